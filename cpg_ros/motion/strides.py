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

"""Steering a gait: how long each leg's stride is, and how fast strides follow one another."""

import math
from typing import TypeVar

from cpg_ros.dynamics.integration.compilation import jit_entry
import numpy as np

Real = TypeVar('Real', float, np.ndarray)


def smoothstep(s: Real) -> tuple[Real, Real]:
    """Smooth step from 0 to 1 and its derivative: 3 s^2 - 2 s^3."""
    return s * s * (3.0 - 2.0 * s), 6.0 * s * (1.0 - s)


def come_to_rest(start: Real, rate: Real, end: Real | float, time: float, s: float
                 ) -> tuple[Real, Real]:
    """Value and rate at a fraction of the cubic from a start and its rate to rest at an end."""
    fraction, slope = smoothstep(s)
    return (start + fraction * (end - start) + s * (1.0 - s)**2 * time * rate,
            slope * (end - start) / time + (1.0 - s) * (1.0 - 3.0 * s) * rate)


#: Targets are approached with this time constant, s.
TIME_CONSTANT = 0.2
_NOTHING = np.zeros(0)


@jit_entry
def approach(targets, trim, dt, now, rate):
    """Advance strides and pace towards their targets by dt in s.

    Args:
        targets: targets, shape (legs + 1,).
        trim: added to those of the strides, shape (legs,) or (0,).
        dt: s.
        now: the strides and the pace, shape (legs + 1,); overwritten.
        rate: their derivatives, 1/s; overwritten.

    """
    # e(t) = (e + (v + e / T) t) exp(-t / T), e the distance from the target.
    decay = math.exp(-dt / TIME_CONSTANT)
    for k in range(len(now)):
        target = targets[k]
        if k < len(trim):
            target = min(max(target + trim[k], -1.0), 1.0)
        gap = now[k] - target
        pull = rate[k] + gap / TIME_CONSTANT
        now[k] = target + (gap + pull * dt) * decay
        rate[k] = (rate[k] - pull * dt / TIME_CONSTANT) * decay


@jit_entry
def lengthen(stride, leg, shift, motion):
    """Scale the joints' motion to the strides of their legs.

    Args:
        stride: of each leg, shape (legs,).
        leg: of each joint, shape (joints,); all others too.
        shift: added to the angles, rad.
        motion: shape (4, joints): deviations of the gait from the stand, rad, and their
            derivatives by phase, rad per cycle, both overwritten; deviations of the gait in
            place, rad, overwritten with the derivatives of the angles by the stride; and their
            derivatives by phase, rad per cycle.

    """
    # angle = in_place + stride (angle - in_place), and so its derivatives.
    angle, d_angle_d_phase, reach, lift = motion
    for joint in range(len(leg)):
        longer = stride[leg[joint]] - 1.0
        reach[joint] = angle[joint] - reach[joint]
        d_angle_d_phase[joint] += longer * (d_angle_d_phase[joint] - lift[joint])
        angle[joint] += longer * reach[joint] + shift[joint]


@jit_entry
def scale(level, frequency, change, leg, offset, motion, wanted, speed):
    """Fill in the joints' angles, rad, and velocities, rad/s, of a gait, shape (joints,).

    Args:
        level: share of the gait about the stand.
        frequency: of the stride, Hz.
        change: of the legs' strides, 1/s, shape (legs,).
        leg: of each joint, shape (joints,); all others too.
        offset: the stand, rad.
        motion: as lengthen leaves it, shape (4, joints).
        wanted: filled, rad.
        speed: filled, rad/s.

    """
    angle, d_angle_d_phase, reach, _ = motion
    for joint in range(len(leg)):
        wanted[joint] = level * angle[joint] + offset[joint]
        speed[joint] = level * (frequency * d_angle_d_phase[joint] + change[leg[joint]]
                                * reach[joint])


class StrideCommand:
    """Strides of the legs and their pace, on the way to their targets.

    Each approaches its target as a critically damped oscillator does, so that a change of
    target changes neither value nor rate at once.

    Attributes:
        stride: factor of each leg's stride, shape (legs,); 1 is the gait as it is.
        rate: its derivative, 1/s.
        pace: factor of the stride frequency.
        trim: added to the targets of the strides, shape (legs,), such as by feedback; None for
            nothing.

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
