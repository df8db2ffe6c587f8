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

"""Solution for the orbits of a gait: from a preset, from an orbit nearby, on branches, or all.

A gait may have several orbits, and the network need not settle on the one that Newton's method
reaches first. Simulations in the gait's symmetry class settle on orbits that attract in it;
unstable ones are on the branches of the class's Hopf points, or follow from deflation.

With a delay one branch gives many orbits: an orbit of period T at a delay is an orbit at the delay
plus any whole number of periods (Yanchuk & Perlikowski 2009, Phys. Rev. E 79, 046221). Therefore
only the first Hopf point of each frequency is followed.
"""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import lru_cache
from itertools import pairwise
from typing import Any

from cpg_ros.common.errors import InputError, ShortRepr
from cpg_ros.dynamics.arclength import NoOrbit
from cpg_ros.dynamics.continuation import Branch, BranchPoint, continue_from_hopf
from cpg_ros.dynamics.equilibrium import NoEquilibrium
from cpg_ros.dynamics.floquet import Multipliers, multipliers_within
from cpg_ros.dynamics.hopf import first_hopf, hopf_points, HopfPoint
from cpg_ros.dynamics.orbit import check_values, extra_symmetry, Orbit, Path
from cpg_ros.dynamics.orbit_method import orbit_method
from cpg_ros.dynamics.settling import find_orbit, NUM_RANDOM, WAVE_SIZES
from cpg_ros.networks.equations import equations_of
from cpg_ros.networks.network import Network, ParameterLine, Preset
from cpg_ros.networks.symmetry import Symmetry
import numpy as np

#: Largest delay at which Hopf points are searched, over the network's delay.
MAX_DELAY_RATIO = 4.0
#: Points of a branch; whole periods that are added to a delay.
MAX_POINTS, MAX_PERIODS = 120, 12


def branch_orbits(network: Network, gait: str
                  ) -> Iterator[tuple[Branch | None, Iterator[Orbit]]]:
    """Yield each Hopf point's branch in the gait's class, and its orbits at the parameters.

    The branches run along the delay or, without a delay, along the network's own line. There are
    none if the network has no equilibrium or its weights break the symmetry.

    Args:
        network: parameters.
        gait: one of its gaits.

    """
    symmetry = network.symmetry(gait)
    line, low, high = _line(network)
    if not low < high or line.at(network, high).broken(symmetry):
        return
    try:
        points = hopf_points(network, line, low, high)
    except (NoEquilibrium, InputError):
        # An InputError says that the classes of the group are not known.
        return
    for point in filter(None, (point.towards(symmetry) for point in points)):
        again = point.n > 0 and _repeats(network)
        branch = None if again else _branch(network, point, low, high)
        yield branch, iter(()) if branch is None else _on_branch(network, branch)


def _line(network: Network) -> tuple[ParameterLine, float, float]:
    """Return the line of parameters along which branches run, and its ends."""
    if network.delay_parameter:
        return (ParameterLine((network.delay_parameter,), (1.0,)), 0.0,
                MAX_DELAY_RATIO * network.delay)
    line = ParameterLine.parse(network.line, type(network))
    if line.at(network, line.value(network)) != network:
        line = ParameterLine(line.names[:1], (1.0,))
    value, (low, high) = line.value(network), network.span or (0.0, 0.0)
    return line, min(low, value), max(high, value)


def _repeats(network: Network) -> bool:
    """Return whether the parameter is the delay alone: orbits then recur by whole periods."""
    return (bool(network.delay_parameter)
            and network.delay_parameter not in equations_of(type(network)).rows)


def _branch(network: Network, point: HopfPoint, low: float, high: float) -> Branch | None:
    """Follow the branch of a Hopf point; None where it does not reach the network's parameters."""
    line, value = point.line, point.line.value(network)
    if network.delay_parameter:
        if point.value > value and point.normal_form.side > 0:
            return None
        low, high = 0.5 * min(point.value, value), max(value, 1.1 * point.value)
    try:
        return continue_from_hopf(point, line, low, high, most=MAX_POINTS)
    except NoOrbit:
        return None


def _on_branch(network: Network, branch: Branch) -> Iterator[Orbit]:
    """Yield the orbits at the network's parameters on a branch."""
    for periods in range(MAX_PERIODS + 1 if _repeats(network) else 1):
        yield from _crossings(network, branch, branch.along.value(network), periods)


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

    A gait may have several; ``coexisting_orbits`` finds them and tells which attract.

    Args:
        network: parameters.
        gait: one of the network's gaits.
        near: an orbit of that gait of the same kind of network to start from; without a delay, by
            default that of the shipped preset.

    Raises:
        InputError: an unknown gait, parameters that are not finite, or a delay that is not
            positive.
        NoOrbit: there is no such orbit, or none was found; the message gives the reason.

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
        for _, orbits in branch_orbits(network, gait):
            for orbit in orbits:
                if not extra_symmetry(orbit):
                    return orbit
    raise error


