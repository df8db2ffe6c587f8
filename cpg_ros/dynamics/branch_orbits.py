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

"""The orbits of a gait on the branches of its class's Hopf points, at one parameter set.

With a delay one branch gives many: an orbit of period T at a delay is an orbit at the delay plus
any whole number of periods (Yanchuk & Perlikowski 2009, Phys. Rev. E 79, 046221). So only the
first Hopf point of each frequency is followed, where waveforms are smooth.
"""

from collections.abc import Iterator
from itertools import pairwise

from cpg_ros.dynamics.continuation import Branch, BranchPoint, continue_from_hopf
from cpg_ros.dynamics.equilibrium import NoEquilibrium
from cpg_ros.dynamics.hopf_point import HopfPoint
from cpg_ros.dynamics.hopf_search import hopf_points
from cpg_ros.dynamics.orbit_method import orbit_method
from cpg_ros.dynamics.periodic import NoOrbit, Orbit
from cpg_ros.errors import InputError
from cpg_ros.networks.equations import equations_of
from cpg_ros.networks.network import Network
from cpg_ros.networks.parameter_line import ParameterLine
import numpy as np

#: Hopf points are looked at up to this many times the delay.
FURTHEST = 4.0
#: Points of a branch, at most, and turns, whole periods that a delay is longer by.
POINTS, TURNS = 80, 12


def branch_orbits(network: Network, gait: str) -> Iterator[list[Orbit]]:
    """Yield for each Hopf point of the gait's class the orbits on its branch at the parameters.

    The delay moves, or without one the parameters that the network names for branches. Nothing is
    yielded where the network has no equilibrium, or weights break its symmetry.

    Args:
        network: parameters.
        gait: one of its gaits.

    """
    shifts = set(network.symmetry(gait).shifts)
    line, low, high = _line(network)
    if not low < high or line.at(network, high).broken(network.symmetry(gait)):
        return
    try:
        points = hopf_points(network, line, low, high)
    except (NoEquilibrium, InputError):
        # An InputError says that weights break the symmetry of the classes.
        return
    for point in points:
        if set(point.block.symmetry.shifts) == shifts:
            again = point.n > 0 and _repeats(network)
            yield [] if again else list(_on_branch(network, point, low, high))


def _line(network: Network) -> tuple[ParameterLine, float, float]:
    """Return the parameters that move, and how far."""
    if network.delay_parameter:
        return ParameterLine((network.delay_parameter,), (1.0,)), 0.0, FURTHEST * network.delay
    line = ParameterLine.parse(network.line, type(network))
    if line.at(network, line.value(network)) != network:
        line = ParameterLine(line.names[:1], (1.0,))
    value, (low, high) = line.value(network), network.span or (0.0, 0.0)
    return line, min(low, value), max(high, value)


def _repeats(network: Network) -> bool:
    """Whether the delay is nothing but that, so that orbits return after whole periods of it."""
    return (bool(network.delay_parameter)
            and network.delay_parameter not in equations_of(type(network)).rows)


def _on_branch(network: Network, point: HopfPoint, low: float, high: float) -> Iterator[Orbit]:
    """Yield the orbits at the network's parameters on the branch of a Hopf point."""
    line, value = point.line, point.line.value(network)
    if network.delay_parameter:
        if point.value > value and point.normal_form.side > 0:
            return
        low, high = 0.5 * min(point.value, value), max(value, 1.1 * point.value)
    try:
        branch = continue_from_hopf(point.network, point.block.symmetry, point.omega, line, low,
                                    high, rest=point.state, vector=point.eigenvector, most=POINTS)
    except NoOrbit:
        return
    for turns in range(TURNS + 1 if _repeats(network) else 1):
        yield from _crossings(network, branch, value, turns)


def _crossings(network: Network, branch: Branch, value: float, turns: int) -> Iterator[Orbit]:
    """Yield the orbits where a branch's value, plus so many periods, is the wanted one."""
    def ahead(point: BranchPoint) -> float:
        return point.value + turns * point.orbit.period - value

    for left, right in pairwise(branch.points):
        a, b = ahead(left), ahead(right)
        if a * b > 0.0 or a == b:
            continue
        share = a / (a - b)
        one, other = left.orbit, right.orbit

        def path(theta: np.ndarray, share: float = share, one: Orbit = one, other: Orbit = other
                 ) -> np.ndarray:
            return ((1.0 - share) * one(theta * one.period)
                    + share * other(theta * other.period))

        period = (1.0 - share) * one.period + share * other.period
        found = orbit_method(network).solve.from_path(network, one.symmetry, path, period)
        if found is not None:
            yield found
