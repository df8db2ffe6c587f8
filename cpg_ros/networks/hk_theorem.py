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

"""The H/K theorem: every symmetry that a periodic solution of a network can have, generated.

Theorem 2.2 of Buono & Golubitsky (2001): in a network with as many symmetries as cells, robust
periodic solutions with spatio-temporal symmetries H and spatial symmetries K exist only for
subgroups K of H with cyclic quotient H/K. Which gait such a pair is, is not known here.
"""

from collections.abc import Iterable, Iterator
from contextlib import suppress
from dataclasses import dataclass
from fractions import Fraction
from functools import cache
from itertools import combinations, product

from cpg_ros.errors import InputError
from cpg_ros.networks.symmetry import Group, Symmetry

#: Names of the elements of a subgroup, in the order in which the group lists them.
Subgroup = tuple[str, ...]


@dataclass(frozen=True)
class Pair:
    """An admissible pair of a network's group.

    Attributes:
        h: the spatio-temporal symmetries.
        k: the spatial symmetries, a subgroup of h.
        order: m, the order of the cyclic quotient h/k: shifts are multiples of T/m.
        waveforms: how many waveforms differ by more than a shift: cells / |h|.
        signals: how many cells differ at all: cells / |k|.
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
    """Return a smallest generating set; of several, the one the group lists first."""
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
    """Return all subgroups of an abelian group, from the trivial one to the whole."""
    found = {_closure(group, ())}
    waiting = list(found)
    while waiting:
        subgroup = waiting.pop()
        for name in group.elements:
            larger = _closure(group, (*subgroup, name))
            if larger not in found:
                found.add(larger)
                waiting.append(larger)
    place = {name: n for n, name in enumerate(group.elements)}
    return tuple(sorted(found, key=lambda names: (len(names), [place[name] for name in names])))


@cache
def admissible_pairs(group: Group) -> tuple[Pair, ...]:
    """Return all pairs H, K of Theorem 2.2, from the largest H and in it from the largest K.

    Raises:
        InputError: the theorem does not apply: not exactly one symmetry takes the first cell
            to each cell, or two symmetries do not commute.

    """
    group.check_regular()
    found = []
    for h, k in product(reversed(subgroups(group)), repeat=2):
        order = len(h) // len(k)
        # The quotient is cyclic if one element runs through all of it.
        if set(k) <= set(h) and any(group.order(name, k) == order for name in h):
            found.append(Pair(h, k, order, group.cells // len(h), group.cells // len(k),
                              (label(group, h), label(group, k))))
    return tuple(found)


@cache
def symmetries(group: Group) -> tuple[Symmetry, ...]:
    """Return all homomorphisms from a subgroup H into the circle, the largest H first.

    A pair of order m has phi(m) of them (Euler's function): the element with shift 1/m may have
    any multiple of it prime to m. With m = 4 these are a wave and the same run backwards.
    """
    return tuple(one for h in reversed(subgroups(group))
                 for one in homomorphisms(group, generators(group, h)))


def homomorphisms(group: Group, names: Iterable[str], variables: int = 2, odd: bool = False
                  ) -> Iterator[Symmetry]:
    """Yield all homomorphisms into the circle of the subgroup that some elements generate.

    Args:
        group: of a network.
        names: of the elements.
        variables: as of a Symmetry.
        odd: as of a Symmetry.

    """
    orders = {name: group.order(name) for name in names}
    for turns in product(*(range(order) for order in orders.values())):
        shifts = {name: Fraction(turn, order)
                  for (name, order), turn in zip(orders.items(), turns, strict=True)}
        # Where generators are not independent, some shifts contradict one another.
        with suppress(InputError):
            yield Symmetry.of(group, shifts, variables, odd)
