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

"""Symmetry groups of networks; a gait is the action of a group on a periodic solution.

A symmetry g of a network permutes its cells. It is a spatio-temporal symmetry of a periodic
solution with shift theta if ``x_{g(i)}(t) = x_i(t + theta T)`` for every cell (Buono & Golubitsky
2001, section 2.1). The spatio-temporal symmetries form a group H, those with shift 0 its subgroup
K, and H/K is cyclic (eq. 2.2). A gait therefore is a homomorphism from a subgroup H into the
circle.
"""

from collections.abc import Collection, Iterable, Iterator, Mapping
from contextlib import suppress
from dataclasses import dataclass, field, replace
from fractions import Fraction
from functools import cache, cached_property
from itertools import combinations, product
import math

from cpg_ros.common.errors import InputError, ShortRepr
import numpy as np

#: g as a permutation: cell i (from 0) goes to cell g[i].
Permutation = tuple[int, ...]


def compose(outer: Permutation, inner: Permutation) -> Permutation:
    """Return the product: first the inner permutation, then the outer one."""
    return tuple(outer[i] for i in inner)


@dataclass(frozen=True)
class Group:
    """A finite group of permutations of cells.

    Attributes:
        cells: number of cells.
        generators: name -> permutation; names of other elements are products of these, of which
            the first factor acts first.

    """

    cells: int
    generators: tuple[tuple[str, Permutation], ...]

    @cached_property
    def elements(self) -> dict[str, Permutation]:
        """Name -> permutation; the identity is '1', powers are written 'omega^2'."""
        names, powers = [], []
        for name, generator in self.generators:
            power = tuple(range(self.cells))
            powers_of: list[Permutation] = []
            while not powers_of or power != powers_of[0]:
                powers_of.append(power)
                power = compose(generator, power)
            powers.append(powers_of)
            names.append(['', name, *(f'{name}^{k}' for k in range(2, len(powers_of)))])
        named: dict[Permutation, str] = {}
        for choice in product(*(range(len(powers_of)) for powers_of in powers)):
            element = tuple(range(self.cells))
            for powers_of, k in zip(powers, choice, strict=True):
                element = compose(powers_of[k], element)
            name = ' '.join(names[g][k] for g, k in enumerate(choice) if k)
            named.setdefault(element, name or '1')
        # Of a group that is not abelian these products need not be all elements.
        waiting = list(named)
        while waiting:
            element = waiting.pop(0)
            for name, generator in self.generators:
                image = compose(generator, element)
                if image not in named:
                    named[image] = f'{named[element]} {name}'
                    waiting.append(image)
        return {name: element for element, name in named.items()}

    @cached_property
    def names(self) -> dict[Permutation, str]:
        """Permutation -> name."""
        return {element: name for name, element in self.elements.items()}

    @cached_property
    def orbits(self) -> np.ndarray:
        """Number of each cell's orbit, from 0, shape (cells,): which cells change places."""
        smallest = np.array(list(self.elements.values())).min(axis=0)
        return np.unique(smallest, return_inverse=True)[1]

    def subgroup(self, names: 'Subgroup') -> 'Group':
        """Return a subgroup, given by all of its elements' names, as a group."""
        return Group(self.cells, tuple((name, self.elements[name])
                                       for name in generators(self, names)))

    @cached_property
    def exponent(self) -> int:
        """Least common multiple of the orders of all elements."""
        return math.lcm(*(self.order(name) for name in self.elements))

    def check_regular(self) -> None:
        """Check that the group is abelian and acts regularly on the cells.

        Raises:
            InputError: it does not.

        """
        elements = self.elements.values()
        if sorted(element[0] for element in elements) != list(range(self.cells)):
            raise InputError(f'the group has {len(elements)} symmetries of {self.cells} cells; '
                             f'exactly one must take the first cell to each cell')
        if any(compose(a, b) != compose(b, a) for a, b in combinations(elements, 2)):
            raise InputError('the group is not abelian')

    def order(self, name: str, modulo: Collection[str] = ('1',)) -> int:
        """Return the smallest power of an element that lies in a subgroup, given by names."""
        subgroup = [self.elements[member] for member in modulo]
        element = power = self.elements[name]
        order = 1
        while power not in subgroup:
            power = compose(element, power)
            order += 1
        return order

    def generated(self, shifts: Mapping[str, Fraction]) -> dict[str, Fraction]:
        """Extend shifts of some elements to the subgroup they generate, element name -> shift.

        Raises:
            ValueError: the shifts contradict one another.

        """
        phases = {tuple(range(self.cells)): Fraction(0)}
        waiting = list(phases)
        while waiting:
            element = waiting.pop()
            for name, shift in shifts.items():
                image = compose(self.elements[name], element)
                theta = (phases[element] + shift) % 1
                if image not in phases:
                    phases[image] = theta
                    waiting.append(image)
                elif phases[image] != theta:
                    raise InputError(f'{self.names[image]} would have the shifts {theta} and '
                                     f'{phases[image]}')
        return {name: phases[element] for name, element in self.elements.items()
                if element in phases}


