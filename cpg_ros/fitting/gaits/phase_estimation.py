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

"""Estimation of the stride phase over time for a steady motion of varying speed.

A rough estimate comes from the first harmonic of all signals together: in a steady gait, their
complex amplitudes in a sliding window of one period have one direction, and the rotation along it
is the phase. The fine estimate uses all harmonics: the phase is linear between knots, one for each
cycle, and is fitted alternately with the mean cycle (Gauss-Newton). With few cycles it is linear
throughout.
"""

from dataclasses import dataclass

from cpg_ros.common.errors import ShortRepr
from cpg_ros.fitting.gaits.mean_cycle import (
    blocks,
    evaluate_series,
    fit_series,
    mean_weights,
    rows_of,
    slopes_of,
)
from cpg_ros.fitting.gaits.steady_stretch import longest_run, resample_evenly, Stretch
import numpy as np
from scipy.linalg import solveh_banded

#: NUM_BLOCKS: in a period, at each of which a window begins; BLOCK_SIZE: points in a block.
NUM_BLOCKS, BLOCK_SIZE = 8, 4
# A motion is steady if it meets the following four limits.
#: MIN_AMPLITUDE_RATIO: least amplitude, as a fraction of the typical one.
MIN_AMPLITUDE_RATIO = 0.4
#: MAX_AMPLITUDE_RATIO: largest amplitude, as a multiple of the typical one.
MAX_AMPLITUDE_RATIO = 2.5
#: RATE_TOLERANCE: relative difference of a stride's rate from the median.
RATE_TOLERANCE = 0.15
#: MIN_COHERENCE: fraction of the motion in the typical direction; a walk has 1/4 of a trot's.
MIN_COHERENCE = 0.5
#: A stride at the end of a stretch is left out if its RMS residual exceeds OUTLIER_RATIO times the
#: median one and MIN_OUTLIER of the motion,
OUTLIER_RATIO, MIN_OUTLIER = 3.0, 0.05
#: or if its rate differs from the median by more than RATE_OUTLIER_RATIO times the median
#: deviation and by more than the fraction MIN_RATE_OUTLIER.
RATE_OUTLIER_RATIO, MIN_RATE_OUTLIER = 4.5, 0.03
#: HARMONICS: that determine the phase; MIN_CYCLES: for knots inside.
HARMONICS, MIN_CYCLES = 8, 4.0
#: END_VARIANCE: of the phase at an end, over that of strides' lengths (found by simulation:
#: strides with 0 to 3 % of scatter, alone and in runs, and of shapes that vary by 0 to 10 %).
END_VARIANCE = 0.08
#: MIN_DRIFT_RATES: number of rates in which a drift is separated from wander.
MIN_DRIFT_RATES = 12
#: MAX_STEP: change of the phase in one step, cycles.
GAUSS_NEWTON_STEPS, MAX_STEP = 6, 0.1
#: SMOOTHING: weight of a knot's neighbours where there are no data around it.
SMOOTHING = 1e-3
#: GAP_RATIO: interval between samples, over the usual one or that of the grid, in which none of
#: the grid's points count.
GAP_RATIO = 2.5


@dataclass(frozen=True, eq=False, repr=False)
class PhaseEstimate(ShortRepr):
    """Phase of a motion, linear between knots.

    Attributes:
        knots: s, ascending, shape (k,); the first and last are the ends of the motion.
        phases: cycles, shape (k,).
        frequency: mean, Hz.
        frequency_error: its standard error, Hz.

    """

    knots: np.ndarray
    phases: np.ndarray
    frequency: float
    frequency_error: float

    def __call__(self, times: np.ndarray) -> np.ndarray:
        """Return the phases in cycles at times within."""
        return np.interp(times, self.knots, self.phases)

    @property
    def cycles(self) -> float:
        """Number of cycles of the stretch."""
        return float(self.phases[-1] - self.phases[0])


@dataclass(frozen=True, eq=False, repr=False)
class RoughPhase(ShortRepr):
    """The rough phase of a stretch: at times (c,), s, in cycles (c,)."""

    begin: float
    end: float
    times: np.ndarray
    phases: np.ndarray


