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

"""Slope: feet under the body along gravity, not along the body."""

import math

from cpg_ros.integration.jit import jit


@jit
def follow(ground, lean, gains, dt):
    """Return the low-passed angle of the ground, rad, dt in s later."""
    return ground + (1.0 - math.exp(-dt / gains.slope_filter)) * (lean - ground)


@jit
def shift(ground, gains):
    """Return how far to move all feet uphill of an angle in rad, m."""
    far = gains.slope_share * gains.slope_height * math.tan(ground)
    return min(max(far, -gains.slope_most), gains.slope_most)
