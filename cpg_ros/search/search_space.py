"""What may vary when weights are looked for: couplings that keep a gait's symmetry, and cells.

A gait with the spatio-temporal symmetries H needs a network that every element g of H maps onto
itself: ``w(g k <- g j) = w(k <- j)``. So one number goes with each orbit of directed couplings
under H: three for the biped's primary gaits, six for its secondary ones.
"""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from cpg_ros.errors import InputError
from cpg_ros.networks import biped, quadruped
from cpg_ros.networks.network import Network, known
from cpg_ros.networks.symmetry import Symmetry

NETWORKS: dict[str, type[Network]] = {
    network.name: network for network in (biped.Biped, quadruped.Quadruped)}
#: Values have this many decimals, so that what is found can be written down as it is.
DECIMALS = 4
#: Weights as in Rashidi et al. (2016), current and phi a little beyond their Table 2. For the
#: quadruped about what Table 13 of Buono & Golubitsky (2001) uses for most gaits; its couplings
#: across the ring, xi and eta, are 0 there, and here unless they are bounded.
WEIGHTS, CELLS = (-1.0, 1.0), {'current': (0.2, 0.32), 'phi': (0.15, 0.4)}
COUPLINGS = {**dict.fromkeys(('alpha', 'beta', 'gamma', 'delta'), (-0.8, 0.8)),
             'xi': (0.0, 0.0), 'eta': (0.0, 0.0)}


@dataclass(frozen=True)
class Variable:
    """A number that is looked for, or given where ``low`` and ``high`` agree.

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
        """Whether there is anything to look for."""
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
        """The variables that are looked for."""
        return tuple(variable for variable in self.variables if variable.free)

    def build(self, values: np.ndarray) -> Network:
        """Return the network with values for the free variables, rounded to 4 decimals."""
        places = iter(np.round(values, DECIMALS))
        return self.network(**{
            member: value for variable in self.variables
            for value in (float(next(places)) if variable.free else variable.low,)
            for member in variable.members})


def _biped_variables(gait: str) -> list[Variable]:
    """One variable for each orbit of couplings, then the cells' current and phi."""
    # An orbit that is one of the paper's three couplings has the paper's name.
    letters = {frozenset(names): f'w_{letter}' for letter, names in biped.WEIGHTS.items()}
    families = biped.Biped.families(Symmetry.of(biped.D2, biped.GAITS[gait]))
    orbits = sorted(tuple(sorted(family)) for family in families if family[0] not in CELLS)
    return [*(Variable(letters.get(frozenset(members), members[0]), *WEIGHTS, members)
              for members in orbits),
            *(Variable(name, *limits, (name,)) for name, limits in CELLS.items())]


def search_space(network_name: str, gait: str, bounds: Mapping[str, tuple[float, float]],
                 fixed: Mapping[str, float]) -> Space:
    """Return the parameter sets among which a gait is looked for.

    Args:
        network_name: biped or quadruped.
        gait: one of the network's.
        bounds: variable, or any parameter that takes its value, -> lower and upper bound,
            instead of the usual ones.
        fixed: the same -> its value.

    Raises:
        InputError: the network or gait is unknown, or a bound or value cannot be used.

    """
    if network_name not in NETWORKS:
        raise InputError(f"network '{network_name}' is not one of {', '.join(NETWORKS)}")
    network = NETWORKS[network_name]
    known(gait, network.gaits())
    variables = (_biped_variables(gait) if network is biped.Biped else
                 [Variable(name, *limits, (name,)) for name, limits in COUPLINGS.items()])
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
        raise InputError('every variable is fixed: there is nothing to look for')
    return space
