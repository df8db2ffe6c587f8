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

"""Pace: a body that is pushed sideways steps faster, for a while.

A gait at a higher frequency sways less and is faster than its efference copy says, which would
pass for a push. The law therefore fatigues, and it disregards the forward speed, which follows
from the frequency itself.
"""

import math

from cpg_ros.feedback.law import Gain, Law, StateVariable
from cpg_ros.integration.jit import jit

LAW = Law(
    'pace', 'take faster strides for a while when the body is pushed sideways', True,
    gains={
        'pace_from': Gain(0.12, 1.2, 'm/s',
                          'sideways velocity error above which strides become faster'),
        'pace_gain': Gain(4.0, 40.0, 's/m',
                          'relative increase of the stride frequency per m/s above pace_from'),
        'pace_most': Gain(0.8, 8.0, '', 'largest relative increase of the stride frequency'),
        'pace_fatigue': Gain(2.0, 20.0, '',
                             'how many times the mean of recent increases is subtracted from '
                             'a new one'),
        'pace_memory': Gain(2.0, 20.0, 's', 'time constant of the mean of recent increases')},
    memory={
        'fatigue': StateVariable('low-passed relative increase of the stride frequency')})


@jit
def frequency_change(left, fatigue, gains):
    """Return the relative increase of the stride frequency.

    Args:
        left: velocity to the left beyond what is expected, m/s.
        fatigue: mean of the recent increases, see update_fatigue.
        gains: of the law.

    """
    fresh = min(max(gains.pace_gain * (abs(left) - gains.pace_from), 0.0), gains.pace_most)
    return max(fresh - gains.pace_fatigue * fatigue, 0.0)


@jit
def update_fatigue(fatigue, added, gains, dt):
    """Return the low-passed increase of the stride frequency, dt in s later."""
    return fatigue + (1.0 - math.exp(-dt / gains.pace_memory)) * (added - fatigue)
