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

"""Meshes of URDF files: where they are, and whether MuJoCo can read them.

MuJoCo reads binary STL, OBJ and MSH. Bodies collide as convex hulls, so that of other files the
points are enough for a shape to collide; for pictures they are not.
"""

from collections.abc import Iterator
import os
from pathlib import Path
import re
from urllib.parse import unquote
from xml.etree import ElementTree

from cpg_ros.files import regular_file, xml_reader
from cpg_ros.robots.urdf import bare, UrdfError
import numpy as np

#: What a reference may begin with, beside the name of a package.
_PACKAGE = re.compile(r'(?:package|model):/+([^/]+)/(.*)', re.DOTALL)
#: What each dimension of a mesh must exceed to have a hull, m.
FLAT = 1e-6


def find_mesh(reference: str, urdf: Path, folder: str = '') -> Path | None:
    """Return the file that a URDF means, None if there is none.

    ``package://NAME/...`` is looked for where ament and ROS_PACKAGE_PATH have packages, then in
    the folders above the URDF: one called NAME, one with a package.xml of that name, at last
    any.

    Args:
        reference: the attribute ``filename``.
        urdf: the file that it is in.
        folder: where that says that meshes are.

    """
    if match := _PACKAGE.fullmatch(reference):
        places = _packaged(match[1], unquote(match[2]), urdf)
    else:
        path = unquote(reference.removeprefix('file://'))
        places = iter([urdf.parent / path, urdf.parent / folder / path,
                       urdf.parent / folder / Path(path).name])
    return next((place for place in places if place.is_file()), None)


def _packaged(package: str, rest: str, urdf: Path) -> Iterator[Path]:
    for prefix in filter(None, os.environ.get('AMENT_PREFIX_PATH', '').split(os.pathsep)):
        yield Path(prefix) / 'share' / package / rest
    for root in filter(None, os.environ.get('ROS_PACKAGE_PATH', '').split(os.pathsep)):
        yield from (Path(root) / package / rest, Path(root) / rest)
    above = urdf.resolve().parents
    for folder in above:
        yield folder / package / rest
    for folder in above:
        if folder.name == package or _name_of(folder) == package:
            yield folder / rest
    for folder in above:
        yield folder / rest


def _name_of(folder: Path) -> str:
    """Return the name that a folder's package.xml gives it, '' without one."""
    manifest = folder / 'package.xml'
    if not manifest.is_file():
        return ''
    found = re.search(r'<name>\s*([^<\s]+)\s*</name>',
                      regular_file.read_bytes(manifest, UrdfError).decode(errors='replace'))
    return found[1] if found else ''


def trouble(path: Path) -> str:
    """Say why MuJoCo cannot read a mesh, '' if it can."""
    if path.suffix.lower() not in ('.stl', '.obj', '.msh'):
        return f'MuJoCo does not read {path.suffix or "files without an ending"}'
    import mujoco
    spec = mujoco.MjSpec()
    spec.add_mesh(name='mesh', file=str(path.resolve()),
                  inertia=mujoco.mjtMeshInertia.mjMESH_INERTIA_CONVEX)
    spec.worldbody.add_geom(type=mujoco.mjtGeom.mjGEOM_MESH, meshname='mesh')
    try:
        spec.compile()
    except ValueError as error:
        return str(error).splitlines()[0].removeprefix('Error: ')
    return ''


