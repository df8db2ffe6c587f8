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

"""A row of an atlas for one gait, as a job: orbits continued from neighbour to neighbour."""

from collections.abc import Iterator
from contextlib import suppress
from dataclasses import dataclass
from typing import Any

from cpg_ros.analysis.atlas.chart import ParameterPlane
from cpg_ros.analysis.basin import basin
from cpg_ros.common.errors import CpgError
from cpg_ros.dynamics.arclength import NoOrbit
from cpg_ros.dynamics.continuation import continue_from_hopf
from cpg_ros.dynamics.equilibrium import NoEquilibrium
from cpg_ros.dynamics.floquet import multipliers, sufficient_gain
from cpg_ros.dynamics.fourier import orbit as collocation
from cpg_ros.dynamics.fourier.floquet import Accuracy
from cpg_ros.dynamics.hopf import hopf_points
from cpg_ros.dynamics.orbit import extra_symmetry, Orbit
from cpg_ros.dynamics.solve_orbit import solve_beside, solve_from_path, solve_orbit
from cpg_ros.dynamics.stability import RATE
from cpg_ros.networks.network import Network
from cpg_ros.networks.stated_gait import other_gait
import numpy as np

#: Labels of a gait at a point. NONE: no orbit; UNSTABLE: unstable in its class; LOCKED: attracts
#: with a symmetry lock; STABLE: attracts by itself.
NONE, UNSTABLE, LOCKED, STABLE = range(4)
#: KEPT: number of points of a waveform that are kept.
KEPT = 65
#: Accuracy of multipliers for a map.
ACCURACY = Accuracy(4, 1e-6, 1e-4, 4)
#: Random states from which the basin of an orbit is estimated.
STARTS = 8
#: MOST: most points of a branch from a Hopf point; TRIED: most nearby orbits that are continued to
#: a point; STEPS: numbers of steps in which this is tried.
MOST, TRIED, STEPS = 60, 3, (1, 4)


@dataclass(frozen=True)
class AtlasRow:
    """Points of one gait in a row of the grid.

    Attributes:
        chart: the plane.
        gait: of the network.
        row: index on the first axis.
        columns: indices on the second axis, rising.
        near: row, column, waveforms (nodes, components) and period of orbits close by.
        basin: whether to run from random starts.
        again: whether orbits are only continued from those close by.

    """

    chart: ParameterPlane
    gait: str
    row: int
    columns: tuple[int, ...]
    near: tuple[tuple[int, int, list[list[float]], float], ...] = ()
    basin: bool = False
    again: bool = False


def assess_row(row: AtlasRow) -> list[dict[str, Any]]:
    """Assess the gait at the points of a row; return a dictionary of plain types for each.

    Of several orbits the first counts that attracts, if only with a lock.
    """
    finder = _Finder(row)
    return [finder.point(column) for column in row.columns]


