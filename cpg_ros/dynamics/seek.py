"""Gaits sought by letting the network run, held in the gait's symmetry, until it repeats."""

from collections.abc import Callable, Iterator

import numpy as np

from cpg_ros.dynamics.equilibrium import equilibrium
from cpg_ros.integration.simulate import Trajectory, simulate
from cpg_ros.networks.network import Network
from cpg_ros.networks.symmetry import Symmetry

#: Periods the network gets to find its gait, held by a lock of this gain (1/model time).
SETTLING, HOLD = 30, 1.0
#: Waves about the equilibrium that a gait is sought from, where no start is known, and for how
#: many steps of the network.
SIZES, SOUGHT = (0.5, 0.1, 2.0), 20_000
#: States over times in cycles, from a peak of cell 1 on.
Path = Callable[[np.ndarray], np.ndarray]


def settled(network: Network, symmetry: Symmetry, start: np.ndarray, period: float,
            hold: float = HOLD) -> tuple[Path, float] | None:
    """Let the network run from a state and find its period: (states over cycles, period).

    None where it comes to rest or repeats nothing within three of the given periods.
    """
    step = min(network.step, period / 400.0)
    lock = (hold, symmetry) if hold else None
    run = simulate(network, start, (SETTLING + 3) * period, step, lock=lock, progress=False)
    return _cycle(run, int(SETTLING * period / step))


def _cycle(run: Trajectory, first: int) -> tuple[Path, float] | None:
    """Find what a simulation repeats from a step on, from a peak of cell 1: states and period."""
    v, rise = run.x[first:, 0], run.slopes[first:, 0]
    if not np.isfinite(run.x[-1]).all() or np.ptp(v) < 1e-3:
        return None
    peaks = first + np.flatnonzero((rise[:-1] > 0.0) & (rise[1:] <= 0.0))
    peaks = peaks[run.x[peaks, 0] > v.max() - 0.02 * np.ptp(v)]
    if peaks.size < 2:
        return None
    size = np.ptp(run.x[first:], axis=0).max()
    gaps = np.abs(run.x[peaks[1:]] - run.x[peaks[0]]).max(axis=1) / size
    close = np.flatnonzero(gaps < max(0.05, 1.5 * gaps.min()))
    if gaps.min() > 0.2:
        return None
    begin, found = run.t[peaks[0]], float(run.t[peaks[1 + close[0]]] - run.t[peaks[0]])
    return lambda theta: run(begin + theta * found), found


def sought(network: Network, gait: str) -> Iterator[tuple[Path, float]]:
    """Yield what the network settles on from waves of several sizes about its equilibrium.

    Args:
        network: parameters.
        gait: one of its gaits.

    Yields:
        States over cycles, and the period in model time.

    """
    symmetry, variables = network.symmetry(gait), np.arange(network.variables)[:, None]
    turn = 2.0 * np.pi * symmetry.phases - 0.5 * np.pi * variables
    rest = np.repeat(equilibrium(network), network.cells)
    for size in SIZES:
        run = simulate(network, rest + size * np.cos(turn).ravel(), SOUGHT * network.step,
                       network.step, lock=(HOLD, symmetry), progress=False)
        found = _cycle(run, SOUGHT // 2)
        if found is not None:
            yield found
