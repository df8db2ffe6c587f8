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
import ctypes
import math
from typing import Any

from cpg_ros.feedback.biped.balanced_pattern import BalancedPattern
from cpg_ros.feedback.biped.feedback import BipedFeedback
from cpg_ros.feedback.biped.gains import BipedGains
from cpg_ros.feedback.biped.substitutes import FEET
from cpg_ros.feedback.closed_loop import (
    CONTACTS_DISAGREE,
    FRACTION,
    Instant,
    LoopData,
    MOUNT,
    OFF_TIME,
    REQUESTED,
    TIME,
)
from cpg_ros.feedback.estimate import Odometry
from cpg_ros.feedback.feedback import Feedback
from cpg_ros.feedback.gains import Gains, Memory
from cpg_ros.feedback.kinematics import Geometry
from cpg_ros.feedback.leg_rates import MOUNT_TEXTS
from cpg_ros.motion.pattern import Pattern
from cpg_ros.motion.plan import GaitPlan
from cpg_ros.ros.feedback.sensor_input import SensorInput
from cpg_ros.ros.node import native
import numpy as np

#: Wanted speeds forward and to the left, m/s, and wanted yaw rate, rad/s.
Motion = Callable[[], tuple[float, float, float]]


class SensorLoop:
    """Feedback from the robot's sensors to a pattern at every tick.

    Any thread may call its methods; ``tick.c`` runs the ticks, see ``compiled``.

    Attributes:
        inputs: the robot's sensors.
        feedback: its laws, whose gains may be replaced.
        enabled: whether the feedback is.
        faults: reasons that interrupt it, such as 'imu: no messages for 3.2 s'; else ''.
        waiting: whether an input has never arrived.
        fraction: of all corrections, 0 to 1.

    """

    feedback: Any
    _correction: native.Correction
    enabled: Any
    faults: Any
    waiting: Any
    fraction: Any

    def __init__(self, pattern: Any, inputs: SensorInput, motion: Motion) -> None:
        self._pattern, self.inputs, self._motion = pattern, inputs, motion

    @property
    def state(self) -> str:
        """State of the feedback while it is wanted, for /diagnostics."""
        if self.faults:
            return f'{self._faulty_state}: {self.faults}'
        return self._active_state

    @property
    def _active_state(self) -> str:
        return f'{100.0 * self.fraction:.0f} %'

    @property
    def _faulty_state(self) -> str:
        return 'waiting' if self.waiting else 'out'

    def _corrects(self, numbers: np.ndarray, **others: Any) -> native.Correction:
        """Return the struct by which ``tick.c`` corrects; numbers begin with dt and time, s."""
        inputs = self.inputs.structs
        return native.Correction(
            take=native.address('rcl_take_serialized_message'),
            forget=native.address('rcutils_reset_error'), numbers=numbers.ctypes.data,
            inputs=ctypes.addressof(inputs), count=len(inputs), **others)

    def learn(self, plan: GaitPlan) -> None:
        """Tabulate a gait before the pattern changes to it."""

    def renew(self) -> None:
        """Update the commanded motion."""

    def compiled(self) -> native.Correction:
        """Read messages of new layouts; return how ``tick.c`` corrects the pattern."""
        self.inputs.read()
        self.renew()
        return self._correction

    @property
    def target(self) -> np.ndarray:
        """The angles to send, rad, shape (joints,), overwritten at every tick."""
        return self._pattern.position

    def news(self) -> str:
        """Return a message about the robot since the last call, or ''."""
        return ''


