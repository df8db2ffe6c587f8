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

"""Branches of ``analyze --plot``, and how gaits lose their stability along them."""

from dataclasses import dataclass, field

from cpg_ros.analysis.analysis_report import Analysis
from cpg_ros.common.command_line import progress_bar
from cpg_ros.dynamics.arclength import NoOrbit
from cpg_ros.dynamics.continuation import (
    Bifurcation,
    bifurcations,
    Branch,
    continue_from_hopf,
    continue_orbit,
)
from cpg_ros.dynamics.floquet import Multipliers, multipliers
from cpg_ros.dynamics.hopf import HopfPoint
from cpg_ros.dynamics.orbit import Orbit
from cpg_ros.dynamics.orbit_normal_form import loses_stability, orbit_normal_form, OrbitNormalForm

#: Points of a branch; arclength between them; ratio of the last period to the first, as branches
#: wind near a homoclinic orbit.
MAX_POINTS, MAX_STEP, MAX_PERIOD_RATIO, MAX_BRANCHES = 80, 0.3, 5.0, 12
#: Kind of a loss of stability -> motion that branches off.
BRANCHING_MOTIONS = {'torus': 'a torus', 'period doubling': 'a gait of two strides',
                     'branch point': 'a gait of less symmetry'}


@dataclass(frozen=True)
class StabilityLoss:
    """A point beyond which a gait no longer attracts, and its normal form.

    Attributes:
        gait: name.
        point: of its branch.
        form: normal form there.

    """

    gait: str
    point: Bifurcation
    form: OrbitNormalForm

    def text(self, along: str) -> str:
        """Return it as a line."""
        verdict = self.form.verdict
        if self.form.soft is not None:
            verdict += (f': {BRANCHING_MOTIONS[self.point.kind]} branches off and is stable'
                        if self.form.soft else ': no stable motion nearby, the gait jumps')
        return (f'{self.gait} loses stability at {along} {self.point.value:.6g} '
                f'({self.point.kind}), {verdict}')

    def as_dict(self) -> dict[str, object]:
        """Return it as plain types."""
        cubic = None if self.form.soft is None else self.form.cubic.real
        return {'gait': self.gait, 'value': self.point.value, 'kind': self.point.kind,
                'soft': self.form.soft, 'cubic': cubic, 'why': self.form.why}


@dataclass
class AssessedBranch:
    """A branch of a gait with the stability of its points.

    Attributes:
        gait: name.
        branch: of its orbits.
        kinds: of each point: 0 attracts, 1 attracts with a symmetry lock, 2 does not attract.
        crossings: points where a multiplier crosses the unit circle.
        losses: crossings next to which the gait attracts.

    """

    gait: str
    branch: Branch
    kinds: list[int] = field(default_factory=list)
    crossings: tuple[Bifurcation, ...] = ()
    losses: list[StabilityLoss] = field(default_factory=list)


def assess_branches(analysis: Analysis) -> list[AssessedBranch]:
    """Follow the gaits of an analysis, and judge where they lose stability."""
    assessed = [AssessedBranch(gait, branch) for gait, branch in _branches(analysis)]
    done = 0
    with progress_bar('stability along the branches',
                      sum(len(entry.branch.points) for entry in assessed)) as bar:
        for entry in assessed:
            spectra: list[Multipliers] = []
            for member in entry.branch.points:
                spectra.append(multipliers(member.orbit))
                entry.kinds.append(0 if spectra[-1].attracts else
                                   1 if spectra[-1].attracts_within else 2)
                done += 1
                bar(done)
            entry.crossings = bifurcations(entry.branch, spectra)
    lost = [(entry, point) for entry in assessed for point in entry.crossings
            if loses_stability(point.point.orbit)]
    with progress_bar('normal forms where gaits lose stability', len(lost)) as bar:
        for done, (entry, point) in enumerate(lost, 1):
            entry.losses.append(StabilityLoss(entry.gait, point, orbit_normal_form(
                point.point.orbit, point.multiplier, point.part)))
            bar(done)
    return assessed


def _branches(analysis: Analysis) -> list[tuple[str, Branch]]:
    """Follow the gaits from their Hopf points within the span, and from the set's orbits.

    An orbit that lies on the branch of a Hopf point is not followed again.
    """
    low, high = _span(analysis)
    value = analysis.along.value(analysis.network)
    branches: list[tuple[str, Branch]] = []
    for point in on_line(analysis)[:MAX_BRANCHES]:
        branches.extend((point.gait, branch) for branch in _born(point, analysis))
    for verdict in analysis.existing:
        orbit = verdict.known_orbit
        if low <= value <= high and not any(
                gait == verdict.gait and _holds(branch, value, orbit)
                for gait, branch in branches):
            branches.append((verdict.gait,
                             continue_orbit(orbit, analysis.along, low, high, most=MAX_POINTS,
                                            longest_step=MAX_STEP, longest=MAX_PERIOD_RATIO)))
    return branches


def _span(analysis: Analysis) -> tuple[float, float]:
    """Return the ends between which branches are followed; delays are above 0."""
    low, high = analysis.span
    if analysis.along.names == (analysis.delay,):
        low = max(low, type(analysis.network).ranges[analysis.delay].low)
    return low, high


def _holds(branch: Branch, value: float, orbit: Orbit) -> bool:
    """Return whether a branch passes through an orbit."""
    try:
        return any(abs(other.period / orbit.period - 1.0) < 1e-6 for other in branch.at(value))
    except NoOrbit:
        return False


def on_line(analysis: Analysis) -> list[HopfPoint]:
    """Hopf points that lie on the line along which branches are drawn."""
    low, high = analysis.span
    return [point for point in analysis.hopf
            if analysis.line == analysis.along and low <= point.value <= high]


def _born(point: HopfPoint, analysis: Analysis) -> list[Branch]:
    """Return the branch of a Hopf point, or None if its first orbit cannot be found."""
    low, high = _span(analysis)
    try:
        return [continue_from_hopf(point, analysis.along, low, high, most=MAX_POINTS,
                                   longest=MAX_PERIOD_RATIO, longest_step=MAX_STEP)]
    except NoOrbit:
        return []
