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

"""Description of a robot by a model file: joints, links and frames; reader of URDF."""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace
from itertools import product
import math
from pathlib import Path
import shutil
import subprocess
from xml.etree.ElementTree import Element, tostring

from cpg_ros.common.errors import CpgError, ShortRepr
from cpg_ros.common.files import one_line, parse, read_bytes
from cpg_ros.motion.meshes import find_mesh, MeshError, read_mesh
from cpg_ros.motion.rotations import rotation, rotation_about
import numpy as np

#: Kinds of joints that turn, which a cell can drive.
REVOLUTE_TYPES = ('revolute', 'continuous')
#: Limits of commands in a ros2_control part, by interface and parameter.
COMMAND_LIMITS = {('position', 'min'): 'lower', ('position', 'max'): 'upper',
             ('velocity', 'max'): 'velocity'}
#: FOOT_FRACTION: fraction of the reach of a leg's last link beyond which its points belong to the
#: foot.
FOOT_FRACTION = 0.97
#: MIN_SPEED, MAX_SPEED: speed limits, rad/s, below and above which a model's limit is doubted;
#: SERVO_SPEEDS: text for that message.
MIN_SPEED, MAX_SPEED, SERVO_SPEEDS = 5.0, 100.0, 'hobby servos reach about 5 to 10 rad/s'


class DescriptionError(CpgError):
    """A robot description cannot be used; the message names the file and the reason."""


