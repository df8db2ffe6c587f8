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

"""An inverted recording in words, and as a page that needs no other file."""

from html import escape
import io
from typing import Any

from cpg_ros.common.command_line import table
from cpg_ros.common.report_page import html_table, image, page
from cpg_ros.fitting.gaits.leg_names import role_of
from cpg_ros.fitting.inversion import stride_report
from cpg_ros.fitting.inversion.paper_fit import PaperFit
from cpg_ros.fitting.inversion.recording_fit import POOR_THRESHOLDS, RecordingFit
import matplotlib
from matplotlib.figure import Figure
import numpy as np

# The pictures of an inverted recording.

#: Colours on light and dark grounds. BAND_COLOR: of bands and zero lines; recorded curves have the
#: colour of text.
FIT_COLOR, BAND_COLOR = '#e04040', '#90a0b080'
LEG_COLORS = ('#2b6cb0', '#c53030', '#2f855a', '#b7791f', '#805ad5', '#00838f')
NUM_COLUMNS = 3
#: MAX_PIXELS: columns of the picture of a recording; PHASE_MARGIN: by how much phases are shown
#: beyond the ends of the cycle, cycles.
MAX_PIXELS, PHASE_MARGIN = 1200, 0.12


def _text() -> str:
    return str(matplotlib.rcParams['text.color'])


