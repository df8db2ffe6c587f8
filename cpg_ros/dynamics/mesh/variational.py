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

"""The variational equation along a gait of a network without delay, with sources, as a matrix.

``y' = J(t) y + r(t)`` over T/m with ``y(T/m) = turn M y(0)``, M the change of places of the cells
after T/m, by the orbit's own collocation. What happens inside intervals is eliminated; the values
at the mesh points are the unknowns of a sparse matrix, which does not mind that some disturbances
grow or decay by many orders of magnitude over T/m.
"""

from cpg_ros.dynamics.mesh import collocation
from cpg_ros.dynamics.mesh.adaptation import kinks
from cpg_ros.dynamics.mesh.floquet import returning
from cpg_ros.dynamics.mesh.newton import path_of, Reduced
from cpg_ros.dynamics.mesh.orbit import MeshOrbit
from cpg_ros.networks.field import Field, States
import numpy as np
import scipy


class Variational:
    """The variational equation of an orbit in all components, on its mesh or a finer one.

    Attributes:
        at: states at the nodes, shape (n, S, components), and None.
        slope: their derivatives by time.
        delay: 0.

    """

    delay = 0.0

    def __init__(self, orbit: MeshOrbit, halvings: int = 0) -> None:
        """Linearise about an orbit.

        Args:
            orbit: of a network without delay.
            halvings: of the intervals.

        """
        reduced, mesh = Reduced(orbit.network, orbit.symmetry), orbit.mesh
        for _ in range(halvings):
            mesh = np.sort(np.concatenate([mesh, 0.5 * (mesh[:-1] + mesh[1:])]))
        self._orbit, self._mesh, self._reduced = orbit, mesh, reduced
        self._lengths = np.diff(mesh) * orbit.solution.length
        places = mesh[:-1, None] + np.diff(mesh)[:, None] * collocation.NODES
        states = path_of(reduced, orbit.solution)(places.ravel()).reshape(*places.shape, -1)
        self.at: States = states[..., reduced.place], None
        field: Field = Field(orbit.network)
        rates, self._jacobians, _ = field.linearised(self.at[0])
        self.slope: States = rates, None
        n, s, d = rates.shape
        self._shape = n, s, d
        self._turn = (orbit.symmetry.turn
                      + np.arange(orbit.network.variables)[:, None] * orbit.network.cells).ravel()
        matrices = np.eye(s * d) - np.einsum('i,pq,iqrc->iprqc', self._lengths, collocation.A,
                                             self._jacobians).reshape(n, s * d, s * d)
        self._inverse = np.linalg.inv(matrices)
        self._answers = (self._inverse @ np.tile(np.eye(d), (s, 1))).reshape(n, s, d, d)
        self._steps = np.eye(d) + self._summed(self._jacobians @ self._answers)

    def _summed(self, values: np.ndarray) -> np.ndarray:
        """Integrate values at the nodes over every interval."""
        return np.einsum('i,s,is...->i...', self._lengths, collocation.WEIGHTS, values)

    @property
    def flaw(self) -> str:
        """Why derivatives of the rates do not tell how disturbances interact, or ''."""
        met = bool(self._orbit.network.kinks) and kinks(self._reduced, self._orbit.solution).size
        return 'the rates have kinks' if met else ''

    def critical(self, part: int, multiplier: complex) -> tuple[complex, np.ndarray]:
        """Return the factor over T/m of the disturbance with a multiplier, and about that.

        Args:
            part: number of its subspace, as in floquet.mode.
            multiplier: about that over a period.

        Returns:
            The factor, and the disturbance at the unknowns, shape (n components,).

        """
        columns, nu, left = returning(self._orbit, part, multiplier)
        values = left @ columns.T
        # On a finer mesh a guess is enough.
        rough = [np.interp(self._mesh[:-1], self._orbit.mesh, row) for row in values.T]
        return nu, np.array(rough).T.ravel()

    def along(self) -> np.ndarray:
        """Return the derivative of the orbit by time at the unknowns, shape (n components,)."""
        points = path_of(self._reduced, self._orbit.solution)(self._mesh[:-1])
        return self._reduced.rates(points)[:, self._reduced.place].ravel()

    def matrix(self, turn: complex) -> 'scipy.sparse.csc_array':
        """Return the matrix of the unknowns.

        Args:
            turn: factor over T/m.

        """
        n, _, d = self._shape
        ones = scipy.sparse.eye_array(d, format='csr', dtype=complex)
        rows: list[list] = [[None] * n for _ in range(n)]
        for k in range(n):
            rows[k][k] = scipy.sparse.csr_array(-self._steps[k])
            # With a single interval both fall together.
            ahead = ones if k < n - 1 else turn * ones[self._turn]
            before = rows[k][(k + 1) % n]
            rows[k][(k + 1) % n] = ahead if before is None else before + ahead
        return scipy.sparse.block_array(rows, format='csc', dtype=complex)

    def right(self, rates: np.ndarray, turn: complex) -> np.ndarray:
        """Return the right-hand side for sources at the nodes, shape (n components,)."""
        inner = self._inner(rates)
        summed = np.einsum('isjk,isk->isj', self._jacobians, inner) + rates
        return self._summed(summed).ravel()

    def _inner(self, rates: np.ndarray) -> np.ndarray:
        n, s, d = self._shape
        given = self._lengths[:, None, None] * np.einsum('pq,iqd->ipd', collocation.A, rates)
        return (self._inverse @ given.reshape(n, s * d, 1)).reshape(n, s, d)

    def values(self, unknowns: np.ndarray, rates: np.ndarray, turn: complex) -> States:
        """Return a solution at the nodes, now and a delay ago.

        Args:
            unknowns: shape (n components,).
            rates: the sources.
            turn: factor over T/m.

        """
        left = unknowns.reshape(self._shape[0], -1)
        return np.einsum('isjk,ik->isj', self._answers, left) + self._inner(rates), None

    def derivative(self, values: States, turn: complex) -> States:
        """Return the derivative by time of a disturbance, by the variational equation."""
        return np.einsum('isjk,isk->isj', self._jacobians, values[0]), None

    def delayed(self, values: States) -> np.ndarray:
        """Return what the part a delay ago adds to the rates: nothing."""
        return np.zeros_like(values[0])
