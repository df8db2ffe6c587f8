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

"""Networks for other numbers of legs: ``delayed6`` is the delayed network for six legs.

A network for any even number of legs states by a rule what changes with that number (``fitted``).
The rule makes a class of networks for each requested number, named after its family and the
number, with parameters, gaits and presets of its own.

Legs are named by their position. Two: left and right. Four: left and right, hind and fore (lh,
rh, lf, rf); six have a middle pair, lm and rm, between them. More are counted on each side from
the foremost, l1 r1 l2 r2 ..., as arachnologists do.
"""

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from functools import cache
import re
from typing import Any

from cpg_ros.common.errors import InputError
from cpg_ros.networks.definition import AnyDefinition, leg_count

BIPED = ('left', 'right')
#: ROBOTS: number of legs -> default shipped robot of networks with that number.
ROBOTS = {2: 'biped', 4: 'quadruped', 6: 'hexapod'}
#: GIRDLES: names of the pairs of legs, from the head on.
GIRDLES = ('fore', 'middle', 'hind')
MAX_LEGS = 32

_NUMBERED_NAME = re.compile(r'(?P<family>\w*?[a-z_])(?P<legs>\d+)')


def pairs(legs: int) -> tuple[str, ...]:
    """Return the names of the pairs of legs, hindmost first.

    Raises:
        InputError: the number is not even, or not from 2 to MAX_LEGS.

    """
    if legs % 2 or not 2 <= legs <= MAX_LEGS:
        raise InputError(f'{legs} legs are not an even number from 2 to {MAX_LEGS}')
    if legs == 2:
        return ('',)
    if legs <= 6:
        return ('h', 'm', 'f') if legs == 6 else ('h', 'f')
    return tuple(str(pair) for pair in range(legs // 2, 0, -1))


def leg_names(legs: int) -> tuple[str, ...]:
    """Return the names of the legs, pair by pair from behind, left before right.

    Raises:
        InputError: as of pairs.

    """
    girdles = pairs(legs)
    return BIPED if legs == 2 else tuple(side + pair for pair in girdles for side in 'lr')


def leg_positions(legs: int) -> dict[str, Any]:
    """Return a network's ``sides``, ``girdles`` and ``usual_robot`` for a number of legs.

    Raises:
        InputError: as of pairs.

    """
    if legs == 2:
        return {'sides': {leg: leg for leg in BIPED}, 'girdles': {}, 'usual_robot': ROBOTS[2]}
    girdles = pairs(legs)
    words = dict.fromkeys(girdles, 'middle') | {girdles[0]: 'hind', girdles[-1]: 'fore'}
    names = leg_names(legs)
    return {'sides': {leg: {'l': 'left', 'r': 'right'}[leg[0]] for leg in names},
            'girdles': {leg: words[leg[1:]] for leg in names},
            'usual_robot': ROBOTS.get(legs, '')}


def with_legs(network: type[AnyDefinition], legs: int) -> type[AnyDefinition]:
    """Return a network's class for another number of legs.

    Raises:
        InputError: the network takes no such number.

    """
    family: type[AnyDefinition] = network.family or network
    return family if legs == leg_count(family) else _made(family, legs)


@cache
def _made(family: type[Any], legs: int) -> type[Any]:
    # A network with parameters for each leg must not inherit those of the family's legs.
    bases = family.__bases__ if 'fields' in family.fitted(legs) else (family,)
    return for_legs(legs)(type(f'{family.__name__}{legs}', bases, {
        '__module__': family.__module__, '__doc__': family.__doc__, 'family': family,
        'name': f'{family.name}{legs}'}))


def for_legs(legs: int) -> Callable[[type[Any]], type[Any]]:
    """Make a class the dataclass of a network for a number of legs, by its ``fitted``.

    The class's own attributes take precedence.

    Raises:
        InputError: the network takes no such number.

    """
    def decorate(network: type[Any]) -> type[Any]:
        attributes = network.fitted(legs)
        network.__annotations__ = {**vars(network).get('__annotations__', {}),
                                   **dict.fromkeys(attributes.pop('fields', ()), float)}
        for name, value in attributes.items():
            if name not in vars(network):
                setattr(network, name, value)
        return dataclass(frozen=True)(network)
    return decorate


def unpickle(family: type[AnyDefinition], legs: int, values: tuple[float, ...]) -> AnyDefinition:
    """Return a network from its family, number of legs and parameters: what pickle calls."""
    return with_legs(family, legs)(*values)


def split_name(name: str) -> tuple[str, int] | None:
    """Split a name such as 'delayed6' into the family's name and the number of legs."""
    match = _NUMBERED_NAME.fullmatch(name)
    return (match['family'], int(match['legs'])) if match and len(match['legs']) < 4 else None


def footfall_order(legs: Iterable[str], sides: Mapping[str, str], girdles: Mapping[str, str]
                   ) -> list[str]:
    """Sort legs as footfall diagrams show them: fore before hind, left before right.

    With more than four legs those of a side stay together, so that waves are seen.
    """
    # Legs stand from hind to fore: only their order distinguishes the middle pairs.
    order = list(legs)[::-1]
    rank = [GIRDLES.index(girdles.get(leg, 'fore')) for leg in order]
    right = [sides.get(leg) == 'right' for leg in order]
    key = list(zip(right, rank, strict=True) if len(order) > 4 else zip(rank, right, strict=True))
    return [order[k] for k in sorted(range(len(order)), key=lambda k: key[k])]
