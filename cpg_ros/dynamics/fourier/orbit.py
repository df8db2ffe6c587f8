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

"""Gaits of networks with a delay as periodic orbits, by Fourier collocation.

On a gait every cell has one of a few waveforms, shifted by a known phase. The delay equations
reduce to a periodic problem for one cell of each waveform: with theta = t / T in cycles,
``u'(theta)/T = f(u(theta), u_w(theta + phi), u_w(theta + phi - tau/T))`` for a cell's inputs,
solved at even nodes with the period as unknown. Cell 1 peaks at phase zero.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import Any, ClassVar, NamedTuple, TypeAlias

from cpg_ros.dynamics.arclength import NoOrbit
from cpg_ros.dynamics.orbit import deflation_factor, Orbit
from cpg_ros.networks.equations import equations_of, values_of
from cpg_ros.networks.network import Network
from cpg_ros.networks.symmetry import Symmetry
import numpy as np

# Trigonometric collocation on one period: n odd, nodes theta_m = m / n, theta in cycles.

def _waves(n: int) -> np.ndarray:
    """Return the factors by which d/dtheta multiplies the harmonics, shape ((n + 1) / 2,)."""
    return 2j * np.pi * np.arange((n + 1) // 2)


@lru_cache(maxsize=16)
def _circulant(n: int) -> np.ndarray:
    """Return the index in the first column of each entry of a circulant matrix, shape (n, n)."""
    return (np.arange(n)[:, None] - np.arange(n)) % n


@lru_cache(maxsize=16)
def derivative_matrix(n: int) -> np.ndarray:
    """Return the matrix of d/dtheta on nodal values, shape (n, n)."""
    return np.fft.irfft(_waves(n), n)[_circulant(n)]


@lru_cache(maxsize=16)
def shift_matrix(n: int, shift: float) -> np.ndarray:
    """Return the matrix from nodal values of u to those of u(theta + shift), shape (n, n)."""
    return np.fft.irfft(np.exp(_waves(n) * shift), n)[_circulant(n)]


def evaluate(values: np.ndarray, theta: np.ndarray, order: int = 0,
             shifts: np.ndarray | None = None) -> np.ndarray:
    """Evaluate the interpolant, or its derivative of the given order in theta.

    Args:
        values: nodal values, shape (n,).
        theta: where, in cycles, any shape.
        order: 0 for the value, 1 and 2 for derivatives.
        shifts: phases to add in turn, in cycles, shape (m,), or none.

    Returns:
        An array of shape theta.shape, or theta.shape + (m,) with shifts.

    """
    coefficients = np.fft.rfft(values) / values.size
    coefficients[1:] *= 2.0
    factor = 2j * np.pi * np.arange(coefficients.size)
    coefficients *= factor**order
    if shifts is not None:
        coefficients = coefficients[:, None] * np.exp(np.outer(factor, shifts))
    waves = np.exp(np.multiply.outer(np.asarray(theta, dtype=float), factor))
    return (waves @ coefficients).real


def tail(values: np.ndarray) -> float:
    """Return the largest of the last six harmonics over the largest of all."""
    size = np.abs(np.fft.rfft(values))
    return float(size[-6:].max() / (size.max() or 1.0))


def resample(values: np.ndarray, n: int) -> np.ndarray:
    """Return the same interpolant on n nodes, more than it has."""
    return np.fft.irfft(np.fft.rfft(values), n) * (n / values.size)


#: Functions on a cycle by n numbers each, and n collocation points: Nodes or pieces.Pieces.
Basis: TypeAlias = Any


@dataclass(frozen=True)
class Nodes:
    """Trigonometric polynomials by their values at n even nodes, which are the points.

    Attributes:
        n: number of the nodes.

    """

    n: int
    #: Residual, over the slopes, at which Newton's method ends.
    tolerance: ClassVar[float] = 1e-12

    def finer(self, values: np.ndarray) -> tuple['Nodes', np.ndarray]:
        """Return a basis twice as fine, and its nodes in cycles; values are of cell 1."""
        return Nodes(2 * self.n + 1), np.arange(2 * self.n + 1) / (2 * self.n + 1)

    @property
    def derive(self) -> np.ndarray:
        """Matrix from the numbers to derivatives by theta at the points, shape (n, n)."""
        return derivative_matrix(self.n)

    def moved(self, shift: float) -> np.ndarray | None:
        """Return the matrix to values at the points plus a shift; None for the identity."""
        return None if shift == 0.0 else shift_matrix(self.n, shift)

    def slope(self, values: np.ndarray, shift: float) -> np.ndarray:
        """Return derivatives by theta at the points plus a shift, shape (n,)."""
        return shift_matrix(self.n, shift) @ (self.derive @ values)

    def jacobian(self, blocks: dict[tuple[int, int], np.ndarray], by_period: np.ndarray
                 ) -> np.ndarray:
        """Join blocks by row and source, the period's column, and the phase condition.

        Cell 1 peaks at the first node.
        """
        rows, n = by_period.shape
        jacobian = np.zeros((rows * n + 1, rows * n + 1))
        whole = jacobian[:-1, :-1].reshape(rows, n, rows, n)
        for (row, source), block in blocks.items():
            whole[row, :, source] = block
        jacobian[:-1, -1] = by_period.ravel()
        jacobian[-1, :n] = self.derive[0]
        return jacobian

    def phase(self, values: np.ndarray) -> float:
        """Return the residual of the phase condition of cell 1's first variable."""
        return float(self.derive[0] @ values)

    def solve(self, jacobian: np.ndarray, right: np.ndarray) -> np.ndarray:
        """Solve a linear system.

        Raises:
            LinAlgError: it is singular.

        """
        # numpy's solver, unlike scipy's, releases the interpreter lock: a node publishes while it
        # solves.
        return np.linalg.solve(jacobian, right)

    def evaluate(self, values: np.ndarray, theta: np.ndarray, order: int) -> np.ndarray:
        """Return values, or derivatives by theta of an order, at theta in cycles."""
        return evaluate(values, theta, order)


