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

"""Hopf points of the equilibrium of any network, with their normal forms.

On the centre manifold ``x = rest + z q + conj(z q) + ...`` with an eigenvector q that has the
symmetry of the gait (Kuznetsov, *Elements of Applied Bifurcation Theory*, chapter 5; with a delay
Diekmann et al., *Delay Equations*, chapter IX)::

    k2 = <p, C(q, q, q*) + 2 B(q, Delta(0)^-1 B(q, q*)) + B(q*, Delta(2 i omega)^-1 B(q, q))> / 2

with ``Delta q = 0``, ``p Delta = 0`` and ``<p, Delta'(i omega) q> = 1``. Delta is the
characteristic matrix of the whole network; it leaves the classes of B(q, q*) and B(q, q).
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cache, cached_property
from itertools import pairwise
import math

from cpg_ros.common.errors import InputError, ShortRepr
from cpg_ros.dynamics.arclength import crossings, NoOrbit
from cpg_ros.dynamics.characteristic import characteristic_matrix, delay_crossings, rightmost_first
from cpg_ros.dynamics.equilibrium import equilibrium, NoEquilibrium
from cpg_ros.dynamics.isotypic import (
    Block,
    block_at,
    block_of,
    blocks,
    classes,
    everywhere,
    Expansion,
    group_of,
    renamed,
)
from cpg_ros.networks.equations import equations_of
from cpg_ros.networks.network import Network, ParameterLine
from cpg_ros.networks.symmetry import Symmetry
import numpy as np

#: Fraction of its terms below which a cubic coefficient is 0.
CUBIC_TOLERANCE = 1e-10


@dataclass(frozen=True)
class NormalForm:
    """Coefficients of the normal form ``z' = (i omega + k1 mu) z + k2 z |z|^2`` in its own time.

    Attributes:
        k1: derivative of the critical eigenvalue by the parameter.
        k2: cubic coefficient.
        size: sum of the moduli of all terms of k2.

    """

    k1: complex
    k2: complex
    size: float = 0.0

    @property
    def degenerate(self) -> bool:
        """Whether the cubic coefficient vanishes, Re k2 = 0, up to rounding."""
        return abs(self.k2.real) <= CUBIC_TOLERANCE * self.size

    @property
    def supercritical(self) -> bool:
        """Whether the orbits attract on the centre manifold: k2 < 0.

        They exist where the equilibrium is unstable. Liu & Zhang (2024), theorem 2.1, call k2 < 0
        stable and k1 k2 < 0 supercritical, which is the same for k1 > 0.
        """
        return self.k2.real < 0.0

    @property
    def side(self) -> int:
        """1 if the orbits lie where mu > 0 (k1 k2 < 0), -1 if where mu < 0, 0 if degenerate."""
        if self.degenerate:
            return 0
        return 1 if self.k1.real * self.k2.real < 0.0 else -1

    def radius(self, mu: float) -> float:
        """Return the radius of the orbit at a parameter distance mu, ``sqrt(-k1 mu / k2)``.

        Raises:
            NoOrbit: there is none on this side, or the form is degenerate.

        """
        if self.degenerate:
            raise NoOrbit('the normal form is degenerate: it has no term of third order')
        square = -self.k1.real * mu / self.k2.real
        if square < 0.0:
            raise NoOrbit(f'at mu {mu:g} the normal form has no orbit')
        return math.sqrt(square)

    def shift(self, mu: float) -> float:
        """Return the orbit's angular frequency less omega: ``Im k1 mu + Im k2 r^2``."""
        return self.k1.imag * mu + self.k2.imag * self.radius(mu)**2


#: Distance from the imaginary axis, over omega, below which a root lies on it.
AXIS_TOLERANCE = 1e-8


