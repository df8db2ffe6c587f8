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

"""Placement of the feet by the capture point, on the network's clock, and the clock's speed-up.

The capture point xi = c + v / w (c centre of mass, w = sqrt(g / h)) moves away from the foot that
stands as exp(w t). The clock knows how long it is until the other foot lands, so that foot is put
where xi will be, less the offset that the next step needs (Pratt et al. 2006, Humanoids;
Englsberger et al. 2015, IEEE Trans. Robotics 31:355).
"""

import math

from cpg_ros.feedback.biped import clock
from cpg_ros.feedback.kinematics import GRAVITY
from cpg_ros.feedback.law import Gain
from cpg_ros.integration.jit import jit

GAINS = {
    'step_width': Gain(0.235, 0.6, 'm', 'between the middles of the soles'),
    'place_x': Gain(0.893, 3.0, '', "step forward by the capture point's error at touchdown"),
    'place_y': Gain(0.626, 3.0, '', 'the same sideways'),
    'place_offset': Gain(0.0028, 0.2, 'm', 'added to every step forward'),
    'reach_x': Gain(0.45, 1.0, 'm', 'longest step forward and backward'),
    'reach_y': Gain(0.45, 1.0, 'm', 'widest step'),
    'narrowest': Gain(0.13, 0.5, 'm', 'narrowest step'),
    'speed_integral': Gain(0.92, 3.0, '1/s', 'speed added by the integral of what is missing'),
    'acceleration': Gain(0.5, 3.0, 'm/s^2', 'with which a wanted speed is approached'),
    'speed_up': Gain(4.90, 20.0, '1/m', "speed-up of the clock by the capture point's error"),
    'speed_up_from': Gain(0.047, 0.5, 'm', 'error that does not speed the clock up'),
    'speed_up_most': Gain(0.6, 2.0, '', 'largest speed-up')}
#: Shortest time to a touchdown that a foot is placed for, s; lowest centre of mass, m.
SOONEST, LOWEST = 0.02, 0.3
#: Largest integral of the missing speed, m, and largest speed missing in it, m/s.
INTEGRAL, MISSING = 0.4, 1.0


@jit
def growth_rate(height):
    """Return w = sqrt(g / h), 1/s, of a centre of mass at a height in m over the feet."""
    return math.sqrt(GRAVITY / max(height, LOWEST))


@jit
def offsets(speed, sideways, rate, gains):
    """Return where the capture point is from a foot that has just landed, forward and outward.

    Args:
        speed: forward, m/s.
        sideways: to the left, m/s.
        rate: see growth_rate.
        gains: BipedGains.

    Returns:
        Forward, m; inward from the foot, m; to the left in addition, m.

    """
    time = 0.5 / gains.frequency
    grown = math.exp(rate * time)
    return (speed * time / (grown - 1.0), gains.step_width / (1.0 + grown),
            sideways * time / (grown - 1.0))


@jit
def capture_error(xi, side, time, rate, wanted, gains):
    """Return by how much the capture point is off its course, forward and left, m.

    Args:
        xi: capture point from the foot that stands, heading's axes, m, a pair.
        side: of the foot that swings, 1 left and -1 right.
        time: since the foot that stands took over, s.
        rate: see growth_rate.
        wanted: speed forward and to the left, m/s.
        gains: BipedGains.

    """
    forward, inward, left = offsets(wanted[0], wanted[1], rate, gains)
    grown = math.exp(rate * time)
    return xi[0] - forward * grown, xi[1] - (side * inward + left) * grown


@jit
def step(error, side, remaining, rate, wanted, gains):
    """Return where a foot is to land from the one that stands, forward and left, m.

    Args:
        error: see capture_error.
        side: of the foot that swings, 1 left and -1 right.
        remaining: time to its touchdown, s.
        rate: see growth_rate.
        wanted: speed forward and to the left, m/s.
        gains: BipedGains.

    """
    time, grown = 0.5 / gains.frequency, math.exp(rate * max(remaining, SOONEST))
    forward = wanted[0] * time + gains.place_x * grown * error[0] + gains.place_offset
    outward = gains.step_width + side * (wanted[1] * time + gains.place_y * grown * error[1])
    return (min(max(forward, -gains.reach_x), gains.reach_x),
            side * min(max(outward, gains.narrowest), gains.reach_y))


@jit
def speed_up(error, gains):
    """Return the factor of the clock by the capture point's error, m, a pair."""
    size = math.sqrt(error[0] * error[0] + error[1] * error[1])
    return 1.0 + min(max(gains.speed_up * (size - gains.speed_up_from), 0.0),
                     gains.speed_up_most)


@jit
def integrate(integral, missing, dt):
    """Return the integral of the missing speed, m, dt in s later."""
    integral += dt * min(max(missing, -MISSING), MISSING)
    return min(max(integral, -INTEGRAL), INTEGRAL)


@jit
def time_to_touchdown(phase, gains):
    """Return when a leg that swings will bear half of the weight, s; phase from lift-off."""
    return ((clock.swing_share(gains) - phase) + 0.5 * (gains.duty - 0.5)) / gains.frequency
