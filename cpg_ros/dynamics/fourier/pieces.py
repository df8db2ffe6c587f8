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

"""Steep orbits with a delay: piecewise polynomials where trigonometric ones need too many nodes.

The equations are those of ``fourier.orbit``, collocated at the Gauss points of the intervals of a
mesh, as DDE-BIFTOOL does (Engelborghs, Luzyanina, in 't Hout & Roose, SIAM J. Sci. Comput. 22,
2001). Their matrix is sparse. The phase condition is an integral one, as plateaus have no peak.
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import Any, ClassVar

from cpg_ros.common.errors import ShortRepr
from cpg_ros.dynamics.characteristic import chebyshev
from cpg_ros.dynamics.fourier.orbit import complete, converge, FourierOrbit
from cpg_ros.dynamics.mesh.collocation import NODES, S, spread
from cpg_ros.networks.network import Network
from cpg_ros.networks.symmetry import Symmetry
import numpy as np
import scipy

#: Points of an interval, [0, 1], by whose values a polynomial of degree S is given.
POINTS, _DERIVE, _WEIGHTS = chebyshev(S)
#: Matrix from these values to the last Chebyshev coefficients, the size of what is left out.
_TAIL = np.linalg.inv(np.polynomial.chebyshev.chebvander(2.0 * POINTS - 1.0, S))[-2:]
#: Waveforms, shape (rows, m), as a function of theta in cycles, shape (m,).
Rows = Callable[[np.ndarray], np.ndarray]
#: MIN_INTERVALS: of the first mesh; GUESS_POINTS: of a cycle, at which the guess is evaluated.
MIN_INTERVALS, MAX_INTERVALS, GUESS_POINTS = 40, 600, 8192
#: Over the range: size of the last terms at which an interval is resolved; by how much the start
#: may miss cell 1's peak. MAX_ITERATIONS: number of meshes.
INTERVAL_TOLERANCE, PEAK_TOLERANCE, MAX_ITERATIONS = 1e-11, 1e-9, 12


@dataclass(frozen=True, eq=False, repr=False)
class Pieces(ShortRepr):
    """Piecewise polynomials on a cycle, with the methods of fourier.orbit.Nodes.

    Attributes:
        ends: of the intervals, from 0 to 1, shape (intervals + 1,).
        guess: at cell 1's first variable at the nodes, whose phase is kept, shape (n,).

    """

    ends: np.ndarray
    guess: np.ndarray
    tolerance: ClassVar[float] = 1e-10

    def _summary(self) -> str:
        return f'{self.ends.size - 1} intervals'

    def finer(self, values: np.ndarray) -> tuple['Pieces', np.ndarray]:
        """As of Nodes."""
        ends = np.sort(np.append(self.ends, 0.5 * (self.ends[:-1] + self.ends[1:])))
        nodes = nodes_of(ends, POINTS[:-1])
        return Pieces(ends, self.evaluate(values, nodes)), nodes

    @cached_property
    def _collocated(self) -> np.ndarray:
        return nodes_of(self.ends, NODES)

    def matrix(self, theta: np.ndarray, order: int = 0) -> scipy.sparse.csr_array:
        """Return the matrix from the numbers to values or derivatives at theta, (m, n)."""
        theta = theta - np.floor(theta)
        k = np.clip(np.searchsorted(self.ends, theta, side='right') - 1, 0, self.ends.size - 2)
        lengths = np.diff(self.ends)[k]
        gaps = ((theta - self.ends[k]) / lengths)[:, None] - POINTS
        exact = np.abs(gaps) < 1e-14
        rows = _WEIGHTS / np.where(exact, 1.0, gaps)
        rows = np.where(exact.any(axis=1)[:, None], exact, rows / rows.sum(axis=1)[:, None])
        rows = rows @ np.linalg.matrix_power(_DERIVE, order) / lengths[:, None]**order
        n = S * (self.ends.size - 1)
        columns = (S * k[:, None] + np.arange(S + 1)) % n
        return scipy.sparse.csr_array((rows.ravel(), columns.ravel(),
                                       (S + 1) * np.arange(theta.size + 1)), (theta.size, n))

    @cached_property
    def derive(self) -> scipy.sparse.csr_array:
        """As of Nodes."""
        return self.matrix(self._collocated, 1)

    def moved(self, shift: float) -> scipy.sparse.csr_array:
        """As of Nodes."""
        return self.matrix(self._collocated + shift)

    def slope(self, values: np.ndarray, shift: float) -> np.ndarray:
        """As of Nodes."""
        return self.matrix(self._collocated + shift, 1) @ values

    @cached_property
    def _along(self) -> np.ndarray:
        """Return the guess's derivative as weights of the numbers, shape (n,)."""
        rises = (self.derive @ self.guess) * np.repeat(np.diff(self.ends), S)
        return np.asarray(rises @ self.moved(0.0)) / np.abs(rises).max()

    def jacobian(self, blocks: dict[tuple[int, int], Any], by_period: np.ndarray
                 ) -> scipy.sparse.csc_array:
        """As of Nodes."""
        rows, n = by_period.shape
        whole = [[blocks.get((row, source), scipy.sparse.csr_array((n, n)))
                  for source in range(rows)] + [by_period[row][:, None]] for row in range(rows)]
        last = [self._along[None], *[np.zeros((1, n))] * (rows - 1), np.zeros((1, 1))]
        return scipy.sparse.block_array([*whole, last], format='csc')

    def phase(self, values: np.ndarray) -> float:
        """As of Nodes; the guess has the phase."""
        return float(self._along @ (values - self.guess))

    def solve(self, jacobian: scipy.sparse.csc_array, right: np.ndarray) -> np.ndarray:
        """As of Nodes."""
        try:
            return np.asarray(scipy.sparse.linalg.splu(jacobian).solve(right))
        except RuntimeError as error:
            raise np.linalg.LinAlgError(str(error)) from error

    def evaluate(self, values: np.ndarray, theta: np.ndarray, order: int = 0) -> np.ndarray:
        """As of Nodes."""
        flat = np.asarray(theta, dtype=float)
        return np.asarray(self.matrix(flat.ravel(), order) @ values).reshape(flat.shape)


