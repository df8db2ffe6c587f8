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

A gait that is hurried sways less and goes faster than its efference copy says, which would pass
for a push: so the law tires, and speed forward, which follows from the pace itself, is no matter
of it.
"""

import math

from cpg_ros.integration.jit import jit


@jit
def hurry(left, fatigue, gains):
    """Return what to add to the factor of the stride frequency.

    Args:
        left: velocity to the left beyond what is expected, m/s.
        fatigue: mean of what was added of late, see tire.
        gains: of the law.

    """
    fresh = min(max(gains.pace_gain * (abs(left) - gains.pace_from), 0.0), gains.pace_most)
    return max(fresh - gains.pace_fatigue * fatigue, 0.0)


@jit
def tire(fatigue, added, gains, dt):
    """Return the mean of what has been added to the factor of late, dt in s later."""
    return fatigue + (1.0 - math.exp(-dt / gains.pace_memory)) * (added - fatigue)
