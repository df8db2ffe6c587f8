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

"""Legs of a hip and two joints that pitch: forward, Jacobian, inverse, compiled.

Frames are the base's: x forward, y left, z up. A hip turns about x, or about z where legs reach
to the sides; either is the first axis of the leg's own frame, whose second is the other joints'
and whose third points away from the foot. A leg of two joints has no way sideways.
"""

from dataclasses import dataclass
from functools import cached_property
import math
from typing import NamedTuple

from cpg_ros.common.errors import InputError
from cpg_ros.dynamics.integration.compilation import jit, jit_entry
from cpg_ros.motion.body_file import BodyGeometry, leg_axes
from cpg_ros.motion.robot import Robot
import numpy as np

#: GRAVITY: acceleration of free fall, m/s^2.
GRAVITY = 9.81


class LegArrays(NamedTuple):
    """A geometry as compiled code takes it.

    Attributes:
        rows: of Geometry, shape (legs, 23).
        columns: of Geometry, shape (legs, 3).
        radius: of the feet, m.
        weight: of the robot, N.

    """

    rows: np.ndarray
    columns: np.ndarray
    radius: float
    weight: float


@dataclass(frozen=True)
class Geometry:
    """Lengths and axes of all legs with all joints at 0, and the weight of the robot.

    Attributes:
        columns: index of each leg's hip, thigh and calf among the joints, shape (legs, 3); of a
            leg without a hip joint the first is any, and its turn 0.
        turns: 1 or -1 by the sense of each joint about x, y and y of the leg's frame, shape
            (legs, 3); 0 of legs whose geometry is not known.
        hips: a point on the axis of each hip, m, shape (legs, 3).
        frames: axes of each leg's frame, as columns, shape (legs, 3, 3).
        thighs: from hip to thigh joint in that frame, m, shape (legs, 3).
        uppers: from thigh to calf joint in their plane as z + i x, m, complex, shape (legs,).
        lowers: from calf joint to the middle of the foot, the same.
        bends: 1 or -1, the side to which each knee is bent, shape (legs,).
        radius: of the feet, which roll, m.
        weight: of the robot, N.

    """

    columns: np.ndarray
    turns: np.ndarray
    hips: np.ndarray
    frames: np.ndarray
    thighs: np.ndarray
    uppers: np.ndarray
    lowers: np.ndarray
    bends: np.ndarray
    radius: float
    weight: float

    @cached_property
    def rows(self) -> np.ndarray:
        """A row for each leg as the kernels take it, shape (legs, 23)."""
        return np.column_stack([self.turns, self.hips, self.thighs, self.uppers.real,
                                self.uppers.imag, self.lowers.real, self.lowers.imag, self.bends,
                                self.frames.reshape(-1, 9)])

    @cached_property
    def arrays(self) -> LegArrays:
        """The geometry as arrays, for the kernels."""
        return LegArrays(self.rows, self.columns, self.radius, self.weight)


def bend_of(upper: complex, lower: complex, second: float) -> float:
    """Return the side to which the second of two links is bent at an angle in rad: 1 or -1."""
    return 1.0 if np.sin(second + np.angle(lower / upper)) >= 0.0 else -1.0


def geometry_of(robot: Robot, body: BodyGeometry | None = None) -> Geometry:
    """Return the geometry of a robot's legs: its file's, or another one.

    Legs that the file does not have stay where they are.

    Raises:
        InputError: there is none.

    """
    body = body or robot.geometry
    if body is None:
        raise InputError(f"robot file '{robot.name}' has no geometry of the legs (part geometry: "
                         'check_robot --make writes it, and tune)')
    joints = {joint.name: k for k, joint in enumerate(robot.joints)}
    offsets = robot.column('offset')
    count = len(robot.legs)
    columns, turns = np.zeros((count, 3), dtype=np.int64), np.zeros((count, 3))
    hips, thighs, bends = np.zeros((count, 3)), np.zeros((count, 3)), np.ones(count)
    uppers, lowers = np.full((2, count), -0.1 + 0.0j)
    frames = np.tile(np.eye(3), (count, 1, 1))
    for k, name in enumerate(robot.legs):
        if name not in body.legs:
            continue
        leg = body.legs[name]
        own = [joints[joint] for joint in leg.joints]
        columns[k], turns[k, -len(own):] = own if len(own) == 3 else [own[0], *own], leg.turns
        hips[k], frames[k] = leg.hip, leg_axes(leg.yaw, leg.roll)
        thighs[k], calf, foot = (np.array(link) @ frames[k]
                                 for link in (leg.thigh, leg.calf, leg.foot))
        # The sideways offsets of the links are part of the offset of the leg's plane.
        thighs[k, 1] += calf[1] + foot[1]
        uppers[k], lowers[k] = (complex(link[2], link[0]) for link in (calf, foot))
        bends[k] = bend_of(uppers[k], lowers[k], turns[k, 2] * offsets[own[-1]])
    return Geometry(columns, turns, hips, frames, thighs, uppers, lowers, bends, body.foot_radius,
                    GRAVITY * body.mass)


@jit
def from_leg(leg, x, y, z):
    """Return a vector, given in a leg's frame, in the frame of the base."""
    return (leg[14] * x + leg[15] * y + leg[16] * z, leg[17] * x + leg[18] * y + leg[19] * z,
            leg[20] * x + leg[21] * y + leg[22] * z)


@jit
def to_leg(leg, x, y, z):
    """Return a vector, given in the frame of the base, in a leg's frame."""
    return (leg[14] * x + leg[17] * y + leg[20] * z, leg[15] * x + leg[18] * y + leg[21] * z,
            leg[16] * x + leg[19] * y + leg[22] * z)


