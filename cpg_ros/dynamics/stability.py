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

"""Gaits of a parameter set: existence, amplitude, period and stability.

Where there is none, ``nearest_threshold`` names the nearest threshold.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

from cpg_ros.common.errors import ShortRepr
from cpg_ros.dynamics import floquet
from cpg_ros.dynamics.arclength import NoOrbit
from cpg_ros.dynamics.equilibrium import NoEquilibrium
from cpg_ros.dynamics.floquet import Multipliers, multipliers_within, sufficient_gain
from cpg_ros.dynamics.hopf import first_hopf
from cpg_ros.dynamics.orbit import Orbit
from cpg_ros.dynamics.solve_orbit import coexisting_orbits, CoexistingOrbits
from cpg_ros.networks.network import Network

#: Rate at which transverse disturbances decay with the lock gain, 1/model time. With a delay they
#: decay by 1/e within it at most: the gain grows exponentially with their product.
MAX_LOCK_RATE = 0.5


def lock_rate(network: Network) -> float:
    """Return the rate at which transverse disturbances decay with the lock, 1/model time."""
    return min(MAX_LOCK_RATE, 1.0 / network.delay) if network.delay else MAX_LOCK_RATE


@dataclass(frozen=True)
class Stability:
    """Stability of an orbit.

    Attributes:
        enough: symmetry gain above which transverse disturbances decay, 1/model time.
        lock_gain: gain with which they decay at lock_rate, 1/model time.
        reason: why no gain makes the gait attract, or why that is undecided; or ''.

    """

    enough: float
    lock_gain: float
    reason: str


def stability(orbit: Orbit) -> Stability:
    """Judge an orbit by its multipliers; the gain follows from the network's own bound, if any."""
    wanted = lock_rate(orbit.network)
    bound = orbit.network.sufficient_gain(wanted)
    if bound is None:
        enough, gain = (sufficient_gain(orbit, rate) for rate in (0.0, wanted))
    else:
        enough = gain = bound
    inside = multipliers_within(orbit)
    reason = {
        True: '',
        False: f'a disturbance within its own symmetry class grows {inside.leading:.4g} times a '
               'stride',
        None: 'cannot tell whether a disturbance within its own symmetry class decays: its '
              f'multiplier is {inside.leading:.10g}, with an error of '
              f'{max(inside.error, 1.0 - floquet.MAX_STABLE_MODULUS):.0e}'}
    return Stability(enough, gain, reason[inside.attracts])


@dataclass(frozen=True, eq=False, repr=False)
class GaitAssessment(ShortRepr):
    """One gait of one parameter set.

    Attributes:
        gait: one of the network's gaits.
        orbit: of the gait, or None; of several, one that attracts within the gait's class if any
            does, nearest in period to the preset's.
        why: reason why there is none, or ''.
        others: assessments of coexisting orbits.
        searched: extent of the search for others, or ''.

    """

    gait: str
    orbit: Orbit | None
    why: str = ''
    others: tuple['GaitAssessment', ...] = ()
    searched: str = ''

    @property
    def orbits(self) -> tuple['GaitAssessment', ...]:
        """Assessments of this orbit and the others; empty where there is no orbit."""
        return () if self.orbit is None else (self, *self.others)

    @property
    def known_orbit(self) -> Orbit:
        """Orbit of a gait that exists; NoOrbit otherwise."""
        if self.orbit is None:
            raise NoOrbit(f'there is no {self.gait}: {self.why}')
        return self.orbit

    @property
    def amplitude(self) -> float:
        """Half the range of cell 1's first variable."""
        return float(self.known_orbit.levels[0, 0, 1])

    @property
    def phases(self) -> dict[str, float]:
        """Lead of each leg's first cell, or of each muscle, on cell 1, in cycles."""
        orbit = self.known_orbit
        muscles = orbit.network.muscles
        return ({name: float(orbit.leads[cell - 1]) for name, cell in muscles.items()}
                or orbit.leg_phases)

    @cached_property
    def multipliers(self) -> Multipliers:
        """Floquet multipliers without a symmetry lock."""
        return floquet.multipliers(self.known_orbit)

    @property
    def stable(self) -> bool | None:
        """Whether the gait attracts in the full network, without a lock; None: cannot tell."""
        return self.multipliers.attracts

    @cached_property
    def smallest_gain(self) -> float:
        """Symmetry gain above which every transverse disturbance decays, 1/model time."""
        return floquet.smallest_gain(self.known_orbit)

    @cached_property
    def default_gain(self) -> float:
        """Gain that the generator selects, 1/model time."""
        return sufficient_gain(self.known_orbit, lock_rate(self.known_orbit.network))

    @cached_property
    def stable_with_default_gain(self) -> bool | None:
        """Whether the gait attracts with the generator's gain; None as above."""
        return floquet.attracts_with(self.known_orbit, self.default_gain)

    def as_dict(self) -> dict[str, Any]:
        """Return everything in plain types, for JSON."""
        if self.orbit is None:
            return {'exists': False, 'why': self.why}
        return {'exists': True, 'period': self.orbit.period, 'amplitude': self.amplitude,
                'phases': self.phases, 'waveforms': int(self.orbit.waves.max()) + 1,
                'floquet_leading': self.multipliers.leading_within,
                'floquet_leading_transverse': self.multipliers.leading_transverse,
                'floquet_error': self.multipliers.error,
                'stable': self.stable, 'min_symmetry_gain': self.smallest_gain,
                'default_symmetry_gain': self.default_gain,
                'stable_with_default_gain': self.stable_with_default_gain,
                'searched': self.searched, 'others': [orbit.as_dict() for orbit in self.others]}


