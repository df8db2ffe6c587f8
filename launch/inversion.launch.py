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

"""Fit what is on the joint topics: ros2 launch cpg_ros inversion.launch.py out:=fitted.yaml.

Then ``ros2 service call /cpg_inversion/fit std_srvs/srv/Trigger``, or every:=10.
"""

from cpg_ros.ros.launch_arguments import declared, page, started
from launch import LaunchDescription
from launch.actions import OpaqueFunction

ARGUMENTS = {
    'topics': ('[joint_states]', list[str], 'topics of sensor_msgs/JointState to listen to'),
    'robot': ('', str, 'robot file, or a shipped name; empty: legs identified by joint names'),
    'window': ('60.0', float, 'how much of the latest joint states to fit [s]; 0 for all'),
    'every': ('0.0', float, 'interval between automatic fits [s]; 0 for none'),
    'network': ('', str, "network to fit; empty: the robot's, or one for the number of legs"),
    'gait': ('', str, 'gait to fit; empty: the recognised gait'),
    'preset': ('', str, "preset for the parameters that are not free; empty: the gait's"),
    'free': ('', list[str], "parameters to fit, as [c, tau]; empty: the network's default ones"),
    'order': ('3', int, 'order of the readout, 1 to 3'),
    'kp': ('0.0', float, 'gain of the joints [N m/rad], to fit the commands; 0 fits the measured '
           'positions'),
    'kd': ('0.0', float, 'damping gain of the joints [N m s/rad]'),
    'out': ('', str, 'parameter file to write; empty for none'),
    'report': ('', str, 'HTML report to write; empty for none'),
    'apply_to': ('', str, 'generator to set after a fit, as /cpg_generator; empty for none'),
    'use_sim_time': ('false', bool, 'follow /clock'),
}


def inversion(context):
    """Return the node with those arguments that are not empty, and the page."""
    return [started(context, 'inversion', 'cpg_inversion', ARGUMENTS), *page(context)]


def generate_launch_description():
    """One inversion node, optionally in a namespace."""
    return LaunchDescription([*declared(ARGUMENTS), OpaqueFunction(function=inversion)])
