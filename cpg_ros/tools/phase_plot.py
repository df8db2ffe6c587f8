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

"""The picture of ``analyze --prc FILE``: the phase response curves of each gait."""

from cpg_ros.errors import InputError
from cpg_ros.tools.analysis_plot import written
from cpg_ros.tools.phase_report import cells, curves, PhaseReport
import matplotlib
from matplotlib.axes import Axes
import numpy as np

#: Points of a cycle.
POINTS = 513
COLOURS = ('#2b6cb0', '#c05621', '#2f855a', '#97266d')


def picture(report: PhaseReport, suffix: str) -> bytes:
    """Draw phase response curves, a row for each gait and a column for each variable.

    Args:
        report: of an analysis.
        suffix: of the file, such as '.png'.

    Raises:
        InputError: there is no curve.

    """
    matplotlib.use('Agg')
    if not report.responses:
        raise InputError('--prc: there is no phase response to draw')
    from matplotlib import pyplot
    network = next(iter(report.responses.values())).orbit.network
    columns = len(network.states)
    figure, axes = pyplot.subplots(
        len(report.responses), columns, squeeze=False, sharex=True, layout='constrained',
        figsize=(max(7.0, 4.6 * columns), 0.8 + 2.2 * len(report.responses)))
    for row, gait in zip(axes, report.responses, strict=True):
        for variable, one in enumerate(row):
            _draw(one, report, gait, variable)
    for one in axes[-1]:
        one.set_xlabel('phase of the cell [cycles], cell 1 peaks at 0')
    figure.suptitle(f'Phase response of {network.name}', fontsize=11)
    return written(figure, suffix)


def _draw(axes: Axes, report: PhaseReport, gait: str, variable: int) -> None:
    response, theta = report.responses[gait], np.linspace(0.0, 1.0, POINTS)
    orbit, size = response.orbit, 0.0
    shown = [(wave, name) for wave, which, name in curves(response) if which == variable]
    for wave, name in shown:
        values = response.waveform(theta, wave, variable)
        size = max(size, float(np.abs(values).max()))
        label = f'cells {cells(response, wave)}' if len(shown) > 1 else 'response'
        axes.plot(theta, values, color=COLOURS[wave % len(COLOURS)], linewidth=1.6, label=label)
        middle, half = orbit.levels[wave, variable]
        wave_values = (orbit.waveform(theta, 0, wave, variable) - middle) / half
        axes.plot(theta, size * wave_values, ':', color=COLOURS[wave % len(COLOURS)],
                  linewidth=1.0, alpha=0.7, label=f'{name}, scaled')
    axes.axhline(0.0, color='#a0aec0', linewidth=0.8, zorder=0)
    axes.set_ylabel(f'advance [cycles per unit of {shown[0][1]}]', fontsize=8)
    axes.set_title(f'{gait.replace("_", " ")}: input to {shown[0][1]} of one cell', loc='left',
                   fontsize=9)
    # Above the axes, where it hides nothing.
    axes.legend(fontsize=7, frameon=False, ncols=4, loc='lower right', bbox_to_anchor=(1.0, 1.0),
                borderaxespad=0.2, borderpad=0.0)
    axes.set_xlim(0.0, 1.0)
