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

"""A Unitree robot walks: ros2 launch cpg_ros go2_robot.launch.py gait:=walk.

Read docs/how_to/unitree.md first. The generator, and the bridge that leads the robot by Unitree's
messages; optionally feedback, a page in the browser and a recording. simulator:=true is for
Unitree's simulator on this computer.
"""

import os

from cpg_ros.ros.launch_arguments import declared, page, started, value
from cpg_ros.ros.launch_arguments import GENERATOR_ARGUMENTS as COMMON
from launch import LaunchDescription
from launch.actions import (
    ExecuteProcess,
    LogInfo,
    OpaqueFunction,
    SetEnvironmentVariable,
    Shutdown,
)
from launch.substitutions import LaunchConfiguration

BOTH = {
    'robot': ('unitree_go2', str, 'robot file, or a shipped name'),
    'command': ('forward_position', str, 'what moves the robot: joint_states, joint_trajectory or '
                'forward_position'),
}
GENERATOR = {
    **COMMON,
    'gait': ('trot', str, 'gait to start with'),
    'feedback.enabled': ('false', bool, 'correct the gait by IMU, joints and feet; tried in '
                         'simulation only'),
}
BRIDGE = {
    'model': ('go2', str, 'robot model, which determines the torque limits: go2, go1 or b2'),
    'torque_factor': ('1.0', float, "fraction of the motors' torque limits to use"),
    'state_timeout': ('0.02', float, 'time without a new state before the robot is damped [s]'),
    'dry_run': ('false', bool, 'compute and log everything, but send nothing'),
    'autostart': ('true', bool, 'start the robot at launch; if false, wait for ~/start'),
}
OTHERS = {
    'simulator': ('false', bool, "use Unitree's simulator instead of a robot: domain 1, and no "
                  'motion modes to release'),
    'domain': ('', int, 'ROS domain ID; empty for 0, or 1 with simulator'),
    'record': ('', str, 'bag in which to record commands and measurements; empty for none'),
}
#: Commands of the bridge -> of the generator.
COMMANDS = {'joint_states': 'none'}
#: What a bag gets.
RECORDED = ('joint_states', 'imu', 'foot_contacts', 'battery', 'cpg_generator/gait',
            'cpg_generator/phase', 'unitree_bridge/state')
#: Ctrl-C makes the robot sit down and rest, s, before it may be hurried.
SITTING = '8'


def nodes(context):
    """Return generator and bridge, and what sets their network."""
    simulator = value(context, 'simulator', bool)
    given = LaunchConfiguration('domain').perform(context)
    domain = value(context, 'domain', int) if given else int(simulator)
    command = LaunchConfiguration('command').perform(context)
    generator = {name: one for name, one in {**BOTH, **GENERATOR}.items() if name != 'command'}
    # LOCALHOST, which ROS's users often set, finds no participant of Unitree.
    network = {'ROS_DOMAIN_ID': str(domain), 'ROS_AUTOMATIC_DISCOVERY_RANGE': 'SUBNET'}
    found = [
        *(LogInfo(msg=f'{name} is {setting} for these nodes, not {os.environ[name]} as in this '
                  'shell (the argument domain selects the domain)')
          for name, setting in network.items() if os.environ.get(name, setting) != setting),
        *(SetEnvironmentVariable(*setting) for setting in network.items()),
        started(context, 'unitree_bridge', 'unitree_bridge', {**BOTH, **BRIDGE}, {
            'motion_switcher': not simulator}, on_exit=Shutdown(), sigterm_timeout=SITTING),
        # Its end makes the robot sit down; the bridge must be there to do it.
        started(context, 'generator', 'cpg_generator', generator, {
            'rate': 500.0, 'combined_topic': '', 'command': COMMANDS.get(command, command),
            # The bridge leads the robot from where it is.
            'assume_stand': True}),
        *page(context)]
    if bag := LaunchConfiguration('record').perform(context):
        space = LaunchConfiguration('namespace').perform(context).strip('/')
        found.append(ExecuteProcess(cmd=[
            'ros2', 'bag', 'record', '-o', bag,
            *(f'/{space}/{topic}'.replace('//', '/') for topic in RECORDED)], output='screen'))
    return found


def generate_launch_description():
    """Return generator and bridge, optionally in a namespace."""
    return LaunchDescription([*declared({**BOTH, **GENERATOR, **BRIDGE, **OTHERS}),
                              OpaqueFunction(function=nodes)])
