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

"""Gaits of the networks without delay as periodic orbits, by Gauss collocation on a mesh.

On a gait the cells of one class under K are equal, and after T/m, m the order of H/K, the classes
are permuted. The network therefore reduces to one cell of each class and 1/m of the period, with
the boundary condition ``y(T/m) = Pi y(0)`` and the period as unknown. Newton's method eliminates
each interval's inner values, which leaves a linear system in y(0) and T. Secondary gaits, with two
waveforms, are solved in the same way.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property

from cpg_ros.common.errors import ShortRepr
from cpg_ros.dynamics.arclength import NoOrbit
from cpg_ros.dynamics.mesh import collocation
from cpg_ros.dynamics.mesh.collocation import chained, summed, transfer
from cpg_ros.dynamics.orbit import deflation_factor, Orbit
from cpg_ros.networks.equations import Field
from cpg_ros.networks.network import Network
from cpg_ros.networks.symmetry import Symmetry
import numpy as np
from numpy.polynomial import polynomial

#: Relative size of the last terms of the polynomials at which a mesh is resolved.
INTERVAL_TOLERANCE = 1e-11
MIN_INTERVALS, MAX_INTERVALS = 12, 800
#: Intervals of a first mesh; positions in each at which the curvature of the guess is evaluated.
FIRST_INTERVALS, GUESS_POINTS = 30, 17
#: Relative size of Newton's step at which it stops; the remaining error is of order its
#: square.
TOLERANCE = 1e-8
NEWTON_ITERATIONS = 15


class Reduced(Field):
    """A network on the gait's Fix(K): one cell of each class.

    Attributes:
        symmetry: of the gait.
        permutation: ``y(T/m) = y(0)[permutation]``.

    """

    def __init__(self, network: Network, symmetry: Symmetry) -> None:
        """Prepare for a network in a gait."""
        super().__init__(network, symmetry.classes)
        first = self.kept[:self.size]
        blocks = np.arange(network.variables)[:, None]
        self.symmetry = symmetry.with_leads(network.leads)
        self.permutation = (symmetry.classes[symmetry.permutation[first]]
                            + blocks * self.size).ravel()


@dataclass(eq=False, repr=False)
class Solution(ShortRepr):
    """Unknowns of Newton's method: values at mesh points and at nodes, and L = T/m."""

    mesh: np.ndarray
    points: np.ndarray
    stages: np.ndarray
    length: float


