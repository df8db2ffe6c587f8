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

Between neighbours that agree for a gait in everything that is named (whether it exists and how
stable it is) they are filled in, bilinearly. What is computed does not depend on the workers.
"""

from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, field
import itertools
from typing import Any

from cpg_ros.analysis.atlas.chart import COARSE, ParameterPlane
from cpg_ros.analysis.atlas.hopf_curves import Boundary, ChartLine, on_curve
from cpg_ros.analysis.atlas.row_job import AtlasRow, NONE
from cpg_ros.common.errors import ShortRepr
import numpy as np

#: CLOSE: number of known orbits from which a point is reached; then the numbers that are filled in
#: between points that agree.
CLOSE = 2
NUMBERS = ('period', 'amplitude', 'leading', 'leading_within', 'unstable', 'lock', 'basin')


@dataclass(eq=False, repr=False)
class GaitMap(ShortRepr):
    """One gait on the grid, as far as it is known.

    Attributes:
        shape: rows and columns.
        label: shape (rows, columns); -1 where nothing is known yet.
        computed: whether it was computed, the same shape.
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
        """Enter the points of a job, where they are better than those known."""
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
        """Fill in a point from those around it, which agree."""
        self.label[at] = self.label[corners[0]]
        for values in self.numbers.values():
            values[at] = np.mean([values[corner] for corner in corners])


def grid_indices(count: int, stride: int) -> list[int]:
    """Return the indices of a grid of this stride: the coarse one with the last index, halved."""
    indices, halved = sorted({*range(0, count, COARSE), count - 1}), COARSE
    while halved > stride:
        indices = sorted({*indices, *((left + right) // 2
                                     for left, right in itertools.pairwise(indices))})
        halved //= 2
    return indices


def coarse_rows(chart: ParameterPlane, gaits: tuple[str, ...],
                curves: Iterable[Boundary]) -> Iterator[AtlasRow]:
    """Yield the jobs of the coarse grid, and of rows between its own that cross Hopf curves.

    Branches are searched in rows: a steep curve between two rows would have none.
    """
    columns = tuple(grid_indices(chart.second.count, COARSE))
    rows = {gait: set(grid_indices(chart.first.count, COARSE)) for gait in gaits}
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
    """Return jobs for points of the coarse grid that are worse than one beside them.

    An orbit may reach where no branch from a Hopf point of its row does.

    Args:
        chart: the plane.
        gait: whose.
        sheet: what is known now.
        before: labels at the previous call; points that have not changed are not tried again.

    """
    jobs = []
    new = [at for at in sheet.waves if sheet.label[at] != before[at]]
    for row in grid_indices(chart.first.count, COARSE):
        some: list[int] = []
        near: set[tuple[int, int]] = set()
        for column in grid_indices(chart.second.count, COARSE):
            close = {at for at in new if max(abs(at[0] - row), abs(at[1] - column)) <= COARSE
                     and sheet.label[at] > sheet.label[row, column]}
            if close:
                some.append(column)
                near |= close
        if some:
            jobs.append(AtlasRow(chart, gait, row, tuple(some), tuple(
                (*at, *sheet.waves[at]) for at in sorted(near)), basin=True, again=True))
    return jobs


def refine_once(chart: ParameterPlane, gait: str, sheet: GaitMap, stride: int) -> list[AtlasRow]:
    """Halve the grid of a stride: fill in points that are clear; return jobs for the others."""
    rows, columns = grid_indices(chart.first.count, stride), grid_indices(chart.second.count,
                                                                          stride)
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
    return [AtlasRow(chart, gait, row, tuple(some), tuple(_near(sheet, row, some, stride)))
            for row, some in by_row.items()]


def uncrossed_edges(chart: ParameterPlane, gait: str, sheet: GaitMap, curves: Iterable[Boundary]
                    ) -> Iterator[ChartLine]:
    """Yield edges of the coarse grid at whose ends verdicts differ though no known curve is there.

    Args:
        chart: the plane.
        gait: whose.
        sheet: its verdicts.
        curves: the known ones.

    """
    own = [curve for curve in curves if gait in curve.gaits]
    rows, columns = grid_indices(chart.first.count, COARSE), grid_indices(chart.second.count,
                                                                          COARSE)
    pairs = [*((0, (left, column), (right, column)) for column in columns
               for left, right in itertools.pairwise(rows)),
             *((1, (row, left), (row, right)) for row in rows
               for left, right in itertools.pairwise(columns))]
    for axis, left, right in pairs:
        here, there = chart.fraction(left), chart.fraction(right)
        middle, reach = 0.5 * (here + there), float(np.abs(here - there).max())
        if sheet.label[left] != sheet.label[right] and not any(
                on_curve(curve, chart, middle, reach) for curve in own):
            low, high = ((chart.low + fraction * chart.size).tolist() for fraction in (here,
                                                                                       there))
            yield ChartLine(chart, (gait,), axis, low[1 - axis], low[axis], high[axis])


def _middles(top: int, bottom: int, left: int, right: int, corners: list[tuple[int, int]]
             ) -> Iterator[tuple[tuple[int, int], list[tuple[int, int]]]]:
    """Points between the corners of a cell, each with those that it is in the middle of."""
    row, column = (top + bottom) // 2, (left + right) // 2
    yield (top, column), corners[:2]
    yield (bottom, column), corners[2:]
    yield (row, left), corners[::2]
    yield (row, right), corners[1::2]
    yield (row, column), corners


def _near(sheet: GaitMap, row: int, columns: list[int], stride: int
          ) -> Iterator[tuple[int, int, list[list[float]], float]]:
    """Known orbits around the points of a row: of each the closest ones."""
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
