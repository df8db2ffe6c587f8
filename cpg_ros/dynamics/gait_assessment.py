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

"""What a parameter set does, gait by gait: whether there is one, how large, how fast, how stable.

And what stands nearest where there is none: the threshold at which rest gives way.
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import Any

from cpg_ros.dynamics.continuation import continue_from_hopf
from cpg_ros.dynamics.equilibrium import NoEquilibrium
from cpg_ros.dynamics.floquet import attracts_with, Multipliers, multipliers, smallest_gain
from cpg_ros.dynamics.hopf import first_hopf
from cpg_ros.dynamics.hopf_search import hopf_points
from cpg_ros.dynamics.orbit import NoOrbit, Orbit, solve_orbit
from cpg_ros.dynamics.stability import stability
from cpg_ros.networks.network import Network
from cpg_ros.networks.parameter_line import ParameterLine

#: Hopf points are looked at up to this many times the delay, and so many turns more than the
#: first of their kind.
FURTHEST, TURNS = 4.0, 1


@dataclass(frozen=True)
class GaitAssessment:
    """One gait of one parameter set.

    Attributes:
        gait: one of the network's gaits.
        orbit: its orbit, or None.
        why: why there is none, or ''.

    """

    gait: str
    orbit: Orbit | None
    why: str = ''

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
        network = type(orbit.network)
        legs = next(iter(network.legs.values()))
        told = network.muscles or {leg: cells[0] for leg, cells in legs.items()}
        return {name: float(orbit.phases[cell - 1]) for name, cell in told.items()}

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
        return stability(self._orbit).chosen

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
                'stable_with_default_gain': self.stable_with_default_gain}


def verdicts(network: Network, done: Callable[[int], None] = lambda count: None
             ) -> dict[str, GaitAssessment]:
    """Judge every gait of a network.

    Args:
        network: parameters, all finite.
        done: told how many gaits are done.

    Raises:
        InputError: a parameter that is not finite, or a delay that is not positive.

    """
    found = {}
    for count, gait in enumerate(network.gaits()):
        done(count)
        try:
            try:
                found[gait] = GaitAssessment(gait, solve_orbit(network, gait))
            except NoOrbit as error:
                found[gait] = _beyond(network, gait, str(error))
        except NoEquilibrium as error:
            found[gait] = GaitAssessment(gait, None, str(error))
    done(len(found))
    return found


def _beyond(network: Network, gait: str, why: str) -> GaitAssessment:
    """Look for an orbit that the solver does not reach from the first onset.

    Those born with unstable roots in their own class, and those beyond a fold, lie on the
    branches of the gait's Hopf points as the delay moves.
    """
    name, delay = network.delay_parameter, network.delay
    if not name:
        return GaitAssessment(gait, None, why)
    line, shifts = ParameterLine((name,), (1.0,)), set(network.symmetry(gait).shifts)
    for point in hopf_points(network, line, 0.0, FURTHEST * delay):
        if set(point.block.symmetry.shifts) != shifts:
            continue
        if (point.value < delay) != (point.normal_form.side > 0) or point.n > TURNS:
            continue
        low, high = sorted((0.9 * point.value, delay)) if point.normal_form.side > 0 else (
            0.5 * delay, 1.1 * point.value)
        try:
            branch = continue_from_hopf(point.network, point.block.symmetry, point.omega, line,
                                        low, high,
                                        rest=point.state, vector=point.eigenvector, most=80)
            orbits = branch.at(delay)
        except NoOrbit:
            continue
        if orbits:
            return GaitAssessment(gait, orbits[-1])
    first = first_hopf(network, gait)
    if first is not None and first.value > delay:
        why = f"{name} {delay:g} is below the {gait}'s critical delay {first.value:.4f}"
    return GaitAssessment(gait, None, why)


def nearest_threshold(network: Network) -> str:
    """Name what would have to change for a gait, of a network with a delay that has none.

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
