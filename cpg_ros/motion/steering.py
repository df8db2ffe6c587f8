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

import math

import numpy as np

#: What is asked for is approached with this time constant, s.
TIME_CONSTANT = 0.2


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
        self._asked = (np.ones(legs + 1), False)
        self.stride, self.rate = self._now[:legs], self._rate[:legs]
        self.trim: np.ndarray | None = None

    @property
    def pace(self) -> float:
        """Factor of the stride frequency."""
        return float(self._now[-1])

    def ask(self, stride: np.ndarray, pace: float, at_once: bool = False) -> None:
        """Set the targets, to be reached at once where nothing moves yet.

        May be called from another thread than advance.
        """
        self._asked = np.append(stride, pace), at_once

    def advance(self, dt: float) -> None:
        """Advance by dt in s."""
        # e(t) = (e + (v + e / T) t) exp(-t / T), e the distance from the target.
        target, at_once = self._asked
        if at_once:
            self._now[:], self._rate[:] = target, 0.0
            return
        if self.trim is not None:
            target = np.append(np.clip(target[:-1] + self.trim, -1.0, 1.0), target[-1])
        decay = math.exp(-dt / TIME_CONSTANT)
        gap = self._now - target
        pull = self._rate + gap / TIME_CONSTANT
        self._now[:] = target + (gap + pull * dt) * decay
        self._rate[:] = (self._rate - pull * dt / TIME_CONSTANT) * decay