class FeedbackLoop(SensorLoop):
    """Corrects a pattern by the robot's sensors, as long as they are plausible.

    Attributes:
        odometry: of the base, where it is wanted; it goes on as long as gaits are corrected.

    """

    def __init__(self, pattern: Pattern, geometry: Geometry, inputs: SensorInput, motion: Motion,
                 odometry: Odometry | None = None) -> None:
        """Prepare to correct a pattern.

        Args:
            pattern: to be corrected.
            geometry: of the robot's legs.
            inputs: the robot's sensors.
            motion: returns the wanted motion.
            odometry: to be advanced, None for none.

        """
        super().__init__(pattern, inputs, motion)
        planned, goal, scale = pattern.planned
        self.feedback = Feedback(geometry, joints=len(pattern.robot.joints))
        self._instant = Instant.empty(len(pattern.robot.legs), scale)
        self._finishes, self.odometry = odometry is not None, odometry or Odometry.begin()
        self._data = LoopData.of(self.feedback, inputs.senses, inputs.sensor_data, self._instant,
                                 planned, goal, self.odometry, pattern.position)
        self._state = self._data.state
        # It loads numba.
        from cpg_ros.feedback import by_address
        self._by_address = by_address
        self._finish: Any = None
        self._memories: list[Any] = []
        memory, self._blank = self.feedback.memory, Memory.empty(1, len(pattern.robot.legs))
        self._resets = (native.Copy * len(memory))(*[
            native.Copy(part.ctypes.data, blank.ctypes.data, part.nbytes)
            for part, blank in zip(memory, self._blank, strict=True)])
        addresses = pattern.addresses
        self._correction = self._corrects(
            self._instant.numbers, gaits=self._instant.gaits.ctypes.data,
            resets=ctypes.addressof(self._resets), parts=len(memory),
            **{name: addresses[name] for name in ('report', 'plan', 'move')})
        self.restart()
        self.learn(pattern.plan)
        self._close = by_address.closing_function(self._data)
        self._correction.close = self._close.address
        self.set_gains(self.feedback.gains)

    @property
    def enabled(self) -> bool:
        """Whether the feedback is enabled."""
        return self._state[REQUESTED] > 0.0

    @enabled.setter
    def enabled(self, enabled: bool) -> None:
        self._state[REQUESTED] = enabled

    @property
    def fraction(self) -> float:
        """Fraction of all corrections, 0 to 1."""
        return float(self._state[FRACTION])

    def set_gains(self, gains: Gains) -> None:
        """Use gains from the next tick on.

        Raises:
            InputError: one is outside its limits.

        """
        gains.check()
        self.feedback.gains = gains
        self._data = self._data._replace(gains=gains)
        # A tick under way may still read those before.
        self._memories = [*self._memories[-1:], self._by_address.memory_of(self._data)]
        self._correction.arguments = ctypes.addressof(self._memories[-1])
        moves = gains.virtual_stiffness or (gains.servo_gains and gains.servo_kp > 0.0)
        if self._finish is None and (self._finishes or moves):
            self._finish = self._by_address.finishing_function(self._data)
            self._correction.finish = self._finish.address

    def restart(self) -> None:
        """Start again, as where simulated time jumps back."""
        enabled = self.enabled
        self._state[:] = 0.0
        self._state[[REQUESTED, OFF_TIME]] = enabled, math.inf
        self.feedback.reset()
        self.inputs.restart()
        self._data.rates[0][:] = 0.0
        self.odometry.restart()
        self._data.servos.restart()
        self._instant.scale[0], self._instant.trim[:] = 1.0, 0.0

    def learn(self, plan: GaitPlan) -> None:
        """Tabulate a gait before the pattern changes to it."""
        self.feedback.slot(plan)

    @property
    def waiting(self) -> bool:
        """Whether an input has never arrived."""
        return self.inputs.faults(0.0)[1]

    @property
    def faults(self) -> str:
        """Faults that interrupt it, such as 'imu: no messages for 3.2 s'; none while active."""
        inputs, plan = self.inputs, self._pattern.plan
        reasons, _ = inputs.faults(self._instant.numbers[TIME])
        if mounted := MOUNT_TEXTS[int(self._state[MOUNT])]:
            reasons.append(f'{inputs.monitors[0].name}: its angular velocity contradicts that of '
                         f'the legs on the ground: it seems to be mounted {mounted} '
                         '(feedback.imu_mount)')
        if plan.motion.efference is None:
            reasons.append(f"the robot file has no efference copy of the gait '{plan.name}'")
        if self._state[CONTACTS_DISAGREE]:
            reasons.append(f'{inputs.feet}: the contacts do not go with the gait')
        return '; '.join(reasons)

    def renew(self) -> None:
        """Update the commanded motion."""
        self._instant.command[:] = self._motion()

    def compiled(self) -> native.Correction:
        """As in the base class; the laws also change the strides."""
        if self._pattern.strides is not None:
            self._pattern.strides.trim = self._instant.trim
        return super().compiled()

    @property
    def target(self) -> np.ndarray:
        """The angles to send, rad, shape (joints,), overwritten at every tick."""
        return super().target if self._finish is None else self._data.sent[0]

    @property
    def servo_ratios(self) -> np.ndarray:
        """Ratios of the servos' kp and kd to servo_kp and servo_kd, in use, shape (2,)."""
        return self._data.servos.applied[0, :2]

    @property
    def fraction_array(self) -> np.ndarray:
        """The fraction of all corrections, shape (1,), overwritten at every tick."""
        return self._state[FRACTION:FRACTION + 1]