@dataclass(frozen=True, eq=False, repr=False)
class FourierOrbit(Orbit):
    """An orbit by its waveforms on evenly spaced nodes, or on a mesh where it is too steep.

    Attributes:
        values: waveforms at the nodes theta = m / n, or those of a mesh, shape (waves, variables,
            n); cell 1's first variable peaks at the first node.
        derivatives: by the parameters, of the nodal values at fixed theta, then of the period,
            shape (waves variables n + 1, parameters).
        basis: of the waveforms.

    """

    values: np.ndarray
    derivatives: np.ndarray
    basis: Basis

    def _summary(self) -> str:
        return f'{super()._summary()}, {self.values.shape[-1]} nodes'

    @property
    def d_period(self) -> np.ndarray:
        """Derivatives of the period by the network's parameters, shape (parameters,)."""
        return self.derivatives[-1]

    @property
    def d_values(self) -> np.ndarray:
        """Derivatives of the nodal values by the parameters, (waves, variables, n, parameters)."""
        return self.derivatives[:-1].reshape(*self.values.shape, -1)

    @property
    def peak(self) -> float:
        """The largest value of cell 1."""
        return float(self.values[0, 0, 0])

    @property
    def levels(self) -> np.ndarray:
        """Middle and half the range of each waveform, shape (waves, variables, 2)."""
        if self.symmetry.odd and self.values.shape[:2] == (1, 1):
            # The symmetry x -> -x puts the middle at 0.
            return np.array([[[0.0, self.peak]]])
        return super().levels

    @property
    def samples(self) -> int:
        """Number of evenly spaced points that resolve a waveform: the nodes, if they are even."""
        return int(self.values.shape[-1]) if isinstance(self.basis, Nodes) else MAX_NODES

    @property
    def between(self) -> np.ndarray:
        """Times in the middle between two nodes, model time, shape (n,)."""
        return (np.arange(self.samples) + 0.5) / self.samples * self.period

    def refined(self) -> 'FourierOrbit':
        """As of Orbit."""
        rows = self.values.reshape(-1, self.values.shape[-1])
        basis, nodes = self.basis.finer(rows[0])
        solved = converge(self.network, self.symmetry,
                          np.array([self.basis.evaluate(row, nodes, 0) for row in rows]),
                          self.period, basis)
        if solved is None:
            raise NoOrbit('the orbit is lost on a mesh twice as fine')
        return complete(self.network, self.symmetry, *solved, basis)

    def waveform(self, theta: np.ndarray, order: int = 0, wave: int = 0, variable: int = 0
                 ) -> np.ndarray:
        """Return a waveform, or its derivative in theta of the given order, at theta in cycles."""
        return self.basis.evaluate(self.values[wave, variable], theta, order)

    def d_waveform(self, theta: np.ndarray, wave: int = 0, variable: int = 0) -> np.ndarray:
        """Return the derivatives by the parameters, shape theta.shape + (parameters,)."""
        return np.stack([self.basis.evaluate(column, theta, 0)
                         for column in self.d_values[wave, variable].T], -1)

    def _states(self, times: np.ndarray, order: int) -> np.ndarray:
        theta = np.asarray(times, dtype=float) / self.period
        if self.values.shape[:2] == (1, 1) and isinstance(self.basis, Nodes):
            return evaluate(self.values[0, 0], theta, order, self.phases)
        return super()._states(times, order)


