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

"""Floquet multipliers of the gaits of networks with a delay, by a spectral method.

Along a gait a disturbance obeys ``z' = D(t) z + B(t) z(t - tau)`` with T-periodic Jacobians, under
which the subspaces of dynamics.isotypic.split are invariant. A history is given by values at
Chebyshev points of equal elements of [-tau, 0]. Elements of the same length cover a period, so
that a delayed value always lies at a point; the monodromy matrix maps the values of a history to
those a period later (Breda, Maset & Vermiglio 2012).
"""

from collections.abc import Callable
from contextlib import suppress
from functools import lru_cache
from typing import NamedTuple

from cpg_ros.dynamics.arclength import NoOrbit
from cpg_ros.dynamics.characteristic import chebyshev
from cpg_ros.dynamics.fourier import orbit as collocation
from cpg_ros.dynamics.fourier.orbit import equations, FourierOrbit, MAX_NODES, rows_of
from cpg_ros.dynamics.isotypic import split
from cpg_ros.dynamics.orbit import NOT_ISOLATED, Waveforms
from cpg_ros.networks.equations import Field, States
import numpy as np
import scipy

#: Size of the last harmonics at which the adjoint is resolved.
HARMONIC_TOLERANCE = 1e-9


def adjoint(orbit: FourierOrbit) -> Waveforms:
    """Return the adjoint's waveforms, in cycles per unit of each variable.

    Raises:
        NoOrbit: the orbit is not isolated, or more nodes are needed than are allowed.

    """
    symmetry = orbit.symmetry
    u = rows_of(orbit.network, symmetry, orbit.cycle(orbit.samples))
    class_sizes = np.repeat(np.bincount(symmetry.waves), orbit.network.variables)[:, None]
    while True:
        rows, n = u.shape
        _, jacobian, _ = equations(orbit.network, symmetry, u, orbit.period)
        last = np.zeros(rows * n + 1)
        last[-1] = 1.0
        try:
            by_residual = np.linalg.solve(jacobian.T, last)[:-1].reshape(u.shape)
        except np.linalg.LinAlgError as error:
            raise NoOrbit(NOT_ISOLATED) from error
        # A rate p added to one wave at all times changes 1/T by the mean of z p over its cells.
        values = -n * by_residual / (class_sizes * orbit.period**2)
        if max(collocation.tail(row) for row in values) <= HARMONIC_TOLERANCE:
            break
        if n >= 2 * MAX_NODES:
            raise NoOrbit(f'the phase response is too steep for {n} nodes')
        u = np.array([collocation.resample(row, 2 * n + 1) for row in u])
    variables = orbit.network.variables

    def waveform(theta: np.ndarray, wave: int = 0, variable: int = 0) -> np.ndarray:
        return collocation.evaluate(values[wave * variables + variable], theta)

    return waveform


#: Polynomial degree on an element; length of an element, in periods.
DEGREE, MAX_ELEMENT_LENGTH = 20, 0.4
#: Size of a matrix up to which all eigenvalues take no longer than the largest.
MAX_DENSE_SIZE = 90


POINTS, DERIVATIVE, _WEIGHTS = chebyshev(DEGREE)


def _interpolation(points: np.ndarray) -> np.ndarray:
    """Return the matrix from values at the points to those at places, (m, degree + 1)."""
    gaps = points[:, None] - POINTS
    exact = np.abs(gaps) < 1e-14
    rows = _WEIGHTS / np.where(exact, 1.0, gaps)
    rows /= rows.sum(axis=1, keepdims=True)
    return np.where(exact.any(axis=1, keepdims=True), exact.astype(float), rows)