def grow_stretch(times: np.ndarray, positions: np.ndarray, seed: Stretch) -> RoughPhase:
    """Follow the phase from a stretch in both directions, as long as the motion stays alike.

    Args:
        times: ascending, s, shape (n,).
        positions: shape (n, joints), nan where missing.
        seed: stretch in which the motion repeats.

    """
    step = seed.period / (NUM_BLOCKS * BLOCK_SIZE)
    grid, y = resample_evenly(times, positions, 1.0 / step)
    step = grid[1] - grid[0]
    period = NUM_BLOCKS * BLOCK_SIZE * step
    blocks = len(y) // BLOCK_SIZE
    parts = y[:blocks * BLOCK_SIZE].reshape(blocks, BLOCK_SIZE, -1)
    phasor = np.exp(-2j * np.pi * np.arange(blocks * BLOCK_SIZE).reshape(blocks, BLOCK_SIZE)
                    / (NUM_BLOCKS * BLOCK_SIZE))
    sums = np.concatenate([np.zeros((1, y.shape[1])),
                           np.cumsum(np.einsum('bp,bpj->bj', phasor, parts), axis=0)])
    z = sums[NUM_BLOCKS:] - sums[:-NUM_BLOCKS]
    middles = grid[0] + (np.arange(len(z)) + 0.5 * NUM_BLOCKS) * BLOCK_SIZE * step - 0.5 * step
    inside = ((middles >= seed.begin + 0.499 * period) & (middles <= seed.end - 0.499 * period))
    if not inside.any():
        inside = np.abs(middles - 0.5 * (seed.begin + seed.end)) <= period
    # The first principal direction.
    direction = np.linalg.eigh(z[inside].T @ z[inside].conj())[1][:, -1]
    along = z @ direction.conj()
    sizes = np.abs(along)
    phases = (middles - grid[0]) / period + np.unwrap(np.angle(along)) / (2.0 * np.pi)
    half = NUM_BLOCKS // 2
    ahead = np.minimum(np.arange(len(z)) + half, len(z) - 1)
    behind = np.maximum(np.arange(len(z)) - half, 0)
    rates = (phases[ahead] - phases[behind]) / np.maximum(middles[ahead] - middles[behind],
                                                          1e-300)
    typical, rate = np.median(sizes[inside]), np.median(rates[inside])
    steady = ((sizes >= MIN_AMPLITUDE_RATIO * typical) & (sizes <= MAX_AMPLITUDE_RATIO * typical)
              & (sizes**2 >= MIN_COHERENCE * np.einsum('bj,bj->b', z, z.conj()).real))
    if len(z) > NUM_BLOCKS:
        steady &= np.abs(rates / rate - 1.0) <= RATE_TOLERANCE
    first, last = longest_run(steady & _runs_containing(steady, inside)) or (0, len(z) - 1)
    # An incomplete block at the end of the recording is no reason to stop before it.
    end = times[-1] if last == len(z) - 1 else middles[last] + 0.5 * period
    return RoughPhase(max(middles[first] - 0.5 * period, times[0]), min(end, times[-1]),
                      middles[first:last + 1], phases[first:last + 1])


def _runs_containing(steady: np.ndarray, inside: np.ndarray) -> np.ndarray:
    """Mark the runs of steady positions that contain one of those inside."""
    number = np.cumsum(np.diff(steady, prepend=False))
    return np.isin(number, number[steady & inside])


def estimate_phase(times: np.ndarray, positions: np.ndarray, rough: RoughPhase) -> PhaseEstimate:
    """Fit the phase to all harmonics of a stretch.

    Args:
        times: ascending, s, shape (n,).
        positions: shape (n, joints), nan where missing.
        rough: the stretch.

    """
    slope, level = (np.polyfit(rough.times - rough.begin, rough.phases, 1)
                    if rough.times.size > 1 else (1.0, 0.0))
    # Convert to plain numbers, as results are written to files that accept no others.
    span = float(rough.end - rough.begin)
    within = index_range(times, rough.begin - 1.0 / slope, rough.end + 1.0 / slope)
    grid, y = resample_evenly(times[within], positions[within], NUM_BLOCKS * BLOCK_SIZE * slope)
    inside = index_range(grid, rough.begin, rough.end)
    # What is interpolated where many samples are missing is no motion.
    steps = np.diff(times[within])
    dense = steps[np.clip(np.searchsorted(times[within], grid) - 1, 0, steps.size - 1)] <= (
        GAP_RATIO * max(float(np.median(steps)), grid[1] - grid[0]))
    grid, x = grid[inside][dense[inside]] - rough.begin, y.T[:, inside][:, dense[inside]]
    if span * slope < MIN_CYCLES:
        phases, error = _fit_constant_rate(grid, x, np.array([level, level + slope * span]), span)
        return PhaseEstimate(np.array([rough.begin, rough.end]), phases,
                             float(phases[1] - phases[0]) / span, error)
    knots = np.linspace(0.0, span, round(span * slope) + 1)
    phases = _prolong(knots + rough.begin, rough.times, rough.phases, slope)
    while True:
        phases = _refine(grid, x, knots, phases)
        first, last = _steady_strides(grid, x, knots, phases)
        if last - first == knots.size - 2 or phases[last + 1] - phases[first] < MIN_CYCLES:
            break
        knots, phases = knots[first:last + 2], phases[first:last + 2]
        inside = index_range(grid, knots[0], knots[-1])
        grid, x = grid[inside], x[:, inside]
    frequency, error = _mean_rate(knots, phases)
    return PhaseEstimate(knots + rough.begin, phases, frequency, error)


