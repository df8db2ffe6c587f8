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

import math

from cpg_ros.dynamics.periodic import Orbit
from cpg_ros.errors import CpgError
from cpg_ros.integration.jit import entry, jit
from cpg_ros.motion.duty import at_even_phases
from cpg_ros.motion.retimed_waveform import read_retimed, tables
import numpy as np

#: Entries of the tables over one cycle.
TABLE = 512

TURN = 2.0 * math.pi


class NoPhase(CpgError):
    """A waveform does not tell its phase and so cannot drive joints; the message says why."""


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


@entry
def observe(now, peak, period, cells, weights, phases, leg_cells, wave, lead, angle, rise,
            leg_phases):
    """Read joints and legs off a network's state.

    Args:
        now: x, x', x'' of the cells, shape (3, cells).
        peak: largest value of a cell on the gait's orbit.
        period: of the orbit, model time.
        cells: the cell behind each joint, shape (joints,).
        weights: readout weights of each joint in rad, shape (joints, 6).
        phases: phase of each cell in the gait.
        leg_cells: the cell that gives each leg's phase.
        wave: normalised waveform over the cycle.
        lead: phase minus angle, both in cycles, as a function of the angle.
        angle: filled with the joints' deviation from their offset, rad.
        rise: filled with its derivative by phase, rad per cycle.
        leg_phases: filled with the legs' phases in cycles, [0, 1).

    Returns:
        The largest distance of a cell from where the gait has it, in units of the peak.

    """
    by_phase = period / TURN
    for joint in range(cells.shape[0]):
        cell = cells[joint]
        x = now[0, cell] / peak
        y = now[1, cell] * by_phase / peak
        z = now[2, cell] * by_phase * by_phase / peak
        w = weights[joint]
        angle[joint] = (w[0] * x + w[1] * y + w[2] * x * x + w[3] * x * y
                        + (w[4] * x + w[5] * y) * x * x)
        rise[joint] = TURN * ((w[0] + 2.0 * w[2] * x + w[3] * y + 3.0 * w[4] * x * x
                               + 2.0 * w[5] * x * y) * y
                              + (w[1] + w[3] * x + w[5] * x * x) * z)
    for leg in range(leg_cells.shape[0]):
        cell = leg_cells[leg]
        turn = math.atan2(-now[1, cell] * by_phase, now[0, cell]) / TURN
        phase = turn + lookup(lead, turn)
        leg_phases[leg] = phase - math.floor(phase)
    base = leg_phases[0] - phases[leg_cells[0]]
    distance, sum_ = 0.0, 0.0
    for cell in range(phases.shape[0]):
        off = abs(now[0, cell] / peak - lookup(wave, base + phases[cell]))
        distance = max(distance, off)
        sum_ += off
    # Whatever max makes of a NaN: it comes through the sum.
    return distance + 0.0 * sum_


@entry
def confine(wanted, wanted_rate, lower, upper, speed, dt, position, velocity, behind):
    """Move position to the wanted one within the joints' limits; count those held back.

    position and behind, which joints were held back, are those of the last tick on entry. Where a
    limit bites, and where a joint catches up, velocity is the difference quotient, so that it
    stays the derivative of what is published.
    """
    held = 0
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
            not tell the phase.

    """
    phase = np.arange(x.size + 1) / x.size
    angle = np.unwrap(np.arctan2(-np.append(y, y[0]), np.append(x, x[0]))) / TURN
    angle -= angle[0]
    if not (np.diff(angle) > 0.0).all() or abs(angle[-1] - 1.0) > 1e-9:
        raise NoPhase('the waveform has more than one hump a cycle')
    grid = np.arange(TABLE) / TABLE
    return np.interp(grid, angle, phase) - grid


def monomials(x: np.ndarray, y: np.ndarray, z: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Evaluate x, y, x^2, x y, x^3, x^2 y and their derivatives by phase in cycles.

    Args:
        x: readout signal, any shape.
        y: its derivative by phase in radians.
        z: the second one.

    Returns:
        Two arrays of shape (6, ...).

    """
    values = np.stack([x, y, x * x, x * y, x**3, x * x * y])
    slopes = TURN * np.stack([y, z, 2 * x * y, y * y + x * z, 3 * x * x * y,
                              2 * x * y * y + x * x * z])
    return values, slopes


class WaveReadout:
    """Joints driven by the cells' waveform.

    Attributes:
        start: phase of the first leg at the orbit's phase 0, cycles.

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
            NoPhase: the waveform does not tell the phase.

        """
        theta = np.arange(TABLE) / TABLE
        x = orbit.waveform(theta) / orbit.peak
        y = orbit.waveform(theta, 1) / (TURN * orbit.peak)
        z = orbit.waveform(theta, 2) / (TURN**2 * orbit.peak)
        self._view = (orbit.peak, orbit.period, cells, weights, orbit.phases, leg_cells, x,
                      lead_table(x, y))
        self.start = float(orbit.phases[leg_cells[0]])
        self._retiming = None
        if maps is None or (maps[:, 0] == 1.0).all():
            values, slopes = monomials(x, y, z)
            self.angles, self.rises = weights @ values, weights @ slopes
            return
        self._retiming = (orbit.peak, orbit.period, cells, weights, *tables(orbit), maps)
        self.angles, self.rises = np.empty((2, len(cells), TABLE))
        for joint, one in enumerate(maps):
            phase, steep = at_even_phases(one, TABLE)
            x, y, z = (orbit.waveform(phase, n) / (TURN**n * orbit.peak) for n in range(3))
            values, slopes = monomials(x, y, z)
            self.angles[joint] = weights[joint] @ values
            self.rises[joint] = steep * (weights[joint] @ slopes)

    def clocks(self, phase: float) -> np.ndarray:
        """Return nothing: a state tells all by itself."""
        return np.empty((0, 0))

    def look(self, now: np.ndarray, strides: float, clocks: np.ndarray, angle: np.ndarray,
             rise: np.ndarray, legs: np.ndarray) -> float:
        """Read joints and legs off a state, however many strides after the last; see observe."""
        distance: float = observe(now, *self._view, angle, rise, legs)
        if self._retiming is not None:
            read_retimed(now, *self._retiming, angle, rise)
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
