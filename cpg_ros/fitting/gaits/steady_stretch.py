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

"""Search for stretches of steady motion in a recording, and for their periods.

Signals repeat with a lag L around a point if they differ from themselves L later by much less than
unrelated signals would: the square difference over the local variance (McLeod & Wyvill 2005, "A
smarter way to find pitch", in windows of one lag). Lags of 12 to 23 points are tried on grids that
are each half as fine as the previous one, so that all octaves together cost little more than the
first.
"""

from dataclasses import dataclass

import numpy as np

#: MAX_FREQUENCY: of strides that are searched for, Hz.
MAX_FREQUENCY = 12.5
#: MIN_LAG: points of a lag on its grid, which has up to twice as many.
MIN_LAG = 12
#: OVERSAMPLING: points of the even grid per sample if samples are few.
OVERSAMPLING = 4.0
MAX_GRID_SIZE = 1 << 18
#: DIFFERENCE_THRESHOLD: mean square difference over twice the variance, below which signals
#: repeat: 0 if exactly, 1 if they are unrelated.
DIFFERENCE_THRESHOLD = 0.25
#: MIN_CYCLES: of a repetition.
MIN_CYCLES = 1.4
#: A multiple of the lag is the period if its difference is less than MAX_DIFFERENCE_RATIO times
#: that of the lag reduced by DIFFERENCE_OFFSET, and if it repeats for at least MIN_LENGTH_RATIO of
#: the lag's stretch.
MAX_DIFFERENCE_RATIO, DIFFERENCE_OFFSET, MIN_LENGTH_RATIO = 0.5, 0.02, 0.7
#: LAG_TOLERANCE: relative difference of lags that belong to one gait.
LAG_TOLERANCE = 0.1
#: LAGS: lags that are tried on a grid, and windows of the local variance, points.
LAGS = range(MIN_LAG - 1, 27)
WINDOW_WIDTHS = (11, 14, 18, 22)


@dataclass(frozen=True)
class Stretch:
    """A stretch in which signals repeat.

    Attributes:
        begin, end: s.
        period: lag, s, to about 2 %.
        difference: mean square difference after one lag over twice the variance.
        typical: the same, the median along the stretch: a single slip of the phase leaves it.
        size: RMS of the signals about their means, rad.

    """

    begin: float
    end: float
    period: float
    difference: float
    typical: float
    size: float

    @property
    def cycles(self) -> float:
        """Number of periods of the stretch."""
        return (self.end - self.begin) / self.period

    def outside(self, begin: float, end: float) -> bool:
        """Return whether most of the stretch is outside two times."""
        return min(self.end, end) - max(self.begin, begin) < 0.5 * (self.end - self.begin)


def resample_evenly(times: np.ndarray, positions: np.ndarray, rate: float
                    ) -> tuple[np.ndarray, np.ndarray]:
    """Interpolate signals linearly on an even grid, each over its own finite samples.

    Args:
        times: ascending, s, shape (n,).
        positions: shape (n, joints), nan where missing; no column all nan.
        rate: of the grid, Hz; lower if it had too many points.

    Returns:
        Times (m,) and signals (m, joints).

    """
    span = times[-1] - times[0]
    count = int(min(span * rate, MAX_GRID_SIZE)) + 1
    grid = times[0] + np.arange(count) / min(rate, MAX_GRID_SIZE / span)
    signals = np.empty((positions.shape[1], grid.size)).T
    for signal, column in zip(signals.T, positions.T, strict=True):
        have = np.isfinite(column)
        signal[:] = np.interp(grid, times[have], column[have])
    return grid, signals


def _prefix_sums(values: np.ndarray) -> np.ndarray:
    """Return the sums of the first 0, 1, ... values."""
    return np.concatenate([[0.0], np.cumsum(values)])


