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

"""Pace: a body that is pushed steps faster."""

import math

from cpg_ros.integration.jit import jit


@jit
def hurry(forward, left, gains):
    """Return the factor of the stride frequency; velocities beyond what is expected, m/s."""
    pushed = math.hypot(forward, left)
    return 1.0 + min(max(gains.pace_gain * (pushed - gains.pace_from), 0.0), gains.pace_most)