@jit
def foot_of(leg, hip, thigh, calf):
    """Return a foot's place in the leg's frame, x, y and z in m; joints in rad."""
    hip, thigh, calf = leg[0] * hip, leg[1] * thigh, leg[1] * thigh + leg[2] * calf
    ct, st, cc, sc = math.cos(thigh), math.sin(thigh), math.cos(calf), math.sin(calf)
    y, z = leg[7], leg[8] + leg[9] * ct - leg[10] * st + leg[11] * cc - leg[12] * sc
    ch, sh = math.cos(hip), math.sin(hip)
    x, y, z = from_leg(leg, leg[6] + leg[9] * st + leg[10] * ct + leg[11] * sc + leg[12] * cc,
                       y * ch - z * sh, y * sh + z * ch)
    return leg[3] + x, leg[4] + y, leg[5] + z


@jit
def slopes_of(leg, hip, thigh, calf, out):
    """Fill the derivatives of a leg's foot by its joints, m/rad, shape (3, 3)."""
    hip, thigh, calf = leg[0] * hip, leg[1] * thigh, leg[1] * thigh + leg[2] * calf
    ct, st, cc, sc = math.cos(thigh), math.sin(thigh), math.cos(calf), math.sin(calf)
    lower_z, lower_x = leg[11] * cc - leg[12] * sc, leg[11] * sc + leg[12] * cc
    whole_z, whole_x = leg[9] * ct - leg[10] * st + lower_z, leg[9] * st + leg[10] * ct + lower_x
    y, z = leg[7], leg[8] + whole_z
    ch, sh = math.cos(hip), math.sin(hip)
    out[0, 0], out[1, 0], out[2, 0] = from_leg(leg, 0.0, leg[0] * (-y * sh - z * ch),
                                               leg[0] * (y * ch - z * sh))
    # A positive turn about y takes z + i x on by i times itself.
    out[0, 1], out[1, 1], out[2, 1] = from_leg(leg, leg[1] * whole_z, leg[1] * sh * whole_x,
                                               -leg[1] * ch * whole_x)
    out[0, 2], out[1, 2], out[2, 2] = from_leg(leg, leg[2] * lower_z, leg[2] * sh * lower_x,
                                               -leg[2] * ch * lower_x)


@jit
def vertical(roll, pitch):
    """Return the vertical in the frame of a base that leans by these angles, rad."""
    return -math.sin(pitch), math.sin(roll) * math.cos(pitch), math.cos(roll) * math.cos(pitch)


@jit
def cross(a, b):
    """Return the product of two vectors, a tuple."""
    return (a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0])


@jit
def wrapped(angle):
    """Return an angle from -pi to pi."""
    return (angle + math.pi) % (2.0 * math.pi) - math.pi


@jit
def joints_of(leg, x, y, z):
    """Return hip, thigh and calf, rad, with a leg's foot there; see inverse."""
    x, y, z = to_leg(leg, x - leg[3], y - leg[4], z - leg[5])
    side, hip = leg[7], 0.0
    if leg[0] != 0.0:
        down = -math.sqrt(max(y * y + z * z - side * side, 1e-6))
        hip, z = math.atan2(z, y) - math.atan2(down, side), down
    z, x = z - leg[8], x - leg[6]
    a2 = leg[9] * leg[9] + leg[10] * leg[10]
    b2 = leg[11] * leg[11] + leg[12] * leg[12]
    cosine = (z * z + x * x - a2 - b2) / (2.0 * math.sqrt(a2 * b2))
    # The calf's angle from a straight leg on, of links that may be cranked.
    cranked = math.atan2(leg[12], leg[11]) - math.atan2(leg[10], leg[9])
    calf = leg[13] * math.acos(min(max(cosine, -1.0), 1.0)) - cranked
    cc, sc = math.cos(calf), math.sin(calf)
    straight = math.atan2(leg[10] + leg[11] * sc + leg[12] * cc,
                          leg[9] + leg[11] * cc - leg[12] * sc)
    thigh = math.atan2(x, z) - straight
    # Turns are their own inverses; a missing hip stays 0.
    return wrapped(hip) * leg[0], wrapped(thigh) * leg[1], wrapped(calf) * leg[2]


@jit
def move_foot(leg, columns, angles, foot, way):
    """Change the angles of a leg, rad, so that its foot moves by a displacement, m, shape (3,).

    A displacement of 0, and a leg of unknown geometry, leave the angles exactly as they are. The
    limits of the joints are up to the caller.
    """
    if leg[1] == 0.0 or (way[0] == 0.0 and way[1] == 0.0 and way[2] == 0.0):
        return
    now = joints_of(leg, foot[0], foot[1], foot[2])
    then = joints_of(leg, foot[0] + way[0], foot[1] + way[1], foot[2] + way[2])
    if leg[0] != 0.0:
        angles[columns[0]] += wrapped(then[0] - now[0])
    angles[columns[1]] += wrapped(then[1] - now[1])
    angles[columns[2]] += wrapped(then[2] - now[2])


@jit_entry
def _feet(rows, columns, angles, out):
    for k in range(angles.shape[0]):
        for leg in range(rows.shape[0]):
            out[k, leg] = foot_of(rows[leg], angles[k, columns[leg, 0]],
                                  angles[k, columns[leg, 1]], angles[k, columns[leg, 2]])


def forward(geometry: Geometry, angles: np.ndarray) -> np.ndarray:
    """Return the places of the feet, m, shape (..., legs, 3), for angles in rad, (..., joints)."""
    out = np.empty((*angles.shape[:-1], len(geometry.hips), 3))
    flat = np.ascontiguousarray(angles, dtype=float).reshape(-1, angles.shape[-1])
    _feet(geometry.rows, geometry.columns, flat, out.reshape(-1, *out.shape[-2:]))
    return out
