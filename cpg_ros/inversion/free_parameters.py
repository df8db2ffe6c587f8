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

"""Which numbers of a network a fit may move, and within what bounds."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TypeVar

from cpg_ros.dynamics.hopf_point import first_hopf
from cpg_ros.errors import InputError
from cpg_ros.networks.network import Network
import numpy as np

N = TypeVar('N', bound=Network)
#: Places at which the edge of the Hopf set is looked for between a value and a bound, and
#: halvings that then find it.
PLACES, HALVINGS = 64, 40


@dataclass(frozen=True)
class Free:
    """A free number of a network in a gait.

    Attributes:
        name: of a parameter, or of a group of them.
        members: parameters that take its value: those that the gait's symmetry needs equal; none
            if it is not the network's.
        low, high: bounds.

    """

    name: str
    members: tuple[str, ...]
    low: float
    high: float

    def value(self, network: Network) -> float:
        """Its value in a network."""
        return float(getattr(network, self.members[0]))


def free_numbers(network: Network, gait: str, names: Sequence[str],
                 bounds: Mapping[str, tuple[float, float]] | None = None) -> tuple[Free, ...]:
    """Return the free numbers of a fit.

    Args:
        network: parameters.
        gait: one of its gaits.
        names: of parameters, or of groups that the network sets together.
        bounds: name -> lower and upper bound, where narrower than the range.

    Raises:
        InputError: a name is unknown or given twice, or bounds cannot be used.

    """
    bounds = dict(bounds or {})
    families = network.families(network.symmetry(gait))
    known = (*network.parameters(), *network.groups)
    found: list[Free] = []
    if not names or isinstance(names, str):
        raise InputError(f'no names of parameters to fit; there are {", ".join(known)}')
    if len(set(names)) < len(names):
        raise InputError(f"names are '{', '.join(names)}'; they must be different ones")
    for name in names:
        if name not in known:
            raise InputError(f"'{name}' is not one of the parameters of {network.name}: "
                             f'{", ".join(known)}')
        members = network.groups.get(name, (name,))
        members = tuple(dict.fromkeys(
            member for family in families if set(family) & set(members) for member in family))
        taken = [other.name for other in found if set(other.members) & set(members)]
        if taken:
            raise InputError(f'{name} is the same as {taken[0]}, which is free already')
        low = max(network.ranges[member].low for member in members)
        high = min(network.ranges[member].high for member in members)
        if name in bounds:
            least, most = bounds.pop(name)
            if not low <= least < most <= high:
                raise InputError(f'{name}: bounds {least:g} to {most:g} are not in order within '
                                 f'{low:g} to {high:g}')
            low, high = least, most
        found.append(Free(name, members, low, high))
    if bounds:
        raise InputError(f"'{next(iter(bounds))}' has bounds but is not free")
    return tuple(found)


def with_values(network: N, free: Sequence[Free], values: Sequence[float] | np.ndarray) -> N:
    """Return the network with values for its free numbers, in their order."""
    return replace(network, **{  # type: ignore[type-var]
        member: float(value) for one, value in zip(free, values, strict=True)
        for member in one.members})


def within_hopf_set(network: Network, gait: str, one: Free) -> Free:
    """Narrow the bounds of a single free number to where its gait is born before the delay.

    The bounds of networks without a delay stay.
    """
    if not network.delay_parameter:
        return one

    def excess(value: float) -> float:
        there = with_values(network, (one,), (value,))
        if there.delay <= 0.0 or there.symmetry(gait) != network.symmetry(gait):
            return -1.0
        point = first_hopf(there, gait)
        return -1.0 if point is None or point.drifts else there.delay - point.value

    here, ends = one.value(network), []
    for end in (one.low, one.high):
        inside = here
        for outside in np.linspace(here, end, PLACES)[1:]:
            if excess(float(outside)) <= 0.0:
                for _ in range(HALVINGS):
                    middle = 0.5 * (inside + outside)
                    inside, outside = ((middle, outside) if excess(middle) > 0.0
                                       else (inside, middle))
                break
            inside = float(outside)
        ends.append(inside)
    return Free(one.name, one.members, *ends)
