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

"""Steering a gait: how long each leg's stride is and how fast they follow one another."""

from cpg_ros.motion.strides import approach
import numpy as np

_NOTHING = np.zeros(0)


class Drive:
    """Strides of the legs and their pace, on the way to what is asked for.

    Each approaches its target as a critically damped oscillator does, so that a change of
    target changes neither value nor rate at once.

    Attributes:
        stride: factor of each leg's stride, shape (legs,); 1 is the gait as it is.
        rate: its derivative, 1/s.
        pace: factor of the stride frequency.
        trim: added to the strides that are asked for, shape (legs,), such as by feedback; None
            for nothing.

    """

    def __init__(self, legs: int) -> None:
        # One row: the legs' strides and the pace.
        self._now, self._rate = np.ones(legs + 1), np.zeros(legs + 1)
        self._target = (np.ones(legs + 1), False)
        self.stride, self.rate = self._now[:legs], self._rate[:legs]
        self.trim: np.ndarray | None = None

    @property
    def pace(self) -> float:
        """Factor of the stride frequency."""
        return float(self._now[-1])

    def set_target(self, stride: np.ndarray, pace: float, at_once: bool = False) -> None:
        """Set the targets, to be reached at once where nothing moves yet.

        May be called from another thread than advance.
        """
        self._target = np.append(stride, pace), at_once

    def advance(self, dt: float) -> None:
        """Advance by dt in s."""
        target, at_once = self._target
        if at_once:
            self._now[:], self._rate[:] = target, 0.0
            return
        approach(target, _NOTHING if self.trim is None else self.trim, dt, self._now, self._rate)