def solve_from_path(network: Network, symmetry: Symmetry,
                    path: Callable[[np.ndarray], np.ndarray], period: float,
                    periods: Sequence[float] = ()) -> Orbit | None:
    """Solve for an orbit from a guess; None where Newton's method finds none.

    Args:
        network: parameters.
        symmetry: of the gait.
        path: states, shape (m, components), as a function of times in cycles, shape (m,), from
            cell 1's peak.
        period: guess, model time.
        periods: of orbits to keep away from, model time.

    """
    orbit: Orbit | None = orbit_method(network).solve.from_path(network, symmetry, path, period,
                                                                periods)
    return orbit


#: Work on a gait's branches after which no further one is followed: sum over their points of the
#: cube of their numbers, about a minute of CPU time.
MAX_WORK = 2e11
#: Random states from which a thorough search simulates.
NUM_RANDOM_THOROUGH = 37
#: Relative differences of periods and ranges up to which two orbits are the same, up to phase and
#: the network's symmetry.
PERIOD_TOLERANCE, LEVEL_TOLERANCE = 1e-6, 1e-4
#: Relative differences of periods and waveforms up to which a simulation's cycle is a known orbit.
CYCLE_PERIOD_TOLERANCE, WAVEFORM_TOLERANCE = 5e-3, 0.02
#: Starts of the deflated method: factors of an orbit's size about its mean, and of its period.
START_SCALES = ((0.5, 1.0), (1.5, 1.0), (0.8, 0.8), (1.2, 1.3))
#: Of a gait.
MAX_ORBITS = 24
#: Of a cycle, at which waveforms are compared.
POINTS = 120


@dataclass(frozen=True, eq=False, repr=False)
class CoexistingOrbits(ShortRepr):
    """Orbits of a gait at one parameter set.

    Attributes:
        gait: one of the network's.
        orbits: those that attract within the gait's class first, by the distance of their period
            from the given orbit's.
        starts: number of simulated states in the gait's class.
        hopf_points: number of Hopf points of the class whose branches were followed.
        deflated: whether Newton's method was deflated about the orbits.
        unfollowed: whether there are more Hopf points than the bound on work allows to follow.

    """

    gait: str
    orbits: tuple[Orbit, ...]
    starts: int = 0
    hopf_points: int = 0
    deflated: bool = False
    unfollowed: bool = False

    @property
    def searched(self) -> str:
        """Extent of the search, such as 'searched from 15 starts and 2 Hopf points', or ''."""
        counts = [f'{count} {what}{"" if count == 1 else "s"}' for count, what in (
            (self.starts, 'start'), (self.hopf_points, 'Hopf point')) if count]
        more = ', and by deflation' if self.deflated and self.orbits else ''
        if self.unfollowed:
            more += '; further branches were left out, as these took long'
        return f'searched from {" and ".join(counts)}{more}' if counts else ''

    def _summary(self) -> str:
        periods = ', '.join(f'{orbit.period:.7g}' for orbit in self.orbits)
        return ', '.join(filter(None, (f'{self.gait}: {periods}', self.searched)))


def coexisting_orbits(network: Network, gait: str, near: Orbit | None = None, *,
                      starts: bool = True, everything: bool = True) -> CoexistingOrbits:
    """Find the orbits of a gait at one parameter set.

    If the first orbit does not attract within its class, all searches run, except that branches
    without a delay are followed on request only.

    Args:
        network: parameters.
        gait: one of the network's gaits.
        near: an orbit of the gait to start from.
        starts: simulate from states in the gait's class.
        everything: simulate from more states and for longer, follow the branches of the class's
            Hopf points and deflate Newton's method about each orbit.

    Raises:
        InputError: an unknown gait, parameters that are not finite, or a delay that is not
            positive.
        NoEquilibrium: the gait has no known start, and the network no equilibrium.
        NoOrbit: there is none; the message gives the number of starts and Hopf points.

    """
    check_values(network, gait)
    search = _Search(network, gait)
    why = search.reach(near)
    if everything or (not search.starts and (starts or not search.attracting)):
        search.simulate(NUM_RANDOM_THOROUGH if everything else NUM_RANDOM, everything)
    if everything or not search.attracting:
        # Without a delay branches take longer than anything else.
        if everything or network.delay_parameter:
            search.follow_branches()
        search.deflate()
    orbits = search.result(near)
    if not orbits.orbits:
        below = _below_threshold(network, gait)
        raise NoOrbit('; '.join(filter(None, (below or why, orbits.searched))))
    return orbits


