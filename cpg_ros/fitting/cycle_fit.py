"""Parameters of a network from one recorded cycle, by a trust region and exact derivatives.

The objective is that of Liu & Zhang (2024), section 4: ``f = 1/2 sum_il (xhat_i(t_l) -
x_i(t_l, p))^2`` over the cells i and the samples l of one cycle. Time is normalised to the
cycle, so it is the shape, size and phases of the waveforms that are fitted, not the period.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.optimize import least_squares

from cpg_ros.dynamics import collocation
from cpg_ros.dynamics.delayed_orbit import DelayedOrbit, solve
from cpg_ros.dynamics.periodic import NoOrbit
from cpg_ros.networks.delayed import Delayed

#: Relative change of parameters and objective at which the method stops.
TOLERANCE = 1e-12


@dataclass(frozen=True)
class CycleFit:
    """A fit to a cycle.

    Attributes:
        orbit: of the parameters found.
        values: of the parameters fitted, shape (parameters,).
        cost: the objective there, half the sum of squares.
        gradient: of the objective by the parameters, shape (parameters,).
        evaluations: how many orbits were solved.
        converged: whether a tolerance was met, not only the limit of evaluations.

    """

    orbit: DelayedOrbit
    values: np.ndarray
    cost: float
    gradient: np.ndarray
    evaluations: int
    converged: bool


def cycle_samples(orbit: DelayedOrbit, theta: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Sample an orbit's cells over the cycle, with derivatives by the network's parameters.

    Args:
        orbit: a gait; cell 1 peaks at theta = 0.
        theta: times in cycles, shape (samples,).

    Returns:
        States (samples, cells), and their derivatives (samples, cells, parameters).

    """
    places = np.asarray(theta, dtype=float)[:, None] + orbit.phases
    slopes = np.stack([collocation.evaluate(column, places) for column in orbit.d_values.T], -1)
    return orbit.waveform(places), slopes


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
        ValueError: shapes do not fit, a value is not finite, a name is unknown or given twice,
            there are fewer values than parameters, or the start is out of a parameter's range.
        NoOrbit: the start has no such gait.

    """
    samples, theta = np.asarray(samples, dtype=float), np.asarray(theta, dtype=float)
    if theta.ndim != 1 or samples.shape != (theta.size, start.cells):
        raise ValueError(f'samples have the shape {samples.shape}, theta {theta.shape}; '
                         f'{start.cells} cells need (m, {start.cells}) and (m,)')
    if not (np.isfinite(samples).all() and np.isfinite(theta).all()):
        raise ValueError('samples or theta hold a value that is not finite')
    known = start.parameters()
    if not names or len(set(names)) < len(names) or not set(names) <= set(known):
        raise ValueError(f"names are '{', '.join(names)}'; they must be different ones of "
                         f'{", ".join(known)}')
    if samples.size < len(names):
        raise ValueError(f'{samples.size} values do not determine {len(names)} parameters')
    columns = [known.index(name) for name in names]
    begin = np.array([getattr(start, name) for name in names], dtype=float)
    low, high = np.array([(start.ranges[name].low, start.ranges[name].high) for name in names]).T
    for name, value in zip(names, begin, strict=True):
        if not start.ranges[name].low < value < start.ranges[name].high:
            raise ValueError(f'{name} {value:g} to start from is not between '
                             f'{start.ranges[name].low:g} and {start.ranges[name].high:g}')
    solved: dict[bytes, DelayedOrbit] = {}

    def orbit_at(values: np.ndarray) -> DelayedOrbit:
        key = values.tobytes()
        if key not in solved:
            there = replace(start, **dict(zip(names, values.tolist(), strict=True)))
            solved[key] = solve(there, gait)
        return solved[key]

    def residual(values: np.ndarray) -> np.ndarray:
        try:
            return (cycle_samples(orbit_at(values), theta)[0] - samples).ravel()
        except NoOrbit:
            # The method answers what is not finite with a shorter step.
            return np.full(samples.size, np.nan)

    def jacobian(values: np.ndarray) -> np.ndarray:
        return cycle_samples(orbit_at(values), theta)[1][..., columns].reshape(-1, len(columns))

    orbit_at(begin)
    found = least_squares(residual, begin, jacobian, (low, high), 'trf', x_scale='jac',
                          xtol=TOLERANCE, ftol=TOLERANCE, gtol=TOLERANCE)
    return CycleFit(orbit_at(found.x), found.x, float(found.cost), found.grad, int(found.nfev),
                    found.status > 0)
