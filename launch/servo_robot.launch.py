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

"""A robot of servos walks: ros2 launch cpg_ros servo_robot.launch.py robot:=R calibration:=C.

Read docs/how_to/servos.md first. The generator, the bridge that leads the robot, and the bus that
its servos are on. The robot lies still until the bridge's service ~/start is called.
"""

from cpg_ros.ros.launch_arguments import declared, GENERATOR_ARGUMENTS, page, started
from launch import LaunchDescription
from launch.actions import OpaqueFunction, Shutdown

ROBOT = {'robot': ('', str, 'robot file, or a shipped name')}
SERVOS = {
    'calibration': ('', str, 'calibration file of the servos'),
    'rate': ('50.0', float, 'commands per second [Hz]'),
}
BRIDGE = {
    'dry_run': ('false', bool, 'compute and log everything, but send nothing'),
    'autostart': ('false', bool, 'start the robot at launch; if false, wait for ~/start'),
}
BUS = {
    'no_position_feedback': ('false', bool, 'drive servos that do not report their position, as '
                             'those of a PCA9685, the robot lying in its rest pose'),
}
COMMAND = {'command': 'forward_position'}
#: Ctrl-C makes the robot sit down and rest, s, before it may be hurried.
SITTING = '8'


def nodes(context):
    """Return bus, bridge and generator."""
    return [
        # It gets Ctrl-C with the bridge, whose way down it has to wait for.
        started(context, 'servo_bus', 'servo_bus', {**SERVOS, **BUS},
                {'end_timeout': float(SITTING)}, on_exit=Shutdown(), sigterm_timeout=SITTING),
        started(context, 'servo_bridge', 'servo_bridge', {**ROBOT, **SERVOS, **BRIDGE}, COMMAND,
                on_exit=Shutdown(), sigterm_timeout=SITTING),
        # Its end makes the robot sit down; the bridge must be there to do it.
        started(context, 'generator', 'cpg_generator', {
            **ROBOT, **GENERATOR_ARGUMENTS, 'rate': SERVOS['rate']}, {
                # The bridge leads the robot from where it is.
                'combined_topic': '', 'assume_stand': True, **COMMAND}),
        *page(context)]


def generate_launch_description():
    """Return bus, bridge and generator, optionally in a namespace."""
    return LaunchDescription([
        *declared({**ROBOT, **SERVOS, **BUS, **GENERATOR_ARGUMENTS, **BRIDGE}),
        OpaqueFunction(function=nodes)])
