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

"""The grid of an atlas: rows as jobs, and refinement between neighbours that differ.

In a row, orbits of one gait are continued from neighbour to neighbour. Between neighbours that
agree on existence and stability of a gait, points are interpolated bilinearly. The result does not
depend on the workers.
"""

from collections.abc import Callable, Iterable, Iterator
from contextlib import suppress
from dataclasses import dataclass, field
import itertools
from typing import Any

from cpg_ros.analysis.atlas.chart import COARSE_STEP, ParameterPlane
from cpg_ros.analysis.atlas.hopf_curves import Boundary, ChartLine
from cpg_ros.analysis.basin import basin
from cpg_ros.common.errors import CpgError, ShortRepr
from cpg_ros.dynamics.arclength import NoOrbit
from cpg_ros.dynamics.continuation import continue_from_hopf
from cpg_ros.dynamics.equilibrium import NoEquilibrium
from cpg_ros.dynamics.floquet import multipliers, sufficient_gain
from cpg_ros.dynamics.fourier import orbit as collocation
from cpg_ros.dynamics.fourier.floquet import Accuracy
from cpg_ros.dynamics.hopf import hopf_points
from cpg_ros.dynamics.orbit import extra_symmetry, Orbit
from cpg_ros.dynamics.solve_orbit import solve_beside, solve_from_path, solve_orbit
from cpg_ros.dynamics.stability import lock_rate
from cpg_ros.networks.network import Network, other_gait
import numpy as np

#: Labels of a gait at a point. NONE: no orbit; UNSTABLE: unstable in its class; UNSURE: cannot
#: tell, as a multiplier in its class is 1 to within its error; LOCKED: attracts with a symmetry
#: lock; STABLE: attracts by itself.
NONE, UNSTABLE, UNSURE, LOCKED, STABLE = range(5)
#: Of a waveform in a file.
WAVEFORM_POINTS = 65
#: Of multipliers for a map; distance of a leading one from 1 at which all are computed as in other
#: reports.
ACCURACY, NEUTRAL_TOLERANCE = Accuracy(4, 1e-6, 1e-4, 4), 1e-3
#: Random states from which the basin of an orbit is estimated.
NUM_STATES = 8
#: Points of a branch from a Hopf point; nearby orbits that are continued to a point; numbers of
#: steps in which this is tried.
MAX_POINTS, MAX_NEARBY, NUM_STEPS = 60, 3, (1, 4)


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

    Of several orbits, the first that attracts, with or without a lock, counts.
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
            assessed = _assess(orbit)
            if best is None or assessed['label'] > best[1]['label']:
                best = orbit, assessed
            if best[1]['label'] >= LOCKED:
                break
        point_data: dict[str, Any] = {'gait': self.row.gait, 'row': self.row.row, 'column': column,
                                      'label': NONE}
        self.last = best[0] if best else None
        if best:
            orbit, assessed = best
            point_data |= assessed | {'wave': _wave(orbit)}
            if self.row.basin:
                point_data['basin'] = basin(orbit, NUM_STATES, gain=point_data['lock']).fraction
        return point_data

    def _orbits(self, network: Network, column: int, value: float) -> Iterator[Orbit]:
        gait = self.row.gait
        if network.broken(network.symmetry(gait)) or other_gait(network, gait):
            return
        if self.last is not None:
            with suppress(NoOrbit):
                yield from _proper(solve_beside(network, self.last))
        for near in sorted(self.row.near, key=lambda point: (
                abs(point[0] - self.row.row) + abs(point[1] - column), point[:2]))[:MAX_NEARBY]:
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
        for steps in NUM_STEPS:
            ahead = orbit
            try:
                for k in range(1, steps + 1):
                    ahead = solve_beside(chart.at(*map(float, begin + k / steps * (end - begin))),
                                         ahead)
                return ahead
            except NoOrbit:
                if steps == NUM_STEPS[-1]:
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
                    self._branches.append(continue_from_hopf(point, line, low, high,
                                                             most=MAX_POINTS))
                except CpgError:
                    continue
        return self._branches


def _assess(orbit: Orbit) -> dict[str, Any]:
    """Return the stability of an orbit, and its numbers."""
    spectrum = multipliers(orbit, accuracy=ACCURACY)
    if any(abs(modulus - 1.0) < NEUTRAL_TOLERANCE for modulus in (spectrum.leading_within,
                                                         spectrum.leading_transverse)):
        spectrum = multipliers(orbit)
    return {'label': STABLE if spectrum.attracts else {
        True: LOCKED, None: UNSURE, False: UNSTABLE}[spectrum.attracts_within],
            'period': orbit.period, 'amplitude': float(orbit.levels[0, 0, 1]),
            'leading': spectrum.leading, 'leading_within': spectrum.leading_within,
            'unstable': spectrum.unstable,
            'lock': 0.0 if spectrum.attracts else sufficient_gain(orbit, lock_rate(orbit.network))}


