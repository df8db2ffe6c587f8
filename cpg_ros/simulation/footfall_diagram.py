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

"""Footfall diagrams after Hildebrand: which foot stands when, and how fast the robot goes."""

from collections.abc import Sequence
from io import BytesIO
from pathlib import Path

from cpg_ros.files.atomic_write import write_atomically
from cpg_ros.gaits.steady_stretch import true_runs
from matplotlib import rcParams
from matplotlib.axes import Axes
from matplotlib.figure import Figure
import numpy as np

#: A foot that bears more than this share of the weight stands.
STANDING = 0.04
#: Time over which the speed is averaged, s.
SMOOTHING = 0.5
#: Endings of the files that can be written.
FORMATS = ('.png', '.svg', '.pdf')


def stances(time: np.ndarray, standing: np.ndarray) -> list[tuple[float, float]]:
    """Return the start and length of each stretch in which a foot stands, the bars of a diagram.

    Args:
        time: of the samples, s or strides, shape (n,), evenly spaced.
        standing: whether the foot stands at them, shape (n,).

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
    for row, (own, colour) in enumerate(zip(bars, colours, strict=True)):
        axes.broken_barh(own, (row - 0.36, 0.72), color=colour, alpha=alpha)
    axes.set_yticks(range(len(names)), names)
    axes.set_ylim(len(names) - 0.45, -0.55)


def _spacing(time: np.ndarray) -> float:
    """Return the mean time between samples: those of a clock of another rate are not even."""
    return float(time[-1] - time[0]) / (len(time) - 1) if len(time) > 1 else 0.0


def speed(time: np.ndarray, position: np.ndarray) -> np.ndarray:
    """Return the ground speed, m/s, shape (n,): of the path, smoothed over SMOOTHING.

    Args:
        time: of the samples, s, shape (n,), evenly spaced.
        position: at them, m, shape (n, 2).

    """
    wide = max(1, min(len(time) - 1, round(SMOOTHING / _spacing(time)))) // 2 + 1
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
    least = STANDING * float(forces.sum(axis=1).mean())
    figure = Figure(figsize=(max(7.0, min(24.0, 0.8 * (time[-1] - time[0]))), 4.4),
                    layout='constrained')
    above, below = figure.subplots(2, 1, sharex=True, height_ratios=[3, 2])
    bars = [stances(time, column > least) for column in forces.T]
    draw_stances(above, [leg.upper() for leg in legs], bars, [rcParams['text.color']] * len(legs))
    for row, own in enumerate(bars):
        share = sum(length for _, length in own) / (time[-1] - time[0])
        above.annotate(f'{share:.0%}', (1.0, row), xycoords=('axes fraction', 'data'),
                       xytext=(4, 0), textcoords='offset points', va='center', fontsize=8)
    above.set(ylabel='foot on the floor',
              title='Footfalls (right: share of the time on the floor)')
    below.plot(time, speed(time, position), color='tab:blue', linewidth=1.2)
    below.set(xlabel='time [s]', ylabel='speed [m/s]', xlim=(time[0], time[-1]))
    below.set_ylim(bottom=0.0)
    below.grid(alpha=0.3)
    for when, name in gaits:
        for axes in (above, below):
            axes.axvline(when, color='tab:red', linewidth=1.0)
        below.annotate(name, (when, 1.0), xycoords=('data', 'axes fraction'), xytext=(3, -3),
                       textcoords='offset points', va='top', color='tab:red', fontsize=8)
    written = BytesIO()
    figure.savefig(written, format=path.suffix[1:], dpi=110)
    write_atomically(path, written.getvalue())
