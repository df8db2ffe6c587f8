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

import base64
from html import escape
import io

from cpg_ros.files.page_style import STYLE
from cpg_ros.files.plain_text import table
from cpg_ros.inversion import fit_figures, stride_report
from cpg_ros.inversion.paper_fit import PaperFit
from cpg_ros.inversion.recording_fit import RecordingFit
from matplotlib.figure import Figure

FIGURES = (('The recording', fit_figures.stretch),
           ('Recorded and fitted', fit_figures.joints),
           ('Error over the cycle', fit_figures.errors),
           ('Phases', fit_figures.phases),
           ('Convergence', fit_figures.convergence))


def _stride(found: RecordingFit) -> list[str]:
    stride, fit = found.stride, found.fit
    return [
        f'{found.recording.source}: {len(found.recording.times)} samples, '
        f'{found.recording.times[-1]:.2f} s; {found.read}.',
        f'Steady from {stride.begin:.2f} to {stride.end:.2f} s, whole strides: {stride.cycles}, '
        f'at {stride.frequency:.4f} +- {stride.frequency_error:.1g} Hz.',
        'Phases [cycles]: ' + ', '.join(f'{leg} {phase:.3f}'
                                        for leg, phase in stride.phases.items())
        + f': {stride.verdict} ({stride.distance:.3f} of a cycle off, the next one '
        f'{stride.margin:.3f} further).',
        f'Confidence in {stride.nearest} and this frequency: {found.confidence:.0%}.',
        f'Fitted: {fit.gait} of the {fit.network.name} network, readout of order {fit.order}, '
        f'{100.0 * fit.mean_rms_share:.1f} % of the range left on average'
        f'{": a poor fit" if found.poor else ""}.']


def parameters(found: RecordingFit) -> list[tuple[str, ...]]:
    """Rows of the fitted parameters, with a head."""
    rows: list[tuple[str, ...]] = [('parameter', 'value', 'standard error', '95 % interval')]
    for name, one in found.fit.parameters.items():
        rows.append((name, f'{one.value:.6g}', f'{one.stderr:.2g}',
                     f'{one.low:.6g} to {one.high:.6g}'
                     + ('' if one.bounded else ' (not bounded by the data)')))
    return rows


def joints(found: RecordingFit) -> list[tuple[str, ...]]:
    """Rows of the joints' errors, with a head."""
    fit = found.fit
    rms, share = fit.rms, fit.rms_share
    rows: list[tuple[str, ...]] = [('joint', 'cell', 'RMS error [rad]', 'share of range')]
    return rows + [(name, str(fit.cells[name]), f'{rms[name]:.4f}', f'{100 * share[name]:.2f} %')
                   for name in fit.joints]


def starts(found: RecordingFit) -> list[tuple[str, ...]]:
    """Rows of the starts as in Liu & Zhang's Tables 1 and 2, with a head."""
    names = found.fit.free
    rows: list[tuple[str, ...]] = [('start', 'iterations', 'half the sum of squares', 'end')]
    for trial in found.fit.starts:
        begin, end = (', '.join(f'{name} {value:.4f}' for name, value
                                in zip(names, values, strict=False))
                      for values in (trial.start, trial.values))
        rows.append((begin, str(trial.iterations), f'{trial.cost:.6g}', trial.why or end))
    return rows


def _minima(found: RecordingFit) -> str:
    fit = found.fit
    return 'Distinct minima of the starts: ' + '; '.join(
        ', '.join(f'{name} {value:.4g}' for name, value in
                  zip(fit.free, trial.values, strict=False)) + f' ({trial.cost:.6g})'
        for trial in fit.minima) + '.'


def _judged(found: RecordingFit) -> list[str]:
    fit = found.fit
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


def _shares(found: RecordingFit) -> str:
    return 'Mean RMS error over range by order of the readout: ' + ', '.join(
        f'{order}: {100 * share:.2f} %' for order, share in found.shares.items()) + '.'


def as_text(found: RecordingFit) -> str:
    """Return the report for a terminal."""
    notes = [*found.recording.notes, *found.stride.notes]
    lines = [*_stride(found), '', *table(parameters(found), '<>>'), '',
             *table(joints(found), '<>>>'), _shares(found), '']
    if len(found.fit.starts) > 1:
        lines += [*table(starts(found), '<>>'), _minima(found), '']
    lines += [*_judged(found), *(f'note: {note}' for note in notes),
              *(f'warning: {warning}' for warning in found.warnings)]
    return '\n'.join(lines)