@dataclass(frozen=True, eq=False, repr=False)
class HopfPoint(ShortRepr):
    """A crossing of the imaginary axis by a pair of roots.

    Attributes:
        network: at the point.
        line: of parameters on which it lies.
        value: of the parameters; of the delay, model time.
        block: of the critical class, with its gait, mode and wave.
        omega: of the critical root i omega, rad per model time, positive.
        rest: state of every cell at the equilibrium, shape (variables,).
        n: along the delay, number of periods 2 pi / omega beyond the smallest delay.

    """

    network: Network
    line: ParameterLine
    value: float
    block: Block
    omega: float
    rest: np.ndarray
    n: int = 0

    def _summary(self) -> str:
        return (f'{self.gait} of {self.network.name} at {self.line} {self.value:.7g}, '
                f'omega {self.omega:.7g}')

    @property
    def gait(self) -> str:
        """The primary gait that branches off, in either direction of its wave."""
        return self.block.gait

    @property
    def mode(self) -> tuple[int, ...]:
        """The class (j, k)."""
        return self.block.mode

    @property
    def symmetry(self) -> Symmetry:
        """Symmetry of the orbits that branch off, in the group of the network's gaits."""
        group = self.network.symmetry(self.network.gaits()[0]).group
        return renamed(self.block.symmetry, group) or self.block.symmetry

    @property
    def wave(self) -> str:
        """Direction of the wave, as in the block."""
        return self.block.wave

    @cached_property
    def _eigenvectors(self) -> tuple[np.ndarray, np.ndarray]:
        """Return q of the whole network with <q, q> = 1, and p with <p, Delta' q> = 1."""
        block = self.block
        matrix, slope = characteristic_matrix(1j * self.omega, block.now, block.past,
                                              self.network.delay)
        left, _, right = np.linalg.svd(matrix)
        q, p = right[-1].conj(), left[:, -1].conj()
        largest = q[np.abs(q).argmax()]
        q = q * (largest.conjugate() / abs(largest))
        return block.embedded(q), block.embedded((p / (p @ slope @ q)).conj()).conj()

    @property
    def vector(self) -> np.ndarray:
        """Eigenvector q of cell 1, shape (variables,); over the whole network <q, q> = 1."""
        return self.eigenvector[::self.network.cells]

    @property
    def eigenvector(self) -> np.ndarray:
        """Eigenvector q of the whole network, shape (components,)."""
        return self._eigenvectors[0]

    @property
    def _size(self) -> float:
        """Largest modulus of q among the first variables of the cells."""
        return float(np.abs(self.eigenvector[:self.network.cells]).max())

    @property
    def state(self) -> np.ndarray:
        """Equilibrium of the whole network, shape (components,)."""
        return everywhere(self.network, self.rest)

    def towards(self, symmetry: Symmetry) -> 'HopfPoint | None':
        """Return this point with the disturbance of a gait's symmetry, or None if it has none."""
        other = self.block.representation.towards(symmetry)
        return None if other is None else replace(self, block=block_of(self._expansion, other))

    @cached_property
    def normal_form(self) -> NormalForm:
        """Normal form in model time, mu = value' - value; z belongs to q."""
        form, axis, (q, p) = self._expansion.multilinear, 1j * self.omega, self._eigenvectors
        ahead = self._moving(q, axis)
        back = ahead[0].conj(), ahead[1].conj()
        flat = self._moving(self._answer(0.0, form(ahead, back)), 0.0)
        fast = self._moving(self._answer(2.0 * axis, form(ahead, ahead)), 2.0 * axis)
        sets = [(ahead, ahead, back), (ahead, flat), (ahead, flat), (back, fast)]
        k2 = 0.5 * sum(p @ form(*one) for one in sets)
        size = 0.5 * sum(np.abs(p) @ form(*one, sizes=True).real for one in sets)
        return NormalForm(self._speed(self.line), complex(k2), float(size))

    def _moving(self, h: np.ndarray, exponent: complex) -> tuple[np.ndarray, np.ndarray]:
        """Return ``h exp(exponent t)`` now and a delay ago."""
        return h, h * np.exp(-exponent * self.network.delay)

    def _answer(self, exponent: complex, push: np.ndarray) -> np.ndarray:
        """Return ``Delta(exponent)^-1 push``; a class with this root need not be pushed."""
        matrix = characteristic_matrix(exponent, *self._expansion.linear, self.network.delay)[0]
        return np.linalg.lstsq(matrix, push, rcond=None)[0]

    @cached_property
    def _expansion(self) -> Expansion:
        return Expansion(self.network, self.rest)

    def _speed(self, line: ParameterLine) -> complex:
        """Return the derivative of the critical root by the value on a line of parameters."""
        expansion, axis, (q, p) = self._expansion, 1j * self.omega, self._eigenvectors
        direction, late = line.direction(self.network), np.exp(-axis * self.network.delay)
        push = expansion.field.by_parameter(expansion.state) @ direction
        moves = self._moving(self._answer(0.0, push), 0.0)
        now, past = expansion.field.linear_along(expansion.state, direction)
        change = (now + past * late) @ q + expansion.multilinear(moves, self._moving(q, axis))
        if self.network.delay_parameter in line.names:
            sign = line.signs[line.names.index(self.network.delay_parameter)]
            change = change - sign * axis * late * (expansion.linear[1] @ q)
        return complex(p @ change)

    @property
    def in_delays(self) -> NormalForm:
        """Normal form in units of the delay, as in Liu & Zhang (2024).

        The delay scales the time as well; z is half the amplitude of a cell's first variable.
        """
        form, delay = self.normal_form, self.network.delay
        scale = delay / self._size**2
        return NormalForm(1j * self.omega + delay * form.k1, scale * form.k2, scale * form.size)

    @property
    def natural_amplitude(self) -> float:
        """Size of a cell's first variable at which the cubic term is as fast as omega.

        It is half the amplitude there, or the size of the equilibrium, or 1, where the normal form
        is degenerate.
        """
        form = self.normal_form
        if form.degenerate:
            return float(np.abs(self.rest).max()) or 1.0
        return self._size * math.sqrt(self.omega / abs(form.k2))

    @property
    def slopes(self) -> dict[str, float]:
        """Derivatives of the value at the Hopf point by the other parameters, by name."""
        back = -self._speed(self.line).real
        return {name: self._speed(ParameterLine((name,), (1.0,))).real / back
                for name in self.network.parameters() if name not in self.line.names}

    @property
    def direction(self) -> int:
        """1 where the critical pair moves to the right as the value grows, -1 to the left."""
        return 1 if self.normal_form.k1.real > 0.0 else -1

    @property
    def supercritical(self) -> bool:
        """Whether the orbits attract on the centre manifold."""
        return self.normal_form.supercritical

    @property
    def lyapunov(self) -> float:
        """First Lyapunov coefficient l1 = Re k2 / omega (Kuznetsov, section 3.5; <q, q> = 1)."""
        return self.normal_form.k2.real / self.omega

    def but_critical(self, block: Block, roots: np.ndarray) -> np.ndarray:
        """Return a block's roots except the critical one or pair."""
        own, values = self.block.representation.values, block.representation.values
        for critical, sought in ((1j * self.omega, own), (-1j * self.omega, own.conj())):
            if np.allclose(values, sought) and len(roots):
                roots = np.delete(roots, np.abs(roots - critical).argmin())
        return roots

    @cached_property
    def _others(self) -> tuple[tuple[Block, np.ndarray], ...]:
        """All blocks with their other roots on the axis and to the right of it."""
        close = AXIS_TOLERANCE * self.omega
        return tuple((block, self.but_critical(block, block.right_of(-close)))
                     for block in blocks(self.network, self.rest))

    @property
    def leading_other(self) -> complex:
        """Rightmost root except the critical pair, 1/model time."""
        return complex(rightmost_first(np.concatenate([
            self.but_critical(block, block.roots(3))
            for block in blocks(self.network, self.rest)]))[0])

    def _right(self, within: bool) -> int:
        close = AXIS_TOLERANCE * self.omega
        return int(sum((roots.real > close).sum() * (
            other.copies - (0 if within else other.inside(self.block)))
            for other, roots in self._others))

    @property
    def unstable_roots(self) -> int:
        """Number of the other roots with positive real part."""
        return self._right(within=True)

    @property
    def unstable_transverse_roots(self) -> int:
        """Number of these outside the gait's class."""
        return self._right(within=False)

    @property
    def simple(self) -> bool:
        """Whether no other root lies on the imaginary axis."""
        return all((roots.real > AXIS_TOLERANCE * self.omega).all()
                   for _, roots in self._others)

    @property
    def stable(self) -> bool:
        """Whether the bifurcation is stable in the sense of Buono & Golubitsky (section 4).

        The critical roots are simple, all others lie to the left. The orbits attract if the
        bifurcation is also supercritical.
        """
        return self.simple and self.unstable_roots == 0

    def amplitude(self, value: float) -> float:
        """Return the amplitude, half the range, of a cell's first variable near onset: 2 |q_1| r.

        Raises:
            NoOrbit: the orbits lie on the other side.

        """
        return 2.0 * abs(self.vector[0]) * self.normal_form.radius(value - self.value)

    def period(self, value: float) -> float:
        """Return the period near onset in model time, to first order in value' - value.

        Raises:
            NoOrbit: the orbits lie on the other side.

        """
        return 2.0 * np.pi / (self.omega + self.normal_form.shift(value - self.value))

    def path(self, value: float, theta: np.ndarray) -> np.ndarray:
        """Return the states ``rest + 2 Re(q z)`` near onset at times in cycles, (m, components).

        Raises:
            NoOrbit: the orbits lie on the other side.

        """
        network = self.line.at(self.network, value)
        swing = self.normal_form.radius(value - self.value) * self.eigenvector
        turning = np.exp(2j * np.pi * np.asarray(theta))[:, None]
        return everywhere(network, equilibrium(network)) + 2.0 * (swing * turning).real