#: omega: i -> i + 2 round both rings; kappa swaps 1-2, 3-4, 5-6, 7-8 (two rings of four cells).
Z4_Z2 = Group(8, (('omega', (2, 3, 4, 5, 6, 7, 0, 1)), ('kappa', (1, 0, 3, 2, 5, 4, 7, 6))))
#: Primary gait with this group -> (j, k): shifts j/4 of omega and k/2 of kappa (Buono & Golubitsky
#: 2001, Table 2). j = 1 stands for both senses in which a wave can run round the ring.
GAITS = {'pronk': (0, 0), 'pace': (0, 1), 'bound': (2, 0), 'trot': (2, 1),
         'jump': (1, 0), 'walk': (1, 1)}
#: rho: 1-2, 3-4 (left and right); tau: 1-3, 2-4 (flexor and extensor).
D2 = Group(4, (('rho', (1, 0, 3, 2)), ('tau', (2, 3, 0, 1))))


@dataclass(frozen=True, repr=False)
class Symmetry(ShortRepr):
    """The spatio-temporal symmetry of a gait: a shift for every element of H.

    Attributes:
        group: of the network.
        shifts: element name -> shift in cycles, a homomorphism on H.
        variables: state variables of a cell.
        odd: whether network and gait have the symmetry x -> -x with a shift of 1/2: every waveform
            is its own negative half a cycle later.
        leads: phase of each cell in cycles that parameters state, between different waveforms;
            comparisons ignore it.

    """

    group: Group
    shifts: tuple[tuple[str, Fraction], ...]
    variables: int = 2
    odd: bool = False
    leads: tuple[float, ...] = field(default=(), compare=False)

    def _summary(self) -> str:
        return f'{self.group.cells} cells: ' + ', '.join(
            f'{name} by {shift}' for name, shift in self.shifts if name != '1')

    @classmethod
    def of(cls, group: Group, shifts: Mapping[str, Fraction | float], variables: int = 2,
           odd: bool = False, leads: tuple[float, ...] = ()) -> 'Symmetry':
        """Build a symmetry from the shifts of elements that generate H.

        Raises:
            ValueError: the shifts contradict one another, or an element is not in the group.

        """
        for name in shifts:
            if name not in group.elements:
                raise InputError(f"'{name}' is not one of {', '.join(group.elements)}")
        symmetry = _generated(group, tuple(shifts.items()), variables, odd)
        return symmetry.with_leads(leads)

    def with_leads(self, leads: tuple[float, ...]) -> 'Symmetry':
        """Return the same symmetry with other stated phases of the cells."""
        return self if leads == self.leads else replace(self, leads=leads)

    def with_variables(self, variables: int) -> 'Symmetry':
        """Return the same symmetry for cells with this number of variables."""
        if variables == self.variables:
            return self
        return _generated(self.group, self.shifts, variables, self.odd).with_leads(self.leads)

    @property
    def h(self) -> tuple[str, ...]:
        """Names of the elements of H."""
        return tuple(name for name, _ in self.shifts)

    @property
    def k(self) -> tuple[str, ...]:
        """Names of the elements of K, the purely spatial symmetries."""
        return tuple(name for name, shift in self.shifts if shift == 0)

    @cached_property
    def order(self) -> int:
        """Order m of the cyclic group H/K; after T/m cells have changed places."""
        return len(self.shifts) // len(self.k)

    @cached_property
    def permutation(self) -> np.ndarray:
        """Return the cells, shape (cells,), with ``x_i(t + T/m) = x_{permutation_i}(t)``."""
        name = next(name for name, shift in self.shifts if shift == Fraction(1, self.order) % 1)
        return np.array(self.group.elements[name])

    @cached_property
    def _orbit_of_cells(self) -> tuple[np.ndarray, np.ndarray]:
        waves, phases = np.full(self.group.cells, -1), np.zeros(self.group.cells)
        for cell in range(self.group.cells):
            if waves[cell] < 0:
                wave = waves.max() + 1
                for name, shift in self.shifts:
                    image = self.group.elements[name][cell]
                    waves[image], phases[image] = wave, float(shift)
        return waves, phases

    @cached_property
    def _hash(self) -> int:
        return hash((self.group, self.shifts, self.variables, self.odd))

    def __hash__(self) -> int:
        return self._hash

    @property
    def waves(self) -> np.ndarray:
        """Number of each cell's waveform, from 0, shape (cells,)."""
        return self._orbit_of_cells[0]

    @cached_property
    def mode(self) -> tuple[int, ...]:
        """(j, k): shifts j/m and k/n of the generators, of orders m and n; -1 outside H."""
        shifts = dict(self.shifts)
        return tuple(int(shifts[name] * self.group.order(name)) if name in shifts else -1
                     for name, _ in self.group.generators)

    @cached_property
    def self_conjugate(self) -> bool:
        """Whether all shifts are 0 or 1/2, so that both directions of a wave coincide."""
        return all(2 * shift % 1 == 0 for _, shift in self.shifts)

    @cached_property
    def phases(self) -> np.ndarray:
        """Phase of each cell in cycles, shape (cells,): x_i(t) = u_wave(i)(t + phase_i T)."""
        shifts = self._orbit_of_cells[1]
        if not self.leads:
            return shifts
        return (shifts + np.array(self.leads)[self.first[self.waves]]) % 1.0

    @cached_property
    def first(self) -> np.ndarray:
        """First cell (from 0) of each waveform, shape (waves,)."""
        return np.unique(self.waves, return_index=True)[1]

    @cached_property
    def classes(self) -> np.ndarray:
        """Class of each cell under K, from 0, shape (cells,); a class has one signal."""
        numbers = np.full(self.group.cells, -1)
        for cell in range(self.group.cells):
            if numbers[cell] < 0:
                numbers[[self.group.elements[name][cell] for name in self.k]] = numbers.max() + 1
        return numbers

    @cached_property
    def basis(self) -> np.ndarray:
        """Orthonormal rows that span the gait's class, shape (variables * d, variables * cells).

        The class is Fix(K), which the flow never leaves. With x -> -x, an element with shift 1/2
        fixes states in combination with the sign.
        """
        stabiliser = [(self.group.elements[name], 1.0 if shift == 0 else -1.0)
                      for name, shift in self.shifts
                      if shift == 0 or (self.odd and shift == Fraction(1, 2))]
        rows, covered = [], np.zeros(self.group.cells, dtype=bool)
        for cell in range(self.group.cells):
            if not covered[cell]:
                row = np.zeros(self.group.cells)
                for element, sign in stabiliser:
                    row[element[cell]] += sign
                covered |= row != 0.0
                rows.append(row / np.linalg.norm(row))
        return np.kron(np.eye(self.variables), np.array(rows))


