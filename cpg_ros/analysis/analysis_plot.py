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

"""Picture of ``analyze --plot``: branches, roots, trajectories and footfalls."""

from collections.abc import Sequence
from functools import cache
from itertools import chain, count, pairwise
from typing import Literal

from cpg_ros.analysis import gait_diagram as footfall
from cpg_ros.analysis.analysis_report import Analysis, cells, curves, PhaseReport
from cpg_ros.analysis.branch_report import AssessedBranch, on_line
from cpg_ros.common.errors import InputError
from cpg_ros.common.report_page import rendered
from cpg_ros.dynamics.continuation import Branch
from cpg_ros.networks.network import Network
import matplotlib
from matplotlib.axes import Axes
from matplotlib.colors import hsv_to_rgb, to_hex
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
import numpy as np
from scipy.interpolate import Akima1DInterpolator

#: Colours of the gaits of the four-legged and two-legged networks.
COLOURS = {'pronk': '#805ad5', 'pace': '#2f855a', 'bound': '#b7791f', 'trot': '#c53030',
           'jump': '#00838f', 'walk': '#2b6cb0', 'run': '#c53030', 'two_legged_jump': '#00838f',
           'two_legged_hop': '#805ad5', 'skip': '#2f855a', 'gallop': '#b7791f',
           'hesitation_walk': '#97266d', 'asymmetric_hop': '#718096', 'one_legged_hop': '#975a16'}
#: Colours of other gaits, in their network's order, and of what is no gait.
MORE_COLOURS = ('#e53e8f', '#00a37a', '#5a67d8', '#a3a300', '#7b341e', '#38b2ff', '#ff8c42',
           '#b794f4', '#9ae600', '#f56565', '#234e52', '#d6bcfa', '#ffd166', '#1a365d')
GREY = '#4a5568'
#: Line styles by stability: by itself, with a symmetry lock, not at all.
STYLES: tuple[tuple[Literal['-', '--', ':'], str], ...] = (
    ('-', 'stable'), ('--', 'stable with a lock'), (':', 'unstable'))
#: Markers of bifurcations other than folds, filled where supercritical.
MARKERS = {'torus': 'o', 'period doubling': '^', 'branch point': 'P'}
#: Lines between two points of a branch.
LINES_PER_STEP = 8
#: Of each class, that are drawn.
MAX_ROOTS = 7


@cache
def colours(network: type[Network]) -> dict[str, str]:
    """Return distinct colours for a network's gaits."""
    hues = (to_hex(tuple(hsv_to_rgb((0.618 * n % 1.0, 0.7, 0.8)))) for n in count())
    spare = chain(MORE_COLOURS, hues)
    by_gait: dict[str, str] = {}
    for gait in sorted(network.gaits(), key=lambda gait: gait not in COLOURS):
        colour = COLOURS.get(gait, '')
        while not colour or colour in by_gait.values():
            colour = next(spare)
        by_gait[gait] = colour
    return by_gait


def _colour(analysis: Analysis, gait: str) -> str:
    return colours(type(analysis.network)).get(gait, GREY)


def _smooth(branch: Branch) -> np.ndarray:
    """Interpolate values and amplitudes along a branch, shape (2, n)."""
    path = np.stack([branch.values, branch.amplitudes])
    sizes = np.ptp(path, axis=1, keepdims=True)
    chords = np.linalg.norm(np.diff(path) / np.where(sizes > 0.0, sizes, 1.0), axis=0)
    positions = np.concatenate([[0.0], np.cumsum(np.maximum(chords, 1e-9))])
    fine = np.interp(np.arange(LINES_PER_STEP * (positions.size - 1) + 1) / LINES_PER_STEP,
                     np.arange(positions.size), positions)
    if positions.size < 3:
        return np.stack([np.interp(fine, positions, row) for row in path])
    return np.asarray(Akima1DInterpolator(positions, path.T)(fine)).T


def _draw_branch(axes: Axes, branch: Branch, kinds: list[int], colour: str) -> None:
    """Draw amplitudes, the line's style by the stability at the points: 0, 1 or 2."""
    values, amplitudes = _smooth(branch)
    starts = [0, *(k for k in range(1, len(kinds)) if kinds[k] != kinds[k - 1]), len(kinds)]
    for begin, end in pairwise(starts):
        part = slice(LINES_PER_STEP * max(begin - 1, 0), LINES_PER_STEP * (end - 1) + 1)
        axes.plot(values[part], amplitudes[part], color=colour,
                  linestyle=STYLES[kinds[begin]][0], linewidth=1.6)
    for k in branch.fold_indices:
        axes.plot(branch.values[k], branch.amplitudes[k], marker='s', color=colour, markersize=5)


