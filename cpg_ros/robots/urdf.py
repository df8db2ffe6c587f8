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

from dataclasses import dataclass, field
import math
from pathlib import Path
from xml.parsers import expat

from cpg_ros.errors import CpgError
import numpy as np

#: Kinds of joints that turn, which a cell can drive.
TURNING = ('revolute', 'continuous')
#: Children of a joint that are read, and their attributes.
_PARTS = ('origin', 'axis', 'parent', 'child', 'limit', 'mimic')


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


@dataclass
class _Document:
    """Collects joints while the file is parsed."""

    path: Path
    joints: dict[str, UrdfJoint] = field(default_factory=dict)
    _open: list[str] = field(default_factory=list)
    _parts: dict[str, dict[str, str]] = field(default_factory=dict)

    def fail(self, why: str) -> UrdfError:
        return UrdfError(' '.join(f'URDF {self.path}: {why}'.split()))

    def start(self, tag: str, attributes: dict[str, str]) -> None:
        if tag.startswith('xacro:'):
            raise self.fail(f'has <{tag}> in it: it is xacro, expand it first (xacro '
                            f'{self.path.name} > robot.urdf)')
        name = tag.rpartition(':')[2]
        if not self._open and name != 'robot':
            raise self.fail(f'its root is <{name}>, not <robot>: this is not a URDF')
        self._open.append(name)
        if self._open == ['robot', 'joint']:
            self._parts = {'joint': attributes}
        elif self._open[:2] == ['robot', 'joint'] and len(self._open) == 3 and name in _PARTS:
            self._parts[name] = attributes

    def end(self, _: str) -> None:
        if self._open == ['robot', 'joint']:
            joint = self._joint()
            if joint.name in self.joints:
                raise self.fail(f"the joint '{joint.name}' appears twice")
            self.joints[joint.name] = joint
        self._open.pop()

    def entity(self, name: str, *_: object) -> None:
        raise self.fail(f"it declares the entity '{name}'; entities are not read")

    def _joint(self) -> UrdfJoint:
        own = self._parts['joint']
        name, kind = own.get('name', '').strip(), own.get('type', '').strip()
        if not name:
            raise self.fail('a joint has no name')
        if not kind:
            raise self.fail(f"the joint '{name}' has no type")
        limits = self._parts.get('limit', {})
        bounded = kind in ('revolute', 'prismatic')
        lower, upper, velocity = (self._numbers(name, 'limit', key, '0', 1)[0]
                                  for key in ('lower', 'upper', 'velocity'))
        if bounded and 'limit' not in self._parts:
            raise self.fail(f"the joint '{name}' is {kind}, but has no <limit>")
        return UrdfJoint(
            name, kind, lower if bounded else -math.inf, upper if bounded else math.inf,
            abs(velocity) if 'velocity' in limits and velocity else math.inf,
            self._parts.get('mimic', {}).get('joint', ''),
            self._parts.get('parent', {}).get('link', ''),
            self._parts.get('child', {}).get('link', ''),
            self._numbers(name, 'origin', 'xyz', '0 0 0', 3),
            self._numbers(name, 'origin', 'rpy', '0 0 0', 3),
            self._numbers(name, 'axis', 'xyz', '1 0 0', 3))

    def _numbers(self, joint: str, part: str, key: str, default: str, count: int
                 ) -> tuple[float, ...]:
        text = self._parts.get(part, {}).get(key, default)
        try:
            values = tuple(float(word) for word in text.split())
        except ValueError:
            values = ()
        if len(values) != count or any(value != value for value in values):
            what = 'a number' if count == 1 else f'{count} numbers'
            raise self.fail(f"the joint '{joint}': {part} {key}=\"{text[:40]}\" is not {what}")
        return values


def load_urdf(path: str | Path) -> dict[str, UrdfJoint]:
    """Read the joints of a URDF file, by name and in its order.

    Raises:
        UrdfError: the file cannot be read, is not XML, is xacro, is no URDF, or a joint in it
            is incomplete.

    """
    path = Path(path)
    document = _Document(path)
    # Without namespaces: prefixes that are declared nowhere are usual in URDF files.
    parser = expat.ParserCreate()
    parser.StartElementHandler = document.start
    parser.EndElementHandler = document.end
    parser.EntityDeclHandler = document.entity
    try:
        parser.Parse(path.read_bytes(), True)
    except OSError as error:
        raise UrdfError(f'URDF {path}: {error.strerror}') from error
    except expat.ExpatError as error:
        raise document.fail(f'line {error.lineno}: {expat.ErrorString(error.code)}') from error
    except UrdfError:
        raise
    except (ValueError, LookupError) as error:
        raise document.fail(str(error)) from error
    if not document.joints:
        raise document.fail('it has no joints')
    return document.joints


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
