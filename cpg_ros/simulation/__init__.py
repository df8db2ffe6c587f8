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

"""Physics: a robot's body in MuJoCo, tuned gaits, pictures of it and of its footfalls.

Imports ``feedback``, ``motion``, ``robots`` and what is below; knows nothing of ROS.
"""

__all__ = ['batch', 'biped_description', 'biped_run', 'biped_tuning', 'bodies', 'body', 'camera',
           'closed_loop', 'efference_measurement', 'feedback_benefit', 'feedback_tuning',
           'foot_path', 'footfall_diagram', 'gait_design', 'inertia', 'inertial_unit',
           'labelled_walks', 'leg_geometry', 'mesh_hull', 'mjcf_description', 'model_indices',
           'nearest_design', 'pattern_batch', 'proprioception', 'robot_model', 'run_metrics',
           'run_recorder', 'scenario', 'servo_gains', 'soft_start', 'sprawled_leg',
           'steering_table', 'terrain', 'tuned_gait', 'tuning', 'urdf_model', 'walk_bag']
