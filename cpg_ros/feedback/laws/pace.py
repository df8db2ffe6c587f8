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

"""Pace: step faster for a while when pushed.

A gait at a higher frequency sways less and is faster than its efference copy expects, which looks
like a push. The law therefore fatigues, and weights the forward speed, which follows from the
frequency itself, less than the sideways speed. It acts only in gaits with measured steering:
others may lock into another motion at a higher frequency.
"""

import math

from cpg_ros.dynamics.integration.compilation import jit
from cpg_ros.feedback.laws.law import Gain, Law, StateVariable

LAW = Law(
    'pace', 'take faster strides for a while when the body is pushed', True,
    gains={
        'pace_from': Gain(0.12, 1.2, 'm/s',
                          'velocity error above which strides become faster'),
        'pace_forward': Gain(0.7, 1.0, '',
                             'fraction of the forward velocity error beside the sideways one'),
        'pace_gain': Gain(4.0, 40.0, 's/m',
                          'relative increase of the stride frequency per m/s above pace_from'),
        'pace_most': Gain(2.4, 8.0, '', 'largest relative increase of the stride frequency'),
        'pace_fatigue': Gain(0.5, 20.0, '',
                             'how many times the mean of recent increases is subtracted from '
                             'a new one'),
        'pace_memory': Gain(2.0, 20.0, 's', 'time constant of the mean of recent increases')},
    memory={
        'fatigue': StateVariable('low-passed relative increase of the stride frequency')})


@jit
def velocity_error(forward, left, gains):
    """Return the velocity error due to a push, m/s.

    Args:
        forward: velocity beyond the expected one, m/s.
        left: the same, to the left.
        gains: of the law.

    """
    return math.sqrt(left * left + (gains.pace_forward * forward)**2)


@jit
def frequency_change(error, fatigue, gains):
    """Return the relative increase of the stride frequency.

    Args:
        error: see velocity_error, m/s.
        fatigue: low-passed recent increase.
        gains: of the law.

    """
    fresh = min(max(gains.pace_gain * (error - gains.pace_from), 0.0), gains.pace_most)
    return max(fresh - gains.pace_fatigue * fatigue, 0.0)
