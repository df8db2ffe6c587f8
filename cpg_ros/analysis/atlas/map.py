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

"""An atlas as a picture, as files on disk, and as one page on which a click shows the orbit."""

import base64
from collections.abc import Iterator
from dataclasses import asdict
import hashlib
from itertools import chain
import json
from pathlib import Path
from string import Template
from typing import Any

from cpg_ros.analysis.atlas.chart import CodimensionTwo, LABELS, LossOnCurve, ParameterPlane
from cpg_ros.analysis.atlas.grid import AtlasRow, GaitMap, QUANTITIES
from cpg_ros.analysis.atlas.hopf_curves import Boundary
from cpg_ros.common.errors import InputError
from cpg_ros.common.files import replacing, stored_json, write_atomically
from cpg_ros.common.report_page import rendered, STYLE
from cpg_ros.fitting.inversion.results import library
from cpg_ros.networks.registry import find_network
import numpy as np

# An atlas as a picture: a panel for each gait, and the exact boundaries on top.

#: Label of a point -> its colour; kind of a curve -> its colour and style.
STATE_COLOURS = {
    'no orbit': '#f1f3f5', 'unstable in its class': '#f4c7a1', 'cannot tell': '#ced4da',
    'attracts with a lock': '#b9d6f2', 'attracts by itself': '#2b6cb0'}
LINE_STYLES = {
    'Hopf': ('#1a202c', '-'), 'torus': ('#c53030', '-'), 'branch point': ('#b7791f', '-'),
    'period doubling': ('#276749', '-'), 'fold': ('#6b46c1', '--'),
    'homoclinic': ('#2c7a7b', ':'), 'SNIC': ('#2c7a7b', '-.')}
#: Distance, as a fraction of the ranges, up to which points have one marker.
MARKER_DISTANCE = 2e-3


def markers(chart: ParameterPlane, curves: list[Boundary], gait: str
            ) -> list[tuple[tuple[float, float], list[str]]]:
    """Return where a gait's points of codimension two are, each once, with their labels."""
    placed: list[tuple[tuple[float, float], list[str]]] = []
    for point in (point for curve in curves for point in curve.codimension_two):
        if point.gait != gait:
            continue
        label = LABELS[point.kind]
        near = next((labels for position, labels in placed
                     if (np.abs(np.subtract(position, point.values)) / chart.size).max()
                     < MARKER_DISTANCE), None)
        if near is None:
            placed.append((point.values, [label]))
        elif label not in near:
            near.append(label)
    return placed


def draw_map(path: Path, chart: ParameterPlane, sheets: dict[str, GaitMap],
             curves: list[Boundary]) -> None:
    """Write the picture, PNG.

    Raises:
        OSError: it cannot be written.

    """
    from matplotlib.colors import ListedColormap
    from matplotlib.figure import Figure
    from matplotlib.lines import Line2D
    from matplotlib.patches import Patch
    wide = min(3, len(sheets))
    high = int(np.ceil(len(sheets) / wide))
    figure = Figure(figsize=(4.2 * wide, 3.4 * high + 0.8), layout='constrained')
    panels = np.atleast_1d(figure.subplots(high, wide, sharex=True, sharey=True)).ravel()
    half = [0.5 * (axis.high - axis.low) / (axis.count - 1)
            for axis in (chart.first, chart.second)]
    # A point is the middle of its pixel.
    extent = (chart.first.low - half[0], chart.first.high + half[0],
              chart.second.low - half[1], chart.second.high + half[1])
    for panel, (gait, sheet) in zip(panels, sheets.items(), strict=False):
        panel.imshow(sheet.label.T, origin='lower', extent=extent, aspect='auto', vmin=-0.5,
                     vmax=4.5, cmap=ListedColormap(list(STATE_COLOURS.values())),
                     interpolation='nearest')
        for curve in curves:
            if gait in curve.gaits:
                colour, style = LINE_STYLES[curve.kind]
                panel.plot(curve.points[:, 0], curve.points[:, 1], style, color=colour, lw=1.1)
        for position, labels in markers(chart, curves, gait):
            panel.plot(*position, 'o', ms=4.5, mfc='#ffffff', mec='#1a202c', mew=1.0, zorder=4)
            # At the right and the upper edge the text is on the inside.
            fraction = (np.array(position) - chart.low) / chart.size
            panel.annotate(' '.join(labels), position, (-5 if fraction[0] > 0.85 else 5,
                                                        -10 if fraction[1] > 0.9 else 4),
                           textcoords='offset points', fontsize=7, zorder=5,
                           ha='right' if fraction[0] > 0.85 else 'left',
                           bbox={'fc': '#ffffff', 'ec': 'none', 'alpha': 0.75, 'pad': 0.6})
        panel.set_title(gait)
        panel.set_xlim(chart.first.low, chart.first.high)
        panel.set_ylim(chart.second.low, chart.second.high)
    for panel in panels[len(sheets):]:
        panel.set_visible(False)
    for panel in panels[len(sheets) - wide:len(sheets)]:
        # The panel below it may be an empty one.
        panel.xaxis.set_tick_params(labelbottom=True)
        panel.set_xlabel(str(chart.first.line))
    figure.supylabel(str(chart.second.line))
    kinds = [kind for kind in LINE_STYLES if any(curve.kind == kind for curve in curves)]
    kinds_on_map = {point.kind for curve in curves for point in curve.codimension_two
                    if point.gait in sheets}
    special = [kind for kind in LABELS if kind in kinds_on_map]
    figure.legend(handles=[
        *(Patch(color=colour, label=text) for text, colour in STATE_COLOURS.items()),
        *(Line2D([], [], color=LINE_STYLES[kind][0], ls=LINE_STYLES[kind][1], label=kind)
          for kind in kinds),
        *(Line2D([], [], ls='', marker='o', ms=4.5, mfc='#ffffff', mec='#1a202c',
                 label=f'{LABELS[kind]} {kind}') for kind in special)],
        loc='outside lower center', ncols=min(4 + len(kinds), 3 * wide), frameon=False, fontsize=9)
    write_atomically(path, rendered(figure))


