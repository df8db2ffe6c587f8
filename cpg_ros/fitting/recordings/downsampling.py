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

"""Downsampling of long recordings to an even grid that fits in memory, without outliers.

A point of the grid has the mean of the samples nearest to it, corrected for their slope, as they
are not centred on it. Grids are multiples of a step since the epoch, so that topics recorded
together share stamps.
"""

from array import array
from itertools import pairwise

import numpy as np

# Implausible samples: stamps far from all others, angles that no joint can have.

#: MAX_POSITION: of a joint, rad.
MAX_POSITION = 1e6
#: SPIKE_RATIO: distance from the median, over the spread of the positions, at least 1 rad, above
#: which a position is implausible; such positions are dropped up to the fraction
#: MAX_SPIKE_FRACTION.
SPIKE_RATIO, MAX_SPIKE_FRACTION = 100.0, 0.01
#: A gap of more than GAP_RATIO times the duration of all samples, and of more than MIN_GAP, ns,
#: separates recordings that do not belong together, or stamps that are wrong.
GAP_RATIO, MIN_GAP = 10.0, 60_000_000_000
#: Stamps, the columns that they are of, and positions, shape (n, columns).
Part = tuple[np.ndarray, list[int], np.ndarray]


def pluralize(count: int, what: str) -> str:
    """Return a number of things in words."""
    return f'{count} {what}{"" if count == 1 else "s"}'


def drop_outlier_stamps(parts: list[Part]) -> tuple[list[Part], list[str]]:
    """Keep the longest run of samples without a huge gap; return it, and notes on the rest."""
    stamps = np.sort(np.concatenate([stamps for stamps, _, _ in parts]))
    steps = np.diff(stamps)
    usual = np.median(steps[steps > 0]) if (steps > 0).any() else 0.0
    gaps = np.flatnonzero(steps > max(GAP_RATIO * usual * stamps.size, MIN_GAP)) + 1
    ends = np.concatenate([[0], gaps, [stamps.size]])
    longest = int(np.argmax(np.diff(ends)))
    num_lost = stamps.size - int(ends[longest + 1] - ends[longest])
    if not num_lost:
        return parts, []
    first, last = stamps[ends[longest]], stamps[ends[longest + 1] - 1]
    remaining = []
    for part_stamps, columns, positions in parts:
        inside = (part_stamps >= first) & (part_stamps <= last)
        if inside.any():
            remaining.append((part_stamps[inside], columns, positions[inside]))
    stray = stamps[0] if ends[longest] else stamps[-1]
    return remaining, [f'{pluralize(num_lost, "sample")} stamped far from the others, left out, '
                       f'such as at {stray / 1e9:.10g} s: the others are from '
                       f'{first / 1e9:.10g} s to {last / 1e9:.10g} s']


def drop_outlier_positions(parts: list[Part], width: int) -> np.ndarray:
    """Replace implausible positions by NaN; return their numbers, shape (width,)."""
    count = np.zeros(width, int)
    for _, columns, positions in parts:
        # Column by column: a long recording is large.
        for k, column in zip(columns, positions.T, strict=True):
            outliers = _outliers(column)
            count[k] += np.count_nonzero(outliers)
            column[outliers] = np.nan
    return count


def _outliers(column: np.ndarray) -> np.ndarray:
    """Return which positions of a joint are beyond all others, shape (samples,)."""
    finite = np.isfinite(column)
    outliers = finite & (np.abs(column) > MAX_POSITION)
    plausible = finite & ~outliers
    if plausible.any():
        low, middle, high = np.percentile(column[plausible], (5.0, 50.0, 95.0))
        spikes = plausible & (np.abs(column - middle) > SPIKE_RATIO * max(high - low, 1.0))
        if np.count_nonzero(spikes) <= max(1.0, MAX_SPIKE_FRACTION * np.count_nonzero(plausible)):
            outliers |= spikes
    return outliers


