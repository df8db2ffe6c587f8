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

"""Meshes of robot descriptions: STL (binary or text), OBJ and Collada."""

from collections.abc import Iterator
import os
from pathlib import Path
import re
from typing import NamedTuple
from urllib.parse import unquote
from xml.etree.ElementTree import Element

from cpg_ros.common.errors import CpgError
from cpg_ros.common.files import one_line, parse, read_bytes
import numpy as np

#: MAX_POINTS: most points, and most triangles, of a Collada file, which can place a mesh any
#: number of times; MAX_NUMBERS: most numbers in one of its lists.
MAX_POINTS, MAX_NUMBERS = 2_000_000, 6_000_000


class MeshError(CpgError):
    """A mesh cannot be found or read; the message names it and the reason."""


class Mesh(NamedTuple):
    """Points, (n, 3), in the file's units (Collada: m, z up), and triangles of them, (m, 3)."""

    points: np.ndarray
    triangles: np.ndarray


def read_mesh(path: Path) -> Mesh:
    """Read a mesh.

    Raises:
        MeshError: the file is missing, not regular, too large, damaged, or of an unknown format.

    """
    data = read_bytes(path, MeshError)
    try:
        if path.suffix.lower() == '.stl':
            points, triangles = _stl(data)
        elif path.suffix.lower() == '.obj':
            points, triangles = _obj(data.decode(errors='replace'))
        elif path.suffix.lower() == '.dae':
            points, triangles = _collada(parse(data, lambda why: MeshError(f'{path}: {why}')))
        else:
            raise MeshError(f"{path}: '{path.suffix}' is none of .stl, .obj and .dae")
        if len(triangles) and not 0 <= triangles.min() <= triangles.max() < len(points):
            raise MeshError(f'{path}: a triangle has a vertex that is not there')
    except (ArithmeticError, LookupError, ValueError, AttributeError) as error:
        raise MeshError(one_line(f'{path}: {error}')) from error
    if not np.isfinite(points).all():
        raise MeshError(f'{path}: a vertex is not finite')
    return Mesh(points, triangles)


def merged(mesh: Mesh, grain: float) -> Mesh:
    """Return a mesh in which vertices closer than a grain, m, are one."""
    _, first, cells = np.unique(np.round(mesh.points / grain), axis=0, return_index=True,
                                return_inverse=True)
    corners = cells.reshape(-1)[mesh.triangles]
    whole = ((corners[:, 0] != corners[:, 1]) & (corners[:, 1] != corners[:, 2])
             & (corners[:, 2] != corners[:, 0]))
    return Mesh(mesh.points[first], corners[whole])


def _stl(data: bytes) -> Mesh:
    count = int.from_bytes(data[80:84], 'little')
    if len(data) == 84 + 50 * count:
        rows = np.frombuffer(data, np.uint8, offset=84).reshape(count, 50)
        points = rows[:, 12:48].copy().view('<f4').reshape(-1, 3).astype(float)
    else:
        words = re.findall(rb'vertex\s+(\S+)\s+(\S+)\s+(\S+)', data)
        points = np.array(words, dtype='S').astype(float).reshape(-1, 3)
    return Mesh(points, np.arange(len(points)).reshape(-1, 3))


def _fan(corners: list[int]) -> list[list[int]]:
    """Return the triangles of a polygon."""
    return [[corners[0], *corners[k:k + 2]] for k in range(1, len(corners) - 1)]


def _obj(text: str) -> Mesh:
    points: list[list[float]] = []
    triangles: list[list[int]] = []
    for line in text.splitlines():
        words = line.split()
        if words[:1] == ['v']:
            points.append([float(word) for word in words[1:4]])
        elif words[:1] == ['f']:
            face = [int(word.split('/')[0]) for word in words[1:]]
            triangles += _fan([k - 1 if k > 0 else len(points) + k for k in face])
    return Mesh(np.array(points).reshape(-1, 3), np.array(triangles, int).reshape(-1, 3))


