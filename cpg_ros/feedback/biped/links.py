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

"""Kinematics of a biped, compiled: positions, centre of mass, Jacobians and gravity torques.

All vectors have the axes of the world and start at the base. Joints turn what is beyond them about
axes that are known with all joints at 0, so that products of rotations give everything; masses are
lumped at the links' centres, which is exact for all that is computed here.
"""

from typing import NamedTuple

from cpg_ros.common.errors import InputError
from cpg_ros.dynamics.integration.compilation import jit, jit_entry
from cpg_ros.feedback.kinematics import cross, GRAVITY
from cpg_ros.motion.body_file import BASE
from cpg_ros.motion.robot import Robot
from cpg_ros.motion.rotations import fill_rotation
import numpy as np


class Links(NamedTuple):
    """Links as arrays for compiled code: row 0 is the base, row k + 1 the link of joint k.

    Attributes:
        parents: rows of the links before, shape (joints + 1,).
        axes: of the joints, unit vectors with all joints at 0, shape (joints + 1, 3).
        anchors: points on them, m, the same.
        masses: kg, shape (joints + 1,).
        centers: of these masses, m, shape (joints + 1, 3).
        chains: rows of each leg's joints from the base outwards, shape (legs, joints of a leg).
        soles: middle of each sole, m, shape (legs, 3).
        half: half the length and the width of a sole, m, shape (2,).
        sides: 1 for a leg on the left, -1 for one on the right, shape (legs,).

    """

    parents: np.ndarray
    axes: np.ndarray
    anchors: np.ndarray
    masses: np.ndarray
    centers: np.ndarray
    chains: np.ndarray
    soles: np.ndarray
    half: np.ndarray
    sides: np.ndarray


class Pose(NamedTuple):
    """Positions and rotations of the links, in world axes from the base.

    Attributes:
        rotations: of each link, shape (joints + 1, 3, 3).
        origins: of the joints' anchors, m, shape (joints + 1, 3).
        axes: of the joints, shape (joints + 1, 3).
        carried: mass from each joint on, kg, shape (joints + 1,).
        moments: that mass times the place of its centre, kg m, shape (joints + 1, 3).
        soles: middle of the soles, m, shape (legs, 3).

    """

    rotations: np.ndarray
    origins: np.ndarray
    axes: np.ndarray
    carried: np.ndarray
    moments: np.ndarray
    soles: np.ndarray


def links_of(robot: Robot) -> Links:
    """Return a robot's links.

    Raises:
        InputError: the robot file has no part ``biped``, or its legs differ in length.

    """
    body = robot.biped
    if body is None:
        raise InputError(f"robot file '{robot.name}' has no part biped (links, soles, servos), "
                         'without which it does not balance on soles')
    rows = {BASE: 0} | {name: k + 1 for k, name in enumerate(body.links)}
    links = body.links.values()
    chains = []
    for leg, joints in robot.legs.items():
        chain = sorted(rows[joint.name] for joint in joints)
        below = [rows[list(body.links.values())[row - 1].parent] for row in chain]
        if below != [0, *chain[:-1]]:
            raise InputError(f"robot file '{robot.name}': joints of the leg {leg} do not follow "
                             'one another from the base on (biped.links)')
        chains.append(chain)
    if len({len(chain) for chain in chains}) != 1:
        raise InputError(f"robot file '{robot.name}': its legs have different numbers of joints")
    return Links(np.array([0, *(rows[link.parent] for link in links)]),
                 np.array([[0.0, 0.0, 0.0], *(link.axis for link in links)]),
                 np.array([[0.0, 0.0, 0.0], *(link.anchor for link in links)]),
                 np.array([body.mass, *(link.mass for link in links)]),
                 np.array([body.center, *(link.center for link in links)]),
                 np.array(chains), np.array([body.soles[leg] for leg in robot.legs]),
                 0.5 * np.array(body.sole_size), np.where(robot.left, 1.0, -1.0))


def blank_pose(links: Links) -> Pose:
    """Return a pose to be filled."""
    count = len(links.masses)
    return Pose(np.zeros((count, 3, 3)), np.zeros((count, 3)), np.zeros((count, 3)),
                np.zeros(count), np.zeros((count, 3)), np.zeros(links.soles.shape))


#: Rotation from the base's axes to the world's.
rotate = jit(fill_rotation)


@jit
def carry(rotation, offset, k):
    """Return component k of a rotated offset."""
    return rotation[k, 0] * offset[0] + rotation[k, 1] * offset[1] + rotation[k, 2] * offset[2]


