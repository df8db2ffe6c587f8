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

"""From cells to joints by the cells' phase: for relaxation oscillators.

A Morris-Lecar cell jumps: its potential crosses most of its range within a few per cent of a
stride, and on the way it may double back so that neither variable gives the phase. No joint can
follow that. Instead every cell is followed as a lock-in amplifier follows a signal: a phase and an
amplitude run with the strides and are drawn to what the cell does, by what its two variables and
the gait's orbit at that phase differ by, along the first harmonic of that orbit and across it. On
the orbit there is no difference and they run evenly; elsewhere the mean pull over a stride is the
sine of the phase error, whatever the waveform.

A joint is a smooth function of that phase: x is the cell's waveform up to a few harmonics, y the
derivative of x by phase in radians, both scaled by ``1 - (1 - a^2)^3``, a the amplitude over the
orbit's, at most 1: a cell that comes to rest moves its joints less. Phase and amplitude change at
rates that are continuous in time, and velocities are made of those rates: they are the
derivatives of the positions whatever the network does, and whatever is done to it.
"""

from functools import lru_cache
import math
from typing import Any, NamedTuple

from cpg_ros.dynamics.integration.compilation import jit_entry, specialised
from cpg_ros.dynamics.integration.simulate import simulate
from cpg_ros.dynamics.integration.stepper import Stepper
from cpg_ros.dynamics.orbit import Orbit
from cpg_ros.motion import readout
from cpg_ros.motion.readout import (
    confine,
    DrivenJoints,
    NoPhase,
    observe,
    over_cycle,
    read_retimed,
    retimed_phase,
    Retiming,
    stance,
    TURN,
    Waveform,
    WaveReadout,
)
from cpg_ros.motion.strides import approach, lengthen, scale
from cpg_ros.networks.registry import find_network
import numpy as np

#: Points of a cycle in the tables of an orbit: a cell may jump within a hundredth of a cycle.
POINTS = 4096
#: Pull of a cell on its phase and amplitude, per stride; over how many strides it is smoothed (so
#: much that they come back as fast as they can without overshoot); and the most it adds to the
#: phase's speed, cycles a stride: joints never run backward.
PULL, SMOOTHING, MOST = 1.0, 0.25, 0.5
#: A cell further away than this many half ranges of its orbit counts as this far.
FURTHEST = 2.0
#: A phase off by a quarter of this (cycles) counts as far off as a half range.
PHASE_SHARE = 4.0
#: Least share of the first harmonic in a waveform's variance, for the phase to be followed.
LEAST_SHARE = 0.1


class PhaseMap(NamedTuple):
    """An orbit as its cells' clocks see it, and the smooth waveform that joints follow.

    Attributes:
        shape: mean and half range of both variables of each wave, shape (waves, 4).
        circles: cosine and sine term of both variables' first harmonic over its mean square,
            shape (waves, 4).
        tables: both variables from their mean over their half range, and their slopes from row
            to row, over the phase, shape (waves, POINTS, 4).
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
        waves: number of each cell's waveform, shape (size,).
        phases: phase of each cell in the gait, cycles, shape (size,).
        maps: what the duty factor makes of each cell's phase, shape (size, 3), see motion.duty.
        known: the waveforms.

    """

    waves: np.ndarray
    phases: np.ndarray
    maps: np.ndarray
    known: PhaseMap