def _collada(root: Element) -> Mesh:
    """Return the mesh of a Collada file, https://www.khronos.org/collada/, z up and in m."""
    for element in root.iter():
        element.tag = element.tag.rpartition(':')[2]
    unit = root.find('asset/unit')
    up = root.findtext('asset/up_axis', 'Y_UP').strip()
    scale = float(unit.get('meter', 1.0)) if unit is not None else 1.0
    meshes = {geometry.get('id', ''): _geometry(geometry) for geometry in root.iter('geometry')}
    parts: list[Mesh] = []
    left = [MAX_POINTS]
    for node in root.iterfind('.//visual_scene/node'):
        _add(node, np.eye(4), meshes, parts, left)
    parts = parts or list(meshes.values()) or [Mesh(np.empty((0, 3)), np.empty((0, 3), int))]
    points = np.concatenate([part.points for part in parts])
    firsts = np.cumsum([0, *(len(part.points) for part in parts)])
    if up == 'Y_UP':
        points = points[:, [0, 2, 1]] * [1.0, -1.0, 1.0]
    elif up == 'X_UP':
        points = points[:, [1, 0, 2]] * [-1.0, 1.0, 1.0]
    return Mesh(scale * points, np.concatenate([
        part.triangles + first for part, first in zip(parts, firsts, strict=False)]))


def _geometry(geometry: Element) -> Mesh:
    """Return the points of all vertices of a geometry and its triangles and polygons."""
    points, triangles = [np.empty((0, 3))], [np.empty((0, 3), int)]
    sources = {source.get('id', ''): source for source in geometry.iter('source')}
    firsts, count = {}, 0
    for vertices in geometry.iter('vertices'):
        firsts[vertices.get('id', '')] = count
        for use in vertices.findall('input[@semantic="POSITION"]'):
            source = sources.get(use.get('source', '').removeprefix('#'))
            numbers = '' if source is None else source.findtext('float_array', '')
            points.append(_numbers(numbers, float).reshape(-1, 3))
            count += len(points[-1])
            if count > MAX_POINTS:
                raise ValueError(f'a mesh has more than {MAX_POINTS} points')
    for kind in ('triangles', 'polylist', 'polygons'):
        for element in geometry.iter(kind):
            inputs = {use.get('semantic'): use for use in element.findall('input')}
            width = 1 + max((int(use.get('offset', 0)) for use in element.findall('input')),
                            default=0)
            use = inputs['VERTEX']
            first, offset = firsts[use.get('source', '').removeprefix('#')], use.get('offset', 0)
            rows = [first + _numbers(element_of.text, int).reshape(-1, width)[:, int(offset)]
                    for element_of in element.findall('p')]
            if kind == 'triangles':
                triangles += [row.reshape(-1, 3) for row in rows]
                continue
            if kind == 'polylist' and rows:
                counts = _numbers(element.findtext('vcount', ''), int)
                rows = np.split(rows[0], np.cumsum(counts)[:-1])
            triangles += [np.array(_fan(row.tolist()), int).reshape(-1, 3) for row in rows]
    return Mesh(np.concatenate(points), np.concatenate(triangles))


def _numbers(text: str | None, kind: type) -> np.ndarray:
    """Return the numbers of a list."""
    text = text or ''
    if sum(map(text.count, ' \t\r\n')) > MAX_NUMBERS:
        raise ValueError(f'a list has more than {MAX_NUMBERS} numbers')
    return np.array(text.split(), dtype=kind)


def _add(node: Element, above: np.ndarray, meshes: dict[str, Mesh], parts: list[Mesh],
         left: list[int]) -> None:
    """Collect the meshes of a node and its descendants, in the frame of the scene.

    Args:
        node: of the scene.
        above: frame of its parent.
        meshes: by name.
        parts: list to extend.
        left: one number, how many more points and triangles are allowed.

    """
    transform = above.copy()
    for step in node:
        if step.tag in ('matrix', 'translate', 'rotate', 'scale'):
            transform = transform @ _transform(step.tag,
                                               np.array((step.text or '').split(), dtype=float))
    for use in node.findall('instance_geometry'):
        mesh = meshes.get(use.get('url', '').removeprefix('#'))
        if mesh is not None:
            left[0] -= len(mesh.points) + len(mesh.triangles) + 1
            if left[0] < 0:
                raise ValueError(f'its meshes have more than {MAX_POINTS} points and triangles')
            parts.append(Mesh(mesh.points @ transform[:3, :3].T + transform[:3, 3],
                              mesh.triangles))
    for below in node.findall('node'):
        _add(below, transform, meshes, parts, left)