def linearised(reduced: Reduced, now: Solution, extra: np.ndarray | None = None
               ) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Linearise: return increments at mesh points as functions of (dy0, dL, extras).

    The answer is (P, R, stage answer to dy, stage answer to the sources): dy_k = P_k dy_0 +
    R_k (dL, 1, extras...).
    """
    h = np.diff(now.mesh)
    slopes, jacobians, _ = reduced.linearised(now.stages)
    step, d = now.length * h, slopes.shape[-1]
    by_length = h[:, None, None] * (collocation.A @ slopes)
    rise = h[:, None] * (collocation.WEIGHTS @ slopes)
    sources = [by_length[..., None],
               (now.points[:-1, None] + now.length * by_length - now.stages)[..., None]]
    ends = [rise[..., None], (now.points[:-1] + now.length * rise - now.points[1:])[..., None]]
    if extra is not None:
        n, s = extra.shape[:2]
        flat = extra.reshape(n, s, -1)
        sources.append(step[:, None, None, None] * (collocation.A @ flat).reshape(extra.shape))
        ends.append(step[:, None, None] * (collocation.WEIGHTS @ flat).reshape(n, d, -1))
    answers = transfer(jacobians, step, np.concatenate(sources, axis=-1))
    steps = summed(jacobians, step, answers)
    steps[..., :d] += np.eye(d)
    steps[..., d:] += np.concatenate(ends, axis=-1)
    reached = chained(steps)
    return reached[..., :d], reached[..., d:], answers[..., :d], answers[..., d:]


def bordered(reduced: Reduced, now: Solution, p: np.ndarray, r: np.ndarray) -> np.ndarray:
    """Return the matrix of boundary and phase conditions in (dy_0, dL)."""
    d = p.shape[-1]
    matrix = np.zeros((d + 1, d + 1))
    matrix[:d, :d] = p[-1] - np.eye(d)[reduced.permutation]
    matrix[:d, d] = r[-1, :, 0]
    matrix[d, :d] = reduced.linearised(now.points[0])[1][0]
    return matrix


def newton(reduced: Reduced, now: Solution, periods: Sequence[float] = ()) -> bool:
    """Solve on a fixed mesh, in place; return whether it converged.

    Args:
        reduced: the network in a gait.
        now: guess; overwritten by the solution.
        periods: lengths T/m of orbits to keep away from, model time.

    """
    scale = np.abs(now.points).max()
    d, longest = now.points.shape[1], 20.0 * now.length
    for _ in range(2 * NEWTON_ITERATIONS if periods else NEWTON_ITERATIONS):
        try:
            p, r, by_start, by_source = linearised(reduced, now)
            right = np.empty(d + 1)
            right[:d] = now.points[0, reduced.permutation] - now.points[-1] - r[-1, :, 1]
            right[d] = -reduced.rates(now.points[0])[0]
            solution = np.linalg.solve(bordered(reduced, now, p, r), right)
        except np.linalg.LinAlgError:
            return False
        start, length = solution[:d], solution[d]
        moved = p @ start + r[..., 0] * length + r[..., 1]
        inner = (np.einsum('nsij,nj->nsi', by_start, moved[:-1]) + by_source[..., 0] * length
                 + by_source[..., 1])
        size = float(max(np.abs(moved).max() / scale, np.abs(inner).max() / scale,
                         abs(length) / now.length))
        if not np.isfinite(size):
            return False
        # A long first step would leave the range where cosh is tame.
        fraction = min(1.0, 0.5 / max(size, 1e-300))
        if periods and size > TOLERANCE:
            fraction *= deflation_factor(now.length, float(length), periods)
        now.points += fraction * moved
        now.stages += fraction * inner
        now.length += fraction * float(length)
        if not 0.0 < now.length < longest:
            return False
        if size <= TOLERANCE:
            return True
    return False


def sampled(path: Callable[[np.ndarray], np.ndarray], mesh: np.ndarray, length: float) -> Solution:
    """Return a guess at the points of a mesh from a path over the places 0 to 1."""
    inner = mesh[:-1, None] + np.diff(mesh)[:, None] * collocation.NODES
    return Solution(mesh, path(mesh), path(inner.ravel()).reshape(*inner.shape, -1), length)


def coefficients_of(reduced: Reduced, now: Solution) -> np.ndarray:
    """Return the coefficients of the polynomials on each interval, shape (S + 1, n, d)."""
    return collocation.power_coefficients(now.points[:-1], reduced.rates(now.stages),
                                          now.length * np.diff(now.mesh))


def path_of(reduced: Reduced, now: Solution) -> Callable[[np.ndarray], np.ndarray]:
    """Return the solution as a function of places from 0 to 1."""
    coefficients = coefficients_of(reduced, now)

    def path(positions: np.ndarray) -> np.ndarray:
        k = np.clip(np.searchsorted(now.mesh, positions, side='right') - 1, 0, now.mesh.size - 2)
        xi = (positions - now.mesh[k]) / np.diff(now.mesh)[k]
        return polynomial.polyval(xi[:, None], coefficients[:, k], tensor=False)
    return path


def finer(mesh: np.ndarray) -> int:
    """Return the smallest number of intervals of the next mesh where this one fell short."""
    n = mesh.size - 1
    return n + 1 + n // 16


def remeshed(reduced: Reduced, now: Solution, fewest: int = MIN_INTERVALS) -> np.ndarray | None:
    """Return a better mesh for a solution, or None if it is resolved.

    Raises:
        NoOrbit: more intervals are needed than are allowed.

    """
    h, slopes = np.diff(now.mesh), reduced.rates(now.stages)
    ends = collocation.last_fraction(slopes) * now.length * h / np.abs(now.points).max()
    if ends.max() <= INTERVAL_TOLERANCE:
        return None
    needed = (1.25 * (ends**(1.0 / collocation.S)).mean()
              / INTERVAL_TOLERANCE**(1.0 / collocation.S) * h.size)
    # `needed` is NaN if the solution is not finite.
    if not max(fewest, needed) <= MAX_INTERVALS:
        raise NoOrbit(f'the waveform is too steep for {MAX_INTERVALS} intervals')
    return collocation.spread(now.mesh, ends**(1.0 / collocation.S) / h, max(fewest, int(needed)))


def first_mesh(reduced: Reduced, path: Callable[[np.ndarray], np.ndarray],
               intervals: int = FIRST_INTERVALS, steps: np.ndarray | None = None) -> np.ndarray:
    """Return a mesh of few intervals for a path over the places 0 to 1, by how it bends.

    Args:
        reduced: the network in a gait.
        path: states of its cells.
        intervals: their number.
        steps: of the simulation that gave the path, in cycles, whose density counts instead.

    """
    if steps is not None:
        ends = steps * reduced.symmetry.order
        ends = ends[(ends > 0.0) & (ends < 1.0)]
        return np.concatenate([[0.0], ends[::max(1, ends.size // intervals)], [1.0]])
    positions = np.linspace(0.0, 1.0, GUESS_POINTS * intervals + 1)
    bend = np.abs(np.diff(reduced.rates(path(positions)), axis=0)).max(axis=1)
    return collocation.spread(positions, np.sqrt(bend + 1e-3 * bend.max() + 1e-300), intervals)


def derivatives(reduced: Reduced, now: Solution) -> tuple[np.ndarray, np.ndarray]:
    """Differentiate a solution by the network's parameters.

    Returns:
        Those of the polynomials, shape (S + 1, n, d, parameters), and those of the period.

    Raises:
        NoOrbit: its equations are singular.

    """
    extra = reduced.by_parameter(now.stages)
    try:
        p, r, by_start, by_source = linearised(reduced, now, extra)
        right = np.vstack([-r[-1, :, 2:], -reduced.by_parameter(now.points[0])[0]])
        solution = np.linalg.solve(bordered(reduced, now, p, r), right)
    except np.linalg.LinAlgError as error:
        raise NoOrbit('the orbit is not isolated: it has no derivatives') from error
    start, d_length = solution[:-1], solution[-1]
    moved = p @ start + r[..., :1] * d_length + r[..., 2:]
    inner = (by_start @ moved[:-1, None] + by_source[..., :1] * d_length + by_source[..., 2:])
    h = np.diff(now.mesh)
    # Slopes in place: d(L F)/dp at the nodes.
    slopes, jacobians, _ = reduced.linearised(now.stages)
    d_slopes = now.length * (jacobians @ inner + extra) + slopes[..., None] * d_length
    d_coefficients = h[:, None, None] * np.einsum('sq,nsdp->qndp', collocation.INTEGRALS, d_slopes)
    d_coefficients[0] += moved[:-1]

    d_period = reduced.symmetry.order * d_length
    # One cell of each class has seen only those of its family's weights that end on it.
    names = reduced.network.parameters()
    for family in reduced.network.families(reduced.symmetry):
        members = [names.index(name) for name in family]
        d_period[members] = d_period[members].mean()
        d_coefficients[..., members] = d_coefficients[..., members].mean(axis=-1, keepdims=True)
    return d_coefficients, d_period


# Orbits as polynomials on a mesh: the gaits of the networks without delay.

#: Even points of a cycle that resolve a relaxation oscillation.
SAMPLES = 8192
#: Positions in an interval, 0 to 1, at which the residual is computed.
RESIDUAL_POSITIONS = np.array([0.02, 0.3, 0.5, 0.7, 0.98])


@dataclass(frozen=True, eq=False, repr=False)
class MeshOrbit(Orbit):
    """An orbit as polynomials on a mesh.

    Attributes:
        mesh: ends of the intervals over T/m, from 0 to 1, shape (n + 1,).
        stages: reduced states at the nodes, shape (n, S, d).
        coefficients: of the polynomials on each interval, shape (S + 1, n, d).

    """

    mesh: np.ndarray
    stages: np.ndarray
    coefficients: np.ndarray

    def _summary(self) -> str:
        return f'{super()._summary()}, {self.mesh.size - 1} intervals'

    @property
    def solution(self) -> Solution:
        """The orbit as the unknowns of Newton's method."""
        ends = np.vstack([self.coefficients[0], self.coefficients[:, -1].sum(axis=0)])
        return Solution(self.mesh, ends, self.stages, self.period / self.symmetry.order)

    def refined(self) -> 'MeshOrbit':
        """As of Orbit."""
        reduced, now = Reduced(self.network, self.symmetry), self.solution
        middles = 0.5 * (self.mesh[:-1] + self.mesh[1:])
        finer = sampled(path_of(reduced, now), np.sort(np.append(self.mesh, middles)), now.length)
        if not newton(reduced, finer):
            raise NoOrbit('the orbit is lost on a mesh twice as fine')
        return completed(reduced, finer)

    @cached_property
    def _derivatives(self) -> tuple[np.ndarray, np.ndarray]:
        return derivatives(Reduced(self.network, self.symmetry), self.solution)

    @property
    def d_period(self) -> np.ndarray:
        """Derivatives of the period by the network's parameters, shape (parameters,)."""
        return self._derivatives[1]

    @property
    def d_coefficients(self) -> np.ndarray:
        """Derivatives of the coefficients by the parameters, at fixed theta.

        The shape is (S + 1, n, d, parameters). Weights that the symmetry maps to each other act as
        one: each has an equal part of the effect of all.
        """
        return self._derivatives[0]

    def waveform(self, theta: np.ndarray, order: int = 0, wave: int = 0, variable: int = 0
                 ) -> np.ndarray:
        """Return a waveform, or its derivative in theta of order 1 or 2, at theta in cycles."""
        return evaluate(self.symmetry, self.mesh, self.coefficients, theta, order=order, wave=wave,
                        variable=variable)

    def d_waveform(self, theta: np.ndarray, wave: int = 0, variable: int = 0) -> np.ndarray:
        """Return the derivatives by the parameters, shape theta.shape + (parameters,)."""
        return evaluate(self.symmetry, self.mesh, self.d_coefficients, theta, wave=wave,
                        variable=variable)

    @property
    def samples(self) -> int:
        """Number of evenly spaced points that resolve a waveform."""
        return SAMPLES

    @property
    def between(self) -> np.ndarray:
        """Times inside the intervals of T/m, model time, shape (5 n,)."""
        positions = self.mesh[:-1, None] + np.diff(self.mesh)[:, None] * RESIDUAL_POSITIONS
        return positions.ravel() * self.solution.length


