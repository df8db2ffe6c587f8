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

"""Limit cycles on which simulations settle, of a free network or one locked to a symmetry."""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
import math
import warnings

from cpg_ros.common.errors import ShortRepr
from cpg_ros.dynamics.arclength import NoOrbit
from cpg_ros.dynamics.equilibrium import equilibrium, Quotient
from cpg_ros.dynamics.integration.c_kernel import LANES
from cpg_ros.dynamics.integration.simulate import History, simulate, Trajectory
from cpg_ros.dynamics.isotypic import everywhere, waves_of
from cpg_ros.dynamics.orbit import Path, signal_symmetry
from cpg_ros.networks.equations import Field
from cpg_ros.networks.network import Network
from cpg_ros.networks.symmetry import Symmetry
import numpy as np

#: Of a simulation, model time.
SPAN, SAMPLE_PERIOD = 500.0, 0.1
#: Step over the network's real-time step; more exact than adaptive methods with their usual
#: tolerances (benchmarks/bench_optimize.py).
STEP_RATIO = 2.5
#: Standard deviation of the start's disturbance, which breaks all symmetry.
DISTURBANCE = 0.05
#: Number of cycles that are averaged; points of a cycle.
NUM_CYCLES, POINTS = 3, 256
#: Range of the first variable below which nothing oscillates.
MIN_RANGE = 0.05
#: Distance of a state from its return, over the range of the states; that of a return after
#: several cycles, over that after one, where the cycles differ.
RETURN_TOLERANCE, MULTIPLE_CYCLE_RATIO = 0.1, 0.01


@dataclass(frozen=True, eq=False, repr=False)
class LimitCycle(ShortRepr):
    """Final cycle of a simulation.

    Attributes:
        run: the simulation.
        begin: time of cell 1's last peak but one, model time.
        period: in model time.
        signals: mean of the last cycles at even points, shape (POINTS, components).
        drift: largest difference between states whole periods apart, over the range of the states;
            infinite for fewer than three states.

    """

    run: Trajectory
    begin: float
    period: float
    signals: np.ndarray
    drift: float

    def __call__(self, theta: np.ndarray) -> np.ndarray:
        """Return states at times in cycles after that peak, 0 to 1, shape (m, components)."""
        return self.run(self.begin + theta * self.period)


def start_states(networks: Sequence[Network], gait: str, seed: int) -> np.ndarray:
    """Start every network near the gait's pattern on a typical cycle, with the same disturbance.

    Only attracting gaits persist. A second waveform starts smaller than the first and at a random
    phase.

    Returns:
        States, shape (networks, components).

    """
    rng = np.random.default_rng(seed)
    sizes, offsets = np.array([1.0, rng.uniform(0.4, 1.0)]), np.array([0.0, rng.uniform()])
    disturbance = DISTURBANCE * rng.standard_normal(networks[0].components)
    states = []
    for network in networks:
        symmetry = network.symmetry(gait)
        angle = 2.0 * np.pi * (symmetry.phases + offsets[symmetry.waves])
        size = sizes[symmetry.waves]
        states.append(np.concatenate([
            middle + half * size * np.cos(angle - 2.0 * np.pi * late)
            for middle, half, late in network.typical_cycle]))
    return np.array(states) + disturbance


def population_run(networks: Sequence[Network], starts: np.ndarray) -> Trajectory:
    """Simulate networks from one start each, in one batch on all cores."""
    step = STEP_RATIO * networks[0].step
    return simulate(networks, starts, SPAN, step, every=max(1, round(SAMPLE_PERIOD / step)),
                    progress=False, quiet=True)


