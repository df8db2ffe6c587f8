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

"""What an inertial measurement unit on a simulated base shows, with the noise of a real one."""

from collections import deque

from cpg_ros.feedback.kinematics import GRAVITY
from cpg_ros.simulation.body import Body
from cpg_ros.simulation.robot_model import engine
from cpg_ros.simulation.scenario import SensorNoise
import numpy as np


class InertialUnit:
    """Measures a body period by period.

    Attributes:
        seed: of its noise.

    """

    def __init__(self, body: Body, period: float, noise: SensorNoise) -> None:
        """Be ready to measure a body at a period in s."""
        self._body, self._period, self._noise = body, period, noise
        self.seed = noise.seed
        self._rng = np.random.default_rng(noise.seed)
        half = 0.5 * noise.orientation_bias
        turned = np.array([1.0, half, half, 0.0])
        self._turned = turned / np.linalg.norm(turned)
        self._before = body.rates[:3].copy()
        self._orientation = np.empty(4)
        self._late: deque[tuple[int, np.ndarray]] = deque()

    def measure(self, stamp: int) -> tuple[int, np.ndarray] | None:
        """Measure at a stamp in ns.

        Returns:
            What arrives now, None if nothing does: its stamp, and orientation (x y z w), angular
            velocity in rad/s and acceleration in m/s^2, shape (10,).

        """
        noise, body, found = self._noise, self._body, np.empty(10)
        engine().mju_mulQuat(self._orientation, body.quaternion, self._turned)
        found[:4] = np.roll(self._orientation, -1)
        rates = body.rates
        faster = (rates[:3] - self._before) / self._period
        faster[2] += GRAVITY
        self._before[:] = rates[:3]
        found[4:7] = rates[3:] + noise.gyroscope_bias
        found[7:] = faster @ body.axes + noise.accelerometer_bias
        if noise.gyroscope_noise or noise.accelerometer_noise:
            drawn = self._rng.standard_normal(6)
            found[4:7] += noise.gyroscope_noise * drawn[:3]
            found[7:] += noise.accelerometer_noise * drawn[3:]
        if not noise.delay:
            return stamp, found
        self._late.append((stamp, found))
        arrived = None
        while self._late and self._late[0][0] <= stamp - 1e9 * noise.delay:
            arrived = self._late.popleft()
        return arrived