@jit_entry
def observe_phases(now, strides, gait, joints, clocks, angle, d_angle_d_phase, legs):
    """Advance the cells' clocks and read joints and legs off them.

    Args:
        now: x, x', x'' of the components, two or more of each cell, shape (3, ...); only x
            of the first two is used.
        strides: since the last look; with 0 the clocks stand and are only read.
        gait: GaitCells.
        joints: DrivenJoints.
        clocks: of each cell, shape (10, size): phase (cycles), what its speed (cycles a
            stride) is above 1 now and at the next look, amplitude, its rate (per stride)
            now and at the next look; and x, y and their derivatives by the strides.
        angle: filled with the joints' deviation from their offset, rad.
        d_angle_d_phase: filled with its derivative by the strides, rad per stride.
        legs: filled with the legs' phases in cycles, [0, 1), 0 where x peaks.

    Returns:
        The largest distance of a cell from where the gait has it, in half ranges; 0 if the
        clocks stand.

    """
    waves, phases, maps, (shape, circles, tables, harmonics, crests) = gait
    cells, weights, leg_cells = joints
    distance, sum_ = 0.0, 0.0
    pull = PULL / (1.0 + 2.0 * PULL * strides)
    fraction = strides / (SMOOTHING + strides)
    for cell in range(waves.shape[0]):
        wave = waves[cell]
        if strides > 0.0:
            # Both rates are linear in between, so that this is their exact integral.
            phase = clocks[0, cell] + strides * (
                1.0 + 0.5 * (clocks[1, cell] + clocks[2, cell]))
            clocks[0, cell] = phase - math.floor(phase)
            clocks[1, cell] = clocks[2, cell]
            clocks[3, cell] += 0.5 * strides * (clocks[4, cell] + clocks[5, cell])
            clocks[4, cell] = clocks[5, cell]
        phase, amount = clocks[0, cell], clocks[3, cell]
        c1, s1 = math.cos(TURN * phase), math.sin(TURN * phase)
        if strides > 0.0:
            s, table, circle = shape[wave], tables[wave], circles[wave]
            # The comparison keeps NaN from becoming an index.
            place = phase * table.shape[0]
            low = int(place) if place >= 0.0 else 0
            t = place - low
            low = low if low < table.shape[0] else 0
            here, there = table[low], table[low + 1 if low + 1 < table.shape[0] else 0]
            h01 = t * t * (3.0 - 2.0 * t)
            h10, h11 = t * (1.0 - t) * (1.0 - t), t * t * (t - 1.0)
            v = here[0] + h01 * (there[0] - here[0]) + h10 * here[2] + h11 * there[2]
            w = here[1] + h01 * (there[1] - here[1]) + h10 * here[3] + h11 * there[3]
            x = (now[0, cell] - s[0]) / s[2]
            y = (now[0, waves.shape[0] + cell] - s[1]) / s[3]
            off = max(abs(x - v), abs(y - w), abs(amount - 1.0))
            distance = max(distance, off)
            sum_ += x + y
            x = min(max(x, -FURTHEST), FURTHEST) - amount * v
            y = min(max(y, -FURTHEST), FURTHEST) - amount * w
            along = ((circle[0] * c1 + circle[1] * s1) * x
                     + (circle[2] * c1 + circle[3] * s1) * y)
            across = ((circle[1] * c1 - circle[0] * s1) * x
                      + (circle[3] * c1 - circle[2] * s1) * y)
            across = min(max(pull * across / TURN, -MOST), MOST)
            clocks[2, cell] += fraction * (across - clocks[2, cell])
            clocks[5, cell] += fraction * (pull * along - clocks[5, cell])
        steep = 1.0
        if maps[cell, 0] != 1.0:
            phase, steep, _ = retimed_phase(phase, maps[cell, 0], maps[cell, 1], maps[cell, 2])
            c1, s1 = math.cos(TURN * phase), math.sin(TURN * phase)
        terms = harmonics[wave]
        x, y, z = terms[0, 0], 0.0, 0.0
        c, s_ = 1.0, 0.0
        for k in range(1, terms.shape[0]):
            c, s_ = c * c1 - s_ * s1, s_ * c1 + c * s1
            in_phase = terms[k, 0] * c + terms[k, 1] * s_
            quadrature = terms[k, 1] * c - terms[k, 0] * s_
            x += in_phase
            y += k * quadrature
            z -= k * k * in_phase
        speed, scale, rate = steep * TURN * (1.0 + clocks[1, cell]), 1.0, 0.0
        if amount < 1.0:
            rest = (1.0 - amount * amount) if amount > 0.0 else 1.0
            scale = 1.0 - rest * rest * rest
            rate = 6.0 * max(amount, 0.0) * rest * rest * clocks[4, cell]
        clocks[6, cell], clocks[7, cell] = scale * x, scale * y
        clocks[8, cell] = scale * y * speed + rate * x
        clocks[9, cell] = scale * z * speed + rate * y
    base = clocks[0, leg_cells[0]] - phases[leg_cells[0]]
    if strides > 0.0:
        for cell in range(waves.shape[0]):
            late = clocks[0, cell] - base - phases[cell]
            distance = max(distance, PHASE_SHARE * abs(late - math.floor(late + 0.5)))
    for joint in range(cells.shape[0]):
        cell = cells[joint]
        x, y, dx, dy = clocks[6, cell], clocks[7, cell], clocks[8, cell], clocks[9, cell]
        angle[joint] = readout.value(weights[joint], x, y)
        d_angle_d_phase[joint] = readout.rate(weights[joint], x, y, dx, dy)
    for leg in range(leg_cells.shape[0]):
        phase = clocks[0, leg_cells[leg]] - crests[waves[leg_cells[leg]]]
        phase -= math.floor(phase)
        legs[leg] = phase if phase < 1.0 else 0.0
    # max may lose a NaN; the sum keeps it.
    return distance + 0.0 * sum_


