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

"""The feedback loop: from the topics of the robot's sensors to the pattern, at every tick."""

from collections.abc import Callable
import math

from cpg_ros.feedback.biped.balanced_pattern import BalancedPattern
from cpg_ros.feedback.biped.feedback import BipedFeedback
from cpg_ros.feedback.biped.substitutes import FEET, JOINTS
from cpg_ros.feedback.estimate import Odometry, TOUCH
from cpg_ros.feedback.feedback import Feedback
from cpg_ros.feedback.gait_tables import POINTS, SLOTS, Timetable
from cpg_ros.feedback.input_checks import agreement, Fade
from cpg_ros.feedback.kinematics import Geometry
from cpg_ros.feedback.laws.virtual_stiffness import targets
from cpg_ros.feedback.leg_rates import RatesCheck
from cpg_ros.feedback.tick import PlannedMotion
from cpg_ros.motion.pattern import Pattern
from cpg_ros.motion.plan import GaitPlan
from cpg_ros.ros.feedback.sensor_input import SensorInput
import numpy as np

#: FURTHEST: largest difference between wanted and measured heading, rad.
FURTHEST = 0.5
#: DIES_OUT: time at a share of 0 after which all displacements have decayed, s.
DIES_OUT = 0.3
#: AGREES: least mean share of legs whose contacts agree with the gait.
AGREES = 0.5
#: Wanted speeds forward and to the left, m/s, and wanted yaw rate, rad/s.
Motion = Callable[[], tuple[float, float, float]]


class SensorLoop:
    """Feeds the robot's sensors back to a pattern at every tick.

    Call ``sense`` from the thread of the ticks; all other methods are for any thread.

    Attributes:
        wanted: whether the feedback is enabled.
        faults: what interrupts it, such as 'imu: no messages for 3.2 s'; empty while it is active.
        waiting: whether an input has never arrived.

    """

    def __init__(self, inputs: SensorInput, motion: Motion) -> None:
        self._inputs, self._motion = inputs, motion
        self.wanted, self.waiting, self.faults = False, True, ''

    def learn(self, plan: GaitPlan) -> None:
        """Tabulate a gait before the pattern changes to it."""

    def ages(self, now: float) -> dict[str, float]:
        """Return name -> time since the last plausible message, s; inf for none."""
        return self._inputs.ages(now)

    def latencies(self) -> dict[str, float]:
        """Return name -> age of its measurements when they are used, low-passed, s."""
        return self._inputs.latencies()

    def targets(self, position: np.ndarray) -> np.ndarray:
        """Return the angles to send for target angles, rad, shape (joints,)."""
        return position