NUM_NODES = 63
MAX_NODES = 511
NEWTON_ITERATIONS = 12
#: Relative size of the last harmonics at which a waveform is resolved.
HARMONIC_TOLERANCE = 1e-12
#: States, parameters, derivative by the delay, and slopes in theta; see ``equations``.
Point = tuple[list[np.ndarray], list[np.ndarray], np.ndarray, np.ndarray]
#: Over the guess: range below which Newton's method has reached the equilibrium, and size of the
#: states at which it has diverged.
MIN_RANGE_RATIO, MAX_STATE_RATIO = 1e-7, 1e3


@lru_cache(maxsize=64)
def _inputs(network: type[Network], symmetry: Symmetry
           ) -> list[tuple[bool, list[tuple[int, float]]]]:
    """Return for each argument whether it is delayed, and row and shift of each wave's input."""
    inputs = []
    for argument in equations_of(network).arguments:
        source = range(network.cells) if argument.source is None else argument.source
        sources = []
        for cell in symmetry.first:
            other = source[cell]
            sources.append((int(symmetry.waves[other]) * network.variables + argument.variable,
                            float(symmetry.phases[other] - symmetry.phases[cell])))
        inputs.append((argument.delayed, sources))
    return inputs


def rows_of(network: Network, symmetry: Symmetry, states: np.ndarray) -> np.ndarray:
    """Pick the waveforms out of states, a row for each variable of each wave."""
    columns = [variable * network.cells + cell for cell in symmetry.first
               for variable in range(network.variables)]
    return states[:, columns].T.copy()


def equations(network: Network, symmetry: Symmetry, u: np.ndarray, period: float,
              waveform_basis: Basis | None = None) -> tuple[np.ndarray, Any, Point]:
    """Evaluate the equations on the nodes and the phase condition.

    Args:
        network: parameters.
        symmetry: of the gait.
        u: waveforms on the nodes, a row for each variable of each wave, shape (rows, n).
        period: in model time.
        waveform_basis: basis of the waveforms, by default n even nodes.

    Returns:
        Residual (rows n + 1,), its Jacobian in (u, T), and what ``by_parameter`` needs.

    """
    rows, n = u.shape
    basis: Basis = waveform_basis or Nodes(n)
    variables, tau, kind = network.variables, network.delay, equations_of(type(network))
    waves, derive = rows // variables, basis.derive
    rise, inputs = (derive @ u.T).T, _inputs(type(network), symmetry)
    states, slopes, matrices = [], [], []
    for delayed, sources in inputs:
        late = tau / period if delayed else 0.0
        matrices.append([basis.moved(shift - late) for _, shift in sources])
        states.append(np.array([u[row] if matrix is None else matrix @ u[row] for (row, _), matrix
                                in zip(sources, matrices[-1], strict=True)]))
        slopes.append([basis.slope(u[row], shift - late) if delayed else None
                       for row, shift in sources])
    p = [value[symmetry.first][:, None] if value.ndim else value for value in values_of(network)]
    rates, by_argument = kind.slopes(states, p)

    residual = np.empty(rows * n + 1)
    left = residual[:-1].reshape(waves, variables, n)
    for v, rate in enumerate(rates):
        left[:, v] = rise[v::variables] / period - rate
    residual[-1] = basis.phase(u[0])

    blocks: dict[tuple[int, int], Any] = {(row, row): derive / period for row in range(rows)}
    by_period, by_delay, flat = -rise / period**2, np.zeros((rows, n)), np.zeros((waves, n))
    for (v, k), slope in by_argument.items():
        slope = slope + flat
        delayed, sources = inputs[k]
        for wave, (source, _) in enumerate(sources):
            row, matrix = wave * variables + v, matrices[k][wave]
            scaled = np.diag(slope[wave]) if matrix is None else matrix * slope[wave][:, None]
            blocks[row, source] = blocks.get((row, source), 0.0) - scaled
            if delayed:
                by_shift = slope[wave] * slopes[k][wave]
                by_period[row] -= by_shift * tau / period**2
                by_delay[row] += by_shift / period
    jacobian = basis.jacobian(blocks, by_period)
    return residual, jacobian, (states, p, by_delay, rise)


