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

from collections.abc import Callable
from pathlib import Path
from xml.etree import ElementTree as Xml

from cpg_ros.panel import body_shape as solids
from cpg_ros.panel import mesh_files
from cpg_ros.panel.body_shape import Link, Shape
from cpg_ros.panel.mesh_places import any_mesh, installed_mesh
from cpg_ros.robots.urdf import (
    joints_of,
    parse_tree,
    read_tree,
    root,
    rotation,
    UrdfError,
    UrdfJoint,
)
import numpy as np

#: Largest text on ``robot_description``, bytes; triangles and bytes of meshes that are drawn.
LARGEST, TRIANGLES, MESHES = 4_000_000, 1_000_000, 500_000_000
#: Nothing that is drawn is longer or further away, m.
FURTHEST = 1e4

FindMesh = Callable[[str], Path]


def from_text(text: str, source: str, said: Callable[[str], None]) -> Shape:
    """Return the shape that a URDF's text on the graph describes.

    Args:
        text: of anybody on the graph: no file is opened that is not of an installed package.
        source: what to call it.
        said: is told of each part that cannot be drawn.

    Raises:
        UrdfError: it is no URDF, is too large, or its links are not one tree.

    """
    data = text.encode(errors='replace')
    if len(data) > LARGEST:
        raise UrdfError(f'URDF {source}: has {len(data) / 1e6:.4g} MB, more than the '
                        f'{LARGEST / 1e6:g} MB that are read')
    return _shape(parse_tree(data, source), source, installed_mesh, said)


def from_file(path: Path, said: Callable[[str], None]) -> Shape:
    """Return the shape that a user's URDF file describes.

    Args:
        path: of the file; meshes are found from its folder, or as ``package://`` says.
        said: is told of each part that cannot be drawn.

    Raises:
        UrdfError: it is no URDF, or its links are not one tree.

    """
    return _shape(read_tree(path), path.name, lambda name: any_mesh(name, path.parent), said)


def _shape(tree: Xml.Element, source: str, find: FindMesh, said: Callable[[str], None]) -> Shape:
    joints = joints_of(tree, source)
    drawing = _Drawing(tree, find)
    visuals = {link.get('name', ''): link.findall('visual') for link in tree.findall('link')}
    shape = Shape(source, [Link(root(joints), -1)])
    shape.limits = {joint.name: (joint.lower, joint.upper) for joint in joints.values()
                    if joint.kind != 'fixed'}
    below: dict[str, list[UrdfJoint]] = {}
    for joint in joints.values():
        below.setdefault(joint.parent, []).append(joint)
    for index, link in enumerate(shape.links):  # which grows
        if len(shape.links) > len(joints) + 1:
            raise UrdfError(f'URDF {source}: the links form a loop')
        for joint in below.get(link.name, ()):
            shape.links.append(_held(joint, index))
        for visual in visuals.get(link.name, ()):
            try:
                drawing.add(link, visual)
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
    """Return as many numbers as the default has."""
    words = (text or default).split()
    try:
        found = np.array([float(word) for word in words])
    except ValueError:
        found = np.empty(0)
    if len(found) != len(default.split()) or not (np.abs(found) < FURTHEST).all():
        raise mesh_files.MeshError(f"'{(text or '')[:40]}' is not {len(default.split())} numbers "
                                   f'below {FURTHEST:g}')
    return found


class _Drawing:
    """Draws visuals as triangles, as many as a page can show."""

    def __init__(self, tree: Xml.Element, find: FindMesh) -> None:
        self._find = find
        self._colours = {one.get('name', ''): one for one in tree.findall('material')}
        self._meshes: dict[Path, np.ndarray] = {}
        self._bytes = self._triangles = 0

    def add(self, link: Link, visual: Xml.Element) -> None:
        """Add a visual to its link.

        Raises:
            MeshError: it cannot be drawn.

        """
        origin, material = visual.find('origin'), visual.find('material')
        place = _numbers(None if origin is None else origin.get('xyz'), '0 0 0')
        pose = rotation(tuple(_numbers(None if origin is None else origin.get('rpy'), '0 0 0')))
        colour = solids.GREY if material is None else self._colour(material)
        for one in visual.iterfind('geometry/*'):
            found = self._solid(one)
            self._triangles += len(found)
            if self._triangles > TRIANGLES:
                raise mesh_files.MeshError(f'the robot has more than {TRIANGLES} triangles')
            link.add(found, colour, place, pose)

    def _colour(self, material: Xml.Element) -> tuple[float, ...]:
        for one in (material, self._colours.get(material.get('name', ''))):
            if one is not None and (colour := one.find('color')) is not None:
                return tuple(_numbers(colour.get('rgba'), '0.6 0.6 0.6 1'))
        return solids.GREY

    def _solid(self, solid: Xml.Element) -> np.ndarray:
        if solid.tag == 'box':
            return solids.box(0.5 * _numbers(solid.get('size'), '0.1 0.1 0.1'))
        radius, length = (float(_numbers(solid.get(key), '0.1')[0])
                          for key in ('radius', 'length'))
        if solid.tag == 'cylinder':
            return solids.cylinder(radius, 0.5 * length)
        if solid.tag == 'sphere':
            return solids.sphere(radius)
        if solid.tag == 'capsule':
            return solids.capsule(radius, 0.5 * length)
        if solid.tag != 'mesh':
            raise mesh_files.MeshError(f'<{solid.tag}> is not a URDF shape')
        name = solid.get('filename', '')
        found = self._mesh(name) * _numbers(solid.get('scale'), '1 1 1')
        if not (np.abs(found) < FURTHEST).all():
            raise mesh_files.MeshError(f'{name}: a vertex is further than {FURTHEST:g} m away')
        return mesh_files.coarse(found)

    def _mesh(self, name: str) -> np.ndarray:
        path = self._find(name)
        if path not in self._meshes:
            found = mesh_files.read(path)
            self._bytes += found.nbytes
            if self._bytes > MESHES:
                raise mesh_files.MeshError(f'{name}: the meshes have more than '
                                           f'{MESHES / 1e6:g} MB')
            self._meshes[path] = found
        return self._meshes[path]