# An atlas on disk: parts as they are finished, then atlas.parquet and boundaries.json.

#: ATLAS_FILE: file that marks a folder with an atlas; PARTS_FOLDER: folder of its finished parts.
ATLAS_FILE, PARTS_FOLDER = 'atlas.json', 'parts'
LABEL_NAMES = ('none', 'unstable', 'cannot tell', 'with lock', 'stable')


class AtlasFolder:
    """The folder of an atlas."""

    def __init__(self, folder: Path, chart: ParameterPlane, gaits: tuple[str, ...]) -> None:
        """Start an atlas, or resume one of the same plane.

        Raises:
            InputError: the folder holds something else.
            OSError: it cannot be made.

        """
        self.folder, self.chart, self.gaits = folder, chart, gaits
        text = json.dumps({**chart.as_dict(), 'gaits': gaits}, indent=1)
        mark = folder / ATLAS_FILE
        if mark.exists():
            if mark.read_text() != text:
                raise InputError(f'{folder} holds an atlas of other parameters or gaits')
        elif folder.exists() and any(folder.iterdir()):
            raise InputError(f'{folder} is not the folder of an atlas: it contains other files')
        (folder / PARTS_FOLDER).mkdir(parents=True, exist_ok=True)
        write_atomically(mark, text)

    def _place(self, row: AtlasRow) -> Path:
        text = json.dumps([LABEL_NAMES, row.gait, row.row, row.columns, row.near, row.basin])
        return (self.folder / PARTS_FOLDER
                / f'{hashlib.sha256(text.encode()).hexdigest()[:20]}.json')

    def get(self, row: AtlasRow) -> list[dict[str, Any]] | None:
        """Return the points of a job, if it is done."""
        points: list[dict[str, Any]] | None = stored_json(self._place(row))
        return points

    def put(self, row: AtlasRow, points: list[dict[str, Any]]) -> list[dict[str, Any]]:
        """Store the points of a job, and return them as get will."""
        text = json.dumps(points)
        write_atomically(self._place(row), text)
        entries: list[dict[str, Any]] = json.loads(text)
        return entries

    def curves(self) -> list[Boundary] | None:
        """Return the boundaries, if they are done."""
        stored = stored_json(self.folder / 'boundaries.json')
        if stored is None or any('losses' not in curve for curve in stored):
            return None  # Those of an earlier version are followed anew.
        return [Boundary(curve['kind'], tuple(curve['gaits']), np.array(curve['points']),
                         tuple(map(CodimensionTwo.of, curve['codimension_two'])),
                         tuple(LossOnCurve(**loss | {'values': tuple(loss['values'])})
                               for loss in curve['losses']))
                for curve in stored]

    def put_curves(self, curves: list[Boundary]) -> None:
        """Store the boundaries."""
        write_atomically(self.folder / 'boundaries.json', json.dumps([
            {'kind': curve.kind, 'gaits': curve.gaits, 'points': curve.points.tolist(),
             'codimension_two': [point.as_dict() for point in curve.codimension_two],
             'losses': [asdict(loss) for loss in curve.losses]}
            for curve in curves]))

    def write(self, sheets: dict[str, GaitMap]) -> Path:
        """Write atlas.parquet: a row for each point and gait.

        Raises:
            OSError: it cannot be written.

        """
        arrow = library()
        path = self.folder / 'atlas.parquet'
        tables = map(arrow.table, columns(self.chart, sheets))
        first = next(tables)
        with (replacing(path) as beside,
              arrow.parquet.ParquetWriter(beside, first.schema) as writer):
            for table in chain([first], tables):
                writer.write_table(table)
        return path


