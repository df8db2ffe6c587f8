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
from typing import Any

from cpg_ros.dynamics.periodic import Orbit
from cpg_ros.errors import CpgError
from cpg_ros.integration.jit import bound, entry, jit
from cpg_ros.motion import joint_polynomial
from cpg_ros.motion.joint_polynomial import DrivenJoints, monomials, over_cycle, TURN
from cpg_ros.motion.retimed_waveform import read_retimed, Retiming, tables, Waveform
import numpy as np

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


@entry
def observe(now, wave, joints, angle, rise, legs):
    """Read joints and legs off a network's state.

    Args:
        now: x, x', x'' of the cells, shape (3, cells).
        wave: Waveform of the gait.
        joints: DrivenJoints.
        angle: filled with the joints' deviation from their offset, rad.
        rise: filled with its derivative by phase, rad per cycle.
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
        angle[joint] = joint_polynomial.value(joints.weights[joint], x, y)
        rise[joint] = TURN * joint_polynomial.rate(joints.weights[joint], x, y, y, z)
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


@entry
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
             rise: np.ndarray, legs: np.ndarray) -> float:
        """Read joints and legs off a state, however many strides after the last.

        See observe; arrays are C-contiguous and of float64.
        """
        arguments = now, self.wave, self.joints, angle, rise, legs
        if self._observe is None:
            self._observe = bound(observe, *arguments)
        distance: float = self._observe(*arguments)
        if self.retiming is not None:
            retimed = now, self.wave, self.joints, self.retiming, angle, rise
            if self._read_retimed is None:
                self._read_retimed = bound(read_retimed, *retimed)
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
