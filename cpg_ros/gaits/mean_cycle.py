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

"""The mean cycle of a recording: one harmonic series per channel, fitted to all its cycles.

Being a fit, it takes times as they come, and averages noise.
"""

from dataclasses import dataclass

from cpg_ros.errors import InputError
from cpg_ros.short_repr import ShortRepr
import numpy as np
from scipy.linalg import solve_toeplitz, toeplitz

#: Most harmonics of a mean cycle.
HARMONICS = 32
#: Least eigenvalue of the normal matrix of harmonics, of at most 1.
DETERMINED = 0.1
#: Places in the cycle that are distinguished for that; many more than harmonics.
BINS = 4096


@dataclass(frozen=True, eq=False, repr=False)
class HarmonicCycle(ShortRepr):
    """The mean cycle of a recording.

    Attributes:
        period: in the unit of the recording's times.
        coefficients: c_n of ``x(t) = Re(c_0 + 2 sum_n c_n exp(2 pi i n (t - start) / period))``,
            complex, shape (harmonics + 1, channels).
        start: where the cycle begins.
        residual: RMS of what the cycle leaves, over that of the signals about their means.

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