def as_table(fits: list[PaperFit]) -> list[str]:
    """Return the paper's fits as its Tables 1 and 2, and error ranges as its Figures 5 to 9."""
    if not fits:
        return []

    def values(parameters: dict[str, float]) -> str:
        return ', '.join(f'{name} {value:.4f}' for name, value in parameters.items())

    rows: list[tuple[str, ...]] = [('initial value', 'iterations', 'error f [rad^2]',
                                    'numerical solution')]
    rows += [(values(one.start), str(one.fit.trial.iterations), f'{one.fit.cost:.4f}',
              values(one.end)) for one in fits]
    best = min(fits, key=lambda one: one.fit.cost)
    ranges = ', '.join(f'{name} [{low:.3f}, {high:.3f}]'
                       for name, (low, high) in best.errors.items())
    return ['', 'As Liu & Zhang (2024) fit, eight joints taken for the eight cells:',
            *table(rows, '<>><'), f'synchronisation errors [rad]: {ranges}']


def _html_table(rows: list[tuple[str, ...]]) -> str:
    head, *body = rows
    lines = ['<table><thead><tr>' + ''.join(f'<th>{escape(cell)}</th>' for cell in head)
             + '</tr></thead><tbody>']
    lines += ['<tr>' + ''.join(f'<td class="value">{escape(cell)}</td>' for cell in row) + '</tr>'
              for row in body]
    return '\n'.join([*lines, '</tbody></table>'])


def _image(figure: Figure, name: str) -> str:
    out = io.BytesIO()
    figure.savefig(out, format='png', dpi=110)
    return (f'<figure><img alt="{escape(name)}" src="data:image/png;base64,'
            f'{base64.b64encode(out.getvalue()).decode("ascii")}"></figure>')


def _warned(found: RecordingFit) -> str:
    """Return the warnings, before anything else; red where the fit is poor."""
    if not found.warnings:
        return ''
    rows = '\n'.join(f'<tr class="{"fails" if found.poor else "erratum"}"><td>{escape(text)}'
                     '</td></tr>' for text in found.warnings)
    return f'<table><thead><tr><th>Warnings</th></tr></thead><tbody>{rows}</tbody></table>'


def _strides(found: RecordingFit) -> list[str]:
    """Return the sections on single strides, that of each stride folded."""
    legs = stride_report.strides_of(found)
    parts = ['<h2>Strides</h2>', *(f'<p>{escape(line)}</p>' for line in stride_report.notes(legs)),
             _html_table(stride_report.by_leg(legs))]
    if len(pairs := stride_report.symmetry(legs)) > 1:
        parts += ['<p>Symmetry index, 0 where both sides are alike:</p>', _html_table(pairs)]
    return [*parts, '<details><summary>Every stride</summary>',
            _html_table(stride_report.every_stride(legs)), '</details>']


def as_html(found: RecordingFit) -> str:
    """Return the report as one page with its figures in it."""
    def paragraphs(lines: list[str]) -> str:
        return '\n'.join(f'<p>{escape(line)}</p>' for line in lines)

    title = f'{found.fit.gait} at {found.stride.frequency:.3f} Hz: {found.recording.source}'
    parts = ['<!DOCTYPE html>', '<html lang="en"><head><meta charset="utf-8">',
             f'<title>{escape(title)}</title><style>{STYLE}</style></head><body>',
             f'<h1>{escape(title)}</h1>', _warned(found), paragraphs(_stride(found)),
             '<h2>Parameters</h2>',
             _html_table(parameters(found)), paragraphs(_judged(found)), '<h2>Joints</h2>',
             paragraphs([_shares(found)]), _html_table(joints(found))]
    parts += _strides(found)
    for name, draw in FIGURES:
        parts += [f'<h2>{escape(name)}</h2>', _image(draw(found), name)]
    parts += ['<h2>Starts</h2>', _html_table(starts(found)), paragraphs([_minima(found)])]
    notes = [*found.recording.notes, *found.stride.notes]
    if notes:
        parts += ['<h2>Notes</h2>', paragraphs(notes)]
    return '\n'.join([*parts, '</body></html>', ''])
