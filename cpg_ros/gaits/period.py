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

"""The period of a recording, to the precision its samples allow.

The first guess is the lag at which the recording repeats (the normalised square difference of
McLeod & Wyvill, 2005, "A smarter way to find pitch"). The period is then fitted together with
the harmonics (variable projection, Gauss-Newton), first to a few cycles, then to ever more of
them, so that it never slips by one.
"""

from cpg_ros.errors import InputError
from cpg_ros.gaits.mean_cycle import (
    evaluate_series,
    fit_series,
    resolvable_harmonics,
    rows_of,
    slopes_of,
)
import numpy as np
from scipy.interpolate import PchipInterpolator

#: Deviations below this share of the signals' RMS do not distinguish a period from its half.
NEGLIGIBLE = 0.005
#: A recording that repeats is at some lag this near to itself; unrelated signals have 1.
REPEATS = 0.5
#: Most points of the even grid on which it is compared with itself.
GRID = 1 << 17
#: Most samples that are used for the period, one of each stretch of a longer recording.
LONGEST = 1 << 15
#: Most lags that are tried as the period.
CANDIDATES = 12

#: What a period leaves, as a share of the signals' power; the period; its series' weights.
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


def _followed(t: np.ndarray, x: np.ndarray, period: float) -> tuple[float, np.ndarray, float]:
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
    found, best = [], 2.0 * REPEATS
    for low in 1 + np.flatnonzero((far[1:-1] < far[:-2]) & (far[1:-1] < far[2:])):
        if low > risen and far[low] < 0.5 * best:
            before, at, after = far[low - 1:low + 2]
            found.append((low + 0.5 * (before - after) / (before - 2.0 * at + after))
                         * (t[-1] - t[0]) / (m - 1))
            best = far[low]
    return found[:CANDIDATES]


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
        chosen = np.random.default_rng(0).integers(edges[:-1], edges[1:])
        t, signals = t[chosen], signals[chosen]
    x = signals - signals.mean(axis=0)
    channels, power = np.ascontiguousarray(x.T), float(np.mean(x * x))

    def tried(guess: float) -> Trial:
        period, weights, error = _followed(t, channels, guess)
        if not holds_two(t, period):
            return np.inf, period, weights
        # Longer cycles leave less merely because fewer of them are averaged.
        return error / power / (1.0 - min(period / _span(t), 0.5)), period, weights

    best: Trial = (np.inf, 1.0, np.empty(0))

    def better(longer: Trial) -> bool:
        # What it explains must stand out of what is irregular: strides that vary average out
        # the less, the fewer the cycles they are cut into.
        return best[0] > (1.0 + longer[1] / best[1]) * longer[0] + NEGLIGIBLE ** 2

    for lag in _lags(t, x):
        best = longer if better(longer := tried(lag)) else best
        if best[0] <= NEGLIGIBLE ** 2:
            break
    if best[0] > REPEATS:
        raise InputError(f'no period found: the signals do not repeat steadily within half of '
                         f'the {_span(t):g} recorded; at least two periods are needed')
    # Where samples are few, lags separate a cycle from its like halves less well than this does.
    for share in (2, 3):
        if best[0] > NEGLIGIBLE ** 2 and holds_two(t, share * best[1]):
            best = longer if better(longer := tried(share * best[1])) else best
    score, period, weights = best
    # And if only every share-th harmonic is there, it is so much shorter.
    harmonics = len(weights) // 2
    strength = 0.5 * np.sum(weights[1:].reshape(2, harmonics, -1) ** 2, axis=(0, 2))
    n = np.arange(1, harmonics + 1)
    for share in range(harmonics, 1, -1):
        others = strength[n % share > 0].sum() / power / x.shape[1]
        if others <= NEGLIGIBLE ** 2 + min(2.0 * score, 0.01):
            return tried(period / share)[1]
    return period
