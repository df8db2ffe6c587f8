# Copyright 2026 cpg_ros maintainers
#
# Licensed under the Apache License, Version 2.0 (the "License");
# you may not use this file except in compliance with the License.
# You may obtain a copy of the License at
#
#     http://www.apache.org/licenses/LICENSE-2.0
#
# Unless required by applicable law or agreed to in writing, software
# distributed under the License is distributed on an "AS IS" BASIS,
# WITHOUT WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied.
# See the License for the specific language governing permissions and
# limitations under the License.

"""Parameters of a network from one recorded cycle, by a trust region and exact derivatives.

The objective is that of Liu & Zhang (2024), section 4: ``f = 1/2 sum_il (xhat_i(t_l) -
x_i(t_l, p))^2`` over the cells i and the samples l of one cycle. Time is normalised to the
cycle, so it is the shape, size and phases of the waveforms that are fitted, not the period.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache

from cpg_ros.dynamics.orbit import Orbit, solve_orbit
from cpg_ros.dynamics.periodic import NoOrbit
from cpg_ros.errors import InputError
from cpg_ros.inversion.free_parameters import free_numbers, with_values
from cpg_ros.inversion.trust_region import Minimisation, minimise
from cpg_ros.networks.delayed import Delayed
from cpg_ros.short_repr import ShortRepr
import numpy as np

#: Relative change of parameters and objective at which the method stops.
TOLERANCE = 1e-12


@dataclass(frozen=True, eq=False, repr=False)
class CycleFit(ShortRepr):
    """A fit to a cycle.

    Attributes:
        orbit: of the parameters found.
        values: of the parameters fitted, shape (parameters,).
        cost: the objective there, half the sum of squares.
        gradient: of the objective by the parameters, shape (parameters,).
        errors: fitted minus recorded, shape (samples, cells).
        trial: how it went, iteration by iteration.

    """

    orbit: Orbit
    values: np.ndarray
    cost: float
    gradient: np.ndarray
    errors: np.ndarray
    trial: Minimisation

    @property
    def evaluations(self) -> int:
        """How many orbits were solved for."""
        return self.trial.evaluations

    @property
    def converged(self) -> bool:
        """Whether a tolerance was met, not only the limit of evaluations."""
        return self.trial.converged


def cycle_samples(orbit: Orbit, theta: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Sample an orbit's cells over the cycle, with derivatives by the network's parameters.

    Args:
        orbit: a gait; cell 1 peaks at theta = 0.
        theta: times in cycles, shape (samples,).

    Returns:
        States (samples, cells), and their derivatives (samples, cells, parameters).

    """
    places = np.asarray(theta, dtype=float)[:, None] + orbit.phases
    return orbit.waveform(places), orbit.d_waveform(places)


def fit_cycle(samples: np.ndarray, theta: np.ndarray, start: Delayed, gait: str,
              names: Sequence[str]) -> CycleFit:
    """Fit parameters of the delayed network to one cycle.

    Args:
        samples: of the cells, shape (samples, cells).
        theta: when they were taken, in cycles from where cell 1 peaks, shape (samples,).
        start: parameters to start from.
        gait: that was recorded.
        names: of the parameters to fit, each within its range; the others keep their values.

    Raises:
        ValueError: shapes do not fit.
        InputError: a value is not finite, a name is unknown or given twice, there are fewer
            values than parameters, or the start is out of a parameter's range.
        NoOrbit: the start has no such gait.

    """
    samples, theta = np.asarray(samples, dtype=float), np.asarray(theta, dtype=float)
    if theta.ndim != 1 or samples.shape != (theta.size, start.cells):
        raise ValueError(f'samples have the shape {samples.shape}, theta {theta.shape}; '
                         f'{start.cells} cells need (m, {start.cells}) and (m,)')
    if not (np.isfinite(samples).all() and np.isfinite(theta).all()):
        raise InputError('samples or theta hold a value that is not finite')
    free = free_numbers(start, gait, names)
    if samples.size < len(free):
        raise InputError(f'{samples.size} values do not determine {len(free)} parameters')
    columns = [start.parameters().index(one.name) for one in free]
    begin = np.array([one.value(start) for one in free])
    for one, value in zip(free, begin, strict=True):
        if not one.low < value < one.high:
            raise InputError(f'{one.name} {value:g} to start from is not between {one.low:g} '
                             f'and {one.high:g}')

    # The method evaluates residual and derivative at the same values, one after the other.
    @lru_cache(maxsize=1)
    def solved(values: tuple[float, ...]) -> Orbit:
        return solve_orbit(with_values(start, free, values), gait)

    def orbit_at(values: np.ndarray) -> Orbit:
        return solved(tuple(values.tolist()))

    def evaluate(values: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        states, slopes = cycle_samples(orbit_at(values), theta)
        return (states - samples).ravel(), slopes[..., columns].reshape(-1, len(columns))

    trial = minimise(evaluate, begin, np.array([one.low for one in free]),
                     np.array([one.high for one in free]), TOLERANCE)
    if trial.why:
        raise NoOrbit(trial.why)
    left, slopes = evaluate(trial.values)
    return CycleFit(orbit_at(trial.values), trial.values, trial.cost, slopes.T @ left,
                    left.reshape(samples.shape), trial)