class _Finder:
    def __init__(self, row: AtlasRow) -> None:
        self.row = row
        self.first = float(row.chart.first.values[row.row])
        self.last: Orbit | None = None
        self._branches: list[Any] | None = None

    def point(self, column: int) -> dict[str, Any]:
        value = float(self.row.chart.second.values[column])
        network = self.row.chart.at(self.first, value)
        best: tuple[Orbit, dict[str, Any]] | None = None
        periods: list[float] = []
        for orbit in self._orbits(network, column, value):
            if np.isclose(orbit.period, periods, rtol=1e-6).any():
                continue
            periods.append(orbit.period)
            judged = _assess(orbit)
            if best is None or judged['label'] > best[1]['label']:
                best = orbit, judged
            if best[1]['label'] >= LOCKED:
                break
        point_data: dict[str, Any] = {'gait': self.row.gait, 'row': self.row.row, 'column': column,
                                      'label': NONE}
        self.last = best[0] if best else None
        if best:
            orbit, judged = best
            point_data |= judged | {'wave': _wave(orbit)}
            if self.row.basin:
                point_data['basin'] = basin(orbit, STARTS, gain=point_data['lock']).fraction
        return point_data

    def _orbits(self, network: Network, column: int, value: float) -> Iterator[Orbit]:
        gait = self.row.gait
        if network.broken(network.symmetry(gait)) or other_gait(network, gait):
            return
        if self.last is not None:
            with suppress(NoOrbit):
                yield from _proper(solve_beside(network, self.last))
        for near in sorted(self.row.near, key=lambda point: (
                abs(point[0] - self.row.row) + abs(point[1] - column), point[:2]))[:TRIED]:
            try:
                yield from _proper(self._continued(near, value))
            except NoOrbit:
                continue
        if self.row.again:
            return
        with suppress(NoOrbit, NoEquilibrium):
            yield from _proper(solve_orbit(network, gait))
        # Branches are searched on the coarse grid only.
        for branch in self._from_rest(network) if self.row.basin else ():
            try:
                yield from branch.at(value)[::-1]
            except CpgError:
                continue

    def _continued(self, near: tuple[int, int, list[list[float]], float], value: float) -> Orbit:
        """Continue an orbit close by in a straight line to a value, in one step or several.

        Raises:
            NoOrbit: it ends on the way.

        """
        chart, (row, column, wave, period) = self.row.chart, near
        begin = np.array([chart.first.values[row], chart.second.values[column]])
        end = np.array([self.first, value])
        orbit = solve_from_wave(chart.at(*map(float, begin)), self.row.gait, wave, period)
        for steps in STEPS:
            ahead = orbit
            try:
                for k in range(1, steps + 1):
                    ahead = solve_beside(chart.at(*map(float, begin + k / steps * (end - begin))),
                                         ahead)
                return ahead
            except NoOrbit:
                if steps == STEPS[-1]:
                    raise
        return orbit

    def _from_rest(self, network: Network) -> list[Any]:
        """Return the branches of the gait's Hopf points in this row, where there is a delay."""
        line, axis = self.row.chart.second.line, self.row.chart.second
        if line.names != (network.delay_parameter,):
            return []
        if self._branches is None:
            self._branches = []
            shifts = set(network.symmetry(self.row.gait).shifts)
            try:
                points = hopf_points(network, line, 0.0, axis.high)
            except CpgError:
                return []
            for point in points:
                if set(point.block.symmetry.shifts) != shifts or point.n:
                    continue
                low, high = ((0.9 * point.value, axis.high) if point.normal_form.side >= 0
                             else (axis.low, 1.1 * point.value))
                try:
                    self._branches.append(continue_from_hopf(point, line, low, high, most=MOST))
                except CpgError:
                    continue
        return self._branches


def _assess(orbit: Orbit) -> dict[str, Any]:
    """Return the stability of an orbit, and its numbers."""
    spectrum = multipliers(orbit, accuracy=ACCURACY)
    if None in (spectrum.attracts, spectrum.attracts_within):
        spectrum = multipliers(orbit)
    return {'label': (STABLE if spectrum.attracts else
                      LOCKED if spectrum.attracts_within else UNSTABLE),
            'period': orbit.period, 'amplitude': float(orbit.levels[0, 0, 1]),
            'leading': spectrum.leading, 'leading_within': spectrum.leading_within,
            'unstable': spectrum.unstable,
            'lock': 0.0 if spectrum.attracts else sufficient_gain(orbit, RATE)}


def _proper(orbit: Orbit) -> Iterator[Orbit]:
    """Yield the orbit, unless it has more symmetry or almost no amplitude."""
    if orbit.levels[0, 0, 1] > 1e-3 and not extra_symmetry(orbit):
        yield orbit


def _wave(orbit: Orbit) -> list[list[float]]:
    """Return the states at an odd number of even times of a cycle."""
    theta = np.arange(KEPT) / KEPT
    return np.round(orbit(theta * orbit.period), 5).tolist()


def solve_from_wave(network: Network, gait: str, wave: list[list[float]], period: float) -> Orbit:
    """Solve for a gait's orbit from stored waveforms of it.

    Raises:
        NoOrbit: there is none near them.

    """
    columns = np.array(wave).T
    orbit = solve_from_path(network, network.symmetry(gait), lambda theta: np.array(
        [collocation.evaluate(column, theta) for column in columns]).T, period)
    if orbit is None:
        raise NoOrbit('no orbit near the stored one')
    return orbit


