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

"""Joints that follow a waveform at another time than their cells do, by the phase.

For a duty factor that is not the network's own. A state (x, y), a cell and its derivative by
phase over the peak, has a phase theta, that of the orbit at its angle, and a size rho over the
orbit there. Joints follow rho (X, Y)(phase'), phase' the one that the duty factor makes of
theta; rates follow by the chain rule from x, x' and x'': they are derivatives also off the orbit.
"""

import math
from typing import NamedTuple

from cpg_ros.dynamics.periodic import Orbit
from cpg_ros.integration.jit import entry, jit
from cpg_ros.motion import joint_polynomial
from cpg_ros.motion.duty import retimed_phase
from cpg_ros.motion.joint_polynomial import TURN
import numpy as np

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


@entry
def read_retimed(now, wave, joints, retiming, angle, rise):
    """Read joints off a network's state at the retimed phase.

    Args:
        now: x, x', x'' of the cells, shape (3, cells).
        wave: Waveform of the gait.
        joints: DrivenJoints.
        retiming: Retiming.
        angle: filled with the joints' deviation from their offset, rad.
        rise: filled with its derivative by phase, rad per cycle.

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
        angle[joint] = joint_polynomial.value(joints.weights[joint], x, y)
        rise[joint] = TURN * joint_polynomial.rate(joints.weights[joint], x, y, dx, dy)


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
