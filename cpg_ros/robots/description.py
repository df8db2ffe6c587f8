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

"""Description of a robot by a model file of any format: joints, links and where they are.

``urdf`` reads it from URDF, ``simulation.mjcf_description`` from MJCF.
"""

from dataclasses import dataclass, field
import math

from cpg_ros.errors import CpgError
import numpy as np

#: Kinds of joints that turn, which a cell can drive.
TURNING = ('revolute', 'continuous')
#: Limits of speed below this, rad/s, are those of a file rather than of a motor.
SLOW, SERVOS = 5.0, 'hobby servos reach about 5 to 10 rad/s'


class DescriptionError(CpgError):
    """A description of a robot cannot be used; the message names the file and the reason."""


@dataclass(frozen=True)
class JointDescription:
    """One joint.

    Attributes:
        name: as in the file.
        kind: as URDF has it: revolute, continuous, prismatic, fixed, ...
        lower, upper: limits in rad (m of a prismatic joint), infinite where there are none.
        velocity: limit in rad/s, infinite where the file gives none or 0.
        mimic: the joint that it follows, '' for none.
        parent, child: links.
        xyz, rpy: where it is in its parent, m and rad.
        axis: about which it turns, in its own frame.

    """

    name: str
    kind: str
    lower: float
    upper: float
    velocity: float
    mimic: str
    parent: str
    child: str
    xyz: tuple[float, ...] = (0.0, 0.0, 0.0)
    rpy: tuple[float, ...] = (0.0, 0.0, 0.0)
    axis: tuple[float, ...] = (1.0, 0.0, 0.0)

    @property
    def flaw(self) -> str:
        """Why no cell can drive it, '' if one can."""
        if self.mimic:
            return f"follows '{self.mimic}' (mimic)"
        return '' if self.kind in TURNING else f'is {self.kind}'


@dataclass(frozen=True)
class LinkDescription:
    """A link.

    Attributes:
        mass: kg, 0 where the file gives none.
        radius: of its sphere that collides, m, 0 if it has none.
        centre: of that sphere in the link's frame, m.

    """

    mass: float = 0.0
    radius: float = 0.0
    centre: tuple[float, ...] = (0.0, 0.0, 0.0)


@dataclass(frozen=True)
class RobotDescription:
    """A robot's joints and links by name, in the order of the file.

    Attributes:
        format: URDF or MJCF, for messages.
        joints: by name.
        links: by name; of URDF only.

    """

    format: str
    joints: dict[str, JointDescription]
    links: dict[str, LinkDescription] = field(default_factory=dict)

    def root(self) -> str:
        """Return the link that no joint moves.

        Raises:
            DescriptionError: there is none, or more than one.

        """
        moved = {joint.child for joint in self.joints.values()}
        found = sorted({joint.parent for joint in self.joints.values()} - moved)
        if len(found) != 1:
            raise DescriptionError(f'the {self.format} has {len(found)} root links '
                                   f'({", ".join(found)}), it must have one')
        return found[0]

    def chain(self, name: str) -> list[JointDescription]:
        """Return the joints from the root to one joint, which is the last.

        Raises:
            DescriptionError: the links form a loop.

        """
        above = {joint.child: joint for joint in self.joints.values()}
        found = [self.joints[name]]
        while found[0].parent in above:
            found.insert(0, above[found[0].parent])
            if len(found) > len(self.joints):
                raise DescriptionError(f"the links above the joint '{name}' form a loop")
        return found

    def frame(self, name: str) -> tuple[np.ndarray, np.ndarray]:
        """Return where a joint is in the frame of the root with all joints at 0.

        Its place is in m, shape (3,); its frame's axes are columns, shape (3, 3). Errors as of
        ``chain``.
        """
        place, axes = np.zeros(3), np.eye(3)
        for joint in self.chain(name):
            place, axes = place + axes @ joint.xyz, axes @ rotation(joint.rpy)
        return place, axes

    def direction(self, name: str) -> np.ndarray:
        """Return the axis of a joint in the frame of the root with all joints at 0, a unit vector.

        Raises:
            DescriptionError: the axis is zero, or the links form a loop.

        """
        axis = self.frame(name)[1] @ self.joints[name].axis
        length = float(np.linalg.norm(axis))
        if not 0.0 < length < math.inf:
            raise DescriptionError(f"the joint '{name}' has no axis to turn about")
        return axis / length

    def foot_below(self, last: str) -> tuple[np.ndarray, float]:
        """Return the middle of the foot below a leg's last joint, m, (3,), and its radius, m.

        It is the furthest sphere of what that joint moves, or else the furthest fixed frame,
        which has no radius.
        """
        begin, axes = self.frame(last)
        found = [(begin, axes, self.joints[last].child)]
        for place, turned, link in found:
            found += [(place + turned @ joint.xyz, turned @ rotation(joint.rpy), joint.child)
                      for joint in self.joints.values()
                      if joint.parent == link and joint.kind == 'fixed']
        balls = [(place + turned @ self.links[link].centre, self.links[link].radius)
                 for place, turned, link in found
                 if link in self.links and self.links[link].radius]
        return max(balls or [(place, 0.0) for place, _, _ in found],
                   key=lambda one: float(np.linalg.norm(one[0] - begin)))


def rotation(rpy: tuple[float, ...]) -> np.ndarray:
    """Return the matrix of roll, pitch and yaw in rad: about the fixed x, then y, then z."""
    (cr, cp, cy), (sr, sp, sy) = np.cos(rpy), np.sin(rpy)
    return np.array([[cy * cp, cy * sp * sr - sy * cr, cy * sp * cr + sy * sr],
                     [sy * cp, sy * sp * sr + cy * cr, sy * sp * cr - cy * sr],
                     [-sp, cp * sr, cp * cr]])