#: MAX_RAW_SAMPLES: messages or rows; with more, a recording is long.
MAX_RAW_SAMPLES = 1 << 17
#: GRID_STEPS: ns, the coarsest first; MAX_INTERVAL_RATIO: of the samples' usual interval to it.
GRID_STEPS, MAX_INTERVAL_RATIO = (10_000_000, 5_000_000, 2_500_000, 1_250_000), 0.5
#: MIN_PERIOD_POINTS: of the strongest motion on the grid; MIN_FREQUENCY: of motion, Hz.
MIN_PERIOD_POINTS, MIN_FREQUENCY = 40.0, 0.2
#: SPECTRUM_SIZE: samples of a part whose spectrum is computed.
SPECTRUM_SIZE = 1 << 14
#: CENTRE_TOLERANCE: distance of the samples' mean time from their grid point, steps, that is
#: ignored; beyond it the mean counts at that time.
CENTRE_TOLERANCE = 0.3
#: SPIKE_STD_RATIO: distance of a spike from both neighbours, over the standard deviation and over
#: the difference of these.
SPIKE_STD_RATIO = 3.0


class Downsampler:
    """Samples of some joints, as received, or on a grid once they are many.

    Attributes:
        step: of the grid, ns; 0 without a grid.
        count: number of received samples.
        rate: of the received samples, Hz, with a grid.

    """

    def __init__(self) -> None:
        self.step, self.count, self.rate = 0, 0, 0.0
        self._pending: list[tuple[np.ndarray, np.ndarray]] = []
        self._size, self._next = 0, MAX_RAW_SAMPLES
        # The grid so far, in arrays that grow in place: joining pieces would take twice the
        # memory.
        self._stamps, self._values = array('q'), array('d')

    def add(self, stamps: np.ndarray, values: np.ndarray) -> None:
        """Add samples.

        Args:
            stamps: ns, int64, shape (n,).
            values: shape (n, columns).

        """
        self._pending.append((stamps, values))
        self.count += len(stamps)
        self._size += len(stamps)
        if self._size < self._next:
            return
        stamps, values = self._concatenate()
        if not self.step:
            self.step, self.rate = _step_for(stamps, values)
            # Without a step now, there may be one later: joints may stand at first.
            self._next = MAX_RAW_SAMPLES if self.step else 2 * self._next
        last = 0
        if self.step:
            # All but what belongs to the last point of the grid.
            points = _points(stamps, self.step)
            last = int(np.flatnonzero(np.append(True, points != points[-1]))[-1])
            self._keep(stamps[:last], values[:last])
        self._pending = [(stamps[last:].copy(), values[last:].copy())]
        self._size = len(stamps) - last

    def _concatenate(self) -> tuple[np.ndarray, np.ndarray]:
        stamps, values = zip(*self._pending, strict=True)
        return np.concatenate(stamps), np.concatenate(values)

    def _keep(self, stamps: np.ndarray, values: np.ndarray) -> None:
        """Put samples on the grid."""
        stamps, values = average_on_grid(stamps, values, self.step)
        self._stamps.frombytes(stamps.tobytes())
        self._values.frombytes(values.tobytes())

    def flush(self) -> tuple[np.ndarray, np.ndarray]:
        """Return stamps and values, and forget them."""
        stamps, values = self._concatenate()
        self._pending = []
        if self.step:
            self._keep(stamps, values)
            stamps, columns = np.frombuffer(self._stamps, np.int64), values.shape[1]
            values = np.frombuffer(self._values).reshape(-1, columns)
            self._stamps, self._values = array('q'), array('d')
        return stamps, values

    @property
    def note(self) -> str:
        """Line on the downsampling, or ''."""
        return '' if not self.step else (
            f'{self.count} samples, of {self.rate:.4g} Hz, smoothed to {1e9 / self.step:g} Hz: '
            'the recording is long')


