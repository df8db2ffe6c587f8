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

"""Basins: the fraction of random states from which a network returns to a gait.

Every variable of every cell is drawn uniformly over twice its range on the orbit, about the middle
of the range; with a delay the history is constant. The final motion of the whole network is
compared with the orbit and with the gaits' symmetries.
"""

from collections import Counter
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, TYPE_CHECKING

from cpg_ros.common.command_line import progress_bar, table
from cpg_ros.common.errors import InputError, ShortRepr
from cpg_ros.dynamics.integration.simulate import simulate, Trajectory
from cpg_ros.dynamics.orbit import Orbit, signal_symmetry
from cpg_ros.dynamics.settling import last_cycle, LimitCycle
from cpg_ros.networks.network import Network
import numpy as np
from scipy.stats import binomtest

if TYPE_CHECKING:
    from cpg_ros.analysis.analysis_report import Analysis

#: Cycles of a run; recorded points of a cycle; runs that advance together.
NUM_CYCLES, POINTS, BATCH_SIZE = 100, 64, 64
#: Range of the random states over the orbit's range.
STATE_RANGE = 2.0
#: Relative differences of equal signals and periods.
SIGNAL_TOLERANCE, PERIOD_TOLERANCE = 0.05, 0.01
#: Relative difference of signals up to which a symmetry holds.
SYMMETRY_TOLERANCE = 0.01
#: Range of the last cycles, over the orbit's, below which a network rests; number of these cycles.
REST_TOLERANCE, REST_CYCLES = 1e-3, 3
#: Ends of runs that are not a gait.
REST, DIVERGENT, UNKNOWN = 'rest', 'runs away', 'unknown'


@dataclass(frozen=True, eq=False, repr=False)
class Basin(ShortRepr):
    """Outcomes of simulations from random states.

    Attributes:
        orbit: of the gait.
        gain: of the symmetry lock, 1/model time.
        states: number of states.
        seed: of the draw.
        returned: number of states that return to the orbit, or to its image under a symmetry.
        others: motion -> number of states that end in it: another gait by name, 'another NAME' for
            another orbit of the same gait, 'rest', 'runs away', or 'unknown' if it has not
            settled.

    """

    orbit: Orbit
    gain: float
    states: int
    seed: int
    returned: int
    others: Mapping[str, int]

    def _summary(self) -> str:
        low, high = self.interval
        return (f'{self.returned} of {self.states} states return to the {self.orbit.gait}, '
                f'{low:.1%} to {high:.1%}')

    @property
    def fraction(self) -> float:
        """Fraction of the states that return."""
        return self.returned / self.states

    @property
    def interval(self) -> tuple[float, float]:
        """Ends of Wilson's 95 % interval of the fraction."""
        bounds = binomtest(self.returned, self.states).proportion_ci(0.95, 'wilson')
        return float(bounds.low), float(bounds.high)


def random_states(orbit: Orbit, count: int, seed: int) -> np.ndarray:
    """Draw states about an orbit, shape (count, components)."""
    levels = orbit.levels[orbit.waves].transpose(1, 0, 2).reshape(-1, 2)
    draws = np.random.default_rng(seed).uniform(-STATE_RANGE, STATE_RANGE,
                                                (count, orbit.network.components))
    return levels[:, 0] + draws * levels[:, 1]


def basin(orbit: Orbit, count: int, seed: int = 0, gain: float = 0.0,
          done: Callable[[int], None] = lambda count: None) -> Basin:
    """Run a network from random states and count the returns to a gait.

    Args:
        orbit: of the gait.
        count: number of states.
        seed: of the draw.
        gain: of a symmetry lock to that gait, 1/model time.
        done: called with the number of finished states.

    Raises:
        InputError: count is not positive.

    """
    if count < 1:
        raise InputError(f'{count} random states: there must be at least 1')
    starts, ends = random_states(orbit, count, seed), Counter[str]()
    network, period = orbit.network, orbit.period
    every = max(1, int(np.ceil(period / network.step / POINTS)))
    for first in range(0, count, BATCH_SIZE):
        done(first)
        batch = simulate(network, starts[first:first + BATCH_SIZE], NUM_CYCLES * period,
                         period / (POINTS * every), every=every, progress=False, quiet=True,
                         lock=(gain, orbit.symmetry) if gain else None)
        ends.update(end_of(Trajectory(batch.t, x, slopes), orbit)
                    for x, slopes in zip(batch.x, batch.slopes, strict=True))
    done(count)
    returned = ends.pop(orbit.gait, 0)
    return Basin(orbit, gain, count, seed, returned, dict(ends.most_common()))


