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

"""Switch of a generator's feedback, controlled by parameters."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

from cpg_ros.dynamics.integration.compilation import COMPILED
from cpg_ros.feedback.biped.balanced_pattern import BalancedPattern
from cpg_ros.feedback.biped.gains import BipedGains
from cpg_ros.feedback.biped.gains import GAINS as BALANCE_GAINS
from cpg_ros.feedback.closed_loop import CONTACTS
from cpg_ros.feedback.estimate import Odometry, SCALE_ERROR
from cpg_ros.feedback.gains import GAINS as GAIN_OF
from cpg_ros.feedback.gains import Gains, LAWS, leg_length, robot_gains, shorter_times
from cpg_ros.feedback.input_checks import MAX_AGE, MAX_AGE_BALANCE, MAX_STAMP_OFFSET
from cpg_ros.feedback.kinematics import Geometry, geometry_of, GRAVITY
from cpg_ros.feedback.laws.law import Gain
from cpg_ros.motion.body_file import GAIT_SPEEDS
from cpg_ros.motion.pattern import Pattern
from cpg_ros.motion.plan import GaitPlan
from cpg_ros.motion.robot import Robot
from cpg_ros.motion.strides import StrideCommand
from cpg_ros.ros.command_topics import held_block, kp_scale_block
from cpg_ros.ros.feedback.loop import BalanceLoop, FeedbackLoop, Motion
from cpg_ros.ros.feedback.odometry import odometry_block
from cpg_ros.ros.feedback.sensor_input import SensorInput
from cpg_ros.ros.kernels import announced, BALANCE_TIME, compile_apart, FEEDBACK_TIME
from cpg_ros.ros.node.message_block import MessageBlock
from cpg_ros.ros.node.node_base import StartError
from cpg_ros.ros.node.parameters import fixed, one_of, Spec
import numpy as np
from rclpy.parameter import Parameter

# The parameters of the feedback: its laws, their gains, and the topics it subscribes to.

PREFIX = 'feedback.'
#: ENABLED: name of the switch; FORMER: its name in earlier releases. FORMER is
#: also the beginning of other names, which ``ros2 param dump`` cannot nest.
ENABLED, FORMER = f'{PREFIX}enabled', PREFIX.rstrip('.')
#: SWITCH: the switch; its default is false for robots without feedback.
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
    f'{PREFIX}max_delay': Spec(MAX_AGE, 'largest age of measurements when they are used, by their '
                               'stamps [s]: feedback fades out above it; '
                               f"by default {MAX_AGE:g}, less for legs shorter than a Go2's, and "
                               f'{MAX_AGE_BALANCE:g} for a robot with soles',
                               0.001, MAX_STAMP_OFFSET),
    f'{PREFIX}odometry_topic': Spec('', 'topic of the nav_msgs/Odometry, computed from the '
                                    "robot's legs and IMU, such as odom; none by default"),
    f'{PREFIX}odometry_scale': Spec(1.0, 'true distance divided by odometry distance, for this '
                                    'robot and ground', 0.5, 2.0),
    f'{PREFIX}odometry_scale_error': Spec(SCALE_ERROR, 'standard deviation of that scale, for the '
                                          'covariance; measured values were about 0.015', 0.0,
                                          0.5),
    f'{PREFIX}odom_frame': Spec('odom', 'frame of that odometry, which begins at the base'),
    f'{PREFIX}base_frame': Spec('base_link', "frame of the robot's base"),
    f'{PREFIX}odometry_tf': Spec(True, 'publish the transform between these frames on /tf, too, '
                                 'where tf2_msgs is installed')})
#: Switches of the laws and gains, all of which can be set at any time.


def _specs(gains: Mapping[str, Gain], values: Any) -> dict[str, Spec]:
    return {f'{PREFIX}{name}': Spec(getattr(values, name), f'{gain.text} [{gain.unit}]'
                                    if gain.unit else gain.text, gain.low, gain.high)
            for name, gain in gains.items()}


def of_gains(usual: Gains) -> dict[str, Spec]:
    """Return the parameters of the laws, with these gains as defaults."""
    return {**{f'{PREFIX}{law.name}': Spec(getattr(usual, law.name), law.text) for law in LAWS},
            **_specs(GAIN_OF, usual)}


#: GAINS: the same for a Go2.
GAINS = of_gains(Gains())
SPECS = {**TOPICS, **GAINS}
#: The same of bipeds with soles; the generator's parameter ``frequency`` is their clock's.
BIPED_GAIN_OF = {name: gain for name, gain in BALANCE_GAINS.items() if name != 'frequency'}
BIPED_GAINS = _specs(BIPED_GAIN_OF, BipedGains())


def specs(robot: Robot) -> dict[str, Spec]:
    """Return all parameters of a robot's feedback except its switch.

    Raises:
        InputError: the robot file has gains of a biped that cannot be used.

    """
    mount = robot.feedback.imu_mount if robot.feedback is not None else ()
    short = 1.0 if robot.geometry is None else shorter_times(leg_length(geometry_of(robot)))
    latest = MAX_AGE_BALANCE if robot.biped is not None else round(MAX_AGE * short, 4)
    topics = {**TOPICS, **{f'{PREFIX}{name}': replace(TOPICS[f'{PREFIX}{name}'], default=value)
                           for name, value in (('imu_mount', list(mount) or [0.0] * 3),
                                               ('max_delay', latest))}}
    if robot.biped is None:
        return {**topics, **of_gains(robot_gains(robot))}
    return {**topics, **_specs(BIPED_GAIN_OF, BipedGains.of_body(robot.biped))}


def missing_requirements(robot: Robot) -> str:
    """Return a requirement of feedback that the machine or the robot file lacks, or ''."""
    if not COMPILED:
        return 'it needs numba, which is not installed'
    if robot.biped is not None:
        return ''
    if robot.geometry is None:
        return f"robot file '{robot.name}' has no geometry of the legs (part geometry)"
    if all(motion.efference is None for motion in robot.motions.values()):
        return f"robot file '{robot.name}' has no gait with an efference copy (gaits.*.efference)"
    return ''


def partial_legs(robot: Robot) -> list[str]:
    """Return a line for each leg that gets only some of the corrections."""
    legs_of_geometry = robot.geometry.legs if robot.geometry is not None else {}
    return [f'feedback moves the leg {leg} forward and up only: it has no hip that abducts'
            if leg in legs_of_geometry else
            f'feedback leaves the leg {leg} alone: the robot file has no geometry of it'
            for leg in robot.legs if leg not in legs_of_geometry
            or len(legs_of_geometry[leg].joints) == 2]


def default_enabled(node: Any, robot: Robot, combined: str, commands: bool) -> Spec:
    """Return the parameter that enables the feedback; its default is true if nothing prevents it.

    With controllers it is false: the user enables it after a check of the sensors' signs.

    Args:
        node: that has declared the feedback's topics.
        robot: to correct.
        combined: topic of all joints that the node publishes, or ''.
        commands: whether the node commands controllers.

    """
    measured = node.get_parameter(f'{PREFIX}joint_states_topic').value
    own = combined and (node.resolve_topic_name(combined) == node.resolve_topic_name(measured))
    helps = robot.feedback is None or robot.feedback.enabled
    able = helps and not (own or missing_requirements(robot))
    if able and commands and ENABLED not in node._parameter_overrides:
        node.get_logger().info("feedback is off, as by default with a robot's controllers: set "
                               f'{ENABLED} to true once its sensors are checked')
    return replace(SWITCH, default=able and not commands)


class FeedbackSwitch:
    """Feedback of a generator, created when it is first switched on.

    Attributes:
        loop: a FeedbackLoop, or the BalanceLoop of a robot with soles; None until it is first on.
        blocks: its messages, which ``tick.c`` publishes.

    """

    def __init__(self, node: Any, pattern: Pattern, motion: Motion, own: Sequence[str]) -> None:
        """Switch the feedback on if the node's parameters say so.

        Args:
            node: a StartedNode.
            pattern: to correct; a BalancedPattern for a robot with soles.
            motion: returns the wanted motion of the robot.
            own: topics that the node publishes itself, resolved.

        Raises:
            StartError: the feedback is enabled, but cannot be on.

        """
        self._node, self._pattern, self._motion, self._own = node, pattern, motion, own
        self._biped = pattern.robot.biped
        self.loop: Any = None
        self._delays_logged = False
        self.blocks: list[MessageBlock] = []
        if reason := self.validate([node.get_parameter(ENABLED)]):
            raise StartError(reason)
        self._hindrance = ''
        #: Whether the robot may already move.
        self._started = False
        self.apply()
        self._started = True

    def _value(self, name: str) -> Any:
        return self._node.get_parameter(PREFIX + name).value

    def validate_setup(self) -> str:
        """Return why the feedback cannot be on, or ''."""
        if self._biped is not None and self._value('contacts') == 'efforts':
            return ("feedback.contacts 'efforts' is for feet that are points: a robot with soles "
                    'needs foot_contacts or wrenches')
        if missing := missing_requirements(self._pattern.robot):
            return missing
        topic = self._node.resolve_topic_name(self._value('joint_states_topic'))
        if topic in self._own:
            return (f"feedback.joint_states_topic '{topic}' is the generator's own: set "
                    "combined_topic to '', or name the robot's topic")
        return ''

    def validate(self, parameters: Sequence[Parameter]) -> str:
        """Return why a batch of changes is rejected, or ''."""
        switched_on = any(parameter.name == ENABLED and parameter.value is True
                          for parameter in parameters)
        reason = self.validate_setup() if switched_on else ''
        return f'no feedback: {reason}' if reason else ''

    def validate_plan(self, plan: GaitPlan) -> str:
        """Return why a gait cannot run, or ''; point feet run it without an efference copy."""
        if self._biped is None or plan.balanced or not self._value('enabled'):
            return ''
        return f'gait {plan.gait} cannot be balanced (supported: {", ".join(GAIT_SPEEDS)})'

    def apply(self) -> None:
        """Apply the parameters."""
        enabled = self._node.get_parameter(ENABLED).value and not self.validate_setup()
        if enabled and self.loop is None:
            self.loop = self._make_balance() if self._biped is not None else self._make()
        if self.loop is not None:
            self.loop.set_gains(Gains(*map(self._value, Gains._fields)) if self._biped is None else
                                BipedGains(**{name: self._value(name) for name in BIPED_GAIN_OF}))
            self.loop.enabled = enabled and not self._hindrance

    def hinder(self, reason: str) -> None:
        """Fade the feedback out as long as there is a reason, '' for none; a biped would fall."""
        if self._biped is None:
            self._hindrance = reason
            if self.loop is not None:
                self.apply()

    def _make(self) -> FeedbackLoop:
        """Return the loop, with compiled kernels."""
        # It loads numba.
        from cpg_ros.feedback.by_address import warm_up
        robot, pattern = self._pattern.robot, self._pattern
        geometry = geometry_of(robot)
        if self._started:
            compile_apart(self._node, 'feedback', 'feedback', FEEDBACK_TIME, moving=True)
        with announced(self._node, 'the feedback', FEEDBACK_TIME):
            warm_up(geometry, len(robot.joints))
        topic = self._value('odometry_topic')
        odometry = Odometry.begin(self._value('odometry_scale'), self._value(
            'odometry_scale_error')) if topic else None
        loop = FeedbackLoop(pattern, geometry, self._inputs(geometry), self._motion, odometry)
        if pattern.strides is None:
            # Speed and heading are closed by the strides.
            pattern.attach(StrideCommand(len(robot.legs)))
        for line in partial_legs(robot):
            self._node.get_logger().warning(line)
        self.blocks.append(kp_scale_block(self._node, loop.feedback.memory.kp_scale))
        if odometry is not None:
            self.blocks.append(odometry_block(
                self._node, odometry, topic,
                (self._value('odom_frame'), self._value('base_frame')),
                self._value('odometry_tf'), loop.fraction_array))
        return loop

    def _make_balance(self) -> BalanceLoop:
        """Return the loop of a biped, with compiled kernels."""
        pattern, biped = self._pattern, self._biped
        assert isinstance(pattern, BalancedPattern) and biped is not None
        if self._started:
            compile_apart(self._node, 'balance', 'balance', BALANCE_TIME, moving=True)
        inputs = self._inputs(GRAVITY * biped.total)
        if self._value('odometry_topic'):
            self._node.get_logger().warning('no odometry: there is none for legs with soles yet')
        with announced(self._node, 'the feedback', BALANCE_TIME):
            loop = BalanceLoop(pattern, inputs, self._motion)
        if loop.feedback.arms.swings.any():
            self.blocks.append(held_block(self._node, pattern.robot, pattern.held_angles))
        return loop

    def _inputs(self, geometry: Geometry | float) -> SensorInput:
        mount = self._value('imu_mount')
        if len(mount) != 3 or not np.isfinite(mount).all():
            raise StartError(f'feedback.imu_mount is {list(mount)}: it must be roll, pitch and '
                             'yaw in rad')
        return SensorInput(self._node, self._pattern.robot, geometry, *map(self._value, (
            'imu_topic', 'joint_states_topic', 'contacts', 'contacts_topic', 'imu_mount',
            'max_delay')))

    def learn(self, plan: GaitPlan) -> None:
        """Tabulate a gait before the pattern changes to it."""
        if self.loop is not None:
            self.loop.learn(plan)

    def renew(self) -> None:
        """Pass requests on to ticks outside the interpreter; log delays once they matter."""
        if self.loop is None:
            return
        self.loop.renew()
        if news := self.loop.news():
            self._node.get_logger().warning(news)
        if self.loop.fraction > 0.0 and not self._delays_logged:
            self._delays_logged = True
            delays = [f'{name} {1e3 * delay:.1f} ms'
                      for name, delay in self.loop.inputs.latencies().items()]
            self._node.get_logger().info(
                'feedback: age of the measurements when they are used: '
                f'{", ".join(delays) or "unknown, messages have no stamps"} '
                f'(feedback.max_delay {1e3 * self._value("max_delay"):.0f} ms)')

    def restart(self) -> None:
        """Restart after a jump back of simulated time."""
        if self.loop is not None:
            self.loop.restart()

    @property
    def active(self) -> bool:
        """Whether the gait is being corrected."""
        return self.loop is not None and self.loop.fraction > 0.0

    @property
    def recovering(self) -> bool:
        """Whether the robot recovers from a push, with strides faster than servos can follow."""
        return (self._biped is None and self.loop is not None
                and bool(self.loop.feedback.memory.stiff_for[0] > 0.0))

    @property
    def out(self) -> str:
        """Reason why active feedback is interrupted, or ''."""
        loop = self.loop
        return loop.faults if loop is not None and loop.enabled and not loop.waiting else ''

    def state(self, now: float) -> dict[str, str]:
        """Return its state and the ages of its inputs, for /diagnostics; now in s."""
        loop = self.loop
        if loop is None:
            return {'feedback': 'off'}
        law = self._biped is None and self._value('servo_gains') and self._value('servo_kp')
        return {'feedback': loop.state if loop.enabled else 'off',
                **({'kp, kd of the servos / expected': '{:.2f}, {:.2f}'.format(*loop.servo_ratios)}
                   if law else {}),
                **{f'age of {name} [ms]': f'{1e3 * age:.1f}'
                   for name, age in loop.inputs.ages(now).items()},
                **{f'delay of {name} [ms]': f'{1e3 * delay:.1f}'
                   for name, delay in loop.inputs.latencies().items()},
                'largest delay [ms]': f'{1e3 * self._value("max_delay"):.1f}'}
