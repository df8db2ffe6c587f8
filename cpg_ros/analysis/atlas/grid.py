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

"""Refinement of a grid: points between neighbours that differ are computed.

Between neighbours at which a gait exists, or not, with the same stability, points are interpolated
bilinearly. The result does not depend on the workers.
"""

from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, field
import itertools
from typing import Any

from cpg_ros.analysis.atlas.chart import COARSE, ParameterPlane
from cpg_ros.analysis.atlas.hopf_curves import Boundary, ChartLine
from cpg_ros.analysis.atlas.row_job import AtlasRow, NONE
from cpg_ros.common.errors import ShortRepr
import numpy as np

#: Orbits from which a point is reached, and numbers of a point.
CLOSE = 2
NUMBERS = ('period', 'amplitude', 'leading', 'leading_within', 'unstable', 'lock', 'basin')


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
        self.numbers = {name: np.full(self.shape, np.nan) for name in NUMBERS}

    def take(self, points: Iterable[dict[str, Any]]) -> None:
        """Enter the points of a job where they are better than those before."""
        for point in points:
            at = point['row'], point['column']
            if self.computed[at] and point['label'] <= self.label[at]:
                continue
            self.label[at], self.computed[at] = point['label'], True
            for name in NUMBERS:
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
    columns = tuple(chart.second.indices(COARSE))
    rows = {gait: set(chart.first.indices(COARSE)) for gait in gaits}
    for curve in curves:
        low, high = np.interp([curve.points[:, 0].min(), curve.points[:, 0].max()],
                              chart.first.values, np.arange(chart.first.count))
        if high - low < 2 * COARSE:
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
        before: labels at the previous call; only points that have changed since are used.

    """
    jobs = []
    new = [at for at in sheet.waves if sheet.label[at] != before[at]]
    for row in chart.first.indices(COARSE):
        columns: list[int] = []
        near: set[tuple[int, int]] = set()
        for column in chart.second.indices(COARSE):
            close = {at for at in new if max(abs(at[0] - row), abs(at[1] - column)) <= COARSE
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
    """Yield edges of the coarse grid at whose ends labels differ and that no curve crosses.

    Args:
        chart: the plane.
        gait: of the map.
        sheet: the map.
        curves: boundaries that have been followed.

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
    seen = set()
    for column in columns:
        close = sorted((abs(r - row) + abs(c - column), r, c)
                       for r in range(max(0, row - stride), row + stride + 1)
                       for c in range(max(0, column - stride), column + stride + 1)
                       if (r, c) in sheet.waves)[:CLOSE]
        for _, r, c in close:
            if (r, c) not in seen:
                seen.add((r, c))
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
    stride = COARSE
    while True:
        for row, points in run(jobs, len(jobs)):
            sheets[row.gait].take(points)
        if stride == COARSE:
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
