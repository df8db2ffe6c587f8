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

"""Switches the balance of a biped on and off, as the generator's parameters say."""

from typing import cast

from cpg_ros.feedback.biped.balance import BalancedPattern
from cpg_ros.feedback.kinematics import GRAVITY
from cpg_ros.motion.plan import GaitPlan
from cpg_ros.nodes import feedback_parameters
from cpg_ros.nodes.balance_loop import BalanceLoop
from cpg_ros.nodes.feedback_switch import FeedbackSwitch
from cpg_ros.nodes.held_joints import HeldPublisher
from cpg_ros.nodes.kernels import announced, BALANCE, compile_apart
from cpg_ros.robots.biped_keys import SPEEDS


class BalanceSwitch(FeedbackSwitch):
    """The feedback of a generator of a biped with soles.

    Attributes:
        loop: a BalanceLoop; None as long as it has not been on.

    """

    _held: HeldPublisher | None = None

    def obstacle(self) -> str:
        """Return why the feedback cannot be on, or ''."""
        if self._value('contacts') == 'efforts':
            return ("feedback.contacts 'efforts' is for feet that are points: a robot with soles "
                    'needs foot_contacts or wrenches')
        return super().obstacle()

    def hinder(self, reason: str) -> None:
        """Do nothing: without its balance the robot falls."""

    def _make(self) -> BalanceLoop:
        pattern = cast(BalancedPattern, self._pattern)
        biped = pattern.robot.biped
        assert biped is not None
        if self._started:
            compile_apart(self._node, 'balance', BALANCE)
        inputs = self._inputs(GRAVITY * biped.total)
        if self._value('odometry_topic'):
            self._node.get_logger().warning('no odometry: there is none for legs with soles yet')
        with announced(self._node, 'the feedback', BALANCE):
            return BalanceLoop(pattern, inputs, self._motion)

    def refuses(self, program: GaitPlan) -> str:
        """Return why a gait cannot be run, or ''."""
        if program.balanced or not self._value('enabled'):
            return ''
        return f'no law balances the {program.gait}: {", ".join(SPEEDS)} are those there are'

    def _set_gains(self) -> None:
        self.loop.feedback.set_gains('walk', feedback_parameters.biped_gains(self._value))

    def publish(self, dt: float, stamp: int) -> None:
        """Publish where joints of no leg go; log what became of the balance."""
        if self.loop is not None and self.loop.feedback.arms.swing:
            if self._held is None:
                self._held = HeldPublisher(self._node, self._pattern.robot)
            self._held.publish(stamp, cast(BalancedPattern, self._pattern).held_angles)
        if self.loop is not None and (news := self.loop.news()):
            self._node.get_logger().warning(news)

    def _text(self) -> str:
        return str(self.loop.state)