def columns(chart: ParameterPlane, sheets: dict[str, GaitMap]) -> Iterator[dict[str, Any]]:
    """Yield the table of each gait: name -> column with a row for each point."""
    first, second = np.meshgrid(chart.first.values, chart.second.values, indexing='ij')
    for gait, sheet in sheets.items():
        label = sheet.label.ravel()
        yield {'gait': np.repeat(gait, label.size), str(chart.first.line): first.ravel(),
               str(chart.second.line): second.ravel(), 'exists': label > 0,
               'state': np.array(LABEL_NAMES)[label], 'computed': sheet.computed.ravel(),
               **{name: sheet.numbers[name].ravel() for name in QUANTITIES}}


#: Points of a waveform on the page; distance on the grid between two waveforms.
WAVEFORM_POINTS, WAVEFORM_SPACING = 32, 4
PAGE_QUANTITIES = ('period', 'amplitude', 'leading', 'lock', 'basin')


def _packed(values: np.ndarray) -> str:
    return base64.b64encode(values.tobytes()).decode('ascii')


def _waves(sheet: GaitMap, cells: int) -> list[Any]:
    """Row, column and cells over a cycle, of some points of the grid."""
    waves, visited = [], set()
    for (row, column), (wave, _) in sorted(sheet.waves.items()):
        tile = row // WAVEFORM_SPACING, column // WAVEFORM_SPACING
        if tile in visited:
            continue
        visited.add(tile)
        x = np.array(wave)[:, :cells]
        some = x[::max(1, len(x) // WAVEFORM_POINTS)]
        waves.append([row, column, np.round(some - x.mean(axis=0), 3).T.tolist()])
    return waves


def write_page(path: Path, chart: ParameterPlane, sheets: dict[str, GaitMap],
               curves: list[Boundary]) -> Path:
    """Write the page and return its path.

    Raises:
        OSError: it cannot be written.

    """
    kind = find_network(chart.network)
    legs = next(iter(kind.legs.values()))
    axes = (chart.first, chart.second)
    atlas = {
        'network': chart.network,
        'names': [str(axis.line) for axis in axes], 'low': [axis.low for axis in axes],
        'high': [axis.high for axis in axes], 'counts': [axis.count for axis in axes],
        'lines_of': [list(zip(axis.line.names, axis.line.signs, strict=True)) for axis in axes],
        'base': chart.base, 'shown': PAGE_QUANTITIES,
        'states': list(STATE_COLOURS), 'colours': list(STATE_COLOURS.values()),
        'lines': {name: line[0] for name, line in LINE_STYLES.items()},
        'legs': [[leg, cells[0] - 1] for leg, cells in legs.items()],
        'curves': [{'kind': boundary.kind, 'gaits': boundary.gaits,
                    'points': np.round(boundary.points[:, :2], 5).tolist()}
                   for boundary in curves],
        'gaits': {gait: {
            'label': _packed(sheet.label.astype(np.uint8)),
            **{name: _packed(sheet.numbers[name].astype(np.float32)) for name in PAGE_QUANTITIES},
            'special': [[*position, ' '.join(labels)]
                        for position, labels in markers(chart, curves, gait)],
            'waves': _waves(sheet, max(max(cells) for cells in legs.values()))}
            for gait, sheet in sheets.items()}}
    data = json.dumps(atlas).replace('<', '\\u003c')
    kinds = {curve.kind for curve in curves}
    colours = {kind: colour for kind, (colour, _) in LINE_STYLES.items() if kind in kinds}
    key = ''.join(f'<span style="background:{colour}"></span>{text}'
                  for text, colour in (STATE_COLOURS | colours).items())
    listed = ''.join(
        f'<tr><td>{LABELS[point.kind]}</td><td>{point}</td></tr>'
        for point in {str(point): point for curve in curves
                      for point in curve.codimension_two if point.gait in sheets}.values())
    special = (f'<h2>Points of codimension two</h2><table>{listed}</table>' if listed else '')
    title = f'Gaits of the {kind.name} network over {axes[0].line} and {axes[1].line}'
    template, style, script = (Path(__file__).with_suffix(suffix).read_text('utf-8')
                               for suffix in ('.html', '.css', '.js'))
    write_atomically(path, Template(template).substitute(
        title=title, style=f'{STYLE}\n{style}', key=key, special=special, data=data,
        script=script))
    return path
