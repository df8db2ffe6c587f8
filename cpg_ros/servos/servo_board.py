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

"""What every board of servos can do, and its error."""

from typing import Protocol

from cpg_ros.errors import CpgError
import numpy as np


class ServoError(CpgError):
    """A servo or its bus cannot be used; the message says which, and why."""


class ServoBoard(Protocol):
    """A board of servos, in its own units: microseconds of a pulse, or steps of an encoder.

    All methods raise an OSError if the bus fails, and ServoError if a servo reports a fault.
    """

    def write(self, units: np.ndarray) -> None:
        """Drive all servos to positions, whole numbers of shape (servos,)."""

    def read(self) -> np.ndarray | None:
        """Return the measured positions, shape (servos,); None if a servo does not answer."""

    def detach(self) -> None:
        """Let all servos go: no pulses, no torque."""

    def close(self) -> None:
        """Give the bus back."""
