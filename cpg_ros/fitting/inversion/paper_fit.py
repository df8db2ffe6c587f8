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

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache

from cpg_ros.common.errors import InputError, ShortRepr
from cpg_ros.dynamics.arclength import NoOrbit
from cpg_ros.dynamics.orbit import Orbit
from cpg_ros.dynamics.solve_orbit import solve_orbit
from cpg_ros.fitting.gaits.stride import Stride
from cpg_ros.fitting.inversion.free_parameters import (
    free_numbers,
    Minimisation,
    minimise,
    with_values,
)
from cpg_ros.motion.robot import Robot
from cpg_ros.networks.library.delayed import CELLS, Delayed
from cpg_ros.networks.network import Network
import numpy as np
from scipy.optimize import minimize_scalar

#: TOLERANCE: relative change of parameters and objective at which the method stops.
TOLERANCE = 1e-12


@dataclass(frozen=True, eq=False, repr=False)
class CycleFit(ShortRepr):
    """A fit to a cycle.

    Attributes:
        orbit: at the fitted parameters.
        values: of the fitted parameters, shape (parameters,).
        cost: objective there, half the sum of squares.
        gradient: of the objective by the parameters, shape (parameters,).
        errors: fitted minus recorded, shape (samples, cells).
        trial: the minimisation, iteration by iteration.

    """

    orbit: Orbit
    values: np.ndarray
    cost: float
    gradient: np.ndarray
    errors: np.ndarray
    trial: Minimisation


