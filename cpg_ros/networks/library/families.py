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

"""Networks with weights between legs, one for each pair and direction, and their gaits.

Legs are counted pair by pair from behind, left before right; first come the first cells of all
legs, then the second ones. A gait is given by a group that acts regularly on the cells: Z2 x Z2 of
sides and girdles for four legs in phase or half a cycle apart; for the walk and for more legs the
cycle in which the legs touch down. The second cells of legs, antagonists, are half a cycle apart
from the first ones.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from fractions import Fraction
from functools import cache
import math
from typing import Any, ClassVar

from cpg_ros.common.errors import InputError
from cpg_ros.networks.definition import leg_count, Range
from cpg_ros.networks.leg_numbers import leg_names, leg_positions
from cpg_ros.networks.network import known, Network
from cpg_ros.networks.symmetry import GAITS, Group, Permutation, Symmetry, Z4_Z2

# Two rings of cells for any even number of legs (Golubitsky, Stewart, Buono & Collins 1999).

#: Number of legs -> names of the two gaits in which neighbouring legs of a side are half a cycle
#: apart: with the legs of a pair half a cycle apart, and with these together.
_ALTERNATING = {4: ('trot', 'bound'), 6: ('tripod', 'lurch'), 8: ('tetrapod', 'lurch')}


def behind(i: int) -> int:
    """Return the cell behind cell i on the same side."""
    return i - 2


def across(i: int) -> int:
    """Return the cell opposite cell i."""
    return i ^ 1


@cache
def ring_group(legs: int) -> Group:
    """Return Z2n x Z2 of 2n legs."""
    if legs == 4:
        return Z4_Z2
    cells = 2 * legs
    return Group(cells, (('omega', tuple((i + 2) % cells for i in range(cells))),
                         ('kappa', tuple(i ^ 1 for i in range(cells)))))


@cache
def ring_gaits(legs: int) -> dict[str, tuple[int, int]]:
    """Return gait -> (j, k): shifts j/2n of omega and k/2 of kappa.

    A wave runs from hind to fore, as in insects: each leg follows the one behind it, and j is
    negative. Up to eight legs have the reverse, too. For four legs j = 1 stands for both
    directions.
    """
    if legs == 4:
        return GAITS
    antiphase, in_phase = _ALTERNATING.get(legs, ('alternating', 'lurch'))
    half = legs // 2
    # Long waves forward do not attract: the same ones from hind to fore take over.
    reverse = {'reverse_ripple': (2, 1), 'reverse_wave': (1, 1)} if legs <= 8 else {}
    return {antiphase: (half, 1), 'ripple': (-2, 1), 'wave': (-1, 1), **reverse, 'pace': (0, 1),
            'pronk': (0, 0), in_phase: (half, 0), 'inchworm': (-2, 0), 'caterpillar': (-1, 0)}


@cache
def ring_symmetry(legs: int, mode: tuple[int, int], variables: int, odd: bool = False) -> Symmetry:
    """Return the symmetry of the mode (j, k) in the rings of 2n legs."""
    j, k = mode
    return Symmetry.of(ring_group(legs), {'omega': Fraction(j, legs), 'kappa': Fraction(k, 2)},
                       variables, odd)


def ring_legs(legs: int) -> dict[str, dict[str, tuple[int, int]]]:
    """Return the two cells that drive each leg, by assignment.

    ``implicit`` runs along the second cells of a ring from fore to hind (Buono & Golubitsky 2001,
    Table 3), ``zigzag`` again from hind to fore.
    """
    names = leg_names(legs)
    count = len(names)
    if count < 4:
        raise InputError(f'{legs} legs are too few for two rings, which need at least 4')
    first = {leg: 1 + i for i, leg in enumerate(names)}
    back = {leg: 1 + count + (count - 2 - (i - i % 2)) + i % 2 for i, leg in enumerate(names)}
    return {'implicit': {leg: (first[leg], back[leg]) for leg in names},
            'zigzag': {leg: (first[leg], first[leg] + count) for leg in names}}


def ring_places(legs: int) -> dict[str, Any]:
    """Return the attributes of a network of two rings for a number of legs."""
    return {'cells': 2 * legs, 'legs': ring_legs(legs), **leg_positions(legs)}


#: Phases of LH RH LF RF, in quarters of a cycle.
GAITS_OF_FOUR = {'trot': (0, 2, 2, 0), 'pace': (0, 2, 0, 2), 'bound': (0, 0, 2, 2),
                 'pronk': (0, 0, 0, 0), 'walk': (0, 2, 3, 1), 'diagonal_walk': (0, 2, 1, 3)}


def partners(legs: int) -> dict[str, tuple[int, ...]]:
    """Return name of weights -> input leg of each leg, from 0.

    The input is the other leg of the pair or, in a pair further on, the leg of the same side or
    the leg of the other side.
    """
    inputs = {'k_side': tuple(i ^ 1 for i in range(legs))}
    for m in range(1, legs // 2):
        number = '' if legs == 4 else str(m)
        ahead = tuple((i + 2 * m) % legs for i in range(legs))
        inputs[f'k_girdle{number}'] = ahead
        inputs[f'k_diagonal{number}'] = tuple(i ^ 1 for i in ahead)
    return inputs


@cache
def gait_phases(legs: int) -> dict[str, tuple[Fraction, ...]]:
    """Return gait -> phases of the legs in cycles."""
    if legs == 4:
        return {gait: tuple(Fraction(quarter, 4) for quarter in quarters)
                for gait, quarters in GAITS_OF_FOUR.items()}
    if legs == 2:
        return {'walk': (Fraction(0), Fraction(1, 2)), 'hop': (Fraction(0), Fraction(0))}
    listed = {gait: tuple((Fraction(i // 2 * j, legs) + Fraction(i % 2 * k, 2)) % 1
                          for i in range(legs)) for gait, (j, k) in ring_gaits(legs).items()}
    return {gait: phases for gait, phases in listed.items() if _even(phases)}


def _even(phases: tuple[Fraction, ...]) -> bool:
    """Return whether the phases are evenly spread, with equally many legs at each."""
    distinct = sorted(set(phases))
    return (distinct == [Fraction(n, len(distinct)) for n in range(len(distinct))]
            and len({phases.count(phase) for phase in distinct}) == 1)


@cache
def symmetry_of(phases: tuple[Fraction, ...], variables: int = 2, each: int = 1) -> Symmetry:
    """Return the symmetry of legs with these phases and one cell, or two antagonists, each."""
    legs, distinct = len(phases), len(set(phases))
    steps: dict[str, Permutation] = {'side': (1, 0, 3, 2), 'girdle': (2, 3, 0, 1)}
    shifts = {'side': phases[1], 'girdle': phases[2]} if legs == 4 else {}
    if legs != 4 or distinct > 2:
        # Map each leg to a leg with the next phase.
        waiting = {phase: [leg for leg in range(legs) if phases[leg] == phase] for phase in phases}
        order = [waiting[Fraction(n % distinct, distinct)].pop(0) for n in range(legs)]
        after = dict(zip(order, order[1:] + order[:1], strict=True))
        steps = {'cycle': tuple(after[leg] for leg in range(legs))}
        shifts = {'cycle': Fraction(1, distinct) % 1}
    if each == 2:
        steps = {name: (*step, *(legs + leg for leg in step)) for name, step in steps.items()}
        steps['antagonist'] = tuple((leg + legs) % (2 * legs) for leg in range(2 * legs))
        shifts['antagonist'] = Fraction(1, 2)
    return Symmetry.of(Group(each * legs, tuple(steps.items())), shifts, variables)


@dataclass(frozen=True)
class LegPairs(Network):
    """A network with a weight k_FROM_TO between any two of its legs."""

    #: Cells of a leg: one, or two antagonists.
    each: ClassVar[int] = 1
    #: Ranges of the parameters other than the weights, and the largest weight.
    own_ranges: ClassVar[dict[str, Range]]
    most: ClassVar[float] = 20.0
    #: Parameters of all presets other than the weights, and the largest weight that is usual.
    usual: ClassVar[dict[str, float]]
    looked_for: ClassVar[float] = 2.0

    @classmethod
    def fitted(cls, legs: int) -> dict[str, Any]:
        """Return the network's attributes for this many legs; InputError for an odd number."""
        names, inputs = leg_names(legs), partners(legs)
        groups = {kind: tuple(f'k_{names[j]}_{names[i]}' for i, j in enumerate(sources))
                  for kind, sources in inputs.items()}
        weights = tuple(name for members in groups.values() for name in members)
        return {
            **leg_positions(legs), 'cells': cls.each * legs, 'groups': groups,
            'couplings': weights,
            'own_of_cells': {kind: cls.each * members for kind, members in groups.items()},
            'legs': {'implicit': {leg: tuple(1 + n + m * legs for m in range(cls.each))
                                  for n, leg in enumerate(names)}},
            'searched': {**{name: (value, value) for name, value in cls.usual.items()},
                         **dict.fromkeys(groups, (-cls.looked_for, cls.looked_for))},
            'ranges': {**cls.own_ranges, **{name: Range(
                -cls.most, cls.most, 'weight from {1} to {2}'.format(*name.split('_')))
                for name in weights}},
            'usual_gait': next(iter(gait_phases(legs))), 'fields': weights}

    @classmethod
    def inputs(cls) -> dict[str, tuple[int, ...]]:
        """Return name of weights -> input cell of each cell, from 0."""
        count = leg_count(cls)
        return {kind: tuple(j + m * count for m in range(cls.each) for j in sources)
                for kind, sources in partners(count).items()}

    @classmethod
    def gaits(cls) -> tuple[str, ...]:
        """Return the names of the gaits."""
        return tuple(gait_phases(leg_count(cls)))

    @classmethod
    def phases(cls, gait: str) -> tuple[Fraction, ...]:
        """Return the phases of a gait's legs, cycles; ValueError for an unknown gait."""
        return gait_phases(leg_count(cls))[known(gait, cls.gaits())]

    def symmetry(self, gait: str) -> Symmetry:
        """Return the gait's symmetry.

        Raises:
            ValueError: there is no such gait.

        """
        return symmetry_of(self.phases(gait), self.variables, self.each)

    @classmethod
    def families(cls, symmetry: Symmetry) -> tuple[tuple[str, ...], ...]:
        """Return the weights that H of a gait permutes: k(g j -> g i) and k(j -> i)."""
        count = leg_count(cls)
        names = leg_names(count)
        elements = [symmetry.group.elements[name] for name in symmetry.h]
        members: dict[str, tuple[str, ...]] = {
            name: (name,) for name in cls.parameters() if name not in cls.couplings}
        for sources in partners(count).values():
            for i, j in enumerate(sources):
                family = tuple(dict.fromkeys(f'k_{names[g[j] % count]}_{names[g[i] % count]}'
                                             for g in elements))
                members.setdefault(min(family), family)
        return tuple(members.values())

    @classmethod
    def weights(cls, gait: str, size: float = 1.0, quarter: float = -1.0) -> Mapping[str, float]:
        """Return weights that select a gait: cos + quarter * sin of the lead of the input leg.

        Weights are 1 between legs in phase and -1 between legs half a cycle apart; on the walk
        they are quarter from the leg a quarter ahead, and -quarter from the leg a quarter behind.
        """
        names, phases, couplings = leg_names(leg_count(cls)), cls.phases(gait), {}
        for sources in partners(leg_count(cls)).values():
            for i, j in enumerate(sources):
                ahead = 2.0 * math.pi * float((phases[j] - phases[i]) % 1)
                couplings[f'k_{names[j]}_{names[i]}'] = size * round(
                    math.cos(ahead) + quarter * math.sin(ahead), 12)
        return couplings