class FeedbackLoop(SensorLoop):
    """Corrects a pattern by the robot's sensors, as long as they are plausible.

    Attributes:
        feedback: its laws, whose gains may be replaced.
        fraction: of all corrections, 0 to 1.
        kp_scale: factor of the servos' proportional gain.
        odometry: of the base, where it is wanted; it goes on as long as gaits are corrected.

    """

    def __init__(self, pattern: Pattern, geometry: Geometry, inputs: SensorInput, motion: Motion
                 ) -> None:
        """Prepare to correct a pattern.

        Args:
            pattern: to be corrected.
            geometry: of the robot's legs.
            inputs: the robot's sensors.
            motion: returns the wanted motion.

        """
        super().__init__(inputs, motion)
        self._pattern, self._geometry = pattern, geometry
        self.feedback = Feedback(geometry, joints=len(pattern.robot.joints))
        self._rates = RatesCheck(geometry)
        self._known: list[tuple[GaitPlan, Timetable]] = []
        self._least = TOUCH * geometry.weight
        self._planned = PlannedMotion(np.zeros((1, len(pattern.robot.joints))), np.zeros(1),
                                      np.zeros((1, 2), dtype=np.int64), np.zeros(1),
                                      np.zeros((1, 2)), np.zeros(1), np.zeros(1))
        self._trim = np.zeros(len(pattern.robot.legs))
        self._limits = pattern.robot.column('lower'), pattern.robot.column('upper')
        self.odometry: Odometry | None = None
        self.restart()
        self.learn(pattern.plan)

    def restart(self) -> None:
        """Start again, as where simulated time jumps back."""
        self._fade, self.fraction, self._spent = Fade(), 0.0, math.inf
        self._dt, self._agrees = 0.0, 1.0
        self.feedback.reset()
        self._inputs.restart()
        self._rates.restart()
        if self.odometry is not None:
            self.odometry.restart()
        self._release()

    def learn(self, plan: GaitPlan) -> None:
        """Tabulate a gait before the pattern changes to it."""
        if not any(known is plan for known, _ in self._known):
            self.feedback.learn(plan)
            self._known = [*self._known, (plan, Timetable(plan, self._geometry))][-SLOTS:]

    @property
    def delay(self) -> float:
        """Age of the measured angles when they are used, low-passed, s; inf if not known."""
        age = self._inputs.joints.age
        return math.inf if math.isnan(age) else age

    def sense(self, dt: float, now: float) -> None:
        """Read the sensors and correct the coming tick by them; dt and now in s."""
        inputs, pattern = self._inputs, self._pattern
        if not self.wanted and self._spent > DIES_OUT:
            if pattern.correct is not None:
                self._release()
            return
        self._dt = dt
        inputs.update(now, pattern.level > 0.0)
        self._judge(now)
        self.fraction = self._fade.advance(self.wanted and not self.faults, dt)
        self._spent = 0.0 if self.fraction else self._spent + dt
        if self._spent > DIES_OUT and self.faults:
            # Nothing is fed back: measurements from before the gap mean nothing after it.
            if pattern.correct is not None:
                self.feedback.reset()
                self._release()
            if self.odometry is not None:
                self.odometry.lose(dt)
        else:
            pattern.correct = self._correct

    def _judge(self, now: float) -> None:
        """Determine the faults that interrupt the feedback."""
        inputs = self._inputs
        found, self.waiting = inputs.faults(now)
        if not found and (mounted := self._rates.verdict(inputs.sensor_data, self._dt)):
            found.append(f'{inputs.monitors[0].name}: its angular velocity is not that of the '
                         f'legs on the ground: it seems to be mounted {mounted} '
                         '(feedback.imu_mount)')
        pattern = self._pattern
        plan = pattern.plan
        if plan.motion.efference is None:
            found.append(f"the robot file has no efference copy of the gait '{plan.name}'")
        times = next((times for known, times in self._known if known is plan), None)
        if found or times is None or pattern.level < 1.0 or pattern.in_transition:
            self._agrees = 1.0
        else:
            row = int(pattern.phases[0] * POINTS) % POINTS
            self._agrees = agreement(inputs.sensor_data.foot_forces[0], self._least,
                                     times.swinging[row],
                                     min(self._dt * plan.frequency, 1.0), self._agrees)
            if self._agrees < AGREES:
                found.append(f'{inputs.feet}: the contacts do not go with the gait')
        self.faults = '; '.join(found)

    def _correct(self, angles: np.ndarray) -> np.ndarray:
        pattern, feedback, inputs = self._pattern, self.feedback, self._inputs
        planned, heading = self._planned, self._planned.heading
        planned.angles[0] = angles
        old, new, planned.mix[0] = pattern.fading
        planned.gaits[0] = feedback.slot(old), feedback.slot(new)
        planned.phase[0] = pattern.phases[0]
        forward, left, turn = self._motion()
        planned.velocity[0], planned.turn[0] = (forward, left), turn
        yaw = float(inputs.sensor_data.rpy[0, 2])
        if self.fraction and pattern.level:
            # Without a wanted turn the heading is kept; with one it advances.
            ahead = (heading[0] + turn * self._dt - yaw + math.pi) % (2.0 * math.pi) - math.pi
            heading[0] = yaw + min(max(ahead, -FURTHEST), FURTHEST)
        else:
            heading[0] = yaw
        memory = feedback.memory
        found = feedback.advance(inputs.sensor_data, planned, self._dt, self.fraction,
                                 pattern.level,
                                 self.delay)
        pattern.frequency_scale = float(memory.frequency_scale[0])
        self.kp_scale = float(memory.kp_scale[0])
        if self.odometry is not None:
            self.odometry.advance(inputs.sensor_data, memory.velocity[0], memory.contact[0],
                                  self._dt)
        if pattern.drive is not None:
            self._trim[:] = memory.stride[0]
            pattern.drive.trim = self._trim
        return found[0]

    def targets(self, position: np.ndarray) -> np.ndarray:
        """Do as the base class does, with targets moved where the virtual stiffness acts."""
        feedback, stiff = self.feedback, self.feedback.memory.stiff
        if not (stiff[0] and feedback.gains.virtual_stiffness):
            return position
        return targets(position, self._inputs.sensor_data.joint_positions, stiff, feedback.gains,
                       self._limits)[0]

    def _release(self) -> None:
        """Run the pattern without corrections."""
        self.feedback.memory.stiff[0] = False
        self._pattern.correct, self._pattern.frequency_scale, self.kp_scale = None, 1.0, 1.0
        if self._pattern.drive is not None:
            self._pattern.drive.trim = None


# The balance of a biped: from the topics of its sensors to its feedback, at every tick.

class BalanceLoop(SensorLoop):
    """Balances a biped by its sensors, as long as they are plausible.

    Attributes:
        feedback: its laws, whose gains may be replaced.

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
        super().__init__(inputs, motion)
        self._pattern, robot = pattern, pattern.robot
        self.feedback = BipedFeedback(robot, plan=pattern.plan)
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
    def fraction(self) -> float:
        """Fraction of the robot's balance by the feedback: 0 or 1."""
        return 1.0 if self._pattern.balance is not None and self._pattern.balancing else 0.0

    def restart(self) -> None:
        """Start again, as where simulated time jumps back."""
        self._pattern.release()
        self._inputs.restart()

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
        return 'the robot was moved by hand; standing up again'

    def sense(self, _: float, now: float) -> None:
        """Read the sensors for the coming tick; now in s."""
        pattern, inputs = self._pattern, self._inputs
        if not self.wanted:
            pattern.balance = None
            return
        inputs.update(now, pattern.enabled)
        found, self.waiting = inputs.faults(now)
        pattern.failed = bool(found)
        found += [f'{inputs.feet if one == FEET else inputs.monitors[one].name}: {why}'
                  for one, why in list(pattern.doubts.items())]
        self.faults = '; '.join(found)
        measured, sensors = inputs.sensor_data, self._sensors
        sensors.joint_positions[0, self._rows] = measured.joint_positions[0]
        sensors.joint_velocities[0, self._rows] = measured.joint_velocities[0]
        pattern.refused = any(monitor.refused for monitor in inputs.monitors)
        ages = [now - monitor.believed for monitor in inputs.monitors]
        # Of several feet the oldest counts; where efforts are the contacts, there are none.
        pattern.ages[:] = *ages[:FEET], max(ages[FEET:], default=ages[JOINTS])
        pattern.sensors = None if self.waiting else sensors
        pattern.wish = self._motion()
        pattern.balance = self.feedback
