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

"""Posture: push with the legs of the low side, and keep swinging feet level to gravity."""

from cpg_ros.dynamics.integration.compilation import jit
from cpg_ros.feedback.laws.law import Gain, Law, limited

LAW = Law(
    'posture', 'keep the body level, through the legs in stance and the height of feet '
    'in swing', True,
    gains={
        'roll': Gain(1.6, 16.0, '1/rad',
                     'how far posture draws a foot in, per metre to the left and rad of roll'),
        'roll_rate': Gain(0.14, 1.4, 's/rad',
                          'how far posture draws a foot in, per metre to the left and rad/s '
                          'of roll rate'),
        'pitch': Gain(0.5, 11.0, '1/rad',
                      'how far posture lets a foot out, per metre to the front and rad of '
                      'pitch, in gaits whose legs swing two or more at a time'),
        'pitch_singly': Gain(1.1, 11.0, '1/rad', 'the same in gaits whose legs swing one by one'),
        'pitch_rate': Gain(0.062, 0.62, 's/rad',
                           'how far posture lets a foot out, per metre to the front and rad/s '
                           'of pitch rate'),
        'posture_most': Gain(0.08, 0.8, 'm', 'the most that posture moves a foot in stance')})


@jit
def in_stance(x, y, roll, pitch, roll_rate, pitch_rate, singly, gains):
    """Return how far to draw a foot in, m.

    Args:
        x: position forward of the middle of all standing feet, m.
        y: to the left of it, m.
        roll: beyond the expected one, rad.
        pitch: the same.
        roll_rate: the same, rad/s.
        pitch_rate: the same.
        singly: 1 where legs swing one by one, 0 where two or more swing at a time.
        gains: of the law.

    """
    per_pitch = gains.pitch + singly * (gains.pitch_singly - gains.pitch)
    return limited((gains.roll * roll + gains.roll_rate * roll_rate) * y
                   - (per_pitch * pitch + gains.pitch_rate * pitch_rate) * x, gains.posture_most)


@jit
def in_swing(x, y, roll, pitch, gains):
    """Return how far to draw a foot in so that its height is that of a level body, m."""
    return limited(pitch * x - roll * y, gains.posture_most)