def smooth_terms(values: np.ndarray, harmonics: int) -> np.ndarray:
    """Cosine and sine terms of a waveform's first harmonics, running from -1 to 1.

    Lanczos' factors sinc(k / (H + 1)) keep the sum from ringing.

    Args:
        values: on even points of a cycle, shape (m,).
        harmonics: H.

    Returns:
        An array of shape (1 + H, 2); row 0 is the constant.

    """
    terms = np.fft.rfft(values)[:harmonics + 1] * np.sinc(np.arange(harmonics + 1)
                                                          / (harmonics + 1))
    smooth = np.fft.irfft(terms, values.size)
    middle, half = 0.5 * (smooth.max() + smooth.min()), 0.5 * np.ptp(smooth)
    found = np.stack([terms.real, -terms.imag], axis=1) * (2.0 / values.size / half)
    found[0] = found[0, 0] / 2.0 - middle / half, 0.0
    return found


def evaluate(terms: np.ndarray, theta: np.ndarray, order: int = 0) -> np.ndarray:
    """x, or its derivative by phase in radians of order 1 or 2, at phases in cycles."""
    k = np.arange(terms.shape[0])
    complex_terms = (terms[:, 0] - 1j * terms[:, 1]) * (1j * k)**order
    return (np.exp(TURN * 1j * np.multiply.outer(theta, k)) @ complex_terms).real


@lru_cache(maxsize=64)
def phase_map(orbit: Orbit, harmonics: int) -> PhaseMap:
    """Return an orbit's phase map, made once.

    Raises:
        NoPhase: a waveform has hardly any first harmonic.

    """
    count, theta = int(orbit.waves.max()) + 1, np.arange(POINTS) / POINTS
    known = PhaseMap(np.empty((count, 4)), np.empty((count, 4)), np.empty((count, POINTS, 4)),
                     np.empty((count, 1 + harmonics, 2)), np.empty(count))
    for wave, levels in enumerate(orbit.levels):
        half = levels[:2, 1]
        states, slopes = (np.stack([orbit.waveform(theta, order, wave, variable)
                                    for variable in (0, 1)], axis=1) for order in (0, 1))
        mean = states.mean(axis=0)
        states = (states - mean) / half
        first = 2.0 * np.fft.rfft(states, axis=0)[1] / POINTS
        square = 0.5 * (np.abs(first)**2).sum()
        if square < LEAST_SHARE * (states**2).mean(axis=0).sum():
            raise NoPhase('its waveform repeats within a cycle: the first harmonic, by which its '
                          f'phase is followed, has less than {LEAST_SHARE:.0%} of it')
        known.shape[wave] = *mean, *half
        known.circles[wave] = np.stack([first.real, -first.imag], axis=1).ravel() / square
        known.tables[wave] = np.hstack([states, slopes / half / POINTS])
        known.terms[wave] = smooth_terms(states[:, 0], harmonics)
        known.crests[wave] = _crest(known.terms[wave])
    return known


class PhaseReadout:
    """Joints driven by the phase of cells, which follows from their first two variables.

    Attributes:
        start: phase of the first leg at the orbit's phase 0, cycles.
        gait: the cells of the gait.
        joints: the cells behind joints and legs.
        angles, rises: of the joints over a cycle, rad and rad per cycle, shape (joints, m).

    """

    def __init__(self, orbit: Orbit, cells: np.ndarray, weights: np.ndarray,
                 leg_cells: np.ndarray, harmonics: int, maps: np.ndarray | None = None) -> None:
        """Prepare for an orbit; arguments as in WaveReadout, and how many harmonics x has.

        Maps are of the joints, as there; those of a cell have one.

        Raises:
            NoPhase: a waveform has hardly any first harmonic.

        """
        known = phase_map(orbit, harmonics)
        of_cells = np.tile([1.0, 0.0, 0.0], (len(orbit.phases), 1))
        if maps is not None:
            of_cells[cells] = maps
        self.gait = GaitCells(orbit.waves, orbit.phases, of_cells, known)
        self.joints = DrivenJoints(cells, weights, leg_cells)
        self._observe: Any = None
        self.start = float((orbit.phases[leg_cells[0]]
                            - known.crests[orbit.waves[leg_cells[0]]]) % 1.0)
        self.angles, self.rises = over_cycle(weights, lambda joint, phase: tuple(
            evaluate(known.terms[orbit.waves[cells[joint]]], phase, order)
            for order in range(3)), maps, 512)

    def clocks(self, phase: float) -> np.ndarray:
        """Return the cells' clocks where the gait has them at a phase of its orbit in cycles."""
        phases = self.gait.phases
        clocks = np.zeros((10, phases.size))
        clocks[0], clocks[3] = (phase + phases) % 1.0, 1.0
        return clocks

    def look(self, now: np.ndarray, strides: float, clocks: np.ndarray, angle: np.ndarray,
             d_angle_d_phase: np.ndarray, legs: np.ndarray) -> float:
        """Advance clocks by some strides to a state and read joints and legs.

        See observe_phases; arrays are C-contiguous and of float64.
        """
        arguments = now, strides, self.gait, self.joints, clocks, angle, d_angle_d_phase, legs
        if self._observe is None:
            self._observe = specialised(observe_phases, *arguments)
        return self._observe(*arguments)


