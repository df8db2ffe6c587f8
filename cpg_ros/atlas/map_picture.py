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
from cpg_ros.atlas.grid_refinement import Sheet
from cpg_ros.atlas.hopf_curves import Boundary
from cpg_ros.files.atomic_write import write_atomically
import numpy as np

#: Colours of the labels, and of the kinds of curves.
STATES = {'no orbit': '#f1f3f5', 'unstable in its class': '#f4c7a1',
          'attracts with a lock': '#b9d6f2', 'attracts by itself': '#2b6cb0'}
LINES = {'Hopf': ('#1a202c', '-'), 'torus': ('#c53030', '-'), 'branch point': ('#b7791f', '-'),
         'period doubling': ('#276749', '-'), 'fold': ('#6b46c1', '--')}


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
    figure.legend(handles=[
        *(Patch(color=colour, label=text) for text, colour in STATES.items()),
        *(Line2D([], [], color=LINES[kind][0], ls=LINES[kind][1], label=kind)
          for kind in kinds)], loc='outside lower center', ncols=4 + len(kinds), frameon=False,
        fontsize=9)
    out = io.BytesIO()
    figure.savefig(out, format='png', dpi=110)
    write_atomically(path, out.getvalue())
