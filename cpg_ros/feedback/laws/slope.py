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

"""Slope: keep feet under the body along gravity, not along the body's own vertical."""

import math

from cpg_ros.dynamics.integration.compilation import jit
from cpg_ros.feedback.laws.law import Gain, Law, limited, StateVariable

LAW = Law(
    'slope', 'move the feet under the centre of mass on slopes', True,
    gains={
        'slope_share': Gain(0.7, 7.0, '',
                            'fraction of the way to the vertical through the body by which feet '
                            'are moved'),
        'slope_share_up': Gain(0.45, 7.0, '',
                               'the same uphill in gaits whose legs swing two or more at a '
                               'time, where feet that are far ahead shorten strides'),
        'slope_height': Gain(0.3, 3.0, 'm', 'height of the body above its feet'),
        'slope_filter': Gain(0.5, 5.0, 's',
                             'time constant of the filter on the angles of the ground'),
        'slope_most': Gain(0.1, 1.0, 'm', 'the most that slope moves the feet')},
    memory={
        'ground_angles': StateVariable('low-passed roll and pitch [rad]', (2,))})


@jit
def shift_ahead(ground, singly, steps, gains):
    """Return how far to move all feet forward, m, on ground at an angle in rad, > 0 downhill.

    ``singly`` is 1 where legs swing one by one, and 0 where two or more swing at a time. There,
    feet move all the way the more the ground has ``steps``, 0 to 1: on stairs the body would fall
    backward off them.
    """
    uphill = gains.slope_share_up + singly * (gains.slope_share - gains.slope_share_up)
    uphill += (1.0 - singly) * steps * (1.0 - uphill)
    return shift(ground, gains.slope_share if ground > 0.0 else uphill, gains)


@jit
def shift(ground, fraction, gains):
    """Return how far to move all feet uphill, m, on ground at an angle in rad."""
    return limited(fraction * gains.slope_height * math.tan(ground), gains.slope_most)
