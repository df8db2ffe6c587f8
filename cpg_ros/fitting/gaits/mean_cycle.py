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

"""Mean cycles of recordings, by period or by known phase, and the exact period of a recording.

The first guess is the lag at which the recording repeats (the normalised square difference of
McLeod & Wyvill, 2005, "A smarter way to find pitch"). The period is then fitted together with
the harmonics (variable projection, Gauss-Newton), first to a few cycles, then to ever more of
them, so that it never slips by one.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

from cpg_ros.common.errors import InputError, ShortRepr
import numpy as np

# The mean cycle of a recording: one harmonic series per channel, fitted to all its cycles.

#: HARMONICS: most harmonics of a mean cycle.
HARMONICS = 32
#: DETERMINED: least eigenvalue of the harmonics' normal matrix, at most 1, with which they are
#: fitted.
DETERMINED = 0.1
#: BINS: phases of the cycle that are distinguished for that; many more than harmonics.
BINS = 4096


@dataclass(frozen=True, eq=False, repr=False)
class HarmonicCycle(ShortRepr):
    """The mean cycle of a recording.

    Attributes:
        period: in the unit of the recording's times.
        coefficients: c_n of ``x(t) = Re(c_0 + 2 sum_n c_n exp(2 pi i n (t - start) / period))``,
            complex, shape (harmonics + 1, channels).
        start: where the cycle begins.
        residual: RMS of the residual, over the RMS of the signals about their means.

    """

    period: float
    coefficients: np.ndarray
    start: float
    residual: float

    def __call__(self, phases: np.ndarray) -> np.ndarray:
        """Return the signals at phases in cycles, shape (m,), as an array (m, channels)."""
        return evaluate_coefficients(self.coefficients, np.asarray(phases, dtype=float)).T


def weights_of(c: np.ndarray) -> np.ndarray:
    """Return the weights of rows, (2 n + 1, channels), for complex coefficients (n + 1, channels).

    The series is ``Re(c_0 + 2 sum_n c_n exp(2 pi i n phase))``.
    """
    return np.vstack([c.real[:1], 2.0 * c.real[1:], -2.0 * c.imag[1:]])


def coefficients_of(weights: np.ndarray) -> np.ndarray:
    """Return the complex coefficients of a series for the weights of its rows."""
    n = len(weights) // 2
    return np.vstack([weights[:1], 0.5 * (weights[1:1 + n] - 1j * weights[1 + n:])])


def slopes_of(weights: np.ndarray) -> np.ndarray:
    """Return the weights of a series' derivative by its phase in radians."""
    n = np.arange(1, len(weights) // 2 + 1)[:, None]
    return np.vstack([0.0 * weights[:1], n * weights[1 + len(n):], -n * weights[1:1 + len(n)]])


def evaluate_coefficients(c: np.ndarray, phases: np.ndarray) -> np.ndarray:
    """Return the channels, (channels, m), that coefficients give at phases in cycles, (m,)."""
    return evaluate_series(weights_of(c), rows_of(phases, len(c) - 1))


def rows_of(phases: np.ndarray, harmonics: int) -> np.ndarray:
    """Return 1, cos(2 pi n phase), sin(2 pi n phase) as rows, shape (2 harmonics + 1, m)."""
    rows = np.ones((2 * harmonics + 1, phases.size))
    if harmonics:
        powers = np.cumprod(np.broadcast_to(np.exp(2j * np.pi * phases),
                                            (harmonics, phases.size)), axis=0)
        rows[1:1 + harmonics], rows[1 + harmonics:] = powers.real, powers.imag
    return rows


def resolvable_harmonics(t: np.ndarray, period: float) -> int:
    """Return how many harmonics the times determine once folded onto one cycle; 0 if none.

    As many as a least-squares fit bears without magnifying noise: the smallest eigenvalue of
    its normal matrix (1 for even sampling, 0 where harmonics are aliases) is kept from 0.
    """
    # Loaded where it is used, as is all of scipy here, for programs that fit nothing.
    from scipy.linalg import toeplitz

    most = min(HARMONICS, (t.size - 1) // 4)
    bins = np.bincount((t / period % 1.0 * BINS).astype(int) % BINS, minlength=BINS)
    sums = np.fft.fft(bins)[:2 * most + 1] / t.size
    low, high = 0, most + 1
    while high - low > 1:
        middle = (low + high) // 2
        if np.linalg.eigvalsh(toeplitz(sums[:2 * middle + 1]))[0] > DETERMINED:
            low = middle
        else:
            high = middle
    return low


def evaluate_series(weights: np.ndarray, rows: np.ndarray) -> np.ndarray:
    """Return the channels, shape (channels, m), that weights (2 n + 1, channels) give."""
    return np.einsum('nc,nm->cm', weights, rows)


def fit_series(values: np.ndarray, rows: np.ndarray) -> np.ndarray:
    """Return the least-squares weights (2 n + 1, channels) of rows for values (channels, m).

    The normal matrix of exp(2 pi i n phase), n = -N..N, is Toeplitz. No BLAS here: on a busy
    computer waiting for its threads takes longer than all of this.
    """
    from scipy.linalg import solve_toeplitz, toeplitz

    n = len(rows) // 2
    cos, sin = rows[1:1 + n], rows[1 + n:]
    sums = np.ones(2 * n + 1, dtype=complex)
    sums[1:1 + n] = (cos - 1j * sin).mean(axis=1)
    if n:
        last = cos[-1] - 1j * sin[-1]
        sums[1 + n:] = np.einsum('nm,m->n', cos, last) - 1j * np.einsum('nm,m->n', sin, last)
        sums[1 + n:] /= values.shape[1]
    means = np.einsum('nm,cm->nc', rows, values) / values.shape[1]
    upper = means[1:1 + n] - 1j * means[1 + n:]
    right = np.vstack([upper[::-1].conj(), means[:1], upper])
    try:
        c = solve_toeplitz(sums, right)[n:]
    except np.linalg.LinAlgError:
        # Samples at fewer phases than there are terms: of all series the smallest.
        c = np.linalg.lstsq(toeplitz(sums), right)[0][n:]
    return weights_of(c)


def mean_cycle(t: np.ndarray, signals: np.ndarray, period: float) -> HarmonicCycle:
    """Fold a recording onto one cycle of the period given.

    Args:
        t: increasing times, evenly or unevenly spaced, shape (m,).
        signals: one channel per column, shape (m, channels).
        period: in the unit of t.

    Raises:
        InputError: the samples do not even determine the first harmonic.

    """
    harmonics = resolvable_harmonics(t, period)
    if harmonics < 1:
        raise InputError(f'the samples, folded onto one period of {period:g}, leave too much of '
                         f'it empty')
    rows = rows_of((t - t[0]) / period, harmonics)
    weights = fit_series(signals.T, rows)
    left = signals.T - evaluate_series(weights, rows)
    return HarmonicCycle(period, coefficients_of(weights), float(t[0]),
                         float(np.sqrt(np.mean(left * left) / signals.var(axis=0).mean())))


# The mean cycle of a motion whose phase is known, and how far each cycle is from it.

#: AVERAGE_HARMONICS: most harmonics of a mean cycle.
AVERAGE_HARMONICS = 24
#: A sample is a spike if it is off the mean cycle by more than FAR times the median distance and
#: by more than WILD standard deviations of the joint.
FAR, WILD = 30.0, 3.0
#: BLOCK: samples of a long recording that are fitted at once; CYCLES: fewest cycles in them.
BLOCK, CYCLES = 1 << 15, 20.0
#: ENOUGH: fewest cycles with which the scatter is estimated at every phase; POOLED: number of
#: cycles as which the scatter of all phases counts there, as that of a few may be small by chance.
ENOUGH, POOLED = 4, 4


@dataclass(frozen=True, eq=False, repr=False)
class PhaseAverage(ShortRepr):
    """Mean cycles.

    Attributes:
        zero: the phase that is 0 in the following, cycles.
        coefficients: c_n of ``x = Re(c_0 + 2 sum c_n exp(2 pi i n theta))`` for each joint, rad,
            complex, shape (n + 1, joints).
        spread: standard deviation of a cycle about the mean, rad, (joints, m).
        error: standard error of the mean, rad, (joints, m).
        counts: samples used, (joints,).
        spikes: samples left out, (joints,).
        left: variance left about the mean over all variance, (joints,).

    """

    zero: float
    coefficients: np.ndarray
    spread: np.ndarray
    error: np.ndarray
    counts: np.ndarray
    spikes: np.ndarray
    left: np.ndarray

    def mean(self, theta: np.ndarray) -> np.ndarray:
        """Return the mean cycles at theta in cycles, shape (joints, m)."""
        return evaluate_coefficients(self.coefficients, theta)


def blocks(phases: np.ndarray) -> list[slice]:
    """Cut a long recording into parts of many cycles each, so that none takes much memory."""
    count = min(-(-phases.size // BLOCK), int((phases[-1] - phases[0]) / CYCLES))
    edges = np.linspace(0, phases.size, max(count, 1) + 1).astype(int)
    return [slice(low, high) for low, high in pairwise(edges)]


def mean_weights(x: np.ndarray, phases: np.ndarray, harmonics: int) -> np.ndarray:
    """Return the least-squares weights (2 n + 1, channels) of the series of x (channels, m).

    Of a long recording the mean of those of its blocks.
    """
    parts = blocks(phases)
    return np.mean([fit_series(x[:, part], rows_of(phases[part], harmonics))
                    for part in parts], axis=0)


def average_cycles(phases: np.ndarray, positions: np.ndarray, theta: np.ndarray,
                   first: Sequence[int]
                   ) -> PhaseAverage:
    """Average cycles.

    Args:
        phases: of the samples in cycles, rising, shape (n,).
        positions: shape (n, joints), nan where missing.
        theta: even points of a cycle for spread and error, shape (m,).
        first: joints of which the one with the largest first harmonic gives phase 0.

    Raises:
        InputError: a joint has too few samples.

    """
    there = np.isfinite(positions)
    joints = positions.shape[1]
    weights = np.zeros((2 * AVERAGE_HARMONICS + 1, joints))
    rests: list[tuple[np.ndarray, np.ndarray, int]] = [None] * joints  # type: ignore[list-item]
    spikes, left = np.zeros(joints, dtype=int), np.zeros(joints)
    # Joints that come in the same messages have the same samples.
    groups: dict[bytes, list[int]] = {}
    for joint, column in enumerate(np.packbits(there, axis=0).T):
        groups.setdefault(column.tobytes(), []).append(joint)
    for alike in groups.values():
        mask = there[:, alike[0]]
        # A view where it can be: a long recording is large.
        at, x = phases[mask], (positions.T if len(alike) == joints and mask.all()
                               else positions.T[np.ix_(alike, mask)])
        weights[:, alike], rest, bins = _fitted(at, x)
        for row, joint in enumerate(alike):
            far, variance = np.abs(rest[row]), float(x[row].var())
            keep = (far <= FAR * np.median(far)) | (far <= WILD * np.sqrt(variance))
            rests[joint] = at, rest[row], bins
            if not keep.all():
                some, own, fewer = _fitted(at[keep], x[row:row + 1, keep])
                weights[:, joint], rests[joint] = some[:, 0], (at[keep], own[0], fewer)
            spikes[joint] = np.count_nonzero(~keep)
            left[joint] = rests[joint][1].var() / max(variance, 1e-300)
    c = coefficients_of(weights)
    lead = c[1, list(first)]
    zero = -float(np.angle(lead[np.argmax(np.abs(lead))])) / (2.0 * np.pi)
    turned = c * np.exp(2j * np.pi * zero * np.arange(len(c)))[:, None]
    scatter = [_scatter(at - zero, rest, bins, theta) for at, rest, bins in rests]
    spread, error = (np.array(values) for values in zip(*scatter, strict=True))
    return PhaseAverage(zero, turned, spread, error, there.sum(axis=0) - spikes, spikes, left)


def _fitted(phases: np.ndarray, x: np.ndarray) -> tuple[np.ndarray, np.ndarray, int]:
    """Fit the series of joints with the same samples; return weights, rest and its bins."""
    n = min(resolvable_harmonics(phases - phases[0], 1.0),
            AVERAGE_HARMONICS) if phases.size > 4 else 0
    if n < 1:
        raise InputError(f'{phases.size} samples leave too much of the cycle empty')
    some = mean_weights(x, phases, n)
    rest = np.empty_like(x)
    for part in blocks(phases):
        rest[:, part] = x[:, part] - evaluate_series(some, rows_of(phases[part], n))
    weights = np.zeros((2 * AVERAGE_HARMONICS + 1, len(x)))
    weights[:1 + n], weights[1 + AVERAGE_HARMONICS:1 + AVERAGE_HARMONICS
                             + n] = some[:1 + n], some[1 + n:]
    return weights, rest, 2 * n + 1


def _scatter(phases: np.ndarray, rest: np.ndarray, bins: int, theta: np.ndarray
             ) -> tuple[np.ndarray, np.ndarray]:
    """Return spread and standard error at theta from the residuals of one joint's samples."""
    cycle = np.floor(phases - phases[0]).astype(int)
    key = cycle * bins + (phases % 1.0 * bins).astype(int) % bins
    cycles = int(cycle[-1]) + 1
    sums, counts = (np.bincount(key, values, cycles * bins).reshape(cycles, bins)
                    for values in (rest, np.ones(rest.size)))
    have = counts > 0
    means = np.divide(sums, counts, out=np.zeros_like(sums), where=have)
    number = have.sum(axis=0)
    middle = means.sum(axis=0) / np.maximum(number, 1)
    square = np.sum(np.where(have, means - middle, 0.0)**2, axis=0)
    # A single value has no scatter.
    free = np.maximum(number - 1, 0)
    pooled = square[free > 0].sum() / max(free.sum(), 1)
    square = (np.full(bins, pooled) if np.median(number) < ENOUGH
              else (square + POOLED * pooled) / (free + POOLED))
    spread = np.sqrt(square)
    error = np.sqrt(square / np.maximum(number, 1) + middle**2)
    centres = (np.arange(bins) + 0.5) / bins
    return (np.interp(theta % 1.0, centres, spread, period=1.0),
            np.interp(theta % 1.0, centres, error, period=1.0))


#: NEGLIGIBLE: deviation, over the signals' RMS, up to which a period is not told from its half.
NEGLIGIBLE = 0.005
#: REPEATS: normalised square difference at a lag, 1 for unrelated signals, below which they
#: repeat.
REPEATS = 0.5
#: GRID: most points of the even grid on which a recording is compared with itself.
GRID = 1 << 17
#: LONGEST: most samples that are used for the period, one of each stretch of a longer recording.
LONGEST = 1 << 15
#: CANDIDATES: most lags that are tried as the period.
CANDIDATES = 12

#: Residual of a period, as a share of the signals' power; the period; its series' weights.
Trial = tuple[float, float, np.ndarray]


def _refined(t: np.ndarray, x: np.ndarray, period: float) -> tuple[float, np.ndarray, float]:
    """Fit period and harmonics to all of x, shape (channels, m), from a guess near enough.

    Returns:
        The period, the series' weights (2 harmonics + 1, channels), and the mean square left.

    """
    centred = t - 0.5 * (t[0] + t[-1])
    span = t[-1] - t[0]
    # Well below the sampling rate: at a period of whole samples higher ones are aliases.
    usual = int(0.4 * period / np.median(np.diff(t)))
    harmonics = min(usual, resolvable_harmonics(t, period))

    def fit(rate: float) -> tuple[float, np.ndarray, np.ndarray, np.ndarray]:
        rows = rows_of(centred * rate, harmonics)
        weights = fit_series(x, rows)
        left = x - evaluate_series(weights, rows)
        return float(np.mean(left * left)), rows, weights, left

    rate = 1.0 / period
    error, rows, weights, left = fit(rate)
    for _ in range(20):
        by_rate = 2.0 * np.pi * centred * evaluate_series(slopes_of(weights), rows)
        by_rate -= evaluate_series(fit_series(by_rate, rows), rows)
        step = float(np.sum(by_rate * left) / max(np.sum(by_rate * by_rate), 1e-300))
        step = float(np.clip(step, -0.1 / span, 0.1 / span))
        while abs(step) * span > 1e-8:
            trial = fit(rate + step)
            if trial[0] < error:
                break
            step *= 0.25
        else:
            break
        rate += step
        error, rows, weights, left = trial
    return 1.0 / rate, weights, error


def _tracked_period(t: np.ndarray, x: np.ndarray,
                    period: float) -> tuple[float, np.ndarray, float]:
    """Refine a rough period on three of its cycles, then on four times as many, up to all."""
    reach = 3.0 * period
    while t[0] + reach < t[-1]:
        head = np.searchsorted(t, t[0] + reach)
        if head > 8:
            period = _refined(t[:head], x[:, :head], period)[0]
        reach *= 4.0
    return _refined(t, x, period)


def _lags(t: np.ndarray, x: np.ndarray) -> list[float]:
    """Return lags at which the recording repeats, each better than all shorter ones."""
    from scipy.interpolate import PchipInterpolator

    m = min(4 * t.size, GRID)
    even = PchipInterpolator(t, x)(np.linspace(t[0], t[-1], m))
    energy = np.concatenate([[0.0], np.cumsum(np.sum(even * even, axis=1))])
    lags = np.arange(int(0.6 * m))
    product = np.zeros(m)
    for channel in even.T:
        spectrum = np.fft.rfft(channel, 2 * m)
        product += np.fft.irfft(spectrum * spectrum.conj(), 2 * m)[:m]
    both = energy[m - lags] + energy[m] - energy[lags]
    far = 1.0 - 2.0 * product[lags] / both
    # Up to a lag of one period the mean of this is 1, so the first rise is within it.
    risen = np.argmax(far > REPEATS)
    candidates, best = [], 2.0 * REPEATS
    for low in 1 + np.flatnonzero((far[1:-1] < far[:-2]) & (far[1:-1] < far[2:])):
        if low > risen and far[low] < 0.5 * best:
            before, at, after = far[low - 1:low + 2]
            candidates.append((low + 0.5 * (before - after) / (before - 2.0 * at + after))
                         * (t[-1] - t[0]) / (m - 1))
            best = far[low]
    return candidates[:CANDIDATES]


def _span(t: np.ndarray) -> float:
    """Return how long a recording lasts, its last sample included."""
    return float(t[-1] - t[0] + np.median(np.diff(t)))


def holds_two(t: np.ndarray, period: float) -> bool:
    """Tell whether a recording holds two periods, to 0.1 %."""
    return 2.0 * period <= 1.001 * _span(t)


def find_period(t: np.ndarray, signals: np.ndarray) -> float:
    """Find the period that all channels share.

    The shortest one that explains the recording as well as any: neither half of it, however
    like the two halves of a cycle are (down to differences of 0.5 % RMS), nor a multiple.

    Args:
        t: increasing times, evenly or unevenly spaced, shape (m,).
        signals: one channel per column, shape (m, channels).

    Raises:
        InputError: the recording does not repeat, or holds less than two periods.

    """
    if t.size > LONGEST:
        # At random, as sampling that stays regular would hide harmonics.
        edges = np.linspace(0, t.size, LONGEST + 1).astype(int)
        indices = np.random.default_rng(0).integers(edges[:-1], edges[1:])
        t, signals = t[indices], signals[indices]
    x = signals - signals.mean(axis=0)
    channels, power = np.ascontiguousarray(x.T), float(np.mean(x * x))

    def tried(guess: float) -> Trial:
        period, weights, error = _tracked_period(t, channels, guess)
        if not holds_two(t, period):
            return np.inf, period, weights
        # Longer cycles leave less merely because fewer of them are averaged.
        return error / power / (1.0 - min(period / _span(t), 0.5)), period, weights

    best: Trial = (np.inf, 1.0, np.empty(0))

    def better(longer: Trial) -> bool:
        # Its gain must exceed the effect of irregular strides, which average out the less, the
        # fewer the cycles they are cut into.
        return best[0] > (1.0 + longer[1] / best[1]) * longer[0] + NEGLIGIBLE ** 2

    for lag in _lags(t, x):
        best = longer if better(longer := tried(lag)) else best
        if best[0] <= NEGLIGIBLE ** 2:
            break
    if best[0] > REPEATS:
        raise InputError(f'no period found: the signals do not repeat steadily within half of '
                         f'the {_span(t):g} recorded; at least two periods are needed')
    # Where samples are few, lags separate a cycle from its like halves less well than this does.
    for fraction in (2, 3):
        if best[0] > NEGLIGIBLE ** 2 and holds_two(t, fraction * best[1]):
            best = longer if better(longer := tried(fraction * best[1])) else best
    score, period, weights = best
    # And if only every share-th harmonic is there, it is so much shorter.
    harmonics = len(weights) // 2
    strength = 0.5 * np.sum(weights[1:].reshape(2, harmonics, -1) ** 2, axis=(0, 2))
    n = np.arange(1, harmonics + 1)
    for fraction in range(harmonics, 1, -1):
        others = strength[n % fraction > 0].sum() / power / x.shape[1]
        if others <= NEGLIGIBLE ** 2 + min(2.0 * score, 0.01):
            return tried(period / fraction)[1]
    return period
