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

"""ROS 2 nodes: parameters, topics, services and clocks; the mathematics is below.

Imports every subpackage but ``tools``.
"""

__all__ = ['bag_recorder', 'balance_loop', 'balance_switch', 'bounded_request', 'bridge_base',
           'bridge_interface', 'bridge_loop', 'bridge_parameters', 'bridge_start', 'cmd_vel',
           'command_topics', 'console', 'deadline_thread', 'diagnostics', 'feedback_loop',
           'feedback_parameters', 'feedback_switch', 'generator', 'generator_parameters',
           'health_publisher', 'held_joints', 'inversion_node', 'joint_publishers',
           'joint_tracking', 'kernels', 'kp_scale', 'launch_arguments', 'lifecycle',
           'local_socket', 'lockstep', 'log_queue', 'measured_pose', 'message_block',
           'message_types', 'node_base', 'node_client', 'odometry_messages', 'odometry_publisher',
           'other_publishers', 'parameter_services', 'parameter_spec', 'polled_group',
           'qos_profiles', 'raw_messages', 'real_time', 'robot_sim', 'sensor_input',
           'sensor_publishers', 'servos', 'shutdown', 'start_progress', 'transport', 'unitree',
           'watchdog', 'watchdog_link']
