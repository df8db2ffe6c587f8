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

"""The variational equation about an orbit where it is singular: null vectors and answers.

Its matrix M(turn) belongs to disturbances that return as ``turn`` times themselves. Where some
return so without any source, M is singular, and is bordered by their null vectors (Govaerts,
*Numerical Methods for Bifurcations of Dynamical Equilibria*, 2000, chapter 3).
"""

from functools import partial
from typing import Any

from cpg_ros.dynamics.orbit_method import orbit_method
from cpg_ros.dynamics.periodic import NoOrbit, Orbit
from cpg_ros.networks.field import Field, States
import numpy as np
import scipy

#: How often null vectors are taken for the borders by which they are found anew.
ROUNDS = 2


class _Bordered:
    """``[[matrix, columns], [conj(rows), 0]]``, factorised; rows and columns of shape (k, n)."""

    def __init__(self, matrix: np.ndarray | scipy.sparse.csc_array, rows: np.ndarray,
                 columns: np.ndarray) -> None:
        self._shape = matrix.shape[0], len(rows)
        if isinstance(matrix, np.ndarray):
            corner = np.zeros((len(rows), len(rows)))
            factors = scipy.linalg.lu_factor(np.block([[matrix, columns.T],
                                                       [rows.conj(), corner]]))
            self._solve: Any = partial(scipy.linalg.lu_solve, factors)
        else:
            whole = scipy.sparse.block_array([[matrix, columns.T], [rows.conj(), None]],
                                             format='csc') if len(rows) else matrix
            lu = scipy.sparse.linalg.splu(whole)
            self._solve = lambda right, trans: lu.solve(right, 'NTH'[trans])

    def answer(self, right: np.ndarray) -> np.ndarray:
        """Return the answer that is normal to the rows, shape (n,) as the right-hand side."""
        n, k = self._shape
        found: np.ndarray = self._solve(np.append(right, np.zeros(k)).astype(complex), trans=0)
        return found[:n]

    def null(self, adjoint: bool) -> np.ndarray:
        """Return the matrix's right or left null vectors, of length 1, shape (k, n)."""
        n, k = self._shape
        found = self._solve(np.eye(n + k, k, -n, dtype=complex), trans=2 * adjoint)[:n].T
        return found / np.linalg.norm(found, axis=1)[:, None]


class Linearised:
    """Disturbances of an orbit, with those that return as multiples of themselves.

    Attributes:
        equation: the variational equation.

    """

    def __init__(self, orbit: Orbit, halvings: int) -> None:
        """Linearise about an orbit, on its mesh halved so many times.

        Raises:
            NoOrbit: its rates have no derivatives, or there are too many unknowns.

        """
        self.equation = orbit_method(orbit.network).variational.Variational(orbit, halvings)
        if self.equation.flaw:
            raise NoOrbit(self.equation.flaw)
        self._field: Field = Field(orbit.network)
        self._systems: dict[complex, tuple[_Bordered, np.ndarray]] = {}

    def find(self, turn: complex, guesses: np.ndarray) -> np.ndarray:
        """Return all disturbances that return as a factor of themselves, shape (k, n).

        Args:
            turn: the factor.
            guesses: of them at the unknowns, shape (k, n).

        """
        matrix = self.equation.matrix(turn)
        rights = lefts = guesses / np.linalg.norm(guesses, axis=1)[:, None]
        for _ in range(ROUNDS):
            system = _Bordered(matrix, rights, lefts)
            rights, lefts = system.null(False), system.null(True)
        self._systems[turn] = _Bordered(matrix, rights, lefts), lefts
        return rights

    def shares(self, turn: complex, rates: np.ndarray) -> np.ndarray:
        """Return what of sources none can answer to, for each left null vector, shape (k,)."""
        return self._systems[turn][1].conj() @ self.equation.right(rates, turn)

    def solve(self, rates: np.ndarray, turn: complex) -> States:
        """Return the disturbance that sources make which return as a factor of themselves."""
        if turn not in self._systems:
            none = np.zeros((0, self.equation.along().size))
            self._systems[turn] = _Bordered(self.equation.matrix(turn), none, none), none
        found = self._systems[turn][0].answer(self.equation.right(rates, turn))
        return self.equation.values(found, rates, turn)

    def second(self, a: States, b: States) -> np.ndarray:
        """Return the rates' second derivative B(a, b) along the orbit."""
        return self._field.multilinear(self.equation.at, a, b)

    def third(self, a: States, b: States, c: States) -> np.ndarray:
        """Return the rates' third derivative C(a, b, c) along the orbit."""
        return self._field.multilinear(self.equation.at, a, b, c)

    def moved(self, y: States) -> np.ndarray:
        """Return ``E y = y + tau B y(t - tau)``."""
        return y[0] + self.equation.delay * self.equation.delayed(y)

    def late(self, y: States) -> States:
        """Return ``tau y(t - tau)`` as a disturbance that is there a delay ago only."""
        past = None if y[1] is None else self.equation.delay * y[1]
        return np.zeros_like(y[0]), past
