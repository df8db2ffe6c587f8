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
from cpg_ros.nodes import feedback_parameters
from cpg_ros.nodes.balance_loop import BalanceLoop
from cpg_ros.nodes.feedback_switch import FeedbackSwitch
from cpg_ros.nodes.kernels import announced, BALANCE


class BalanceSwitch(FeedbackSwitch):
    """The feedback of a generator of a biped with soles.

    Attributes:
        loop: a BalanceLoop; None as long as it has not been on.

    """

    def obstacle(self) -> str:
        """Return why the feedback cannot be on, or ''."""
        if self._value('contacts') == 'efforts':
            return ("feedback.contacts 'efforts' is for feet that are points: a robot with soles "
                    'needs foot_contacts or wrenches')
        return super().obstacle()

    def _make(self) -> BalanceLoop:
        pattern = cast(BalancedPattern, self._pattern)
        biped = pattern.robot.biped
        assert biped is not None
        inputs = self._inputs(GRAVITY * biped.total)
        if self._value('odometry_topic'):
            self._node.get_logger().warning('no odometry: that of legs with soles is not there')
        with announced(self._node, 'the feedback', BALANCE):
            return BalanceLoop(pattern, inputs, self._motion)

    def _set_gains(self) -> None:
        self.loop.feedback.gains = feedback_parameters.biped_gains(
            self._value, self._pattern.program.frequency)

    def publish(self, dt: float, stamp: int) -> None:
        """Publish nothing besides the joints."""

    def _text(self) -> str:
        return str(self.loop.state)
