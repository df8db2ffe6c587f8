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

"""The two rhythms of two_rhythms, of which the second is heard a delay ago."""

from dataclasses import dataclass

from cpg_ros.networks.definition import Range
from two_rhythms import OTHER, TwoRhythms


@dataclass(frozen=True)
class LateTwoRhythms(TwoRhythms):
    """z of the other leg is heard a delay ago."""

    tau: float = 0.4

    name = 'late_two_rhythms'
    delay_parameter = 'tau'
    longest_delay = 2.0
    ranges = {**TwoRhythms.ranges, 'tau': Range(0.01, 2.0, 'delay [model time]')}

    @staticmethod
    def heard(cell):
        return cell.past(OTHER)
