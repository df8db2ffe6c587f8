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

"""Feedback of robots: from sensor data to corrected angles, strides and frequency."""

from collections.abc import Callable

from cpg_ros.dynamics.integration.compilation import specialised
from cpg_ros.feedback.efference_copy import EfferenceCopy
from cpg_ros.feedback.estimate import SensorData
from cpg_ros.feedback.gains import Gains, Memory
from cpg_ros.feedback.gait_tables import GaitTables, MAX_GAITS, Timetable
from cpg_ros.feedback.kinematics import Geometry
from cpg_ros.feedback.tick import PlannedMotion, tick
from cpg_ros.motion.plan import GaitPlan
import numpy as np


class Feedback:
    """Feedback of robots of one kind, one for each run; a tick allocates nothing.

    Attributes:
        geometry: of the legs.
        gains: of the laws; may be replaced between ticks.
        memory: state and output of the laws.
        tables: of the learnt gaits.
        angles: last corrected ones, rad, shape (runs, joints).

    """

    def __init__(self, geometry: Geometry, gains: Gains | None = None, runs: int = 1,
                 joints: int | None = None) -> None:
        """Prepare; each gait must be learnt before it is entered."""
        legs = len(geometry.hips)
        self.geometry, self.gains = geometry, gains or Gains()
        self.memory = Memory.empty(runs, legs)
        self._legs, self.tables = geometry.arrays, GaitTables.empty(legs)
        self._plans: list[GaitPlan | None] = [None] * MAX_GAITS
        self._learnt = 0
        self.angles = np.zeros((runs, joints or int(geometry.columns.max()) + 1))
        self._tick: Callable | None = None
        self._bound: Gains | None = None

    def learn(self, plan: GaitPlan, expected: EfferenceCopy | None = None) -> int:
        """Add a gait to the tables; return its slot.

        It replaces the oldest if there is no room. Without an efference copy, also in the robot
        file, only the gait's speed is expected.
        """
        if expected is None and plan.motion.efference is not None:
            expected = EfferenceCopy.of(plan.motion.efference)
        slot = self._learnt % MAX_GAITS
        self.tables.fill(slot, Timetable(plan, self.geometry),
                          expected or EfferenceCopy.blank(), plan)
        self._plans[slot] = plan
        self._learnt += 1
        return slot

    def slot(self, plan: GaitPlan) -> int:
        """Return the slot of a gait; learn a new one without an efference copy."""
        for k, plan_of_slot in enumerate(self._plans):
            if plan_of_slot is plan:
                return k
        return self.learn(plan)

    def reset(self) -> None:
        """Restart with an empty memory."""
        for part, blank in zip(self.memory, Memory.empty(*self.memory.contact.shape),
                               strict=True):
            part[...] = blank

    def advance(self, sensors: SensorData, planned: PlannedMotion, dt: float,
                fraction: float = 1.0,
                level: float = 1.0, delay: float = 0.0) -> np.ndarray:
        """Return the corrected angles, rad, shape (runs, joints), before any limits.

        Args:
            sensors: present measurements.
            planned: present plan of the pattern.
            dt: since the last tick, s.
            fraction: of all corrections, 0 to 1.
            level: of the pattern: 0 at the stand, 1 in the full gait.
            delay: age of the measured angles, s.

        Raises:
            InputError: a new gain is outside its limits.

        """
        # A plain tuple, which is made faster than a named one.
        arguments = (self._legs, self.tables, self.gains, self.memory, sensors, planned,
                     (dt, fraction * level, level, delay), self.angles)
        if self._tick is None or self._bound is not self.gains:
            self.gains.check()
            self._tick, self._bound = specialised(tick, *arguments), self.gains
        self._tick(*arguments)
        return self.angles