class Variation:
    """The variational equation along an orbit, on elements of the length delay / n."""

    def __init__(self, orbit: FourierOrbit, n: int) -> None:
        network = orbit.network
        self.n, self.period, self.length = n, orbit.period, network.delay / n
        self.count = int(np.ceil(self.period / self.length * (1.0 - 1e-12)))
        times = (np.arange(self.count)[:, None] + POINTS[1:]) * self.length
        _, self.now, self.past = Field(network).linearised(orbit(times),
                                                           orbit(times - network.delay))
        self.inside, self.outside = split(orbit.symmetry)
        self._vectors: dict[int, np.ndarray] = {}

    def march(self, columns: np.ndarray, gain: float
              ) -> tuple[int, Callable[[np.ndarray], np.ndarray]]:
        """Return the map that takes histories in a subspace over a period.

        Args:
            columns: orthonormal, shape (components, d).
            gain: symmetry lock, 1/model time; 0 within the class.

        Returns:
            Length of a history, d (n degree + 1), and a function that takes k histories, shape
            (length, k), to values at the points of all elements from -tau on, shape
            (points, d, k), where neighbours share one.

        """
        d, degree = columns.shape[1], DEGREE
        size = d * (self.n * degree + 1)
        now = columns.T @ self.now @ columns - gain * np.eye(d)
        past = columns.T @ self.past @ columns
        system = np.zeros((self.count, degree, d, degree, d))
        system[:] = np.einsum('st,ij->sitj', DERIVATIVE[1:, 1:], np.eye(d)) / self.length
        s = np.arange(degree)
        system[:, s, :, s, :] -= now.transpose(1, 0, 2, 3)
        inverse = np.linalg.inv(system.reshape(self.count, degree * d, degree * d))

        def through(histories: np.ndarray) -> np.ndarray:
            k = histories.shape[1]
            values = np.empty(((self.n + self.count) * degree + 1, d, k))
            values[:self.n * degree + 1] = histories.reshape(-1, d, k)
            for element in range(self.count):
                start = (self.n + element) * degree
                nodes = values[element * degree + 1:(element + 1) * degree + 1]
                right = past[element] @ nodes - (
                    DERIVATIVE[1:, 0, None, None] / self.length * values[start])
                values[start + 1:start + degree + 1] = (
                    inverse[element] @ right.reshape(degree * d, k)).reshape(degree, d, k)
            return values

        return size, through

    def read(self, values: np.ndarray, times: np.ndarray) -> np.ndarray:
        """Interpolate values at the points of all elements, shape (points, d, k).

        Args:
            values: as march has them.
            times: from -tau to a period, over the length of an element, shape (m,).

        Returns:
            Values at the times, shape (m, d, k).

        """
        positions = np.asarray(times) + self.n
        elements = np.clip(positions.astype(int), 0, self.n + self.count - 1)
        nearby = elements[:, None] * DEGREE + np.arange(DEGREE + 1)
        return np.einsum('mk,mkds->mds', _interpolation(positions - elements), values[nearby])

    def period_map(self, columns: np.ndarray, gain: float
                   ) -> tuple[int, Callable[[np.ndarray], np.ndarray]]:
        """Return the map that takes histories in a subspace to those a period later.

        Args:
            columns: as of march.
            gain: as of march.

        Returns:
            Length of a history and a function of k histories, shape (length, k).

        """
        size, through = self.march(columns, gain)
        points = np.append((np.arange(self.n)[:, None] + POINTS[:-1]).ravel(), self.n)
        times = points - self.n + self.period / self.length

        def later(histories: np.ndarray) -> np.ndarray:
            return self.read(through(histories), times).reshape(histories.shape)

        return size, later

    def multipliers(self, columns: np.ndarray, gain: float, count: int | None, exact: float
                    ) -> np.ndarray:
        """Return the multipliers in a subspace, or the largest ones by Arnoldi's method.

        Args:
            columns: as of march.
            gain: as of march.
            count: number of multipliers, at least; None for all.
            exact: relative tolerance of Arnoldi's method.

        """
        size, later = self.period_map(columns, gain)
        if count is not None and size > MAX_DENSE_SIZE:
            arpack = scipy.sparse.linalg
            operator = arpack.LinearOperator((size, size),
                                             matvec=lambda x: later(x.reshape(-1, 1))[:, 0])
            # The eigenvectors at the last gain are a good start.
            start = self._vectors.get(id(columns), np.random.default_rng(0).standard_normal(size))
            with suppress(arpack.ArpackError):
                roots, vectors = arpack.eigs(operator, k=count, ncv=24, tol=exact, v0=start,
                                             maxiter=20)
                self._vectors[id(columns)] = vectors.real.sum(axis=1)
                return np.asarray(roots)
        return np.linalg.eigvals(later(np.eye(size)))