def verdicts(network: Network, done: Callable[[int], None] = lambda count: None,
             near: Orbit | None = None, everything: bool = False) -> dict[str, GaitAssessment]:
    """Judge every gait of a network by all of its orbits.

    If the first orbit is not stable, simulations from starts in the gait's class look for others;
    if none attracts in the class, deflation and, with a delay, branches follow.

    Args:
        network: parameters, all finite.
        done: called with the number of finished gaits.
        near: orbit of one of the gaits, from which that gait is solved for.
        everything: look for all orbits of every gait.

    Raises:
        InputError: a parameter is not finite, or a delay is not positive.

    """
    assessments = {}
    for count, gait in enumerate(network.gaits()):
        done(count)
        guess = near if near is not None and near.gait == gait else None
        try:
            orbits = coexisting_orbits(network, gait, guess, starts=everything,
                                       everything=everything)
            assessments[gait] = _assessed(orbits)
            if not (assessments[gait].stable or orbits.starts):
                assessments[gait] = _assessed(coexisting_orbits(network, gait, orbits.orbits[0],
                                                                everything=False))
        except (NoEquilibrium, NoOrbit) as error:
            assessments[gait] = GaitAssessment(gait, None, str(error))
    done(len(assessments))
    return assessments


def _assessed(orbits: CoexistingOrbits) -> GaitAssessment:
    first, *others = (GaitAssessment(orbits.gait, orbit) for orbit in orbits.orbits)
    return replace(first, others=tuple(others), searched=orbits.searched)


def nearest_threshold(network: Network) -> str:
    """Name the nearest threshold, for a network with a delay that has no gait.

    It is the nearest critical delay above the delay or, if there is none, the least coupling.
    """
    name, delay = network.delay_parameter, network.delay
    points = {gait: first_hopf(network, gait) for gait in network.gaits()}
    ahead = {gait: point.value for gait, point in points.items()
             if point is not None and point.value >= delay}
    if ahead:
        gait = min(ahead, key=ahead.__getitem__)
        return (f"the nearest threshold is the {gait}'s critical delay {ahead[gait]:.4f} ({name} "
                f'is {delay:g})')
    needed = {gait: coupling for gait, point in points.items()
              if point is None and (coupling := network.least_coupling(gait)) is not None}
    if needed:
        gait = min(needed, key=lambda gait: needed[gait].least)
        what, value, least = needed[gait]
        return (f'the nearest threshold is {what} {least:.4f}, above which the {gait} has a '
                f'critical delay ({what} is {value:g})')
    if not any(points.values()):
        return 'no delay gives one'
    return f'every critical delay is below {name}, but no orbit was found this far from onset'
