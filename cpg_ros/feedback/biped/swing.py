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

"""Swing of a foot, its sole level: a path of minimum jerk, lifted as a squared sine."""

import math

from cpg_ros.feedback.law import Gain
from cpg_ros.integration.jit import jit

GAINS = {
    'lift': Gain(0.084, 0.4, 'm', 'height of a swinging foot'),
    'swing_end': Gain(0.9966, 1.0, '', 'share of the swing in which the foot goes its way'),
    'swing_kp': Gain(3580.0, 5e4, 'N/m', 'force on a swinging foot by its place'),
    'swing_kd': Gain(176.0, 2e3, 'N s/m', 'the same by its velocity'),
    'swing_mass': Gain(3.37, 30.0, 'kg', 'the same by the acceleration of its path'),
    'sole_kp': Gain(30.2, 500.0, 'N m/rad', 'moment that keeps the sole level and ahead'),
    'sole_kd': Gain(0.716, 50.0, 'N m s/rad', 'the same by its rate'),
    'press': Gain(0.012, 0.1, 'm', 'how far below the ground a path ends')}
#: Share of the forces that is left once the foot has landed, and of the damping of its joints.
LANDED, SWUNG = 0.2, 0.2


@jit
def path(share, duration, lift_off, target, gains, out):
    """Fill place, velocity and acceleration of a foot on its path, m, s, shape (3, 3).

    Args:
        share: of the swing that is over, 0 to 1.
        duration: of the swing, s.
        lift_off: where it began, m, (3,).
        target: where it is to end, m, (3,).
        gains: BipedGains.
        out: filled.

    """
    quick = gains.swing_end * duration
    s = min(max(share / gains.swing_end, 0.0), 1.0)
    way = s * s * s * (10.0 - 15.0 * s + 6.0 * s * s)
    speed = 30.0 * s * s * (1.0 - s) * (1.0 - s) / quick
    rise = (60.0 * s - 180.0 * s * s + 120.0 * s * s * s) / (quick * quick)
    for k in range(2):
        total = target[k] - lift_off[k]
        out[0, k], out[1, k], out[2, k] = lift_off[k] + way * total, speed * total, rise * total
    turn = math.pi / duration
    sine = math.sin(math.pi * share)
    out[0, 2] = (lift_off[2] + way * (target[2] - lift_off[2]) + gains.lift * sine * sine
                 - gains.press * share * share)
    out[1, 2] = gains.lift * turn * math.sin(2.0 * math.pi * share)
    out[2, 2] = 2.0 * gains.lift * turn * turn * math.cos(2.0 * math.pi * share)


@jit
def foot_force(wanted, place, velocity, gains):
    """Return the force on a foot that follows its path, N; wanted as path fills it."""
    return (gains.swing_kp * (wanted[0, 0] - place[0]) + gains.swing_kd * (
                wanted[1, 0] - velocity[0]) + gains.swing_mass * wanted[2, 0],
            gains.swing_kp * (wanted[0, 1] - place[1]) + gains.swing_kd * (
                wanted[1, 1] - velocity[1]) + gains.swing_mass * wanted[2, 1],
            gains.swing_kp * (wanted[0, 2] - place[2]) + gains.swing_kd * (
                wanted[1, 2] - velocity[2]) + gains.swing_mass * wanted[2, 2])


@jit
def level_moment(turn, heading, turning, gains):
    """Return the moment that brings a sole level and to the heading, N m.

    Args:
        turn: rotation of the sole, shape (3, 3).
        heading: rad.
        turning: its angular velocity, rad/s, (3,).
        gains: BipedGains.

    """
    c, s = math.cos(heading), math.sin(heading)
    # Half the sum of the products of the axes that are and those that are to be.
    x = 0.5 * (-turn[2, 0] * s - turn[2, 1] * c + turn[1, 2])
    y = 0.5 * (turn[2, 0] * c - turn[2, 1] * s - turn[0, 2])
    z = 0.5 * (turn[0, 0] * s - turn[1, 0] * c + turn[0, 1] * c + turn[1, 1] * s)
    return (gains.sole_kp * x - gains.sole_kd * turning[0],
            gains.sole_kp * y - gains.sole_kd * turning[1],
            gains.sole_kp * z - gains.sole_kd * turning[2])
