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

"""Footfall (Hildebrand) diagrams of recorded runs and of gaits, and their executable.

A leg is in stance while the signal that drives it falls, from peak to trough; where cells drive
muscles, a muscle is active while its cell is above the middle of its range.
"""

from collections.abc import Sequence
from pathlib import Path

from cpg_ros.common.files import write_atomically
from cpg_ros.common.report_page import rendered
from cpg_ros.dynamics.orbit import Orbit
from cpg_ros.fitting.gaits.steady_stretch import true_runs
from cpg_ros.motion.phase_readout import evaluate, phase_map
from cpg_ros.motion.robot import NUM_HARMONICS
from cpg_ros.networks.leg_numbers import footfall_order
from cpg_ros.networks.network import Network
import matplotlib
from matplotlib import rcParams
from matplotlib.axes import Axes
from matplotlib.figure import Figure
import numpy as np

#: Fraction of the weight above which a foot stands.
STANCE_THRESHOLD = 0.04
#: Over which the speed is averaged, s.
SMOOTHING_TIME = 0.5
#: FORMATS: endings of the files that can be written.
FORMATS = ('.png', '.svg', '.pdf')


def stances(time: np.ndarray, standing: np.ndarray) -> list[tuple[float, float]]:
    """Return start and length of each stance of a foot, the bars of a diagram.

    Args:
        time: of the samples, s or strides, shape (n,), evenly spaced.
        standing: whether the foot is in stance, shape (n,).

    """
    step = _spacing(time)
    return [(float(time[first]), float((last + 1 - first) * step))
            for first, last in true_runs(standing)]


def draw_stances(axes: Axes, names: Sequence[str], bars: Sequence[list[tuple[float, float]]],
                 colours: Sequence[str], alpha: float = 1.0) -> None:
    """Draw the stances of legs as rows of bars, the first row on top.

    Args:
        axes: drawn into.
        names: of the rows.
        bars: of each row, as ``stances`` returns them.
        colours: of each row.
        alpha: opacity of the bars, 0 to 1.

    """
    for row, (stretches, colour) in enumerate(zip(bars, colours, strict=True)):
        axes.broken_barh(stretches, (row - 0.36, 0.72), color=colour, alpha=alpha)
    axes.set_yticks(range(len(names)), names)
    axes.set_ylim(len(names) - 0.45, -0.55)


def _spacing(time: np.ndarray) -> float:
    """Return the mean time between samples, which need not be even."""
    return float(time[-1] - time[0]) / (len(time) - 1) if len(time) > 1 else 0.0


def speed(time: np.ndarray, position: np.ndarray) -> np.ndarray:
    """Return the ground speed, m/s, shape (n,), of the path smoothed over SMOOTHING_TIME.

    Args:
        time: of the samples, s, shape (n,), evenly spaced.
        position: m, shape (n, 2).

    """
    wide = max(1, min(len(time) - 1, round(SMOOTHING_TIME / _spacing(time)))) // 2 + 1
    low, high = np.arange(len(time)) - wide, np.arange(len(time)) + wide
    low, high = np.maximum(low, 0), np.minimum(high, len(time) - 1)
    return np.linalg.norm(position[high] - position[low], axis=1) / (time[high] - time[low])


