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

"""The feedback of a robot, or of many: from what is felt to corrected angles, strides and pace."""

from collections.abc import Callable

from cpg_ros.feedback.efference_copy import EfferenceCopy
from cpg_ros.feedback.estimate import Senses
from cpg_ros.feedback.gains import Gains
from cpg_ros.feedback.gait_tables import GaitTables, SLOTS
from cpg_ros.feedback.kinematics import Geometry
from cpg_ros.feedback.tick import Memory, tick
from cpg_ros.feedback.timetable import Timetable
from cpg_ros.integration.jit import bound
from cpg_ros.motion.pattern import Pattern
from cpg_ros.motion.plan import Program
import numpy as np


class Feedback:
    """The feedback of as many robots of one kind as there are runs; a tick allocates nothing.

    Attributes:
        geometry: of the legs.
        gains: of the laws; may be replaced between ticks.
        memory: what it keeps from tick to tick.
        angles: the last corrected ones, rad, shape (runs, joints).

    """

    def __init__(self, geometry: Geometry, gains: Gains | None = None, runs: int = 1,
                 joints: int | None = None) -> None:
        """Prepare; gaits are to be learnt before they are met."""
        legs = len(geometry.hips)
        self.geometry, self.gains = geometry, gains or Gains()
        self.memory = Memory.empty(runs, legs)
        self._tables = GaitTables.empty(legs)
        self._programs: list[Program | None] = [None] * SLOTS
        self._learnt = 0
        self._sides = np.zeros(legs)
        self._geometry = (geometry.rows, geometry.columns, geometry.radius, geometry.weight)
        self.angles = np.zeros((runs, joints or int(geometry.columns.max()) + 1))
        self._tick: Callable | None = None
        self._bound: Gains | None = None

    def learn(self, program: Program, expected: EfferenceCopy | None = None) -> int:
        """Get to know a gait; return its slot.

        The oldest is forgotten where there is no room. Without an efference copy, and without one
        in the robot file, nothing but the gait's speed is expected.
        """
        if expected is None and program.motion.efference is not None:
            expected = EfferenceCopy.of(program.motion.efference)
        slot = self._learnt % SLOTS
        self._tables.fill(slot, Timetable(program, self.geometry),
                          expected or EfferenceCopy.blank(), program)
        if program.motion.steering is not None:
            self._sides[:] = np.where(program.robot.left, -0.5, 0.5)
        self._programs[slot] = program
        self._learnt += 1
        return slot

    def slot(self, program: Program) -> int:
        """Return where a gait has been learnt; one that is new is learnt without a copy."""
        for k, known in enumerate(self._programs):
            if known is program:
                return k
        return self.learn(program)

    def reset(self) -> None:
        """Forget what has been felt."""
        for part, blank in zip(self.memory, Memory.empty(*self.memory.contact.shape),
                               strict=True):
            part[...] = blank

    def advance(self, senses: Senses, planned: np.ndarray, phase: np.ndarray, gaits: np.ndarray,
                mix: np.ndarray, wanted: np.ndarray, course: np.ndarray, dt: float,
                share: float = 1.0, level: float = 1.0) -> np.ndarray:
        """Return the corrected angles, rad, shape (runs, joints), not yet held to any limit.

        Args:
            senses: what is felt.
            planned: the pattern's angles, rad, shape (runs, joints).
            phase: of the first leg, cycles, shape (runs,).
            gaits: slots of the gait that is left and of that which is entered, shape (runs, 2).
            mix: share of the one that is entered, shape (runs,).
            wanted: speed forward and to the left, m/s, shape (runs, 2).
            course: wanted heading, rad, shape (runs,).
            dt: since the last time, s.
            share: of all corrections, 0 to 1.
            level: of the pattern: 0 at the stand, 1 in the full gait.

        """
        arguments = (*self._geometry, self.gains, self._tables, self._sides, self.memory,
                     senses.angles, senses.rates, senses.loads, senses.lean, senses.turning,
                     senses.push, planned, phase, gaits, mix, wanted, course, dt, share * level,
                     level, self.angles)
        if self._tick is None or self._bound is not self.gains:
            self._tick, self._bound = bound(tick, *arguments), self.gains
        self._tick(*arguments)
        return self.angles


def close(pattern: Pattern, feedback: Feedback, feel: Callable[[], Senses], wanted: np.ndarray,
          course: np.ndarray, dt: float = 0.002) -> None:
    """Let a feedback of one run correct a pattern from now on, at ticks of dt.

    Strides need a pattern with a drive; without one, speed and heading are not closed.

    Args:
        pattern: whose angles are corrected before its limits hold them.
        feedback: that has learnt its gaits.
        feel: asked for the senses at each tick.
        wanted: speed forward and to the left, m/s, shape (1, 2); may be changed in place.
        course: wanted heading, rad, shape (1,); the same.
        dt: s.

    """
    gaits, mix, memory = np.zeros((1, 2), dtype=np.int64), np.zeros(1), feedback.memory

    def correct(planned: np.ndarray) -> np.ndarray:
        old, new, mix[0] = pattern.fading
        gaits[0] = feedback.slot(old), feedback.slot(new)
        found = feedback.advance(feel(), planned[None], pattern.phases[:1], gaits, mix, wanted,
                                 course, dt, 1.0, pattern.level)
        pattern.hurry = float(memory.hurry[0])
        if pattern.drive is not None and new.motion.steering is not None:
            asked, pace = new.steer(float(wanted[0, 0]), 0.0)
            pattern.steer(np.clip(asked + memory.stride[0], -1.0, 1.0), pace)
        return found[0]

    pattern.correct = correct
