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

"""Two rings of cells for any even number of legs (Golubitsky, Stewart, Buono & Collins 1999).

2n legs are driven by 4n cells, a ring of 2n cells on each side: odd numbers left, even ones right.
The symmetry group is Z2n (omega: i -> i + 2, round both rings) x Z2 (kappa: 1-2, 3-4 ...), and a
primary gait gives these the shifts j/2n and k/2. The first n cells of a ring are its legs' own,
from hind to fore; the others are their second cells.

The gaits of six legs have the names of that paper's hexapod gaits where engineers have none:
*wave* is its metachronal gait, *ripple* (also called tetrapod) its rolling tripod.
"""

from fractions import Fraction
from functools import cache
from typing import Any

from cpg_ros.errors import InputError
from cpg_ros.networks.leg_numbers import leg_names, places
from cpg_ros.networks.symmetry import GAITS, Group, Symmetry, Z4_Z2

#: By number of legs: the gaits in which neighbouring legs of a side are half a cycle apart, right
#: and left legs of a pair as well, or together.
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

    A wave runs from hind to fore, as insects' do: each leg follows the one behind it, j is
    negative; up to eight legs have the reverse, too. Of four legs j = 1 stands for both senses.
    """
    if legs == 4:
        return GAITS
    opposed, together = _ALTERNATING.get(legs, ('alternating', 'lurch'))
    half = legs // 2
    # Long waves forward do not attract: the same ones from hind to fore take over.
    reverse = {'reverse_ripple': (2, 1), 'reverse_wave': (1, 1)} if legs <= 8 else {}
    return {opposed: (half, 1), 'ripple': (-2, 1), 'wave': (-1, 1), **reverse, 'pace': (0, 1),
            'pronk': (0, 0), together: (half, 0), 'inchworm': (-2, 0), 'caterpillar': (-1, 0)}


@cache
def ring_symmetry(legs: int, mode: tuple[int, int], variables: int, odd: bool = False
                  ) -> Symmetry:
    """Return the symmetry of the mode (j, k) in the rings of 2n legs."""
    j, k = mode
    return Symmetry.of(ring_group(legs), {'omega': Fraction(j, legs), 'kappa': Fraction(k, 2)},
                       variables, odd)


def ring_legs(legs: int) -> dict[str, dict[str, tuple[int, int]]]:
    """Return which two cells drive each leg, by assignment.

    ``implicit`` takes the second cells of a ring back from fore to hind (Buono & Golubitsky 2001,
    Table 3), ``zigzag`` once more from hind to fore.
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
    """Return what a network of such rings states for a number of legs: cells, legs, places."""
    return {'cells': 2 * legs, 'legs': ring_legs(legs), **places(legs)}
