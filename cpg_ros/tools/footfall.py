"""Footfall (Hildebrand) diagrams: when each leg stands, over two strides.

``python -m cpg_ros.tools.footfall gaits.png`` draws the six primary gaits from their orbits.
"""

import sys
from collections.abc import Sequence
from pathlib import Path

import matplotlib
import numpy as np
from matplotlib.axes import Axes

from cpg_ros.dynamics.orbit import Orbit, solve_orbit
from cpg_ros.networks.delayed import PRESETS, Delayed

STRIDES = 2.0
#: Rows from the top, and a colour for each girdle.
ROWS = {'lf': '#2b6cb0', 'rf': '#2b6cb0', 'lh': '#c05621', 'rh': '#c05621'}
GAITS = ('walk', 'trot', 'pace', 'bound', 'jump', 'pronk')


def stances(orbit: Orbit, leg: str, strides: float = STRIDES) -> list[tuple[float, float]]:
    """Intervals in strides in which a leg stands: while its cell falls, from peak to trough.

    Args:
        orbit: the gait.
        leg: lh, rh, lf or rf.
        strides: how long.

    """
    theta = np.linspace(0.0, strides, int(1000 * strides) + 1)
    phase = orbit.phases[Delayed.legs['implicit'][leg][0] - 1]
    # Not merely below 0: at a peak on the grid the sign of the slope is that of rounding.
    standing = orbit.waveform(theta + phase, 1) < -1e-9
    edges = np.flatnonzero(np.diff(np.concatenate([[False], standing, [False]]).astype(int)))
    last = theta.size - 1
    return [(float(theta[a]), float(theta[min(b, last)] - theta[a]))
            for a, b in edges.reshape(-1, 2)]


def draw(axes: Axes, orbit: Orbit, title: str) -> None:
    """Draw one gait's footfalls, with each leg's cell as a line over its row."""
    theta = np.linspace(0.0, STRIDES, 401)
    for row, (leg, colour) in enumerate(ROWS.items()):
        height = len(ROWS) - 1 - row
        axes.broken_barh(stances(orbit, leg), (height - 0.36, 0.72), color=colour, alpha=0.85)
        phase = orbit.phases[Delayed.legs['implicit'][leg][0] - 1]
        wave = orbit.waveform(theta + phase) / orbit.peak
        axes.plot(theta, height + 0.33 * wave, color='#1a202c', linewidth=0.9)
    axes.set_yticks(range(len(ROWS)), [leg.upper() for leg in reversed(ROWS)])
    axes.set_xlim(0.0, STRIDES)
    axes.set_ylim(-0.55, len(ROWS) - 0.45)
    axes.set_title(title, fontsize=11, loc='left')
    for side in ('top', 'right', 'left'):
        axes.spines[side].set_visible(False)
    axes.tick_params(left=False)


def main(arguments: Sequence[str] | None = None) -> int:
    """Write the picture of the six gaits; return the exit code."""
    arguments = sys.argv[1:] if arguments is None else arguments
    if len(arguments) != 1:
        print('usage: python -m cpg_ros.tools.footfall PICTURE', file=sys.stderr)
        return 2
    matplotlib.use('Agg')
    from matplotlib import pyplot
    figure, grid = pyplot.subplots(2, 3, figsize=(10.5, 5.2), sharex=True, sharey=True,
                                   layout='constrained')
    for axes, gait in zip(grid.flat, GAITS, strict=True):
        orbit = solve_orbit(PRESETS[gait].network, gait)
        draw(axes, orbit, f'{gait}   (period {orbit.period:.4f} model time)')
    for axes in grid[-1]:
        axes.set_xlabel('time [strides]')
    figure.suptitle('Bars: the leg stands. Lines: its cell, whose fall is the stance.',
                    fontsize=10)
    figure.savefig(Path(arguments[0]), dpi=130)
    return 0


if __name__ == '__main__':
    sys.exit(main())
