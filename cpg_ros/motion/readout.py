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

"""From cells to joints: what a network in its gait means for the legs, compiled.

Here for cells whose waveform drives the joints as it is (the delayed network): x is the cell over
the gait's peak, y its derivative by phase. See phase_readout for those whose phase does.
"""

from collections.abc import Callable
import math
from typing import Any, NamedTuple

from cpg_ros.common.errors import CpgError, InputError
from cpg_ros.dynamics.integration.compilation import inline, jit, jit_entry, specialised
from cpg_ros.dynamics.orbit import Orbit
import numpy as np

# The duty factor: how much of a stride a leg stands, whatever its network does.

#: Smallest and largest duty factor that can be set.
LEAST, MOST = 0.3, 0.9


@jit
def retimed_phase(phase, k, centre, own):
    """Return the phase at which joints are read, and its first and second derivative by the phase.

    All in cycles; with k = 1 nothing changes.
    """
    angle = math.pi * (phase - centre)
    s, c = math.sin(angle), math.cos(angle)
    size = c * c + k * k * s * s
    return (own + math.atan2(k * s, c) / math.pi, k / size,
            2.0 * math.pi * k * (1.0 - k * k) * s * c / (size * size))


def at_even_phases(one: np.ndarray, points: int) -> tuple[np.ndarray, np.ndarray]:
    """Return what a map (k, centre, own) makes of even phases of a cycle, and its slope there."""
    rows = [retimed_phase(n / points, *one)[:2] for n in range(points)]
    phase, steep = np.array(rows).T
    return phase, steep


def stance(values: np.ndarray, crest: float) -> float:
    """Return the share of a cycle that a signal falls from its crest to its trough.

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
    """The duty factors of legs, and the maps of phase that bring them about.

    Attributes:
        fractions: of the stride that each leg stands, shape (legs,).

    """

    def __init__(self, orbit: Orbit, leg_cells: np.ndarray, begin: np.ndarray, own: np.ndarray,
                 fractions: np.ndarray) -> None:
        """Work out the map of each leg.

        Args:
            orbit: the gait.
            leg_cells: the cell that gives each leg's phase, from 0, shape (legs,).
            begin: phase of that cell at which each leg begins to stand, cycles, shape (legs,).
            own: shares that legs stand by themselves, shape (legs,).
            fractions: wanted shares, shape (legs,).

        Raises:
            InputError: a share is not from LEAST to MOST, or not one of a cycle.

        """
        for fraction in fractions[fractions != own]:
            if not LEAST <= fraction <= MOST:
                raise InputError(f'duty {fraction:g} is not from {LEAST:g} to {MOST:g}')
        self.fractions = fractions
        self._phases, self._leg_cells = orbit.phases, leg_cells
        k = np.tan(0.5 * math.pi * own) / np.tan(0.5 * math.pi * fractions)
        self._maps = np.stack([np.where(fractions == own, 1.0, k), begin + 0.5 * fractions,
                               begin + 0.5 * own], axis=1)

    def of_cells(self, legs: np.ndarray, cells: np.ndarray) -> np.ndarray:
        """Return k, centre and own for cells by their own phases, shape (n, 3).

        Args:
            legs: index of the leg that each cell drives, shape (n,).
            cells: from 0, shape (n,).

        """
        found = self._maps[legs].copy()
        found[:, 1:] += (self._phases[cells] - self._phases[self._leg_cells[legs]])[:, None]
        return found


# The polynomial by which a joint follows its cell: its weights, its value and its rate.

TURN = 2.0 * math.pi


class DrivenJoints(NamedTuple):
    """The cells behind joints and legs.

    Attributes:
        cells: the cell behind each joint, from 0, shape (joints,).
        weights: readout weights of each joint, rad, shape (joints, 6).
        leg_cells: the cell that gives each leg's phase, from 0, shape (legs,).

    """

    cells: np.ndarray
    weights: np.ndarray
    leg_cells: np.ndarray


@inline
def value(w, x, y):
    """Return a joint's deviation from its offset, rad; w are its weights."""
    return w[0] * x + w[1] * y + w[2] * x * x + w[3] * x * y + (w[4] * x + w[5] * y) * x * x


