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

"""Coexisting orbits of a gait.

A gait may have several periodic orbits, and the network need not settle on the one that Newton's
method reaches first. Simulations in the gait's symmetry class settle on orbits that attract in it;
unstable ones lie on the branches of the class's Hopf points, or follow from deflation.
"""

from collections.abc import Iterator
from dataclasses import dataclass

from cpg_ros.common.errors import ShortRepr
from cpg_ros.dynamics.arclength import NoOrbit
from cpg_ros.dynamics.equilibrium import NoEquilibrium
from cpg_ros.dynamics.floquet import Multipliers, multipliers_within
from cpg_ros.dynamics.hopf import first_hopf
from cpg_ros.dynamics.orbit import check_values, extra_symmetry, Orbit
from cpg_ros.dynamics.settling import find_orbit, Path, RANDOM, SIZES
from cpg_ros.dynamics.solve_orbit import branch_orbits, solve_from_path, solve_orbit
from cpg_ros.networks.network import Network
import numpy as np

#: MORE_RANDOM: number of random states from which a thorough search simulates.
MORE_RANDOM = 37
#: Relative differences up to which two orbits are the same, up to phase and the network's
#: symmetry.
#: SAME_PERIOD: of the periods; SAME_LEVEL: of the ranges.
SAME_PERIOD, SAME_LEVEL = 1e-6, 1e-4
#: Relative differences up to which a simulation's cycle is a known orbit. NEAR_PERIOD: of the
#: periods; NEAR_WAVEFORM: of the waveforms.
NEAR_PERIOD, NEAR_WAVEFORM = 5e-3, 0.02
#: Starts of the deflated method: factors of an orbit's size about its mean, and of its period.
SCALED = ((0.5, 1.0), (1.5, 1.0), (0.8, 0.8), (1.2, 1.3))
#: Orbits of a gait, at most.
MOST = 24
#: POINTS: points of a cycle at which waveforms are compared.
POINTS = 120


@dataclass(frozen=True, eq=False, repr=False)
class CoexistingOrbits(ShortRepr):
    """The orbits of a gait at one parameter set.

    Attributes:
        gait: one of the network's.
        orbits: those that attract within the gait's class first, sorted by the distance of their
            period from the given orbit's.
        starts: number of states in the gait's class from which simulations were run.
        hopf_points: number of Hopf points of its class whose branches were followed.
        deflated: whether Newton's method was deflated about the orbits.

    """

    gait: str
    orbits: tuple[Orbit, ...]
    starts: int = 0
    hopf_points: int = 0
    deflated: bool = False

    @property
    def searched(self) -> str:
        """The extent of the search, as 'searched from 15 starts and 2 Hopf points', or ''."""
        counts = [f'{count} {what}{"" if count == 1 else "s"}' for count, what in (
            (self.starts, 'start'), (self.hopf_points, 'Hopf point')) if count]
        deflated = ', and by deflation' if self.deflated and self.orbits else ''
        return f'searched from {" and ".join(counts)}{deflated}' if counts else ''

    def _summary(self) -> str:
        periods = ', '.join(f'{orbit.period:.7g}' for orbit in self.orbits)
        return ', '.join(filter(None, (f'{self.gait}: {periods}', self.searched)))


def coexisting_orbits(network: Network, gait: str, near: Orbit | None = None, *,
                      starts: bool = True, everything: bool = True) -> CoexistingOrbits:
    """Find the orbits that a gait has at one parameter set.

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
        InputError: an unknown gait, or parameters that are not finite or a delay not positive.
        NoEquilibrium: a gait without a known start, of a network without equilibrium.
        NoOrbit: there is none; the message says from how many starts and Hopf points.

    """
    check_values(network, gait)
    search = _Search(network, gait)
    why = search.reach(near)
    if everything or (not search.starts and (starts or not search.attracting)):
        search.simulate(MORE_RANDOM if everything else RANDOM, everything)
    if everything or not search.attracting:
        # Without a delay branches take longer than anything else.
        if everything or network.delay_parameter:
            search.follow()
        search.deflate()
    orbits = search.result(near)
    if not orbits.orbits:
        below = _below_threshold(network, gait)
        raise NoOrbit('; '.join(filter(None, (below or why, orbits.searched))))
    return orbits