def _draw_branches(axes: Axes, analysis: Analysis, assessed: Sequence[AssessedBranch]) -> None:
    shown: set[str] = set()
    labels: dict[str, str] = {}
    for member in assessed:
        gait, branch, colour = member.gait, member.branch, _colour(analysis, member.gait)
        _draw_branch(axes, branch, member.kinds, colour)
        shown.add(gait)
        soft = {loss.point for loss in member.losses if loss.form.soft}
        for point in member.crossings:
            axes.plot(point.value, point.point.amplitude, marker=MARKERS[point.kind],
                      markersize=6, color=colour,
                      markerfacecolor=colour if point in soft else axes.get_facecolor())
            labels[point.kind + (' (soft)' if point in soft else '')] = MARKERS[point.kind]
        for end, last in zip(branch.ends, (branch.points[0], branch.points[-1]), strict=True):
            if end.why == 'period':
                axes.plot(last.value, last.amplitude, marker='x', color=colour)
                labels['period grows'] = 'x'
    for start in on_line(analysis):
        axes.plot(start.value, 0.0, marker='o', color=_colour(analysis, start.gait), markersize=5,
                  clip_on=False)
        shown.add(start.gait)
    value = analysis.along.value(analysis.network)
    axes.axvline(value, color='#a0aec0', linewidth=1.0, zorder=0)
    for verdict in analysis.existing:
        axes.plot(value, verdict.amplitude, marker='D', color=_colour(analysis, verdict.gait),
                  markersize=6)
        shown.add(verdict.gait)
    handles = [Line2D([], [], color=_colour(analysis, gait), label=gait.replace('_', ' '))
               for gait in dict.fromkeys([*colours(type(analysis.network)), *sorted(shown)])
               if gait in shown]
    # The colour of the text differs on a dark page.
    plain = matplotlib.rcParams['text.color']
    handles += [Line2D([], [], color=plain, linestyle=style, label=label)
                for style, label in STYLES]
    handles += [Line2D([], [], color=plain, marker=marker, linestyle='', label=label)
                for marker, label in (('o', 'Hopf point'), ('s', 'fold'), ('D', 'this set'))]
    handles += [Line2D([], [], color=plain, marker=marker, linestyle='', label=label,
                       markerfacecolor=plain if label.endswith('(soft)') else
                       axes.get_facecolor()) for label, marker in labels.items()]
    axes.legend(handles=handles, fontsize=7, ncols=5, frameon=False, title='Branches of gaits',
                title_fontsize=10, alignment='left', loc='lower left', bbox_to_anchor=(0.0, 1.0),
                borderaxespad=0.2, borderpad=0.0)
    axes.set_ylim(bottom=0.0)
    timed = analysis.along.names == (analysis.delay,)
    axes.set_xlabel(f'{analysis.along} [model time]' if timed else str(analysis.along))
    axes.set_ylabel('amplitude of cell 1')


def _draw_roots(axes: Axes, analysis: Analysis) -> None:
    for block in analysis.blocks:
        roots = block.roots(MAX_ROOTS)
        axes.plot(roots.real, roots.imag, 'o', color=_colour(analysis, block.gait), alpha=0.8,
                  markersize=5)
    title = 'Characteristic roots of the equilibrium' if analysis.delay else (
        'Eigenvalues of the equilibrium')
    axes.axvline(0.0, color='#718096', linewidth=1.0, zorder=0)
    axes.set_xlabel('real part [1/model time]')
    axes.set_ylabel('imaginary part [rad/model time]')
    axes.set_title(title, loc='left', fontsize=10)


