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

"""Readout of joints from the phase of cells, for relaxation oscillators.

The potential of a Morris-Lecar cell jumps, and no joint can follow it. A phase and an amplitude
follow the cell as a lock-in amplifier follows a signal: the difference between the cell's two
variables and the gait's orbit at that phase pulls the phase along the first harmonic of the orbit,
and the amplitude across it. The mean pull over a stride is the sine of the phase error.

A joint is a smooth function of that phase: x is a few harmonics of the cell's waveform, y its
derivative by phase in radians, both scaled by ``1 - (1 - a^2)^3`` with the amplitude a, at most 1.
Phase and amplitude have continuous rates, from which the joints' velocities follow.
"""

from functools import lru_cache
from typing import Any, NamedTuple

from cpg_ros.dynamics.orbit import Orbit
from cpg_ros.motion.readout import DrivenJoints, NoPhase, over_cycle, stance, TWO_PI, WaveReadout
import numpy as np

#: POINTS: points of a cycle in the tables of an orbit; a cell may jump within 0.01 cycles.
POINTS = 4096
#: MIN_FRACTION: least fraction of the first harmonic in a waveform's variance for a phase to be
#: read.
MIN_FRACTION = 0.1


class PhaseMap(NamedTuple):
    """An orbit as a function of phase, and the smooth waveform that joints follow.

    Attributes:
        shape: mean and half range of both variables of each wave, shape (waves, 4).
        circles: cosine and sine term of both variables' first harmonic over its mean square, shape
            (waves, 4).
        tables: both variables less their mean over their half range, and slopes per row, over the
            phase, shape (waves, POINTS, 4).
        terms: cosine and sine terms of x, shape (waves, 1 + H, 2).
        crests: phase at which x peaks, shape (waves,).

    """

    shape: np.ndarray
    circles: np.ndarray
    tables: np.ndarray
    terms: np.ndarray
    crests: np.ndarray


class GaitCells(NamedTuple):
    """The cells of a gait.

    Attributes:
        waves: waveform of each cell, from 0, shape (size,).
        phases: of each cell in the gait, cycles, shape (size,).
        maps: map of each cell's phase by the duty factor, shape (size, 3), see motion.duty.
        known: the waveforms.

    """

    waves: np.ndarray
    phases: np.ndarray
    maps: np.ndarray
    known: PhaseMap


def smooth_terms(values: np.ndarray, harmonics: int) -> np.ndarray:
    """Return cosine and sine terms of a waveform's first harmonics, scaled to -1 to 1.

    Lanczos' factors sinc(k / (H + 1)) avoid ringing.

    Args:
        values: on even points of a cycle, shape (m,).
        harmonics: H.

    Returns:
        Terms of shape (1 + H, 2); row 0 is the constant.

    """
    terms = np.fft.rfft(values)[:harmonics + 1] * np.sinc(np.arange(harmonics + 1)
                                                          / (harmonics + 1))
    smooth = np.fft.irfft(terms, values.size)
    middle, half = 0.5 * (smooth.max() + smooth.min()), 0.5 * np.ptp(smooth)
    terms_found = np.stack([terms.real, -terms.imag], axis=1) * (2.0 / values.size / half)
    terms_found[0] = terms_found[0, 0] / 2.0 - middle / half, 0.0
    return terms_found


def evaluate(terms: np.ndarray, theta: np.ndarray, order: int = 0) -> np.ndarray:
    """Return x, or its derivative by phase in radians of order 1 or 2, at phases in cycles."""
    k = np.arange(terms.shape[0])
    complex_terms = (terms[:, 0] - 1j * terms[:, 1]) * (1j * k)**order
    return (np.exp(TWO_PI * 1j * np.multiply.outer(theta, k)) @ complex_terms).real


@lru_cache(maxsize=64)
def phase_map(orbit: Orbit, harmonics: int) -> PhaseMap:
    """Return an orbit's phase map, computed once.

    Raises:
        NoPhase: a waveform has almost no first harmonic.

    """
    count, theta = int(orbit.waves.max()) + 1, np.arange(POINTS) / POINTS
    maps = PhaseMap(np.empty((count, 4)), np.empty((count, 4)), np.empty((count, POINTS, 4)),
                     np.empty((count, 1 + harmonics, 2)), np.empty(count))
    for wave, levels in enumerate(orbit.levels):
        half = levels[:2, 1]
        states, slopes = (np.stack([orbit.waveform(theta, order, wave, variable)
                                    for variable in (0, 1)], axis=1) for order in (0, 1))
        mean = states.mean(axis=0)
        states = (states - mean) / half
        first = 2.0 * np.fft.rfft(states, axis=0)[1] / POINTS
        square = 0.5 * (np.abs(first)**2).sum()
        if square < MIN_FRACTION * (states**2).mean(axis=0).sum():
            raise NoPhase('its waveform repeats within a cycle: the first harmonic, by which its '
                          f'phase is followed, has less than {MIN_FRACTION:.0%} of it')
        maps.shape[wave] = *mean, *half
        maps.circles[wave] = np.stack([first.real, -first.imag], axis=1).ravel() / square
        maps.tables[wave] = np.hstack([states, slopes / half / POINTS])
        maps.terms[wave] = smooth_terms(states[:, 0], harmonics)
        maps.crests[wave] = _crest(maps.terms[wave])
    return maps


