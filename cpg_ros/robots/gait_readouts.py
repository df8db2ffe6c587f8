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

"""A gait's readout as one list for each joint: its offset, then its weights, rad."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
import math

from cpg_ros.errors import InputError
from cpg_ros.robots.robot import JointMotion, Motion, Robot, WEIGHTS

#: What the generator's parameters of readouts begin with; the joint's name follows.
READOUT = 'readout.'


def gait_readouts(robot: Robot, motion: Motion) -> dict[str, tuple[float, ...]]:
    """Return offset and weights of every joint in one of the robot's motions, rad, by name."""
    found = {}
    for joint in robot.joints:
        moved = motion.joints.get(joint.name, joint)
        found[joint.name] = (moved.offset, *moved.weights)
    return found


def with_readouts(robot: Robot, preset: str, gait: str,
                  wanted: Mapping[str, Sequence[float]]) -> Robot:
    """Return a robot whose joints are read off a gait in another way.

    Weights at a stride of 0, steering and duty stay those of the file.

    Args:
        robot: it is returned as it is if that is how it moves already.
        preset: whose motion is changed, or that of its gait if it has none of its own.
        gait: of the preset.
        wanted: of every joint its offset, then 1, 2, 4 or 6 weights, rad.

    Raises:
        InputError: of a joint there are fewer or more numbers, or one is not finite.

    """
    motion = robot.motion(preset, gait)
    if wanted == gait_readouts(robot, motion):
        return robot
    joints = {}
    for name, (offset, *weights) in ((name, [*row] or [math.nan])
                                     for name, row in wanted.items()):
        if len(weights) not in WEIGHTS or not all(map(math.isfinite, (offset, *weights))):
            raise InputError(f'{READOUT}{name} must be an offset and 1, 2, 4 or 6 weights in rad, '
                             f'not {list(wanted[name])}')
        own = motion.joints.get(name)
        joints[name] = JointMotion(offset, tuple(weights), own.in_place if own else ())
    return replace(robot, motions={**robot.motions, preset: replace(motion, joints=joints)})
