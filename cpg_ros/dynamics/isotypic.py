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

"""Isotypic blocks of the linearisation at an equilibrium: a small matrix for each class.

An abelian group permutes the cells simply and transitively. Each of its characters chi has the
eigenvector (chi(cell)) once for each variable, and the linearisation splits into
``L_chi = sum_i J_1i chi(i)`` (Buono & Golubitsky 2001, section 5.2), for the state now and for the
state a delay ago. Oscillations of a class are primary gaits: ``x_i ~ chi(i) exp(i omega t)``, so
the character is the gait (Table 5).
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction
from functools import cache, cached_property
from typing import Any

from cpg_ros.common.errors import InputError, ShortRepr
from cpg_ros.dynamics.characteristic import characteristic_roots, roots_right_of
from cpg_ros.networks.equations import equations_of, multilinear, values_of
from cpg_ros.networks.network import Network, ParameterLine
from cpg_ros.networks.symmetry import Group, homomorphisms, Symmetry
import numpy as np


@cache
def split(symmetry: Symmetry) -> tuple[np.ndarray, list[np.ndarray]]:
    """Return orthonormal columns of the gait's class, and of the subspaces transverse to it."""
    cells = symmetry.group.cells
    inside, spaces = symmetry.basis.T, [np.eye(cells)]
    for name, shift in symmetry.shifts:
        sign = 1.0 if shift == 0 else -1.0
        if shift not in (0, Fraction(1, 2)) or (sign < 0.0 and not symmetry.odd):
            continue
        image = np.zeros((cells, cells))
        image[np.array(symmetry.group.elements[name]), np.arange(cells)] = sign
        if np.array_equal(image @ image, np.eye(cells)):
            spaces = [half for space in spaces for half in _halves(space, image)]
    outside = []
    for space in spaces:
        columns = np.kron(np.eye(symmetry.variables), space)
        remainder = columns - inside @ (inside.T @ columns)
        vectors, sizes, _ = np.linalg.svd(remainder, full_matrices=False)
        if (sizes > 0.5).any():
            outside.append(vectors[:, sizes > 0.5])
    return inside, outside


def _halves(basis: np.ndarray, image: np.ndarray) -> list[np.ndarray]:
    """Split a subspace, orthonormal columns, into the eigenspaces of an involution."""
    columns = []
    for sign in (1.0, -1.0):
        vectors, sizes, _ = np.linalg.svd(0.5 * (basis + sign * image @ basis),
                                          full_matrices=False)
        if (sizes > 0.5).any():
            columns.append(vectors[:, sizes > 0.5])
    return columns


