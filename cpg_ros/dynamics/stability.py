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

"""The gaits of a parameter set: existence, amplitude, period and stability.

And what stands nearest where there is none: the threshold at which rest gives way.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

from cpg_ros.common.errors import ShortRepr
from cpg_ros.dynamics.arclength import NoOrbit
from cpg_ros.dynamics.coexisting_orbits import coexisting_orbits, CoexistingOrbits
from cpg_ros.dynamics.equilibrium import NoEquilibrium
from cpg_ros.dynamics.floquet import (
    ATTRACTS,
    attracts_with,
    leading_within,
    Multipliers,
    multipliers,
    smallest_gain,
    sufficient_gain,
)
from cpg_ros.dynamics.hopf import first_hopf
from cpg_ros.dynamics.orbit import Orbit
from cpg_ros.networks.network import Network

# Stability of a gait: whether it attracts, and with what symmetry gain.

#: RATE: rate at which transverse disturbances decay with the lock gain, 1/model time.
RATE = 0.5


@dataclass(frozen=True)
class Stability:
    """Stability of an orbit.

    Attributes:
        enough: symmetry gain (1/model time) that makes transverse disturbances decay.
        lock_gain: gain to run with: that, with a margin.
        flaw: why the gait does not attract whatever the gain, or ''.

    """

    enough: float
    lock_gain: float
    flaw: str


def stability(orbit: Orbit) -> Stability:
    """Judge an orbit by its multipliers.

    Where the network knows a bound that holds in any of its states, the gain comes from that.
    """
    bound = orbit.network.sufficient_gain(RATE)
    if bound is None:
        enough, gain = (sufficient_gain(orbit, rate) for rate in (0.0, RATE))
    else:
        enough = gain = bound
    leading = leading_within(orbit)
    flaw = '' if leading < ATTRACTS else (
        f'a disturbance within its own symmetry class grows {leading:.4g} times a stride')
    return Stability(enough, gain, flaw)


@dataclass(frozen=True, eq=False, repr=False)
class GaitAssessment(ShortRepr):
    """One gait of one parameter set.

    Attributes:
        gait: one of the network's gaits.
        orbit: its orbit, or None; of several one that attracts within the gait's class if any
            does, nearest in period to that of the preset.
        why: why there is none, or ''.
        others: the same of each coexisting orbit of the gait that was found.
        searched: what others were searched from, or ''.

    """

    gait: str
    orbit: Orbit | None
    why: str = ''
    others: tuple['GaitAssessment', ...] = ()
    searched: str = ''

    @property
    def orbits(self) -> tuple['GaitAssessment', ...]:
        """Itself and the others; none where there is no orbit."""
        return () if self.orbit is None else (self, *self.others)

    @property
    def _orbit(self) -> Orbit:
        if self.orbit is None:
            raise NoOrbit(f'there is no {self.gait}: {self.why}')
        return self.orbit

    @property
    def amplitude(self) -> float:
        """Half the range of cell 1's first variable."""
        return float(self._orbit.levels[0, 0, 1])

    @property
    def phases(self) -> dict[str, float]:
        """Phase of each leg's first cell, or of each muscle, in cycles."""
        orbit = self._orbit
        muscles = orbit.network.muscles
        return ({name: float(orbit.phases[cell - 1]) for name, cell in muscles.items()}
                or orbit.leg_phases)

    @cached_property
    def multipliers(self) -> Multipliers:
        """Floquet multipliers without a symmetry lock."""
        return multipliers(self._orbit)

    @property
    def stable(self) -> bool:
        """Whether the gait attracts in the full network, without a lock."""
        return self.multipliers.attracts

    @cached_property
    def smallest_gain(self) -> float:
        """Symmetry gain above which every transverse disturbance decays, 1/model time."""
        return smallest_gain(self._orbit)

    @cached_property
    def default_gain(self) -> float:
        """The gain the generator would choose, 1/model time."""
        return sufficient_gain(self._orbit, RATE)

    @cached_property
    def stable_with_default_gain(self) -> bool:
        """Whether the gait attracts with the gain the generator would choose."""
        return attracts_with(self._orbit, self.default_gain)

    def as_dict(self) -> dict[str, Any]:
        """Everything in plain types, for JSON."""
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
    """Judge every gait of a network, by all of its orbits that are found.

    Where the orbit reached first is not stable, others are looked for from starts in the gait's
    class; where none attracts in it, also by deflation and, with a delay, on branches.

    Args:
        network: parameters, all finite.
        done: called with the number of gaits that are done.
        near: a known orbit of one of the gaits, from which that one is solved for.
        everything: look for all orbits of every gait.

    Raises:
        InputError: a parameter that is not finite, or a delay that is not positive.

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
    """Return a text on the nearest threshold of a gait, for a network with a delay without one.

    The critical delay that is nearest above the delay; where no delay has one, what the network
    says has to be larger.
    """
    name, delay = network.delay_parameter, network.delay
    points = {gait: first_hopf(network, gait) for gait in network.gaits()}
    ahead = {gait: point.value for gait, point in points.items()
             if point is not None and point.value >= delay}
    if ahead:
        gait = min(ahead, key=lambda one: ahead[one])
        return (f"the nearest threshold is the {gait}'s critical delay {ahead[gait]:.4f} ({name} "
                f'is {delay:g})')
    needed = {gait: coupling for gait, point in points.items()
              if point is None and (coupling := network.least_coupling(gait)) is not None}
    if needed:
        gait = min(needed, key=lambda one: needed[one].least)
        what, value, least = needed[gait]
        return (f'the nearest threshold is {what} {least:.4f}, above which the {gait} has a '
                f'critical delay ({what} is {value:g})')
    if not any(points.values()):
        return 'no delay gives one'
    return f'every critical delay is below {name}, but no orbit was found this far from onset'