@dataclass(frozen=True)
class JointDescription:
    """One joint.

    Attributes:
        name: as in the file.
        kind: as in URDF: revolute, continuous, prismatic, fixed, ...
        lower, upper: limits, rad (m for a prismatic joint), infinite where there are none.
        velocity: limit, rad/s, infinite where the file gives none, 0 or more than MAX_SPEED.
        mimic: joint that it follows, '' for none.
        parent, child: links.
        xyz, rpy: pose in the parent, m and rad.
        axis: of rotation, in the joint's frame.
        passive: whether other joints have a motor, but not this one.

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
    passive: bool = False

    @property
    def undrivable(self) -> str:
        """Why no cell can drive it, '' if one can."""
        if self.mimic:
            return f"follows '{self.mimic}' (mimic)"
        if self.passive:
            return 'has no motor'
        return '' if self.kind in REVOLUTE_TYPES else f'is {self.kind}'


@dataclass(frozen=True)
class CollisionShape:
    """A collision shape: box, cylinder or mesh.

    Attributes:
        xyz, rpy: pose in the link, m and rad.
        size: of a box along x, y and z, m; of a cylinder its two widths and its length, m; of a
            mesh the scale.
        mesh: vertices, shape (n, 3), or their file; None for the corners.

    """

    xyz: tuple[float, ...]
    rpy: tuple[float, ...]
    size: tuple[float, ...]
    mesh: Path | np.ndarray | None = None

    def points(self) -> np.ndarray:
        """Return corners or vertices in the link's frame, m, shape (points, 3).

        A mesh that cannot be read has none; drawing and simulation report it.
        """
        corners = (np.array(list(product((-0.5, 0.5), repeat=3))) if self.mesh is None
                   else self.mesh)
        if isinstance(corners, Path):
            try:
                corners = read_mesh(corners).points
            except MeshError:
                return np.empty((0, 3))
        return self.xyz + corners * self.size @ rotation(self.rpy).T


@dataclass(frozen=True)
class LinkDescription:
    """A link.

    Attributes:
        mass: kg, 0 where the file gives none.
        radius: of the collision sphere, m, 0 for none.
        centre: of that sphere in the link's frame, m.
        shapes: other collision shapes.

    """

    mass: float = 0.0
    radius: float = 0.0
    centre: tuple[float, ...] = (0.0, 0.0, 0.0)
    shapes: tuple[CollisionShape, ...] = ()


@dataclass(frozen=True)
class RobotDescription:
    """A robot's joints and links by name, in the order of the file.

    Attributes:
        format: URDF or MJCF, for messages.
        joints: by name.
        links: by name.

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
        roots = sorted({joint.parent for joint in self.joints.values()} - moved)
        if len(roots) != 1:
            raise DescriptionError(f'the {self.format} has {len(roots)} root links '
                                   f'({", ".join(roots)}), it must have one')
        return roots[0]

    def chain(self, name: str) -> list[JointDescription]:
        """Return the joints from the root to a joint, which is the last.

        Raises:
            DescriptionError: the links form a loop.

        """
        above = {joint.child: joint for joint in self.joints.values()}
        joints = [self.joints[name]]
        while joints[0].parent in above:
            joints.insert(0, above[joints[0].parent])
            if len(joints) > len(self.joints):
                raise DescriptionError(f"the links above the joint '{name}' form a loop")
        return joints

    def frame(self, name: str) -> tuple[np.ndarray, np.ndarray]:
        """Return a joint's position, m, (3,), and axes as columns, (3, 3), in the root's frame.

        All joints are at 0. Errors as of ``chain``.
        """
        position, axes = np.zeros(3), np.eye(3)
        for joint in self.chain(name):
            position, axes = position + axes @ joint.xyz, axes @ rotation(joint.rpy)
        return position, axes

    def direction(self, name: str) -> np.ndarray:
        """Return a joint's axis in the root's frame with all joints at 0, a unit vector.

        Raises:
            DescriptionError: the axis is zero, or the links form a loop.

        """
        axis = self.frame(name)[1] @ self.joints[name].axis
        length = float(np.linalg.norm(axis))
        if not 0.0 < length < math.inf:
            raise DescriptionError(f"the joint '{name}' has no axis to turn about")
        return axis / length

    def leg(self, names: Iterable[str]) -> 'LegChain':
        """Return a leg from its joints' names, in any order; errors as of ``direction``."""
        joints = sorted(names, key=lambda name: len(self.chain(name)))
        return LegChain(tuple(joints), np.array([self.direction(name) for name in joints]),
                        np.array([self.frame(name)[0] for name in joints]),
                        *self.foot_below(joints[-1]))

    def foot_below(self, last: str) -> tuple[np.ndarray, float]:
        """Return middle, m, (3,), and radius, m, of the foot below a leg's last joint.

        The foot is the furthest sphere that the joint moves, or else the middle of the end of
        shapes and frames, with radius 0. All joints are at 0.
        """
        begin = self.frame(last)[0]
        below = self._below(last)
        balls = [(position + turned @ link.centre, link.radius) for position, turned, link in below
                 if link.radius]
        if balls:
            return max(balls, key=lambda ball: float(np.linalg.norm(ball[0] - begin)))
        points = np.concatenate([np.array([position for position, _, _ in below]),
                                 self.shapes(last)])
        reach = points - begin
        furthest = reach[np.linalg.norm(reach, axis=1).argmax()]
        along = reach @ furthest
        end = points[along >= FOOT_FRACTION * along.max()]
        return 0.5 * (end.min(axis=0) + end.max(axis=0)), 0.0

    def shapes(self, last: str) -> np.ndarray:
        """Return points of the shapes below a joint with all joints at 0, m, shape (n, 3)."""
        return np.concatenate([np.empty((0, 3)), *(
            origin + shape.points() @ turned.T for origin, turned, link in self._below(last)
            for shape in link.shapes)])

    def _below(self, last: str) -> list[tuple[np.ndarray, np.ndarray, LinkDescription]]:
        """Return position, axes and link of everything below a joint, all joints at 0."""
        frames = [(*self.frame(last), self.joints[last].child)]
        for origin, turned, link in frames:
            frames += [(origin + turned @ joint.xyz, turned @ rotation(joint.rpy), joint.child)
                      for joint in self.joints.values() if joint.parent == link]
        return [(origin, turned, self.links.get(link, LinkDescription()))
                for origin, turned, link in frames]


