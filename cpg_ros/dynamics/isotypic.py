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

A finite group permutes the cells. Disturbances split into classes, one for each irreducible
representation that occurs; of its d copies one tells all. It is picked out by the symmetry of an
oscillation, ``x_h(i) ~ exp(2 pi i theta(h)) x_i`` for a subgroup H, where theta induces the
representation (Serre, *Linear Representations of Finite Groups*, sections 2.6 and 7.2), and the
linearisation maps these disturbances to one another. An abelian group that takes the first cell
once to each has a block of one cell's size for each character chi, ``sum_i J_1i chi(i)`` (Buono &
Golubitsky 2001, section 5.2). By the equivariant Hopf theorem (Golubitsky, Stewart & Schaeffer
1988, chapter XVI) gaits branch off whose symmetry occurs once in the representation.
"""

from collections.abc import Iterable
from dataclasses import dataclass, replace
from fractions import Fraction
from functools import cache, cached_property, lru_cache
from itertools import chain

from cpg_ros.common.errors import InputError, ShortRepr
from cpg_ros.dynamics.characteristic import characteristic_roots, roots_right_of
from cpg_ros.networks.equations import equations_of, Field
from cpg_ros.networks.network import asymmetry, MAX_ASYMMETRY, Network
from cpg_ros.networks.symmetry import (
    compose,
    generators,
    Group,
    homomorphisms,
    subgroups,
    Symmetry,
)
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


# Irreducible representations in which a group permutes cells.

#: Difference of two characters, and of two vectors of length 1, that is rounding.
ROUNDING_TOLERANCE = 1e-9


def _units(shifts: np.ndarray) -> np.ndarray:
    """Return exp(2 pi i shift), with exact powers of i."""
    quarters = 4.0 * shifts
    exact = np.array([1.0, 1j, -1.0, -1j])[np.round(quarters).astype(int) % 4]
    return np.where(quarters == np.round(quarters), exact, np.exp(0.5j * np.pi * quarters))


def _moved(group: Group, names: Iterable[str], weights: Iterable[complex], vectors: np.ndarray
           ) -> np.ndarray:
    """Return the weighted sum of the images of vectors, shape (cells, n), by some elements."""
    out = np.zeros(vectors.shape, dtype=complex)
    for name, weight in zip(names, weights, strict=True):
        out[list(group.elements[name])] += weight * vectors
    return out


@dataclass(frozen=True, eq=False, repr=False)
class Representation(ShortRepr):
    """An irreducible representation of a group, with disturbances that transform by it.

    Attributes:
        symmetry: of the disturbances.
        values: its character for each of the group's elements, shape (elements,).

    """

    symmetry: Symmetry
    values: np.ndarray

    @property
    def dimension(self) -> int:
        """Number d of independent copies of the disturbances, with the same roots."""
        return round(self.values[0].real)

    @cached_property
    def columns(self) -> np.ndarray:
        """Orthonormal disturbances of cells with the symmetry, shape (cells, m)."""
        symmetry, group = self.symmetry, self.symmetry.group
        images = np.eye(group.cells, dtype=complex)
        if self.dimension > 1:
            images = _moved(group, group.elements, self.values, images)
        images = _moved(group, symmetry.h, _units(np.array([
            float(shift) for _, shift in symmetry.shifts])), images)
        columns: list[np.ndarray] = []
        for image in images.T:
            for column in columns:
                image = image - column * (column.conj() @ image)
            if np.linalg.norm(image) > 1e-6:
                # The first cell that it moves has phase 0.
                first = image[np.flatnonzero(np.abs(image) > ROUNDING_TOLERANCE)[0]]
                columns.append(image * (abs(first) / first) / np.linalg.norm(image))
        out = np.array(columns).reshape(-1, group.cells).T
        return out.real.astype(complex) if symmetry.self_conjugate else out

    @cached_property
    def whole(self) -> np.ndarray:
        """The same for each variable, shape (components, variables m)."""
        return np.kron(np.eye(self.symmetry.variables), self.columns)

    def copies(self, symmetry: Symmetry) -> int:
        """Return how many of the d copies have a symmetry."""
        place = {name: n for n, name in enumerate(symmetry.group.elements)}
        back = _units(-np.array([float(shift) for _, shift in symmetry.shifts]))
        return round((back * self.values[[place[name] for name in symmetry.h]]).mean().real)

    def towards(self, symmetry: Symmetry) -> 'Representation | None':
        """Return the same representation by disturbances with this symmetry and no more.

        Return None if there are none, or more than one of the copies has it.
        """
        group = self.symmetry.group
        target = renamed(symmetry, group)
        if target is None or self.copies(target) != 1:
            return None
        if target == self.symmetry:
            return self
        other = replace(self, symmetry=target)
        for name in group.elements.keys() - set(target.h):
            image = _moved(group, [name], [1.0], other.columns)
            if abs(np.vdot(other.columns, image)) > (
                    1.0 - ROUNDING_TOLERANCE) * other.columns.shape[1]:
                return None
        return other


@cache
def renamed(symmetry: Symmetry, group: Group) -> Symmetry | None:
    """Return a symmetry as one of another group of the same cells; None if H is not in it."""
    if symmetry.group == group:
        return symmetry
    shifts = {group.names.get(symmetry.group.elements[name], ''): shift
              for name, shift in symmetry.shifts}
    return None if '' in shifts else Symmetry.of(group, shifts, symmetry.variables, symmetry.odd)


def _induced(symmetry: Symmetry) -> np.ndarray:
    """Return the character that the shifts of H induce, for every element, shape (elements,)."""
    group, elements = symmetry.group, list(symmetry.group.elements.values())
    inverses = [tuple(np.argsort(element)) for element in elements]
    shifts = {group.elements[name]: float(shift) for name, shift in symmetry.shifts}
    values = []
    for element in elements:
        conjugates = [compose(inverse, compose(element, other))
                      for other, inverse in zip(elements, inverses, strict=True)]
        values.append(_units(np.array([shifts[one] for one in conjugates
                                       if one in shifts])).sum() / len(shifts))
    return np.array(values)


@cache
def representations(group: Group, variables: int, odd: bool) -> tuple[Representation, ...]:
    """Return the irreducible representations that occur on the cells, the trivial one first.

    Raises:
        InputError: a representation is induced by no character of a subgroup; the smallest such
            group has 24 elements.

    """
    result: list[Representation] = []
    candidates = chain.from_iterable(
        homomorphisms(group, names, variables, odd) for names in chain(
            [tuple(name for name, _ in group.generators)],
            (generators(group, h) for h in reversed(subgroups(group)))))
    for symmetry in candidates:
        values = _induced(symmetry)
        if (abs((np.abs(values)**2).mean() - 1.0) < ROUNDING_TOLERANCE
                and not any(np.allclose(values, one.values) for one in result)):
            result.append(Representation(symmetry, values))
        if sum(one.dimension**2 for one in result) == len(group.elements):
            return tuple(one for one in result if one.columns.size)
    raise InputError('the group is not monomial: its classes are not known')


# The symmetry that a network has, and states that it fixes.

@lru_cache(maxsize=256)
def group_of(network: Network) -> Group:
    """Return the group of a network's gaits, or what its parameters leave of it."""
    symmetry = network.symmetry(network.gaits()[0])
    group = symmetry.group
    whole = Symmetry.of(group, dict.fromkeys(group.elements, Fraction(0)), symmetry.variables)
    if not network.broken(whole) and not (equations_of(type(network)).by_cell and type(
            network).families is Network.families and asymmetry(network, whole) > MAX_ASYMMETRY):
        return group
    return group.subgroup(tuple(name for name in group.elements if asymmetry(
        network, Symmetry.of(group, {name: Fraction(0)}, symmetry.variables)) <= MAX_ASYMMETRY))


