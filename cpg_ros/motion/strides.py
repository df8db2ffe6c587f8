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

"""Steering of a gait: length and frequency of the strides."""

import ctypes
from typing import TypeVar

from cpg_ros.motion.core import core, Smoother
import numpy as np

Real = TypeVar('Real', float, np.ndarray)


def smoothstep(s: Real) -> Real:
    """Return the smooth step from 0 to 1, 3 s^2 - 2 s^3."""
    return s * s * (3.0 - 2.0 * s)


class StrideCommand:
    """Strides of the legs and their pace, on the way to their targets.

    Each approaches its target as a critically damped oscillator, so that a new target changes
    neither value nor rate at once.

    Attributes:
        stride: factor of each leg's stride, shape (legs,); 1 is the gait's own.
        rate: derivative of the strides, 1/s.
        pace: factor of the stride frequency.
        state: strides and pace, and their rates, 1/s, shape (2, legs + 1).

    """

    def __init__(self, legs: int) -> None:
        # One row: the legs' strides and the pace.
        self.state = np.stack([np.ones(legs + 1), np.zeros(legs + 1)])
        self._now, self._rate = self.state
        self._goal = np.ones(legs + 1)
        self.stride, self.rate = self._now[:legs], self._rate[:legs]
        self._trim: np.ndarray | None = None
        self._struct = Smoother(self._now.ctypes.data, self._rate.ctypes.data,
                                self._goal.ctypes.data, None, legs, 0)
        self.address = ctypes.addressof(self._struct)

    @property
    def pace(self) -> float:
        """Factor of the stride frequency."""
        return float(self._now[-1])

    @property
    def trim(self) -> np.ndarray | None:
        """Offsets of the strides' targets, shape (legs,), such as from feedback, or None."""
        return self._trim

    @trim.setter
    def trim(self, trim: np.ndarray | None) -> None:
        if trim is not self._trim:
            self._trim = None if trim is None else np.ascontiguousarray(trim, dtype=float)
            self._struct.trim = None if self._trim is None else self._trim.ctypes.data

    def set_target(self, stride: np.ndarray, pace: float, at_once: bool = False) -> None:
        """Set the targets, to be reached at once where nothing moves yet.

        It may be called from another thread than advance.
        """
        # A tick in between must not reach a part of them at once.
        self._struct.at_once = 0
        self._goal[:-1], self._goal[-1] = stride, pace
        self._struct.at_once = at_once

    def advance(self, dt: float) -> None:
        """Advance by dt in s."""
        core().cpg_steer(self.address, dt)
