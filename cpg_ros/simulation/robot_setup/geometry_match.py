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

"""Lengths, senses of rotation and mass of a robot: the robot file's beside its description's.

Legs are compared by forward kinematics: where the feet are in the stand, and which way they move
while they are low.
"""

from collections.abc import Iterator
from itertools import pairwise
import math

from cpg_ros.motion.body_file import BodyGeometry, LegGeometry
from cpg_ros.motion.description import RobotDescription
from cpg_ros.motion.plan import GaitPlan
from cpg_ros.motion.robot import Robot
import numpy as np

#: Tolerance of lengths: LENGTH, m, plus the share LENGTH_SHARE.
LENGTH_SHARE, LENGTH = 0.05, 0.003
#: MASS_RATIO: largest ratio of masses that agree.
MASS_RATIO = 1.25
#: LONGEST_LEG: longest plausible leg, m; DENSITIES: plausible range of the mass over the cube of
#: the longest leg, kg/m^3, which is 50 to 600 for real robots.
LONGEST_LEG, DENSITIES = 5.0, (5.0, 6000.0)
#: FORWARD: share of a stride above which a low foot that goes forward goes the wrong way.
FORWARD = 0.25
#: Gaits in which a robot walks forward, with alternating legs.
FORWARD_GAITS = ('walk', 'trot', 'pace', 'tripod', 'run')


class LegKinematics:
    """A leg of a description, in the frame of its root with all joints at 0."""

    def __init__(self, names: list[str], known: RobotDescription) -> None:
        """Take names of a leg's joints, in any order; errors as of RobotDescription.direction."""
        self.names = sorted(names, key=lambda one: len(known.chain(one)))
        self.axes = [known.direction(name) for name in self.names]
        self.places = [known.frame(name)[0] for name in self.names]
        self.foot = known.foot_below(self.names[-1])[0]

    @property
    def lengths(self) -> list[float]:
        """From each joint to the next, and to the foot, m."""
        points = [*self.places, self.foot]
        return [float(np.linalg.norm(b - a)) for a, b in pairwise(points)]

    def foot_at(self, angles: dict[str, float]) -> np.ndarray:
        """Return where the foot is at angles of the joints, rad, in m, shape (3,)."""
        place = self.foot
        for name, axis, point in reversed(list(zip(self.names, self.axes, self.places,
                                                   strict=True))):
            arm, angle = place - point, angles[name]
            place = point + (arm * math.cos(angle) + np.cross(axis, arm) * math.sin(angle)
                             + axis * (axis @ arm) * (1.0 - math.cos(angle)))
        return place


def kinematics(robot: Robot, known: RobotDescription) -> dict[str, LegKinematics]:
    """Return the legs whose joints and foot the description has."""
    found = {}
    for leg, joints in robot.legs.items():
        names = [joint.name for joint in joints]
        if known.links and all(name in known.joints and not known.joints[name].flaw
                               for name in names):
            made = LegKinematics(names, known)
            if sum(made.lengths) > 0.0 and made.lengths[-1] > 0.0:
                found[leg] = made
    return found


def implausible(robot: Robot, known: RobotDescription) -> Iterator[str]:
    """Say which lengths and masses of a description no walking robot has."""
    legs, what = kinematics(robot, known), known.format
    longest = 0.0
    for leg, made in legs.items():
        longest = max(longest, sum(made.lengths))
        if sum(made.lengths) > LONGEST_LEG:
            k = int(np.argmax(made.lengths))
            yield (f'{leg}: the link below {made.names[k]} is {made.lengths[k]:.4g} m long in the '
                   f'{what}: are its lengths in mm?')
    mass = sum(link.mass for link in known.links.values())
    if legs and mass > 0.0 and 0.0 < longest <= LONGEST_LEG:
        density = mass / longest**3
        if not DENSITIES[0] <= density <= DENSITIES[1]:
            yield (f'the {what} has a mass of {mass:.3g} kg with legs of {longest:.3g} m, which '
                   'no walking robot has')


def differing(stated: BodyGeometry, found: BodyGeometry, what: str) -> Iterator[str]:
    """Say where the geometry of a robot file is not the description's; what is its format."""
    if found.mass > 0.0 and not 1.0 / MASS_RATIO <= stated.mass / found.mass <= MASS_RATIO:
        yield f"geometry.mass {stated.mass:.4g} kg is not the {what}'s {found.mass:.4g} kg"
    for leg, own in stated.legs.items():
        other = found.legs.get(leg)
        if other is not None:
            yield from (f'geometry.legs.{leg}.{fault}' for fault in _leg_faults(own, other, what))


def _leg_faults(own: LegGeometry, other: LegGeometry, what: str) -> Iterator[str]:
    if set(own.joints) == set(other.joints) and own.joints != other.joints:
        yield f"joints: {', '.join(own.joints)} come in the {what} as {', '.join(other.joints)}"
        return
    for name, turn, described in zip(own.joints, own.turns, other.turns, strict=False):
        if turn != described:
            yield (f'turns: {name} turns the other way in the {what}: {turn:g} where it has '
                   f'{described:g}')
    for key in ('hip', 'thigh', 'calf', 'foot'):
        mine, theirs = np.array(getattr(own, key)), np.array(getattr(other, key))
        room = LENGTH + LENGTH_SHARE * float(np.linalg.norm(theirs))
        if (off := float(np.linalg.norm(mine - theirs))) > room:
            yield f"{key}: {mine.tolist()} m is {off:.4g} m from the {what}'s {theirs.tolist()}"


def walks_backward(robot: Robot, known: RobotDescription, gait: GaitPlan) -> Iterator[str]:
    """Say which feet move forward while they are low, in a gait that goes forward."""
    names = [joint.name for joint in robot.joints]
    readout, count = gait.readout, 64
    phases, points = np.arange(count) / count, readout.angles.shape[1]
    offsets = robot.column('offset') + gait.shift
    angles = {name: offsets[k] + np.interp(
        phases + gait.orbit.phases[robot.cells[k]], np.arange(points) / points,
        readout.angles[k], period=1.0) for k, name in enumerate(names)}
    for leg, made in kinematics(robot, known).items():
        path = np.array([made.foot_at({name: float(angles[name][k]) for name in made.names})
                         for k in range(count)])
        steps = np.roll(path[:, 0], -1) - path[:, 0]
        height = path[:, 2] + 0.5 * (np.roll(path[:, 2], -1) - path[:, 2])
        low = height < np.median(height)
        stride, lift = float(np.ptp(path[:, 0])), float(np.ptp(path[:, 2]))
        if lift > 0.02 * stride and steps[low].sum() > FORWARD * stride > 0.0:
            yield (f'{leg}: its foot moves forward while it is low in the {gait.name}, so that '
                   f'the robot walks backward: are the axes of the {known.format} turned the '
                   'other way?')
