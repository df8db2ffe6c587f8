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

"""An atlas on disk: parts as they are finished, then atlas.parquet and boundaries.json."""

from collections.abc import Iterator
import hashlib
from itertools import chain
import json
from pathlib import Path
from typing import Any

from cpg_ros.atlas.chart import Chart
from cpg_ros.atlas.codimension_two import CodimensionTwo
from cpg_ros.atlas.grid_refinement import NUMBERS, Sheet
from cpg_ros.atlas.hopf_curves import Boundary
from cpg_ros.atlas.row_job import AtlasRow
from cpg_ros.atlas.stability_losses import LossOnCurve
from cpg_ros.errors import InputError
from cpg_ros.files.atomic_write import replacing, stored_json, write_atomically
from cpg_ros.fleet.results_table import library
import numpy as np

#: The file that a folder with an atlas has, the folder of its parts, and names of the labels.
MARK, PARTS = 'atlas.json', 'parts'
LABELS = ('none', 'unstable', 'with lock', 'stable')


class AtlasFolder:
    """The folder of an atlas."""

    def __init__(self, folder: Path, chart: Chart, gaits: tuple[str, ...]) -> None:
        """Start an atlas, or resume one of the same plane.

        Raises:
            InputError: the folder holds something else.
            OSError: it cannot be made.

        """
        self.folder, self.chart = folder, chart
        text = json.dumps({**chart.as_dict(), 'gaits': gaits}, indent=1)
        mark = folder / MARK
        if mark.exists():
            if mark.read_text() != text:
                raise InputError(f'{folder} holds an atlas of other parameters or gaits')
        elif folder.exists() and any(folder.iterdir()):
            raise InputError(f'{folder} is not the folder of an atlas: it contains other files')
        (folder / PARTS).mkdir(parents=True, exist_ok=True)
        write_atomically(mark, text)

    def _place(self, row: AtlasRow) -> Path:
        text = json.dumps([row.gait, row.row, row.columns, row.near, row.basin])
        return self.folder / PARTS / f'{hashlib.sha256(text.encode()).hexdigest()[:20]}.json'

    def get(self, row: AtlasRow) -> list[dict[str, Any]] | None:
        """Return the points of a job, if it is done."""
        found: list[dict[str, Any]] | None = stored_json(self._place(row))
        return found

    def put(self, row: AtlasRow, points: list[dict[str, Any]]) -> list[dict[str, Any]]:
        """Store the points of a job, and return them as get will."""
        text = json.dumps(points)
        write_atomically(self._place(row), text)
        kept: list[dict[str, Any]] = json.loads(text)
        return kept

    def curves(self) -> list[Boundary] | None:
        """Return the boundaries, if they are done."""
        found = stored_json(self.folder / 'boundaries.json')
        if found is None or any('losses' not in one for one in found):
            return None  # Those of an earlier version are followed anew.
        return [Boundary(one['kind'], tuple(one['gaits']), np.array(one['points']),
                         tuple(map(CodimensionTwo.of, one['codimension_two'])),
                         tuple(map(LossOnCurve.of, one['losses'])))
                for one in found]

    def put_curves(self, curves: list[Boundary]) -> None:
        """Store the boundaries."""
        write_atomically(self.folder / 'boundaries.json', json.dumps([
            {'kind': curve.kind, 'gaits': curve.gaits, 'points': curve.points.tolist(),
             'codimension_two': [point.as_dict() for point in curve.codimension_two],
             'losses': [loss.as_dict() for loss in curve.losses]}
            for curve in curves]))

    def write(self, sheets: dict[str, Sheet]) -> Path:
        """Write atlas.parquet: a row for each point and gait.

        Raises:
            OSError: it cannot be written.

        """
        arrow = library()
        path = self.folder / 'atlas.parquet'
        tables = map(arrow.table, _columns(self.chart, sheets))
        first = next(tables)
        with (replacing(path) as beside,
              arrow.parquet.ParquetWriter(beside, first.schema) as writer):
            for one in chain([first], tables):
                writer.write_table(one)
        return path


def _columns(chart: Chart, sheets: dict[str, Sheet]) -> Iterator[dict[str, Any]]:
    one, other = np.meshgrid(chart.first.values, chart.second.values, indexing='ij')
    for gait, sheet in sheets.items():
        label = sheet.label.ravel()
        yield {'gait': [gait] * label.size, str(chart.first.line): one.ravel(),
               str(chart.second.line): other.ravel(), 'exists': label > 0,
               'state': [LABELS[k] for k in label], 'computed': sheet.computed.ravel(),
               **{name: sheet.numbers[name].ravel() for name in NUMBERS}}
