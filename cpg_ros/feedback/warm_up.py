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

"""Make every kernel of the feedback ready, compiling those not yet on disk."""

from cpg_ros.feedback.estimate import SensorData
from cpg_ros.feedback.feedback import Feedback
from cpg_ros.feedback.foot_force import loads_of
from cpg_ros.feedback.kinematics import Geometry
from cpg_ros.feedback.leg_rates import RatesCheck
from cpg_ros.feedback.odometry import Odometry
from cpg_ros.feedback.plausibility import (
    agreement,
    IMU,
    IMU_MEMORY,
    judge_imu,
    judge_joints,
    judge_loads,
)
from cpg_ros.feedback.tick import PlannedMotion
import numpy as np


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
