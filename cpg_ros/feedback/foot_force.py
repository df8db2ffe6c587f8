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

"""Foot forces from joint torques, for feet without sensors."""

from cpg_ros.feedback.kinematics import cross, slopes_of, vertical
from cpg_ros.integration.jit import entry, jit
import numpy as np

#: Least determinant, m^3: in a leg below it, torques do not determine the force.
SINGULAR = 1e-6


@jit
def load_of(leg, columns, angles, efforts, up, slopes):
    """Return the upward force on a foot, N, of a leg without mass.

    Args:
        leg: a row of the geometry.
        columns: index of hip, thigh and calf among the joints.
        angles: of all joints, rad.
        efforts: of all joints, N m.
        up: the vertical in the base's frame.
        slopes: scratch, shape (3, 3).

    """
    hip, thigh, calf = columns[0], columns[1], columns[2]
    slopes_of(leg, angles[hip], angles[thigh], angles[calf], slopes)
    effort = (efforts[hip], efforts[thigh], efforts[calf])
    if leg[0] == 0.0:
        # Nothing holds it sideways: no force there.
        slopes[1, 0], effort = 1.0, (0.0, effort[1], effort[2])
    # By virtual work the efforts are -J^T F; J^-T has the cross products of J's rows as rows.
    forward, left, upward = (cross(slopes[1], slopes[2]), cross(slopes[2], slopes[0]),
                             cross(slopes[0], slopes[1]))
    volume = slopes[0, 0] * forward[0] + slopes[0, 1] * forward[1] + slopes[0, 2] * forward[2]
    if abs(volume) < SINGULAR:
        return 0.0
    load = 0.0
    for k in range(3):
        load -= effort[k] * (up[0] * forward[k] + up[1] * left[k] + up[2] * upward[k]) / volume
    return load


@entry
def loads_of(rows, columns, angles, efforts, roll, pitch, out):
    """Fill out, N, shape (legs,), with the upward forces on the feet of one robot.

    Rows and columns are the geometry's; angles in rad, efforts in N m, shape (joints,); roll
    and pitch in rad.
    """
    up, slopes = vertical(roll, pitch), np.empty((3, 3))
    for leg in range(len(out)):
        out[leg] = load_of(rows[leg], columns[leg], angles, efforts, up, slopes)
