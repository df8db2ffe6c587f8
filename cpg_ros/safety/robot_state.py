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

"""State that a bridge reads from its robot, and command that it sends; subclassed by robot."""

from typing import Any

import numpy as np


class RobotState:
    """The measured state; a subclass reads the robot's messages into it.

    The defaults are those of a robot without an IMU, temperatures or a counter.

    Attributes:
        q: angles, rad, shape (joints,), in the order of the robot's motors.
        dq: speeds, rad/s.
        temperature: of the motors, deg C, shape (joints,); empty if they are not measured.

    """

    temperature: np.ndarray = np.zeros(0)

    def __init__(self, joints: int) -> None:
        """Start with all angles and speeds at zero."""
        self.q, self.dq = np.zeros(joints), np.zeros(joints)

    def read(self, message: Any) -> bool:
        """Take a message over; return whether it could be used. Keep the arrays, fill them."""
        raise NotImplementedError

    @property
    def tick(self) -> int:
        """The robot's own counter of its states, which must not stand still; 0 for none."""
        return 0

    @property
    def tilt_cosine(self) -> float:
        """Cosine of the angle between the body's and the world's vertical; 1 without an IMU."""
        return 1.0

    def reset_motor_faults(self) -> None:
        """Compare motors with their state as it is now, before the joints are driven."""

    def motor_fault(self) -> str:
        """Return which motor reports a fault, and which, or ''."""
        return ''


class JointCommand:
    """The command for all joints, filled in place; a subclass encodes it for the robot.

    Each motor applies tau + kp (q - angle) + kd (dq - speed).

    Attributes:
        q: angles wanted, rad, shape (joints,), in the order of the robot's motors.
        dq: speeds wanted, rad/s.
        tau: torques added, N m.
        kp: N m / rad.
        kd: N m s / rad.

    """

    def __init__(self, joints: int) -> None:
        """Start with all numbers at zero: no torque."""
        self.q, self.dq, self.tau, self.kp, self.kd = np.zeros((5, joints))

    def damp(self, kd: float | np.ndarray) -> None:
        """Only brake the joints: kp 0, no torque, ``kd`` in N m s / rad."""
        self.q[:] = self.dq[:] = self.tau[:] = self.kp[:] = 0.0
        self.kd[:] = kd

    def encode(self) -> Any:
        """Return the command as a message, or as the bytes of one."""
        raise NotImplementedError