def _proper(orbit: Orbit) -> Iterator[Orbit]:
    """Yield the orbit, unless it has more symmetry or almost no amplitude."""
    if orbit.levels[0, 0, 1] > 1e-3 and not extra_symmetry(orbit):
        yield orbit


def _wave(orbit: Orbit) -> list[list[float]]:
    """Return the states at an odd number of even times of a cycle."""
    return np.round(orbit.cycle(WAVEFORM_POINTS), 5).tolist()


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


#: Orbits from which a point is reached, and numbers of a point.
NUM_CORNERS = 2
QUANTITIES = ('period', 'amplitude', 'leading', 'leading_within', 'unstable', 'lock', 'basin')


@dataclass(eq=False, repr=False)
class GaitMap(ShortRepr):
    """One gait on the grid.

    Attributes:
        shape: rows and columns.
        label: shape (rows, columns); -1 where there is none yet.
        computed: whether a point was computed, the same shape.
        numbers: name -> values, nan where there are none.
        waves: (row, column) -> waveforms and period.

    """

    shape: tuple[int, int]
    label: np.ndarray = field(init=False)
    computed: np.ndarray = field(init=False)
    numbers: dict[str, np.ndarray] = field(init=False)
    waves: dict[tuple[int, int], tuple[list[list[float]], float]] = field(default_factory=dict)

    def __post_init__(self) -> None:
        self.label = np.full(self.shape, -1)
        self.computed = np.zeros(self.shape, dtype=bool)
        self.numbers = {name: np.full(self.shape, np.nan) for name in QUANTITIES}

    def add_points(self, points: Iterable[dict[str, Any]]) -> None:
        """Enter the points of a job where they are better than previous ones."""
        for point in points:
            at = point['row'], point['column']
            if self.computed[at] and point['label'] <= self.label[at]:
                continue
            self.label[at], self.computed[at] = point['label'], True
            for name in QUANTITIES:
                if point.get(name) is not None:
                    self.numbers[name][at] = point[name]
            if 'wave' in point:
                self.waves[at] = point['wave'], point['period']

    def fill(self, at: tuple[int, int], corners: list[tuple[int, int]]) -> None:
        """Interpolate a point from those around it, which agree."""
        self.label[at] = self.label[corners[0]]
        for values in self.numbers.values():
            values[at] = np.mean([values[corner] for corner in corners])


def coarse_rows(chart: ParameterPlane, gaits: tuple[str, ...],
                curves: Iterable[Boundary]) -> Iterator[AtlasRow]:
    """Yield the jobs of the coarse grid, and of rows through Hopf curves between its own rows."""
    columns = tuple(chart.second.indices(COARSE_STEP))
    rows = {gait: set(chart.first.indices(COARSE_STEP)) for gait in gaits}
    for curve in curves:
        low, high = np.interp([curve.points[:, 0].min(), curve.points[:, 0].max()],
                              chart.first.values, np.arange(chart.first.count))
        if high - low < 2 * COARSE_STEP:
            for gait in curve.gaits:
                rows[gait].add(round(0.5 * (low + high)))
    for row in sorted(set().union(*rows.values())):
        for gait in gaits:
            if row in rows[gait]:
                yield AtlasRow(chart, gait, row, columns, basin=True)


def worse_points(chart: ParameterPlane, gait: str, sheet: GaitMap,
                 before: np.ndarray) -> list[AtlasRow]:
    """Return jobs for points of the coarse grid that are worse than a neighbour.

    A neighbour's orbit may reach a point that no branch from a Hopf point of its row reaches.

    Args:
        chart: the plane.
        gait: of the map.
        sheet: the map.
        before: labels at the previous call; only points next to changed ones are used.

    """
    jobs = []
    new = [at for at in sheet.waves if sheet.label[at] != before[at]]
    for row in chart.first.indices(COARSE_STEP):
        columns: list[int] = []
        near: set[tuple[int, int]] = set()
        for column in chart.second.indices(COARSE_STEP):
            close = {at for at in new if max(abs(at[0] - row), abs(at[1] - column)) <= COARSE_STEP
                     and sheet.label[at] > sheet.label[row, column]}
            if close:
                columns.append(column)
                near |= close
        if columns:
            jobs.append(AtlasRow(chart, gait, row, tuple(columns), tuple(
                (*at, *sheet.waves[at]) for at in sorted(near)), basin=True, again=True))
    return jobs


