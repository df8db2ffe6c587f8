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

"""What may vary when weights are looked for: couplings that keep a gait's symmetry, and cells.

A gait with the spatio-temporal symmetries H needs a network that every element g of H maps onto
itself: ``w(g k <- g j) = w(k <- j)``. So one number goes with each orbit of directed couplings
under H: three for the biped's primary gaits, six for its secondary ones.
"""

from collections.abc import Mapping
from dataclasses import dataclass

from cpg_ros.errors import InputError
from cpg_ros.networks.network import known, Network
from cpg_ros.networks.registry import find_network, is_path, NETWORKS, SHIPPED
from cpg_ros.networks.symmetry import Symmetry
import numpy as np

#: Shipped networks whose weights can be looked for.
SEARCHED: dict[str, type[Network]] = {
    name: SHIPPED[name] for name in sorted(SHIPPED) if SHIPPED[name].searched}
#: Values have this many decimals, so that what is found can be written down as it is.
DECIMALS = 4


@dataclass(frozen=True)
class Variable:
    """A number to search for, or a given one where ``low`` and ``high`` agree.

    Attributes:
        name: by which it is fixed or bounded.
        low, high: bounds.
        members: parameters of the network that take its value.

    """

    name: str
    low: float
    high: float
    members: tuple[str, ...]

    @property
    def free(self) -> bool:
        """Whether it has a range."""
        return self.low < self.high


@dataclass(frozen=True)
class Space:
    """Parameter sets of a network that have the symmetry of a gait.

    Attributes:
        network: whose parameters.
        gait: one of its gaits.
        variables: all of them, free or given.

    """

    network: type[Network]
    gait: str
    variables: tuple[Variable, ...]

    @property
    def free(self) -> tuple[Variable, ...]:
        """The variables to search for."""
        return tuple(variable for variable in self.variables if variable.free)

    @property
    def symmetry(self) -> Symmetry:
        """Symmetry of the gait, which all sets have."""
        return self.build(np.array([one.low for one in self.free])).symmetry(self.gait)

    def build(self, values: np.ndarray) -> Network:
        """Return the network with values for the free variables, rounded to 4 decimals."""
        places = iter(np.round(values, DECIMALS))
        return self.network(**{
            member: value for variable in self.variables
            for value in (float(next(places)) if variable.free else variable.low,)
            for member in variable.members})


def _variables(network: type[Network], gait: str) -> list[Variable]:
    """One variable for each family of parameters, those of groups first."""
    # A family that is a whole group has the group's name.
    names = {frozenset(members): group for group, members in network.groups.items()}
    families = network.families(network.presets()[gait].network.symmetry(gait))
    stated = {member: (name, limits) for name, limits in network.searched.items()
              for member in network.groups.get(name, (name,))}
    found = []
    for family in families:
        # Its members have the same bounds, whatever groups they are of.
        name, limits = stated[min(family)]
        found.append((name not in network.groups, Variable(
            names.get(frozenset(family), min(family)), *limits, tuple(sorted(family)))))
    return [variable for _, variable in sorted(
        found, key=lambda one: (one[0], () if one[0] else one[1].members))]


def search_space(network_name: str, gait: str, bounds: Mapping[str, tuple[float, float]],
                 fixed: Mapping[str, float]) -> Space:
    """Return the parameter sets in which to search for a gait.

    Args:
        network_name: of a network that states what may be looked for, or its file.
        gait: one of the network's.
        bounds: variable, or any parameter that takes its value, -> lower and upper bound,
            instead of the usual ones.
        fixed: the same -> its value.

    Raises:
        InputError: the network or gait is unknown, or a bound or value cannot be used.

    """
    if not is_path(network_name) and (network_name not in NETWORKS
                                      or not NETWORKS[network_name].searched):
        raise InputError(f"network '{network_name}' is not one of {', '.join(SEARCHED)}")
    network = find_network(network_name)
    if not network.searched:
        raise InputError(f'the network {network.name} does not state what may be looked for')
    known(gait, network.gaits())
    variables = _variables(network, gait)
    places = {name: k for k, variable in enumerate(variables)
              for name in (*variable.members, variable.name)}
    given: dict[int, str] = {}
    for name, (low, high) in [*bounds.items(), *((name, (value, value))
                                                 for name, value in fixed.items())]:
        if name not in places:
            raise InputError(f"'{name}' is not one of the variables of {gait}: "
                             f'{", ".join(variable.name for variable in variables)}')
        place = places[name]
        old = variables[place]
        if place in given:
            raise InputError(f'{name} is the same as {given[place]}, which is given already')
        if name in bounds and not low < high:
            raise InputError(f'{name}: the lower bound {low:g} is not below the upper bound '
                             f'{high:g}')
        allowed = network.ranges[old.members[0]]
        if not allowed.low <= low <= high <= allowed.high:
            raise InputError(f'{name}: {low:g}{"" if low == high else f" to {high:g}"} is not '
                             f'within {allowed.low:g} to {allowed.high:g}')
        given[place] = name
        variables[place] = Variable(old.name, low, high, old.members)
    space = Space(network, gait, tuple(variables))
    if not space.free:
        raise InputError('every variable is fixed: nothing is left to search')
    return space