class Accuracy(NamedTuple):
    """Accuracy of multipliers with a delay.

    Attributes:
        leading: number of largest multipliers of each subspace, by Arnoldi's method; None for all.
        exact: relative tolerance of Arnoldi's method.
        trivial: error of the trivial multiplier above which the elements are halved.
        halvings: of the elements, at most.

    """

    leading: int | None
    exact: float
    trivial: float
    halvings: int


EXACT = Accuracy(None, 1e-10, 1e-9, 4)


def within(orbit: FourierOrbit, accuracy: Accuracy = EXACT) -> tuple[np.ndarray, complex]:
    """Return the multipliers within the gait's class, without the trivial one, and that one."""
    roots = variation(orbit, accuracy)[1]
    trivial = int(np.abs(roots - 1.0).argmin())
    return np.delete(roots, trivial), complex(roots[trivial])


def transverse(orbit: FourierOrbit, gain: float = 0.0, accuracy: Accuracy = EXACT
               ) -> tuple[np.ndarray, ...]:
    """Return the multipliers of each subspace transverse to the class, with a symmetry lock."""
    equation = variation(orbit, accuracy)[0]
    return tuple(equation.multipliers(columns, gain, accuracy.leading, accuracy.exact)
                 for columns in equation.outside)


def largest_transverse(orbit: FourierOrbit, gain: float = 0.0, exact: float = 1e-10) -> float:
    """Return the largest modulus of the transverse multipliers, to a relative error, or 0."""
    equation = variation(orbit)[0]
    return max((float(np.abs(equation.multipliers(part, gain, 2, exact)).max())
                for part in equation.outside), default=0.0)


@lru_cache(maxsize=4)
def variation(orbit: FourierOrbit, accuracy: Accuracy = EXACT) -> tuple[Variation, np.ndarray]:
    """Return a sufficiently fine variational equation and the multipliers within the class."""
    n = max(1, int(np.ceil(orbit.network.delay / (MAX_ELEMENT_LENGTH * orbit.period))))
    for halving in range(accuracy.halvings):
        equation = Variation(orbit, n * 2**halving)
        roots = equation.multipliers(equation.inside, 0.0, accuracy.leading, accuracy.exact)
        if np.abs(roots - 1.0).min() <= accuracy.trivial:
            break
    return equation, roots


def mode(orbit: FourierOrbit, part: int, multiplier: complex
         ) -> Callable[[np.ndarray], np.ndarray]:
    """Return the disturbance with a multiplier as a function of time, with largest value 1.

    It is the eigenvector of the multiplier, a history, continued over a period by the variational
    equation.

    Args:
        orbit: of a network with a delay.
        part: 0 for the gait's class, then the transverse subspaces, as in transverse.
        multiplier: approximate, real and not the trivial one.

    Returns:
        States, shape (points, components), as a function of times in cycles, shape (points,).

    """
    equation = variation(orbit)[0]
    columns = (equation.inside, *equation.outside)[part]
    size, through = equation.march(columns, 0.0)
    roots, vectors = np.linalg.eig(equation.period_map(columns, 0.0)[1](np.eye(size)))
    gaps = np.abs(roots - multiplier)
    if part == 0:
        # The disturbance along the orbit.
        gaps[np.abs(roots - 1.0).argmin()] = np.inf
    nearest = gaps.argmin()
    values = through(vectors[:, [nearest]].real)
    values /= np.abs(values).max()
    nu = float(roots[nearest].real)

    def path(theta: np.ndarray) -> np.ndarray:
        periods = np.floor(theta)
        times = (theta - periods) * orbit.period / equation.length
        return nu**periods[:, None] * equation.read(values, times)[..., 0] @ columns.T

    return path


#: The matrices are dense.
MAX_UNKNOWNS = 4096