def refine_once(chart: ParameterPlane, gait: str, sheet: GaitMap, stride: int) -> list[AtlasRow]:
    """Halve the stride of the grid: interpolate clear points; return jobs for the others."""
    rows, columns = chart.first.indices(stride), chart.second.indices(stride)
    points: set[tuple[int, int]] = set()
    fillable: dict[tuple[int, int], list[tuple[int, int]]] = {}
    for top, bottom in itertools.pairwise(rows):
        for left, right in itertools.pairwise(columns):
            corners = [(top, left), (top, right), (bottom, left), (bottom, right)]
            clear = len({int(sheet.label[corner]) for corner in corners}) == 1
            for at, between in _middles(top, bottom, left, right, corners):
                if sheet.label[at] >= 0:
                    continue
                if clear:
                    fillable.setdefault(at, between)
                else:
                    points.add(at)
    for at, between in fillable.items():
        if at not in points:
            sheet.fill(at, between)
    by_row: dict[int, list[int]] = {}
    for row, column in sorted(points):
        by_row.setdefault(row, []).append(column)
    return [AtlasRow(chart, gait, row, tuple(columns), tuple(_near(sheet, row, columns, stride)))
            for row, columns in by_row.items()]


def uncrossed_edges(chart: ParameterPlane, gait: str, sheet: GaitMap, curves: Iterable[Boundary]
                    ) -> Iterator[ChartLine]:
    """Yield edges of the coarse grid whose ends have different labels and that no curve crosses.

    Args:
        chart: the plane.
        gait: of the map.
        sheet: the map.
        curves: known boundaries.

    """
    crossing = [curve for curve in curves if gait in curve.gaits]
    for axis, left, right in chart.neighbours():
        ends = chart.fraction(left), chart.fraction(right)
        if sheet.label[left] != sheet.label[right] and not any(
                curve.passes(chart, 0.5 * (ends[0] + ends[1]),
                             float(np.abs(ends[0] - ends[1]).max())) for curve in crossing):
            low, high = (chart.values_at(end) for end in ends)
            yield ChartLine(chart, (gait,), axis, low[1 - axis], low[axis], high[axis])


def _middles(top: int, bottom: int, left: int, right: int, corners: list[tuple[int, int]]
             ) -> Iterator[tuple[tuple[int, int], list[tuple[int, int]]]]:
    """Yield the midpoints of a cell's edges and its centre, with the corners around each."""
    row, column = (top + bottom) // 2, (left + right) // 2
    yield (top, column), corners[:2]
    yield (bottom, column), corners[2:]
    yield (row, left), corners[::2]
    yield (row, right), corners[1::2]
    yield (row, column), corners


def _near(sheet: GaitMap, row: int, columns: list[int], stride: int
          ) -> Iterator[tuple[int, int, list[list[float]], float]]:
    """Yield the closest orbits around each point of a row."""
    visited = set()
    for column in columns:
        close = sorted((abs(r - row) + abs(c - column), r, c)
                       for r in range(max(0, row - stride), row + stride + 1)
                       for c in range(max(0, column - stride), column + stride + 1)
                       if (r, c) in sheet.waves)[:NUM_CORNERS]
        for _, r, c in close:
            if (r, c) not in visited:
                visited.add((r, c))
                wave, period = sheet.waves[r, c]
                yield r, c, wave, period


def refine(chart: ParameterPlane, gaits: tuple[str, ...], curves: Iterable[Boundary],
           run: Callable[[Iterable[AtlasRow], int],
                         Iterable[tuple[AtlasRow, list[dict[str, Any]]]]]
           ) -> dict[str, GaitMap]:
    """Fill sheets for all gaits, from the coarse grid to the finest.

    Args:
        chart: the plane.
        gaits: of its network.
        curves: of their Hopf points.
        run: runs jobs, given with their number.

    """
    sheets = {gait: GaitMap((chart.first.count, chart.second.count)) for gait in gaits}
    jobs: list[AtlasRow] = list(coarse_rows(chart, gaits, curves))
    before = {gait: np.full_like(sheet.label, -1) for gait, sheet in sheets.items()}
    stride = COARSE_STEP
    while True:
        for row, points in run(jobs, len(jobs)):
            sheets[row.gait].add_points(points)
        if stride == COARSE_STEP:
            jobs = [job for gait in gaits for job in worse_points(chart, gait, sheets[gait],
                                                                  before[gait])]
            before = {gait: sheet.label.copy() for gait, sheet in sheets.items()}
            if jobs:
                continue
        if stride == 1:
            break
        jobs = [job for gait in gaits for job in refine_once(chart, gait, sheets[gait], stride)]
        stride //= 2
    for sheet in sheets.values():
        assert (sheet.label >= NONE).all()
    return sheets
