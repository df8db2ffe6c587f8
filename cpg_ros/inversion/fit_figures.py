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

"""The pictures of an inverted recording."""

from typing import Any

from cpg_ros.inversion.recording_fit import POOR, RecordingFit
import matplotlib
from matplotlib.figure import Figure
import numpy as np

#: Of what is fitted, and of bands and zero lines, on light and on dark grounds; what is recorded
#: has the colour of text.
FITTED, BAND = '#e04040', '#90a0b080'
LINES = ('#2b6cb0', '#c53030', '#2f855a', '#b7791f', '#805ad5', '#00838f')
COLUMNS = 3
#: Columns of the picture of a recording, and how far phases are shown beyond the seam (cycles).
COLUMN, SEAM = 1200, 0.12
#: Points of a cycle at which errors are shown, as in Liu & Zhang's Figures 5, 6, 8 and 9.
POINTS = 20


def _text() -> str:
    return str(matplotlib.rcParams['text.color'])


def _grid(count: int, height: float) -> tuple[Figure, np.ndarray]:
    """Return a figure of panels in columns, those beyond the count left empty."""
    rows = -(-count // COLUMNS)
    figure = Figure((10.5, 0.5 + height * rows), layout='constrained')
    grid = figure.subplots(rows, COLUMNS, sharex=True, squeeze=False)
    for axes in grid.flat[count:]:
        axes.axis('off')
    for axes in grid.flat[:count]:
        axes.tick_params(labelsize=8)
        for side in ('top', 'right'):
            axes.spines[side].set_visible(False)
    for column in range(COLUMNS):
        below = [axes for axes in grid[:, column] if axes.axison]
        if below:
            below[-1].set_xlabel('phase [cycles]', fontsize=8)
            below[-1].tick_params(labelbottom=True)
    return figure, grid.flat[:count]


def joints(found: RecordingFit) -> Figure:
    """Draw the recorded mean cycle with its spread, and the fitted one, joint by joint."""
    fit, stride = found.fit, found.stride
    figure, grid = _grid(len(fit.joints), 1.9)
    share = fit.rms_share
    for axes, name, recorded, fitted in zip(grid, fit.joints, fit.recorded, fit.fitted,
                                            strict=True):
        spread = stride.spread[stride.joints.index(name)]
        axes.fill_between(fit.theta, recorded - spread, recorded + spread, color=BAND,
                          linewidth=0.0, label='spread of cycles')
        axes.plot(fit.theta, recorded, color=_text(), linewidth=1.4, label='recorded')
        axes.plot(fit.theta, fitted, color=FITTED, linewidth=1.4, linestyle='--', label='fitted')
        poor = share[name] > POOR[fit.order]
        axes.set_title(f'{name}: {100 * share[name]:.1f} % of range{", poor" if poor else ""}',
                       fontsize=8, loc='left', color=FITTED if poor else _text())
        axes.set_ylabel('angle [rad]', fontsize=8)
    grid[0].legend(fontsize=7, frameon=False)
    strides = f'{stride.cycles} strides' if stride.cycles > 1 else '1 stride'
    figure.suptitle(f'Mean cycle of {strides} at {stride.frequency:.4f} Hz, and the '
                    f'{fit.gait} of the {fit.network.name} network, readout of order '
                    f'{fit.order}{": a poor fit" if found.poor else ""}', fontsize=10,
                    color=FITTED if found.poor else _text())
    return figure


def errors(found: RecordingFit) -> Figure:
    """Fitted minus recorded at even instants of the cycle, joint by joint."""
    theta, values = found.fit.synchronisation(POINTS)
    figure, grid = _grid(len(found.fit.joints), 1.5)
    for axes, name, row in zip(grid, found.fit.joints, values, strict=True):
        axes.axhline(0.0, color=BAND, linewidth=1.0)
        axes.plot(theta, row, 'o-', color=FITTED, markersize=3, linewidth=0.9)
        axes.set_title(f'{name}: {row.min():.3f} to {row.max():.3f} rad', fontsize=8, loc='left')
        axes.set_ylabel('error [rad]', fontsize=8)
    figure.suptitle('Synchronisation error: fitted minus recorded', fontsize=10)
    return figure


def phases(found: RecordingFit) -> Figure:
    """Draw the recorded phases of the legs beside those of the gait, round the cycle."""
    figure = Figure((6.0, 0.9 + 0.45 * len(found.stride.phases)), layout='constrained')
    axes = figure.subplots()
    orbit = found.fit.orbit
    cells = next(iter(orbit.network.legs.values()))
    wanted = {leg: float(orbit.phases[own[0] - 1]) for leg, own in cells.items()}
    for row, (leg, phase) in enumerate(found.stride.phases.items()):
        height = len(found.stride.phases) - 1 - row
        marks: list[tuple[float | None, dict[str, Any]]] = [
            (phase, {'marker': 'o', 'markersize': 8, 'color': _text(), 'label': 'recorded'}),
            (wanted.get(leg), {'marker': 'D', 'markersize': 11, 'color': FITTED,
                               'markerfacecolor': 'none', 'label': found.fit.gait})]
        for value, style in marks:
            # What is near the seam stands on both sides of it.
            places = [] if value is None else [
                at for at in (value % 1.0 - 1.0, value % 1.0, value % 1.0 + 1.0)
                if -SEAM <= at <= 1.0 + SEAM]
            for at in places:
                axes.plot(at, height, linestyle='none', **style)
    for seam in (0.0, 1.0):
        axes.axvline(seam, color=BAND, linewidth=1.0)
    axes.set_yticks(range(len(found.stride.phases)), list(found.stride.phases)[::-1])
    axes.set_ylim(-0.6, len(found.stride.phases) - 0.4)
    axes.set_xlim(-SEAM, 1.0 + SEAM)
    axes.set_xticks(np.arange(5) / 4)
    axes.set_xlabel('phase [cycles], 1 is 0 again')
    axes.grid(axis='y', color=BAND)
    known = dict(zip(*axes.get_legend_handles_labels()[::-1], strict=True))
    axes.legend(known.values(), known.keys(), fontsize=8, frameon=False, loc='lower center',
                ncols=2, bbox_to_anchor=(0.5, 1.0))
    return figure


def stretch(found: RecordingFit) -> Figure:
    """Draw the whole recording of the joint that moves most, and the stretch in it."""
    recording, stride = found.recording, found.stride
    name = stride.joints[int(np.argmax(np.ptp(stride.mean, axis=1)))]
    angles = recording.positions[:, recording.joints.index(name)]
    figure = Figure((10.5, 2.4), layout='constrained')
    axes = figure.subplots()
    # Lowest and highest of each column of the picture: all there is to see of a long recording.
    edges = np.linspace(0, len(angles), min(COLUMN, len(angles)) + 1).astype(int)[:-1]
    low, high = (extreme.reduceat(np.where(np.isnan(angles), none, angles), edges)
                 for extreme, none in ((np.minimum, np.inf), (np.maximum, -np.inf)))
    there = low <= high
    axes.fill_between(recording.times[edges][there], low[there], high[there], color=_text(),
                      linewidth=0.6)
    axes.axvspan(stride.begin, stride.end, color=FITTED, alpha=0.15, linewidth=0.0)
    axes.set_title(f'{name}; shaded: the steady stretch, {stride.begin:.2f} to {stride.end:.2f} s '
                   f'of {recording.times[-1]:.2f} s', fontsize=9, loc='left')
    axes.set_xlim(0.0, recording.times[-1])
    axes.set_xlabel('time [s]', fontsize=8)
    axes.set_ylabel('angle [rad]', fontsize=8)
    axes.tick_params(labelsize=8)
    return figure


def convergence(found: RecordingFit) -> Figure:
    """Objective and parameters over the iterations of each start."""
    names = found.fit.free
    trials = [trial for trial in found.fit.starts if len(trial.path)]
    figure = Figure((3.4 * (1 + len(names)), 2.6), layout='constrained')
    grid = figure.subplots(1, 1 + len(names), squeeze=False)
    for number, trial in enumerate(trials):
        steps = np.arange(len(trial.path))
        for k, axes in enumerate(grid.flat):
            axes.plot(steps, trial.path[:, k], 'o-', markersize=3, linewidth=1.0,
                      color=LINES[number % len(LINES)])
    grid.flat[0].set_yscale('log')
    for axes, label in zip(grid.flat, ('half the sum of squares [1]', *names), strict=True):
        axes.set_xlabel('iteration')
        axes.set_ylabel(label)
    figure.suptitle('Convergence of each start', fontsize=10)
    return figure