class Variational:
    """The variational equation of an orbit in all components, on its nodes or on more.

    Attributes:
        at: states at the nodes now and a delay ago, shape (n, components) each.
        slope: their derivatives by time.
        delay: model time.
        unusable: reason why the derivatives of the rates do not describe disturbances, or ''.

    """

    def __init__(self, orbit: FourierOrbit, halvings: int = 0) -> None:
        """Linearise about an orbit.

        Args:
            orbit: of a network with a delay.
            halvings: of the distances of nodes.

        Raises:
            NoOrbit: there would be more unknowns than there may be.

        """
        network = orbit.network
        n = (orbit.samples + 1) * 2**halvings - 1
        if n > 2 * MAX_NODES + 1 or n * network.components > MAX_UNKNOWNS:
            raise NoOrbit('the waveform is too steep')
        self._orbit, self._n, self.delay = orbit, n, network.delay
        self._times = np.arange(n) / n * orbit.period
        late = self._times - self.delay
        self.at: States = orbit(self._times), orbit(late)
        self.slope: States = orbit.derivative(self._times), orbit.derivative(late)
        field: Field = Field(network)
        _, self._now, self._past = field.linearised(*self.at)
        self._shift = collocation.shift_matrix(n, -self.delay / orbit.period)
        self.unusable = 'the rates have kinks' if network.kinks else ''

    def critical(self, part: int, multiplier: complex) -> tuple[complex, np.ndarray]:
        """Return the factor of the disturbance with a multiplier, and a guess at it.

        Args:
            part: number of its subspace, as in mode.
            multiplier: over a period.

        Returns:
            The factor, and the disturbance at the unknowns, shape (n components,).

        """
        # The real part of a pair is enough for a guess.
        values = mode(self._orbit, part, multiplier)(self._times / self._orbit.period)
        return multiplier, (values * self._wave(multiplier, -1.0)).ravel()

    def _sigma(self, factor: complex) -> complex:
        return complex(np.log(complex(factor))) / self._orbit.period

    def _wave(self, factor: complex, sign: float) -> np.ndarray:
        return np.exp(sign * self._sigma(factor) * self._times)[:, None]

    def along(self) -> np.ndarray:
        """Return the derivative of the orbit by time at the unknowns, shape (n components,)."""
        return self.slope[0].ravel()

    def matrix(self, factor: complex) -> np.ndarray:
        """Return the matrix of the unknowns.

        Args:
            factor: over a period.

        """
        n, d = self.at[0].shape
        sigma, nodes = self._sigma(factor), np.arange(n)
        matrix = np.zeros((n, d, n, d), dtype=complex)
        derive = collocation.derivative_matrix(n) / self._orbit.period + sigma * np.eye(n)
        for k in range(d):
            matrix[:, k, :, k] = derive
        matrix[nodes, :, nodes, :] -= self._now
        matrix -= (np.exp(-sigma * self.delay) * self._shift)[:, None, :, None] * self._past[
            :, :, None, :]
        return matrix.reshape(n * d, n * d)

    def right(self, rates: np.ndarray, factor: complex) -> np.ndarray:
        """Return the right-hand side for sources at the nodes, shape (n components,)."""
        return (rates * self._wave(factor, -1.0)).ravel()

    def values(self, unknowns: np.ndarray, rates: np.ndarray, factor: complex) -> States:
        """Return a solution at the nodes, now and a delay ago.

        Args:
            unknowns: shape (n components,).
            rates: the sources, which are in the unknowns already.
            factor: over a period.

        """
        periodic, sigma = unknowns.reshape(self._n, -1), self._sigma(factor)
        return (periodic * self._wave(factor, 1.0),
                self._shift @ periodic * np.exp(sigma * (self._times - self.delay))[:, None])

    def derivative(self, values: States, factor: complex) -> States:
        """Return the derivative by time of a disturbance, now and a delay ago."""
        sigma = self._sigma(factor)
        derive = collocation.derivative_matrix(self._n) / self._orbit.period
        waves = np.exp(sigma * self._times)[:, None]
        now, past = (waves * (derive @ (state / waves)) + sigma * state
                     for state in values if state is not None)
        return now, past

    def delayed(self, values: States) -> np.ndarray:
        """Return the contribution of the state a delay ago to the rates."""
        assert values[1] is not None
        sources: np.ndarray = np.einsum('tij,tj->ti', self._past, values[1])
        return sources