def completed(reduced: Reduced, now: Solution) -> MeshOrbit:
    """Make an orbit of a solution."""
    return MeshOrbit(reduced.network, reduced.symmetry, reduced.symmetry.order * now.length,
                     now.mesh, now.stages, coefficients_of(reduced, now))


def columns_of(symmetry: Symmetry, wave: int, variable: int) -> list[int]:
    """Return the columns of the reduced state that hold u_wave, in each m-th of the cycle."""
    columns, cell = [], int(symmetry.first[wave])
    for _ in range(symmetry.order):
        columns.append(int(symmetry.classes[cell] + variable * (symmetry.classes.max() + 1)))
        cell = int(symmetry.permutation[cell])
    return columns


def evaluate(symmetry: Symmetry, mesh: np.ndarray, coefficients: np.ndarray, theta: np.ndarray, *,
             order: int = 0, wave: int = 0, variable: int = 0) -> np.ndarray:
    """Evaluate a waveform, or its derivative in theta, from polynomials on a mesh.

    Args:
        symmetry: of the gait.
        mesh: ends of the intervals over T/m, from 0 to 1, shape (n + 1,).
        coefficients: of reduced states on each interval, shape (terms, n, d, ...).
        theta: cycles, any shape.
        order: of the derivative, 0 for the value.
        wave: index of the waveform.
        variable: of the cell.

    Returns:
        Values of shape theta.shape + (...).

    """
    theta = np.asarray(theta, dtype=float) - symmetry.phases[symmetry.first[wave]]
    positions = (theta - np.floor(theta)) * symmetry.order
    part = np.minimum(positions.astype(int), symmetry.order - 1)
    positions = positions - part
    interval = np.clip(np.searchsorted(mesh, positions, side='right') - 1, 0, mesh.size - 2)
    length = np.diff(mesh)[interval]
    xi = (positions - mesh[interval]) / length
    column = np.array(columns_of(symmetry, wave, variable))[part]
    terms = coefficients
    for _ in range(order):
        terms = terms[1:] * np.arange(1, terms.shape[0]).reshape(-1, *[1] * (terms.ndim - 1))
    picked = terms[:, interval, column]
    xi = xi.reshape(xi.shape + (1,) * (picked.ndim - 1 - xi.ndim))
    out = np.zeros(picked.shape[1:])
    for term in picked[::-1]:
        out = out * xi + term
    return out * ((symmetry.order / length)**order).reshape(xi.shape)
