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

"""The commands of joints, from their positions, velocities and efforts."""

from dataclasses import dataclass

from cpg_ros.errors import InputError
import numpy as np

#: Gains beyond these are mistakes, and would make numbers overflow.
SMALLEST, LARGEST = 1e-3, 1e5


@dataclass(frozen=True)
class Servo:
    """The controller of a robot's joints: effort = kp (command - position) - kd velocity.

    Attributes:
        kp: N m / rad, from SMALLEST to LARGEST.
        kd: N m s / rad, from 0 to LARGEST.

    Raises:
        InputError: a gain is out of its range.

    """

    kp: float
    kd: float = 0.0

    def __post_init__(self) -> None:
        if not SMALLEST <= self.kp <= LARGEST:
            raise InputError(f'kp {self.kp:g} is not from {SMALLEST:g} to {LARGEST:g} N m/rad')
        if not 0.0 <= self.kd <= LARGEST:
            raise InputError(f'kd {self.kd:g} is not from 0 to {LARGEST:g} N m s/rad')

    @property
    def needs(self) -> str:
        """What joint states must have besides positions."""
        return 'velocity and effort' if self.kd else 'effort'

    def command(self, position: np.ndarray, velocity: np.ndarray, effort: np.ndarray
                ) -> np.ndarray:
        """Return the angles that joints were driven to, rad.

        Args:
            position: rad.
            velocity: rad/s, of the same shape; not looked at where kd is 0.
            effort: N m, of the same shape.

        """
        if self.kd:
            effort = effort + self.kd * velocity
        return position + effort / self.kp
