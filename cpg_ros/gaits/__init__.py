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

"""What a recording does: its steady stretch, stride, mean cycle, leg phases and gait.

Imports ``networks`` and ``files``; knows nothing of ROS.
"""

__all__ = [
           'foot_contacts',
           'insect_legs',
           'leg_motion',
           'leg_names',
           'leg_phases',
           'leg_strides',
           'mean_cycle',
           'period',
           'phase_average',
           'phase_change',
           'phase_estimation',
           'phase_scatter',
           'quality_checks',
           'recognition',
           'recording_like',
           'steady_stretch',
           'stride',
           'usable_joints',
           'waveform_comparison',
]