def end_of(run: Trajectory, orbit: Orbit) -> str:
    """Name the final motion of a simulation, as in Basin.

    Args:
        run: of many cycles.
        orbit: of the gait whose name is returned for this orbit.

    """
    network = orbit.network
    if not np.isfinite(run.x[-1]).all():
        return DIVERGENT
    last = run.x[-int(np.ceil(REST_CYCLES * orbit.period / run.t[1])):]
    if np.ptp(last, axis=0).max() < REST_TOLERANCE * 2.0 * orbit.levels[..., 1].max():
        return REST
    cycle = last_cycle(run, network.cells)
    if cycle is None:
        return UNKNOWN
    if abs(cycle.period / orbit.period - 1.0) < PERIOD_TOLERANCE and _is(cycle, orbit):
        return orbit.gait
    gait = _named(cycle, network)
    return f'another {gait}' if gait == orbit.gait else gait


def _is(cycle: LimitCycle, orbit: Orbit) -> bool:
    """Return whether a cycle is an orbit, or its image under a symmetry, from some phase on."""
    points = len(cycle.signals)
    exact = orbit.cycle(points)
    spectrum = np.fft.rfft(cycle.signals - cycle.signals.mean(axis=0), axis=0)
    cells, blocks = orbit.network.cells, np.arange(orbit.network.variables)[:, None]
    for element in orbit.symmetry.group.elements.values():
        image = exact[:, (np.array(element) + blocks * cells).ravel()]
        waves = np.fft.rfft(image - image.mean(axis=0), axis=0).conj()
        late = int(np.fft.irfft((spectrum * waves).sum(axis=1), points).argmax())
        gap = np.abs(cycle.signals - np.roll(image, late, axis=0)).max(axis=0)
        if (gap < SIGNAL_TOLERANCE * np.ptp(exact, axis=0).max()).all():
            return True
    return False


def _named(cycle: LimitCycle, network: Network) -> str:
    """Name the gait whose symmetry a cycle has, and no more; or 'unknown'."""
    signals = cycle.signals[:, :network.cells]
    for gait in network.gaits():
        symmetry = network.symmetry(gait)
        if len(symmetry.group.elements) > 1 and all(
                np.abs(signals[:, list(symmetry.group.elements[name])]
                       - np.roll(signals, -round(float(shift) * len(signals)), axis=0)).max()
                < SYMMETRY_TOLERANCE * np.ptp(signals) for name, shift in symmetry.shifts
                ) and not signal_symmetry(symmetry, signals, SYMMETRY_TOLERANCE):
            return gait
    return UNKNOWN


# The basins that ``analyze --basin N`` reports: as text, and as JSON.

def basins(analysis: 'Analysis', count: int, seed: int) -> dict[str, Basin]:
    """Compute the basin of each gait that attracts, without or else with the default gain."""
    gains = {verdict.gait: 0.0 if verdict.stable else verdict.default_gain
             for verdict in analysis.existing
             if verdict.stable or verdict.stable_with_default_gain}
    by_gait: dict[str, Basin] = {}
    with progress_bar('random states', len(gains) * count) as bar:
        for gait, gain in gains.items():
            def done(states: int, before: int = len(by_gait) * count) -> None:
                bar(before + states)

            by_gait[gait] = basin(analysis.gaits[gait].known_orbit, count, seed, gain, done)
    return by_gait


def text(by_gait: dict[str, Basin]) -> str:
    """Return a table of the basins."""
    if not by_gait:
        return 'Basins: no gait attracts.'
    rows: list[tuple[str, ...]] = [
        ('gait', 'gain', 'return', 'fraction', '95 % interval', 'others')]
    for gait, basin in by_gait.items():
        low, high = basin.interval
        others = ', '.join(f'{name} {number}' for name, number in basin.others.items())
        rows.append((gait, f'{basin.gain:.4f}', str(basin.returned), f'{basin.fraction:.1%}',
                     f'{low:.1%} to {high:.1%}', others or '-'))
    first = next(iter(by_gait.values()))
    return '\n'.join([
        f'Basins: of {first.states} random states each (seed {first.seed}; every variable of '
        'every cell evenly over twice its range on',
        'the orbit, and constant before), those that return to the gait, without a symmetry lock '
        'where it is stable, or else',
        'with the default gain; and what the others do:',
        *(f'  {line}' for line in table(rows, '<>>>><'))])


def as_dict(by_gait: dict[str, Basin]) -> dict[str, Any]:
    """Return the basins in plain types, gait -> basin."""
    return {gait: {'symmetry_gain': basin.gain, 'states': basin.states, 'seed': basin.seed,
                   'returned': basin.returned, 'fraction': basin.fraction,
                   'interval': list(basin.interval), 'others': dict(basin.others)}
            for gait, basin in by_gait.items()}