def by_parameter(network: Network, symmetry: Symmetry, point: Point) -> np.ndarray:
    """Return the derivative of the residual by the parameters, shape (rows n + 1, parameters)."""
    states, p, by_delay, _ = point
    names, kind = network.parameters(), equations_of(type(network))
    rows, n = by_delay.shape
    variables = network.variables
    out, flat = np.zeros((rows * n + 1, len(names))), np.zeros((rows // variables, n))
    blocks = out[:-1].reshape(rows, n, len(names))
    for (v, r), slope in kind.by_parameter(states, p).items():
        slope, row = slope + flat, kind.rows[r]
        for wave, cell in enumerate(symmetry.first):
            name = kind.by_cell[row][cell] if row in kind.by_cell else row
            blocks[wave * variables + v, :, names.index(name)] -= slope[wave]
    if network.delay_parameter:
        blocks[..., names.index(network.delay_parameter)] += by_delay
    return out


def complete(network: Network, symmetry: Symmetry, u: np.ndarray, period: float,
             jacobian: Any, point: Point, waveform_basis: Basis | None = None) -> FourierOrbit:
    """Complete a solution by its derivatives; jacobian and point are results of equations."""
    basis: Basis = waveform_basis or Nodes(u.shape[1])
    derivatives = -basis.solve(jacobian, by_parameter(network, symmetry, point))
    names = network.parameters()
    # The equations of one cell contain only the weights of its own inputs.
    for family in network.families(symmetry):
        if len(family) > 1:
            members = [names.index(name) for name in family]
            derivatives[:, members] = derivatives[:, members].mean(axis=1, keepdims=True)
    shape = (u.shape[0] // network.variables, network.variables, u.shape[1])
    return FourierOrbit(network, symmetry, period, u.reshape(shape), derivatives, basis)


class Converged(NamedTuple):
    """A solution on one basis, with the Jacobian and the point of ``equations``."""

    u: np.ndarray
    period: float
    jacobian: Any
    point: Point


def converge(network: Network, symmetry: Symmetry, u: np.ndarray, period: float, basis: Basis,
             periods: Sequence[float] = ()) -> Converged | None:
    """Solve on one basis by Newton's method; None where it diverges or reaches an equilibrium."""
    range_at_first, furthest = np.ptp(u[0]), MAX_STATE_RATIO * np.abs(u).max()
    for _ in range(2 * NEWTON_ITERATIONS if periods else NEWTON_ITERATIONS):
        residual, jacobian, point = equations(network, symmetry, u, period, basis)
        size, rise = float(np.abs(residual[:-1]).max()), float(np.abs(point[3]).max()) / period
        if size <= basis.tolerance * rise or not rise:
            break
        try:
            step = basis.solve(jacobian, residual)
        except np.linalg.LinAlgError:
            return None
        if periods:
            step = step * deflation_factor(period, -float(step[-1]), periods)
        u, period = u - step[:-1].reshape(u.shape), period - float(step[-1])
        if not (1e-3 * network.delay < period < 1e3 * network.delay
                and np.abs(u).max() < furthest):
            return None
    else:
        return None
    return Converged(
        u, period, jacobian, point) if np.ptp(u[0]) > MIN_RANGE_RATIO * range_at_first else (
        None)
