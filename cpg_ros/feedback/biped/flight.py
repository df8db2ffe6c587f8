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

"""Gaits with flight, run and hop: the upward force of a stance is half a sine on the clock.

In each stance the legs push the body off by the impulse that it needs until the next one; the
height and speed that this makes of a point mass are followed. A foot lands where the body would
be in the middle of its stance, the more ahead the faster it is than wanted (Raibert 1986, Legged
Robots That Balance). Legs swing in turn, or together.
"""

import math

from cpg_ros.feedback.biped import clock
from cpg_ros.feedback.kinematics import GRAVITY
from cpg_ros.feedback.law import Gain
from cpg_ros.integration.jit import jit

GAINS = {
    'flight_height': Gain(0.97, 1.2, '', 'height of the centre of mass as feet leave and touch '
                          'the ground in gaits with flight, by height', low=0.5),
    'flight_kp': Gain(7410.0, 5e4, 'N/m', 'upward force by that height'),
    'flight_kd': Gain(20.0, 5e3, 'N s/m', 'the same by its rate'),
    'flight_width': Gain(0.48, 2.0, '', 'width of the steps in gaits with flight, by step_width'),
    'flight_ahead': Gain(0.444, 1.5, '', 'way from the foot to the body at touchdown, by the way '
                         'of a stance'),
    'flight_x': Gain(0.159, 1.0, 's', 'foot further ahead by what the speed is too high'),
    'flight_y': Gain(0.0512, 1.0, 's', 'the same sideways')}
#: Most upward force by the weight, furthest foot from the body and least sideways, m.
MOST, REACH, ASIDE = 3.5, 0.35, 0.045
#: How legs go: in turn without flight, in turn with flight, together.
WALKS, RUNS, HOPS = 0, 1, 2


@jit
def spans(kind, gains):
    """Return how long a stance is, and how long it is from one to the next, s."""
    return gains.duty / gains.frequency, (1.0 if kind == HOPS else 0.5) / gains.frequency


@jit
def course(share, kind, gains):
    """Return height over the ground, m, upward speed, m/s, and force by weight in a stance.

    Args:
        share: of the stance that is over, 0 to 1.
        kind: RUNS or HOPS.
        gains: BipedGains.

    """
    stance, cycle = spans(kind, gains)
    flight, turn = cycle - stance, math.pi * share
    rise = GRAVITY * (0.5 * cycle * (1.0 - math.cos(turn)) - 0.5 * flight - share * stance)
    height = gains.height * gains.flight_height + GRAVITY * stance * (
        -0.5 * flight * share - 0.5 * share * share * stance
        + 0.5 * cycle * (share - math.sin(turn) / math.pi))
    return height, rise, 0.5 * math.pi * math.sin(turn) * cycle / stance


@jit
def upward_force(share, kind, height, rise, mass, gains):
    """Return the upward force of a stance, N; height and upward speed as of course."""
    weight = mass * GRAVITY
    at, speed, force = course(share, kind, gains)
    push = math.sin(math.pi * share) * (gains.flight_kp * (at - height)
                                        + gains.flight_kd * (speed - rise))
    return min(max(weight * force + push, 0.0), MOST * weight)


@jit
def foothold(speed, wanted, side, remaining, gains):
    """Return where a foot is to land from the centre of mass, forward and left, m.

    Args:
        speed: forward and left, m/s.
        wanted: the same.
        side: of the foot, 1 left and -1 right.
        remaining: time to its touchdown, s.
        gains: BipedGains.

    """
    stance = gains.duty / gains.frequency
    ahead = (speed[0] * (remaining + gains.flight_ahead * stance)
             + gains.flight_x * (speed[0] - wanted[0]) + gains.place_offset)
    left = (0.5 * side * gains.flight_width * gains.step_width
            + speed[1] * (remaining + 0.5 * stance) + gains.flight_y * (speed[1] - wanted[1]))
    return (min(max(ahead, -REACH), REACH), side * min(max(side * left, ASIDE), REACH))


@jit
def stance_share(phase, gains):
    """Return the share of a leg's stance that is over, by its phase from lift-off."""
    return min(max((phase - clock.swing_share(gains)) / gains.duty, 0.0), 1.0)