@dataclass(frozen=True, eq=False, repr=False)
class LegChain(ShortRepr):
    """A leg at joint angles of 0, in the root's frame.

    Attributes:
        joints: names, from the body outwards.
        axes: unit vectors, shape (joints, 3).
        anchors: points on the axes, m, shape (joints, 3).
        foot: middle of the foot, m, shape (3,).
        radius: of the foot, m.

    """

    joints: tuple[str, ...]
    axes: np.ndarray
    anchors: np.ndarray
    foot: np.ndarray
    radius: float = 0.0

    @property
    def lengths(self) -> np.ndarray:
        """Distance from each joint to the next, and to the foot, m, shape (joints,)."""
        return np.linalg.norm(np.diff([*self.anchors, self.foot], axis=0), axis=1)

    def posed(self, angles: Sequence[float] | np.ndarray
              ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return the leg at joint angles, rad.

        Returns:
            Axes, shape (joints, 3); anchors and foot, m, shape (joints + 1, 3); rotation of the
                last link from its pose at 0, shape (3, 3).

        """
        frame, axes, points = np.eye(3), np.empty_like(self.axes), [self.anchors[0]]
        links = np.diff([*self.anchors, self.foot], axis=0)
        for k, angle in enumerate(angles):
            axes[k] = frame @ self.axes[k]
            frame = frame @ rotation_about(self.axes[k], float(angle))
            points.append(points[-1] + frame @ links[k])
        return axes, np.array(points), frame

    def holding(self, angles: Mapping[str, float]) -> 'LegChain':
        """Return the leg without some joints, which are held at angles, rad."""
        axes, points, _ = self.posed([angles.get(name, 0.0) for name in self.joints])
        rest = [k for k, name in enumerate(self.joints) if name not in angles]
        return LegChain(tuple(self.joints[k] for k in rest), axes[rest], points[rest],
                        points[-1], self.radius)


# URDF files: joints with their limits and places, links with their masses and feet.

def read_tree(path: str | Path) -> Element:
    """Read a URDF file as XML, tags without prefixes; the program xacro expands one with macros.

    Raises:
        DescriptionError: the file cannot be read, is not XML, is xacro that cannot be expanded
            here, or no URDF.

    """
    data, xacro = read_bytes(path, DescriptionError, 'URDF'), shutil.which('xacro')
    if b'<xacro:' in data and xacro:
        expanded = subprocess.run([xacro, str(path)], capture_output=True)
        if expanded.returncode:
            reason = expanded.stderr.decode(errors='replace').strip()
            raise _error(str(path), f'xacro cannot expand it: {reason[-500:]}')
        data = expanded.stdout
    return parse_tree(data, str(path))


def read_urdf_text(path: str | Path) -> str:
    """Return a URDF file as text, expanded; errors as of ``load_urdf``."""
    file = Path(path).expanduser()
    tree = read_tree(file)
    describe(tree, str(file), file)
    return tostring(tree, encoding='unicode')


def parse_tree(data: bytes, source: str) -> Element:
    """Parse a URDF; errors as of ``read_tree``, which name the source."""
    tree = parse(data, lambda why: _error(source, why))
    for element in tree.iter():
        if element.tag.startswith('xacro:'):
            raise _error(source, f'has <{element.tag}> in it: it is xacro, expand it first (xacro '
                         f'{Path(source).name} > robot.urdf)')
        element.tag = element.tag.rpartition(':')[2]
    if tree.tag != 'robot':
        raise _error(source, f'its root is <{tree.tag}>, not <robot>: this is not a URDF')
    return tree


def load_urdf(path: str | Path) -> RobotDescription:
    """Read a URDF file.

    Raises:
        DescriptionError: as of ``read_tree`` and ``describe``.

    """
    return describe(read_tree(path), str(path), Path(path))


def describe(tree: Element, source: str, path: Path | None = None) -> RobotDescription:
    """Return the description of a robot from a URDF.

    Args:
        tree: as of ``read_tree``.
        source: name for messages.
        path: of the file, from which meshes are found; None for a text.

    Raises:
        DescriptionError: it has no joints, or one is incomplete; the message names the source.

    """
    joints: dict[str, JointDescription] = {}
    for element in tree.iterfind('joint'):
        joint = _joint(element, source)
        if joint.name in joints:
            raise _error(source, f"the joint '{joint.name}' appears twice")
        joints[joint.name] = joint
    if not joints:
        raise _error(source, 'it has no joints')
    for name in _passive(tree, joints):
        joints[name] = replace(joints[name], passive=True)
    for element in tree.iterfind('ros2_control/joint'):
        if (name := element.get('name', '')) in joints:
            joints[name] = _controlled(element, joints[name])
    folder = mesh_folder(tree)
    return RobotDescription('URDF', joints, {
        link.get('name', '').strip(): _link(link, path, folder)
        for link in tree.iterfind('link')})


def _passive(tree: Element, joints: Mapping[str, JointDescription]) -> list[str]:
    """Return joints without a motor, where most of the others have one."""
    turning = [name for name, joint in joints.items() if not joint.undrivable]
    motors = {joint.get('name', '') for joint in tree.iterfind('transmission/joint')}
    motors |= {joint.get('name', '') for joint in tree.iterfind('ros2_control/joint')
               if joint.find('command_interface') is not None}
    weak = {joint.get('name', '').strip() for joint in tree.iterfind('joint')
            if (limit := joint.find('limit')) is not None
            and numbers(limit.get('effort', ''), 1) == (0.0,)}
    if 2 * len(motors & set(turning)) <= len(turning):
        motors = set(turning)
    if 2 * len(weak & set(turning)) >= len(turning):
        weak = set()
    return [name for name in turning if name not in motors or name in weak]


def _controlled(element: Element, joint: JointDescription) -> JointDescription:
    """Narrow a joint's limits to those of its command interfaces in the ros2_control part."""
    limits = {key: getattr(joint, key) for key in COMMAND_LIMITS.values()}
    for interface in element.iterfind('command_interface'):
        for param in interface.iterfind('param'):
            value = numbers(param.text or '', 1)
            key = COMMAND_LIMITS.get((interface.get('name', ''), param.get('name', '')))
            if value and key:
                narrower = max if key == 'lower' else min
                limits[key] = narrower(limits[key], *value)
    return replace(joint, **limits)


def mesh_folder(tree: Element) -> str:
    """Return the mesh folder that a URDF names (MuJoCo's extension), or ''."""
    compiler = tree.find('mujoco/compiler')
    return '' if compiler is None else compiler.get('meshdir', '')


def numbers(text: str, count: int, finite: bool = True) -> tuple[float, ...]:
    """Return the numbers of an attribute, () if their count is wrong.

    Args:
        text: numbers separated by spaces.
        count: how many there should be.
        finite: whether infinite values count as missing.

    """
    try:
        values = tuple(float(word) for word in text.split())
    except ValueError:
        return ()
    valid = not any(value != value or (finite and math.isinf(value)) for value in values)
    return values if valid and len(values) == count else ()


def _error(source: str, why: str) -> DescriptionError:
    return DescriptionError(one_line(f'URDF {source}: {why}'))


def _joint(element: Element, source: str) -> JointDescription:
    name, kind = element.get('name', '').strip(), element.get('type', '').strip()
    if not name:
        raise _error(source, 'a joint has no name')
    if not kind:
        raise _error(source, f"the joint '{name}' has no type")
    parts: dict[str, dict[str, str]] = {part.tag: part.attrib for part in element}

    def text(part: str, key: str, default: str = '') -> str:
        return parts.get(part, {}).get(key, default)

    def read(part: str, key: str, default: str, finite: bool = True) -> tuple[float, ...]:
        given, count = text(part, key, default), len(default.split())
        if not (values := numbers(given, count, finite)):
            what = 'a number' if count == 1 else f'{count} numbers'
            raise _error(source, f"the joint '{name}': {part} {key}=\"{given[:40]}\" is not "
                         f'{what}')
        return values

    lower, upper, velocity = (read('limit', key, '0', finite=False)[0]
                              for key in ('lower', 'upper', 'velocity'))
    bounded = kind in ('revolute', 'prismatic')
    if bounded and 'limit' not in parts:
        raise _error(source, f"the joint '{name}' is {kind}, but has no <limit>")
    # As programs write them that know no limits.
    bounded &= lower != 0.0 or upper != 0.0
    return JointDescription(
        name, kind, lower if bounded else -math.inf, upper if bounded else math.inf,
        abs(velocity) if 0.0 < abs(velocity) <= MAX_SPEED else math.inf, text('mimic', 'joint'),
        text('parent', 'link'), text('child', 'link'), read('origin', 'xyz', '0 0 0'),
        read('origin', 'rpy', '0 0 0'), read('axis', 'xyz', '1 0 0'))


def _link(element: Element, path: Path | None, folder: str) -> LinkDescription:
    """Return a link; entries that are not numbers are ignored."""
    mass = radius = 0.0
    centre: tuple[float, ...] = ()
    shapes: list[CollisionShape] = []
    for part in element.iterfind('inertial/mass'):
        mass = sum(numbers(part.get('value', ''), 1))
    # Without collision shapes, visual ones show where a link ends.
    for collision in element.findall('collision') or element.findall('visual'):
        origin, sphere = collision.find('origin'), collision.find('geometry/sphere')
        attributes = {} if origin is None else origin.attrib
        if sphere is not None and not radius:
            radius = sum(numbers(sphere.get('radius', ''), 1))
            centre = numbers(attributes.get('xyz', ''), 3)
        shapes += _shapes(collision, path, folder, *(
            numbers(attributes.get(key, ''), 3) or (0.0, 0.0, 0.0) for key in ('xyz', 'rpy')))
    return LinkDescription(mass, radius, centre or (0.0, 0.0, 0.0), tuple(shapes))


def _shapes(collision: Element, path: Path | None, folder: str, xyz: tuple[float, ...],
            rpy: tuple[float, ...]) -> Iterator[CollisionShape]:
    """Return the boxes, cylinders and meshes of a link."""
    for box in collision.iterfind('geometry/box'):
        if size := numbers(box.get('size', ''), 3):
            yield CollisionShape(xyz, rpy, size)
    for cylinder in collision.iterfind('geometry/cylinder'):
        (radius, length) = (sum(numbers(cylinder.get(key, ''), 1)) for key in ('radius', 'length'))
        yield CollisionShape(xyz, rpy, (2.0 * radius, 2.0 * radius, length))
    for mesh in collision.iterfind('geometry/mesh'):
        with suppress(MeshError):    # one that is missing is reported where it is needed
            yield CollisionShape(xyz, rpy, numbers(mesh.get('scale', ''), 3) or (1.0, 1.0, 1.0),
                        find_mesh(mesh.get('filename', ''), path, folder))


# Legs that reach to the side, as those of insects.

#: MIN_PITCH_COSINE: component of the femur's axis across the body from which on it swings the leg
#: forward.
MIN_PITCH_COSINE = 0.9


def sprawls(axes: np.ndarray) -> bool:
    """Tell whether a leg extends sideways: coxa about the vertical, femur about a level axis.

    Args:
        axes: of its joints down the leg with all joints at 0, unit vectors, shape (joints, 3).

    """
    if len(axes) < 3:
        return False
    coxa, femur, tibia = axes[-3:]
    return bool(abs(coxa[2]) > 0.99 and max(abs(femur[2]), abs(tibia[2])) < 0.01
                and abs(femur @ tibia) > 0.99 and abs(femur[1]) < MIN_PITCH_COSINE)


def outward(axis: np.ndarray, reach: np.ndarray) -> np.ndarray:
    """Return the level direction in which a leg extends, in the plane in which its femur moves.

    Args:
        axis: of the femur, shape (3,).
        reach: from coxa to foot, m; its first two numbers count.

    """
    out = np.array([-axis[1], axis[0]]) / math.hypot(axis[0], axis[1])
    return out if out @ reach[:2] >= 0.0 else -out