def first_hopf(network: Network, gait: str) -> HopfPoint | None:
    """Return the Hopf point at a gait's smallest critical delay, or None.

    There a pair of roots of the gait's class moves to the right.

    Args:
        network: parameters; its own delay does not matter.
        gait: one of its gaits.

    Raises:
        InputError: an unknown gait.
        NoEquilibrium: the network has no equilibrium.

    """
    symmetry, delay = network.symmetry(gait), network.delay_parameter
    if not delay:
        return None
    rest, line = equilibrium(network), ParameterLine((delay,), (1.0,))
    try:
        block = block_of(Expansion(network, rest), symmetry)
    except InputError:
        # The gait branches off no equilibrium.
        return None
    points = [crossing_at(block, line, rest, omega, tau)
              for omega, tau in delay_crossings(block.now, block.past)]
    # With one variable the fast wave begins there, and the slow one ends.
    born = points[:1] if len(rest) == 1 else [point for point in points if point.direction > 0]
    return min(born, key=lambda point: point.value, default=None)


def crossing_at(block: Block, line: ParameterLine, rest: np.ndarray, omega: float, tau: float,
                n: int = 0) -> HopfPoint:
    """Return the Hopf point of a block at a delay.

    Args:
        block: of a network with any delay.
        line: of the delay alone.
        rest: state of every cell at the equilibrium, shape (variables,).
        omega: rad per model time.
        tau: smallest delay at which the block's roots cross.
        n: number of periods 2 pi / omega to add to it.

    """
    tau += 2.0 * np.pi * n / omega
    network = line.at(block.network, tau)
    return HopfPoint(network, line, tau, replace(block, network=network), omega, rest, n)