def everywhere(network: Network, cell: np.ndarray) -> np.ndarray:
    """Return the network's state from that of a cell of each orbit, shape (..., components).

    Args:
        network: parameters.
        cell: for each variable, a value for each orbit of cells, (..., variables orbits), or one
            for all, (..., variables).

    """
    if cell.shape[-1] == network.variables:
        return np.repeat(cell, network.cells, axis=-1)
    orbits = group_of(network).orbits
    blocks = np.arange(network.variables)[:, None] * (orbits.max() + 1)
    return cell[..., (orbits + blocks).ravel()]


class Expansion:
    """Exact derivatives of a network's rates at an equilibrium.

    Attributes:
        network: parameters.
        field: its rates.
        state: shape (components,).
        linear: L0 and L1 of the whole network, shape (components, components) each.

    """

    def __init__(self, network: Network, state: np.ndarray) -> None:
        """Expand about a state of every cell, or of one of each orbit of cells."""
        self.network, self.field = network, Field(network)
        state = np.asarray(state, dtype=float)
        self.state = state if state.size == network.components else everywhere(network, state)
        now, past = self.field.linearised(self.state)[1:]
        self.linear = now, past if past.size else np.zeros_like(now)

    def multilinear(self, *sets: tuple[np.ndarray, np.ndarray], sizes: bool = False
                    ) -> np.ndarray:
        """Derivative of the rates, B(a, b) or C(a, b, c), as of Field.multilinear."""
        return self.field.multilinear((self.state, self.state), *sets, sizes=sizes)


