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

"""Start the generator: ros2 launch cpg_ros generator.launch.py network:=biped gait:=skip."""

from cpg_ros.ros.launch_arguments import declared, page, started
from launch import LaunchDescription
from launch.actions import OpaqueFunction

ARGUMENTS = {
    'network': ('delayed', str, 'delayed, quadruped, biped, phase, hopf, matsuoka, one of them '
                'with a number of legs such as phase6, or the path of a Python file with one'),
    'gait': ('', str, "gait, or the name of a preset; empty for the network's usual one"),
    'presets': ('', str, 'file with additional presets; empty for none'),
    'robot': ('', str, "robot file, or a shipped name; empty for the network's usual one"),
    'rate': ('100.0', float, 'messages per second [Hz]'),
    'frequency': ('', float, "strides per second [Hz]; empty for the gait's usual one"),
    'amplitude': ('1.0', float, "factor on the robot file's amplitudes"),
    'command': ('none', str, 'none, joint_trajectory or forward_position'),
    'cmd_vel': ('false', bool, 'follow the commands on cmd_vel (geometry_msgs/Twist); the robot '
                'file must have steering tables'),
    'stamped_cmd_vel': ('false', bool, 'cmd_vel is a geometry_msgs/TwistStamped'),
    'assume_stand': ('false', bool, 'begin at the stand where no pose is measured, although '
                     'command is not none'),
    'autostart': ('true', bool, 'ramp into the gait at start'),
    'use_sim_time': ('false', bool, 'follow /clock'),
}


def generator(context):
    """Return the node with those arguments that are not empty, and the page."""
    return [started(context, 'generator', 'cpg_generator', ARGUMENTS), *page(context)]


def generate_launch_description():
    """One generator, optionally in a namespace."""
    return LaunchDescription([*declared(ARGUMENTS), OpaqueFunction(function=generator)])
