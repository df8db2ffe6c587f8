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

"""Stiffening: make servos stiff while the body recovers from a push, and soft otherwise.

Soft servos walk at low cost and yield to stairs; only stiff ones follow the fast, wide steps that
bring a pushed body back under control.
"""

from cpg_ros.dynamics.integration.compilation import jit
from cpg_ros.feedback.laws.law import Gain, Law, StateVariable

LAW = Law(
    'stiffen', 'make the servos stiff while the body recovers from a push', True,
    gains={
        'stiffen_from': Gain(1.0, 10.0, 'm/s',
                             'velocity error, as of pace, above which servos become stiff'),
        'stiffen_hold': Gain(0.8, 8.0, 's', 'time for which they stay stiff after such an error'),
        # Drivers take a factor below 1 for 1.
        'stiffen_kp': Gain(2.0, 4.0, '', "factor by which the servos' proportional gain is higher "
                           'while stiff', low=1.0)},
    memory={
        'stiff_for': StateVariable('time for which servos stay stiff [s]'),
        'stiff': StateVariable('whether servos are stiff, by gains or targets', (), False),
        'kp_scale': StateVariable("factor of the servos' proportional gain", (), 1.0)})


@jit
def remaining(before, error, gains, dt):
    """Return the time for which servos stay stiff, s.

    Args:
        before: the same, dt in s earlier.
        error: velocity error, m/s, see pace.velocity_error.
        gains: of the law.
        dt: s.

    """
    return gains.stiffen_hold if error > gains.stiffen_from else max(before - dt, 0.0)
