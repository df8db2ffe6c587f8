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

"""Efference copy: the body's own motion in a gait, by stride phase and speed.

The feedback acts on deviations from it. The term is von Holst and Mittelstaedt's (1950).
"""

from dataclasses import dataclass

from cpg_ros.common.errors import InputError
from cpg_ros.dynamics.integration.compilation import jit
from cpg_ros.motion import body_file
from cpg_ros.motion.body_file import EfferenceTable
import numpy as np

# Linear interpolation in tables: periodic ones over the stride, and ones over rising speeds.

def periodic(values: np.ndarray, phase: np.ndarray) -> np.ndarray:
    """Interpolate values at even phases of a cycle, from 0, at phases in cycles."""
    grid = np.arange(values.size + 1) / values.size
    return np.interp(phase % 1.0, grid, np.append(values, values[0]))


@jit
def between_phases(phase, points):
    """Return the points of a cycle around a phase, and the fraction of the second.

    Args:
        phase: in points, from 0.
        points: number of points in the cycle.

    """
    low = int(phase) % points
    return low, (low + 1) % points, phase - int(phase)


@jit
def between_speeds(speeds, speed):
    """Return the rows of a table around a speed, and the fraction of the second.

    Beyond the table, the nearest end counts.

    Args:
        speeds: of the rows, m/s, ascending, shape (rows,).
        speed: m/s.

    """
    low = 0
    while low + 2 < speeds.shape[0] and speed > speeds[low + 1]:
        low += 1
    high = min(low + 1, speeds.shape[0] - 1)
    gap = speeds[high] - speeds[low]
    return low, high, min(max((speed - speeds[low]) / gap, 0.0), 1.0) if gap > 0.0 else 0.0


#: BINS: bins of a stride; SIGNALS: number of signals; SPEEDS: most speeds of a table.
BINS, SIGNALS, SPEEDS = body_file.NUM_BINS, len(body_file.SIGNALS), body_file.MAX_SPEEDS


@dataclass(frozen=True)
class EfferenceCopy:
    """Expected motion of the base.

    Attributes:
        speeds: at which it was measured, m/s, ascending, shape (speeds,), at most SPEEDS.
        table: shape (speeds, BINS, SIGNALS).

    """

    speeds: np.ndarray
    table: np.ndarray

    @classmethod
    def blank(cls) -> 'EfferenceCopy':
        """Return a copy that expects only the wanted speed."""
        table = np.zeros((2, BINS, SIGNALS))
        table[:, :, 0] = [[-10.0], [10.0]]
        return cls(np.array([-10.0, 10.0]), table)

    @classmethod
    def of(cls, table: EfferenceTable) -> 'EfferenceCopy':
        """Return the copy for a robot file's table."""
        return cls(np.array(table.speeds),
                   np.stack([table.rows[key] for key in body_file.SIGNALS], axis=-1))

    def as_table(self) -> EfferenceTable:
        """Return the table for a robot file."""
        return EfferenceTable(tuple(self.speeds.round(4).tolist()), {
            key: tuple(tuple(row) for row in self.table[:, :, k].tolist())
            for k, key in enumerate(body_file.SIGNALS)})


@jit
def expect(speeds, table, phase, speed, fraction, out):
    """Add a fraction of the expected signals to out, shape (SIGNALS,); see EfferenceCopy."""
    low, high, up = between_speeds(speeds, speed)
    # A bin's mean stands for its middle.
    one, two, on = between_phases((phase * BINS - 0.5) % BINS, BINS)
    for k in range(SIGNALS):
        below = table[low, one, k] + on * (table[low, two, k] - table[low, one, k])
        above = table[high, one, k] + on * (table[high, two, k] - table[high, one, k])
        out[k] += fraction * (below + up * (above - below))


def fold(phases: np.ndarray, signals: np.ndarray) -> np.ndarray:
    """Average signals over the strides, shape (BINS, SIGNALS).

    Args:
        phases: of the first leg, cycles, shape (samples,), several a bin.
        signals: shape (samples, SIGNALS).

    Raises:
        InputError: a bin has no sample.

    """
    bins = (phases % 1.0 * BINS).astype(int) % BINS
    count = np.bincount(bins, minlength=BINS)
    if not count.all():
        raise InputError(f'an efference copy needs samples in all {BINS} bins of the stride, '
                         f'not in {np.count_nonzero(count)}')
    return np.stack([np.bincount(bins, column, BINS) for column in signals.T], axis=1
                    ) / count[:, None]
