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

"""Figures of the papers: what the cells do over time."""

from collections.abc import Sequence

from matplotlib.figure import Figure
import numpy as np

#: Colours of the waveforms, as in the other pictures.
WAVES = ('#2b6cb0', '#c05621', '#2f855a', '#6b46c1')


def trajectories(title: str, t: np.ndarray, x: np.ndarray, names: Sequence[str],
                 waves: Sequence[int] | None = None, variable: str = 'x') -> Figure:
    """Draw cells over time, one under the other.

    Args:
        title: paper and number of the figure.
        t: model time, shape (m,).
        x: one cell per column, shape (m, cells).
        names: of the cells.
        waves: number of each cell's waveform, from 0, which gives the colour; one each by
            default.
        variable: what is drawn, for the axis.

    """
    waves = range(len(names)) if waves is None else waves
    figure = Figure(figsize=(6.4, 0.9 + 0.75 * len(names)), layout='constrained')
    low, high = float(x.min()), float(x.max())
    margin = 0.08 * (high - low)
    grid = figure.subplots(len(names), 1, sharex=True, squeeze=False)[:, 0]
    for cell, axes in enumerate(grid):
        axes.plot(t, x[:, cell], color=WAVES[waves[cell]], linewidth=1.1)
        axes.set_ylim(low - margin, high + margin)
        axes.set_ylabel(names[cell], rotation=0, ha='right', va='center', fontsize=9)
        axes.tick_params(labelsize=8)
        axes.grid(linewidth=0.3)
        axes.spines[['top', 'right']].set_visible(False)
    grid[-1].set_xlim(float(t[0]), float(t[-1]))
    grid[-1].set_xlabel('time [model time]', fontsize=9)
    figure.supylabel(f'{variable} [1]', fontsize=9)
    figure.suptitle(title, fontsize=10)
    return figure