# All Hopf points of a network's equilibrium along a line of parameters.

#: Points of the grid between which crossings are refined.
GRID_SIZE = 241
#: Roots of a class that are followed with a delay, beside those to the right of the axis.
NUM_SPARE = 2


def hopf_points(network: Network, line: ParameterLine | str, low: float, high: float
                ) -> list[HopfPoint]:
    """Find all Hopf points of the equilibrium between two parameter values, in ascending order.

    Values without an equilibrium are skipped. Along lines other than the delay, points closer than
    (high - low)/240 are distinguished only if a pair crosses twice in the same class.

    Args:
        network: the other parameters.
        line: line of parameters, or its text: 'tau', 'alpha=-beta', or a group.
        low: smallest value, in the parameter's unit.
        high: largest value, in the parameter's unit.

    Raises:
        NoEquilibrium: there is none on the whole line.
        InputError: low is not below high, there is no such parameter, a parameter is not finite,
            or the delay would be negative.

    """
    if not (np.isfinite(low) and np.isfinite(high) and low < high):
        raise InputError(f'low {low} must be less than high {high}')
    line = ParameterLine.of(line, type(network))
    if not network.rests:
        equilibrium(network)
    delay = network.delay_parameter
    if min(line.at(network, value).delay for value in (low, high)) < 0.0:
        raise InputError(f'{line} from {low:g} to {high:g} makes {delay} negative')
    if line.names == (delay,) and delay not in equations_of(type(network)).rows:
        return _by_delay(network, line, low, high)
    return _on_grid(network, line, low, high)


