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

"""The shape of a robot from its URDF, a file or the text on ``robot_description``.

URDF: https://wiki.ros.org/urdf/XML/link.
"""

from collections.abc import Callable, Mapping
import os
from pathlib import Path
import tempfile
from xml.etree import ElementTree as Xml

from ament_index_python.packages import get_package_share_directory, PackageNotFoundError
from cpg_ros.panel import body_shape as solids
from cpg_ros.panel import mesh_files
from cpg_ros.panel.body_shape import Link, Shape
from cpg_ros.robots.urdf import load_urdf, root, rotation, UrdfError, UrdfJoint
import numpy as np


def from_text(text: str, source: str, said: Callable[[str], None]) -> Shape:
    """Return the shape that a URDF's text describes; errors and the rest as of ``from_file``."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / 'robot_description.urdf'
        path.write_text(text)
        return from_file(path, said, source)


def from_file(path: Path, said: Callable[[str], None], source: str = '') -> Shape:
    """Return the shape that a URDF file describes.

    Args:
        path: of the file; meshes are found from its folder, or as ``package://`` says.
        said: is told of each part that cannot be drawn.
        source: what to call it, the file by default.

    Raises:
        UrdfError: it is no URDF, or its links are not one tree.

    """
    joints = load_urdf(path)
    # That has read it: what follows is well-formed, without entities.
    tree = Xml.fromstring(path.read_bytes())
    visuals = {link.get('name', ''): link.findall('visual') for link in tree.iter('link')}
    colours = {one.get('name', ''): colour for one in tree.findall('material')
               if (colour := _colour(one)) is not None}
    shape = Shape(source or path.name, [Link(root(joints), -1)])
    shape.limits = {joint.name: (joint.lower, joint.upper) for joint in joints.values()
                    if joint.kind != 'fixed'}
    below: dict[str, list[UrdfJoint]] = {}
    for joint in joints.values():
        below.setdefault(joint.parent, []).append(joint)
    for index, link in enumerate(shape.links):  # which grows
        if len(shape.links) > len(joints) + 1:
            raise UrdfError(f'URDF {source or path}: the links form a loop')
        for joint in below.get(link.name, ()):
            shape.links.append(_held(joint, index))
        for visual in visuals.get(link.name, ()):
            try:
                _draw(link, visual, colours, path.parent)
            except mesh_files.MeshError as error:
                said(f'not drawn: {error}')
    return shape


def _held(joint: UrdfJoint, parent: int) -> Link:
    fixed = joint.kind == 'fixed' or bool(joint.mimic)
    axis = np.array(joint.axis)
    return Link(joint.child, parent, '' if fixed else joint.name, joint.kind == 'prismatic',
                axis / max(float(np.linalg.norm(axis)), 1e-9), np.array(joint.xyz),
                rotation(joint.rpy))


def _numbers(text: str | None, default: str) -> np.ndarray:
    try:
        return np.array([float(word) for word in (text or default).split()])
    except ValueError as error:
        raise mesh_files.MeshError(f"'{(text or '')[:40]}' are not numbers") from error


def _colour(material: Xml.Element) -> tuple[float, ...] | None:
    colour = material.find('color')
    return None if colour is None else tuple(_numbers(colour.get('rgba'), '0.6 0.6 0.6 1'))


def _draw(link: Link, visual: Xml.Element, colours: Mapping[str, tuple[float, ...]],
          folder: Path) -> None:
    origin, material = visual.find('origin'), visual.find('material')
    place = _numbers(None if origin is None else origin.get('xyz'), '0 0 0')
    pose = rotation(tuple(_numbers(None if origin is None else origin.get('rpy'), '0 0 0')))
    colour = solids.GREY
    if material is not None:
        named = colours.get(material.get('name', ''), solids.GREY)
        colour = _colour(material) or named  # type: ignore[assignment]
    for one in visual.iterfind('geometry/*'):
        link.add(_triangles(one, folder), colour, place, pose)


def _triangles(solid: Xml.Element, folder: Path) -> np.ndarray:
    if solid.tag == 'box':
        return solids.box(0.5 * _numbers(solid.get('size'), '0.1 0.1 0.1'))
    radius, length = (float(_numbers(solid.get(key), '0.1')[0]) for key in ('radius', 'length'))
    if solid.tag == 'cylinder':
        return solids.cylinder(radius, 0.5 * length)
    if solid.tag == 'sphere':
        return solids.sphere(radius)
    if solid.tag == 'capsule':
        return solids.capsule(radius, 0.5 * length)
    if solid.tag != 'mesh':
        raise mesh_files.MeshError(f'<{solid.tag}> is not a URDF shape')
    found = mesh_files.read(_path(solid.get('filename', ''), folder))
    return mesh_files.coarse(found * _numbers(solid.get('scale'), '1 1 1'))


def _path(name: str, folder: Path) -> Path:
    """Return where a mesh is, as ROS names it."""
    if not name.startswith('package://'):
        return Path(os.path.normpath(folder / name.removeprefix('file://')))
    package, _, rest = name.removeprefix('package://').partition('/')
    try:
        return Path(get_package_share_directory(package)) / rest
    except (PackageNotFoundError, ValueError) as error:
        raise mesh_files.MeshError(f'{name}: the package is not installed here') from error
