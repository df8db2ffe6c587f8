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

"""Variational equation of gaits without delay: adjoint, Floquet multipliers, forced solutions.

A gait lies in Fix(K), K its spatial symmetries. Fix(K) and its orthogonal complement are invariant
under the linearised flow, so the multipliers split into those within the class, 1 among them, and
those transverse to it. The symmetry lock -g (I - P) x adds -g on the complement: it multiplies the
transverse multipliers by exp(-g T) exactly.

The multiplier 1 belongs to the direction of the flow. The others of the class are computed across
the flow, so that they stay separate at a fold, where 1 is double.
"""

from functools import lru_cache
from itertools import pairwise

from cpg_ros.dynamics.arclength import NoOrbit
from cpg_ros.dynamics.isotypic import split
from cpg_ros.dynamics.mesh import collocation
from cpg_ros.dynamics.mesh.collocation import addresses, chained, solver, summed, transfer
from cpg_ros.dynamics.mesh.orbit import evaluate, MAX_INTERVALS, MeshOrbit, path_of, Reduced
from cpg_ros.dynamics.mesh.solve import kinks
from cpg_ros.dynamics.orbit import NOT_ISOLATED, Waveforms
from cpg_ros.networks.equations import Field, States
import numpy as np
import scipy

#: Relative size of the last terms of its polynomials at which an interval is resolved.
INTERVAL_TOLERANCE = 1e-9
#: Singular value below which a disturbance other than along the orbit does not decay.
SINGULAR_TOLERANCE = 1e-9


def adjoint(orbit: MeshOrbit) -> Waveforms:
    """Return the adjoint's waveforms, in cycles per unit of each variable.

    Raises:
        NoOrbit: the orbit is not isolated, or more intervals are needed than are allowed.

    """
    mesh, symmetry = orbit.mesh, orbit.symmetry
    while True:
        coefficients, unresolved = _on_mesh(orbit, mesh)
        if not unresolved.any():
            break
        if mesh.size + unresolved.sum() > 4 * MAX_INTERVALS:
            raise NoOrbit('the phase response is too steep to be resolved')
        middles = 0.5 * (mesh[:-1] + mesh[1:])[unresolved]
        mesh = np.sort(np.concatenate([mesh, middles]))
    fine = mesh

    def waveform(theta: np.ndarray, wave: int = 0, variable: int = 0) -> np.ndarray:
        return evaluate(symmetry, fine, coefficients, theta, wave=wave, variable=variable)

    return waveform


