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

"""Velocity of a biped's base from the sole that stands, the accelerometer in between."""

import math

from cpg_ros.feedback.biped.links import carry
from cpg_ros.feedback.kinematics import GRAVITY
from cpg_ros.feedback.law import Gain
from cpg_ros.integration.jit import jit

GAINS = {'velocity_time': Gain(0.03, 1.0, 's', 'in which the soles that stand correct the '
                               "accelerometer's velocity")}
#: Share of the weight from which on a sole counts, and over which it comes to count in full.
FROM, OVER = 0.06, 0.18
#: Speed and rate of turning of a sole at which it counts half, m/s and rad/s.
SLIP, ROLL = 0.2, 1.0


@jit
def update(turn, acceleration, soles, loads, dt, gains, velocity):
    """Update the base's velocity, world's axes, m/s, shape (3,), in place.

    Args:
        turn: rotation of the base, shape (3, 3).
        acceleration: as an accelerometer measures it, m/s^2, shape (3,).
        soles: velocities of the soles from the base's, m/s, shape (2, 6).
        loads: share of the weight on each foot, shape (2,).
        dt: since the last time, s.
        gains: BipedGains.
        velocity: changed.

    """
    for k in range(3):
        velocity[k] += dt * (carry(turn, acceleration, k) - (GRAVITY if k == 2 else 0.0))
    first, second = _trust(soles[0], loads[0], velocity), _trust(soles[1], loads[1], velocity)
    total = first + second
    if total > 0.0:
        pull = (1.0 - math.exp(-dt * min(total, 1.0) / max(gains.velocity_time, 1e-4))) / total
        for k in range(3):
            # Where a sole stands, the base moves against it.
            velocity[k] -= pull * (first * (soles[0, k] + velocity[k])
                                   + second * (soles[1, k] + velocity[k]))


@jit
def _trust(sole, load, velocity):
    """Return how far a sole counts as standing, 0 to 1.

    One that turns rolls over an edge or strikes the ground; one that moves at this velocity of the
    base slips. It still counts a little, since integrated accelerations drift.
    """
    off = turned = 0.0
    for k in range(3):
        off += (sole[k] + velocity[k])**2
        turned += sole[3 + k]**2
    return min(max((load - FROM) / OVER, 0.0), 1.0) / (
        (1.0 + off / SLIP**2) * (1.0 + turned / ROLL**2))
