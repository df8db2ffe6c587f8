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

"""Heading: turn back to the heading."""

from cpg_ros.dynamics.integration.compilation import jit
from cpg_ros.feedback.efference_copy import between_speeds
from cpg_ros.feedback.laws.law import Gain, Law, limited, StateVariable

LAW = Law(
    'heading', 'hold the heading, by strides that differ between left and right', True,
    gains={
        'turn': Gain(1.0, 10.0, '1/s', 'yaw rate asked for per rad of heading error'),
        'turn_rate': Gain(0.5, 5.0, '1/s^2',
                          'yaw rate asked for per rad s of heading error, against gaits that '
                          'turn by themselves'),
        'turn_most': Gain(0.6, 6.0, 'rad/s', 'the largest yaw rate asked for')},
    memory={
        'heading_integral': StateVariable('yaw rate against a heading error that lasts [rad/s]')})
#: MAX_LASTING_ERROR: heading error beyond which none lasts, but comes of a push or a turn, rad;
#: MAX_INTEGRAL: the largest integral, as a fraction of turn_most.
MAX_LASTING_ERROR, MAX_INTEGRAL = 0.2, 0.25


@jit
def integrate(integral, off, gains, dt):
    """Return the integral for a heading error in rad, rad/s."""
    lasting = off if abs(off) < MAX_LASTING_ERROR else 0.0
    return limited(integral + dt * gains.turn_rate * lasting, MAX_INTEGRAL * gains.turn_most)


@jit
def yaw_rate(off, integral, gains):
    """Return the yaw rate that corrects a heading error in rad, rad/s."""
    return limited(gains.turn * off + integral, gains.turn_most)


@jit
def response(speeds, values, speed):
    """Return the value of a column of the steering table at a speed.

    Args:
        speeds: of the table, m/s, ascending, shape (rows,).
        values: at these speeds, shape (rows,): the stride, or the yaw rate for each unit by which
            right strides exceed left ones, rad/s.
        speed: forward, m/s.

    """
    low, high, up = between_speeds(speeds, speed)
    return values[low] + up * (values[high] - values[low])
