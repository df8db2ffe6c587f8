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

"""URDF files: joints with their limits and places, links with their masses and feet.

Reads what a robot file is compared with and leaves the rest (sensors, gazebo and transmission
blocks, whatever their prefixes) alone. URDF: https://wiki.ros.org/urdf/XML.
"""

import math
from pathlib import Path
from xml.etree.ElementTree import Element

from cpg_ros.files.regular_file import one_line, read_bytes
from cpg_ros.files.xml_reader import parse
from cpg_ros.robots.description import (
    DescriptionError,
    JointDescription,
    LinkDescription,
    RobotDescription,
)


def read_tree(path: str | Path) -> Element:
    """Read a URDF file as XML, tags without their prefixes.

    Raises:
        DescriptionError: the file cannot be read, is not XML, is xacro or is no URDF.

    """
    return parse_tree(read_bytes(path, DescriptionError, 'URDF'), str(path))


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
    return describe(read_tree(path), str(path))


def describe(tree: Element, source: str) -> RobotDescription:
    """Return what a URDF describes.

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
    return RobotDescription('URDF', joints, {link.get('name', '').strip(): _link(link)
                                             for link in tree.iterfind('link')})


def mesh_folder(tree: Element) -> str:
    """Return the mesh folder that a URDF names (MuJoCo's extension), '' if it names none."""
    compiler = tree.find('mujoco/compiler')
    return '' if compiler is None else compiler.get('meshdir', '')


def numbers(text: str, count: int, finite: bool = True) -> tuple[float, ...]:
    """Return the numbers of an attribute, () where they are not as many as they should be.

    Args:
        text: numbers with spaces between them.
        count: how many there should be.
        finite: count what is infinite as no number.

    """
    try:
        values = tuple(float(word) for word in text.split())
    except ValueError:
        return ()
    known = not any(value != value or (finite and math.isinf(value)) for value in values)
    return values if known and len(values) == count else ()


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
    return JointDescription(
        name, kind, lower if bounded else -math.inf, upper if bounded else math.inf,
        abs(velocity) if velocity else math.inf, text('mimic', 'joint'), text('parent', 'link'),
        text('child', 'link'), read('origin', 'xyz', '0 0 0'), read('origin', 'rpy', '0 0 0'),
        read('axis', 'xyz', '1 0 0'))


def _link(element: Element) -> LinkDescription:
    """Return a link; what is no number counts as not there."""
    mass = radius = 0.0
    centre: tuple[float, ...] = ()
    for part in element.iterfind('inertial/mass'):
        mass = sum(numbers(part.get('value', ''), 1))
    for collision in element.iterfind('collision'):
        origin, sphere = collision.find('origin'), collision.find('geometry/sphere')
        if sphere is not None and not radius:
            radius = sum(numbers(sphere.get('radius', ''), 1))
            centre = () if origin is None else numbers(origin.get('xyz', ''), 3)
    return LinkDescription(mass, radius, centre or (0.0, 0.0, 0.0))