def hopf_at(network: Network, line: ParameterLine, mode: tuple[int, ...], omega: float
            ) -> HopfPoint:
    """Return the Hopf point of a network at which a class is critical.

    Args:
        network: at the point.
        line: of parameters, along which the pair crosses.
        mode: of the critical class.
        omega: estimate of that of the critical root i omega.

    """
    rest = equilibrium(network)
    return _on_axis(line, block_at(network, rest, mode), rest, omega)


def _on_axis(line: ParameterLine, block: Block, rest: np.ndarray, omega: float) -> HopfPoint:
    # The real part is zero up to rounding.
    roots, network = block.right_of(-1e-3 * omega), block.network
    root = roots[np.abs(roots - 1j * omega).argmin()]
    return HopfPoint(network, line, line.value(network), block, float(root.imag), rest)


def _by_delay(network: Network, line: ParameterLine, low: float, high: float) -> list[HopfPoint]:
    rest, points = equilibrium(network), []
    for block in blocks(network, rest):
        for omega, tau in delay_crossings(block.now, block.past):
            period = 2.0 * np.pi / omega
            points += [crossing_at(block, line, rest, omega, tau, n) for n in range(
                max(0, int(np.ceil((low - tau) / period))),
                int(np.floor((high - tau) / period)) + 1)]
    return sorted(points, key=lambda point: point.value)


def _on_grid(network: Network, line: ParameterLine, low: float, high: float) -> list[HopfPoint]:
    # At single values the network may have more symmetry.
    group = min((group_of(line.at(network, value)) for value in (low, high)),
                key=lambda group: len(group.elements))

    @cache
    def split(value: float) -> tuple[Block, ...]:
        """Return the blocks; none where there is no equilibrium."""
        moved = line.at(network, value)
        try:
            return blocks(moved, equilibrium(moved), group)
        except NoEquilibrium:
            return ()

    @cache
    def roots(value: float, which: int, count: int) -> np.ndarray:
        if not split(value):
            return np.full(count, np.nan, dtype=complex)
        listed = split(value)[which].roots(count)
        # Cells whose delayed input has the weight 0 have fewer.
        return np.pad(listed, (0, count - len(listed)), constant_values=np.nan)

    grid = _with_edges([float(value) for value in np.linspace(low, high, GRID_SIZE)],
                       lambda value: bool(split(value)))
    if not any(split(value) for value in grid):
        equilibrium(line.at(network, low))
    points: list[HopfPoint] = []
    for which in range(len(classes(network, group))):
        count = tracked_roots([split(value)[which] for value in grid if split(value)])
        pairs: list[tuple[float, float]] = []
        for rank in range(count):
            def real_part(value: float, at: tuple[int, int, int] = (which, count, rank)) -> float:
                return float(roots(value, *at[:2])[at[2]].real)

            for value in crossings(real_part, np.array(grid)):
                # Two roots of a block may cross together; each then appears twice.
                for root in roots(value, which, count):
                    omega = float(root.imag)
                    if (omega > 0.0 and abs(root.real) <= AXIS_TOLERANCE * omega
                            and not any(np.allclose((value, omega), pair) for pair in pairs)):
                        pairs.append((value, omega))
                        block = split(value)[which]
                        points.append(_on_axis(line, block, equilibrium(block.network), omega))
    # Equal values, by symmetry, differ by rounding.
    return sorted(points, key=lambda point: (round((point.value - low) / (high - low), 9),
                                             point.omega, point.mode))


def tracked_roots(along: list[Block], spare: int = NUM_SPARE) -> int:
    """Return how many roots of a class to follow along some blocks: without a delay, all."""
    if not any(block.past.any() for block in along):
        return len(along[0].now)
    return spare + max(len(block.right_of(0.0)) for block in along)


def _with_edges(grid: list[float], exists: Callable[[float], bool]) -> list[float]:
    """Add to a grid the ends of the intervals in which something exists."""
    whole = grid[:1]
    for left, right in pairwise(grid):
        if exists(left) != exists(right):
            inside, outside = (left, right) if exists(left) else (right, left)
            for _ in range(20):
                middle = 0.5 * (inside + outside)
                inside, outside = (middle, outside) if exists(middle) else (inside, middle)
            if left < inside < right:
                whole.append(inside)
        whole.append(right)
    return whole