def _crest(terms: np.ndarray) -> float:
    """Phase at which x is largest, cycles, [0, 1)."""
    grid = np.arange(512) / 512
    place = float(grid[evaluate(terms, grid).argmax()])
    for _ in range(4):
        slope, bend = (float(evaluate(terms, np.array(place), order)) for order in (1, 2))
        place -= float(np.clip(slope / bend / TURN, -1 / 512, 1 / 512)) if bend else 0.0
    return place % 1.0


# The readout of a network's joints: of the waveform or of the phase, as the network states.

#: Phases at which troughs are looked for, cycles.
GRID = np.arange(1024) / 1024


def joint_readout(orbit: Orbit, cells: np.ndarray, weights: np.ndarray, leg_cells: np.ndarray,
                  harmonics: int, maps: np.ndarray | None = None) -> WaveReadout | PhaseReadout:
    """Return what reads joints and legs off the states of a gait.

    Args:
        orbit: the gait.
        cells: the cell behind each joint, from 0, shape (joints,).
        weights: in rad, shape (joints, 6).
        leg_cells: the cell that gives each leg's phase, from 0, shape (legs,).
        harmonics: of a waveform that joints follow by its phase.
        maps: what the duty factor makes of the phase of each joint's cell, shape (joints, 3).

    Raises:
        NoPhase: the phase does not follow from a waveform.

    """
    if orbit.network.readout == 'waveform':
        return WaveReadout(orbit, cells, weights, leg_cells, maps)
    return PhaseReadout(orbit, cells, weights, leg_cells, harmonics, maps)


def standing(orbit: Orbit, leg_cells: np.ndarray, harmonics: int
             ) -> tuple[np.ndarray, np.ndarray]:
    """Return when each leg begins to stand by itself, and for which share of the stride.

    A leg stands while the signal of its cell falls. Phases are those of the cell, cycles; two
    arrays of shape (legs,).
    """
    begin, fraction = np.empty((2, len(leg_cells)))
    for leg, cell in enumerate(leg_cells):
        if orbit.network.readout == 'waveform':
            begin[leg], fraction[leg] = 0.0, stance(orbit.waveform(GRID), 0.0)
            continue
        known, wave = phase_map(orbit, harmonics), orbit.waves[cell]
        begin[leg] = known.crests[wave]
        fraction[leg] = stance(evaluate(known.terms[wave], GRID), float(begin[leg]))
    return begin, fraction


def precompile(name: str) -> None:
    """Run each kernel that a network needs once, on the types the generator uses.

    Args:
        name: as find_network takes it, and errors as of that.

    """
    preset = next(iter(find_network(name).presets().values()))
    network = preset.network
    stepper = Stepper(network, np.zeros(network.components), gain=1.0,
                      symmetry=network.symmetry(preset.gait))
    stepper.advance(2.0 * network.step)
    some, table, cells = np.zeros(1), np.zeros(4), np.zeros(1, dtype=int)
    joints, one = DrivenJoints(cells, np.zeros((1, 6)), cells), np.ones((1, 3))
    if network.readout == 'waveform':
        wave = Waveform(1.0, 1.0, np.zeros(8), table, table)
        observe(stepper.now, wave, joints, some, some, some)
        read_retimed(stepper.now, wave, joints, Retiming(np.zeros((4, 2)), np.ones((4, 4)), one),
                     some, some)
    else:
        simulate(network, np.zeros(network.components), network.step, network.step)
        known = PhaseMap(np.ones((1, 4)), np.ones((1, 4)), np.ones((1, 4, 4)),
                         np.zeros((1, 2, 2)), some)
        observe_phases(stepper.now, 1.0, GaitCells(cells, np.zeros(1), one, known), joints,
                       np.zeros((10, 1)), some, some, some)
    confine(some, some, np.zeros((3, 1)), 1.0, some, some, np.zeros(1, dtype=bool))
    approach(some, some, 0.1, some, some)
    lengthen(some, cells, some, np.zeros((4, 1)))
    scale(1.0, 1.0, some, cells, some, np.zeros((4, 1)), some, some)
