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

"""Solving for the orbits of a gait: from a preset, from an orbit nearby, or on branches.

With a delay one branch gives many orbits: an orbit of period T at a delay is an orbit at the delay
plus any whole number of periods (Yanchuk & Perlikowski 2009, Phys. Rev. E 79, 046221). So only the
first Hopf point of each frequency is followed.
"""

from collections.abc import Callable, Iterator, Sequence
from functools import lru_cache
from itertools import pairwise
from typing import Any

from cpg_ros.common.errors import InputError
from cpg_ros.dynamics.arclength import NoOrbit
from cpg_ros.dynamics.continuation import Branch, BranchPoint, continue_from_hopf
from cpg_ros.dynamics.equilibrium import NoEquilibrium
from cpg_ros.dynamics.hopf import hopf_points, HopfPoint
from cpg_ros.dynamics.orbit import extra_symmetry, Orbit
from cpg_ros.dynamics.orbit_method import orbit_method
from cpg_ros.networks.equations import equations_of
from cpg_ros.networks.network import Network, ParameterLine, Preset
from cpg_ros.networks.symmetry import Symmetry
import numpy as np

#: Largest delay at which Hopf points are searched, over the network's delay.
FURTHEST = 4.0
#: POINTS: most points of a branch; MOST_PERIODS: most whole periods that are added to a delay.
POINTS, MOST_PERIODS = 80, 12


def branch_orbits(network: Network, gait: str) -> Iterator[list[Orbit]]:
    """Yield for each Hopf point of the gait's class the orbits on its branch at the parameters.

    The branches run along the delay or, without a delay, along the network's own line. There are
    none if the network has no equilibrium or its weights break the symmetry.

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
    """Return the line of parameters along which branches run, and its ends."""
    if network.delay_parameter:
        return ParameterLine((network.delay_parameter,), (1.0,)), 0.0, FURTHEST * network.delay
    line = ParameterLine.parse(network.line, type(network))
    if line.at(network, line.value(network)) != network:
        line = ParameterLine(line.names[:1], (1.0,))
    value, (low, high) = line.value(network), network.span or (0.0, 0.0)
    return line, min(low, value), max(high, value)


def _repeats(network: Network) -> bool:
    """Return whether the parameter is the delay alone: orbits then recur by whole periods."""
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
        branch = continue_from_hopf(point, line, low, high, most=POINTS)
    except NoOrbit:
        return
    for periods in range(MOST_PERIODS + 1 if _repeats(network) else 1):
        yield from _crossings(network, branch, value, periods)


def _crossings(network: Network, branch: Branch, value: float, periods: int) -> Iterator[Orbit]:
    """Yield the orbits where a branch's value plus a number of periods is a given value."""
    def ahead(point: BranchPoint) -> float:
        return point.value + periods * point.orbit.period - value

    for left, right in pairwise(branch.points):
        a, b = ahead(left), ahead(right)
        if a * b > 0.0 or a == b:
            continue
        orbits, weights = (left.orbit, right.orbit), np.array([b, -a]) / (b - a)

        def path(theta: np.ndarray, ends: Any = orbits, weights: np.ndarray = weights
                 ) -> np.ndarray:
            states: np.ndarray = weights @ [orbit(theta * orbit.period).ravel() for orbit in ends]
            return states.reshape(theta.size, -1)

        period = float(weights @ [orbit.period for orbit in orbits])
        solved = solve_from_path(network, left.orbit.symmetry, path, period)
        if solved is not None:
            yield solved


# Gaits as exact periodic orbits, for every network.

def solve_orbit(network: Network, gait: str, near: Orbit | None = None) -> Orbit:
    """Solve for one orbit of the gait, with exact derivatives by every parameter.

    A gait may have several: ``coexisting_orbits`` finds them and which of them attract.

    Args:
        network: parameters.
        gait: one of the network's gaits.
        near: an orbit of that gait of the same kind of network to start from; by default, where
            the network has no delay, that of the shipped preset.

    Raises:
        InputError: an unknown gait, or parameters that are not finite or a delay not positive.
        NoOrbit: this set has no such orbit, or none was found; the message gives the reason.

    """
    preset = network.presets().get(gait)
    try:
        orbit: Orbit = orbit_method(network).solve.solve(network, gait, near)
        return orbit
    except NoOrbit as error:
        if near is not None or (preset is not None and preset.start is not None):
            raise
        return _from_hopf_point(network, gait, error)


def solve_beside(network: Network, near: Orbit) -> Orbit:
    """Solve for the orbit next to a known one of the same symmetry, by Newton's method alone.

    Args:
        network: parameters.
        near: the known orbit.

    Raises:
        NoOrbit: the method leads elsewhere; a shorter step may succeed.

    """
    orbit: Orbit = orbit_method(network).solve.beside(network, near)
    return orbit


@lru_cache(maxsize=64)
def solve_preset(preset: Preset) -> Orbit:
    """Solve for a preset's orbit; errors as in solve_orbit."""
    try:
        orbit: Orbit = orbit_method(preset.network).solve.from_preset(preset)
        return orbit
    except NoOrbit as error:
        if preset.start is not None:
            raise
        return _from_hopf_point(preset.network, preset.gait, error)


def _from_hopf_point(network: Network, gait: str, error: NoOrbit) -> Orbit:
    """Return the first orbit on the branches of the equilibrium's Hopf points, or raise."""
    if not network.delay_parameter:
        for orbits in branch_orbits(network, gait):
            for orbit in orbits:
                if not extra_symmetry(orbit):
                    return orbit
    raise error


def solve_from_path(network: Network, symmetry: Symmetry,
                    path: Callable[[np.ndarray], np.ndarray], period: float,
                    periods: Sequence[float] = ()) -> Orbit | None:
    """Solve for an orbit from a guess; None where Newton's method leads to none.

    Args:
        network: parameters.
        symmetry: of the gait.
        path: states, shape (m, components), as a function of times in cycles, shape (m,), that
            begin where cell 1 peaks.
        period: in model time.
        periods: periods, model time, of orbits that Newton's method is to be kept off.

    """
    orbit: Orbit | None = orbit_method(network).solve.from_path(network, symmetry, path, period,
                                                                periods)
    return orbit
