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

"""Readout from cells to joints: duty factors, polynomials, retiming and waveform readouts.

The waveform readout is for smooth cells (the delayed network): x is the cell over the gait's peak,
y its derivative by phase. For relaxation oscillators see phase_readout.
"""

from collections.abc import Callable
import math
from typing import Any, NamedTuple

from cpg_ros.common.errors import CpgError, InputError
from cpg_ros.dynamics.orbit import Orbit
from cpg_ros.motion.core import TABLE_SIZE
import numpy as np

# The duty factor: how much of a stride a leg stands, whatever its network does.

#: MIN_DUTY, MAX_DUTY: smallest and largest duty factor that can be set.
MIN_DUTY, MAX_DUTY = 0.3, 0.9


def retimed_phase(phase, k, centre, own):
    """Return the phase at which joints are read, and its first and second derivative by phase.

    All are in cycles; k = 1 is the identity.
    """
    angle = math.pi * (phase - centre)
    s, c = math.sin(angle), math.cos(angle)
    size = c * c + k * k * s * s
    return (own + math.atan2(k * s, c) / math.pi, k / size,
            2.0 * math.pi * k * (1.0 - k * k) * s * c / (size * size))


def at_even_phases(wave: np.ndarray, points: int) -> tuple[np.ndarray, np.ndarray]:
    """Return a map (k, centre, own) at even phases of a cycle, and its slope."""
    rows = [retimed_phase(n / points, *wave)[:2] for n in range(points)]
    phase, steep = np.array(rows).T
    return phase, steep


def stance(values: np.ndarray, crest: float) -> float:
    """Return the fraction of a cycle that a signal falls from its crest to its trough.

    Args:
        values: on even points of a cycle, shape (m,).
        crest: phase of the crest, cycles.

    """
    low = int(values.argmin())
    before, here, after = (float(values[(low + n) % values.size]) for n in (-1, 0, 1))
    bend = before - 2.0 * here + after
    trough = (low + (0.5 * (before - after) / bend if bend > 0.0 else 0.0)) / values.size
    return (trough - crest) % 1.0


class Duty:
    """Duty factors of legs, and the maps of phase that produce them.

    Attributes:
        fractions: of the stride that each leg stands, shape (legs,).

    """

    def __init__(self, orbit: Orbit, leg_cells: np.ndarray, begin: np.ndarray, own: np.ndarray,
                 fractions: np.ndarray) -> None:
        """Compute the map of each leg.

        Args:
            orbit: the gait.
            leg_cells: cell that gives each leg's phase, from 0, shape (legs,).
            begin: phase of that cell at the leg's touchdown, cycles, shape (legs,).
            own: duty factors of the cells, shape (legs,).
            fractions: wanted duty factors, shape (legs,).

        Raises:
            InputError: a fraction is not from MIN_DUTY to MAX_DUTY.

        """
        for fraction in fractions[fractions != own]:
            if not MIN_DUTY <= fraction <= MAX_DUTY:
                raise InputError(f'duty {fraction:g} is not from {MIN_DUTY:g} to {MAX_DUTY:g}')
        self.fractions = fractions
        self._phases, self._leg_cells = orbit.phases, leg_cells
        k = np.tan(0.5 * math.pi * own) / np.tan(0.5 * math.pi * fractions)
        self._maps = np.stack([np.where(fractions == own, 1.0, k), begin + 0.5 * fractions,
                               begin + 0.5 * own], axis=1)

    def of_cells(self, legs: np.ndarray, cells: np.ndarray) -> np.ndarray:
        """Return k, centre and own for cells by their own phases, shape (n, 3).

        Args:
            legs: leg of each cell, shape (n,).
            cells: from 0, shape (n,).

        """
        maps = self._maps[legs].copy()
        maps[:, 1:] += (self._phases[cells] - self._phases[self._leg_cells[legs]])[:, None]
        return maps


# The polynomial by which a joint follows its cell: its weights, its value and its rate.

TWO_PI = 2.0 * math.pi


