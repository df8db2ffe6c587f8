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

"""The pattern of a balanced biped: its feedback sets the joint targets."""

import math

from cpg_ros.feedback.biped import balance as compiled
from cpg_ros.feedback.biped.crouch import crouch_pose
from cpg_ros.feedback.biped.feedback import addresses, BipedFeedback
from cpg_ros.feedback.biped.gains import WALK
from cpg_ros.feedback.biped.substitutes import LastStride, Substitutes
from cpg_ros.feedback.estimate import SensorData
from cpg_ros.feedback.input_checks import RECOVERY_TIME
from cpg_ros.feedback.kinematics import GRAVITY
from cpg_ros.motion.core import Core
from cpg_ros.motion.pattern import GaitRunner, MIN_DURATION, Pattern, shared
from cpg_ros.motion.plan import GaitPlan
from cpg_ros.motion.strides import StrideCommand
import numpy as np


class BalancedPattern(Pattern):
    """A pattern whose joint targets come from a biped's feedback.

    Without feedback it is the open-loop pattern. With it, it holds the stand's angles until the
    robot stands on its feet, then balances: it stands while disabled, and walks as commanded while
    enabled. After a fall it holds the stand until somebody has put the robot on its feet. Limits
    of positions and speeds hold throughout; where the feedback begins or ends, the joints move on
    from where they are.

    A stand needs balance, a crouch does not. Where an input fails it stops with what substitutes
    it, and crouches; without inertial unit and joints it crouches in the middle of a step. Once
    all inputs are valid it stands up and goes on. Before the end it crouches, too, see ``lower``.

    Attributes:
        balance: the feedback, None for the open-loop pattern.
        watch: data for compiled code; available once a feedback is prepared.
        command: speeds forward and to the left, m/s, and rate of turning, rad/s.
        enabled: whether it is to walk.
        balancing: whether the feedback balances the robot now.
        fallen: whether it fell, and has not been put on its feet yet.
        falls: how often it fell.
        ages: of inertial unit, joints and feet, s, shape (3,): since the last valid values came.
        latencies: the same since they were measured.
        failed: whether an input is out.
        waiting: whether one that is out has never been valid.
        refused: whether messages arrive, but none of an input has been valid yet.
        crouching: whether it holds the crouch or is on its way into it.

    """

    enabled, balancing, fallen, falls, failed, waiting, refused, crouching = (
        shared(name, '_state') for name in ('enabled', 'balancing', 'fallen', 'falls', 'failed',
                                            'waiting', 'refused', 'crouching'))

    def __init__(self, plan: GaitPlan, ramp: float = 1.0, enabled: bool = True,
                 strides: StrideCommand | None = None) -> None:
        """Stand; arguments as of Pattern, but a stride command has no effect."""
        self._record = np.zeros(1, compiled.STATE).view(np.recarray)
        self._state = self._record[0]
        self._state.gap, self._state.good, self._state.suspect = math.inf, RECOVERY_TIME, -1
        self._feedback: BipedFeedback | None = None
        super().__init__(plan, ramp, enabled)
        self.ages, self.latencies = self._state.ages, self._state.latencies
        self._rest = np.array(list(self.robot.held.values()))

    @property
    def balance(self) -> BipedFeedback | None:
        """The feedback, None for the open-loop pattern."""
        return self._feedback if self._state.wanted else None

    @balance.setter
    def balance(self, feedback: BipedFeedback | None) -> None:
        if feedback is None:
            if self.balance is not None and self.balance.changing:
                super().apply(self.balance.wanted.plan, MIN_DURATION)
        else:
            if feedback is not self._feedback:
                self.prepare(feedback)
            self._drift.clear()
            self._request.value = 0
            self._know(feedback)
        self._state.wanted = feedback is not None

    def prepare(self, feedback: BipedFeedback) -> None:
        """Prepare to tick with a feedback, which ``balance`` then switches on."""
        joints, size = len(feedback.order), self.robot.order_indices.size
        rest = self._offset
        (low, depth), (leant, _) = (crouch_pose(self.robot, feedback.biped.links, behind)
                                    or (rest, 0.0) for behind in (0.0, compiled.COM_OFFSET))
        self._state.depth = depth
        self._state.weight = GRAVITY * feedback.biped.links.masses.sum()
        self.watch = compiled.Watch(
            SensorData.zeros(1, 2, joints), Substitutes.empty(feedback.biped.links),
            LastStride.empty(size), np.zeros((3, joints)),
            np.stack([rest, low, leant - low, self.position]), self._goal, self.position,
            self.robot.order_indices, addresses('cpg_advance', 'cpg_let_go', 'cpg_reach'),
            self._address, self._view('track', np.int64), self._view('stall', float),
            self._record)
        self._feedback = feedback

    def _view(self, name: str, kind: type) -> np.ndarray:
        """Return a number of the core's struct as an array, shape (1,)."""
        return np.ndarray(1, kind, memoryview(self._struct).cast('B'), getattr(Core, name).offset)

    def _know(self, feedback: BipedFeedback) -> None:
        """Keep the runners of a feedback and of the core, and drop all others."""
        struct = self._struct
        used = {struct.waiting, *struct.track[:struct.tracks]}
        # A new dictionary, as other threads read the present one.
        self._runners = {**{address: runner for address, runner in self._runners.items()
                            if address in used},
                         **{runner.address: runner for runner in feedback.runners if runner}}

    @property
    def command(self) -> np.ndarray:
        """Speeds forward and to the left, m/s, and rate of turning, rad/s, shape (3,)."""
        return self._state.command

    @command.setter
    def command(self, command: tuple[float, float, float]) -> None:
        self._state.command[:] = command

    @property
    def doubts(self) -> dict[int, str]:
        """Reasons to doubt inputs, until the pattern is enabled in a crouch or the robot falls."""
        if self._feedback is None:
            return {}
        joint, apart = self._feedback.order[max(self._state.suspect, 0)], self._state.apart
        return {k: compiled.FAULT_TEXTS[code].format(joint=joint, apart=apart)
                for k, code in enumerate(self._state.doubts.tolist()) if code}

    def steer(self, stride: np.ndarray, pace: float) -> None:
        """Do nothing: feet are placed for the commanded speed."""

    def apply(self, plan: GaitPlan, transition: float) -> None:
        """Change to a plan; with feedback at once, whatever the transition."""
        if self._feedback is not None and plan.balanced:
            self._feedback.set_gait(GaitRunner(plan, MIN_DURATION))
            self._know(self._feedback)
        if self.balance is None:
            super().apply(plan, transition)

    def enable(self, enabled: bool, ramp: float) -> None:
        """Walk, or come to a stand; doubted inputs are checked again."""
        self._state.anew = True
        super().enable(enabled, ramp)

    def attach(self, strides: StrideCommand) -> None:
        """Do nothing: feet are placed for the commanded speed."""

    @property
    def faults(self) -> int:
        """Times the watchdog had to put the network back on its orbit."""
        return self._struct.faults if self.balance is None else int(self.balance.state.faults)

    @property
    def level(self) -> float:
        """0 in the stand, 1 in the gait."""
        if self.balance is None:
            return self._ramp.level
        return 1.0 if self.balancing and self.balance.state.mode == WALK else 0.0

    @property
    def standing(self) -> bool:
        """Return whether it is disabled and has come to a stand."""
        if self.balance is None:
            return super().standing
        state = self._state
        if state.lowers and not self.fallen and (
                self.balancing or state.time < compiled.CROUCH_TIME + compiled.SETTLE_TIME):
            return False
        return not (self.enabled or self.level)

    @property
    def held_angles(self) -> np.ndarray:
        """Target angles of joints of no leg, rad, in the order of ``robot.held``."""
        return self._rest if self._feedback is None else self._feedback.arms.positions

    @property
    def in_transition(self) -> bool:
        """Return whether a change to another gait is pending."""
        return self.balance.changing if self.balance is not None else super().in_transition

    def restart(self, ramp: float, enabled: bool = True) -> None:
        """Start again from the present joint angles."""
        super().restart(ramp, enabled)
        self.release()
        self.crouching = self._state.lowers = False

    def lower(self) -> bool:
        """Crouch once the robot stands, and stay there, before the end of all commands.

        Returns:
            Whether it will: it balances, or did.

        """
        state = self._state
        state.lowers = self.balance is not None and state.known and not self.fallen
        return bool(state.lowers)

    def release(self) -> None:
        """Stop balancing, as without sensors, and hold the angles of the stand."""
        self._state.balancing, self._state.stood = False, 0.0