def _grid(count: int, height: float) -> tuple[Figure, np.ndarray]:
    """Return a figure of panels in columns, those beyond the count left empty."""
    rows = -(-count // NUM_COLUMNS)
    figure = Figure((10.5, 0.5 + height * rows), layout='constrained')
    grid = figure.subplots(rows, NUM_COLUMNS, sharex=True, squeeze=False)
    for axes in grid.flat[count:]:
        axes.axis('off')
    for axes in grid.flat[:count]:
        axes.tick_params(labelsize=8)
        for side in ('top', 'right'):
            axes.spines[side].set_visible(False)
    for column in range(NUM_COLUMNS):
        below = [axes for axes in grid[:, column] if axes.axison]
        if below:
            below[-1].set_xlabel('phase [cycles]', fontsize=8)
            below[-1].tick_params(labelbottom=True)
    return figure, grid.flat[:count]


def joint_figure(result: RecordingFit) -> Figure:
    """Draw the recorded mean cycle with its spread, and the fitted one, joint by joint."""
    fit, stride = result.fit, result.stride
    figure, grid = _grid(len(fit.joints), 1.9)
    fraction = fit.rms_share
    for axes, name, recorded, fitted in zip(grid, fit.joints, fit.recorded, fit.fitted,
                                            strict=True):
        spread = stride.spread[stride.joints.index(name)]
        axes.fill_between(fit.theta, recorded - spread, recorded + spread, color=BAND_COLOR,
                          linewidth=0.0, label='spread of cycles')
        axes.plot(fit.theta, recorded, color=_text(), linewidth=1.4, label='recorded')
        axes.plot(fit.theta, fitted, '--', color=FIT_COLOR, linewidth=1.4, label='fitted')
        poor = fraction[name] > POOR_THRESHOLDS[fit.order]
        axes.set_title(f'{name}: {100 * fraction[name]:.1f} % of range{", poor" if poor else ""}',
                       fontsize=8, loc='left', color=FIT_COLOR if poor else _text())
        axes.set_ylabel('angle [rad]', fontsize=8)
    grid[0].legend(fontsize=7, frameon=False)
    strides = f'{stride.cycles} strides' if stride.cycles > 1 else '1 stride'
    figure.suptitle(f'Mean cycle of {strides} at {stride.frequency:.4f} Hz, and the '
                    f'{fit.gait} of the {fit.network.name} network, readout of order '
                    f'{fit.order}{": a poor fit" if result.poor else ""}', fontsize=10,
                    color=FIT_COLOR if result.poor else _text())
    return figure


def stride_curves(result: RecordingFit) -> Figure:
    """Draw the joints' angles over 0 to 100 % of the stride, legs side by side."""
    curves = stride_report.normalised(result, stride_report.strides_of(result))
    panels: dict[str, list[tuple[str, np.ndarray, np.ndarray]]] = {}
    for leg, name, mean, spread in curves:
        panels.setdefault(role_of(name) or name, []).append((leg, mean, spread))
    figure, grid = _grid(max(1, len(panels)), 2.2)
    legs = list(result.stride.phases)
    percent = np.linspace(0.0, 100.0, len(result.stride.theta) + 1)
    for axes, (role, curves_of_role) in zip(grid, panels.items(), strict=False):
        for leg, *rows in curves_of_role:
            # The end of the stride is its begin.
            mean, spread = (np.append(row, row[0]) for row in rows)
            color = LEG_COLORS[legs.index(leg) % len(LEG_COLORS)]
            if result.stride.cycles > 1:
                axes.fill_between(percent, mean - spread, mean + spread, color=color, alpha=0.2,
                                  linewidth=0.0)
            axes.plot(percent, mean, color=color, linewidth=1.4, label=leg)
        axes.set_title(role, fontsize=9, loc='left')
        axes.set_ylabel('angle [deg]', fontsize=8)
        axes.set_xlabel('stride [%]', fontsize=8)
        axes.set_xlim(0.0, 100.0)
        axes.legend(fontsize=7, frameon=False)
    band = ', bands: standard deviation of strides' if result.stride.cycles > 1 else ''
    begin = ('touchdown' if result.stride.contacts is not None
             else 'the foremost or largest angle of each leg')
    figure.suptitle(f'Angles over the stride, 0 % is {begin}{band}', fontsize=10)
    return figure


def phases(result: RecordingFit) -> Figure:
    """Draw the recorded phases of the legs beside those of the gait, round the cycle."""
    figure = Figure((6.0, 0.9 + 0.45 * len(result.stride.phases)), layout='constrained')
    axes = figure.subplots()
    orbit = result.fit.orbit
    cells = next(iter(orbit.network.legs.values()))
    network_phases = {leg: float(orbit.phases[ids[0] - 1]) for leg, ids in cells.items()}
    for row, (leg, phase) in enumerate(result.stride.phases.items()):
        height = len(result.stride.phases) - 1 - row
        marks: list[tuple[float | None, dict[str, Any]]] = [
            (phase, {'marker': 'o', 'markersize': 8, 'color': _text(), 'label': 'recorded'}),
            (network_phases.get(leg), {'marker': 'D', 'markersize': 11, 'color': FIT_COLOR,
                               'markerfacecolor': 'none', 'label': result.fit.gait})]
        for value, style in marks:
            # Draw a phase near the seam on both sides of it.
            copies = [] if value is None else [
                at for at in (value % 1.0 - 1.0, value % 1.0, value % 1.0 + 1.0)
                if -PHASE_MARGIN <= at <= 1.0 + PHASE_MARGIN]
            for at in copies:
                axes.plot(at, height, linestyle='none', **style)
    for seam in (0.0, 1.0):
        axes.axvline(seam, color=BAND_COLOR, linewidth=1.0)
    axes.set_yticks(range(len(result.stride.phases)), list(result.stride.phases)[::-1])
    axes.set_ylim(-0.6, len(result.stride.phases) - 0.4)
    axes.set_xlim(-PHASE_MARGIN, 1.0 + PHASE_MARGIN)
    axes.set_xticks(np.arange(5) / 4)
    axes.set_xlabel('phase [cycles], 1 is 0 again')
    axes.grid(axis='y', color=BAND_COLOR)
    handles = dict(zip(*axes.get_legend_handles_labels()[::-1], strict=True))
    axes.legend(handles.values(), handles.keys(), fontsize=8, frameon=False, loc='lower center',
                ncols=2, bbox_to_anchor=(0.5, 1.0))
    return figure


def stretch(result: RecordingFit) -> Figure:
    """Draw the whole recording of the joint that moves most, and the stretch in it."""
    recording, stride = result.recording, result.stride
    name = stride.joints[int(np.argmax(np.ptp(stride.mean, axis=1)))]
    angles = recording.positions[:, recording.joints.index(name)]
    figure = Figure((10.5, 2.4), layout='constrained')
    axes = figure.subplots()
    # Lowest and highest of each column of the picture: all there is to see of a long recording.
    edges = np.linspace(0, len(angles), min(MAX_PIXELS, len(angles)) + 1).astype(int)[:-1]
    low, high = (extreme.reduceat(np.where(np.isnan(angles), none, angles), edges)
                 for extreme, none in ((np.minimum, np.inf), (np.maximum, -np.inf)))
    inside = low <= high
    axes.fill_between(recording.times[edges][inside], low[inside], high[inside], color=_text(),
                      linewidth=0.6)
    axes.axvspan(stride.begin, stride.end, color=FIT_COLOR, alpha=0.15, linewidth=0.0)
    axes.set_title(f'{name}; shaded: the steady stretch, {stride.begin:.2f} to {stride.end:.2f} s '
                   f'of {recording.times[-1]:.2f} s', fontsize=9, loc='left')
    axes.set_xlim(0.0, recording.times[-1])
    axes.set_xlabel('time [s]', fontsize=8)
    axes.set_ylabel('angle [rad]', fontsize=8)
    axes.tick_params(labelsize=8)
    return figure


FIGURES = (('The recording', stretch),
           ('Recorded and fitted', joint_figure),
           ('Phases', phases))


def _stride(result: RecordingFit) -> list[str]:
    stride, fit = result.stride, result.fit
    return [
        f'{result.recording.source}: {len(result.recording.times)} samples, '
        f'{result.recording.times[-1]:.2f} s; {result.read}.',
        f'Steady from {stride.begin:.2f} to {stride.end:.2f} s, whole strides: {stride.cycles}, '
        f'at {stride.frequency:.4f} +- {stride.frequency_error:.1g} Hz.',
        'Phases [cycles]: ' + ', '.join(f'{leg} {phase:.3f}'
                                        for leg, phase in stride.phases.items())
        + f': {stride.verdict} ({stride.distance:.3f} of a cycle off, the next one '
        f'{stride.margin:.3f} further).',
        f'Confidence in {stride.nearest} and this frequency: {result.confidence:.0%}.',
        f'Fitted: {fit.gait} of the {fit.network.name} network, readout of order {fit.order}, '
        f'{100.0 * fit.mean_rms_share:.1f} % of the range left on average'
        f'{": a poor fit" if result.poor else ""}.']


def parameters(result: RecordingFit) -> list[tuple[str, ...]]:
    """Return rows of the fitted parameters, with a head."""
    rows: list[tuple[str, ...]] = [('parameter', 'value', 'standard error', '95 % interval')]
    for name, estimate in result.fit.parameters.items():
        rows.append((name, f'{estimate.value:.6g}', f'{estimate.stderr:.2g}',
                     f'{estimate.low:.6g} to {estimate.high:.6g}'
                     + ('' if estimate.bounded else ': cannot tell' if result.fit.model_error else
                        ' (not bounded by the data)')))
    return rows


def joints(result: RecordingFit) -> list[tuple[str, ...]]:
    """Return rows of the joints' errors, with a head."""
    fit = result.fit
    rms, fraction = fit.rms, fit.rms_share
    rows: list[tuple[str, ...]] = [('joint', 'cell', 'RMS error [rad]', 'fraction of range')]
    return rows + [(name, str(fit.cells[name]), f'{rms[name]:.4f}',
                    f'{100 * fraction[name]:.2f} %')
                   for name in fit.joints]


def starts(result: RecordingFit) -> list[tuple[str, ...]]:
    """Return rows of the starts as in Liu & Zhang's Tables 1 and 2, with a head."""
    names = result.fit.free
    rows: list[tuple[str, ...]] = [('start', 'iterations', 'half the sum of squares', 'end')]
    for trial in result.fit.starts:
        begin, end = (', '.join(f'{name} {value:.4f}' for name, value
                                in zip(names, values, strict=False))
                      for values in (trial.start, trial.values))
        rows.append((begin, str(trial.iterations), f'{trial.cost:.6g}', trial.reason or end))
    return rows


def _minima(result: RecordingFit) -> str:
    fit = result.fit
    return 'Distinct minima of the starts: ' + '; '.join(
        ', '.join(f'{name} {value:.4g}' for name, value in
                  zip(fit.free, trial.values, strict=False)) + f' ({trial.cost:.6g})'
        for trial in fit.minima) + '.'


def _stability(result: RecordingFit) -> list[str]:
    fit = result.fit
    lines = []
    if fit.hopf is not None:
        lines.append(f'The {fit.gait} is born at the critical delay {fit.hopf.value:.4f}; '
                     f'{fit.network.delay_parameter} is {fit.network.delay:.4f}.')
    verdict = fit.verdict
    lines.append(
        f'It attracts by itself (largest multiplier {verdict.multipliers.leading:.3g} a stride).'
        if verdict.stable else
        f'It attracts with the symmetry lock (gain above {verdict.smallest_gain:.3g} per model '
        f'time; the generator takes {verdict.default_gain:.3g}).'
        if verdict.stable_with_default_gain else
        'It does not attract, with or without the symmetry lock.')
    return lines


def _order_errors(result: RecordingFit) -> str:
    return 'Mean RMS error over range by order of the readout: ' + ', '.join(
        f'{order}: {100 * fraction:.2f} %'
        for order, fraction in result.fit.fractions.items()) + '.'


def as_text(result: RecordingFit) -> str:
    """Return the report for a terminal."""
    notes = [*result.recording.notes, *result.stride.notes]
    legs = stride_report.strides_of(result)
    lines = [*_stride(result), '', *table(stride_report.gait_summary(result, legs), '<>'), '',
             *table(stride_report.ranges(result), '<>>>>'), '',
             *table(parameters(result), '<>>'), '',
             *table(joints(result), '<>>>'), _order_errors(result), '']
    if len(result.fit.starts) > 1:
        lines += [*table(starts(result), '<>>'), _minima(result), '']
    lines += [*_stability(result), *(f'note: {note}' for note in notes),
              *(f'warning: {warning}' for warning in result.warnings)]
    return '\n'.join(lines)


def as_table(fits: list[PaperFit]) -> list[str]:
    """Return the paper's fits as its Tables 1 and 2, and error ranges as its Figures 5 to 9."""
    if not fits:
        return []

    def values(parameters: dict[str, float]) -> str:
        return ', '.join(f'{name} {value:.4f}' for name, value in parameters.items())

    rows: list[tuple[str, ...]] = [('initial value', 'iterations', 'error f [rad^2]',
                                    'numerical solution')]
    rows += [(values(fit.start), str(fit.fit.trial.iterations), f'{fit.fit.cost:.4f}',
              values(fit.end)) for fit in fits]
    best = min(fits, key=lambda fit: fit.fit.cost)
    ranges = ', '.join(f'{name} [{low:.3f}, {high:.3f}]'
                       for name, (low, high) in best.errors.items())
    return ['', 'As Liu & Zhang (2024) fit, eight joints taken for the eight cells:',
            *table(rows, '<>><'), f'synchronisation errors [rad]: {ranges}']


def _html_table(rows: list[tuple[str, ...]]) -> str:
    return html_table(rows[0], ['<tr>' + ''.join(
        f'<td class="value">{escape(cell)}</td>' for cell in row) + '</tr>' for row in rows[1:]])


def _image(figure: Figure, name: str) -> str:
    out = io.BytesIO()
    figure.savefig(out, format='png', dpi=110)
    return image(out.getvalue(), name)


def _warning(result: RecordingFit) -> str:
    """Return the warnings, before anything else; red where the fit is poor."""
    if not result.warnings:
        return ''
    return html_table(['Warnings'], [
        f'<tr class="{"fails" if result.poor else "erratum"}"><td>{escape(text)}</td></tr>'
        for text in result.warnings])


def _strides(result: RecordingFit) -> list[str]:
    """Return the sections on the gait and its strides; the table of single strides is folded."""
    legs = stride_report.strides_of(result)
    parts = ['<h2>Gait</h2>', _html_table(stride_report.gait_summary(result, legs)),
             _image(stride_curves(result), 'Angles over the stride'),
             _html_table(stride_report.ranges(result)),
             '<h2>Strides</h2>', *(f'<p>{escape(line)}</p>' for line in stride_report.notes(
                 legs, result.stride.contacts)),
             _html_table(stride_report.by_leg(legs))]
    if len(pairs := stride_report.symmetry(legs)) > 1:
        parts += ['<p>Symmetry index, 0 where both sides are alike:</p>', _html_table(pairs)]
    return [*parts, '<details><summary>Every stride</summary>',
            _html_table(stride_report.every_stride(legs)), '</details>']


def as_html(result: RecordingFit) -> str:
    """Return the report as one page with its figures in it."""
    def paragraphs(lines: list[str]) -> str:
        return '\n'.join(f'<p>{escape(line)}</p>' for line in lines)

    title = f'{result.fit.gait} at {result.stride.frequency:.3f} Hz: {result.recording.source}'
    parts = [_warning(result), paragraphs(_stride(result)), *_strides(result),
             '<h2>Parameters</h2>',
             _html_table(parameters(result)), paragraphs(_stability(result)), '<h2>Joints</h2>',
             paragraphs([_order_errors(result)]), _html_table(joints(result))]
    for name, draw in FIGURES:
        parts += [f'<h2>{escape(name)}</h2>', _image(draw(result), name)]
    parts += ['<h2>Starts</h2>', _html_table(starts(result)), paragraphs([_minima(result)])]
    notes = [*result.recording.notes, *result.stride.notes]
    if notes:
        parts += ['<h2>Notes</h2>', paragraphs(notes)]
    return page(title, parts)
