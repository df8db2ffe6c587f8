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

"""The parameters of the feedback: its laws, their gains, and the topics that it listens to."""

from collections.abc import Callable
from dataclasses import replace
from typing import Any

from cpg_ros.feedback.biped.gains import BipedGains
from cpg_ros.feedback.biped.gains import GAINS as BIPED_GAIN_OF
from cpg_ros.feedback.froude_scaling import robot_gains
from cpg_ros.feedback.gains import GAINS as GAIN_OF
from cpg_ros.feedback.gains import Gains, LAWS
from cpg_ros.feedback.input_monitor import DELAYED, LATE, LATE_BALANCE
from cpg_ros.feedback.odometry import SCALE
from cpg_ros.nodes.parameter_spec import fixed, one_of, Spec
from cpg_ros.nodes.sensor_input import CONTACTS
from cpg_ros.robots.robot import Robot

PREFIX = 'feedback.'
#: The switch, which has been PREFIX without its dot: no name is the beginning of another, or
#: ``ros2 param dump`` could not nest them.
ENABLED, FORMER = f'{PREFIX}enabled', PREFIX.rstrip('.')
#: Its default is false where the feedback cannot be on.
SWITCH = Spec(True, "correct the gait by the robot's sensors; false by default if the robot file "
              'is not calibrated, if the generator itself publishes the topic joint_states '
              "that it would measure from, or if it commands a robot's controllers (command)")

#: Topics, read when the feedback is first switched on.
TOPICS = fixed({
    f'{PREFIX}imu_topic': Spec('imu', "topic of the robot's sensor_msgs/Imu, which must have an "
                               'orientation'),
    f'{PREFIX}joint_states_topic': Spec('joint_states', "topic of the robot's measured "
                                        'sensor_msgs/JointState, which must have velocities'),
    f'{PREFIX}contacts': Spec('foot_contacts', 'source of the loads on the feet: one message '
                              'with all of them, a geometry_msgs/WrenchStamped for each leg, or '
                              'the efforts of the measured joints', constraints=one_of(CONTACTS)),
    f'{PREFIX}contacts_topic': Spec('foot_contacts', 'topic of the std_msgs/Float64MultiArray '
                                    'with the loads on the feet in N; with wrenches, the name of '
                                    "each leg's own topic, as in lh/foot_contacts"),
    f'{PREFIX}imu_mount': Spec([0.0, 0.0, 0.0], "roll, pitch and yaw of the IMU's frame in that "
                               'of the base [rad], as in the origin of its URDF joint; by default '
                               'that of the robot file'),
    f'{PREFIX}max_delay': Spec(LATE, 'largest age of measurements when they are used, by their '
                               'stamps, low-passed over 0.1 s [s]: feedback fades out above it; '
                               f'by default {LATE:g}, and {LATE_BALANCE:g} for a robot with soles',
                               0.001, DELAYED),
    f'{PREFIX}odometry_topic': Spec('', 'topic of the nav_msgs/Odometry, where the base is by the '
                                    "robot's legs and IMU, such as odom; none by default"),
    f'{PREFIX}odometry_scale': Spec(1.0, 'true way over the way by odometry, of the robot and its '
                                    'ground', 0.5, 2.0),
    f'{PREFIX}odometry_scale_error': Spec(SCALE, 'standard deviation of that scale, for the '
                                          'covariance: about 0.015 where it was measured', 0.0,
                                          0.5),
    f'{PREFIX}odom_frame': Spec('odom', 'frame of that odometry, which begins where the base is'),
    f'{PREFIX}base_frame': Spec('base_link', "frame of the robot's base"),
    f'{PREFIX}odometry_tf': Spec(True, 'publish the transform between these frames on /tf, too, '
                                 'where tf2_msgs is installed')})
#: Switches of the laws and gains, all of which can be set at any time.


def of_gains(usual: Gains) -> dict[str, Spec]:
    """Return the parameters of the laws, whose defaults are these gains."""
    return {**{f'{PREFIX}{law.name}': Spec(getattr(usual, law.name), law.text) for law in LAWS},
            **{f'{PREFIX}{name}': Spec(getattr(usual, name), f'{gain.text} [{gain.unit}]'
                                       if gain.unit else gain.text, gain.low, gain.high)
               for name, gain in GAIN_OF.items()}}


#: Those of a Go2.
GAINS = of_gains(Gains())
SPECS = {**TOPICS, **GAINS}
#: The same of bipeds with soles; the generator's parameter ``frequency`` is their clock's.
BIPED_GAINS = {f'{PREFIX}{name}': Spec(gain.default, f'{gain.text} [{gain.unit}]' if gain.unit
                                       else gain.text, gain.low, gain.high)
               for name, gain in BIPED_GAIN_OF.items() if name != 'frequency'}


def specs(robot: Robot) -> dict[str, Spec]:
    """Return all parameters of a robot's feedback but its switch.

    Raises:
        InputError: the robot file has gains of a biped that cannot be used.

    """
    mount = robot.feedback.imu_mount if robot.feedback is not None else ()
    balanced = robot.biped is not None
    topics = {**TOPICS, **{f'{PREFIX}{name}': replace(TOPICS[f'{PREFIX}{name}'], default=value)
                           for name, value in (('imu_mount', list(mount) or [0.0] * 3),
                                               ('max_delay', LATE_BALANCE if balanced else LATE))}}
    if robot.biped is None:
        return {**topics, **of_gains(robot_gains(robot))}
    own = BipedGains.of_body(robot.biped)
    return {**topics, **{name: replace(spec, default=getattr(own, name.removeprefix(PREFIX)))
                         for name, spec in BIPED_GAINS.items()}}


def gains(value: Callable[[str], Any]) -> Gains:
    """Return the gains; ``value`` returns that of a parameter, by its name behind PREFIX."""
    return Gains(*map(value, Gains._fields))


def biped_gains(value: Callable[[str], Any]) -> BipedGains:
    """Return a biped's gains in its walk, the same way."""
    return BipedGains(**{name: value(name) for name in BIPED_GAIN_OF if name != 'frequency'})
