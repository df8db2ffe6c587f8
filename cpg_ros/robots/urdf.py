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

"""Joints of a URDF file: kind, limits, and where they are in the robot.

Reads what a robot file is compared with and leaves the rest (meshes, sensors, gazebo and
transmission blocks, whatever their prefixes) alone. URDF: https://wiki.ros.org/urdf/XML/joint.
"""

from dataclasses import dataclass
import math
from pathlib import Path
from xml.etree.ElementTree import Element

from cpg_ros.errors import CpgError
from cpg_ros.files.regular_file import one_line, read_bytes
from cpg_ros.files.xml_reader import parse
import numpy as np

#: Kinds of joints that turn, which a cell can drive.
TURNING = ('revolute', 'continuous')


class UrdfError(CpgError):
    """A URDF file cannot be used; the message names the file and the reason in one line."""


@dataclass(frozen=True)
class UrdfJoint:
    """One joint.

    Attributes:
        name, kind: as in the file; kind is revolute, continuous, fixed, ...
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


def bare(tag: str) -> str:
    """Return a tag without its prefix."""
    return tag.rpartition(':')[2]


def read_tree(path: str | Path) -> Element:
    """Read a URDF file as XML.

    Raises:
        UrdfError: the file cannot be read, is not XML, is xacro or is no URDF.

    """
    return parse_tree(read_bytes(path, UrdfError, 'URDF'), str(path))


def parse_tree(data: bytes, source: str) -> Element:
    """Parse a URDF; errors as of ``read_tree``, which name the source."""
    tree = parse(data, lambda why: _wrong(source, why))
    for element in tree.iter():
        if element.tag.startswith('xacro:'):
            raise _wrong(source, f'has <{element.tag}> in it: it is xacro, expand it first (xacro '
                         f'{Path(source).name} > robot.urdf)')
    if bare(tree.tag) != 'robot':
        raise _wrong(source, f'its root is <{tree.tag}>, not <robot>: this is not a URDF')
    return tree


def load_urdf(path: str | Path) -> dict[str, UrdfJoint]:
    """Read the joints of a URDF file, by name and in its order.

    Raises:
        UrdfError: as of ``read_tree``, or a joint in the file is incomplete.

    """
    return joints_of(read_tree(path), str(path))


def joints_of(tree: Element, source: str) -> dict[str, UrdfJoint]:
    """Return the joints of a URDF, by name and in its order.

    Raises:
        UrdfError: there are none, or one is incomplete; the message names the source.

    """
    joints: dict[str, UrdfJoint] = {}
    for element in tree:
        if bare(element.tag) == 'joint':
            joint = _joint(element, source)
            if joint.name in joints:
                raise _wrong(source, f"the joint '{joint.name}' appears twice")
            joints[joint.name] = joint
    if not joints:
        raise _wrong(source, 'it has no joints')
    return joints


def _wrong(source: str, why: str) -> UrdfError:
    return UrdfError(one_line(f'URDF {source}: {why}'))


def _joint(element: Element, source: str) -> UrdfJoint:
    name, kind = element.get('name', '').strip(), element.get('type', '').strip()
    if not name:
        raise _wrong(source, 'a joint has no name')
    if not kind:
        raise _wrong(source, f"the joint '{name}' has no type")
    parts: dict[str, dict[str, str]] = {bare(part.tag): part.attrib for part in element}

    def text(part: str, key: str, default: str = '') -> str:
        return parts.get(part, {}).get(key, default)

    def numbers(part: str, key: str, default: str, finite: bool = True) -> tuple[float, ...]:
        given, count = text(part, key, default), len(default.split())
        try:
            values = tuple(float(word) for word in given.split())
        except ValueError:
            values = ()
        if len(values) != count or any(
                value != value or (finite and math.isinf(value)) for value in values):
            what = 'a number' if count == 1 else f'{count} numbers'
            raise _wrong(source, f"the joint '{name}': {part} {key}=\"{given[:40]}\" is not "
                         f'{what}')
        return values

    lower, upper, velocity = (numbers('limit', key, '0', finite=False)[0]
                              for key in ('lower', 'upper', 'velocity'))
    bounded = kind in ('revolute', 'prismatic')
    if bounded and 'limit' not in parts:
        raise _wrong(source, f"the joint '{name}' is {kind}, but has no <limit>")
    return UrdfJoint(
        name, kind, lower if bounded else -math.inf, upper if bounded else math.inf,
        abs(velocity) if velocity else math.inf, text('mimic', 'joint'), text('parent', 'link'),
        text('child', 'link'), numbers('origin', 'xyz', '0 0 0'),
        numbers('origin', 'rpy', '0 0 0'), numbers('axis', 'xyz', '1 0 0'))


def root(joints: dict[str, UrdfJoint]) -> str:
    """Return the link that no joint moves.

    Raises:
        UrdfError: there is none, or more than one.

    """
    moved = {joint.child for joint in joints.values()}
    found = sorted({joint.parent for joint in joints.values()} - moved)
    if len(found) != 1:
        raise UrdfError(f'the URDF has {len(found)} root links ({", ".join(found)}), it must '
                        'have one')
    return found[0]


def chain(joints: dict[str, UrdfJoint], name: str) -> list[UrdfJoint]:
    """Return the joints from the root to one joint, which is the last.

    Raises:
        UrdfError: the links form a loop.

    """
    above = {joint.child: joint for joint in joints.values()}
    found = [joints[name]]
    while found[0].parent in above:
        found.insert(0, above[found[0].parent])
        if len(found) > len(joints):
            raise UrdfError(f"the links above the joint '{name}' form a loop")
    return found


def direction(joints: dict[str, UrdfJoint], name: str) -> np.ndarray:
    """Return the axis of a joint in the frame of the root with all joints at 0, a unit vector.

    Raises:
        UrdfError: the axis is zero, or the links form a loop.

    """
    turned = np.eye(3)
    for joint in chain(joints, name):
        turned = turned @ rotation(joint.rpy)
    axis = turned @ joints[name].axis
    length = float(np.linalg.norm(axis))
    if not 0.0 < length < math.inf:
        raise UrdfError(f"the joint '{name}' has no axis to turn about")
    return axis / length


def rotation(rpy: tuple[float, ...]) -> np.ndarray:
    """Return the matrix of roll, pitch and yaw in rad: about the fixed x, then y, then z."""
    (cr, cp, cy), (sr, sp, sy) = np.cos(rpy), np.sin(rpy)
    return np.array([[cy * cp, cy * sp * sr - sy * cr, cy * sp * cr + sy * sr],
                     [sy * cp, sy * sp * sr + cy * cr, sy * sp * cr - cy * sr],
                     [-sp, cp * sr, cp * cr]])