@inline
def rate(w, x, y, dx, dy):
    """Return the derivative of a joint's angle from those of x and y, by whatever they are."""
    return ((w[0] + 2.0 * w[2] * x + w[3] * y + 3.0 * w[4] * x * x + 2.0 * w[5] * x * y) * dx
            + (w[1] + w[3] * x + w[5] * x * x) * dy)


def monomials(x: np.ndarray, y: np.ndarray, z: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Evaluate x, y, x^2, x y, x^3, x^2 y and their derivatives by phase in cycles.

    Args:
        x: readout signal, any shape.
        y: its derivative by phase in radians.
        z: its second derivative.

    Returns:
        Two arrays of shape (6, ...).

    """
    values = np.stack([x, y, x * x, x * y, x**3, x * x * y])
    slopes = TURN * np.stack([y, z, 2 * x * y, y * y + x * z, 3 * x * x * y,
                              2 * x * y * y + x * x * z])
    return values, slopes


def over_cycle(weights: np.ndarray, signals: Callable[[int, np.ndarray], tuple[np.ndarray, ...]],
               maps: np.ndarray | None, points: int) -> tuple[np.ndarray, np.ndarray]:
    """Tabulate joints over a cycle.

    Args:
        weights: of the readouts, rad, shape (joints, 6).
        signals: joint and phases of its cell, cycles, (m,) -> x, y and the derivative of y.
        maps: what the duty factor makes of the phase of each joint's cell, shape (joints, 3), see
            motion.duty; None for nothing.
        points: m, even over the cycle.

    Returns:
        Angles, rad, and their derivatives by phase, rad per cycle, shape (joints, m).

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
#: Squares of a size below this are those of a cell at rest, which has no phase.
REST = 1e-12


class Waveform(NamedTuple):
    """The waveform of a gait's cells.

    Attributes:
        peak: largest value of a cell on the orbit.
        period: of the orbit, model time.
        phases: phase of each cell in the gait, cycles, shape (cells,).
        values: over the peak, on even phases of a cycle, shape (m,).
        lead: phase minus angle, both in cycles, on even angles, shape (m,).

    """

    peak: float
    period: float
    phases: np.ndarray
    values: np.ndarray
    lead: np.ndarray


class Retiming(NamedTuple):
    """How joints follow a waveform at another phase than their cells'.

    Attributes:
        lead: of the orbit on even angles: phase minus angle, cycles, and its slope per entry,
            shape (m, 2).
        cycle: of the orbit on even phases: x and its slope per entry, y and its slope, shape
            (m, 4).
        maps: k, centre and own of each joint, shape (joints, 3), see motion.duty.

    """

    lead: np.ndarray
    cycle: np.ndarray
    maps: np.ndarray


@jit
def _hermite(table, column, cycles):
    """Return value and slope per cycle of a periodic table of values and slopes per entry."""
    place = (cycles - math.floor(cycles)) * table.shape[0]
    # A comparison that NaN fails, too: it must not become an index.
    low = int(place) if place >= 0.0 else 0
    t = place - low
    low = low if low < table.shape[0] else 0
    high = low + 1 if low + 1 < table.shape[0] else 0
    a, b = table[low, column], table[high, column]
    da, db = table[low, column + 1], table[high, column + 1]
    gap = b - a
    value = a + t * (da + t * (3.0 * gap - 2.0 * da - db + t * (da + db - 2.0 * gap)))
    slope = da + t * (6.0 * gap - 4.0 * da - 2.0 * db + t * (3.0 * (da + db) - 6.0 * gap))
    return value, slope * table.shape[0]


@jit_entry
def read_retimed(now, wave, joints, retiming, angle, d_angle_d_phase):
    """Read joints off a network's state at the retimed phase.

    Args:
        now: x, x', x'' of the cells, shape (3, cells).
        wave: Waveform of the gait.
        joints: DrivenJoints.
        retiming: Retiming.
        angle: filled with the joints' deviation from their offset, rad.
        d_angle_d_phase: filled with its derivative by phase, rad per cycle.

    """
    peak, by_phase = wave.peak, wave.period / TURN
    lead, cycle, maps = retiming
    last, x, y, dx, dy = -1, 0.0, 0.0, 0.0, 0.0
    for joint in range(joints.cells.shape[0]):
        cell = joints.cells[joint]
        if cell != last:
            last = cell
            x = now[0, cell] / peak
            y = now[1, cell] * by_phase / peak
            z = now[2, cell] * by_phase * by_phase / peak
            square = x * x + y * y
            # Derivatives by the phase that advances evenly, in radians.
            turning = (y * y - x * z) / square if square > REST else 1.0
            growing = y * (x + z) / square if square > REST else 0.0
            turn = math.atan2(-y, x) / TURN
            ahead, slope = _hermite(lead, 0, turn)
            theta, going = turn + ahead, (1.0 + slope) * turning
            own_x, own_y = _hermite(cycle, 0, theta)[0], _hermite(cycle, 2, theta)[0]
            own_z = _hermite(cycle, 2, theta)[1] / TURN
            whole = own_x * own_x + own_y * own_y
            size = math.sqrt(square / whole)
            growing = size * (growing - going * own_y * (own_x + own_z) / whole)
            phase, steep, _ = retimed_phase(theta, maps[joint, 0], maps[joint, 1], maps[joint, 2])
            unit_x, unit_y = _hermite(cycle, 0, phase)[0], _hermite(cycle, 2, phase)[0]
            unit_z = _hermite(cycle, 2, phase)[1] / TURN
            speed = size * steep * going
            x, y = size * unit_x, size * unit_y
            dx, dy = speed * unit_y + growing * unit_x, speed * unit_z + growing * unit_y
        angle[joint] = value(joints.weights[joint], x, y)
        d_angle_d_phase[joint] = TURN * rate(joints.weights[joint], x, y, dx, dy)


def tables(orbit: Orbit) -> tuple[np.ndarray, np.ndarray]:
    """Return lead and cycle of a Retiming; the waveform must determine its phase."""
    grid = np.arange(POINTS) / POINTS

    def unit(theta: np.ndarray) -> tuple[np.ndarray, ...]:
        return tuple(orbit.waveform(theta, n) / (TURN**n * orbit.peak) for n in range(3))

    x, y, z = unit(grid)
    cycle = np.stack([x, y * TURN / POINTS, y, z * TURN / POINTS], axis=1)
    angle = np.unwrap(np.arctan2(-y, x)) / TURN
    angle -= np.round(angle[0])
    # Phases at even angles, by Newton's method from what lies between the entries.
    theta = np.interp(grid, np.append(angle, angle[0] + 1.0), np.append(grid, 1.0))
    for _ in range(4):
        x, y, z = unit(theta)
        gap = (np.arctan2(-y, x) / TURN - grid + 0.5) % 1.0 - 0.5
        slope = (y * y - x * z) / (x * x + y * y)
        theta = theta - gap / slope
    x, y, z = unit(theta)
    faster = (x * x + y * y) / (y * y - x * z)
    return np.stack([theta - grid, (faster - 1.0) / POINTS], axis=1), cycle


#: Entries of the tables over one cycle.
TABLE = 512


class NoPhase(CpgError):
    """A waveform does not determine its phase and so cannot drive joints; the message says why."""


@jit
def lookup(table, cycles):
    """Periodic table with linear interpolation, at a place in cycles."""
    place = (cycles - math.floor(cycles)) * table.shape[0]
    # A comparison that NaN fails, too: it must not become an index.
    low = int(place) if place >= 0.0 else 0
    rest = place - low
    low = low if low < table.shape[0] else 0
    high = low + 1 if low + 1 < table.shape[0] else 0
    return table[low] + rest * (table[high] - table[low])


@jit_entry
def observe(now, wave, joints, angle, d_angle_d_phase, legs):
    """Read joints and legs off a network's state.

    Args:
        now: x, x', x'' of the cells, shape (3, cells).
        wave: Waveform of the gait.
        joints: DrivenJoints.
        angle: filled with the joints' deviation from their offset, rad.
        d_angle_d_phase: filled with its derivative by phase, rad per cycle.
        legs: filled with the legs' phases in cycles, [0, 1).

    Returns:
        The largest distance of a cell from where the gait has it, in units of the peak.

    """
    peak, by_phase = wave.peak, wave.period / TURN
    for joint in range(joints.cells.shape[0]):
        cell = joints.cells[joint]
        x = now[0, cell] / peak
        y = now[1, cell] * by_phase / peak
        z = now[2, cell] * by_phase * by_phase / peak
        angle[joint] = value(joints.weights[joint], x, y)
        d_angle_d_phase[joint] = TURN * rate(joints.weights[joint], x, y, y, z)
    for leg in range(joints.leg_cells.shape[0]):
        cell = joints.leg_cells[leg]
        turn = math.atan2(-now[1, cell] * by_phase, now[0, cell]) / TURN
        phase = turn + lookup(wave.lead, turn)
        legs[leg] = phase - math.floor(phase)
    base = legs[0] - wave.phases[joints.leg_cells[0]]
    distance, sum_ = 0.0, 0.0
    for cell in range(wave.phases.shape[0]):
        off = abs(now[0, cell] / peak - lookup(wave.values, base + wave.phases[cell]))
        distance = max(distance, off)
        sum_ += off
    # max may lose a NaN; the sum keeps it.
    return distance + 0.0 * sum_


@jit_entry
def confine(wanted, wanted_rate, limits, dt, position, velocity, behind):
    """Move joints to the wanted positions within their limits; count those held back.

    Where a limit bites, and where a joint catches up, velocity is the difference quotient, so that
    it stays the derivative of what is published.

    Args:
        wanted: positions, rad, shape (joints,).
        wanted_rate: their velocities, rad/s.
        limits: lowest and highest angle, rad, and largest speed, rad/s, shape (3, joints).
        dt: since the last tick, s.
        position: of the last tick, rad; overwritten.
        velocity: filled, rad/s.
        behind: whether a limit held each joint back in the last tick; overwritten.

    """
    held, (lower, upper, speed) = 0, limits
    for joint in range(position.shape[0]):
        last = position[joint]
        reach = speed[joint] * dt * (1.0 + 1e-9)
        new = min(max(wanted[joint], last - reach), last + reach)
        new = min(max(new, lower[joint]), upper[joint])
        rate = wanted_rate[joint]
        short = new != wanted[joint]
        if short or abs(rate) > speed[joint] * (1.0 + 1e-9):
            held += 1
            rate = (new - last) / dt if dt > 0.0 else 0.0
        elif behind[joint]:
            rate = (new - last) / dt if dt > 0.0 else 0.0
        behind[joint] = short
        position[joint] = new
        velocity[joint] = min(max(rate, -speed[joint]), speed[joint])
    return held


def lead_table(x: np.ndarray, y: np.ndarray) -> np.ndarray:
    """Tabulate phase minus angle over the angle, from a closed curve sampled evenly in phase.

    Args:
        x: normalised state, shape (m,), from phase 0 where it peaks.
        y: its derivative by phase in radians, shape (m,). The angle is atan2(-y, x).

    Raises:
        NoPhase: the curve does not turn steadily about the origin, so that its angle does
            not determine the phase.

    """
    phase = np.arange(x.size + 1) / x.size
    angle = np.unwrap(np.arctan2(-np.append(y, y[0]), np.append(x, x[0]))) / TURN
    angle -= angle[0]
    if not (np.diff(angle) > 0.0).all() or abs(angle[-1] - 1.0) > 1e-9:
        raise NoPhase('the waveform has more than one hump a cycle')
    grid = np.arange(TABLE) / TABLE
    return np.interp(grid, angle, phase) - grid


class WaveReadout:
    """Joints driven by the cells' waveform.

    Attributes:
        start: phase of the first leg at the orbit's phase 0, cycles.
        angles, rises: of the joints over a cycle, rad and rad per cycle, shape (joints, m).
        wave: the gait's waveform.
        joints: the cells behind joints and legs.
        retiming: what the duty factor makes of it, None for nothing.

    """

    def __init__(self, orbit: Orbit, cells: np.ndarray, weights: np.ndarray,
                 leg_cells: np.ndarray, maps: np.ndarray | None = None) -> None:
        """Prepare for an orbit.

        Args:
            orbit: the gait.
            cells: the cell behind each joint, from 0, shape (joints,).
            weights: in rad, shape (joints, 6).
            leg_cells: the cell that gives each leg's phase, shape (legs,).
            maps: what the duty factor makes of the phase of each joint's cell, shape (joints,
                3), see motion.duty; None for nothing.

        Raises:
            NoPhase: the waveform does not determine the phase.

        """
        theta = np.arange(TABLE) / TABLE
        x = orbit.waveform(theta) / orbit.peak
        y = orbit.waveform(theta, 1) / (TURN * orbit.peak)
        z = orbit.waveform(theta, 2) / (TURN**2 * orbit.peak)
        self.wave = Waveform(orbit.peak, orbit.period, orbit.phases, x, lead_table(x, y))
        self.joints = DrivenJoints(cells, weights, leg_cells)
        self._observe: Any = None
        self._read_retimed: Any = None
        self.start = float(orbit.phases[leg_cells[0]])
        self.retiming = None
        if maps is None or (maps[:, 0] == 1.0).all():
            values, slopes = monomials(x, y, z)
            self.angles, self.rises = weights @ values, weights @ slopes
            return
        self.retiming = Retiming(*tables(orbit), maps)
        self.angles, self.rises = over_cycle(weights, lambda _, phase: tuple(
            orbit.waveform(phase, n) / (TURN**n * orbit.peak) for n in range(3)), maps, TABLE)

    def clocks(self, phase: float) -> np.ndarray:
        """Return an empty array: the state alone determines the joints."""
        return np.empty((0, 0))

    def look(self, now: np.ndarray, strides: float, clocks: np.ndarray, angle: np.ndarray,
             d_angle_d_phase: np.ndarray, legs: np.ndarray) -> float:
        """Read joints and legs off a state, however many strides after the last.

        See observe; arrays are C-contiguous and of float64.
        """
        arguments = now, self.wave, self.joints, angle, d_angle_d_phase, legs
        if self._observe is None:
            self._observe = specialised(observe, *arguments)
        distance: float = self._observe(*arguments)
        if self.retiming is not None:
            retimed = now, self.wave, self.joints, self.retiming, angle, d_angle_d_phase
            if self._read_retimed is None:
                self._read_retimed = specialised(read_retimed, *retimed)
            self._read_retimed(*retimed)
        return distance


def extremes(values: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Minimum and maximum of each row, a periodic function on even points, by parabolas."""
    return -_highest(-values), _highest(values)


def _highest(values: np.ndarray) -> np.ndarray:
    top = values.argmax(axis=1)
    rows = np.arange(len(values))
    before, here, after = (values[rows, (top + k) % values.shape[1]] for k in (-1, 0, 1))
    bend = 2.0 * here - before - after
    return here + np.divide((after - before)**2, 8.0 * bend, out=np.zeros_like(here),
                            where=bend > 0.0)
