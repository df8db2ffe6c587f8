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

"""The feedback of robots: from sensor data to corrected angles, strides and frequency."""

from collections.abc import Callable

from cpg_ros.dynamics.integration.compilation import specialised
from cpg_ros.feedback.efference_copy import EfferenceCopy
from cpg_ros.feedback.estimate import loads_of, Odometry, SensorData
from cpg_ros.feedback.gains import Gains, Memory
from cpg_ros.feedback.gait_tables import GaitTables, SLOTS, Timetable
from cpg_ros.feedback.input_checks import (
    agreement,
    IMU,
    IMU_MEMORY,
    judge_imu,
    judge_joints,
    judge_loads,
)
from cpg_ros.feedback.kinematics import Geometry
from cpg_ros.feedback.leg_rates import RatesCheck
from cpg_ros.feedback.tick import PlannedMotion, tick
from cpg_ros.motion.plan import GaitPlan
import numpy as np


class Feedback:
    """The feedback of as many robots of one kind as there are runs; a tick allocates nothing.

    Attributes:
        geometry: of the legs.
        gains: of the laws; may be replaced between ticks.
        memory: state and output of the laws.
        angles: the last corrected ones, rad, shape (runs, joints).

    """

    def __init__(self, geometry: Geometry, gains: Gains | None = None, runs: int = 1,
                 joints: int | None = None) -> None:
        """Prepare; gaits have to be learnt before they are entered."""
        legs = len(geometry.hips)
        self.geometry, self.gains = geometry, gains or Gains()
        self.memory = Memory.empty(runs, legs)
        self._legs, self._tables = geometry.arrays, GaitTables.empty(legs)
        self._programs: list[GaitPlan | None] = [None] * SLOTS
        self._learnt = 0
        self.angles = np.zeros((runs, joints or int(geometry.columns.max()) + 1))
        self._tick: Callable | None = None
        self._bound: Gains | None = None

    def learn(self, plan: GaitPlan, expected: EfferenceCopy | None = None) -> int:
        """Add a gait to the tables; return its slot.

        It replaces the oldest where there is no room. Without an efference copy, and without one
        in the robot file, nothing but the gait's speed is expected.
        """
        if expected is None and plan.motion.efference is not None:
            expected = EfferenceCopy.of(plan.motion.efference)
        slot = self._learnt % SLOTS
        self._tables.fill(slot, Timetable(plan, self.geometry),
                          expected or EfferenceCopy.blank(), plan)
        self._programs[slot] = plan
        self._learnt += 1
        return slot

    def slot(self, plan: GaitPlan) -> int:
        """Return the slot of a gait; one that is new is learnt without an efference copy."""
        for k, known in enumerate(self._programs):
            if known is plan:
                return k
        return self.learn(plan)

    def reset(self) -> None:
        """Start again from an empty memory."""
        for part, blank in zip(self.memory, Memory.empty(*self.memory.contact.shape),
                               strict=True):
            part[...] = blank

    def advance(self, sensors: SensorData, planned: PlannedMotion, dt: float,
                fraction: float = 1.0,
                level: float = 1.0, delay: float = 0.0) -> np.ndarray:
        """Return the corrected angles, rad, shape (runs, joints), which no limit holds yet.

        Args:
            sensors: what is measured now.
            planned: what the pattern plans for now.
            dt: since the last time, s.
            fraction: of all corrections, 0 to 1.
            level: of the pattern: 0 at the stand, 1 in the full gait.
            delay: age of the measured angles, s.

        Raises:
            InputError: the gains are new, and one is outside its limits.

        """
        # A plain tuple, which is made faster than a named one.
        arguments = (self._legs, self._tables, self.gains, self.memory, sensors, planned,
                     (dt, fraction * level, level, delay), self.angles)
        if self._tick is None or self._bound is not self.gains:
            self.gains.check()
            self._tick, self._bound = specialised(tick, *arguments), self.gains
        self._tick(*arguments)
        return self.angles


# Make every kernel of the feedback ready, compiling those not yet on disk.

def warm_up_judges(legs: int, joints: int) -> None:
    """Run the kernels that judge messages once; legs and joints are their numbers."""
    sensors, some, load = SensorData.zeros(1, legs, joints), np.zeros(joints), np.zeros(legs)
    places = np.arange(joints)
    # As they come in messages: not to be written to.
    message = np.frombuffer(bytes(8 * max(IMU, joints)))
    judge_imu(message, 0.1, True, np.zeros(4), np.zeros(IMU_MEMORY), sensors.rpy[0],
              sensors.angular_velocity[0], sensors.acceleration[0])
    judge_joints(message, message, places, some, some, some, some, some)
    judge_loads(message, places[:legs], 1.0, 0.1, np.zeros(1), load)


def warm_up(geometry: Geometry, joints: int) -> None:
    """Run each kernel once, on the types that a generator uses; joints is their number."""
    feedback, legs = Feedback(geometry, joints=joints), len(geometry.hips)
    warm_up_judges(legs, joints)
    sensors, some, load = SensorData.zeros(1, legs, joints), np.zeros(joints), np.zeros(legs)
    one = np.zeros(1)
    RatesCheck(geometry).verdict(sensors, 0.002)
    loads_of(geometry.rows, geometry.columns, some, some, 0.0, 0.0, load)
    agreement(load, 1.0, np.zeros(legs, dtype=bool), 0.1, 1.0)
    planned = PlannedMotion(some[None], one, np.zeros((1, 2), dtype=np.int64), one.copy(),
                            np.zeros((1, 2)), one.copy(), one.copy())
    feedback.advance(sensors, planned, 0.002, 0.0)
    Odometry(geometry).advance(sensors, np.zeros(3), np.zeros(legs, dtype=bool), 0.002)