def plot_footfalls(path: Path, legs: Sequence[str], time: np.ndarray, forces: np.ndarray,
                   position: np.ndarray, gaits: Sequence[tuple[float, str]] = ()) -> None:
    """Draw which foot stands when, with the speed below.

    Args:
        path: picture to write, .png, .svg or .pdf.
        legs: names of the legs, from the top.
        time: of the samples, s, shape (n,), evenly spaced.
        forces: of the floor on each leg, N, shape (n, legs).
        position: of the base, m, shape (n, 2).
        gaits: (time in s, name) of each change of gait.

    Raises:
        OSError: it cannot be written.

    """
    least = STANCE_THRESHOLD * float(forces.sum(axis=1).mean())
    figure = Figure(figsize=(max(7.0, min(24.0, 0.8 * (time[-1] - time[0]))), 4.4),
                    layout='constrained')
    above, below = figure.subplots(2, 1, sharex=True, height_ratios=[3, 2])
    bars = [stances(time, column > least) for column in forces.T]
    draw_stances(above, [leg.upper() for leg in legs], bars, [rcParams['text.color']] * len(legs))
    for row, stretches in enumerate(bars):
        fraction = sum(length for _, length in stretches) / (time[-1] - time[0])
        above.annotate(f'{fraction:.0%}', (1.0, row), xycoords=('axes fraction', 'data'),
                       xytext=(4, 0), textcoords='offset points', va='center', fontsize=8)
    above.set(ylabel='foot on the floor',
              title='Footfalls (right: fraction of the time on the floor)')
    below.plot(time, speed(time, position), color='tab:blue', linewidth=1.2)
    below.set(xlabel='time [s]', ylabel='speed [m/s]', xlim=(time[0], time[-1]))
    below.set_ylim(bottom=0.0)
    below.grid(alpha=0.3)
    for when, name in gaits:
        for axes in (above, below):
            axes.axvline(when, color='tab:red', linewidth=1.0)
        below.annotate(name, (when, 1.0), xycoords=('data', 'axes fraction'), xytext=(3, -3),
                       textcoords='offset points', va='top', color='tab:red', fontsize=8)
    write_atomically(path, rendered(figure, path.suffix))


STRIDES = 2.0
#: COLOURS: colours of the fore, hind and middle pairs, or of the legs one after the other.
COLOURS = ('#2b6cb0', '#c05621', '#2f855a')


def rows(network: type[Network]) -> list[tuple[str, int, str]]:
    """Return the rows from the top: a leg or a muscle, its cell from 1, and its colour."""
    legs, girdles = next(iter(network.legs.values())), network.girdles
    if network.muscles:
        names = {cell: name.replace('_', ' ') for name, cell in network.muscles.items()}
        return [(names[cell], cell, COLOURS[k % 2]) for k, cells in enumerate(legs.values())
                for cell in cells if cell in names]
    colours = dict(zip(('fore', 'hind', 'middle'), COLOURS, strict=True))
    return [(leg.upper(), legs[leg][0], colours[girdles.get(leg, 'fore')])
            for leg in footfall_order(legs, network.sides, girdles)]


def signal(orbit: Orbit, cell: int, theta: np.ndarray, order: int = 0) -> np.ndarray:
    """Return the signal that drives a leg: its cell, smoothed for the joints, from -1 to 1.

    Args:
        orbit: the gait.
        cell: from 1.
        theta: in cycles, any shape.
        order: 1 for the derivative.

    """
    phase, wave = orbit.phases[cell - 1], int(orbit.waves[cell - 1])
    if orbit.network.readout == 'waveform':
        return orbit.waveform(theta + phase, order) / orbit.peak
    return evaluate(phase_map(orbit, NUM_HARMONICS).terms[wave], theta + phase, order)


def active(orbit: Orbit, cell: int, strides: float = STRIDES) -> list[tuple[float, float]]:
    """Return the intervals (begin, length), in strides, of a row's bars.

    Args:
        orbit: the gait.
        cell: from 1.
        strides: number of strides.

    """
    theta = np.linspace(0.0, strides, int(1000 * strides) + 1)
    if orbit.network.muscles:
        wave = int(orbit.waves[cell - 1])
        on = orbit.waveform(theta + orbit.phases[cell - 1], 0, wave) > orbit.levels[wave, 0, 0]
    else:
        # Below -1e-9: the sign of the slope at a peak on the grid is a rounding error.
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
        axes.plot(theta, row - 0.33 * line, color=matplotlib.rcParams['text.color'], linewidth=0.9)
    axes.set_xlim(0.0, STRIDES)
    axes.set_title(title, fontsize=10, loc='left')
    axes.spines[['top', 'right', 'left']].set_visible(False)
    axes.tick_params(left=False)
