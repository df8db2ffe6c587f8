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

"""Comparison of the measured angular velocity with the motion of the legs on the ground.

Two standing feet keep their distance and its direction in the world, so the legs' kinematics give
the base's rotation about every axis except the line between the feet. Of all checks, only this one
detects an IMU whose mount is rotated about the vertical.
"""

from cpg_ros.dynamics.integration.compilation import jit, jit_entry
from cpg_ros.feedback.estimate import TOUCHDOWN_LOAD, velocity_by_leg
from cpg_ros.feedback.kinematics import foot_of
import numpy as np

#: MOUNTS: ways of mounting the IMU, each as its x and y axis in the base's frame: as it should be,
#: turned by quarters about z, and the same four with the pitch mirrored.
MOUNTS = np.array([[1.0, 0.0, 0.0, 1.0], [0.0, 1.0, -1.0, 0.0], [-1.0, 0.0, 0.0, -1.0],
                   [0.0, -1.0, 1.0, 0.0], [1.0, 0.0, 0.0, -1.0], [0.0, 1.0, 1.0, 0.0],
                   [-1.0, 0.0, 0.0, 1.0], [0.0, -1.0, -1.0, 0.0]])
#: MOUNT_TEXTS: text for the user on each of MOUNTS.
MOUNT_TEXTS = ('', 'turned by 90 degrees about z', 'turned by 180 degrees about z',
           'turned by -90 degrees about z', *['with a wrong sign of an axis'] * 4)
#: RATES_STATE_SIZE: values of the memory: for each of MOUNTS the mean square of the feet's
#: relative motion that it leaves unexplained, (rad/s)^2; time with two feet on the ground, s; the
#: verdict.
RATES_STATE_SIZE = len(MOUNTS) + 2
#: MEAN_TIME: time constant of these means, s on two feet; MIN_TIME: time from which on they are
#: judged, s.
MEAN_TIME, MIN_TIME = 1.0, 0.15
#: SLIP_RATE: least mismatch of all mounts, rad/s, at which a sample counts half: the feet slip.
SLIP_RATE = 0.2
#: The mount is wrong if it leaves more than MIN_UNEXPLAINED, (rad/s)^2, unexplained, and if
#: another mount leaves less than the fraction MAX_RATIO of that.
MAX_RATIO, MIN_UNEXPLAINED = 0.5, 0.0025


@jit
def _add(leg, other, turning, dt, memory):
    """Add a pair of standing feet, each with its velocity at rest and its position, shape (6,)."""
    count, least = len(MOUNTS), np.inf
    ax, ay, az = leg[3] - other[3], leg[4] - other[4], leg[5] - other[5]
    square = ax * ax + ay * ay + az * az
    off = np.empty(count)
    for k in range(count):
        mount = MOUNTS[k]
        x = mount[0] * turning[0] + mount[2] * turning[1]
        y = mount[1] * turning[0] + mount[3] * turning[1]
        z = turning[2]
        ex = leg[0] - other[0] - (y * az - z * ay)
        ey = leg[1] - other[1] - (z * ax - x * az)
        ez = leg[2] - other[2] - (x * ay - y * ax)
        along = ex * ax + ey * ay + ez * az
        off[k] = (ex * ex + ey * ey + ez * ez - along * along / square) / square
        least = min(least, off[k])
    memory[count] += dt
    fraction = min(dt / min(MEAN_TIME, memory[count]), 1.0) / (1.0 + least / SLIP_RATE**2)
    for k in range(count):
        memory[k] += fraction * (off[k] - memory[k])


@jit_entry
def compare_rates(legs, sensors, dt, memory, seen, scratch):
    """Update the memory with a measurement; return an index into MOUNT_TEXTS, 0 for a right mount.

    Args:
        legs: LegArrays of the robot.
        sensors: SensorData of one run.
        dt: since the last tick, s.
        memory: shape (RATES_STATE_SIZE,), zeros at first; overwritten.
        seen: scratch, shape (legs, 6).
        scratch: shape (4, 3).

    """
    rows, columns, forces = legs.rows, legs.columns, sensors.foot_forces[0]
    angles, rates, turning = (sensors.joint_positions[0], sensors.joint_velocities[0],
                              sensors.angular_velocity[0])
    load, slopes, now = 2.0 * TOUCHDOWN_LOAD * legs.weight, scratch[:3], scratch[3]
    count = len(MOUNTS)
    for leg in range(rows.shape[0]):
        if forces[leg] < load or rows[leg, 1] == 0.0:
            continue
        first, second, third = columns[leg, 0], columns[leg, 1], columns[leg, 2]
        now[0], now[1], now[2] = angles[first], angles[second], angles[third]
        velocity_by_leg(rows[leg], now, (rates[first], rates[second], rates[third]), slopes,
                        (0.0, 0.0, 0.0), (0.0, 0.0, 1.0), legs.radius, seen[leg])
        seen[leg, 3], seen[leg, 4], seen[leg, 5] = foot_of(rows[leg], now[0], now[1], now[2])
        for other in range(leg):
            if forces[other] >= load and rows[other, 1] != 0.0:
                _add(seen[leg], seen[other], turning, dt, memory)
    best = 0
    for k in range(1, count):
        best = k if memory[k] < memory[best] else best
    if memory[count] > MIN_TIME:
        if best and memory[0] > MIN_UNEXPLAINED and memory[best] < MAX_RATIO * memory[0]:
            memory[count + 1] = best
        elif best == 0:
            memory[count + 1] = 0.0
    return int(memory[count + 1])


def rates_memory(legs: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return memory and scratch of compare_rates."""
    return np.zeros(RATES_STATE_SIZE), np.zeros((legs, 6)), np.zeros((4, 3))
