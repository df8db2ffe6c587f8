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

"""The Pareto front of a search for weights, as a table in a file and as a picture."""

import csv
import io
from pathlib import Path
from typing import Any

from cpg_ros.files.atomic_write import write_atomically
from cpg_ros.search.nsga2 import Front
from cpg_ros.search.objectives import APERIODIC, objective_names, RESOLUTION
from cpg_ros.search.verification import orbit_signals
import matplotlib
from matplotlib.axes import Axes
import numpy as np

#: Colours of the waveforms, of sets that were tried or solved, and of the front.
WAVES, TRIED, SOLVED, BEST = ('#2b6cb0', '#c05621'), '#cbd5e0', '#718096', '#2f855a'
#: The smallest multiplier that is drawn.
FLOOR = 1e-6


def write_front(path: Path, front: Front) -> None:
    """Write the front, best set first: variables, objectives and periods, units in the names."""
    names = [variable.name for variable in front.space.variables]
    two = front.scores[0].difference is not None
    errors = [name for name in objective_names(front.space.symmetry) if name.startswith('phase')]
    text = io.StringIO(newline='')
    rows = csv.writer(text)
    rows.writerow([*(f'{name} [1]' for name in names), *errors, 'leading multiplier [1]',
                   *(['difference of waveforms [1]'] if two else []),
                   'period [model time]', 'chosen'])
    for score in front.scores:
        parameters = score.network.as_dict()
        values = [parameters[variable.members[0]] for variable in front.space.variables]
        rows.writerow([*values, *(f'{error:.4g}' for error in score.errors),
                       f'{score.stability:.6g}',
                       *([f'{score.difference:.6g}'] if two else []),
                       f'{score.period:.6f}',
                       int(score.network == front.chosen.preset.network)])
    write_atomically(path, text.getvalue())


def _scatter(axes: Axes, front: Front, x: str, y: str, values: dict[str, np.ndarray]) -> None:
    """Draw two objectives of all sets; the front and the chosen set stand out."""
    on = np.array([score.network in {one.network for one in front.scores}
                   for score in front.tried])
    chosen = np.array([score.network == front.chosen.preset.network for score in front.tried])
    exact = np.array([score.exact for score in front.tried])
    axes.scatter(values[x][~exact], values[y][~exact], s=12, color=TRIED, marker='x',
                 linewidths=0.7, label='tried, multiplier estimated')
    rest = exact & ~on
    axes.scatter(values[x][rest], values[y][rest], s=12, color=SOLVED, alpha=0.7, linewidths=0,
                 label='tried, orbit solved')
    axes.scatter(values[x][on], values[y][on], s=22, color=BEST, label='Pareto front', zorder=3)
    axes.scatter(values[x][chosen], values[y][chosen], s=110, facecolors='none',
                 edgecolors='#1a202c', linewidths=1.3, label='chosen', zorder=4)
    for name, scale, limits in ((x, axes.set_xscale, axes.set_xlim),
                                (y, axes.set_yscale, axes.set_ylim)):
        if 'phase' in name:
            scale('log')
            limits(0.5 * RESOLUTION, 300.0)
        elif 'multiplier' in name:
            scale('log')
            # Whole decades, so that there are some to label.
            limits(10.0**np.floor(np.log10(0.999 * values[name].min())), 3.0)
    axes.set_xlabel(x)
    axes.set_ylabel(y)


def _signals(axes: Axes, front: Front) -> None:
    """Draw what every cell does over two cycles of the exact orbit, one row each."""
    orbit = front.chosen.orbit
    points = 512
    once = orbit_signals(orbit, points)[:, :orbit.network.cells]
    signals = np.concatenate([once, once, once[:1]])
    time = np.arange(2 * points + 1) / points * orbit.period
    spacing = 1.15 * float(np.ptp(once, axis=0).max())
    cells = orbit.network.cells
    middles = (cells - 1 - np.arange(cells)) * spacing
    for cell in range(cells):
        middle = 0.5 * float(once[:, cell].max() + once[:, cell].min())
        axes.plot(time, middles[cell] + signals[:, cell] - middle,
                  color=WAVES[int(orbit.waves[cell])], linewidth=1.4)
    axes.axvline(orbit.period, color=TRIED, linewidth=0.8, linestyle=':')
    axes.set_yticks(middles, [f'cell {cell + 1}' for cell in range(cells)])
    # Without dimension, like everything in these networks: a bar tells how large.
    unit = float(f'{0.5 * spacing:.1g}')
    axes.plot([time[-1] * 1.02] * 2, [middles[-1] - 0.5 * unit, middles[-1] + 0.5 * unit],
              color='#1a202c', linewidth=2.0, clip_on=False)
    axes.text(time[-1] * 1.03, middles[-1], f'{unit:g}', va='center', fontsize=9)
    axes.set_xlim(0.0, time[-1])
    axes.set_xlabel('time [model time], two cycles of the exact orbit')
    axes.set_ylabel('potential v [1]')


def draw_front(path: Path, front: Front) -> None:
    """Draw objectives against each other, and the chosen set's signals."""
    matplotlib.use('Agg')
    from matplotlib import pyplot
    names = objective_names(front.space.symmetry)
    values = dict(zip(names, np.array([one.objectives for one in front.tried]).T, strict=True))
    multiplier = 'leading multiplier a cycle [1]'
    stability = values.pop('leading multiplier [1]')
    exact = np.array([one.exact for one in front.tried])
    values[multiplier] = np.clip(stability, FLOOR, APERIODIC)
    phases = [name for name in names if name.startswith('phase')]
    worst = 'largest phase error [deg]'
    values[worst] = np.max([values[name] for name in phases], axis=0)
    panels = [(phases[0], phases[1]), (worst, multiplier)]
    if front.chosen.orbit.waves.max():
        difference = 'difference in shape of the waveforms [1]'
        values[difference] = np.array([one.difference for one in front.tried])
        # Elsewhere the gait's two waveforms are not there to be compared.
        values[difference][~exact] = np.nan
        panels.append((difference, multiplier))
    else:
        panels.insert(1, (phases[0], phases[2]))
    figure = pyplot.figure(figsize=(12.0, 7.6), layout='constrained')
    parts: Any = figure.subfigures(2, 1)
    upper, lower = parts
    for axes, (x, y) in zip(upper.subplots(1, len(panels)), panels, strict=True):
        _scatter(axes, front, x, y, values)
        axes.grid(linewidth=0.3)
        axes.spines[['top', 'right']].set_visible(False)
    upper.legend(*axes.get_legend_handles_labels(), fontsize=9, loc='outside lower center',
                 ncols=4, frameon=False)
    axes = lower.subplots()
    _signals(axes, front)
    axes.spines[['top', 'right', 'left']].set_visible(False)
    axes.tick_params(left=False)
    orbit = front.chosen.orbit
    figure.suptitle(f'{front.space.gait.replace("_", " ")} of the {front.space.network.name}: '
                    f'{len(front.tried)} sets tried, {len(front.scores)} on the Pareto front; '
                    f'chosen: period {orbit.period:.3f} model time, leading multiplier '
                    f'{front.chosen.leading:.2g} a cycle', fontsize=11)
    image = io.BytesIO()
    figure.savefig(image, dpi=120, format='png')
    pyplot.close(figure)
    write_atomically(path, image.getvalue())