def _on_mesh(orbit: MeshOrbit, mesh: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the adjoint's polynomials, (S + 1, n, d), and which intervals are too long."""
    reduced, length = Reduced(orbit.network, orbit.symmetry), orbit.solution.length
    lengths = length * np.diff(mesh)
    positions = mesh[:-1, None] + np.diff(mesh)[:, None] * collocation.NODES
    states = path_of(reduced, orbit.solution)(positions.ravel()).reshape(*positions.shape, -1)
    jacobians = reduced.linearised(states)[1]
    # Backwards in time.
    back = np.ascontiguousarray(jacobians[::-1, ::-1].swapaxes(2, 3))
    try:
        answers = transfer(back, lengths[::-1], np.zeros((*back.shape[:3], 0)))
        d = back.shape[-1]
        steps = np.eye(d) + summed(back, lengths[::-1], answers)
        whole = chained(steps)
        # z(L) = z(0)[permutation], and z along the flow 1/T.
        start = orbit.solution.points[-1]
        matrix = np.vstack([whole[-1, reduced.permutation] - np.eye(d),
                            orbit.period * reduced.rates(start)])
        end, _, _, sizes = np.linalg.lstsq(matrix, np.append(np.zeros(d), 1.0), rcond=None)
    except np.linalg.LinAlgError as error:
        raise NoOrbit(NOT_ISOLATED) from error
    if not sizes[-1] > SINGULAR_TOLERANCE:
        raise NoOrbit(NOT_ISOLATED)
    points = whole @ end
    slopes = -np.einsum('nsij,nsjk,nk->nsi', back, answers, points[:-1])[::-1, ::-1]
    coefficients = collocation.power_coefficients(points[::-1][:-1], slopes, lengths)
    ends = collocation.last_fraction(slopes) * lengths / np.abs(points).max()
    # The cells of a class share its response.
    class_sizes = np.tile(np.bincount(orbit.symmetry.classes), orbit.network.variables)
    return coefficients / class_sizes, ends > INTERVAL_TOLERANCE


# Eigenvalues of a product of many matrices, each relative to its own size.

#: Distance below which two subspaces are the same.
SUBSPACE_TOLERANCE = 1e-13
#: Of the eigenvalues of a block.
MAX_SIZE_RATIO = 1e4
MAX_ITERATIONS = 40


def eigenvalues(factors: np.ndarray) -> np.ndarray:
    """Return the eigenvalues of ``F_n ... F_2 F_1``.

    Args:
        factors: F_1, F_2 ..., shape (n, d, d).

    Returns:
        Complex numbers, shape (d,); nan where they overflow.

    """
    factors, d = np.ascontiguousarray(factors), factors.shape[-1]
    # Generic columns, which lie in no invariant subspace.
    columns = np.ascontiguousarray(np.linalg.qr(np.random.default_rng(0).normal(size=(d, d)))[0])
    work = np.empty((3, d, d))
    for _ in range(MAX_ITERATIONS):
        start, whole = columns.copy(), np.eye(d)
        solver().mesh_round(len(factors), d, *addresses(factors, columns, whole, work))
        back = start.T @ columns
        if not np.isfinite(back).all():
            return np.full(d, np.nan, dtype=complex)
        cuts = [0, *(k for k in range(1, d)
                     if np.abs(back[k:, :k]).max() <= SUBSPACE_TOLERANCE), d]
        blocks = [slice(*ends) for ends in pairwise(cuts)]
        sizes = [np.abs(np.diag(whole)[block]) for block in blocks]
        if all(size.max() <= MAX_SIZE_RATIO * size.min() for size in sizes):
            break
    return np.concatenate([
        np.linalg.eigvals(back[block, block] @ whole[block, block]).astype(complex)
        for block in blocks])


def within(orbit: MeshOrbit, accuracy: object = None) -> tuple[np.ndarray, complex]:
    """Return the multipliers within the gait's class, without the trivial one, and that one."""
    roots, _, trivial = multipliers(orbit)
    return roots, complex(trivial)


def transverse(orbit: MeshOrbit, gain: float = 0.0, accuracy: object = None
               ) -> tuple[np.ndarray, ...]:
    """Return the multipliers of each subspace transverse to the class, with a symmetry lock."""
    return tuple(part * np.exp(-gain * orbit.period) for part in multipliers(orbit)[1])


def largest_transverse(orbit: MeshOrbit, gain: float = 0.0, exact: float = 0.0) -> float:
    """Return the largest modulus of the transverse multipliers, 0 if there is none."""
    return max((float(np.abs(part).max()) for part in transverse(orbit, gain)), default=0.0)


@lru_cache(maxsize=4)
def multipliers(orbit: MeshOrbit) -> tuple[np.ndarray, tuple[np.ndarray, ...], float]:
    """Return the multipliers within the class, transverse to it, and the trivial one, no lock."""
    m, (inside, outside) = orbit.symmetry.order, split(orbit.symmetry)
    linear = Flow(orbit)
    steps, change = linear.on(inside)
    network = Reduced(orbit.network, orbit.symmetry)
    points = np.vstack([orbit.coefficients[0], orbit.coefficients[:, -1].sum(axis=0)])
    rates = network.rates(points)[:, network.columns] @ inside
    sizes = np.linalg.norm(rates, axis=1)
    along = rates / sizes[:, None]
    # Growth along the flow: 1 up to the error of the collocation.
    along_flow = np.einsum('ni,nij,nj->n', along[1:], steps, along[:-1]) * sizes[:-1] / sizes[1:]
    across = _across(along)
    inner = across[1:].transpose(0, 2, 1) @ steps @ across[:-1]
    back = across[0].T @ change.T @ across[-1]
    # After T/m the cells have changed places; m of these make a period.
    roots = eigenvalues(np.concatenate([inner, back[None]] * m))
    transverse = []
    for columns in outside:
        steps, change = linear.on(columns)
        # After m changes a cell is another one of its class.
        again = np.linalg.matrix_power(change, m)
        transverse.append(eigenvalues(np.concatenate([*[steps, change.T[None]] * m, again[None]])))
    return roots, tuple(transverse), float(np.prod(along_flow)**m)


class Flow:
    """The linearised flow along an orbit, over T/m."""

    def __init__(self, orbit: MeshOrbit) -> None:
        """Linearise about an orbit."""
        symmetry, network = orbit.symmetry, orbit.network
        index = Reduced(network, symmetry).columns
        self._jacobians = network.jacobian(orbit.stages[..., index])
        #: Lengths of the intervals, model time.
        self.lengths = np.diff(orbit.mesh) * orbit.period / symmetry.order
        self._permutation = (symmetry.permutation
                             + np.arange(network.variables)[:, None] * network.cells).ravel()

    def on(self, columns: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return the flow over each interval, and the permutation of cells after T/m.

        Args:
            columns: orthonormal, of a subspace that the flow keeps, shape (components, d).

        Returns:
            Matrices of the intervals, shape (n, d, d), and x -> x[permutation], shape (d, d).

        """
        jacobians, answers = self.solved(columns)
        steps = np.eye(columns.shape[1]) + summed(jacobians, self.lengths, answers)
        return steps, columns.T @ columns[self._permutation]

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


def returning(orbit: MeshOrbit, part: int, multiplier: complex
              ) -> tuple[np.ndarray, complex, np.ndarray]:
    """Return the disturbance with a multiplier, and its factor over T/m.

    On a gait ``x(t + T/m) = M x(t)``, M the permutation of the cells. Disturbances w that grow by
    a factor nu are eigenvectors of the map over T/m in the frame that is permuted with the cells,
    and ``v(t + j T/m) = M^j Re(nu^j w(t))``.

    Args:
        orbit: of a network without delay.
        part: 0 for the gait's class, then the transverse subspaces, as in transverse.
        multiplier: approximate, over a period, not the trivial one.

    Returns:
        Orthonormal columns of the subspace, shape (components, d); nu; w at the mesh points in
            these columns, shape (n + 1, d).

    """
    inside, outside = split(orbit.symmetry)
    columns, m = (inside, *outside)[part], orbit.symmetry.order
    steps, change = Flow(orbit).on(columns)
    whole = np.eye(columns.shape[1])
    for step in steps:
        whole = step @ whole
    roots, vectors = np.linalg.eig((change.T @ whole).astype(complex))
    again = np.linalg.matrix_power(change, m)
    fractions = np.einsum('ik,ij,jk->k', vectors.conj(), again, vectors)
    gaps = np.abs(fractions * roots**m - multiplier)
    if part == 0:
        # The disturbance along the orbit.
        gaps[np.abs(roots - 1.0).argmin()] = np.inf
    nu, w = roots[gaps.argmin()], [vectors[:, gaps.argmin()]]
    for step in steps:
        w.append(step @ w[-1])
    return columns, complex(nu), np.array(w)


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
        positions = mesh[:-1, None] + np.diff(mesh)[:, None] * collocation.NODES
        states = path_of(reduced, orbit.solution)(positions.ravel()).reshape(*positions.shape, -1)
        self.at: States = states[..., reduced.columns], None
        field: Field = Field(orbit.network)
        rates, self._jacobians, _ = field.linearised(self.at[0])
        self.slope: States = rates, None
        n, s, d = rates.shape
        self._shape = n, s, d
        network = orbit.network
        self._permutation = (orbit.symmetry.permutation
                             + np.arange(network.variables)[:, None] * network.cells).ravel()
        matrices = np.eye(s * d) - np.einsum('i,pq,iqrc->iprqc', self._lengths, collocation.A,
                                             self._jacobians).reshape(n, s * d, s * d)
        self._inverse = np.linalg.inv(matrices)
        self._answers = (self._inverse @ np.tile(np.eye(d), (s, 1))).reshape(n, s, d, d)
        self._steps = np.eye(d) + self._summed(self._jacobians @ self._answers)

    def _summed(self, values: np.ndarray) -> np.ndarray:
        """Integrate values at the nodes over every interval."""
        return np.einsum('i,s,is...->i...', self._lengths, collocation.WEIGHTS, values)

    @property
    def unusable(self) -> str:
        """Reason why derivatives of the rates do not describe disturbances, or ''."""
        kink = bool(self._orbit.network.kinks) and kinks(self._reduced, self._orbit.solution).size
        return 'the rates have kinks' if kink else ''

    def critical(self, part: int, multiplier: complex) -> tuple[complex, np.ndarray]:
        """Return the factor over T/m of the disturbance with a multiplier, and a guess at it.

        Args:
            part: number of its subspace, as in returning.
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
        return self._reduced.rates(points)[:, self._reduced.columns].ravel()

    def matrix(self, factor: complex) -> 'scipy.sparse.csc_array':
        """Return the matrix of the unknowns.

        Args:
            factor: over T/m.

        """
        n, _, d = self._shape
        ones = scipy.sparse.eye_array(d, format='csr', dtype=complex)
        rows: list[list] = [[None] * n for _ in range(n)]
        for k in range(n):
            rows[k][k] = scipy.sparse.csr_array(-self._steps[k])
            # With a single interval both are the same block.
            ahead = ones if k < n - 1 else factor * ones[self._permutation]
            before = rows[k][(k + 1) % n]
            rows[k][(k + 1) % n] = ahead if before is None else before + ahead
        return scipy.sparse.block_array(rows, format='csc', dtype=complex)

    def right(self, rates: np.ndarray, factor: complex) -> np.ndarray:
        """Return the right-hand side for sources at the nodes, shape (n components,)."""
        inner = self._inner(rates)
        summed = np.einsum('isjk,isk->isj', self._jacobians, inner) + rates
        return self._summed(summed).ravel()

    def _inner(self, rates: np.ndarray) -> np.ndarray:
        n, s, d = self._shape
        sources = self._lengths[:, None, None] * np.einsum('pq,iqd->ipd', collocation.A, rates)
        return (self._inverse @ sources.reshape(n, s * d, 1)).reshape(n, s, d)

    def values(self, unknowns: np.ndarray, rates: np.ndarray, factor: complex) -> States:
        """Return a solution at the nodes, now and a delay ago.

        Args:
            unknowns: shape (n components,).
            rates: the sources.
            factor: over T/m.

        """
        left = unknowns.reshape(self._shape[0], -1)
        return np.einsum('isjk,ik->isj', self._answers, left) + self._inner(rates), None

    def derivative(self, values: States, factor: complex) -> States:
        """Return the derivative by time of a disturbance, by the variational equation."""
        return np.einsum('isjk,isk->isj', self._jacobians, values[0]), None

    def delayed(self, values: States) -> np.ndarray:
        """Return the contribution of the state a delay ago to the rates: 0."""
        return np.zeros_like(values[0])
