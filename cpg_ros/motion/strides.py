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

"""Strides of another length and pace than the gait's own, compiled."""

import math

from cpg_ros.integration.jit import entry

#: What is asked for is approached with this time constant, s.
TIME_CONSTANT = 0.2


@entry
def approach(targets, trim, dt, now, rate):
    """Let strides and pace go on for dt in s towards what is asked for.

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


@entry
def lengthen(stride, leg, shift, angle, rise, reach, lift):
    """Make the joints' way as long as their legs' strides are.

    Args:
        stride: of each leg, shape (legs,).
        leg: of each joint, shape (joints,); all others too.
        shift: added to the angles, rad.
        angle: deviations of the gait from the stand, rad; overwritten.
        rise: their derivatives by phase, rad per cycle; overwritten.
        reach: deviations of the gait in place, rad; overwritten with the derivatives of the
            angles by the stride.
        lift: derivatives of the gait in place by phase, rad per cycle.

    """
    # angle = in_place + stride (angle - in_place), and so its derivatives.
    for joint in range(len(leg)):
        longer = stride[leg[joint]] - 1.0
        reach[joint] = angle[joint] - reach[joint]
        rise[joint] += longer * (rise[joint] - lift[joint])
        angle[joint] += longer * reach[joint] + shift[joint]


@entry
def scale(level, frequency, change, leg, offset, angle, rise, reach, wanted, speed):
    """Fill in where a gait wants the joints, rad, and how fast, rad/s, shape (joints,).

    Args:
        level: share of the gait about the stand.
        frequency: of the stride, Hz.
        change: of the legs' strides, 1/s, shape (legs,).
        leg: of each joint, shape (joints,); all others too.
        offset: the stand, rad.
        angle: as of lengthen.
        rise: as of lengthen.
        reach: as of lengthen.
        wanted: filled, rad.
        speed: filled, rad/s.

    """
    for joint in range(len(leg)):
        wanted[joint] = level * angle[joint] + offset[joint]
        speed[joint] = level * (frequency * rise[joint] + change[leg[joint]] * reach[joint])
