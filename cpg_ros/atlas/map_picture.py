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

"""An atlas as a picture: a panel for each gait, and the exact boundaries on top."""

import io
from pathlib import Path

from cpg_ros.atlas.chart import Chart
from cpg_ros.atlas.codimension_two import LABELS
from cpg_ros.atlas.grid_refinement import Sheet
from cpg_ros.atlas.hopf_curves import Boundary
from cpg_ros.files.atomic_write import write_atomically
import numpy as np

#: Colours of the labels, and of the kinds of curves.
STATES = {'no orbit': '#f1f3f5', 'unstable in its class': '#f4c7a1',
          'attracts with a lock': '#b9d6f2', 'attracts by itself': '#2b6cb0'}
LINES = {'Hopf': ('#1a202c', '-'), 'torus': ('#c53030', '-'), 'branch point': ('#b7791f', '-'),
         'period doubling': ('#276749', '-'), 'fold': ('#6b46c1', '--'),
         'homoclinic': ('#2c7a7b', ':'), 'SNIC': ('#2c7a7b', '-.')}
#: Points this close, in shares of the ranges, have one marker.
TOGETHER = 2e-3


def markers(chart: Chart, curves: list[Boundary], gait: str
            ) -> list[tuple[tuple[float, float], list[str]]]:
    """Return where a gait's points of codimension two are, each once, with their labels."""
    found: list[tuple[tuple[float, float], list[str]]] = []
    for point in (point for curve in curves for point in curve.codimension_two):
        if point.gait != gait:
            continue
        label = LABELS[point.kind]
        near = next((labels for place, labels in found
                     if (np.abs(np.subtract(place, point.values)) / chart.size).max() < TOGETHER),
                    None)
        if near is None:
            found.append((point.values, [label]))
        elif label not in near:
            near.append(label)
    return found


def draw_map(path: Path, chart: Chart, sheets: dict[str, Sheet], curves: list[Boundary]) -> None:
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
                     vmax=3.5, cmap=ListedColormap(list(STATES.values())), interpolation='nearest')
        for curve in curves:
            if gait in curve.gaits:
                colour, style = LINES[curve.kind]
                panel.plot(curve.points[:, 0], curve.points[:, 1], style, color=colour, lw=1.1)
        for place, labels in markers(chart, curves, gait):
            panel.plot(*place, 'o', ms=4.5, mfc='#ffffff', mec='#1a202c', mew=1.0, zorder=4)
            # At the right and the upper edge the text is on the inside.
            share = (np.array(place) - chart.low) / chart.size
            panel.annotate(' '.join(labels), place, (-5 if share[0] > 0.85 else 5,
                                                     -10 if share[1] > 0.9 else 4),
                           textcoords='offset points', fontsize=7, zorder=5,
                           ha='right' if share[0] > 0.85 else 'left',
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
    kinds = [kind for kind in LINES if any(curve.kind == kind for curve in curves)]
    met = {point.kind for curve in curves for point in curve.codimension_two
           if point.gait in sheets}
    special = [kind for kind in LABELS if kind in met]
    figure.legend(handles=[
        *(Patch(color=colour, label=text) for text, colour in STATES.items()),
        *(Line2D([], [], color=LINES[kind][0], ls=LINES[kind][1], label=kind)
          for kind in kinds),
        *(Line2D([], [], ls='', marker='o', ms=4.5, mfc='#ffffff', mec='#1a202c',
                 label=f'{LABELS[kind]} {kind}') for kind in special)],
        loc='outside lower center', ncols=min(4 + len(kinds), 3 * wide), frameon=False, fontsize=9)
    out = io.BytesIO()
    figure.savefig(out, format='png', dpi=110)
    write_atomically(path, out.getvalue())