@cache
def _generated(group: Group, shifts: tuple[tuple[str, Fraction | float], ...], variables: int,
               odd: bool) -> Symmetry:
    exact = {name: Fraction(shift).limit_denominator(64) % 1 for name, shift in shifts}
    return Symmetry(group, tuple(group.generated(exact).items()), variables, odd)


# The H/K theorem: all symmetries that a periodic solution of a network can have.

#: Names of the elements of a subgroup, in the order in which the group lists them.
Subgroup = tuple[str, ...]


@dataclass(frozen=True)
class Pair:
    """An admissible pair of a network's group.

    Attributes:
        h: spatio-temporal symmetries.
        k: spatial symmetries, a subgroup of h.
        order: m, order of the cyclic quotient h/k; shifts are multiples of T/m.
        waveforms: number of waveforms that differ by more than a shift, cells / |h|.
        signals: number of cells with different signals, cells / |k|.
        labels: of h and k, by generators.

    """

    h: Subgroup
    k: Subgroup
    order: int
    waveforms: int
    signals: int
    labels: tuple[str, str]


def _closure(group: Group, names: Iterable[str]) -> Subgroup:
    return tuple(group.generated(dict.fromkeys(names, Fraction(0))))


@cache
def generators(group: Group, subgroup: Subgroup) -> Subgroup:
    """Return a smallest generating set, the first in the group's order."""
    # A group of n elements needs at most log2(n) generators.
    return next(names for size in range(len(subgroup).bit_length())
                for names in combinations(subgroup[1:], size)
                if _closure(group, names) == subgroup)


