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

"""The disturbance of an orbit that belongs to a Floquet multiplier, as a function of time.

On a gait ``x(t + T/m) = M x(t)``, M the change of places of the cells after T/m. So the
disturbances w that return as a multiple nu of themselves are those of the map over T/m in the
frame that changes places with the cells, and ``v(t + j T/m) = M^j Re(nu^j w(t))``.
"""

from collections.abc import Callable

from cpg_ros.dynamics.isotypic_split import split
from cpg_ros.dynamics.mesh import collocation
from cpg_ros.dynamics.mesh.floquet import Flow
from cpg_ros.dynamics.mesh.orbit import MeshOrbit
import numpy as np
from numpy.polynomial import polynomial


def mode(orbit: MeshOrbit, part: int, multiplier: complex
         ) -> Callable[[np.ndarray], np.ndarray]:
    """Return the disturbance with a multiplier, of size 1 at most.

    Args:
        orbit: of a network without delay.
        part: 0 for the gait's class, then the subspaces transverse to it, as in floquet.
        multiplier: about that of the disturbance over a period, not the trivial one.

    Returns:
        States, shape (points, components), as a function of times in cycles, shape (points,).

    """
    inside, outside = split(orbit.symmetry)
    columns, m = (inside, *outside)[part], orbit.symmetry.order
    flow = Flow(orbit)
    jacobians, answers = flow.solved(columns)
    steps, change = flow.on(columns)
    whole = np.eye(columns.shape[1])
    for step in steps:
        whole = step @ whole
    roots, vectors = np.linalg.eig((change.T @ whole).astype(complex))
    again = np.linalg.matrix_power(change, m)
    shares = np.einsum('ik,ij,jk->k', vectors.conj(), again, vectors)
    gaps = np.abs(shares * roots**m - multiplier)
    if part == 0:
        # The disturbance along the orbit.
        gaps[np.abs(roots - 1.0).argmin()] = np.inf
    nu, w = roots[gaps.argmin()], [vectors[:, gaps.argmin()]]
    for step in steps:
        w.append(step @ w[-1])
    left = np.array(w)
    inner = np.einsum('nsij,nj->nsi', answers, left[:-1])
    slopes = np.einsum('nsij,nsj->nsi', jacobians, inner)
    coefficients = collocation.power_coefficients(left[:-1], slopes, flow.lengths)
    size = float(np.abs(left).max())

    def path(theta: np.ndarray) -> np.ndarray:
        places = np.asarray(theta, dtype=float) * m
        turns = np.floor(places).astype(int)
        places = places - turns
        k = np.clip(np.searchsorted(orbit.mesh, places, side='right') - 1, 0,
                    orbit.mesh.size - 2)
        xi = (places - orbit.mesh[k]) / np.diff(orbit.mesh)[k]
        values = polynomial.polyval(xi[:, None], coefficients[:, k], tensor=False)
        out = (nu**turns[:, None] * values).real
        for turn in np.unique(turns):
            there = turns == turn
            out[there] = out[there] @ np.linalg.matrix_power(change, int(turn)).T
        return out @ columns.T / size

    return path