class _Search:
    """The orbits of a gait that have been found, and the extent of the search."""

    def __init__(self, network: Network, gait: str) -> None:
        self.network, self.gait = network, gait
        self.orbits: list[Orbit] = []
        self._within: list[Multipliers] = []
        self.starts = self.hopf_points = 0
        self.deflated = self.unfollowed = False

    def reach(self, near: Orbit | None) -> str:
        """Solve for one orbit; return why there is none, or ''."""
        try:
            self.add(solve_orbit(self.network, self.gait, near))
        except NoOrbit as error:
            if not self.network.delay_parameter:
                # The solver has simulated from these starts.
                self.starts = len(WAVE_SIZES) + NUM_RANDOM
            return str(error)
        return ''

    @property
    def attracting(self) -> bool:
        """Whether an orbit is known that attracts within its class."""
        return any(spectrum.attracts for spectrum in self._within)

    def result(self, near: Orbit | None) -> CoexistingOrbits:
        nearest = near or (self.orbits[0] if self.orbits else None)
        order = sorted(range(len(self.orbits)), key=lambda k: (
            not self._within[k].attracts,
            0.0 if nearest is None else abs(np.log(self.orbits[k].period / nearest.period))))
        return CoexistingOrbits(self.gait, tuple(self.orbits[k] for k in order), self.starts,
                                self.hopf_points, self.deflated, self.unfollowed)

    def add(self, orbit: Orbit | None) -> bool:
        """Add an orbit that is new and has no more symmetry; return whether it was added."""
        if orbit is None or extra_symmetry(orbit) or any(
                _same(orbit, other) for other in self.orbits):
            return False
        self.orbits.append(orbit)
        self._within.append(multipliers_within(orbit))
        return True

    def simulate(self, random: int, longer: bool) -> None:
        """Simulate the network from many states in the gait's class until it settles.

        Slow runs continue while no orbit attracts, or with longer.
        """
        try:
            for symmetry, path, period in find_orbit(self.network, self.gait, random,
                                                     lambda: longer or not self.attracting):
                if len(self.orbits) < MAX_ORBITS and not any(
                        _near(path, period, orbit) for orbit in self.orbits):
                    self.add(solve_from_path(self.network, symmetry, path, period))
        except (NoEquilibrium, NoOrbit):
            # The starts lie about the equilibrium, or all run away.
            return
        self.starts = len(WAVE_SIZES) + random

    def follow_branches(self) -> None:
        """Follow the branches of the class's Hopf points to the parameters."""
        work = 0.0
        for branch, orbits in branch_orbits(self.network, self.gait):
            self.hopf_points += 1
            for orbit in orbits:
                if len(self.orbits) < MAX_ORBITS:
                    self.add(orbit)
            if branch is not None:
                work += sum(point.curve_point.z.size**3.0 for point in branch.points)
            if self.network.delay_parameter and work > MAX_WORK:
                self.unfollowed = True
                break

    def deflate(self) -> None:
        """Deflate Newton's method about all orbits until it finds no more."""
        self.deflated = True
        todo = list(self.orbits)
        while todo:
            orbit = todo.pop(0)
            for path, period in _scaled(orbit):
                solution = solve_from_path(self.network, orbit.symmetry, path, period,
                                           [other.period for other in self.orbits])
                if len(self.orbits) < MAX_ORBITS and self.add(solution):
                    todo.append(self.orbits[-1])


def _scaled(orbit: Orbit) -> Iterator[tuple[Path, float]]:
    """Yield guesses about an orbit, states over times in cycles, and their periods."""
    mean = orbit.cycle(POINTS).mean(axis=0)
    for size, slower in START_SCALES:
        def path(theta: np.ndarray, size: float = size) -> np.ndarray:
            return mean + size * (orbit(theta * orbit.period) - mean)

        yield path, slower * orbit.period


def _levels(orbit: Orbit) -> np.ndarray:
    """Ranges of the waveforms, sorted, shape (waves, 2 variables)."""
    rows = orbit.levels.reshape(len(orbit.levels), -1)
    return rows[np.lexsort(rows.round(6).T)]


def _same(orbit: Orbit, other: Orbit) -> bool:
    if (orbit.symmetry != other.symmetry
            or abs(orbit.period / other.period - 1.0) > PERIOD_TOLERANCE):
        return False
    a, b = _levels(orbit), _levels(other)
    return bool(np.abs(a - b).max() < LEVEL_TOLERANCE * np.abs(a).max())


def _near(path: Path, period: float, orbit: Orbit) -> bool:
    """Return whether the cycle of a simulation is an orbit that is known."""
    if abs(period / orbit.period - 1.0) > CYCLE_PERIOD_TOLERANCE:
        return False
    exact, states = orbit.cycle(POINTS), path(np.arange(POINTS) / POINTS)
    return bool(np.abs(states - exact).max() < WAVEFORM_TOLERANCE * np.ptp(exact))


def _below_threshold(network: Network, gait: str) -> str:
    """Say that a gait's critical delay is larger than the delay, or ''."""
    point = first_hopf(network, gait) if network.delay_parameter else None
    if point is None or point.value <= network.delay:
        return ''
    return (f"{network.delay_parameter} {network.delay:g} is below the {gait}'s critical delay "
            f'{point.value:.4f}')
