"""Floquet multipliers of the gaits of networks with a delay: the variational equation, spectrally.

Along a gait a disturbance obeys ``z' = D(t) z + B(t) z(t - tau)`` with T-periodic Jacobians, which
keep the subspaces apart that symmetry does (dynamics.isotypic_split). A history is held at
Chebyshev points of equal elements of [-tau, 0]. Elements of the same length march over a period,
so that a delayed value always lies at a point; the monodromy matrix takes the values of one
history to those a period later (Breda, Maset & Vermiglio 2012).
"""

from functools import lru_cache

import numpy as np

from cpg_ros.dynamics.fourier.orbit import FourierOrbit
from cpg_ros.dynamics.isotypic_split import split
from cpg_ros.networks.field import Field

#: Polynomial degree on an element, and how much of a period one holds at most.
DEGREE, SPAN = 20, 0.3
#: Elements are halved until the trivial multiplier is 1 to this.
TRIVIAL = 1e-9
HALVINGS = 4


def _differentiation(degree: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Chebyshev points of [0, 1], the derivative matrix there, and barycentric weights."""
    k = np.arange(degree + 1)
    points = 0.5 * (1.0 - np.cos(np.pi * k / degree))
    weights = (-1.0) ** k
    weights[[0, -1]] *= 0.5
    gaps = points[:, None] - points + np.eye(degree + 1)
    matrix = weights / weights[:, None] / gaps
    np.fill_diagonal(matrix, 0.0)
    np.fill_diagonal(matrix, -matrix.sum(axis=1))
    return points, matrix, weights


POINTS, DERIVATIVE, _WEIGHTS = _differentiation(DEGREE)


def _interpolation(places: np.ndarray) -> np.ndarray:
    """Matrix from values at the points to values at places in [0, 1], shape (m, degree + 1)."""
    gaps = places[:, None] - POINTS
    exact = np.abs(gaps) < 1e-14
    rows = _WEIGHTS / np.where(exact, 1.0, gaps)
    rows /= rows.sum(axis=1, keepdims=True)
    return np.where(exact.any(axis=1, keepdims=True), exact.astype(float), rows)


class Variation:
    """The variational equation along an orbit, on elements of which n hold a delay."""

    def __init__(self, orbit: FourierOrbit, n: int) -> None:
        network = orbit.network
        self.n, self.period, self.length = n, orbit.period, network.delay / n
        self.count = int(np.ceil(self.period / self.length * (1.0 - 1e-12)))
        times = (np.arange(self.count)[:, None] + POINTS[1:]) * self.length
        _, self.now, self.past = Field(network).linearised(orbit(times),
                                                           orbit(times - network.delay))
        self.inside, self.outside = split(orbit.symmetry)

    def monodromy(self, columns: np.ndarray, gain: float) -> np.ndarray:
        """Return the matrix that takes a history in a subspace to the one a period later.

        Args:
            columns: orthonormal, shape (components, d).
            gain: symmetry lock, 1/model time; 0 within the class.

        Returns:
            A matrix of size d (n degree + 1).

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
        # Values at the points of all elements, as linear functions of the first history's.
        values = np.zeros(((self.n + self.count) * degree + 1, d, size))
        values[:self.n * degree + 1] = np.eye(size).reshape(-1, d, size)
        for element in range(self.count):
            start = (self.n + element) * degree
            heard = values[element * degree + 1:(element + 1) * degree + 1]
            right = past[element] @ heard - (
                DERIVATIVE[1:, 0, None, None] / self.length * values[start])
            values[start + 1:start + degree + 1] = (
                inverse[element] @ right.reshape(degree * d, size)).reshape(degree, d, size)
        # Where the last history lies among the elements.
        points = np.append((np.arange(self.n)[:, None] + POINTS[:-1]).ravel(), self.n)
        places = points + self.period / self.length
        elements = np.minimum(places.astype(int), self.n + self.count - 1)
        rows = _interpolation(places - elements)
        nearby = values[elements[:, None] * degree + np.arange(degree + 1)]
        return np.einsum('mk,mkds->mds', rows, nearby).reshape(size, size)

    def transverse(self, gain: float) -> tuple[np.ndarray, ...]:
        """Return the multipliers of each subspace transverse to the class, with a lock."""
        return tuple(np.linalg.eigvals(self.monodromy(columns, gain)) for columns in self.outside)


def within(orbit: FourierOrbit) -> tuple[np.ndarray, complex]:
    """Return the multipliers within the gait's class but the trivial one, and that."""
    found = variation(orbit)[1]
    place = int(np.abs(found - 1.0).argmin())
    return np.delete(found, place), complex(found[place])


def transverse(orbit: FourierOrbit, gain: float = 0.0) -> tuple[np.ndarray, ...]:
    """Return the multipliers of each subspace transverse to the class, with a symmetry lock."""
    return variation(orbit)[0].transverse(gain)


@lru_cache(maxsize=4)
def variation(orbit: FourierOrbit) -> tuple[Variation, np.ndarray]:
    """Return the variational equation, fine enough, and the multipliers within the class."""
    n = max(1, int(np.ceil(orbit.network.delay / (SPAN * orbit.period))))
    for halving in range(HALVINGS):
        equation = Variation(orbit, n * 2**halving)
        within = np.linalg.eigvals(equation.monodromy(equation.inside, 0.0))
        if np.abs(within - 1.0).min() <= TRIVIAL:
            break
    return equation, within