def index_range(times: np.ndarray, begin: float, end: float) -> slice:
    """Return where rising times are from one to another, both included."""
    return slice(int(np.searchsorted(times, begin)),
                 int(np.searchsorted(times, end, side='right')))


def _mean_rate(knots: np.ndarray, phases: np.ndarray) -> tuple[float, float]:
    """Return the mean rate of the stretch and its standard error.

    Phases at the knots wander, as strides vary, and have errors. Rates between knots therefore
    vary by 2 q/3 + 2 s and covary with their neighbours by q/6 - s, with the variances s of the
    errors and q of strides, as knots lie anywhere in strides. A drift is treated separately. The
    mean of least variance gives all rates the same weight if they only wander, and is the slope of
    a straight line if they do not.

    The result is the mean over this stretch, including strides that happened to be quick. Its
    errors are those of the phases at the knots, of weights that differ from those of that mean,
    and of the phases at the ends, where a straight piece of phase does not follow the stride's own
    speed.
    """
    rates = np.diff(phases) / np.diff(knots)
    n = rates.size
    off, free = rates - rates.mean(), n - 1
    if n >= MIN_DRIFT_RATES:
        offsets = np.arange(n) - 0.5 * (n - 1)
        off, free = off - offsets * (offsets @ rates) / (offsets @ offsets), n - 2
    total = float(off @ off) / max(free, 1)
    covariance = float(off[1:] @ off[:-1]) / max(n - 1, 1)
    errors = min(max((0.25 * total - covariance) / 1.5, 0.0), 0.499 * total)
    wander = 1.5 * (total - 2.0 * errors)
    if total <= 0.0:
        return float(rates.mean()), 0.0
    bands = np.stack([np.full(n, wander / 6.0 - errors), np.full(n, total)])
    weights = solveh_banded(bands, np.ones(n))
    weights /= weights.sum()
    uneven, steps = weights - 1.0 / n, np.diff(weights, prepend=0.0, append=0.0)
    variance = (errors * (steps @ steps)
                + wander * (2.0 * (uneven @ uneven) + uneven[1:] @ uneven[:-1]) / 3.0
                + 2.0 * END_VARIANCE * wander / n**2)
    return float(weights @ rates), float(np.sqrt(max(variance, 0.0)))


def _prolong(at: np.ndarray, times: np.ndarray, phases: np.ndarray, slope: float) -> np.ndarray:
    """Interpolate phases, and continue them with a slope."""
    inner = np.interp(at, times, phases)
    return inner + slope * (np.minimum(at - times[0], 0.0) + np.maximum(at - times[-1], 0.0))


