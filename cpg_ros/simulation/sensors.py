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

"""Sensor data of simulated bodies, from the true state of the physics and with sensor noise."""

from collections import deque
from dataclasses import replace
import math

from cpg_ros.dynamics.integration.compilation import jit_entry
from cpg_ros.feedback.estimate import SensorData
from cpg_ros.feedback.kinematics import GRAVITY
from cpg_ros.motion.rotations import fill_quaternion
from cpg_ros.simulation.body import Body
from cpg_ros.simulation.scenario import SensorNoise
import numpy as np


class SimulatedSensors:
    """The IMU and the feet of one body, measured period by period.

    Attributes:
        foot_forces: of the floor on each leg, as last measured, N, shape (legs,).

    """

    def __init__(self, body: Body, period: float, noise: SensorNoise) -> None:
        """Prepare to measure a body at a period in s; the delay is that of the IMU's messages."""
        self._body, self._period, self._delay = body, period, round(1e9 * noise.delay)
        self.foot_forces = body.feet.copy()
        self._true = SensorData.zeros(1, len(body.feet), 0)
        self._noise = NoisySenses(replace(noise, delay=0.0), 1, len(body.feet), period)
        self._before, self._velocity = body.rates[None].copy(), np.empty((1, 3))
        self._late: deque[tuple[int, np.ndarray]] = deque()

    def measure(self, stamp: int) -> tuple[int, np.ndarray] | None:
        """Measure at a stamp in ns.

        Returns:
            The IMU's message that arrives now, None if none does: its stamp, and orientation
            (x y z w), angular velocity in rad/s and acceleration in m/s^2, shape (10,).

        """
        body, true, imu = self._body, self._true, np.empty(10)
        true.foot_forces[0] = body.feet
        # As plain Python: a simulated robot needs no machine code for one body.
        fill_sensor_data.py_func(true, body.quaternion[None], body.rates[None], self._before,
                                 self._period, self._velocity)
        self._before[0] = body.rates
        sensed = self._noise(true)
        self.foot_forces = sensed.foot_forces[0]
        roll, pitch, yaw = sensed.rpy[0].tolist()
        fill_quaternion(roll, pitch, yaw, imu)
        imu[:4] = np.roll(np.copysign(1.0, imu[0]) * imu[:4], -1)
        imu[4:7], imu[7:] = sensed.angular_velocity[0], sensed.acceleration[0]
        self._late.append((stamp, imu))
        arrived = None
        while self._late and self._late[0][0] <= stamp - self._delay:
            arrived = self._late.popleft()
        return arrived


@jit_entry
def fill_sensor_data(senses, quaternions, moving, before, dt, velocity):
    """Fill the measurements of the base, and its true velocity in its own frame, m/s, (runs, 3).

    Args:
        senses: SensorData, whose rpy, angular_velocity and acceleration are filled.
        quaternions: of the bases, w x y z, shape (runs, 4).
        moving: velocity in the world's frame, m/s, then angular velocity in the base's, rad/s,
            shape (runs, 6).
        before: the same dt before.
        dt: s.
        velocity: filled.

    """
    rpy, acceleration = senses.rpy, senses.acceleration
    for k in range(len(quaternions)):
        w, x, y, z = quaternions[k]
        rpy[k, 0] = math.atan2(2.0 * (w * x + y * z), 1.0 - 2.0 * (x * x + y * y))
        rpy[k, 1] = math.asin(min(max(2.0 * (w * y - z * x), -1.0), 1.0))
        rpy[k, 2] = math.atan2(2.0 * (w * z + x * y), 1.0 - 2.0 * (y * y + z * z))
        axes = ((1 - 2 * (y * y + z * z), 2 * (x * y + w * z), 2 * (x * z - w * y)),
                (2 * (x * y - w * z), 1 - 2 * (x * x + z * z), 2 * (y * z + w * x)),
                (2 * (x * z + w * y), 2 * (y * z - w * x), 1 - 2 * (x * x + y * y)))
        faster = ((moving[k, 0] - before[k, 0]) / dt, (moving[k, 1] - before[k, 1]) / dt,
                  (moving[k, 2] - before[k, 2]) / dt + GRAVITY)
        for axis in range(3):
            senses.angular_velocity[k, axis] = moving[k, 3 + axis]
            acceleration[k, axis] = velocity[k, axis] = 0.0
            for world in range(3):
                acceleration[k, axis] += axes[axis][world] * faster[world]
                velocity[k, axis] += axes[axis][world] * moving[k, world]


class NoisySenses:
    """Sensor data of many bodies with the noise and the delay of sensors."""

    def __init__(self, noise: SensorNoise, runs: int, legs: int, dt: float) -> None:
        self._noise, self._rng = noise, np.random.default_rng(noise.seed)
        self._later = round(noise.delay / dt)
        self._waiting: list[SensorData] = []
        self._factor = 1.0 + noise.force_bias * self._rng.uniform(-1.0, 1.0, (runs, legs))
        signs = self._rng.choice([-1.0, 1.0], (runs, 2))
        self._bias = (noise.orientation_bias + noise.imu_tilt) * signs
        self._tilt = noise.imu_tilt * np.column_stack([signs, np.zeros(runs)])

    def __call__(self, true: SensorData) -> SensorData:
        """Return the data that arrives now."""
        rng, noise = self._rng, self._noise
        loads = true.foot_forces * (self._factor + noise.force_noise * rng.normal(
            size=true.foot_forces.shape))
        if noise.stuck is not None:
            loads[:, 0] = noise.stuck
        rpy = true.rpy.copy()
        rpy[:, :2] += self._bias
        # Vectors in the axes of a unit that is tilted by a small angle.
        turning, faster = (vectors + np.cross(vectors, self._tilt) if noise.imu_tilt else vectors
                           for vectors in (true.angular_velocity, true.acceleration))
        angular_velocity = (turning + noise.gyroscope_bias
                            + noise.gyroscope_noise * rng.normal(size=rpy.shape))
        acceleration = faster + noise.accelerometer_bias
        if noise.accelerometer_noise:
            acceleration += noise.accelerometer_noise * rng.normal(size=rpy.shape)
        self._waiting.append(SensorData(true.joint_positions.copy(), true.joint_velocities.copy(),
                                        loads, rpy, angular_velocity, acceleration))
        return self._waiting[0] if len(self._waiting) <= self._later else self._waiting.pop(0)