@jit
def place(links, rpy, joints, pose):
    """Fill a pose.

    Args:
        links: Links.
        rpy: roll, pitch and yaw of the base, rad, shape (3,).
        joints: angles in the order of the links, rad, shape (joints,).
        pose: filled.

    """
    count = links.masses.size
    rotations, origins, axes = pose.rotations, pose.origins, pose.axes
    rotate(rpy[0], rpy[1], rpy[2], rotations[0])
    for row in range(count):
        before, rotation, at = links.parents[row], rotations[row], links.anchors[row]
        if row > 0:
            u, c, s = links.axes[row], np.cos(joints[row - 1]), np.sin(joints[row - 1])
            base, start = rotations[before], links.anchors[before]
            off = (at[0] - start[0], at[1] - start[1], at[2] - start[2])
            v = 1.0 - c
            for k in range(3):
                origins[row, k] = origins[before, k] + carry(base, off, k)
                axes[row, k] = carry(base, u, k)
                # Rodrigues' formula, times the rotation before, row by row.
                a, b, d = base[k, 0], base[k, 1], base[k, 2]
                along = v * (a * u[0] + b * u[1] + d * u[2])
                rotation[k, 0] = c * a + along * u[0] + s * (b * u[2] - d * u[1])
                rotation[k, 1] = c * b + along * u[1] + s * (d * u[0] - a * u[2])
                rotation[k, 2] = c * d + along * u[2] + s * (a * u[1] - b * u[0])
        center = links.centers[row]
        off = (center[0] - at[0], center[1] - at[1], center[2] - at[2])
        pose.carried[row] = links.masses[row]
        for k in range(3):
            pose.moments[row, k] = links.masses[row] * (origins[row, k] + carry(rotation, off, k))
    for row in range(count - 1, 0, -1):
        before = links.parents[row]
        pose.carried[before] += pose.carried[row]
        for k in range(3):
            pose.moments[before, k] += pose.moments[row, k]
    for leg in range(links.chains.shape[0]):
        last, sole = links.chains[leg, -1], links.soles[leg]
        at = links.anchors[last]
        off = (sole[0] - at[0], sole[1] - at[1], sole[2] - at[2])
        for k in range(3):
            pose.soles[leg, k] = origins[last, k] + carry(rotations[last], off, k)


@jit
def column(pose, row, point):
    """Return the velocity of a point at a unit speed of a joint before it, m/rad."""
    at = pose.origins[row]
    return cross(pose.axes[row], (point[0] - at[0], point[1] - at[1], point[2] - at[2]))


@jit
def gravity_torque(pose, row):
    """Return the torque of a joint that holds the weight of all links beyond it, N m."""
    moment, mass, at = pose.moments[row], pose.carried[row], pose.origins[row]
    lever = (moment[0] - mass * at[0], moment[1] - mass * at[1], 0.0)
    return GRAVITY * cross(pose.axes[row], lever)[2]


@jit
def center_velocity(pose, turning, rates, out):
    """Fill the velocity of the centre of mass from that of the base, m/s, shape (3,).

    Args:
        pose: filled.
        turning: angular velocity of the base, rad/s.
        rates: of the joints, rad/s, shape (joints,).
        out: filled.

    """
    mass = pose.carried[0]
    moment = pose.moments[0]
    out[0], out[1], out[2] = cross(turning, (moment[0] / mass, moment[1] / mass,
                                             moment[2] / mass))
    for row in range(1, pose.carried.size):
        moment, own, at = pose.moments[row], pose.carried[row], pose.origins[row]
        lever = (moment[0] - own * at[0], moment[1] - own * at[1], moment[2] - own * at[2])
        moved = cross(pose.axes[row], lever)
        for k in range(3):
            out[k] += rates[row - 1] * moved[k] / mass


@jit
def sole_velocity(links, pose, leg, turning, rates, out):
    """Fill a sole's velocity from that of the base, m/s, then its angular one, rad/s: (6,)."""
    point = pose.soles[leg]
    out[0], out[1], out[2] = cross(turning, point)
    out[3], out[4], out[5] = turning[0], turning[1], turning[2]
    for k in range(links.chains.shape[1]):
        row = links.chains[leg, k]
        moved, rate = column(pose, row, point), rates[row - 1]
        for axis in range(3):
            out[axis] += rate * moved[axis]
            out[3 + axis] += rate * pose.axes[row, axis]


@jit
def add_torques(links, pose, leg, point, force, moment, torques):
    """Add the joint torques J' F by which a leg exerts a force and a moment.

    Args:
        links: Links.
        pose: filled.
        leg: which.
        point: of its last link, m.
        force: N, a triple.
        moment: about that point, N m, a triple.
        torques: of the leg, N m, shape (joints of a leg,).

    """
    for k in range(links.chains.shape[1]):
        row = links.chains[leg, k]
        moved, axis = column(pose, row, point), pose.axes[row]
        torques[k] += (moved[0] * force[0] + moved[1] * force[1] + moved[2] * force[2]
                       + axis[0] * moment[0] + axis[1] * moment[1] + axis[2] * moment[2])


@jit_entry
def kinematics(links, rpy, joints, motion, pose, center, soles, weights):
    """Fill everything about a pose; for checks and pictures, the laws take what they need.

    Args:
        links: Links.
        rpy: of the base, rad, shape (3,).
        joints: rad, shape (joints,).
        motion: angular velocity of the base, world's axes, rad/s, shape (3,), and the joints'
            rates, rad/s, shape (joints,).
        pose: filled.
        center: place and velocity of the centre of mass from the base's, shape (6,).
        soles: velocities, m/s and rad/s, from the base's, shape (legs, 6).
        weights: gravity torques of all joints, N m, shape (joints,).

    """
    turning, rates = motion
    place(links, rpy, joints, pose)
    center_velocity(pose, turning, rates, center[3:])
    for k in range(3):
        center[k] = pose.moments[0, k] / pose.carried[0]
    for leg in range(soles.shape[0]):
        sole_velocity(links, pose, leg, turning, rates, soles[leg])
    for row in range(1, pose.carried.size):
        weights[row - 1] = gravity_torque(pose, row)