class DrivenJoints(NamedTuple):
    """Cells of joints and legs.

    Attributes:
        cells: cell of each joint, from 0, shape (joints,).
        weights: readout weights of each joint, rad, shape (joints, 6).
        leg_cells: cell that gives each leg's phase, from 0, shape (legs,).

    """

    cells: np.ndarray
    weights: np.ndarray
    leg_cells: np.ndarray

    def fields(self) -> dict[str, Any]:
        """Return the fields of the core, see core.CGait."""
        return {'joints': self.cells.size, 'joint_cell': self.cells, 'weights': self.weights,
                'legs': self.leg_cells.size, 'leg_cell': self.leg_cells}


def monomials(x: np.ndarray, y: np.ndarray, z: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Evaluate x, y, x^2, x y, x^3, x^2 y and their derivatives by phase in cycles.

    Args:
        x: readout signal, any shape.
        y: derivative by phase in radians.
        z: second derivative.

    Returns:
        Two arrays of shape (6, ...).

    """
    values = np.stack([x, y, x * x, x * y, x**3, x * x * y])
    slopes = TWO_PI * np.stack([y, z, 2 * x * y, y * y + x * z, 3 * x * x * y,
                              2 * x * y * y + x * x * z])
    return values, slopes


def over_cycle(weights: np.ndarray, signals: Callable[[int, np.ndarray], tuple[np.ndarray, ...]],
               maps: np.ndarray | None, points: int) -> tuple[np.ndarray, np.ndarray]:
    """Tabulate joints over a cycle.

    Args:
        weights: of the readouts, rad, shape (joints, 6).
        signals: (joint, phases of its cell in cycles, (m,)) -> x, y and the derivative of y.
        maps: map of the phase of each joint's cell by the duty factor, shape (joints, 3), see
            motion.duty, or None.
        points: m, number of even points.

    Returns:
        Angles, rad, and derivatives by phase, rad per cycle, shape (joints, m).

    """
    angles, rises = np.empty((2, len(weights), points))
    for joint, row in enumerate(weights):
        phase, steep = np.arange(points) / points, np.ones(points)
        if maps is not None and maps[joint, 0] != 1.0:
            phase, steep = at_even_phases(maps[joint], points)
        values, slopes = monomials(*signals(joint, phase))
        angles[joint], rises[joint] = row @ values, steep * (row @ slopes)
    return angles, rises


# Joints that follow a waveform at another time than their cells do, by the phase.

#: Entries of the tables over one cycle.
POINTS = 512


class Waveform(NamedTuple):
    """Waveform of a gait's cells.

    Attributes:
        peak: largest value of a cell on the orbit.
        period: of the orbit, model time.
        phases: of each cell in the gait, cycles, shape (cells,).
        values: over the peak, at even phases, shape (m,).
        phase_offset: phase minus angle, both in cycles, at even angles, shape (m,).

    """

    peak: float
    period: float
    phases: np.ndarray
    values: np.ndarray
    phase_offset: np.ndarray


class Retiming(NamedTuple):
    """Tables by which joints follow a waveform at another phase than that of their cells.

    Attributes:
        phase_offset: phase minus angle of the orbit at even angles, cycles, and slope per entry,
            shape (m, 2).
        cycle: x and y of the orbit at even phases, each with its slope per entry, shape (m, 4).
        maps: k, centre and own of each joint, shape (joints, 3), see motion.duty.

    """

    phase_offset: np.ndarray
    cycle: np.ndarray
    maps: np.ndarray


def tables(orbit: Orbit) -> tuple[np.ndarray, np.ndarray]:
    """Return phase_offset and cycle of a Retiming; the waveform must determine its phase."""
    grid = np.arange(POINTS) / POINTS

    def unit(theta: np.ndarray) -> tuple[np.ndarray, ...]:
        return tuple(orbit.waveform(theta, n) / (TWO_PI**n * orbit.peak) for n in range(3))

    x, y, z = unit(grid)
    cycle = np.stack([x, y * TWO_PI / POINTS, y, z * TWO_PI / POINTS], axis=1)
    angle = np.unwrap(np.arctan2(-y, x)) / TWO_PI
    angle -= np.round(angle[0])
    # Phases at even angles, by Newton's method from what lies between the entries.
    theta = np.interp(grid, np.append(angle, angle[0] + 1.0), np.append(grid, 1.0))
    for _ in range(4):
        x, y, z = unit(theta)
        gap = (np.arctan2(-y, x) / TWO_PI - grid + 0.5) % 1.0 - 0.5
        slope = (y * y - x * z) / (x * x + y * y)
        theta = theta - gap / slope
    x, y, z = unit(theta)
    faster = (x * x + y * y) / (y * y - x * z)
    return np.stack([theta - grid, (faster - 1.0) / POINTS], axis=1), cycle


class NoPhase(CpgError):
    """A waveform does not determine its phase, so it cannot drive joints."""


def phase_offsets(x: np.ndarray, y: np.ndarray) -> np.ndarray:
    """Tabulate phase minus angle over the angle, for a closed curve sampled evenly in phase.

    Args:
        x: normalised state, shape (m,), from phase 0 where it peaks.
        y: derivative by phase in radians, shape (m,). The angle is atan2(-y, x).

    Raises:
        NoPhase: the angle is not monotonic, so that it does not determine the phase.

    """
    phase = np.arange(x.size + 1) / x.size
    angle = np.unwrap(np.arctan2(-np.append(y, y[0]), np.append(x, x[0]))) / TWO_PI
    angle -= angle[0]
    if not (np.diff(angle) > 0.0).all() or abs(angle[-1] - 1.0) > 1e-9:
        raise NoPhase('the waveform has more than one hump a cycle')
    grid = np.arange(TABLE_SIZE) / TABLE_SIZE
    return np.interp(grid, angle, phase) - grid


class WaveReadout:
    """Joints that follow the cells' waveform.

    Attributes:
        start: phase of the first leg at the orbit's phase 0, cycles.
        angles, rises: of the joints over a cycle, rad and rad per cycle, shape (joints, m).
        wave: of the gait.
        joints: cells of joints and legs.
        retiming: by the duty factor, or None.

    """

    def __init__(self, orbit: Orbit, cells: np.ndarray, weights: np.ndarray,
                 leg_cells: np.ndarray, maps: np.ndarray | None = None) -> None:
        """Prepare for an orbit.

        Args:
            orbit: the gait.
            cells: cell of each joint, from 0, shape (joints,).
            weights: rad, shape (joints, 6).
            leg_cells: cell that gives each leg's phase, shape (legs,).
            maps: map of the phase of each joint's cell by the duty factor, shape (joints, 3), see
                motion.duty, or None.

        Raises:
            NoPhase: the waveform does not determine the phase.

        """
        theta = np.arange(TABLE_SIZE) / TABLE_SIZE
        x = orbit.waveform(theta) / orbit.peak
        y = orbit.waveform(theta, 1) / (TWO_PI * orbit.peak)
        z = orbit.waveform(theta, 2) / (TWO_PI**2 * orbit.peak)
        self.wave = Waveform(orbit.peak, orbit.period, orbit.phases, x, phase_offsets(x, y))
        self.joints = DrivenJoints(cells, weights, leg_cells)
        self.start = float(orbit.phases[leg_cells[0]])
        self.retiming = None
        if maps is None or (maps[:, 0] == 1.0).all():
            values, slopes = monomials(x, y, z)
            self.angles, self.rises = weights @ values, weights @ slopes
            return
        self.retiming = Retiming(*tables(orbit), maps)
        self.angles, self.rises = over_cycle(weights, lambda _, phase: tuple(
            orbit.waveform(phase, n) / (TWO_PI**n * orbit.peak) for n in range(3)),
                                              maps, TABLE_SIZE)

    def fields(self) -> dict[str, Any]:
        """Return the fields by which the core reads joints and legs, see core.CGait."""
        wave, joints, retiming = self.wave, self.joints, self.retiming
        offset, cycle, maps = (None,) * 3 if retiming is None else retiming
        return {'peak': wave.peak, 'period': wave.period, 'phase': wave.phases,
                'cells': wave.phases.size, 'values': wave.values,
                'phase_offset': wave.phase_offset,
                'phase_offset_slope': offset, 'cycle': cycle, 'maps': maps, **joints.fields()}


def extremes(values: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return minimum and maximum of each periodic row on even points, by parabolas."""
    return -_highest(-values), _highest(values)


def _highest(values: np.ndarray) -> np.ndarray:
    top = values.argmax(axis=1)
    rows = np.arange(len(values))
    before, here, after = (values[rows, (top + k) % values.shape[1]] for k in (-1, 0, 1))
    bend = 2.0 * here - before - after
    return here + np.divide((after - before)**2, 8.0 * bend, out=np.zeros_like(here),
                            where=bend > 0.0)