def _fit_mean_cycle(x: np.ndarray, phases: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Fit the mean cycle; return what it leaves, and its slope by phase."""
    weights = mean_weights(x, phases, HARMONICS)
    slope_weights = 2.0 * np.pi * slopes_of(weights)
    residual, slope = np.empty_like(x), np.empty_like(x)
    for part in blocks(phases):
        rows = rows_of(phases[part], HARMONICS)
        residual[:, part] = x[:, part] - evaluate_series(weights, rows)
        slope[:, part] = evaluate_series(slope_weights, rows)
    return residual, slope


def _fit_constant_rate(grid: np.ndarray, x: np.ndarray, phases: np.ndarray, span: float
              ) -> tuple[np.ndarray, float]:
    """Fit a constant rate with the mean cycle eliminated; return phases and error."""
    offsets = grid - 0.5 * span
    for _ in range(2 * GAUSS_NEWTON_STEPS):
        at = np.interp(grid, [0.0, span], phases)
        residual, slope = _fit_mean_cycle(x, at)
        by_rate, rows = offsets * slope, rows_of(at, HARMONICS)
        by_rate -= evaluate_series(fit_series(by_rate, rows), rows)
        power = float(np.sum(by_rate * by_rate))
        step = float(np.sum(by_rate * residual)) / max(power, 1e-300)
        step = float(np.clip(step, -MAX_STEP / span, MAX_STEP / span))
        phases = phases + step * span * np.array([-0.5, 0.5])
        if abs(step) * span < 1e-6:
            break
    # Blocks of an eighth of a cycle, all joints together, vary independently; the few harmonics
    # have taken their part of what is left.
    scores = np.einsum('jn,jn->n', by_rate, residual)
    block = (np.interp(grid, [0.0, span], phases - phases[0]) * NUM_BLOCKS).astype(int)
    sums = np.bincount(block, scores)
    free = max(1.0 - (2 * HARMONICS + 1) / grid.size, 0.1)
    error = float(np.sqrt(np.sum(sums**2)) / max(power, 1e-300) / free)
    # Strides wander besides, slowly: what blocks and their neighbours are early or late together
    # is that, and counts once a cycle. The mean cycle takes one cycle's part of it.
    leads = (np.bincount(block, np.einsum('jn,jn->n', slope, residual))
             / np.maximum(np.bincount(block, np.einsum('jn,jn->n', slope, slope)), 1e-300))
    cycles = float(phases[1] - phases[0])
    covariance = float(np.sum(leads[1:] * leads[:-1])) / max(leads.size - 1, 1)
    wander = max(covariance, 0.0) / max(1.0 - 1.0 / cycles, 0.1)**2
    return phases, float(np.hypot(error, np.sqrt(12.0 * wander / cycles) / span))


def _steady_strides(grid: np.ndarray, x: np.ndarray, knots: np.ndarray, phases: np.ndarray
            ) -> tuple[int, int]:
    """Return first and last stride of the longest run, between knots, that resembles the mean."""
    residual, _ = _fit_mean_cycle(x, np.interp(grid, knots, phases))
    starts = np.minimum(np.searchsorted(grid, knots[:-1]), grid.size - 1)
    counts = np.maximum(np.diff(np.append(starts, grid.size)), 1)

    def sums(values: np.ndarray) -> np.ndarray:
        return np.add.reduceat(values, starts, axis=1)

    # Subtract the means of each stride: the lean of a body is not part of the gait.
    def products(a: np.ndarray, b: np.ndarray) -> np.ndarray:
        return (sums(a * b) - sums(a) * sums(b) / counts).sum(axis=0)

    mean = x - residual
    overlap, power, typical = products(x, mean), products(x, x), products(mean, mean)
    rates = np.diff(phases) / np.diff(knots)
    first, last = longest_run((np.abs(rates / np.median(rates) - 1.0) <= RATE_TOLERANCE)
                              & (overlap >= MIN_AMPLITUDE_RATIO * typical)
                              & (overlap <= MAX_AMPLITUDE_RATIO * typical)
                              & (overlap * np.abs(overlap) >= MIN_COHERENCE * power * typical)
                              ) or (0, rates.size - 1)
    misfit = products(residual, residual)
    off = np.abs(rates - np.median(rates))
    outlier = ((misfit
                > np.maximum(OUTLIER_RATIO**2 * np.median(misfit), MIN_OUTLIER**2 * typical))
               | (off > max(RATE_OUTLIER_RATIO * np.median(off),
                            MIN_RATE_OUTLIER * np.median(rates))))
    while last - first > 2 and outlier[first]:
        first += 1
    while last - first > 2 and outlier[last]:
        last -= 1
    return first, last


def _refine(grid: np.ndarray, x: np.ndarray, knots: np.ndarray, phases: np.ndarray) -> np.ndarray:
    """Fit the phase at the knots and the mean cycle alternately."""
    interval = np.clip(np.searchsorted(knots, grid, side='right') - 1, 0, knots.size - 2)
    after = (grid - knots[interval]) / (knots[interval + 1] - knots[interval])
    before = 1.0 - after

    def accumulate(low: np.ndarray, high: np.ndarray) -> np.ndarray:
        return (np.bincount(interval, low, knots.size)
                + np.bincount(interval + 1, high, knots.size))

    for _ in range(GAUSS_NEWTON_STEPS):
        residual, slope = _fit_mean_cycle(x, np.interp(grid, knots, phases))
        stiff, pull = np.einsum('jn,jn->n', slope, slope), np.einsum('jn,jn->n', slope, residual)
        bands = np.zeros((2, knots.size))
        bands[1] = accumulate(stiff * before**2, stiff * after**2)
        bands[0, 1:] = np.bincount(interval, stiff * before * after, knots.size)[:-1]
        tie = SMOOTHING * bands[1].mean() + 1e-300
        bands[1] += 2.0 * tie
        bands[0, 1:] -= tie
        step = solveh_banded(bands, accumulate(pull * before, pull * after))
        phases = phases + np.clip(step, -MAX_STEP, MAX_STEP)
        if np.abs(step).max() < 1e-5:
            break
    return phases
