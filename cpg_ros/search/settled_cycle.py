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

"""The settled cycles of networks, many of which are simulated at once."""

from collections.abc import Sequence
from dataclasses import dataclass

from cpg_ros.integration.simulate import simulate, Trajectory
from cpg_ros.networks.network import Network
from cpg_ros.short_repr import ShortRepr
import numpy as np

#: Model time that every set is simulated for, and between the states that are kept.
SPAN, KEPT = 500.0, 0.1
#: Steps of the network's real-time step at once: still more exact than adaptive methods with
#: their usual tolerances (benchmarks/bench_optimize.py).
COARSER = 2.5
#: Of every component at the start, which breaks all symmetry.
DISTURBANCE = 0.05
#: Cycles that are averaged, and points of one.
AVERAGED, POINTS = 3, 256
#: Below this range of the first variable nothing oscillates.
ALIVE = 0.05
#: A state has come back when it is this near, over the range of the states.
RETURNED = 0.1


@dataclass(frozen=True, eq=False, repr=False)
class SettledCycle(ShortRepr):
    """The cycle in which a network settles, from a simulation.

    Attributes:
        run: the simulation.
        begin: where cell 1 peaks for the last time but one, model time.
        period: in model time.
        signals: mean of the last cycles on even points, shape (POINTS, components).

    """

    run: Trajectory
    begin: float
    period: float
    signals: np.ndarray

    def __call__(self, theta: np.ndarray) -> np.ndarray:
        """States at times in cycles from such a peak on, 0 to 1, shape (m, components)."""
        return self.run(self.begin + theta * self.period)


def start_states(networks: Sequence[Network], gait: str, seed: int) -> np.ndarray:
    """Start every network near the gait's pattern on a typical cycle, all disturbed alike.

    So only a gait that attracts is found. A second waveform starts smaller than the first one
    and anywhere in its cycle.

    Returns:
        States, shape (networks, components).

    """
    rng = np.random.default_rng(seed)
    sizes, offsets = np.array([1.0, rng.uniform(0.4, 1.0)]), np.array([0.0, rng.uniform()])
    disturbance = DISTURBANCE * rng.standard_normal(networks[0].components)
    found = []
    for network in networks:
        symmetry = network.symmetry(gait)
        turn = 2.0 * np.pi * (symmetry.phases + offsets[symmetry.waves])
        size = sizes[symmetry.waves]
        found.append(np.concatenate([
            middle + half * size * np.cos(turn - 2.0 * np.pi * late)
            for middle, half, late in network.typical_cycle]))
    return np.array(found) + disturbance


def population_run(networks: Sequence[Network], starts: np.ndarray) -> Trajectory:
    """Simulate networks from a start each, all at once, on all cores."""
    step = COARSER * networks[0].step
    return simulate(networks, starts, SPAN, step, every=max(1, round(KEPT / step)),
                    progress=False)


def last_cycle(run: Trajectory, cells: int) -> SettledCycle | None:
    """Find a simulation's cycle; None where it rests, runs away or does not repeat.

    Cycles begin where the liveliest cell crosses its middle upwards, which it does fast; of
    several such crossings in a cycle the whole state tells which belong together.
    """
    half = run.t.size // 2
    span = np.ptp(run.x[half:, :cells], axis=0)
    if not span.max() >= ALIVE:
        return None
    cell = int(span.argmax())
    v = run.x[half:, cell]
    middle = 0.5 * (v.max() + v.min())
    before = np.flatnonzero((v[:-1] < middle) & (v[1:] >= middle))
    if before.size < 2:
        return None
    low, high = run.t[half + before], run.t[half + before + 1]
    for _ in range(30):
        between = 0.5 * (low + high)
        under = run(between)[:, cell] < middle
        low, high = np.where(under, between, low), np.where(under, high, between)
    states = run(high)
    gaps = np.abs(states[:-1] - states[-1]).max(axis=1) / np.ptp(run.x[half:], axis=0).max()
    if gaps.min() > RETURNED:
        return None
    back = np.flatnonzero(gaps <= max(0.2 * RETURNED, 1.5 * gaps.min()))[-1]
    period = float(high[-1] - high[back])
    cycles = min(AVERAGED, int(high[-1] / period))
    times = high[-1] + period * (np.arange(cycles * POINTS) / POINTS - cycles)
    signals = run(times).reshape(cycles, POINTS, -1).mean(axis=0)
    # An orbit begins where cell 1 peaks, and so must the guess at it. The first of the crossings
    # is past the middle of the run, so that two periods fit in before the last one.
    begin = high[-1] + period * (signals[:, 0].argmax() / POINTS - 2.0)
    return SettledCycle(run, float(begin), period, signals)