@dataclass(frozen=True, eq=False, repr=False)
class Block(ShortRepr):
    """The linearisation in a symmetry class.

    Attributes:
        network: parameters.
        representation: of the class.
        now: L0, complex, shape (variables m, variables m), by the state now.
        past: L1, by the state a delay ago.

    """

    network: Network
    representation: Representation
    now: np.ndarray
    past: np.ndarray

    @property
    def symmetry(self) -> Symmetry:
        """Symmetry of the class's oscillation."""
        return self.representation.symmetry

    @property
    def copies(self) -> int:
        """How often the network has each of the roots."""
        return self.representation.dimension

    @cached_property
    def gait(self) -> str:
        """The network's gait that oscillates in this class, in either direction of its wave."""
        gaits = {gait: self.network.symmetry(gait) for gait in self.network.gaits()}
        # Some networks have a name for each direction.
        return next((gait for way in (1, -1) for gait, symmetry in gaits.items()
                     if self.representation.towards(power(symmetry, way))), '')

    @property
    def mode(self) -> tuple[int, ...]:
        """(j, k): shifts j/m and k/n of the group's generators, of the orders m and n."""
        return self.symmetry.mode

    @property
    def name(self) -> str:
        """Name as in Buono & Golubitsky's Table 6, ``L_21``; * stands for -1."""
        return f'L_{"".join("*" if j < 0 else str(j) for j in self.mode)}'

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
        """Disturbance of the cells, 1 for the first that it moves, shape (cells,)."""
        column = self.representation.columns[:, 0]
        return np.asarray(column / column[np.flatnonzero(np.abs(column) > ROUNDING_TOLERANCE)[0]])

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

    def embedded(self, vectors: np.ndarray) -> np.ndarray:
        """Return vectors of the block, shape (variables m, ...), for the whole network."""
        return np.asarray(self.representation.whole @ vectors)

    def restricted(self, matrix: np.ndarray) -> np.ndarray:
        """Return a matrix of the whole network in this class."""
        return np.asarray(self.representation.whole.conj().T @ matrix @ self.representation.whole)

    def inside(self, other: 'Block') -> int:
        """Return how many copies lie in the fixed-point space of the K of the other's gait.

        With the symmetry x -> -x, elements with a shift of 1/2 belong to K, too.
        """
        phases = (Fraction(0), Fraction(1, 2)) if self.symmetry.odd else (Fraction(0),)
        return self.representation.copies(Symmetry.of(
            other.symmetry.group, {name: shift for name, shift in other.symmetry.shifts
                                   if shift in phases}, odd=self.symmetry.odd))


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


def classes(network: Network, group: Group | None = None) -> tuple[Representation, ...]:
    """Return the representations of the classes, by ascending mode.

    Args:
        network: parameters.
        group: symmetries of the equilibrium, by default all of the network.

    """
    symmetry = network.symmetry(network.gaits()[0])
    return representations(group or group_of(network), symmetry.variables, symmetry.odd)


@cache
def _class_of(group: Group, symmetry: Symmetry) -> Representation:
    matches = [one for each in representations(group, symmetry.variables, symmetry.odd)
               if (one := each.towards(symmetry)) is not None]
    if not matches:
        raise InputError(f'{symmetry!r} belongs to no class of the equilibrium')
    return matches[0]


def block_of(expansion: Expansion, representation: Representation | Symmetry) -> Block:
    """Return the block of one class.

    Args:
        expansion: at the equilibrium.
        representation: of the class, or the symmetry of its oscillation.

    Raises:
        InputError: no class has this symmetry.

    """
    if isinstance(representation, Symmetry):
        representation = _class_of(group_of(expansion.network), representation)
    block = Block(expansion.network, representation, *expansion.linear)
    return replace(block, now=block.restricted(block.now), past=block.restricted(block.past))


def blocks(network: Network, state: np.ndarray, group: Group | None = None) -> tuple[Block, ...]:
    """Split the linearisation at an equilibrium, a block for each class, by ascending mode.

    Args:
        network: parameters.
        state: of every cell, of one of each orbit of cells, or of all.
        group: symmetries of the equilibrium, by default all of the network.

    """
    expansion = Expansion(network, state)
    return tuple(block_of(expansion, one) for one in classes(network, group))


def block_at(network: Network, state: np.ndarray, mode: tuple[int, ...]) -> Block:
    """Return the block of one class by its mode, as of blocks."""
    return block_of(Expansion(network, state), next(
        one for one in classes(network) if one.symmetry.mode == mode))