def hull(path: Path) -> bytes:
    """Return the convex hull of a mesh as OBJ, m, of a Collada or STL file.

    Raises:
        UrdfError: the file cannot be read, or its points are in a plane.

    """
    from scipy.spatial import ConvexHull, QhullError
    try:
        points = _collada(path) if path.suffix.lower() == '.dae' else _stl(path)
    except UrdfError:
        raise
    except (ValueError, LookupError, AttributeError) as error:
        raise UrdfError(f'{path.name}: {error}') from error
    if len(points) < 4 or np.ptp(points, axis=0).min() < FLAT:
        raise UrdfError(f'{path.name}: {len(points)} points that enclose no volume')
    try:
        found = ConvexHull(points)
    except QhullError as error:
        raise UrdfError(f'{path.name}: its points enclose no volume') from error
    corners = points[found.vertices]
    place = {int(vertex): k + 1 for k, vertex in enumerate(found.vertices)}
    outward = found.equations[:, :3]
    lines = [f'v {x:.9g} {y:.9g} {z:.9g}' for x, y, z in corners]
    for (a, b, c), normal in zip(found.simplices, outward, strict=True):
        if np.cross(points[b] - points[a], points[c] - points[a]) @ normal < 0.0:
            b, c = c, b
        lines.append(f'f {place[int(a)]} {place[int(b)]} {place[int(c)]}')
    return ('\n'.join(lines) + '\n').encode()


def _stl(path: Path) -> np.ndarray:
    """Return the vertices of an ASCII STL file, shape (vertices, 3)."""
    found = re.findall(rb'vertex\s+(\S+)\s+(\S+)\s+(\S+)',
                       regular_file.read_bytes(path, UrdfError))
    return np.array(found, dtype=float).reshape(-1, 3)


def _collada(path: Path) -> np.ndarray:
    """Return the points of a Collada file, z up and in metres, shape (points, 3)."""
    root = xml_reader.parse(regular_file.read_bytes(path, UrdfError),
                            lambda why: UrdfError(f'{path.name}: {why}'))
    for element in root.iter():
        element.tag = bare(element.tag)
    unit = root.find('asset/unit')
    up = root.findtext('asset/up_axis', 'Y_UP').strip()
    scale = float(unit.get('meter', 1.0)) if unit is not None else 1.0
    meshes = {geometry.get('id', ''): _positions(geometry)
              for geometry in root.iter('geometry')}
    found: list[np.ndarray] = []
    for scene in root.iter('visual_scene'):
        for node in scene.findall('node'):
            _placed(node, np.eye(4), meshes, found)
    points = np.concatenate(found or list(meshes.values()) or [np.empty((0, 3))])
    if up == 'Y_UP':
        points = points[:, [0, 2, 1]] * [1.0, -1.0, 1.0]
    elif up == 'X_UP':
        points = points[:, [1, 0, 2]] * [-1.0, 1.0, 1.0]
    return scale * points


def _positions(geometry: ElementTree.Element) -> np.ndarray:
    found = [np.empty((0, 3))]
    sources = {source.get('id', ''): source for source in geometry.iter('source')}
    for vertices in geometry.iter('vertices'):
        for use in vertices.findall('input[@semantic="POSITION"]'):
            source = sources.get(use.get('source', '').removeprefix('#'))
            numbers = '' if source is None else source.findtext('float_array', '')
            found.append(np.array(numbers.split(), dtype=float).reshape(-1, 3))
    return np.concatenate(found)


def _placed(node: ElementTree.Element, above: np.ndarray, meshes: dict[str, np.ndarray],
            found: list[np.ndarray]) -> None:
    """Collect the points of a node and all below it, in the frame of the scene."""
    place = above.copy()
    for step in node:
        kind = step.tag
        if kind in ('matrix', 'translate', 'rotate', 'scale'):
            place = place @ _step(kind, np.array((step.text or '').split(), dtype=float))
    for use in node.findall('instance_geometry'):
        points = meshes.get(use.get('url', '').removeprefix('#'))
        if points is not None:
            found.append(points @ place[:3, :3].T + place[:3, 3])
    for below in node.findall('node'):
        _placed(below, place, meshes, found)


def _step(kind: str, numbers: np.ndarray) -> np.ndarray:
    if kind == 'matrix':
        return numbers.reshape(4, 4)
    step = np.eye(4)
    if kind == 'translate':
        step[:3, 3] = numbers
    elif kind == 'scale':
        step[:3, :3] = np.diag(numbers)
    else:
        x, y, z = numbers[:3] / np.linalg.norm(numbers[:3])
        turn, angle = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]]), np.radians(numbers[3])
        step[:3, :3] += np.sin(angle) * turn + (1.0 - np.cos(angle)) * turn @ turn
    return step
