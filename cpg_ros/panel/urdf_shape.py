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
from cpg_ros.panel.body_shape import Link, Shape
from cpg_ros.robots.description import DescriptionError, JointDescription, rotation
from cpg_ros.robots.mesh_files import MeshError, read_mesh
from cpg_ros.robots.mesh_paths import find_mesh
from cpg_ros.robots.urdf import describe, mesh_folder, numbers, parse_tree, read_tree
import numpy as np

#: Largest text on ``robot_description``, bytes; triangles and bytes of meshes that are drawn.
LARGEST, TRIANGLES, MESHES = 4_000_000, 100_000, 500_000_000
#: Nothing that is drawn is longer or further away, m.
FURTHEST = 1e4


def from_text(text: str, source: str, report: Callable[[str], None]) -> Shape:
    """Return the shape that a URDF's text on the graph describes.

    Args:
        text: from anyone on the graph: only files of installed packages are opened.
        source: what to call it.
        report: takes a line about each part that cannot be drawn.

    Raises:
        DescriptionError: it is no URDF, is too large, or its links are not one tree.

    """
    data = text.encode(errors='replace')
    if len(data) > LARGEST:
        raise DescriptionError(f'URDF {source}: has {len(data) / 1e6:.4g} MB, more than the '
                        f'{LARGEST / 1e6:g} MB that are read')
    return _shape(parse_tree(data, source), source, None, report)


def from_file(path: Path, report: Callable[[str], None]) -> Shape:
    """Return the shape that a user's URDF file describes.

    Args:
        path: of the file; meshes are found as ``find_mesh`` says.
        report: takes a line about each part that cannot be drawn.

    Raises:
        DescriptionError: it is no URDF, or its links are not one tree.

    """
    return _shape(read_tree(path), path.name, path, report)


def _shape(tree: Xml.Element, source: str, path: Path | None, report: Callable[[str], None]
           ) -> Shape:
    description = describe(tree, source)
    joints = description.joints
    drawing = _Drawing(tree, path)
    visuals = {link.get('name', ''): link.findall('visual') for link in tree.findall('link')}
    shape = Shape(source, [Link(description.root(), -1)])
    shape.limits = {joint.name: (joint.lower, joint.upper) for joint in joints.values()
                    if joint.kind != 'fixed'}
    below: dict[str, list[JointDescription]] = {}
    for joint in joints.values():
        below.setdefault(joint.parent, []).append(joint)
    for index, link in enumerate(shape.links):  # which grows
        if len(shape.links) > len(joints) + 1:
            raise DescriptionError(f'URDF {source}: the links form a loop')
        for joint in below.get(link.name, ()):
            shape.links.append(_held(joint, index))
        for visual in visuals.get(link.name, ()):
            try:
                drawing.add(link, visual)
            except MeshError as error:
                report(f'not drawn: {error}')
    return shape


def _held(joint: JointDescription, parent: int) -> Link:
    fixed = joint.kind == 'fixed' or bool(joint.mimic)
    axis = np.array(joint.axis)
    return Link(joint.child, parent, '' if fixed else joint.name, joint.kind == 'prismatic',
                axis / max(float(np.linalg.norm(axis)), 1e-9), np.array(joint.xyz),
                rotation(joint.rpy))


def _numbers(text: str | None, default: str) -> np.ndarray:
    """Return as many numbers as the default has."""
    count = len(default.split())
    found = np.array(numbers(text or default, count))
    if not len(found) or not (np.abs(found) < FURTHEST).all():
        raise MeshError(f"'{(text or '')[:40]}' is not {count} numbers below {FURTHEST:g}")
    return found


class _Drawing:
    """Draws visuals as triangles, as many as a page can show."""

    def __init__(self, tree: Xml.Element, path: Path | None) -> None:
        self._path, self._folder = path, mesh_folder(tree)
        self._colours = {one.get('name', ''): one for one in tree.findall('material')}
        self._meshes: dict[Path, np.ndarray] = {}
        self._bytes, self._left = 0, TRIANGLES

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
            if len(found) > self._left:
                raise MeshError(f'what exceeds {TRIANGLES} triangles of the whole robot')
            self._left -= len(found)
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
            raise MeshError(f'<{solid.tag}> is not a URDF shape')
        name = solid.get('filename', '')
        found = self._mesh(name) * _numbers(solid.get('scale'), '1 1 1')
        if not (np.abs(found) < FURTHEST).all():
            raise MeshError(f'{name}: a vertex is further than {FURTHEST:g} m away')
        return solids.coarse(found)

    def _mesh(self, name: str) -> np.ndarray:
        path = find_mesh(name, self._path, self._folder)
        if path not in self._meshes:
            mesh = read_mesh(path)
            if not len(mesh.triangles):
                raise MeshError(f'{path}: it has no triangles')
            found = mesh.points[mesh.triangles]
            self._bytes += found.nbytes
            if self._bytes > MESHES:
                raise MeshError(f'{name}: the meshes have more than {MESHES / 1e6:g} MB')
            self._meshes[path] = found
        return self._meshes[path]
