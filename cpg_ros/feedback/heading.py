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

"""Heading: a robot that is turned away turns back."""

import math

from cpg_ros.integration.jit import jit


@jit
def turn(wanted, yaw, gains):
    """Return the yaw rate to ask of the legs, rad/s; headings in rad."""
    error = (wanted - yaw + math.pi) % (2.0 * math.pi) - math.pi
    return min(max(gains.turn * error, -gains.turn_most), gains.turn_most)
