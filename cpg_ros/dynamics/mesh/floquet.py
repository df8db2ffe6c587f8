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

"""Floquet multipliers of the gaits of networks without delay.

A gait lies in Fix(K), K its spatial symmetries. Along it the linearised flow keeps Fix(K) and its
orthogonal complement apart, so the multipliers split: those within the class, 1 among them, and
those transverse to it. The symmetry lock -g (I - P) x adds -g on the complement and nothing else:
it multiplies the transverse multipliers by exp(-g T) exactly.

The multiplier 1 belongs to the direction of the flow, which is known. The others of the class are
those of what is left across it, so that none of them is mixed up with it at a fold, where it is
double.
"""

from collections.abc import Callable
from functools import lru_cache

from cpg_ros.dynamics.isotypic_split import split
from cpg_ros.dynamics.mesh import collocation
from cpg_ros.dynamics.mesh.elimination import summed, transfer
from cpg_ros.dynamics.mesh.newton import Reduced
from cpg_ros.dynamics.mesh.orbit import MeshOrbit
from cpg_ros.dynamics.mesh.periodic_schur import eigenvalues
import numpy as np
from numpy.polynomial import polynomial


def within(orbit: MeshOrbit) -> tuple[np.ndarray, complex]:
    """Return the multipliers within the gait's class but the trivial one, and that."""
    found, _, trivial = multipliers(orbit)
    return found, complex(trivial)


def transverse(orbit: MeshOrbit, gain: float = 0.0) -> tuple[np.ndarray, ...]:
    """Return the multipliers of each subspace transverse to the class, with a symmetry lock."""
    return tuple(part * np.exp(-gain * orbit.period) for part in multipliers(orbit)[1])


def largest_transverse(orbit: MeshOrbit, gain: float = 0.0, exact: float = 0.0) -> float:
    """Return the modulus of the largest of them, 0 if there is none; always as exact as can be."""
    return max((float(np.abs(part).max()) for part in transverse(orbit, gain)), default=0.0)


@lru_cache(maxsize=4)
def multipliers(orbit: MeshOrbit) -> tuple[np.ndarray, tuple[np.ndarray, ...], float]:
    """Return the multipliers within the class, transverse to it, and the trivial one, no lock.

    They come from the variational equation, by the orbit's own collocation.
    """
    m, (inside, outside) = orbit.symmetry.order, split(orbit.symmetry)
    linear = Flow(orbit)
    steps, change = linear.on(inside)
    network = Reduced(orbit.network, orbit.symmetry)
    points = np.vstack([orbit.coefficients[0], orbit.coefficients[:, -1].sum(axis=0)])
    rates = network.rates(points)[:, network.place] @ inside
    sizes = np.linalg.norm(rates, axis=1)
    along = rates / sizes[:, None]
    # What is left of the way along the flow: 1, but for what collocation makes wrong.
    kept = np.einsum('ni,nij,nj->n', along[1:], steps, along[:-1]) * sizes[:-1] / sizes[1:]
    across = _across(along)
    inner = across[1:].transpose(0, 2, 1) @ steps @ across[:-1]
    back = across[0].T @ change.T @ across[-1]
    # After T/m the cells have changed places; m of these make a period.
    found = eigenvalues(np.concatenate([inner, back[None]] * m))
    others = []
    for columns in outside:
        steps, change = linear.on(columns)
        # After m changes a cell is another one of its class.
        again = np.linalg.matrix_power(change, m)
        others.append(eigenvalues(np.concatenate([*[steps, change.T[None]] * m, again[None]])))
    return found, tuple(others), float(np.prod(kept)**m)


class Flow:
    """The linearised flow along an orbit, over T/m."""

    def __init__(self, orbit: MeshOrbit) -> None:
        """Linearise about an orbit."""
        symmetry, network = orbit.symmetry, orbit.network
        place = Reduced(network, symmetry).place
        self._jacobians = network.jacobian(orbit.stages[..., place])
        #: Lengths of the intervals, model time.
        self.lengths = np.diff(orbit.mesh) * orbit.period / symmetry.order
        self._turn = (symmetry.turn
                      + np.arange(network.variables)[:, None] * network.cells).ravel()

    def on(self, columns: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return the flow over each interval, and how cells change places after T/m.

        Args:
            columns: orthonormal, of a subspace that the flow keeps, shape (components, d).

        Returns:
            Matrices of the intervals, shape (n, d, d), and x -> x[turn], shape (d, d).

        """
        jacobians, answers = self.solved(columns)
        steps = np.eye(columns.shape[1]) + summed(jacobians, self.lengths, answers)
        return steps, columns.T @ columns[self._turn]

    def solved(self, columns: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return Jacobians and flow at the nodes of each interval, shape (n, S, d, d) each."""
        jacobians = columns.T @ (self._jacobians @ columns)
        return jacobians, transfer(jacobians, self.lengths, np.zeros((*jacobians.shape[:3], 0)))


def _across(along: np.ndarray) -> np.ndarray:
    """Orthonormal columns that are normal to unit vectors, by reflection, (n, d, d - 1)."""
    mirror = along.copy()
    mirror[:, 0] += np.where(along[:, 0] < 0.0, -1.0, 1.0)
    mirror /= np.linalg.norm(mirror, axis=1)[:, None]
    return (np.eye(along.shape[1]) - 2.0 * mirror[:, :, None] * mirror[:, None, :])[:, :, 1:]


def mode(orbit: MeshOrbit, part: int, multiplier: complex
         ) -> Callable[[np.ndarray], np.ndarray]:
    """Return the disturbance with a multiplier as a function of time, of size 1 at most.

    On a gait ``x(t + T/m) = M x(t)``, M the change of places of the cells after T/m. So the
    disturbances w that return as a multiple nu of themselves are those of the map over T/m in the
    frame that changes places with the cells, and ``v(t + j T/m) = M^j Re(nu^j w(t))``.

    Args:
        orbit: of a network without delay.
        part: 0 for the gait's class, then the subspaces transverse to it, as in transverse.
        multiplier: about that of the disturbance over a period, not the trivial one.

    Returns:
        States, shape (points, components), as a function of times in cycles, shape (points,).

    """
    columns, nu, left = returning(orbit, part, multiplier)
    flow, m = Flow(orbit), orbit.symmetry.order
    jacobians, answers = flow.solved(columns)
    change = flow.on(columns)[1]
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


def returning(orbit: MeshOrbit, part: int, multiplier: complex
              ) -> tuple[np.ndarray, complex, np.ndarray]:
    """Return the disturbance with a multiplier, and what it is multiplied by over T/m.

    Args:
        orbit: as of mode.
        part: as of mode.
        multiplier: as of mode.

    Returns:
        Orthonormal columns of the subspace, shape (components, d); nu; and w of mode at the
        mesh points in these columns, shape (n + 1, d).

    """
    inside, outside = split(orbit.symmetry)
    columns, m = (inside, *outside)[part], orbit.symmetry.order
    steps, change = Flow(orbit).on(columns)
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
    return columns, complex(nu), np.array(w)
