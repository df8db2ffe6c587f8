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

"""Plausibility of sensor messages: each is checked before the feedback uses it.

Rules of thumb for legged robots. A value that is far too large counts as a fault only if it lasts
longer than a stumble does.
"""

import math

from cpg_ros.feedback.kinematics import GRAVITY
from cpg_ros.integration.jit import entry

#: What is wrong with a message, by the number that the checks return.
VERDICTS = ('', 'numbers that are not finite', 'an orientation whose length is not 1',
            'no orientation (its covariance begins with -1)', 'an impossible angular velocity',
            'an impossible acceleration',
            'an orientation and an angular velocity that contradict each other',
            'a joint far beyond its limits', 'an impossible speed of a joint',
            'impossible loads on the feet')
#: Length of an orientation, from 1; rad/s; m/s^2 within TELLING, in s.
UNIT, FASTEST, HARDEST, TELLING = 0.1, 35.0, 4.0 * GRAVITY, 0.05
#: How far orientation and the sum of angular velocities may part, rad, within a time in s, and
#: the longest gap between messages over which they are compared, s.
APART, FORGET, GAP = 0.15, 0.2, 0.05
#: Joints beyond their limits, rad, and by how much they outrun their largest speeds.
BEYOND, OUTRUN = 0.3, 3.0
#: Loads of all feet within TELLING, and drawn by one, in weights.
HEAVIEST, DRAWN = 4.0, -0.5
#: Numbers of a sensor_msgs/Imu, and of the memory of its check: acceleration (3), vertical (3),
#: drift of the vertical from the integrated angular velocity (3), whether there is a last message.
IMU, IMU_MEMORY = 37, 10


@entry
def judge_imu(values, dt, memory, rpy, angular_velocity, acceleration):
    """Fill the last three if the message is plausible; return an index into VERDICTS, 0 for good.

    Args:
        values: the numbers of a sensor_msgs/Imu in its order, shape (IMU,).
        dt: since the last one, s.
        memory: shape (IMU_MEMORY,), zeros at first; overwritten.
        rpy: roll, pitch and yaw, rad, shape (3,).
        angular_velocity: of the base, rad/s, shape (3,).
        acceleration: what the accelerometer shows, m/s^2, shape (3,).

    """
    for k in (0, 1, 2, 3, 13, 14, 15, 25, 26, 27):
        if not math.isfinite(values[k]):
            return 1
    if values[4] == -1.0:
        return 3
    x, y, z, w = values[0], values[1], values[2], values[3]
    if abs(math.sqrt(x * x + y * y + z * z + w * w) - 1.0) > UNIT:
        return 2
    wx, wy, wz = values[13], values[14], values[15]
    if math.sqrt(wx * wx + wy * wy + wz * wz) > FASTEST:
        return 4
    hard = 0.0
    for k in range(3):
        memory[k] += min(dt / TELLING, 1.0) * (values[25 + k] - memory[k])
        hard += memory[k] * memory[k]
    if math.sqrt(hard) > HARDEST:
        return 5
    up = (2.0 * (x * z - w * y), 2.0 * (y * z + w * x), 1.0 - 2.0 * (x * x + y * y))
    # What stands still in the world turns the other way in the base's frame.
    turned = (up[1] * wz - up[2] * wy, up[2] * wx - up[0] * wz, up[0] * wy - up[1] * wx)
    known, parted = memory[9] > 0.0 and dt < GAP, 0.0
    for k in range(3):
        off = (1.0 - dt / FORGET) * memory[6 + k] + up[k] - memory[3 + k] - dt * turned[k]
        memory[6 + k], memory[3 + k] = off if known else 0.0, up[k]
        parted += memory[6 + k]**2
    memory[9] = 1.0
    if math.sqrt(parted) > APART:
        return 6
    rpy[0] = math.atan2(up[1], up[2])
    rpy[1] = math.asin(min(max(-up[0], -1.0), 1.0))
    rpy[2] = math.atan2(2.0 * (w * z + x * y), 1.0 - 2.0 * (y * y + z * z))
    for k in range(3):
        angular_velocity[k], acceleration[k] = values[13 + k], values[25 + k]
    return 0


@entry
def judge_joints(positions, velocities, places, lower, upper, fastest, angles, rates):
    """Fill angles and rates if plausible; return an index into VERDICTS, 0 for good.

    Args:
        positions: of a message, in its own order, rad.
        velocities: the same, rad/s.
        places: index of each joint in the message, shape (joints,).
        lower: limits of the joints, rad, shape (joints,).
        upper: the same.
        fastest: the same, rad/s.
        angles: rad, shape (joints,).
        rates: rad/s, shape (joints,).

    """
    for k in range(len(places)):
        angle, rate = positions[places[k]], velocities[places[k]]
        if not math.isfinite(angle + rate):
            return 1
        if not lower[k] - BEYOND <= angle <= upper[k] + BEYOND:
            return 7
        if abs(rate) > OUTRUN * fastest[k]:
            return 8
    for k in range(len(places)):
        angles[k], rates[k] = positions[places[k]], velocities[places[k]]
    return 0


@entry
def judge_loads(loads, places, weight, dt, memory, forces):
    """Fill forces if plausible; return an index into VERDICTS, 0 for good.

    Args:
        loads: of the feet, N, in any order.
        places: index of each foot among them, shape (legs,).
        weight: of the robot, N.
        dt: since the last ones, s.
        memory: shape (1,), zeros at first; overwritten.
        forces: N, shape (legs,).

    """
    whole = 0.0
    for load in loads:
        if not math.isfinite(load):
            return 1
        if load < DRAWN * weight:
            return 9
        whole += load
    memory[0] += min(dt / TELLING, 1.0) * (whole - memory[0])
    if memory[0] > HEAVIEST * weight:
        return 9
    for k in range(len(places)):
        forces[k] = loads[places[k]]
    return 0


@entry
def agreement(loads, least, swinging, share, before):
    """Return how well contacts go with a gait, 0 to 1, low-passed.

    Args:
        loads: of the feet, N, shape (legs,).
        least: load of a foot that stands, N.
        swinging: whether each leg is meant to, shape (legs,).
        share: of the new in the mean.
        before: the mean so far.

    """
    same = 0
    for leg in range(len(loads)):
        same += (loads[leg] > least) != swinging[leg]
    return before + share * (same / len(loads) - before)
