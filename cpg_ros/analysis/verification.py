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

"""The verification of a parameter set: its exact orbit, its multipliers, and runs with noise."""

from dataclasses import dataclass

from cpg_ros.analysis.objectives import phase_errors, Score, waveform_shortfall
from cpg_ros.common.errors import CpgError, ShortRepr
from cpg_ros.dynamics.arclength import NoOrbit
from cpg_ros.dynamics.floquet import multipliers
from cpg_ros.dynamics.integration.simulate import simulate, Trajectory
from cpg_ros.dynamics.orbit import Orbit
from cpg_ros.dynamics.settling import ALIVE, COARSE_STEPS, KEPT_FRACTION, last_cycle
from cpg_ros.dynamics.solve_orbit import solve_preset
from cpg_ros.fitting.gaits.recognition import shape_difference
from cpg_ros.networks.network import Preset
from cpg_ros.networks.symmetry import Symmetry
import numpy as np

#: NOISE: intensity of noise that a gait survives, per square root of model time; DURATION: of the
#: runs, model time; RUNS: number of runs, which fit into the vector registers.
NOISE, DURATION, RUNS = 0.01, 500.0, 8
#: PEACE: periods without noise after that; BACK: largest phase error then, degrees.
PEACE, BACK = 30, 1.0
#: LOST: phase error, degrees, averaged over CYCLES cycles under noise, at which a gait is left.
LOST, CYCLES = 60.0, 4
#: POINTS: points of a cycle; DIGITS: digits of the start and period of a preset.
POINTS, DIGITS = 1024, 10


class NotVerified(CpgError):
    """A parameter set fails the verification; the message says why."""


@dataclass(frozen=True, eq=False, repr=False)
class VerifiedGait(ShortRepr):
    """A parameter set with its exact orbit.

    Attributes:
        preset: gait, parameters, a state on the orbit and its period, rounded.
        orbit: solved for from that preset.
        errors: phase errors at the end of the search's simulation, degrees.
        leading: its leading Floquet multiplier.
        differences: in shape of its two waveforms, strictly and plainly (see shape_difference);
            0 for a gait with one.

    """

    preset: Preset
    orbit: Orbit
    errors: np.ndarray
    leading: float
    differences: tuple[float, float]


def orbit_signals(orbit: Orbit, points: int = POINTS) -> np.ndarray:
    """Return the states on even points of an orbit's cycle, shape (points, components)."""
    return orbit(np.arange(points) / points * orbit.period)


def exact_preset(preset: Preset) -> tuple[Preset, Orbit]:
    """Move a preset's start onto its exact orbit, to where cell 1 peaks.

    Returns:
        The preset with start and period rounded, and the orbit that is found from them.

    Raises:
        NoOrbit: it has no such orbit.

    """
    orbit = solve_preset(preset)
    start = orbit(np.array(0.0)).round(DIGITS)
    rounded = Preset(preset.gait, preset.network, tuple(start.tolist()),
                     round(orbit.period, DIGITS))
    return rounded, solve_preset(rounded)


def survives(orbit: Orbit, seed: int = 0) -> bool:
    """Return whether a gait survives noise without a lock, started from its orbit."""
    network, symmetry = orbit.network, orbit.symmetry
    starts = np.repeat(orbit(np.zeros(1)), RUNS, axis=0)
    step = COARSE_STEPS * network.step
    every = max(1, round(KEPT_FRACTION / step))
    noisy = simulate(network, starts, DURATION, step, noise=NOISE, seed=seed, every=every,
                     progress=False)
    window = round(CYCLES * orbit.period / (step * every))
    windows = noisy.x[:, :(noisy.t.size - 1) // window * window].reshape(
        RUNS, -1, window, network.components)
    if not all(_holds(window_states, symmetry) for run in windows for window_states in run):
        return False
    calm = simulate(network, noisy.x[:, -1], PEACE * orbit.period, step, every=every,
                    progress=False)
    for x, slopes in zip(calm.x, calm.slopes, strict=True):
        cycle = last_cycle(Trajectory(calm.t, x, slopes), network.cells)
        if (cycle is None or abs(cycle.period / orbit.period - 1.0) > 0.01
                or phase_errors(cycle.signals, symmetry).max() > BACK
                or waveform_shortfall(cycle.signals, symmetry) > 0.0):
            return False
    return True


def _holds(signals: np.ndarray, symmetry: Symmetry) -> bool:
    """Return whether the cells are alive and in phase on the mean of a few noisy cycles."""
    alive = np.ptp(signals[:, :symmetry.group.cells], axis=0).min() >= ALIVE
    return bool(alive and phase_errors(_folded(signals), symmetry).max() <= LOST)


def _folded(signals: np.ndarray) -> np.ndarray:
    """Return the mean over the cycles of a window, shape (window // CYCLES, components)."""
    points = signals.shape[0] // CYCLES
    return signals[:points * CYCLES].reshape(CYCLES, points, -1).mean(axis=0)


def polish(score: Score, gait: str, seed: int = 0) -> VerifiedGait:
    """Solve for the orbit of a set and verify it.

    Args:
        score: of the set.
        gait: that it must have.
        seed: of the noise.

    Raises:
        NotVerified: it has no stable orbit of the gait, its waveforms miss their requirements, or
            it does not survive noise.

    """
    if not score.exact:
        raise NotVerified('its orbit was not found')
    try:
        preset, orbit = exact_preset(Preset(gait, score.network, score.state, score.period))
    except NoOrbit as error:
        raise NotVerified(str(error)) from error
    spectrum = multipliers(orbit)
    leading = spectrum.leading
    if not spectrum.attracts:
        raise NotVerified(f'its orbit is not stable, with a leading multiplier of {leading:.3f}')
    signals = orbit_signals(orbit)
    if waveform_shortfall(signals, orbit.symmetry) > 0.0:
        raise NotVerified('a waveform is too small, turns too unsteadily or is too like the other')
    first, differences = orbit.symmetry.first, (0.0, 0.0)
    if len(first) == 2:
        a, b = (signals[:, cell] for cell in first)
        differences = shape_difference(a, b), shape_difference(a, b, plain=True)
    if not survives(orbit, seed):
        raise NotVerified(f'noise of {NOISE} drives it off its gait')
    return VerifiedGait(preset, orbit, score.errors, leading, differences)