def last_cycle(run: Trajectory, cells: int, first: int | None = None, least: float = MIN_RANGE
               ) -> LimitCycle | None:
    """Find a simulation's cycle; None if it rests, diverges or does not repeat.

    A cycle begins where the cell with the largest range crosses its middle upwards, at a similar
    state of the whole network.

    Args:
        run: simulation.
        cells: number of cells.
        first: step after which the simulation repeats; by default its middle.
        least: range of the first variable below which nothing oscillates.

    """
    half = run.t.size // 2 if first is None else first
    span = np.ptp(run.x[half:, :cells], axis=0)
    if not np.isfinite(run.x[-1]).all() or not span.max() >= least:
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
    # Each variable has a unit of its own.
    size = np.ptp(run.x[half:], axis=0).reshape(-1, cells).max(axis=1).repeat(cells)
    states = states / np.where(size > 0.0, size, 1.0)
    gaps = np.abs(states[:-1] - states[-1]).max(axis=1)
    if gaps.min() > RETURN_TOLERANCE:
        return None
    back = np.flatnonzero(gaps <= max(0.2 * RETURN_TOLERANCE, 1.5 * gaps.min()))[-1]
    if gaps[back] > CYCLE_TOLERANCE and gaps.min() < MULTIPLE_CYCLE_RATIO * gaps[back]:
        # Only every second cycle is the same after a period doubling.
        back = np.flatnonzero(gaps <= max(MULTIPLE_CYCLE_RATIO * gaps[back], 1.5 * gaps.min()))[-1]
    period = float(high[-1] - high[back])
    same = states[::back - len(gaps)]
    drift = float(np.abs(same - same[0]).max()) if len(same) > 2 else np.inf
    cycles = min(NUM_CYCLES, int(high[-1] / period))
    times = high[-1] + period * (np.arange(cycles * POINTS) / POINTS - cycles)
    signals = run(times).reshape(cycles, POINTS, -1).mean(axis=0)
    # An orbit begins where cell 1 peaks. The crossings lie in the second half of the run, so two
    # periods fit in before the last one.
    begin = high[-1] + period * (signals[:, 0].argmax() / POINTS - 2.0)
    return LimitCycle(run, float(begin), period, signals, drift)


#: Of a simulation that is locked to a gait; gain in 1/model time.
SETTLING_PERIODS, LOCK_GAIN = 30, 1.0
#: Starts of a gait without a known one: waves about the equilibrium, and random states in the
#: gait's class with this standard deviation; all over the size of a variable at the equilibrium
#: if that is above 1.
WAVE_SIZES, NUM_RANDOM, RANDOM_DEVIATION = (0.5, 0.1, 2.0), 12, 0.3
#: Numbers of steps after which starts are checked, and further ones on request.
CHECK_STEPS, LATE_CHECK_STEPS = (3125, 6250, 12_500, 25_000), (50_000, 100_000)
#: Factor of the step without a delay; with one, delays before the first check, and the factor of
#: the step that these may need.
UNDELAYED_STEP_RATIO, MIN_DELAYS, MAX_STEP_RATIO = 2.0, 8.0, 4.0
#: Rates below which a network rests, over those at first; relative difference up to which cycles
#: repeat.
REST_TOLERANCE, CYCLE_TOLERANCE = 1e-9, 1e-3
#: Ratio of a network's natural unit to 1 from which starts take it.
MIN_UNIT_RATIO = 30.0
#: Range of the first variable, over that of the whole run, below which a locked network does not
#: oscillate.
MIN_RANGE_RATIO = 1e-3
#: Relative error of the gait's shifts, and that up to which there is a further symmetry.
SHIFT_TOLERANCE, SYMMETRY_TOLERANCE = 0.05, 0.01


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


