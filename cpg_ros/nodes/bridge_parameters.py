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

"""The parameters that every bridge has."""

from cpg_ros.nodes.command_topics import KINDS
from cpg_ros.nodes.parameter_spec import one_of, Spec


def bridge_specs(robot: str, **others: Spec) -> dict[str, Spec]:
    """Return the specs of a bridge's parameters.

    Args:
        robot: default robot file.
        others: the parameters that only this bridge has.

    """
    return {
        'robot': Spec(robot, 'robot file, or the name of a shipped one',
                      constraints='a shipped name, or the path of a YAML file'),
        **others,
        'command': Spec('joint_states', 'kind of command messages to follow',
                        constraints=one_of(KINDS)),
        'torque_factor': Spec(1.0, "fraction of the motors' torque limits that commands may use",
                              0.1, 1.0),
        'rate': Spec(500.0, 'commands per second [Hz]', 100.0, 1000.0),
        'sensor_rate': Spec(500.0, 'measured states published per second, at most [Hz]', 1.0,
                            1000.0),
        'target_timeout': Spec(0.1, 'time without a new target after which the robot sits down '
                               '[s]', 0.02, 1.0),
        'state_timeout': Spec(0.02, 'time without a new state, or without a tick of the bridge, '
                              'after which the robot is damped [s]', 0.005, 0.2),
        'watchdog_timeout': Spec(0.0, 'time without a tick of the bridge after which its watchdog '
                                 'damps the robot, which then stays damped [s]; 0 for '
                                 'state_timeout', 0.0, 5.0),
        'tilt': Spec(50.0, 'tilt of the body at which the robot is damped [deg]', 10.0, 90.0),
        'hottest': Spec(85.0, 'motor temperature at which the robot is damped [deg C]', 30.0,
                        110.0),
        'tracking_error': Spec(0.3, 'mean distance of a joint from its commanded angle at which '
                               'the robot sits down [rad]', 0.05, 3.0),
        'tracking_time': Spec(1.0, 'time over which that mean is taken [s]', 0.1, 10.0),
        'own_publishers': Spec(0, "number of the robot's own publishers on the command topic", 0,
                               4),
        'exclusive': Spec(True, 'make the robot sit down if more than one node publishes the '
                          'commands to follow; if false, follow them all'),
        'autostart': Spec(True, 'start the robot at launch; if false, wait for ~/start'),
        'dry_run': Spec(False, 'compute and log everything, but send nothing')}
