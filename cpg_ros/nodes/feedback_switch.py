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

"""Switches the feedback of a generator on and off, as its parameters say."""

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

from cpg_ros.feedback.kinematics import Geometry, geometry_of
from cpg_ros.feedback.odometry import Odometry
from cpg_ros.feedback.warm_up import warm_up
from cpg_ros.integration.jit import COMPILED
from cpg_ros.motion.pattern import Pattern
from cpg_ros.motion.plan import GaitPlan
from cpg_ros.motion.strides import Drive
from cpg_ros.nodes import feedback_parameters
from cpg_ros.nodes.feedback_loop import FeedbackLoop, Motion
from cpg_ros.nodes.feedback_parameters import ENABLED, PREFIX
from cpg_ros.nodes.kernels import announced, compile_apart, FEEDBACK
from cpg_ros.nodes.kp_scale import KpScalePublisher
from cpg_ros.nodes.node_base import StartError
from cpg_ros.nodes.odometry_publisher import OdometryPublisher
from cpg_ros.nodes.parameter_spec import Spec
from cpg_ros.nodes.sensor_input import SensorInput
from cpg_ros.robots.robot import Robot
import numpy as np
from rclpy.parameter import Parameter


def lacking(robot: Robot) -> str:
    """Return what feedback needs, and this machine or the robot file lacks, or ''."""
    if not COMPILED:
        return 'it needs numba, which is not installed'
    if robot.biped is not None:
        return ''
    if robot.geometry is None:
        return f"robot file '{robot.name}' has no geometry of the legs (part geometry)"
    if all(motion.efference is None for motion in robot.motions.values()):
        return f"robot file '{robot.name}' has no gait with an efference copy (gaits.*.efference)"
    return ''


def shortfalls(robot: Robot) -> list[str]:
    """Return a line for each leg that gets only some of the corrections."""
    known = robot.geometry.legs if robot.geometry is not None else {}
    return [f'feedback moves the leg {leg} forward and up only: it has no hip that abducts'
            if leg in known else
            f'feedback leaves the leg {leg} alone: the robot file has no geometry of it'
            for leg in robot.legs if leg not in known or len(known[leg].joints) == 2]


def usual(node: Any, robot: Robot, combined: str, commands: bool) -> Spec:
    """Return the parameter that enables the feedback, by default true where nothing prevents it.

    On a robot's controllers the user enables it, who has checked the signs of its sensors.

    Args:
        node: that has declared the feedback's topics.
        robot: to be corrected.
        combined: topic of all joints that the node publishes, or ''.
        commands: whether the node commands controllers.

    """
    measured = node.get_parameter(f'{PREFIX}joint_states_topic').value
    own = combined and (node.resolve_topic_name(combined) == node.resolve_topic_name(measured))
    helps = robot.feedback is None or robot.feedback.enabled
    able = helps and not (own or lacking(robot))
    if able and commands and ENABLED not in node._parameter_overrides:
        node.get_logger().info("feedback is off, as by default with a robot's controllers: set "
                               f'{ENABLED} to true once its sensors are checked')
    return replace(feedback_parameters.SWITCH, default=able and not commands)


