"""The pictures of an inverted recording."""

import matplotlib
import numpy as np
from matplotlib.figure import Figure

from cpg_ros.inversion.recording_fit import Inverted

RECORDED, FITTED, BAND = '#1a202c', '#c53030', '#cbd5e0'
LINES = ('#2b6cb0', '#c53030', '#2f855a', '#b7791f', '#805ad5', '#00838f')
COLUMNS = 3
#: Points of a cycle at which errors are shown, as in Liu & Zhang's Figures 5, 6, 8 and 9.
POINTS = 20


def _grid(count: int, height: float) -> tuple[Figure, np.ndarray]:
    """A figure of panels in columns, those beyond the count left empty."""
    matplotlib.use('Agg')
    from matplotlib import pyplot
    rows = -(-count // COLUMNS)
    figure, grid = pyplot.subplots(rows, COLUMNS, figsize=(10.5, 0.5 + height * rows),
                                   sharex=True, squeeze=False, layout='constrained')
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


def joints(found: Inverted) -> Figure:
    """Recorded mean cycle with its spread, and the fitted one, joint by joint."""
    fit, stride = found.fit, found.stride
    figure, grid = _grid(len(fit.joints), 1.9)
    share = fit.rms_share
    for axes, name, recorded, fitted in zip(grid, fit.joints, fit.recorded, fit.fitted,
                                            strict=True):
        spread = stride.spread[stride.joints.index(name)]
        axes.fill_between(fit.theta, recorded - spread, recorded + spread, color=BAND,
                          linewidth=0.0, label='spread of cycles')
        axes.plot(fit.theta, recorded, color=RECORDED, linewidth=1.4, label='recorded')
        axes.plot(fit.theta, fitted, color=FITTED, linewidth=1.4, linestyle='--', label='fitted')
        axes.set_title(f'{name}: {100 * share[name]:.1f} % of range', fontsize=8, loc='left')
        axes.set_ylabel('angle [rad]', fontsize=8)
    grid[0].legend(fontsize=7, frameon=False)
    strides = f'{stride.cycles} strides' if stride.cycles > 1 else '1 stride'
    figure.suptitle(f'Mean cycle of {strides} at {stride.frequency:.4f} Hz, and the '
                    f'{fit.gait} of the {fit.network.name} network, readout of order '
                    f'{fit.order}', fontsize=10)
    return figure


def errors(found: Inverted) -> Figure:
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


def phases(found: Inverted) -> Figure:
    """Recorded phases of the legs beside those of the gait."""
    matplotlib.use('Agg')
    from matplotlib import pyplot
    figure, axes = pyplot.subplots(figsize=(6.0, 0.9 + 0.45 * len(found.stride.phases)),
                                   layout='constrained')
    orbit = found.fit.orbit
    cells = next(iter(orbit.network.legs.values()))
    wanted = {leg: float(orbit.phases[own[0] - 1]) for leg, own in cells.items()}
    for row, (leg, phase) in enumerate(found.stride.phases.items()):
        height = len(found.stride.phases) - 1 - row
        axes.plot(phase % 1.0, height, 'o', color=RECORDED, markersize=8,
                  label='recorded' if row == 0 else None)
        if leg in wanted:
            axes.plot(wanted[leg] % 1.0, height, 'D', color=FITTED, markersize=11,
                      markerfacecolor='none', label=found.fit.gait if row == 0 else None)
    axes.set_yticks(range(len(found.stride.phases)), list(found.stride.phases)[::-1])
    axes.set_ylim(-0.6, len(found.stride.phases) - 0.4)
    axes.set_xlim(-0.05, 1.05)
    axes.set_xlabel('phase [cycles]')
    axes.grid(axis='y', color=BAND)
    axes.legend(fontsize=8, frameon=False, loc='upper center', ncols=2,
                bbox_to_anchor=(0.5, 1.2))
    return figure


def convergence(found: Inverted) -> Figure:
    """Objective and parameters over the iterations of each start."""
    matplotlib.use('Agg')
    from matplotlib import pyplot
    names = list(found.fit.parameters)
    trials = [trial for trial in found.fit.starts if len(trial.path)]
    figure, grid = pyplot.subplots(1, 1 + len(names), figsize=(3.4 * (1 + len(names)), 2.6),
                                   squeeze=False, layout='constrained')
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