def label(group: Group, subgroup: Subgroup) -> str:
    """Return a readable name, such as '<omega^2, kappa>', '<omega kappa>' or '1'."""
    # The group counts its last generator fastest; read it first generator first.
    names = generators(group, subgroup)[::-1]
    return f'<{", ".join(names)}>' if names else '1'


@cache
def subgroups(group: Group) -> tuple[Subgroup, ...]:
    """Return all subgroups of a group, from the trivial one to the whole."""
    groups = {_closure(group, ())}
    waiting = list(groups)
    while waiting:
        subgroup = waiting.pop()
        for name in group.elements:
            larger = _closure(group, (*subgroup, name))
            if larger not in groups:
                groups.add(larger)
                waiting.append(larger)
    index = {name: n for n, name in enumerate(group.elements)}
    return tuple(sorted(groups, key=lambda names: (len(names), [index[name] for name in names])))


@cache
def admissible_pairs(group: Group) -> tuple[Pair, ...]:
    """Return all pairs H, K of Theorem 2.2, ordered from the largest H, then from the largest K.

    Raises:
        InputError: the theorem does not apply: the group does not act regularly, or is not
            abelian.

    """
    group.check_regular()
    pairs = []
    for h, k in product(reversed(subgroups(group)), repeat=2):
        order = len(h) // len(k)
        # The quotient is cyclic if an element generates it.
        if set(k) <= set(h) and any(group.order(name, k) == order for name in h):
            pairs.append(Pair(h, k, order, group.cells // len(h), group.cells // len(k),
                              (label(group, h), label(group, k))))
    return tuple(pairs)


@cache
def symmetries(group: Group) -> tuple[Symmetry, ...]:
    """Return all homomorphisms from a subgroup H into the circle, the largest H first.

    A pair of order m has phi(m) of them (Euler's function): the shift 1/m times any number prime
    to m. For m = 4 these are a wave and its reverse.
    """
    return tuple(homomorphism for h in reversed(subgroups(group))
                 for homomorphism in homomorphisms(group, generators(group, h)))


def homomorphisms(group: Group, names: Iterable[str], variables: int = 2, odd: bool = False
                  ) -> Iterator[Symmetry]:
    """Yield all homomorphisms into the circle of the subgroup that some elements generate.

    Args:
        group: of a network.
        names: of the elements.
        variables: as of Symmetry.
        odd: as of Symmetry.

    """
    orders = {name: group.order(name) for name in names}
    for steps in product(*(range(order) for order in orders.values())):
        shifts = {name: Fraction(step, order)
                  for (name, order), step in zip(orders.items(), steps, strict=True)}
        # If generators are not independent, some of their shifts contradict each other.
        with suppress(InputError):
            yield Symmetry.of(group, shifts, variables, odd)