def _points(stamps: np.ndarray, step: int) -> np.ndarray:
    """Return the number of the grid point nearest to each stamp."""
    return (stamps + step // 2) // step


def _step_for(stamps: np.ndarray, values: np.ndarray) -> tuple[int, float]:
    """Return the grid's step that the motion allows, 0 for none, and the samples' rate (Hz)."""
    intervals = np.diff(stamps)
    if not (intervals > 0).any():
        return 0, 0.0
    usual = float(np.median(intervals[intervals > 0]))
    power: np.ndarray | float = 0.0
    for low, high in pairwise(range(0, len(values) + 1, min(SPECTRUM_SIZE, len(values)))):
        part = _without_spikes(values[low:high])
        part = np.nan_to_num(part - np.nanmean(np.where(np.isfinite(part), part, 0.0), axis=0))
        power = power + np.sum(np.abs(np.fft.rfft(part, axis=0))**2, axis=1)
    frequencies = np.fft.rfftfreq(min(SPECTRUM_SIZE, len(values)), usual * 1e-9)
    strongest = frequencies[np.argmax(np.where(frequencies >= MIN_FREQUENCY, power, 0.0))]
    steps = [step for step in GRID_STEPS if step * MIN_PERIOD_POINTS * strongest <= 1e9
             and usual <= MAX_INTERVAL_RATIO * step]
    return (steps[0] if steps else 0), 1e9 / usual


def drop_spikes(values: np.ndarray) -> int:
    """Replace samples far off both neighbours by NaN; return their number.

    Args:
        values: changed in place, shape (n,) or (n, columns).

    """
    before, centre, after = values[:-2], values[1:-1], values[2:]
    off = np.abs(centre - 0.5 * (before + after))
    with np.errstate(invalid='ignore'):
        spikes = off > SPIKE_STD_RATIO * np.maximum(np.nanstd(values, axis=0),
                                                    np.abs(after - before))
    centre[spikes] = np.nan
    return int(np.count_nonzero(spikes))


def _without_spikes(values: np.ndarray) -> np.ndarray:
    """Return values without single spikes and without values that are not angles."""
    values = np.where(np.abs(values) <= MAX_POSITION, values, np.nan)
    drop_spikes(values)
    return values


def average_on_grid(stamps: np.ndarray, values: np.ndarray, step: int
             ) -> tuple[np.ndarray, np.ndarray]:
    """Put samples on the grid.

    Where all samples lie on one side of a point, their mean keeps its own stamp.

    Args:
        stamps: ns, int64, shape (n,).
        values: shape (n, columns); not finite where missing.
        step: of the grid, ns.

    Returns:
        Stamps, shape (m,), ascending, and values, shape (m, columns), of the m points with
            samples.

    """
    if not len(stamps):
        return stamps, values
    order = np.argsort(stamps, kind='stable')
    stamps, values = stamps[order], _without_spikes(values[order])
    numbers = _points(stamps, step)
    points, first = np.unique(numbers, return_index=True)
    finite = np.isfinite(values)
    count = np.add.reduceat(finite, first, dtype=float)
    offset = ((stamps - numbers * step) / step)[:, None]
    with np.errstate(invalid='ignore'):
        # Points without samples become NaN by 0 / 0.
        mean = np.add.reduceat(np.where(finite, values, 0.0), first) / count
        off = np.add.reduceat(finite * offset, first) / count
    rise = np.diff(mean, axis=0) / (1.0 + np.diff(off, axis=0))
    beside = np.isfinite(rise) & (np.diff(points) == 1)[:, None]
    rise = np.where(beside, rise, 0.0)
    before, after = (np.pad(rise, one) for one in (((1, 0), (0, 0)), ((0, 1), (0, 0))))
    sides = np.pad(beside, ((1, 0), (0, 0))) + np.pad(beside, ((0, 1), (0, 0))).astype(int)
    slope = (before + after) / np.maximum(sides, 1)
    # Samples all over a step have a mean that is off by 1 / 24 of the second difference.
    mean -= np.where(sides == 2, (after - before) / 24.0, 0.0)
    centre = off[np.arange(len(points)), np.argmax(count, axis=1)]
    centre[np.abs(centre) <= CENTRE_TOLERANCE] = 0.0
    return (points * step + np.rint(centre * step).astype(np.int64),
            mean - slope * (off - centre[:, None]))
