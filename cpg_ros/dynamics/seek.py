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

"""Gaits sought by letting the network run, held in the gait's symmetry, until it repeats."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass

from cpg_ros.dynamics.equilibrium import equilibrium
from cpg_ros.dynamics.periodic import added_symmetry
from cpg_ros.integration.simulate import History, LANES, simulate, Trajectory
from cpg_ros.networks.network import Network
from cpg_ros.networks.symmetry import Symmetry
import numpy as np

#: Periods the network gets to find its gait, held by a lock of this gain (1/model time).
SETTLING, HOLD = 30, 1.0
#: Where no start is known, gaits are sought from waves about the equilibrium of these sizes, and
#: from so many states in the gait's class at random about it, this far in the mean. Variables that
#: are beyond 1 at the equilibrium are taken over what they are there.
SIZES, RANDOM, SCATTER = (0.5, 0.1, 2.0), 12, 0.3
#: After how many steps it is looked whether a start has settled, twice as many each time, the
#: last of them only where that is asked for; how many are taken at once where there is no delay.
LOOKED, LONGER, COARSER = (3125, 6250, 12_500, 25_000), (50_000, 100_000), 2.0
#: Rates below which a network rests, 1/model time, and what its cycles differ by at most, over
#: their size, where they repeat: neither changes any more.
RESTING, REPEATING = 1e-9, 1e-3
#: How well what the network settles on has to repeat the gait's shifts, over its range, and from
#: where on it has a further symmetry.
KEPT, ADDED = 0.05, 0.01
#: States over times in cycles, from a peak of cell 1 on.
Path = Callable[[np.ndarray], np.ndarray]


@dataclass(frozen=True)
class LimitCycle:
    """What a simulation repeats.

    Attributes:
        path: states over times in cycles, from a peak of cell 1 on.
        period: model time.
        drift: difference between the first and the last state that should be one, over the size.

    """

    path: Path
    period: float
    drift: float


class _Past:
    """States of a trajectory up to its end, at its nodes, as a history."""

    def __init__(self, run: Trajectory) -> None:
        self._run = run

    def _nodes(self, times: np.ndarray) -> np.ndarray:
        return np.maximum(np.rint(times / self._run.t[1]).astype(int) - 1, -len(self._run.t))

    def __call__(self, times: np.ndarray) -> np.ndarray:
        return self._run.x[self._nodes(times)]

    def derivative(self, times: np.ndarray) -> np.ndarray:
        return self._run.slopes[self._nodes(times)]


def settle(network: Network, symmetry: Symmetry, start: np.ndarray, period: float,
           hold: float = HOLD) -> tuple[Path, float] | None:
    """Let the network run from a state and find its period: (states over cycles, period).

    None where it comes to rest or repeats nothing within three of the given periods.
    """
    step = min(network.step, period / 400.0)
    lock = (hold, symmetry) if hold else None
    history: History = start
    early = 0 if network.delay_parameter else SETTLING // 4
    if early:
        # Most states from which no gait is reached come to rest soon.
        run = simulate(network, start, early * period, step, lock=lock, progress=False)
        if _ends(run, run.t.size // 2):
            return None
        history = run.x[-1]
    rest = SETTLING + 3 - early
    run = simulate(network, history, rest * period, step, lock=lock, progress=False)
    found = _cycle(run, int((rest - 3) * period / step))
    return None if found is None else (found.path, found.period)


def _ends(run: Trajectory, first: int) -> bool:
    """Whether the network rests from a step on, or has left all bounds."""
    return not np.isfinite(run.x[-1]).all() or bool(np.abs(run.slopes[first:]).max() < RESTING)


def _cycle(run: Trajectory, first: int) -> LimitCycle | None:
    """Find what a simulation repeats from a step on."""
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
    # Of a cycle with several peaks alike, those that are one and the same point.
    same = peaks[::1 + close[0]]
    share = run.slopes[same, 0] / (run.slopes[same, 0] - run.slopes[same + 1, 0])
    states = run(run.t[same] + share * run.t[1])
    drift = float(np.abs(states - states[0]).max() / size) if len(same) > 2 else np.inf
    return LimitCycle(lambda theta: run(begin + theta * found), found, drift)


def starts(network: Network, symmetry: Symmetry, random: int = RANDOM) -> np.ndarray:
    """States that the gait is sought from: waves with its phases, then any of its class."""
    variables = np.arange(network.variables)[:, None]
    turn = 2.0 * np.pi * symmetry.phases - 0.5 * np.pi * variables
    waves = np.multiply.outer(SIZES, np.cos(turn).ravel())
    scattered = SCATTER * np.random.default_rng(0).standard_normal((random, network.components))
    # On the class, of any length there: fewer numbers, each as large.
    inside = scattered[:, :len(symmetry.basis)] @ symmetry.basis
    inside *= np.sqrt(network.components / len(symmetry.basis))
    rest = np.repeat(equilibrium(network), network.cells)
    # A variable in mV swings by more than 1.
    return rest + np.maximum(1.0, np.abs(rest)) * np.concatenate([waves, inside])


def find_orbit(network: Network, gait: str, random: int = RANDOM,
               longer: Callable[[], bool] = lambda: True) -> Iterator[tuple[Path, float]]:
    """Yield what the network settles on in the gait's class, where it has the gait's symmetry.

    Args:
        network: parameters.
        gait: one of its gaits.
        random: number of states at random, besides the waves.
        longer: whether to wait longer for starts that have not settled, as slow relaxation
            oscillations need it.

    Yields:
        States over cycles, and the period in model time.

    """
    symmetry = network.symmetry(gait)
    step = network.step * (1.0 if network.delay_parameter else COARSER)
    # As many at a time as advance together.
    for some in np.array_split(starts(network, symmetry, random), (len(SIZES) + random) // LANES):
        histories: list[History] = list(some)
        before = 0
        for steps in LOOKED + LONGER:
            if not histories or (before == LOOKED[-1] and not longer()):
                break
            batch = simulate(network, histories, (steps - before) * step, step,
                             lock=(HOLD, symmetry), progress=False)
            histories = []
            for x, slopes in zip(batch.x, batch.slopes, strict=True):
                run = Trajectory(batch.t, x, slopes)
                first = steps * 3 // 4 - before
                found = _cycle(run, first)
                settled = _ends(run, first) or (found is not None and found.drift <= REPEATING)
                if not settled:
                    histories.append(_Past(run))
                if ((settled or steps >= LOOKED[-1]) and found is not None
                        and _fits(found.path, symmetry)):
                    yield found.path, found.period
            before = steps


def _fits(path: Path, symmetry: Symmetry) -> bool:
    """Whether a cycle has the symmetry of a gait, and no more."""
    count = 24 * symmetry.order
    x = path(np.arange(count) / count)[:, :symmetry.group.cells]
    gap = np.abs(x[:, symmetry.turn] - np.roll(x, -24, axis=0)).max()
    return bool(gap < KEPT * np.ptp(x)) and not added_symmetry(symmetry, x, ADDED)