def nodes_of(ends: np.ndarray, positions: np.ndarray) -> np.ndarray:
    """Return the same positions, 0 to 1, in all intervals, in cycles."""
    return (ends[:-1, None] + np.diff(ends)[:, None] * positions).ravel()


def solve(network: Network, symmetry: Symmetry, rows: Rows, period: float
          ) -> FourierOrbit | None:
    """Solve for a steep orbit from a guess, on meshes that fit it; None if it fails.

    Args:
        network: parameters.
        symmetry: of the gait.
        rows: waveforms, shape (rows, m), as a function of theta in cycles, shape (m,).
        period: guess, model time.

    """
    positions = np.linspace(0.0, 1.0, GUESS_POINTS + 1)
    values = rows(positions[:-1])
    bend = np.abs(np.roll(values, -1, 1) - 2.0 * values + np.roll(values, 1, 1))
    bend = (bend / np.ptp(values, axis=1)[:, None]).max(axis=0)
    ends = spread(positions, np.sqrt(bend + 1e-6 * bend.max()), MIN_INTERVALS)
    for _ in range(MAX_ITERATIONS):
        u = rows(nodes_of(ends, POINTS[:-1]))
        basis = Pieces(ends, u[0])
        solved = converge(network, symmetry, u, period, basis)
        if solved is None:
            return None
        start, left = _peak(basis, solved.u[0]), _left_out(solved.u)
        if not start and left.max() <= INTERVAL_TOLERANCE:
            return complete(network, symmetry, *solved, basis)
        ends, period = _remeshed(ends, left, start), solved.period
        if ends.size - 1 > MAX_INTERVALS:
            return None

        def rows(theta: np.ndarray, old: Pieces = basis, u: np.ndarray = solved.u,
                 start: float = start) -> np.ndarray:
            return np.array([old.evaluate(row, theta + start) for row in u])

    return None


def _peak(basis: Pieces, values: np.ndarray) -> float:
    """Return theta of the largest value, or 0 if it is at the start."""
    fine = basis.evaluate(values, np.arange(GUESS_POINTS) / GUESS_POINTS)
    if fine.max() <= values[0] + PEAK_TOLERANCE * np.ptp(fine):
        return 0.0
    start = fine.argmax() / GUESS_POINTS
    slope, bend = (float(basis.evaluate(values, np.array([start]), order)[0]) for order in (1, 2))
    return start + float(np.clip(-slope / bend, -1.0 / GUESS_POINTS, 1.0 / GUESS_POINTS)
                         ) if bend else start


def _left_out(u: np.ndarray) -> np.ndarray:
    """Return the size of the last terms of each interval over the range, shape (intervals,)."""
    values = u.reshape(len(u), -1, S)
    values = np.concatenate([values, np.roll(values, -1, axis=1)[:, :, :1]], axis=2)
    ends = np.abs(values @ _TAIL.T).max(axis=2)
    return np.asarray((ends / np.ptp(u, axis=1)[:, None]).max(axis=0))


def _remeshed(ends: np.ndarray, left: np.ndarray, start: float) -> np.ndarray:
    """Return a mesh from another start that fits a solution."""
    shares = (left / INTERVAL_TOLERANCE)**(1.0 / S)
    turned = np.unique([0.0, *(ends[:-1] - start) % 1.0, 1.0])
    middles = (0.5 * (turned[:-1] + turned[1:]) + start) % 1.0
    k = np.clip(np.searchsorted(ends, middles) - 1, 0, left.size - 1)
    n = left.size + (1 + left.size // 16 if left.max() > INTERVAL_TOLERANCE else 0)
    return spread(turned, (shares / np.diff(ends))[k], max(n, int(1.25 * shares.sum())))
