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

"""The balance of a biped: from the topics of its sensors to its feedback, at every tick."""

from cpg_ros.feedback.biped.balance import BalancedPattern
from cpg_ros.feedback.biped.feedback import BipedFeedback
from cpg_ros.feedback.biped.substitutes import FEET, JOINTS
from cpg_ros.motion.plan import GaitPlan
from cpg_ros.nodes.feedback_loop import Motion
from cpg_ros.nodes.sensor_input import SensorInput
import numpy as np


class BalanceLoop:
    """Balances a biped by its sensors, as long as they are plausible.

    Call ``sense`` from the thread of the ticks; all other methods are for any thread.

    Attributes:
        feedback: its laws, whose gains may be replaced.
        wanted: whether the feedback is enabled.
        faults: what interrupts it, such as 'imu: no messages for 3.2 s'; empty while it is active.
        waiting: whether an input has never arrived.

    """

    def __init__(self, pattern: BalancedPattern, inputs: SensorInput, motion: Motion) -> None:
        """Prepare to balance.

        Args:
            pattern: of the robot.
            inputs: its sensors.
            motion: returns the wanted motion.

        Raises:
            InputError: the robot file's part ``biped`` cannot be used.

        """
        robot = pattern.robot
        self._pattern, self._inputs, self._motion = pattern, inputs, motion
        self.feedback = BipedFeedback(robot, program=pattern.program)
        self.wanted, self.waiting, self.faults = False, True, ''
        self._balanced = False
        order = self.feedback.order
        names = [*(joint.name for joint in robot.joints), *robot.held]
        self._rows = np.array([order.index(name) for name in names])
        self._sensors = inputs.sensor_data._replace(
            joint_positions=np.zeros((1, len(order))), joint_velocities=np.zeros((1, len(order))))
        # Compiles, or loads what has been compiled.
        self.feedback.advance(self._sensors, 1e-3)
        self.feedback.restart()

    @property
    def share(self) -> float:
        """Share of the robot's balance that is the feedback's: all or nothing."""
        return 1.0 if self._pattern.balance is not None and self._pattern.balancing else 0.0

    def restart(self) -> None:
        """Start again, as where simulated time jumps back."""
        self._pattern.release()
        self._inputs.restart()

    def learn(self, program: GaitPlan) -> None:
        """Do nothing: laws of a biped know no gait."""

    def ages(self, now: float) -> dict[str, float]:
        """Return name -> time since the last plausible message, s; inf for none."""
        return self._inputs.ages(now)

    def latencies(self) -> dict[str, float]:
        """Return name -> age of its measurements when they are used, low-passed, s."""
        return self._inputs.latencies()

    @property
    def state(self) -> str:
        """What it is doing, as text."""
        pattern = self._pattern
        if pattern.balancing:
            return f'coming to a stand: {self.faults}' if self.faults else 'on'
        if pattern.crouching and not pattern.fallen:
            return 'crouching' + (f': {self.faults}' if self.faults else '')
        return ('the robot has fallen: put it on its feet' if pattern.fallen else
                'holding the stand until the robot stands on its feet')

    def news(self) -> str:
        """Return how the robot has lost its balance since the last call, or ''."""
        pattern, before = self._pattern, self._balanced
        self._balanced = pattern.balancing
        if not before or pattern.balancing:
            return ''
        if self.faults:
            return f'the robot is not balanced any more: {self.faults}'
        if pattern.crouching:
            return ''
        if pattern.fallen:
            return 'the robot has fallen: holding the stand until it is on its feet'
        return 'the robot was moved by somebody: standing it up again'

    @staticmethod
    def targets(position: np.ndarray) -> np.ndarray:
        """Return what to send to joints that are wanted at angles: the torques are in them."""
        return position

    def sense(self, _: float, now: float) -> None:
        """Read the sensors for the coming tick; now in s."""
        pattern, inputs = self._pattern, self._inputs
        if not self.wanted:
            pattern.balance = None
            return
        inputs.take(now, pattern.enabled)
        found, self.waiting = inputs.faults(now)
        self.faults = '; '.join(found)
        measured, sensors = inputs.sensor_data, self._sensors
        sensors.joint_positions[0, self._rows] = measured.joint_positions[0]
        sensors.joint_velocities[0, self._rows] = measured.joint_velocities[0]
        pattern.failed = bool(found)
        pattern.refused = any(monitor.refused for monitor in inputs.monitors)
        ages = [now - monitor.believed for monitor in inputs.monitors]
        # Of several feet the oldest counts; where efforts are the contacts, there are none.
        pattern.ages[:] = *ages[:FEET], max(ages[FEET:], default=ages[JOINTS])
        pattern.sensors = None if self.waiting else sensors
        pattern.wish = self._motion()
        pattern.balance = self.feedback