def _transform(kind: str, numbers: np.ndarray) -> np.ndarray:
    if kind == 'matrix':
        return numbers.reshape(4, 4)
    made = np.eye(4)
    if kind == 'translate':
        made[:3, 3] = numbers
    elif kind == 'scale':
        made[:3, :3] = np.diag(numbers)
    else:
        x, y, z = numbers[:3] / np.linalg.norm(numbers[:3])
        cross, angle = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]]), np.radians(numbers[3])
        made[:3, :3] += np.sin(angle) * cross + (1.0 - np.cos(angle)) * cross @ cross
    return made


# Paths of the meshes that a URDF names, by path or by package.

_PACKAGE = re.compile(r'(?:package|model):/+([^/]+)/+(.*)', re.DOTALL)


def find_mesh(reference: str, urdf: Path | None, folder: str = '') -> Path:
    """Return the path of a mesh that a URDF names.

    ``package://NAME/...`` is searched in the packages of ament and ROS_PACKAGE_PATH, then in the
    folders above the URDF: a folder NAME, one whose package.xml has that name, and finally any.

    Args:
        reference: the attribute ``filename``.
        urdf: the user's file; None for a text from the graph, which may name files of installed
            packages only.
        folder: mesh folder that the file states.

    Raises:
        MeshError: there is none, or the text may not name it.

    """
    package, rest = '', unquote(reference.removeprefix('file://'))
    if match := _PACKAGE.fullmatch(reference):
        package, rest = match[1], unquote(match[2]).lstrip('/')
    if urdf is None:
        return _installed(reference, package, rest)
    paths = _packaged(package, rest, urdf) if package else iter(
        [urdf.parent / rest, urdf.parent / folder / rest, urdf.parent / folder / Path(rest).name])
    for directory in paths:
        if directory.is_file():
            return directory
    raise MeshError(one_line(f'{reference[:200]}: ' + (
        'neither an installed package nor a folder above the URDF has such a file' if package
        else f'no such file, from {urdf.parent}')))


def _folders(variable: str) -> list[Path]:
    return [Path(folder) for folder in os.environ.get(variable, '').split(os.pathsep) if folder]


def _packaged(package: str, rest: str, urdf: Path) -> Iterator[Path]:
    for prefix in _folders('AMENT_PREFIX_PATH'):
        yield prefix / 'share' / package / rest
    for root in _folders('ROS_PACKAGE_PATH'):
        yield from (root / package / rest, root / rest)
    above = urdf.resolve().parents
    for folder in above:
        yield folder / package / rest
    for folder in above:
        if folder.name == package or _package_name(folder) == package:
            yield folder / rest
    for folder in above:
        yield folder / rest


def _installed(reference: str, package: str, rest: str) -> Path:
    """Return a file of an installed package, or of its sources if it links there."""
    try:
        for prefix in _folders('AMENT_PREFIX_PATH'):
            shared = Path(os.path.normpath(prefix / 'share'))
            path = Path(os.path.normpath(shared / package / rest if package else Path('/',
                                                                                        rest)))
            if not path.is_relative_to(shared):
                continue
            name = package or path.relative_to(shared).parts[:1][0]
            index = shared / 'ament_index' / 'resource_index' / 'packages' / name
            if not re.fullmatch(r'\w[\w-]*', name, re.ASCII) or not index.is_file():
                continue
            real = Path(os.path.realpath(path))
            if real.is_relative_to(os.path.realpath(shared / name)) or _is_source(real, name):
                return real
    except (ValueError, LookupError) as error:  # a byte 0, or the folder of all packages
        raise MeshError(one_line(f'{reference[:80]!r}: {error}')) from error
    raise MeshError(one_line(f'{reference[:200]}: robot_description may name files of installed '
                             'packages only; start the panel with -p urdf:=FILE for others'))


def _is_source(path: Path, package: str) -> bool:
    """Tell whether a file is in a package's sources, to which ``--symlink-install`` links."""
    nearest = next((name for folder in path.parents if (name := _package_name(folder))), '')
    return nearest == package


def _package_name(folder: Path) -> str:
    """Return the name in a folder's package.xml, or ''."""
    manifest = folder / 'package.xml'
    if not manifest.is_file():
        return ''
    match = re.search(r'<name>\s*([^<\s]+)\s*</name>',
                      read_bytes(manifest, MeshError).decode(errors='replace'))
    return match[1] if match else ''
