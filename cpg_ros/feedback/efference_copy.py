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

Only what differs from it is fed back. The term is von Holst and Mittelstaedt's (1950).
"""

from dataclasses import dataclass

from cpg_ros.errors import InputError
from cpg_ros.feedback.interpolation import between_phases, between_speeds
from cpg_ros.integration.jit import jit
from cpg_ros.robots import body_keys
from cpg_ros.robots.body_keys import EfferenceTable
import numpy as np

#: Bins of a stride, number of signals, and most speeds of a table; see ``body_keys``.
BINS, SIGNALS, SPEEDS = body_keys.BINS, len(body_keys.SIGNALS), body_keys.SPEEDS


@dataclass(frozen=True)
class EfferenceCopy:
    """Expected motion of the base.

    Attributes:
        speeds: at which it was measured, m/s, rising, shape (speeds,), at most SPEEDS.
        table: shape (speeds, BINS, SIGNALS).

    """

    speeds: np.ndarray
    table: np.ndarray

    @classmethod
    def blank(cls) -> 'EfferenceCopy':
        """Nothing expected but the wanted speed."""
        table = np.zeros((2, BINS, SIGNALS))
        table[:, :, 0] = [[-10.0], [10.0]]
        return cls(np.array([-10.0, 10.0]), table)

    @classmethod
    def of(cls, table: EfferenceTable) -> 'EfferenceCopy':
        """Take a robot file's table."""
        return cls(np.array(table.speeds),
                   np.stack([table.rows[key] for key in body_keys.SIGNALS], axis=-1))

    def as_table(self) -> EfferenceTable:
        """Return it as a robot file has it."""
        return EfferenceTable(tuple(self.speeds.round(4).tolist()), {
            key: tuple(tuple(row) for row in self.table[:, :, k].tolist())
            for k, key in enumerate(body_keys.SIGNALS)})


@jit
def expect(speeds, table, phase, speed, share, out):
    """Add a share of what is expected to out, shape (SIGNALS,); see EfferenceCopy."""
    low, high, up = between_speeds(speeds, speed)
    # A bin's mean stands for its middle.
    one, two, on = between_phases((phase * BINS - 0.5) % BINS, BINS)
    for k in range(SIGNALS):
        below = table[low, one, k] + on * (table[low, two, k] - table[low, one, k])
        above = table[high, one, k] + on * (table[high, two, k] - table[high, one, k])
        out[k] += share * (below + up * (above - below))


def fold(phases: np.ndarray, signals: np.ndarray) -> np.ndarray:
    """Average signals over the strides, shape (BINS, SIGNALS).

    Args:
        phases: of the first leg, cycles, shape (samples,), several a bin.
        signals: shape (samples, SIGNALS).

    Raises:
        InputError: a bin has no sample.

    """
    place = (phases % 1.0 * BINS).astype(int) % BINS
    count = np.bincount(place, minlength=BINS)
    if not count.all():
        raise InputError(f'an efference copy needs samples in all {BINS} bins of the stride, '
                         f'not in {np.count_nonzero(count)}')
    return np.stack([np.bincount(place, column, BINS) for column in signals.T], axis=1
                    ) / count[:, None]
