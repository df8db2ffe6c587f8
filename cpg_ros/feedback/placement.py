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

"""Placement: a body that goes too fast steps further that way."""

import math

from cpg_ros.integration.jit import jit


@jit
def step(velocity, turning, gain, rate_gain, gains):
    """Return how much further to put feet down, m, forward or to the left.

    Args:
        velocity: that way beyond what is expected, m/s.
        turning: of pitch or roll beyond what is expected, rad/s.
        gain: of the first.
        rate_gain: of the second.
        gains: of the law.

    """
    return min(max(gain * velocity + rate_gain * turning, -gains.step_most), gains.step_most)


@jit
def swing(way, wanted, gains, dt):
    """Move a foot in the air towards its step; ways in m, dt in s."""
    return way + (1.0 - math.exp(-dt / gains.step_filter)) * (wanted - way)


@jit
def stand(way, giving, gains, dt):
    """Let a foot on the ground go back, and give way at a speed in m/s."""
    found = way * math.exp(-gains.step_decay * dt) - dt * giving
    return min(max(found, -gains.step_most), gains.step_most)
