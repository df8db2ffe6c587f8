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

"""Subspaces of a network's states that its linearised flow along a gait keeps apart.

Elements of K, and with x -> -x those with a shift of half a cycle, leave a gait alone, so the
variational equation along it commutes with them: disturbances of different signs under them do not
mix. The states that all of them leave alone are the gait's class.
"""

from fractions import Fraction
from functools import cache

from cpg_ros.networks.symmetry import Symmetry
import numpy as np


@cache
def split(symmetry: Symmetry) -> tuple[np.ndarray, list[np.ndarray]]:
    """Return orthonormal columns of the gait's class, and of the subspaces transverse to it."""
    cells = symmetry.group.cells
    inside, parts = symmetry.basis.T, [np.eye(cells)]
    for name, shift in symmetry.shifts:
        sign = 1.0 if shift == 0 else -1.0
        if shift not in (0, Fraction(1, 2)) or (sign < 0.0 and not symmetry.odd):
            continue
        image = np.zeros((cells, cells))
        image[np.array(symmetry.group.elements[name]), np.arange(cells)] = sign
        if np.array_equal(image @ image, np.eye(cells)):
            parts = [half for part in parts for half in _halves(part, image)]
    outside = []
    for part in parts:
        columns = np.kron(np.eye(symmetry.variables), part)
        rest = columns - inside @ (inside.T @ columns)
        vectors, sizes, _ = np.linalg.svd(rest, full_matrices=False)
        if (sizes > 0.5).any():
            outside.append(vectors[:, sizes > 0.5])
    return inside, outside


def _halves(part: np.ndarray, image: np.ndarray) -> list[np.ndarray]:
    """Part a subspace, orthonormal columns, into those that an involution keeps and turns."""
    found = []
    for sign in (1.0, -1.0):
        vectors, sizes, _ = np.linalg.svd(0.5 * (part + sign * image @ part), full_matrices=False)
        if (sizes > 0.5).any():
            found.append(vectors[:, sizes > 0.5])
    return found