class BalanceLoop(SensorLoop):
    """Balances a biped by its sensors, as long as they are plausible."""

    def __init__(self, pattern: BalancedPattern, inputs: SensorInput, motion: Motion) -> None:
        """Prepare to balance.

        Args:
            pattern: of the robot.
            inputs: its sensors.
            motion: returns the wanted motion.

        Raises:
            InputError: the robot file's part ``biped`` cannot be used.

        """
        super().__init__(pattern, inputs, motion)
        robot = pattern.robot
        self.feedback = BipedFeedback(robot, plan=pattern.plan)
        pattern.prepare(self.feedback)
        order, self._balanced = self.feedback.order, False
        names = [*(joint.name for joint in robot.joints), *robot.held]
        self._numbers = np.zeros(2)
        # It loads numba.
        from cpg_ros.feedback.by_address import balancing_function, memory_of
        self._arguments = (inputs.senses, inputs.sensor_data, inputs.legs, self._numbers,
                           np.array([order.index(name) for name in names]), pattern.watch,
                           self.feedback.biped)
        self._close, self._memory = (balancing_function(self._arguments),
                                     memory_of(self._arguments))
        self._correction = self._corrects(self._numbers, close=self._close.address,
                                          arguments=ctypes.addressof(self._memory))

    @property
    def enabled(self) -> bool:
        """Whether the feedback is enabled."""
        return self._pattern.balance is not None

    @enabled.setter
    def enabled(self, enabled: bool) -> None:
        self._pattern.balance = self.feedback if enabled else None

    @property
    def waiting(self) -> bool:
        """Whether an input has never arrived."""
        return bool(self._pattern.waiting)

    @property
    def faults(self) -> str:
        """Faults of the inputs, such as 'imu: no messages for 3.2 s'; '' for none."""
        inputs = self.inputs
        faults, _ = inputs.faults(self._numbers[TIME])
        faults += [f'{inputs.feet if k == FEET else inputs.monitors[k].name}: {why}'
                   for k, why in self._pattern.doubts.items()]
        return '; '.join(faults)

    @property
    def fraction(self) -> float:
        """Fraction of the robot's balance by the feedback: 0 or 1."""
        return 1.0 if self.enabled and self._pattern.balancing else 0.0

    def restart(self) -> None:
        """Start again, as where simulated time jumps back."""
        self._pattern.release()
        self.inputs.restart()

    def set_gains(self, gains: BipedGains) -> None:
        """Replace the gains of the walk."""
        self.feedback.set_gains('walk', gains)

    @property
    def _active_state(self) -> str:
        pattern = self._pattern
        if pattern.balancing:
            return 'on'
        if pattern.crouching and not pattern.fallen:
            return 'crouching'
        return ('the robot has fallen: put it on its feet' if pattern.fallen else
                'holding the stand until the robot stands on its feet')

    @property
    def _faulty_state(self) -> str:
        pattern = self._pattern
        if pattern.balancing:
            return 'coming to a stand'
        return ('crouching' if pattern.crouching and not pattern.fallen else
                super()._faulty_state)

    def news(self) -> str:
        """Return why the robot lost its balance since the last call, or ''."""
        pattern, before = self._pattern, self._balanced
        self._balanced = bool(pattern.balancing)
        if not before or pattern.balancing:
            return ''
        if faults := self.faults:
            return f'the robot is not balanced any more: {faults}'
        if pattern.crouching:
            return ''
        if pattern.fallen:
            return 'the robot has fallen: holding the stand until it is on its feet'
        return 'the robot was moved by hand; standing up again'

    def renew(self) -> None:
        """Update the commanded motion."""
        self._pattern.command = self._motion()