def _draw_trajectories(axes: Axes, analysis: Analysis) -> None:
    for row, verdict in enumerate(analysis.existing):
        orbit = verdict.known_orbit
        times = np.linspace(0.0, footfall.STRIDES * orbit.period, 601)
        cells = orbit(times)[:, :4]
        height = 2.3 * (len(analysis.existing) - 1 - row)
        size = np.ptp(cells) / 2.0
        middle = cells.max() - size
        for cell, style in enumerate(('-', '--', '-.', ':')):
            axes.plot(times / orbit.period, height + (cells[:, cell] - middle) / size, style,
                      color=_colour(analysis, verdict.gait), linewidth=1.1,
                      label=f'x{cell + 1}' if row == 0 else None)
        axes.text(0.01, height + 1.03, f'{verdict.gait.replace("_", " ")}: period '
                  f'{orbit.period:.4f}, swing {2.0 * size:.3f}', fontsize=7)
    if analysis.existing:
        axes.legend(fontsize=7, ncols=4, frameon=False, loc='lower right')
        axes.set_ylim(-1.4, 2.3 * len(analysis.existing) - 0.9)
    axes.set_yticks([])
    axes.set_xlabel('time [strides]')
    axes.set_ylabel('cells 1 to 4, over their range')
    axes.set_title('Trajectories', loc='left', fontsize=10)


def check_suffix(option: str, suffix: str) -> None:
    """Raise an InputError unless matplotlib writes files of a suffix, such as '.png'."""
    if suffix.lstrip('.') not in Figure().canvas.get_supported_filetypes():
        raise InputError(f"{option}: '{suffix}' is not a kind of picture that can be written, "
                         'such as .png, .pdf or .svg')


def written(figure: Figure, suffix: str) -> bytes:
    """Return a figure as the contents of a file of that suffix, and close it."""
    from matplotlib import pyplot
    content = rendered(figure, suffix, 130)
    pyplot.close(figure)
    return content


def picture(analysis: Analysis, assessed: Sequence[AssessedBranch], suffix: str) -> bytes:
    """Draw an analysis.

    Args:
        analysis: of a parameter set.
        assessed: its branches.
        suffix: of the file, such as '.png'.

    """
    matplotlib.use('Agg')
    from matplotlib import pyplot
    count = max(1, len(analysis.existing))
    figure = pyplot.figure(figsize=(12.0, 7.4 + 1.7 * max(0, count - 3)), layout='constrained')
    outer = figure.add_gridspec(2, 2)
    _draw_branches(figure.add_subplot(outer[0, 0]), analysis, assessed)
    _draw_roots(figure.add_subplot(outer[0, 1]), analysis)
    _draw_trajectories(figure.add_subplot(outer[1, 0]), analysis)
    inner = outer[1, 1].subgridspec(count, 1)
    for row, verdict in enumerate(analysis.existing):
        axes = figure.add_subplot(inner[row])
        footfall.draw(axes, verdict.known_orbit, f'Footfalls: {verdict.gait.replace("_", " ")}')
        if row == count - 1:
            axes.set_xlabel('time [strides]')
    figure.suptitle(f'{analysis.network.name}: {analysis.parameters}', fontsize=11)
    return written(figure, suffix)


# The picture of ``analyze --prc FILE``: the phase response curves of each gait.

#: POINTS: number of points of a drawn cycle.
POINTS = 513
LINE_COLOURS = ('#2b6cb0', '#c05621', '#2f855a', '#97266d')


def phase_picture(report: PhaseReport, suffix: str) -> bytes:
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
        for variable, panel in enumerate(row):
            _draw(panel, report, gait, variable)
    for axis in axes[-1]:
        axis.set_xlabel('phase of the cell [cycles], cell 1 peaks at 0')
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
        axes.plot(theta, values, color=LINE_COLOURS[wave % len(LINE_COLOURS)], linewidth=1.6,
                  label=label)
        middle, half = orbit.levels[wave, variable]
        wave_values = (orbit.waveform(theta, 0, wave, variable) - middle) / half
        axes.plot(theta, size * wave_values, ':', color=LINE_COLOURS[wave % len(LINE_COLOURS)],
                  linewidth=1.0, alpha=0.7, label=f'{name}, scaled')
    axes.axhline(0.0, color='#a0aec0', linewidth=0.8, zorder=0)
    axes.set_ylabel(f'advance [cycles per unit of {shown[0][1]}]', fontsize=8)
    axes.set_title(f'{gait.replace("_", " ")}: input to {shown[0][1]} of one cell', loc='left',
                   fontsize=9)
    # Above the axes, where it hides nothing.
    axes.legend(fontsize=7, frameon=False, ncols=4, loc='lower right', bbox_to_anchor=(1.0, 1.0),
                borderaxespad=0.2, borderpad=0.0)
    axes.set_xlim(0.0, 1.0)