def cycle_samples(orbit: Orbit, theta: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Sample an orbit's cells over the cycle, with derivatives by the network's parameters.

    Args:
        orbit: a gait; cell 1 peaks at theta = 0.
        theta: times in cycles, shape (samples,).

    Returns:
        States (samples, cells), and their derivatives (samples, cells, parameters).

    """
    cycles = np.asarray(theta, dtype=float)[:, None] + orbit.phases
    return orbit.waveform(cycles), orbit.d_waveform(cycles)


def fit_cycle(samples: np.ndarray, theta: np.ndarray, start: Delayed, gait: str,
              names: Sequence[str]) -> CycleFit:
    """Fit parameters of the delayed network to one cycle.

    Args:
        samples: of the cells, shape (samples, cells).
        theta: times of the samples, cycles from cell 1's peak, shape (samples,).
        start: initial parameters.
        gait: recorded one.
        names: of the parameters to fit, each within its range; the others keep their values.

    Raises:
        ValueError: shapes do not fit.
        InputError: a value is not finite, a name is unknown or repeated, there are fewer values
            than parameters, or the start is out of a parameter's range.
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
    columns = [start.parameters().index(parameter.name) for parameter in free]
    begin = np.array([parameter.value(start) for parameter in free])
    for parameter, value in zip(free, begin, strict=True):
        if not parameter.low < value < parameter.high:
            raise InputError(f'{parameter.name} {value:g} to start from is not between '
                             f'{parameter.low:g} and {parameter.high:g}')

    # The method evaluates residual and derivative at the same values, one after the other.
    @lru_cache(maxsize=1)
    def orbit_of(values: tuple[float, ...]) -> Orbit:
        return solve_orbit(with_values(start, free, values), gait)

    def orbit_at(values: np.ndarray) -> Orbit:
        return orbit_of(tuple(values.tolist()))

    def evaluate(values: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        states, slopes = cycle_samples(orbit_at(values), theta)
        return (states - samples).ravel(), slopes[..., columns].reshape(-1, len(columns))

    trial = minimise(evaluate, begin, np.array([parameter.low for parameter in free]),
                     np.array([parameter.high for parameter in free]), TOLERANCE)
    if trial.reason:
        raise NoOrbit(trial.reason)
    residual, slopes = evaluate(trial.values)
    return CycleFit(orbit_at(trial.values), trial.values, trial.cost, slopes.T @ residual,
                    residual.reshape(samples.shape), trial)


# A recorded gait inverted as Liu & Zhang (2024) do it: eight joints taken for the eight cells.

#: POINTS: instants of a cycle; NUM_SHIFTS: phases between recording and orbit.
POINTS, NUM_SHIFTS = 20, 60


@dataclass(frozen=True, eq=False, repr=False)
class PaperFit(ShortRepr):
    """A fit from one start.

    Attributes:
        start: initial values of the free parameters.
        fit: result.
        joints: names, in the order of the cells.

    """

    start: dict[str, float]
    fit: CycleFit
    joints: tuple[str, ...]

    @property
    def end(self) -> dict[str, float]:
        """The numerical solution."""
        return dict(zip(self.start, self.fit.values.tolist(), strict=True))

    @property
    def errors(self) -> dict[str, tuple[float, float]]:
        """Range of the synchronisation error of each joint, rad."""
        return {name: (float(column.min()), float(column.max()))
                for name, column in zip(self.joints, self.fit.errors.T, strict=True)}


def refuse_others(robot: Robot | None, network: str) -> None:
    """Refuse robots and networks (by name, '' for the robot's) that are not those of the paper.

    Raises:
        ValueError: the network is another one, or not each of its cells has one joint.

    """
    if (robot is None or Delayed.name not in robot.networks or network not in ('', Delayed.name)
            or sorted(robot.cells) != list(range(CELLS))):
        raise InputError('--paper: the paper has one joint for each of the eight cells of the '
                         f'{Delayed.name} network: a --robot file has to say which, such as goat')


def paper_fits(cycle: Stride, cells: Mapping[str, int], network: Network, gait: str,
               free: Sequence[str], starts: Sequence[Mapping[str, float]] = ({},)
               ) -> list[PaperFit]:
    """Fit parameters to eight joints, once from each start.

    Args:
        cycle: the recording's.
        cells: joint -> its cell, from 1; each cell has one joint.
        network: the other parameters.
        gait: that was recorded.
        free: names of the parameters to fit.
        starts: free parameter -> value to start from; {} starts from the network's own values.

    Raises:
        InputError: another network, a cell with no joint or several, or what fit_cycle cannot
            use.
        NoOrbit: a start has no such gait.

    """
    if not isinstance(network, Delayed):
        raise InputError(f'--paper: the paper has the {Delayed.name} network, not the '
                         f'{network.name}')
    by_cell = sorted(cells, key=lambda name: cells[name])
    if [cells[name] for name in by_cell] != list(range(1, CELLS + 1)):
        raise InputError('the paper takes one joint for each of the eight cells: a robot file '
                         'has to say which, such as the shipped goat')
    rows = [list(cycle.joints).index(name) for name in by_cell]
    theta = np.arange(POINTS) / POINTS
    samples = np.array([np.interp(theta, cycle.theta, cycle.mean[row] - cycle.mean[row].mean(),
                                  period=1.0) for row in rows]).T
    for name in (name for start in starts for name in start):
        if name not in free:
            raise InputError(f"start: '{name}' is not free")
    begins = [replace(network, **start) for start in starts]
    theta = theta + _shift(solve_orbit(begins[0], gait), theta, samples)
    fits = []
    for begin in begins:
        values = begin.as_dict()
        fits.append(PaperFit({name: values[name] for name in free},
                              fit_cycle(samples, theta, begin, gait, free),
                              tuple(by_cell)))
    return fits


def _shift(orbit: Orbit, theta: np.ndarray, samples: np.ndarray) -> float:
    """Return the phase of an orbit, cycles, at which its cells are nearest to samples."""
    def gap(shift: float) -> float:
        return float(np.sum((cycle_samples(orbit, theta + shift)[0] - samples)**2))

    start = min(np.arange(NUM_SHIFTS) / NUM_SHIFTS, key=gap)
    return float(minimize_scalar(gap, method='bounded', options={'xatol': 1e-9},
                                 bounds=(start - 1.0 / NUM_SHIFTS, start + 1.0 / NUM_SHIFTS)).x)