class PhaseReadout:
    """Joints that follow the phase of cells, computed from their first two variables.

    Attributes:
        start: phase of the first leg at the orbit's phase 0, cycles.
        gait: cells of the gait.
        joints: cells of joints and legs.
        angles, rises: of the joints over a cycle, rad and rad per cycle, shape (joints, m).

    """

    def __init__(self, orbit: Orbit, cells: np.ndarray, weights: np.ndarray,
                 leg_cells: np.ndarray, harmonics: int, maps: np.ndarray | None = None) -> None:
        """Prepare for an orbit; arguments as of WaveReadout, and the number of harmonics of x.

        All joints of a cell have the same map.

        Raises:
            NoPhase: a waveform has almost no first harmonic.

        """
        gait_maps = phase_map(orbit, harmonics)
        of_cells = np.tile([1.0, 0.0, 0.0], (len(orbit.phases), 1))
        if maps is not None:
            of_cells[cells] = maps
        self.gait = GaitCells(orbit.waves, orbit.phases, of_cells, gait_maps)
        self.joints = DrivenJoints(cells, weights, leg_cells)
        self.start = float((orbit.phases[leg_cells[0]]
                            - gait_maps.crests[orbit.waves[leg_cells[0]]]) % 1.0)
        self.angles, self.rises = over_cycle(weights, lambda joint, phase: tuple(
            evaluate(gait_maps.terms[orbit.waves[cells[joint]]], phase, order)
            for order in range(3)), maps, 512)

    def fields(self) -> dict[str, Any]:
        """Return the fields by which the core reads joints and legs, see core.CGait."""
        waves, phases, maps, phase_maps = self.gait
        mean, half = phase_maps.shape[:, None, :2], phase_maps.shape[:, None, 2:]
        values = mean + half * phase_maps.tables[:, :, :2], half * phase_maps.tables[:, :, 2:]
        return {'by_phase': 1, 'phase': phases, 'cells': phases.size, 'wave': waves,
                'points': POINTS, 'waves': np.stack(values, axis=3).transpose(0, 2, 1, 3),
                'shapes': phase_maps.shape, 'circles': phase_maps.circles,
                'terms': phase_maps.terms,
                'harmonics': phase_maps.terms.shape[1] - 1, 'crests': phase_maps.crests,
                'maps': maps[self.joints.cells], **self.joints.fields()}


def _crest(terms: np.ndarray) -> float:
    """Return the phase at which x is largest, cycles, [0, 1)."""
    grid = np.arange(512) / 512
    crest = float(grid[evaluate(terms, grid).argmax()])
    for _ in range(4):
        slope, bend = (float(evaluate(terms, np.array(crest), order)) for order in (1, 2))
        crest -= float(np.clip(slope / bend / TWO_PI, -1 / 512, 1 / 512)) if bend else 0.0
    return crest % 1.0


# The readout of a network's joints: of the waveform or of the phase, as the network states.

#: PHASES: phases at which troughs are searched for, cycles.
PHASES = np.arange(1024) / 1024


def joint_readout(orbit: Orbit, cells: np.ndarray, weights: np.ndarray, leg_cells: np.ndarray,
                  harmonics: int, maps: np.ndarray | None = None) -> WaveReadout | PhaseReadout:
    """Return the readout of joints and legs from the states of a gait.

    Args:
        orbit: the gait.
        cells: cell of each joint, from 0, shape (joints,).
        weights: rad, shape (joints, 6).
        leg_cells: cell that gives each leg's phase, from 0, shape (legs,).
        harmonics: number of harmonics of a waveform that joints follow by its phase.
        maps: map of the phase of each joint's cell by the duty factor, shape (joints, 3).

    Raises:
        NoPhase: a waveform does not determine the phase.

    """
    if orbit.network.readout == 'waveform':
        return WaveReadout(orbit, cells, weights, leg_cells, maps)
    return PhaseReadout(orbit, cells, weights, leg_cells, harmonics, maps)


def standing(orbit: Orbit, leg_cells: np.ndarray, harmonics: int
             ) -> tuple[np.ndarray, np.ndarray]:
    """Return each leg's own touchdown and duty factor, shape (legs,) each.

    A leg stands while the signal of its cell falls. The touchdown is a phase of the cell, cycles.
    """
    begin, fraction = np.empty((2, len(leg_cells)))
    for leg, cell in enumerate(leg_cells):
        if orbit.network.readout == 'waveform':
            begin[leg], fraction[leg] = 0.0, stance(orbit.waveform(PHASES), 0.0)
            continue
        maps, wave = phase_map(orbit, harmonics), orbit.waves[cell]
        begin[leg] = maps.crests[wave]
        fraction[leg] = stance(evaluate(maps.terms[wave], PHASES), float(begin[leg]))
    return begin, fraction