class _Search:
    """The orbits of a gait that have been found, and the extent of the search."""

    def __init__(self, network: Network, gait: str) -> None:
        self.network, self.gait, self.symmetry = network, gait, network.symmetry(gait)
        self.orbits: list[Orbit] = []
        self._within: list[Multipliers] = []
        self.starts = self.hopf_points = 0
        self.deflated = False

    def reach(self, near: Orbit | None) -> str:
        """Solve for one orbit; return why there is none, or ''."""
        try:
            self.add(solve_orbit(self.network, self.gait, near))
        except NoOrbit as error:
            if not self.network.delay_parameter:
                # The solver has simulated from these starts.
                self.starts = len(SIZES) + RANDOM
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
                                self.hopf_points, self.deflated)

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
            for path, period in find_orbit(self.network, self.gait, random,
                                           lambda: longer or not self.attracting):
                if len(self.orbits) < MOST and not any(
                        _near(path, period, orbit) for orbit in self.orbits):
                    self.add(solve_from_path(self.network, self.symmetry, path, period))
        except NoEquilibrium:
            # The starts lie about the equilibrium.
            return
        self.starts = len(SIZES) + random

    def follow(self) -> None:
        """Follow the branches of the class's Hopf points to the parameters."""
        for orbits in branch_orbits(self.network, self.gait):
            self.hopf_points += 1
            for orbit in orbits:
                if len(self.orbits) < MOST:
                    self.add(orbit)

    def deflate(self) -> None:
        """Deflate Newton's method about all orbits until it finds no more."""
        self.deflated = True
        todo = list(self.orbits)
        while todo:
            orbit = todo.pop(0)
            for path, period in _scaled(orbit):
                solution = solve_from_path(self.network, self.symmetry, path, period,
                                           [other.period for other in self.orbits])
                if len(self.orbits) < MOST and self.add(solution):
                    todo.append(self.orbits[-1])


def _scaled(orbit: Orbit) -> Iterator[tuple[Path, float]]:
    """Yield guesses about an orbit, states over times in cycles, and their periods."""
    mean = orbit(np.arange(POINTS) / POINTS * orbit.period).mean(axis=0)
    for size, slower in SCALED:
        def path(theta: np.ndarray, size: float = size) -> np.ndarray:
            return mean + size * (orbit(theta * orbit.period) - mean)

        yield path, slower * orbit.period


def _levels(orbit: Orbit) -> np.ndarray:
    """Ranges of the waveforms, sorted, shape (waves, 2 variables)."""
    rows = orbit.levels.reshape(len(orbit.levels), -1)
    return rows[np.lexsort(rows.round(6).T)]


def _same(orbit: Orbit, other: Orbit) -> bool:
    if abs(orbit.period / other.period - 1.0) > SAME_PERIOD:
        return False
    a, b = _levels(orbit), _levels(other)
    return bool(np.abs(a - b).max() < SAME_LEVEL * np.abs(a).max())


def _near(path: Path, period: float, orbit: Orbit) -> bool:
    """Whether the cycle of a simulation is an orbit that has been solved for."""
    if abs(period / orbit.period - 1.0) > NEAR_PERIOD:
        return False
    theta = np.arange(POINTS) / POINTS
    exact = orbit(theta * orbit.period)
    return bool(np.abs(path(theta) - exact).max() < NEAR_WAVEFORM * np.ptp(exact))


def _below_threshold(network: Network, gait: str) -> str:
    """Say that a gait's critical delay is larger than the delay, or ''."""
    point = first_hopf(network, gait) if network.delay_parameter else None
    if point is None or point.value <= network.delay:
        return ''
    return (f"{network.delay_parameter} {network.delay:g} is below the {gait}'s critical delay "
            f'{point.value:.4f}')