def _differences(y: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Measure how much signals differ after a lag, for the lags of one grid.

    Returns:
        Lags in points, shape (lags,); the difference about every point, (lags, n), inf where
        the recording does not reach; and the variance about every point.

    """
    n = len(y)
    # Joint by joint: all at once take several times the memory.
    columns = (y - y.mean(axis=0)).T
    squares = _prefix_sums(sum(column * column for column in columns))
    # Rounding errors of a constant signal are not motion.
    min_variance = 1e-12 * squares[-1] / n + 1e-300
    lags = np.array([lag for lag in LAGS if lag + min(lag, n - lag) >= MIN_CYCLES * lag], int)
    variances: dict[int, np.ndarray] = {}
    differences = np.full((lags.size, n), np.inf)
    for row, lag in zip(differences, lags, strict=True):
        window = min(lag, n - lag)
        width = min(max(k for k in WINDOW_WIDTHS if k <= lag), window)
        if width not in variances:
            means = ((sums[width:] - sums[:-width]) / width for sums in map(_prefix_sums, columns))
            variances[width] = np.maximum((squares[width:] - squares[:-width]) / width
                                          - sum(mean * mean for mean in means), min_variance)
        total = _prefix_sums(sum((column[lag:] - column[:-lag])**2 for column in columns))
        count = total.size - window
        inside = np.arange(count) + (window - width) // 2
        # The smaller of both: standing before a step is not like the step.
        smaller = np.minimum(variances[width][inside], variances[width][inside + lag])
        middle = (lag + window) // 2
        row[middle:middle + count] = (total[window:] - total[:-window]) / window / (2.0 * smaller)
    variance = np.zeros(n)
    if lags.size:
        width = max(variances)
        offset = width // 2
        variance[offset:offset + variances[width].size] = variances[width]
    return lags, differences, variance


def true_runs(mask: np.ndarray) -> np.ndarray:
    """Return first and last index of every run of true values, shape (runs, 2)."""
    edges = np.diff(np.concatenate([[0], mask.astype(np.int8), [0]]))
    return np.stack([np.flatnonzero(edges > 0), np.flatnonzero(edges < 0) - 1], axis=1)


def longest_run(mask: np.ndarray) -> tuple[int, int] | None:
    """Return first and last index of the longest run of true values, None without any."""
    runs = true_runs(mask)
    if not runs.size:
        return None
    first, last = runs[np.argmax(runs[:, 1] - runs[:, 0])]
    return int(first), int(last)


def _best_lag(lags: np.ndarray, differences: np.ndarray, nearby: np.ndarray
              ) -> tuple[float, float, float] | None:
    """Return the lag among the near ones with the smallest mean difference, that and its median.

    A parabola interpolates between lags; None if a lag that is not near has a smaller one.
    """
    finite = np.isfinite(differences)
    means = np.where(finite, differences, 0.0).sum(axis=1) / np.maximum(finite.sum(axis=1), 1)
    means[~finite.any(axis=1)] = np.inf
    k = nearby[np.argmin(means[nearby])]
    median = float(np.median(differences[k, finite[k]])) if finite[k].any() else np.inf
    if not 0 < k < lags.size - 1 or not np.isfinite(means[k + 1]):
        return float(lags[k]), float(means[k]), median
    full = finite[k - 1:k + 2].all(axis=0)
    before, centre, after = differences[k - 1:k + 2, full].mean(axis=1) if full.any() else means[
        k - 1:k + 2]
    if min(before, after) < centre:
        return None
    bend = max(before - 2.0 * centre + after, 1e-300)
    minimum = max(centre - 0.125 * (before - after)**2 / bend, 0.0)
    return lags[k] + 0.5 * (before - after) / bend, minimum, median * minimum / max(centre, 1e-300)


def find_stretches(times: np.ndarray, y: np.ndarray) -> list[Stretch]:
    """Find all stretches that repeat, for all lags; those of near lags overlap.

    Args:
        times: even, s, shape (n,).
        y: signals, shape (n, joints).

    """
    step, start = times[1] - times[0], times[0]
    stretches = []
    while len(y) >= MIN_CYCLES * MIN_LAG:
        lags, differences, variance = _differences(y)
        for lag in lags[(lags >= MIN_LAG) & (lags < 2 * MIN_LAG)]:
            nearby = np.flatnonzero(np.abs(lags - lag) <= LAG_TOLERANCE * lag)
            for first, last in true_runs(differences[nearby].min(axis=0) < DIFFERENCE_THRESHOLD):
                best_lag = _best_lag(lags, differences[:, first:last + 1], nearby)
                half = 0.5 * min(2 * lag, len(y))
                begin, end = max(first - half, 0.0), min(last + half, len(y) - 1.0)
                if best_lag is not None and end - begin >= MIN_CYCLES * best_lag[0]:
                    stretches.append(Stretch(
                        start + begin * step, start + end * step, best_lag[0] * step,
                        best_lag[1], best_lag[2],
                        float(np.sqrt(variance[first:last + 1].mean()))))
        half = len(y) // 2
        y = 0.5 * (y[:2 * half:2] + y[1:2 * half:2])
        start, step = start + 0.5 * step, 2.0 * step
    return stretches


def best_stretch(stretches: list[Stretch]) -> Stretch:
    """Select the stretch with most cycles of most motion, at its true period.

    Half a period gives more cycles, which differ from one another: its multiple is then taken.
    """
    best = max(stretches,
               key=lambda stretch: stretch.cycles * stretch.size * (1.0 - stretch.difference))
    limit, typical_limit = (MAX_DIFFERENCE_RATIO * (difference - DIFFERENCE_OFFSET)
                            for difference in (best.difference, best.typical))
    for times in (2, 3):
        for stretch in stretches:
            if (abs(stretch.period / best.period / times - 1.0) < LAG_TOLERANCE / 2
                    and not stretch.outside(best.begin, best.end)
                    and stretch.end - stretch.begin >= MIN_LENGTH_RATIO * (best.end - best.begin)
                    and stretch.difference < limit and stretch.typical < typical_limit):
                return stretch
    return best
