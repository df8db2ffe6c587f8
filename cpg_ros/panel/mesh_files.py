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

"""Triangles from the files that a URDF names: STL, binary or text, and OBJ."""

from pathlib import Path
import re

from cpg_ros.errors import CpgError
from cpg_ros.files.regular_file import one_line, read_bytes
import numpy as np

#: Vertices closer than this are made one: a page draws a robot, not its screws, m.
GRAIN = 0.008


class MeshError(CpgError):
    """A mesh cannot be read; the message names the file and says why."""


def read(path: Path) -> np.ndarray:
    """Read the triangles of a file, shape (n, 3, 3), in its own units.

    Raises:
        MeshError: there is no such file, it is no regular file, too large or empty, or of no
            kind that is read.

    """
    data = read_bytes(path, MeshError)
    try:
        if path.suffix.lower() == '.stl':
            found = _stl(data)
        elif path.suffix.lower() == '.obj':
            found = _obj(data.decode(errors='replace'))
        else:
            raise MeshError(f"{path}: '{path.suffix}' is neither .stl nor .obj")
    except MeshError:
        raise
    except (ArithmeticError, LookupError, ValueError) as error:
        raise MeshError(one_line(f'{path}: {error}')) from error
    if not len(found):
        raise MeshError(f'{path}: it has no triangles')
    if not np.isfinite(found).all():
        raise MeshError(f'{path}: a vertex is not finite')
    return found


def _stl(data: bytes) -> np.ndarray:
    count = int.from_bytes(data[80:84], 'little')
    if len(data) == 84 + 50 * count:
        rows = np.frombuffer(data, np.uint8, offset=84).reshape(count, 50)
        return rows[:, 12:48].copy().view('<f4').reshape(count, 3, 3).astype(float)
    words = re.findall(rb'vertex\s+(\S+)\s+(\S+)\s+(\S+)', data)
    return np.array(words, dtype='S').astype(float).reshape(-1, 3, 3)


def _obj(text: str) -> np.ndarray:
    places: list[list[float]] = []
    corners: list[list[int]] = []
    for line in text.splitlines():
        words = line.split()
        if words[:1] == ['v']:
            places.append([float(word) for word in words[1:4]])
        elif words[:1] == ['f']:
            face = [int(word.split('/')[0]) for word in words[1:]]
            face = [k - 1 if k > 0 else len(places) + k for k in face]
            corners += [[face[0], face[k], face[k + 1]] for k in range(1, len(face) - 1)]
    return np.array(places).reshape(-1, 3)[np.array(corners, int).reshape(-1, 3)]


def coarse(triangles: np.ndarray, grain: float = GRAIN) -> np.ndarray:
    """Return the triangles left when vertices that lie close together, m, are made one."""
    cells = np.round(triangles / grain)
    _, first, which = np.unique(cells.reshape(-1, 3), axis=0, return_index=True,
                                return_inverse=True)
    which = which.reshape(-1, 3)
    whole = ((which[:, 0] != which[:, 1]) & (which[:, 1] != which[:, 2])
             & (which[:, 2] != which[:, 0]))
    left = which[whole]
    # Two that came to lie on one another are one, whichever way round.
    _, kept = np.unique(np.sort(left, axis=1), axis=0, return_index=True)
    return triangles.reshape(-1, 3)[first][left[np.sort(kept)]]
