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

"""Feedback from sensors to the pattern: kinematics, estimate, laws, efference copy.

Imports ``motion``, ``robots`` and what is below; knows nothing of ROS. All of it works on many
robots at a time: arrays have a leading axis of runs, which is 1 for a robot alone.
"""

__all__ = ['biped', 'clearance', 'efference_copy', 'estimate', 'feedback', 'foot_force',
           'froude_scaling', 'gains', 'gait_tables', 'heading', 'input_monitor',
           'interpolation', 'kinematics', 'law', 'memory', 'odometry', 'pace', 'placement',
           'plausibility', 'posture', 'reflexes', 'sidestep', 'slope', 'speed', 'stiffen',
           'tegotae', 'tick', 'timetable', 'touchdown', 'virtual_stiffness', 'warm_up']
