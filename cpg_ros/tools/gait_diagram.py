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

"""Footfall (Hildebrand) diagrams: when legs stand, or muscles are active, over two strides.

``python -m cpg_ros.tools.gait_diagram gaits.png --network biped`` draws a network's gaits from
their orbits. A leg stands while the signal that drives it falls, from peak to trough; where cells
drive muscles, a muscle is active while its cell is above the middle of its range.
"""

from argparse import Namespace
from collections.abc import Sequence
from pathlib import Path
import sys

from cpg_ros.dynamics.orbit import Orbit, solve_preset
from cpg_ros.errors import InputError
from cpg_ros.motion.phase_readout import evaluate, phase_map
from cpg_ros.networks.leg_numbers import footfall_order
from cpg_ros.networks.network import Network
from cpg_ros.networks.registry import find_network, SHIPPED
from cpg_ros.robots.robot import HARMONICS
from cpg_ros.simulation.footfall_diagram import draw_stances, stances
from cpg_ros.tools.command_line import Parser, run
import matplotlib
from matplotlib.axes import Axes
import numpy as np

STRIDES = 2.0
#: Of the fore, the hind and the middle pairs, or of one leg after the other.
COLOURS = ('#2b6cb0', '#c05621', '#2f855a')


def rows(network: type[Network]) -> list[tuple[str, int, str]]:
    """Return what is drawn, from the top: a leg or a muscle, its cell from 1, and its colour."""
    legs, girdles = next(iter(network.legs.values())), network.girdles
    if network.muscles:
        names = {cell: name.replace('_', ' ') for name, cell in network.muscles.items()}
        return [(names[cell], cell, COLOURS[k % 2]) for k, cells in enumerate(legs.values())
                for cell in cells if cell in names]
    colours = dict(zip(('fore', 'hind', 'middle'), COLOURS, strict=True))
    return [(leg.upper(), legs[leg][0], colours[girdles.get(leg, 'fore')])
            for leg in footfall_order(legs, network.sides, girdles)]


def signal(orbit: Orbit, cell: int, theta: np.ndarray, order: int = 0) -> np.ndarray:
    """Return what drives a leg: its cell over its range, smoothed as joints see it, from -1 to 1.

    Args:
        orbit: the gait.
        cell: from 1.
        theta: in cycles, any shape.
        order: 1 for the derivative.

    """
    phase, wave = orbit.phases[cell - 1], int(orbit.waves[cell - 1])
    if orbit.network.readout == 'waveform':
        return orbit.waveform(theta + phase, order) / orbit.peak
    return evaluate(phase_map(orbit, HARMONICS).terms[wave], theta + phase, order)


def active(orbit: Orbit, cell: int, strides: float = STRIDES) -> list[tuple[float, float]]:
    """Intervals (begin, length), in strides, of a row's bars.

    Args:
        orbit: the gait.
        cell: from 1.
        strides: how long.

    """
    theta = np.linspace(0.0, strides, int(1000 * strides) + 1)
    if orbit.network.muscles:
        wave = int(orbit.waves[cell - 1])
        on = orbit.waveform(theta + orbit.phases[cell - 1], 0, wave) > orbit.levels[wave, 0, 0]
    else:
        # Not merely below 0: at a peak on the grid the sign of the slope is that of rounding.
        on = signal(orbit, cell, theta, 1) < -1e-9
    return stances(theta, on)


def draw(axes: Axes, orbit: Orbit, title: str) -> None:
    """Draw one gait, with each row's cell as a line over it."""
    drawn = rows(type(orbit.network))
    theta = np.linspace(0.0, STRIDES, 801)
    names, cells, colours = zip(*drawn, strict=True)
    draw_stances(axes, names, [active(orbit, cell) for cell in cells], colours, 0.85)
    for row, cell in enumerate(cells):
        wave = int(orbit.waves[cell - 1])
        middle, half = orbit.levels[wave, 0]
        line = (orbit.waveform(theta + orbit.phases[cell - 1], 0, wave) - middle) / half
        axes.plot(theta, row - 0.33 * line, color=matplotlib.rcParams['text.color'],
                  linewidth=0.9)
    axes.set_xlim(0.0, STRIDES)
    axes.set_title(title, fontsize=10, loc='left')
    axes.spines[['top', 'right', 'left']].set_visible(False)
    axes.tick_params(left=False)


def picture(network: type[Network], path: Path) -> None:
    """Write the picture of a network's gaits, each from the preset of its name.

    Raises:
        InputError: matplotlib does not write such files.

    """
    matplotlib.use('Agg')
    from matplotlib import pyplot
    presets = {name: preset for name, preset in network.presets().items() if name == preset.gait}
    columns = 3
    lines = -(-len(presets) // columns)
    figure, grid = pyplot.subplots(lines, columns, figsize=(10.5, 0.4 + 2.4 * lines), sharex=True,
                                   sharey=True, layout='constrained')
    for axes in grid.flat[len(presets):]:
        axes.axis('off')
    for axes, (name, preset) in zip(grid.flat, presets.items(), strict=False):
        orbit = solve_preset(preset)
        draw(axes, orbit, f'{name.replace("_", " ")}   (period {orbit.period:.4f})')
    for axes in grid[-1]:
        axes.set_xlabel('time [strides]')
    bars = ('Bars: the cell is above the middle of its range.' if network.muscles else
            'Bars: the leg stands, while the signal that drives it falls.')
    figure.suptitle(f'{bars} Lines: the cell. Periods in model time.', fontsize=10)
    try:
        figure.savefig(path, dpi=130)
    except ValueError as error:
        # The ending of the file is of no format that matplotlib writes.
        raise InputError(str(error)) from error


def _parser() -> Parser:
    parser = Parser(prog='python -m cpg_ros.tools.gait_diagram', description=__doc__)
    parser.add_argument('picture', type=Path, help='file to write, .png or .pdf or .svg')
    parser.add_argument('--network', default='delayed', metavar='NAME',
                        help=f'{", ".join(SHIPPED)}, or a file (default: %(default)s)')
    return parser


def _draw(chosen: Namespace) -> int:
    picture(find_network(chosen.network), chosen.picture)
    return 0


def main(arguments: Sequence[str] | None = None) -> int:
    """Write the picture; return the exit code."""
    return run(_parser(), _draw, arguments)


if __name__ == '__main__':
    sys.exit(main())
