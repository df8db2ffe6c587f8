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

"""Whether the feedback can be on, and on or off as the parameters say."""

from collections.abc import Sequence
from dataclasses import replace
import time
from typing import Any

from cpg_ros.feedback.kinematics import geometry_of
from cpg_ros.feedback.precompile import precompile
from cpg_ros.motion.pattern import Pattern
from cpg_ros.motion.plan import GaitPlan
from cpg_ros.motion.steering import Drive
from cpg_ros.nodes import feedback_parameters
from cpg_ros.nodes.feedback_loop import FeedbackLoop, Motion
from cpg_ros.nodes.feedback_parameters import ENABLED, PREFIX
from cpg_ros.nodes.parameter_spec import Spec
from cpg_ros.nodes.sensor_input import SensorInput
from cpg_ros.robots.robot import Robot
from rclpy.parameter import Parameter


def uncalibrated(robot: Robot) -> str:
    """Say what a robot file has not that feedback needs, or ''."""
    if robot.geometry is None:
        return f"robot file '{robot.name}' has no geometry of the legs (part geometry)"
    if all(motion.efference is None for motion in robot.motions.values()):
        return f"robot file '{robot.name}' has no gait with an efference copy (gaits.*.efference)"
    return ''


def shortfalls(robot: Robot) -> list[str]:
    """Say which legs get only some of the corrections, a line each."""
    known = robot.geometry.legs if robot.geometry is not None else {}
    return [f'feedback moves the leg {leg} forward and up only: it has no hip that abducts'
            if leg in known else
            f'feedback leaves the leg {leg} alone: the robot file has no geometry of it'
            for leg in robot.legs if leg not in known or len(known[leg].joints) == 2]


def usual(node: Any, robot: Robot, combined: str) -> Spec:
    """Return the switch, on if nothing is in the way.

    Args:
        node: that has declared the feedback's topics.
        robot: to be corrected.
        combined: topic of all joints that the node publishes, or ''.

    """
    measured = node.get_parameter(f'{PREFIX}joint_states_topic').value
    own = combined and (node.resolve_topic_name(combined) == node.resolve_topic_name(measured))
    return replace(feedback_parameters.SWITCH, default=not (own or uncalibrated(robot)))


class FeedbackSwitch:
    """The feedback of a generator, made when it is first switched on.

    Attributes:
        loop: None as long as it has not been on.

    """

    def __init__(self, node: Any, pattern: Pattern, motion: Motion, own: Sequence[str]) -> None:
        """Look at the parameters that a node has declared.

        Args:
            node: a StartedNode.
            pattern: to be corrected.
            motion: what is wanted of the robot.
            own: topics that the node publishes itself, resolved.

        """
        self._node, self._pattern, self._motion, self._own = node, pattern, motion, own
        self.loop: FeedbackLoop | None = None

    def _value(self, name: str) -> Any:
        return self._node.get_parameter(PREFIX + name).value

    def obstacle(self) -> str:
        """Say why it cannot be on, or ''."""
        if missing := uncalibrated(self._pattern.robot):
            return missing
        topic = self._node.resolve_topic_name(self._value('joint_states_topic'))
        if topic in self._own:
            return (f"feedback.joint_states_topic '{topic}' is the generator's own: set "
                    "combined_topic to '', or name the robot's topic")
        return ''

    def judge(self, parameters: Sequence[Parameter]) -> str:
        """Say why a batch of changes cannot be, or ''."""
        switched_on = any(one.name == ENABLED and one.value is True for one in parameters)
        obstacle = self.obstacle() if switched_on else ''
        return f'no feedback: {obstacle}' if obstacle else ''

    def apply(self) -> None:
        """Do as the parameters say."""
        wanted = self._node.get_parameter(ENABLED).value and not self.obstacle()
        if wanted and self.loop is None:
            robot, pattern = self._pattern.robot, self._pattern
            began, geometry = time.monotonic(), geometry_of(robot)
            precompile(geometry, len(robot.joints))
            if time.monotonic() - began > 1.0:
                self._node.get_logger().info('the feedback was compiled in '
                                             f'{time.monotonic() - began:.1f} s')
            loop = FeedbackLoop(pattern, geometry, self._motion)
            loop.listen(SensorInput(
                self._node, robot, geometry, self._value('imu_topic'),
                self._value('joint_states_topic'), self._value('contacts'),
                self._value('contacts_topic')))
            if pattern.drive is None:
                # Speed and heading are closed by the strides.
                pattern.attach(Drive(len(robot.legs)))
            for line in shortfalls(robot):
                self._node.get_logger().warning(line)
            self.loop = loop
        if self.loop is not None:
            self.loop.gains = feedback_parameters.gains(
                lambda name: self._node.get_parameter(name).value)
            self.loop.wanted = wanted

    def learn(self, program: GaitPlan) -> None:
        """Get to know a gait before it is met."""
        if self.loop is not None:
            self.loop.learn(program)

    def sense(self, dt: float, stamp: int) -> None:
        """Have the coming tick of dt in s, stamped in ns, corrected by what is felt."""
        if self.loop is not None:
            self.loop.sense(dt, 1e-9 * stamp)

    def restart(self) -> None:
        """Begin anew, as where simulated time jumps back."""
        if self.loop is not None:
            self.loop.restart()

    @property
    def active(self) -> bool:
        """Whether it corrects the gait now."""
        return self.loop is not None and self.loop.share > 0.0

    @property
    def out(self) -> str:
        """What keeps it out though it has been in, or ''."""
        loop = self.loop
        return loop.faults if loop is not None and loop.wanted and not loop.waiting else ''

    def state(self, now: float) -> dict[str, str]:
        """Return what to tell of it; now in s."""
        loop = self.loop
        if loop is None or not loop.wanted:
            text = 'off'
        elif loop.faults:
            text = f'{"waiting" if loop.waiting else "out"}: {loop.faults}'
        else:
            text = f'{100.0 * loop.share:.0f} %'
        ages = {} if loop is None else loop.ages(now)
        return {'feedback': text, **{f'age of {name} [ms]': f'{1e3 * age:.1f}'
                                     for name, age in ages.items()}}
