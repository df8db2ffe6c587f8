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

"""The shipped Go2's gaits, for tests that move its body."""

from functools import cache
from pathlib import Path

from cpg_ros.feedback.kinematics import joints_of, move_foot, slopes_of
from cpg_ros.motion.plan import plan
from cpg_ros.motion.robot_file import read_robot
from cpg_ros.networks.registry import PRESETS
import numpy as np

FILE = Path(__file__).parents[2] / 'config' / 'unitree_go2.yaml'
GO2 = read_robot(FILE)
#: Time step of the physics, s.
DT = 0.002


@cache
def gait_plan(gait, network='delayed'):
    """Return a gait at the frequency that the robot file has for it."""
    preset = PRESETS[network][gait]
    return plan(GO2, gait, preset, preset.network, GO2.motion(gait, gait).frequency)


def jacobian(geometry, angles):
    """Return the feet's derivatives by hip, thigh and calf, m/rad, shape (legs, 3, 3)."""
    out = np.empty((len(geometry.rows), 3, 3))
    for row, columns, slopes in zip(geometry.rows, geometry.columns, out, strict=True):
        slopes_of(row, *angles[columns], slopes)
    return out


def inverse(geometry, feet):
    """Return angles of hip, thigh and calf, rad, shape (legs, 3), with the feet there."""
    return np.array([joints_of(row, *foot) for row, foot in zip(geometry.rows, feet, strict=True)])


def displace(geometry, angles, feet, way):
    """Return angles with the feet moved by a way in m, rad, shape (..., joints)."""
    found = np.array(angles)
    for place in np.ndindex(found.shape[:-1]):
        for leg, (row, columns) in enumerate(zip(geometry.rows, geometry.columns, strict=True)):
            move_foot(row, columns, found[place], feet[place][leg], way[place][leg])
    return found
