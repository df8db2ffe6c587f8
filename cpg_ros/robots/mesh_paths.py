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

"""Where the meshes are that a URDF names, by path or by package.

Whoever is on the graph can publish a robot_description. Only files of installed packages are
opened for it, so that it cannot point a process at others of this machine.
"""

from collections.abc import Iterator
import os
from pathlib import Path
import re
from urllib.parse import unquote

from cpg_ros.files.regular_file import one_line, read_bytes
from cpg_ros.robots.mesh_files import MeshError

_PACKAGE = re.compile(r'(?:package|model):/+([^/]+)/+(.*)', re.DOTALL)


def find_mesh(reference: str, urdf: Path | None, folder: str = '') -> Path:
    """Return the file that a URDF means.

    ``package://NAME/...`` is looked for where ament and ROS_PACKAGE_PATH have packages, then in
    the folders above the URDF: one called NAME, one with a package.xml of that name, at last
    any.

    Args:
        reference: the attribute ``filename``.
        urdf: the user's file that it is in; None for a text on the graph, which may name files of
            installed packages only.
        folder: where the file says that meshes are.

    Raises:
        MeshError: there is none, or none that may be named.

    """
    package, rest = '', unquote(reference.removeprefix('file://'))
    if match := _PACKAGE.fullmatch(reference):
        package, rest = match[1], unquote(match[2]).lstrip('/')
    if urdf is None:
        return _installed(reference, package, rest)
    places = _packaged(package, rest, urdf) if package else iter(
        [urdf.parent / rest, urdf.parent / folder / rest, urdf.parent / folder / Path(rest).name])
    for place in places:
        if place.is_file():
            return place
    raise MeshError(one_line(f'{reference[:200]}: ' + (
        'neither an installed package nor a folder above the URDF has such a file' if package
        else f'no such file, from {urdf.parent}')))


def _folders(variable: str) -> list[Path]:
    return [Path(one) for one in os.environ.get(variable, '').split(os.pathsep) if one]


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
    """Return a file of an installed package, or of its sources where these are linked to."""
    try:
        for prefix in _folders('AMENT_PREFIX_PATH'):
            share = Path(os.path.normpath(prefix / 'share'))
            path = Path(os.path.normpath(share / package / rest if package else Path('/', rest)))
            if not path.is_relative_to(share):
                continue
            name = package or path.relative_to(share).parts[:1][0]
            index = share / 'ament_index' / 'resource_index' / 'packages' / name
            if not re.fullmatch(r'\w[\w-]*', name, re.ASCII) or not index.is_file():
                continue
            real = Path(os.path.realpath(path))
            if real.is_relative_to(os.path.realpath(share / name)) or _is_source(real, name):
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
    """Return the name that a folder's package.xml gives it, '' without one."""
    manifest = folder / 'package.xml'
    if not manifest.is_file():
        return ''
    found = re.search(r'<name>\s*([^<\s]+)\s*</name>',
                      read_bytes(manifest, MeshError).decode(errors='replace'))
    return found[1] if found else ''
