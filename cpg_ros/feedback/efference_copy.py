"""Efference copy: what the body does by itself in a gait, by stride phase and speed.

Only what differs from it is fed back.
"""

from dataclasses import dataclass

import numpy as np

from cpg_ros.errors import InputError

#: Bins of a stride; the signals are the velocity forward and to the left in m/s, the rates of
#: roll and pitch in rad/s, and roll and pitch in rad.
BINS, SIGNALS = 64, 6


@dataclass(frozen=True)
class EfferenceCopy:
    """Expected motion of the base.

    Attributes:
        speeds: at which it was measured, m/s, rising, shape (speeds,).
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

    def __call__(self, phase: np.ndarray, speed: np.ndarray) -> np.ndarray:
        """Return what is expected, shape (runs, SIGNALS).

        Args:
            phase: of the first leg, cycles, shape (runs,).
            speed: wanted, m/s, shape (runs,).

        """
        rows = np.interp(speed, self.speeds, np.arange(self.speeds.size))
        low = np.minimum(rows.astype(int), max(self.speeds.size - 2, 0))
        high = np.minimum(low + 1, self.speeds.size - 1)
        up = (rows - low)[:, None]
        # A bin's mean stands for its middle.
        place = (phase * BINS - 0.5) % BINS
        one = place.astype(int) % BINS
        two, on = (one + 1) % BINS, (place - np.floor(place))[:, None]
        table = self.table
        return ((1.0 - up) * ((1.0 - on) * table[low, one] + on * table[low, two])
                + up * ((1.0 - on) * table[high, one] + on * table[high, two]))


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