def settle(network: Network, symmetry: Symmetry, start: np.ndarray, period: float
           ) -> LimitCycle | None:
    """Simulate from a state, locked to a symmetry, and return the final cycle.

    Return None if the network comes to rest or does not repeat within three periods.
    """
    step = min(network.step, period / 400.0)
    lock = LOCK_GAIN, symmetry
    history: History = start
    early = 0 if network.delay_parameter else SETTLING_PERIODS // 4
    if early:
        # Most states that reach no gait come to rest soon.
        run = simulate(network, start, early * period, step, lock=lock, progress=False,
                       quiet=True)
        if _ends(run, run.t.size // 2, np.abs(run.slopes).max()):
            return None
        history = run.x[-1]
    rest = SETTLING_PERIODS + 3 - early
    run = simulate(network, history, rest * period, step, lock=lock, progress=False, quiet=True)
    return last_cycle(run, network.cells, int((rest - 3) * period / step), _smallest(run, network))


@dataclass(frozen=True, eq=False, repr=False)
class StiffCycle(ShortRepr):
    """Final cycle of a simulation with steps that adapt, of one cell of each class.

    Attributes:
        run: states of these cells, shape (d, m), over model times, shape (m,).
        begin: time of cell 1's last peak but one, model time.
        period: in model time.
        columns: index among these of each component of the network, shape (components,).
        steps: ends of the steps, cycles after that peak, rising.

    """

    run: Callable[[np.ndarray], np.ndarray]
    begin: float
    period: float
    columns: np.ndarray
    steps: np.ndarray

    def __call__(self, theta: np.ndarray) -> np.ndarray:
        """Return states at times in cycles after that peak, 0 to 1, shape (m, components)."""
        return self.run(self.begin + theta * self.period).T[:, self.columns]


def _stiff_cycle(network: Network, symmetry: Symmetry, start: np.ndarray) -> StiffCycle | None:
    """Simulate a network without a delay in a gait's class, with any steps it needs."""
    # Import here, as it takes long to load.
    from scipy.integrate import solve_ivp
    cell = Quotient(network, symmetry.classes)
    span = LATE_CHECK_STEPS[-1] * UNDELAYED_STEP_RATIO * network.step
    with np.errstate(all='ignore'), warnings.catch_warnings():
        # LSODA warns where it gives up.
        warnings.simplefilter('ignore')
        run = solve_ivp(lambda _, x: cell.rates(x), (0.0, span), start[cell.kept], method='LSODA',
                        jac=lambda _, x: cell.linearised(x)[1], dense_output=True, rtol=1e-8,
                        atol=1e-9 * np.abs(start).max())
    late = run.t > 0.5 * span
    if run.status or not np.isfinite(run.y).all() or not late.any():
        return None
    size = np.ptp(run.y[:, late], axis=1)
    first = run.y[int(size[:cell.size].argmax())]
    middle = 0.5 * (first[late].max() + first[late].min())
    risen = np.flatnonzero(late[:-1] & (first[:-1] < middle) & (first[1:] >= middle))
    states = run.y[:, risen] / np.where(size > 0.0, size, 1.0)[:, None]
    gaps = np.abs(states[:, :-1] - states[:, -1:]).max(axis=0, initial=0.0)
    if not gaps.size or gaps.min() > RETURN_TOLERANCE:
        return None
    last = np.flatnonzero(gaps <= max(0.2 * RETURN_TOLERANCE, 1.5 * gaps.min()))[-1]
    end, period = run.t[risen[-1]], run.t[risen[-1]] - run.t[risen[last]]
    cycle = (run.t >= end - 2.0 * period) & (run.t <= end - period)
    begin = run.t[cycle][run.y[0, cycle].argmax()]
    steps = (run.t - begin) / period
    return StiffCycle(run.sol, float(begin), float(period), cell.columns,
                      steps[(steps >= 0.0) & (steps <= 1.0)])


def _smallest(run: Trajectory, network: Network) -> float:
    """Return the range of the first variable below which a run does not oscillate."""
    return float(MIN_RANGE_RATIO * np.ptp(run.x[:, :network.cells]))


def _ends(run: Trajectory, first: int, rates: float) -> bool:
    """Return whether the network rests after a step, compared with some rates, or has diverged."""
    return bool(not np.isfinite(run.x[-1]).all()
                or np.abs(run.slopes[first:]).max() <= REST_TOLERANCE * rates)


def starts(network: Network, symmetry: Symmetry, random: int = NUM_RANDOM) -> np.ndarray:
    """Start states for a gait: waves with its phases, then random states of its class."""
    variables = np.arange(network.variables)[:, None]
    angle = 2.0 * np.pi * symmetry.phases - 0.5 * np.pi * variables
    waves = np.multiply.outer(WAVE_SIZES, np.cos(angle).ravel())
    scattered = RANDOM_DEVIATION * np.random.default_rng(0).standard_normal(
        (random, network.components))
    # Random states within the class, with the same standard deviation.
    inside = scattered[:, :len(symmetry.basis)] @ symmetry.basis
    inside *= np.sqrt(network.components / len(symmetry.basis))
    rest = equilibrium(network)
    states = everywhere(network, rest)
    # A variable in mV swings by more than 1.
    unit = natural_unit(network, rest) or np.maximum(1.0, np.abs(states))
    return states + unit * np.concatenate([waves, inside])


def natural_unit(network: Network, rest: np.ndarray) -> float | None:
    """Return the size of a variable at which rates bend, where it is far from 1; else None.

    At this size terms of second or third order about an equilibrium equal linear ones.
    """
    linear, *higher = (Field(network).terms(everywhere(network, rest), order)
                       for order in (1, 2, 3))
    sizes = [float(np.abs(linear[v, last] / value).min())**(1.0 / order)
             for order, terms in enumerate(higher, 1) for (v, *_, last), value in terms.items()
             if np.all(value) and np.all(linear.get((v, last), 0.0))]
    unit = min(sizes, default=1.0)
    return None if 1.0 / MIN_UNIT_RATIO < unit < MIN_UNIT_RATIO else unit


def find_orbit(network: Network, gait: str, random: int = NUM_RANDOM,
               longer: Callable[[], bool] = lambda: True
               ) -> Iterator[tuple[Symmetry, Path, float]]:
    """Yield the cycles of a gait on which the network settles in the gait's class.

    Args:
        network: parameters.
        gait: one of its gaits.
        random: number of random states, besides the waves.
        longer: continue runs that have not settled, as slow relaxation oscillations need.

    Yields:
        The gait's symmetry or that of its wave in the other direction, states over cycles, and
            the period in model time.

    Raises:
        NoEquilibrium: the starts would lie about it.
        NoOrbit: simulations from all of the first starts run away.

    """
    directions = waves_of(network, gait)
    symmetry = directions[0]
    step = network.step * (1.0 if network.delay_parameter else UNDELAYED_STEP_RATIO)
    # Within the first steps there are a few periods, which a delay may make long.
    slow = max(1.0, MIN_DELAYS * network.delay / (CHECK_STEPS[0] * step))
    step *= min(slow, MAX_STEP_RATIO)
    longest = math.ceil(slow / MAX_STEP_RATIO)
    for group in np.array_split(starts(network, symmetry, random),
                                (len(WAVE_SIZES) + random) // LANES):
        histories: list[History] = list(group)
        before, rates = 0, 0.0
        for steps in (longest * count for count in CHECK_STEPS + LATE_CHECK_STEPS):
            last = longest * CHECK_STEPS[-1]
            if not histories or (before == last and not longer()):
                break
            batch = simulate(network, histories, (steps - before) * step, step,
                             lock=(LOCK_GAIN, symmetry), progress=False, quiet=True)
            if not (before or np.isfinite(batch.x[:, -1]).any()):
                stiff = None if network.delay_parameter else _stiff_cycle(network, symmetry,
                                                                          group[0])
                if stiff is not None:
                    yield from ((each, stiff, stiff.period) for each in directions
                                if _fits(stiff, each))
                    return
                raise NoOrbit(f'no {gait} was found: simulations with steps of {step:g} model '
                              'time run away from all starts; a stiff network needs a shorter '
                              "'step'")
            rates = rates or float(np.nanmax(np.abs(batch.slopes[:, 0])))
            histories = []
            for x, slopes in zip(batch.x, batch.slopes, strict=True):
                run = Trajectory(batch.t, x, slopes)
                first = steps * 3 // 4 - before
                cycle = last_cycle(run, network.cells, first, _smallest(run, network))
                settled = _ends(run, first, rates) or (cycle is not None
                                                       and cycle.drift <= CYCLE_TOLERANCE)
                if not settled:
                    histories.append(_Past(run))
                if (settled or steps >= last) and cycle is not None:
                    yield from ((each, cycle, cycle.period) for each in directions
                                if _fits(cycle, each))
            before = steps


def _fits(path: Path, symmetry: Symmetry) -> bool:
    """Return whether a cycle has the symmetry of a gait, and no more."""
    count = 24 * symmetry.order
    x = path(np.arange(count) / count)[:, :symmetry.group.cells]
    gap = np.abs(x[:, symmetry.permutation] - np.roll(x, -24, axis=0)).max()
    return bool(gap < SHIFT_TOLERANCE * np.ptp(x)) and not signal_symmetry(
        symmetry, x, SYMMETRY_TOLERANCE)