class FeedbackSwitch:
    """The feedback of a generator, made when it is first switched on.

    Attributes:
        loop: a FeedbackLoop; None as long as it has not been on.

    """

    def __init__(self, node: Any, pattern: Pattern, motion: Motion, own: Sequence[str]) -> None:
        """Switch the feedback on if the node's parameters say so.

        Args:
            node: a StartedNode.
            pattern: to be corrected.
            motion: returns the wanted motion of the robot.
            own: topics that the node publishes itself, resolved.

        Raises:
            StartError: the feedback is enabled, and cannot be on.

        """
        self._node, self._pattern, self._motion, self._own = node, pattern, motion, own
        self.loop: Any = None
        self._delays_logged = False
        self._odometry: OdometryPublisher | None = None
        if refusal := self.judge([node.get_parameter(ENABLED)]):
            raise StartError(refusal)
        self._hindrance = ''
        #: Whether the robot may move meanwhile.
        self._started = False
        self.apply()
        self._started = True

    def _value(self, name: str) -> Any:
        return self._node.get_parameter(PREFIX + name).value

    def obstacle(self) -> str:
        """Return why the feedback cannot be on, or ''."""
        if missing := lacking(self._pattern.robot):
            return missing
        topic = self._node.resolve_topic_name(self._value('joint_states_topic'))
        if topic in self._own:
            return (f"feedback.joint_states_topic '{topic}' is the generator's own: set "
                    "combined_topic to '', or name the robot's topic")
        return ''

    def judge(self, parameters: Sequence[Parameter]) -> str:
        """Return why a batch of changes is rejected, or ''."""
        switched_on = any(one.name == ENABLED and one.value is True for one in parameters)
        obstacle = self.obstacle() if switched_on else ''
        return f'no feedback: {obstacle}' if obstacle else ''

    def refuses(self, program: GaitPlan) -> str:
        """Return why a gait cannot be run, or '': feedback without an efference copy waits."""
        return ''

    def apply(self) -> None:
        """Apply the parameters."""
        wanted = self._node.get_parameter(ENABLED).value and not self.obstacle()
        if wanted and self.loop is None:
            self.loop = self._make()
        if self.loop is not None:
            self._set_gains()
            self.loop.wanted = wanted and not self._hindrance

    def hinder(self, reason: str) -> None:
        """Fade the feedback out as long as there is a reason, '' for none."""
        self._hindrance = reason
        if self.loop is not None:
            self.loop.wanted = (self._node.get_parameter(ENABLED).value and not self.obstacle()
                                and not reason)

    def _make(self) -> Any:
        """Return the loop, its kernels compiled."""
        robot, pattern = self._pattern.robot, self._pattern
        geometry = geometry_of(robot)
        if self._started:
            compile_apart(self._node, 'feedback', FEEDBACK)
        with announced(self._node, 'the feedback', FEEDBACK):
            warm_up(geometry, len(robot.joints))
        loop = FeedbackLoop(pattern, geometry, self._inputs(geometry), self._motion)
        if pattern.drive is None:
            # Speed and heading are closed by the strides.
            pattern.attach(Drive(len(robot.legs)))
        for line in shortfalls(robot):
            self._node.get_logger().warning(line)
        self._kp_scale = KpScalePublisher(self._node)
        if topic := self._value('odometry_topic'):
            loop.odometry = Odometry(geometry, self._value('odometry_scale'),
                                     self._value('odometry_scale_error'))
            self._odometry = OdometryPublisher(
                self._node, loop.odometry, topic,
                (self._value('odom_frame'), self._value('base_frame')),
                self._value('odometry_tf'))
        return loop

    def _inputs(self, geometry: Geometry | float) -> SensorInput:
        mount = self._value('imu_mount')
        if len(mount) != 3 or not np.isfinite(mount).all():
            raise StartError(f'feedback.imu_mount is {list(mount)}: it must be roll, pitch and '
                             'yaw in rad')
        return SensorInput(self._node, self._pattern.robot, geometry, *map(self._value, (
            'imu_topic', 'joint_states_topic', 'contacts', 'contacts_topic', 'imu_mount',
            'max_delay')))

    def _set_gains(self) -> None:
        self.loop.feedback.gains = feedback_parameters.gains(self._value)

    def learn(self, program: GaitPlan) -> None:
        """Tabulate a gait before the pattern changes to it."""
        if self.loop is not None:
            self.loop.learn(program)

    def sense(self, dt: float, stamp: int) -> None:
        """Correct the coming tick by the sensors; dt in s, stamp in ns."""
        if self.loop is not None:
            self.loop.sense(dt, 1e-9 * stamp)
            if self.loop.share > 0.0 and not self._delays_logged:
                self._delays_logged = True
                self._log_delays()

    def _log_delays(self) -> None:
        delays = [f'{name} {1e3 * delay:.1f} ms' for name, delay in self.loop.latencies().items()]
        self._node.get_logger().info(
            'feedback: age of the measurements when they are used: '
            f'{", ".join(delays) or "unknown, messages have no stamps"} '
            f'(feedback.max_delay {1e3 * self._value("max_delay"):.0f} ms)')

    def targets(self, position: np.ndarray) -> np.ndarray:
        """Return what to send to joints that are wanted at angles, rad, shape (joints,)."""
        return position if self.loop is None else self.loop.targets(position)

    def publish(self, dt: float, stamp: int) -> None:
        """Publish what is due; dt since the last call, s, and stamp, ns."""
        if self.loop is not None:
            self._kp_scale.publish(dt, self.loop.kp_scale)
            if self._odometry is not None and self.loop.share > 0.0:
                self._odometry.publish(dt, stamp)

    def restart(self) -> None:
        """Start again, as where simulated time jumps back."""
        if self.loop is not None:
            self.loop.restart()

    @property
    def active(self) -> bool:
        """Whether the gait is being corrected."""
        return self.loop is not None and self.loop.share > 0.0

    @property
    def out(self) -> str:
        """What interrupts feedback that has been active, or ''."""
        loop = self.loop
        return loop.faults if loop is not None and loop.wanted and not loop.waiting else ''

    def _text(self) -> str:
        return f'{100.0 * self.loop.share:.0f} %'

    def state(self, now: float) -> dict[str, str]:
        """Return its state and the ages of its inputs, for /diagnostics; now in s."""
        loop = self.loop
        if loop is None or not loop.wanted:
            text = 'off'
        elif loop.faults:
            text = f'{"waiting" if loop.waiting else "out"}: {loop.faults}'
        else:
            text = self._text()
        if loop is None:
            return {'feedback': text}
        return {'feedback': text,
                **{f'age of {name} [ms]': f'{1e3 * age:.1f}'
                   for name, age in loop.ages(now).items()},
                **{f'delay of {name} [ms]': f'{1e3 * delay:.1f}'
                   for name, delay in loop.latencies().items()},
                'largest delay [ms]': f'{1e3 * self._value("max_delay"):.1f}'}