class Expansion:
    """Exact derivatives of a cell's rates by its inputs, at a state in which all cells are equal.

    Attributes:
        network: parameters.
        state: of every cell, shape (variables,).

    """

    def __init__(self, network: Network, state: np.ndarray) -> None:
        """Expand about a state of every cell at these parameters."""
        self.network, self.state = network, state
        self._equations = equations_of(type(network))
        self._x = [state[argument.variable] for argument in self._equations.arguments]
        self._p = [value.flat[0] for value in values_of(network)]
        self._higher: dict[int, Mapping[Any, float]] = {}

    @cached_property
    def slopes(self) -> Mapping[tuple[int, int], float]:
        """Return (variable, argument) -> derivative of the rate."""
        return self._equations.slopes(self._x, self._p)[1]

    def linear(self, chi: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """L0 and L1 of a class, complex: ``h' = L0 h(t) + L1 h(t - tau)``, (variables, variables).

        Args:
            chi: the class's character for every cell, 1 for the first, shape (cells,).

        """
        return self._split(chi, self.slopes)

    def _split(self, chi: np.ndarray, slopes: Mapping[tuple[int, int], float]
               ) -> tuple[np.ndarray, np.ndarray]:
        variables = self.network.variables
        both = np.zeros((2, variables, variables), dtype=complex)
        for (v, k), slope in slopes.items():
            argument = self._equations.arguments[k]
            both[int(argument.delayed), v, argument.variable] += slope * (
                1.0 if argument.source is None else chi[argument.source[0]])
        return both[0], both[1]

    def inputs(self, h: np.ndarray, chi: np.ndarray, exponent: complex = 0.0) -> np.ndarray:
        """Return the inputs from ``h chi exp(exponent t)`` at t = 0, shape (arguments,).

        Args:
            h: of a cell, shape (variables,).
            chi: character, shape (cells,).
            exponent: 1/model time.

        """
        past = np.exp(-exponent * self.network.delay)
        return np.array([h[argument.variable]
                         * (1.0 if argument.source is None else chi[argument.source[0]])
                         * (past if argument.delayed else 1.0)
                         for argument in self._equations.arguments])

    def multilinear(self, *sets: np.ndarray) -> np.ndarray:
        """Derivative of the rates, B(a, b) or C(a, b, c), at sets of arguments, (variables,)."""
        return self._summed(self.derivatives(len(sets)), sets)

    def bound(self, *sets: np.ndarray) -> np.ndarray:
        """Return the sum of the moduli of the terms of ``multilinear``, shape (variables,)."""
        sizes = {key: abs(value) for key, value in self.derivatives(len(sets)).items()}
        return self._summed(sizes, [np.abs(vectors) for vectors in sets]).real

    def derivatives(self, order: int) -> Mapping[Any, float]:
        """Return (variable, arguments) -> derivative of order 2 or 3; arguments ascend."""
        if order not in self._higher:
            self._higher[order] = self._equations.higher(order, self._x, self._p)
        return self._higher[order]

    def _summed(self, derivatives: Mapping[Any, float], sets: Sequence[np.ndarray]) -> np.ndarray:
        out = np.zeros(self.network.variables, dtype=complex)
        for v, rate in multilinear(derivatives, sets).items():
            out[v] = rate
        return out

    def _moving(self, line: ParameterLine) -> dict[int, float]:
        """Return the rates at which rows of parameters change along a line, without zeros."""
        signs = dict(zip(line.names, line.signs, strict=True))
        by_cell = self._equations.by_cell
        names = [by_cell[row][0] if row in by_cell else row for row in self._equations.rows]
        return {r: signs[name] for r, name in enumerate(names) if name in signs}

    def along(self, line: ParameterLine) -> np.ndarray:
        """Return the derivative of the rates along a line of parameters, shape (variables,)."""
        out, moving = np.zeros(self.network.variables), self._moving(line)
        for (v, r), slope in self._equations.by_parameter(self._x, self._p).items():
            out[v] += slope * moving.get(r, 0.0)
        return out

    def linear_along(self, line: ParameterLine, chi: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return derivatives of L0 and L1 along a line of parameters, at a state that stays."""
        moving = self._moving(line)
        slopes: dict[tuple[int, int], float] = {}
        mixed = self._equations.by_parameter_and_argument(self._x, self._p)
        for (v, r, k), slope in mixed.items():
            slopes[v, k] = slopes.get((v, k), 0.0) + slope * moving.get(r, 0.0)
        return self._split(chi, slopes)


@dataclass(frozen=True, eq=False, repr=False)
class Block(ShortRepr):
    """The linearisation in a symmetry class.

    Attributes:
        network: parameters.
        symmetry: of the class's oscillation, the shifts of the whole group.
        now: L0, complex, shape (variables, variables), by the state now.
        past: L1, by the state a delay ago.

    """

    network: Network
    symmetry: Symmetry
    now: np.ndarray
    past: np.ndarray

    @cached_property
    def gait(self) -> str:
        """The network's gait that oscillates in this class, in either direction of its wave."""
        own = dict(self.symmetry.shifts)
        directions = [own, {name: -shift % 1 for name, shift in own.items()}]
        gaits = {gait: dict(self.network.symmetry(gait).shifts) for gait in self.network.gaits()}
        # Some networks have a name for each direction.
        return next((gait for direction in directions for gait, shifts in gaits.items()
                     if shifts == direction), '')

    @property
    def mode(self) -> tuple[int, ...]:
        """(j, k): shifts j/m and k/n of the group's generators, of the orders m and n."""
        return self.symmetry.mode

    @property
    def name(self) -> str:
        """Name as in Buono & Golubitsky's Table 6, ``L_21``."""
        return f'L_{"".join(map(str, self.mode))}'

    @property
    def real(self) -> bool:
        """Whether the class is its own conjugate: its roots are real or in pairs."""
        return self.symmetry.self_conjugate

    @property
    def wave(self) -> str:
        """Direction of the wave, such as 'LF leads LH', or '' where all phases are 0 or 1/2.

        A leg has the phase of its first cell in the network's first assignment.
        """
        legs = next(iter(self.network.legs.values()))
        first, *others = ((leg.upper(), cells[0] - 1) for leg, cells in legs.items())
        for leg, cell in others:
            ahead = (self.symmetry.phases[cell] - self.symmetry.phases[first[1]]) % 1.0
            if ahead not in (0.0, 0.5):
                return f'{leg} leads {first[0]}' if ahead < 0.5 else f'{first[0]} leads {leg}'
        return ''

    @property
    def vector(self) -> np.ndarray:
        """Value of the character for every cell, shape (cells,)."""
        return character(self.symmetry)

    @property
    def leading(self) -> complex:
        """Rightmost root; one of a conjugate pair."""
        return complex(self.roots(1)[0])

    def roots(self, count: int) -> np.ndarray:
        """Return the rightmost roots, at most as many as there are, 1/model time, (count,)."""
        return characteristic_roots(self.now, self.past, self.network.delay, count, self.real)

    def right_of(self, bound: float) -> np.ndarray:
        """Return all roots whose real part is above a bound, rightmost first."""
        return roots_right_of(bound, self.now, self.past, self.network.delay, self.real)

    def within(self, other: 'Block') -> bool:
        """Return whether the class lies in the fixed-point space of the K of the other's gait.

        With the symmetry x -> -x, elements with a shift of 1/2 belong to K, too.
        """
        own = dict(self.symmetry.shifts)
        kept = (Fraction(0), Fraction(1, 2)) if self.symmetry.odd else (Fraction(0),)
        return all(own[name] == shift for name, shift in other.symmetry.shifts if shift in kept)


@cache
def character(symmetry: Symmetry) -> np.ndarray:
    """Return a character's values for the cells, with exact powers of i."""
    quarters = 4.0 * symmetry.phases
    exact = np.array([1.0, 1j, -1.0, -1j])[np.round(quarters).astype(int) % 4]
    return np.where(quarters == np.round(quarters), exact, np.exp(0.5j * np.pi * quarters))


@cache
def characters(group: Group, variables: int, odd: bool) -> tuple[Symmetry, ...]:
    """Return all characters of a network's group, as symmetries of oscillations.

    Raises:
        InputError: the group does not act regularly on the cells, or is not abelian.

    """
    group.check_regular()
    return tuple(homomorphisms(group, [name for name, _ in group.generators], variables, odd))


def power(symmetry: Symmetry, n: int) -> Symmetry:
    """Return the n-th power of a character; -1 for the conjugate."""
    return Symmetry.of(symmetry.group, {name: n * shift % 1 for name, shift in symmetry.shifts},
                       symmetry.variables, symmetry.odd)


def waves_of(network: Network, gait: str) -> list[Symmetry]:
    """Return a gait's symmetry, and that of the wave in the other direction if it has no name."""
    symmetry = network.symmetry(gait)
    other = power(symmetry, -1)
    named = [network.symmetry(name) for name in network.gaits()]
    return [symmetry] if other in named else [symmetry, other]


def block_of(expansion: Expansion, symmetry: Symmetry) -> Block:
    """Return the block of one class.

    Args:
        expansion: at the equilibrium.
        symmetry: of the class, the shifts of the whole group.

    """
    return Block(expansion.network, symmetry, *expansion.linear(character(symmetry)))


def blocks(network: Network, state: np.ndarray) -> tuple[Block, ...]:
    """Split the linearisation at an equilibrium, one block for each cell, by ascending mode.

    Args:
        network: parameters.
        state: of every cell, shape (variables,).

    Raises:
        InputError: weights differ that the network's symmetry makes equal, or its group does not
            act regularly on the cells.

    """
    expansion = Expansion(network, np.asarray(state, dtype=float))
    return tuple(block_of(expansion, symmetry) for symmetry in classes(network))


def block_at(network: Network, state: np.ndarray, mode: tuple[int, ...]) -> Block:
    """Return the block of one class by its mode, as of blocks."""
    symmetry = next(symmetry for symmetry in classes(network) if symmetry.mode == mode)
    return block_of(Expansion(network, np.asarray(state, dtype=float)), symmetry)


def classes(network: Network) -> tuple[Symmetry, ...]:
    """Return the symmetries of the classes; order and errors as of blocks."""
    symmetry = network.symmetry(network.gaits()[0])
    split = characters(symmetry.group, network.variables, symmetry.odd)
    broken = network.broken(split[0])
    if broken:
        raise InputError(f'{broken} differ: the network does not have the symmetry of its gaits')
    return split
