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

"""Where the meshes are that a URDF names, and which of them a text on the graph may name.

Whoever is on the graph can publish a robot_description. Only files of installed packages are
opened for it, so that it cannot point the panel at others of this machine.
"""

import os
from pathlib import Path
import re
from urllib.parse import unquote

from ament_index_python.packages import (
    get_package_share_directory,
    get_packages_with_prefixes,
    PackageNotFoundError,
)
from cpg_ros.files.regular_file import one_line, read_bytes
from cpg_ros.panel.mesh_files import MeshError

PACKAGE, FILE = 'package://', 'file://'


def any_mesh(name: str, folder: Path) -> Path:
    """Return where a mesh is that a user's own URDF in a folder names.

    Raises:
        MeshError: the package is not installed.

    """
    if name.startswith(PACKAGE):
        package, rest = _parted(name)
        return _share(name, package) / rest
    return Path(os.path.normpath(folder / unquote(name.removeprefix(FILE))))


def installed_mesh(name: str) -> Path:
    """Return where a mesh is that a robot_description names, if an installed package has it.

    Raises:
        MeshError: it is a file of no installed package.

    """
    if name.startswith(PACKAGE):
        package, rest = _parted(name)
        share = _share(name, package)
        path = share / rest
    else:
        path = Path(os.path.normpath(Path('/', unquote(name.removeprefix(FILE)))))
        shares = {one: Path(prefix, 'share', one)
                  for one, prefix in get_packages_with_prefixes().items()}
        package = next((one for one, share in shares.items() if path.is_relative_to(share)), '')
        share = shares.get(package, Path('/nowhere'))
    try:
        real = Path(os.path.realpath(path))
        inside = bool(package) and (real.is_relative_to(os.path.realpath(share))
                                    or _is_source(real, package))
    except ValueError as error:  # a byte 0
        raise MeshError(one_line(f'{name[:80]!r}: {error}')) from error
    if not inside:
        raise MeshError(one_line(f'{name[:200]}: robot_description may name files of installed '
                                 'packages only; start the panel with -p urdf:=FILE for others'))
    return real


def _parted(name: str) -> tuple[str, str]:
    package, _, rest = name.removeprefix(PACKAGE).partition('/')
    return package, unquote(rest).lstrip('/')


def _share(name: str, package: str) -> Path:
    try:
        if not re.fullmatch(r'\w[\w-]*', package, re.ASCII):
            raise ValueError(package)
        return Path(get_package_share_directory(package))
    except (PackageNotFoundError, ValueError) as error:
        raise MeshError(one_line(f'{name[:200]}: the package is not installed here')) from error


def _is_source(path: Path, package: str) -> bool:
    """Tell whether a file is in a package's sources, to which ``--symlink-install`` links."""
    for manifest in (folder / 'package.xml' for folder in path.parents):
        if manifest.is_file():
            text = read_bytes(manifest, MeshError).decode(errors='replace')
            found = re.search(r'<name>\s*([^<\s]+)\s*</name>', text)
            return found is not None and found[1] == package
    return False
