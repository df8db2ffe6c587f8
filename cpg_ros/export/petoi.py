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

"""Gaits as skill arrays of Petoi's OpenCat: one cycle in frames of whole degrees.

An array has the number of frames, the body's roll and pitch (0: none is expected), the number that
all angles are to be multiplied by, and the frames: the walking joints of all legs, joint by joint
from the shoulders down, in the order left front, right front, right hind, left hind.
"""

from collections.abc import Sequence

from cpg_ros.errors import InputError
from cpg_ros.export.c_text import braces
from cpg_ros.export.gait_data import c_name, check_names, comment
from cpg_ros.motion.plan import GaitPlan
from cpg_ros.robots.robot import Robot
import numpy as np

#: What an array may take in the robot's memory, bytes, and its most frames, by its first number.
MOST_BYTES, MOST_FRAMES = 450, 127
HEAD = 4
LEGS = (('lf', 'fl'), ('rf', 'fr'), ('rh', 'hr', 'rb', 'br', 'rr'), ('lh', 'hl', 'lb', 'bl', 'rl'))


def joint_order(robot: Robot) -> np.ndarray:
    """Return which of the robot's joints each number of a frame is.

    Raises:
        InputError: the robot has not four legs, of these names, with two or three joints each.

    """
    found = {leg.lower(): leg for leg in robot.legs}
    legs = [found[name] for names in LEGS for name in names if name in found]
    joints = {len(robot.legs[leg]) for leg in legs}
    if len(legs) != len(LEGS) or len(robot.legs) != len(LEGS) or not joints <= {2, 3} \
            or len(joints) != 1:
        raise InputError(f'robot {robot.name}: skill arrays are for four legs, named lf, rf, rh '
                         f'and lh, with two or three joints each; it has {", ".join(robot.legs)}')
    names = [joint.name for joint in robot.joints]
    return np.array([names.index(robot.legs[leg][number].name)
                     for number in range(joints.pop()) for leg in legs])


def skill(plan: GaitPlan) -> np.ndarray:
    """Return a gait's array of int8, from where its first leg's phase is 0.

    Raises:
        InputError: an angle is beyond twice the range of int8, or the robot is none of Petoi's.

    """
    order, readout, robot = joint_order(plan.robot), plan.readout, plan.robot
    frames = min(MOST_FRAMES, (MOST_BYTES - HEAD) // order.size)
    phases = np.arange(frames) / frames - readout.start
    grid = np.arange(readout.angles.shape[1]) / readout.angles.shape[1]
    stand = plan.shift + robot.column('offset')
    degrees = np.degrees([stand[joint] + np.interp(
        phases + plan.orbit.phases[robot.cells[joint]], grid, readout.angles[joint], period=1.0)
        for joint in order]).T
    ratio = 1 if np.abs(degrees).max() <= 127.0 else 2
    found = np.rint(degrees / ratio).astype(int)
    if np.abs(found).max() > 127:
        raise InputError(f'{plan.name}: an angle of {np.abs(degrees).max():.0f} degrees; skill '
                         'arrays go to 254')
    return np.concatenate([[frames, 0, 0, ratio], found.ravel()]).astype(np.int8)


def skills(plans: Sequence[GaitPlan], title: str) -> str:
    """Write gaits as arrays of C.

    Raises:
        InputError: as of skill, or two gaits have the same name in C.

    """
    check_names('gait', [plan.name for plan in plans])
    arrays = []
    for plan in plans:
        data = skill(plan)
        rows = [data[:HEAD], *data[HEAD:].reshape(data[0], -1)]
        numbers = ',\n'.join('    ' + braces(row, 'int8')[1:-1] for row in rows)
        arrays.append(f'/* {data[0]} frames a stride: {plan.frequency:g} strides per second are '
                      f'{data[0] * plan.frequency:g} frames per second. */\n'
                      f'const int8_t {c_name(plan.name).lower()}[] PROGMEM = {{\n{numbers}}};\n')
    return '\n'.join([f'/* {comment(title)}, as skill arrays of OpenCat. */', *arrays])
