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

"""Mean cycle of a motion with known phase: a harmonic series fitted to all its samples."""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

from cpg_ros.common.errors import InputError, ShortRepr
import numpy as np

# A harmonic series, its rows and its least-squares fit.

MAX_HARMONICS = 32
#: MIN_EIGENVALUE: of the harmonics' normal matrix, at most 1, with which they are fitted.
MIN_EIGENVALUE = 0.1
#: PHASE_BINS: of a cycle for that matrix; many more than harmonics.
PHASE_BINS = 4096


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
    """Return the number of harmonics that the phases determine; 0 if none.

    It is the largest number for which a least-squares fit does not magnify noise: the smallest
    eigenvalue of its normal matrix (1 for even sampling, 0 where harmonics are aliases) stays away
    from 0.
    """
    # Loaded where it is used, as is all of scipy here, for programs that fit nothing.
    from scipy.linalg import toeplitz

    limit = min(MAX_HARMONICS, (t.size - 1) // 4)
    bins = (t / period % 1.0 * PHASE_BINS).astype(int) % PHASE_BINS
    sums = np.fft.fft(np.bincount(bins, minlength=PHASE_BINS))[:2 * limit + 1] / t.size
    low, high = 0, limit + 1
    while high - low > 1:
        middle = (low + high) // 2
        if np.linalg.eigvalsh(toeplitz(sums[:2 * middle + 1]))[0] > MIN_EIGENVALUE:
            low = middle
        else:
            high = middle
    return low


def evaluate_series(weights: np.ndarray, rows: np.ndarray) -> np.ndarray:
    """Return the channels, shape (channels, m), that weights (2 n + 1, channels) give."""
    return np.einsum('nc,nm->cm', weights, rows)


def fit_series(values: np.ndarray, rows: np.ndarray) -> np.ndarray:
    """Return the least-squares weights (2 n + 1, channels) of rows for values (channels, m).

    The normal matrix of exp(2 pi i n phase), n = -N..N, is Toeplitz. It avoids BLAS, whose threads
    take longer to wait for on a busy computer than all of this.
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


# The mean cycle, and how far each cycle is from it.

#: AVERAGE_HARMONICS: most harmonics of a PhaseAverage.
AVERAGE_HARMONICS = 24
#: A sample is a spike if it is off the mean cycle by more than SPIKE_MEDIAN_RATIO times the median
#: distance and by more than SPIKE_STD_RATIO standard deviations of the joint.
SPIKE_MEDIAN_RATIO, SPIKE_STD_RATIO = 30.0, 3.0
#: BLOCK_SIZE: samples of a long recording that are fitted at once.
BLOCK_SIZE, MIN_BLOCK_CYCLES = 1 << 15, 20.0
#: MIN_CYCLES: for a scatter of its own at every phase; PRIOR_CYCLES: number of cycles as which the
#: scatter of all phases counts there, as that of a few may be small by chance.
MIN_CYCLES, PRIOR_CYCLES = 4, 4


@dataclass(frozen=True, eq=False, repr=False)
class PhaseAverage(ShortRepr):
    """Mean cycles.

    Attributes:
        zero: phase that becomes 0, cycles.
        coefficients: c_n of ``x = Re(c_0 + 2 sum c_n exp(2 pi i n theta))`` for each joint, rad,
            complex, shape (n + 1, joints).
        spread: standard deviation of a cycle about the mean, rad, (joints, m).
        error: standard error of the mean, rad, (joints, m).
        spikes: number of samples dropped, (joints,).
        residual: variance about the mean over all variance, (joints,).

    """

    zero: float
    coefficients: np.ndarray
    spread: np.ndarray
    error: np.ndarray
    spikes: np.ndarray
    residual: np.ndarray

    def mean(self, theta: np.ndarray) -> np.ndarray:
        """Return the mean cycles at theta in cycles, shape (joints, m)."""
        return evaluate_coefficients(self.coefficients, theta)


def blocks(phases: np.ndarray) -> list[slice]:
    """Cut a long recording into parts of many cycles each, to limit memory."""
    count = min(-(-phases.size // BLOCK_SIZE), int((phases[-1] - phases[0]) / MIN_BLOCK_CYCLES))
    edges = np.linspace(0, phases.size, max(count, 1) + 1).astype(int)
    return [slice(low, high) for low, high in pairwise(edges)]


def mean_weights(x: np.ndarray, phases: np.ndarray, harmonics: int) -> np.ndarray:
    """Return the least-squares weights (2 n + 1, channels) of the series of x (channels, m).

    For a long recording, return the mean over its blocks.
    """
    parts = blocks(phases)
    return np.mean([fit_series(x[:, part], rows_of(phases[part], harmonics))
                    for part in parts], axis=0)


def average_cycles(phases: np.ndarray, positions: np.ndarray, theta: np.ndarray,
                   first: Sequence[int]
                   ) -> PhaseAverage:
    """Average cycles.

    Args:
        phases: of the samples in cycles, ascending, shape (n,).
        positions: shape (n, joints), nan where missing.
        theta: even points of a cycle for spread and error, shape (m,).
        first: joints, of which the one with the largest first harmonic gives phase 0.

    Raises:
        InputError: a joint has too few samples.

    """
    finite = np.isfinite(positions)
    joints = positions.shape[1]
    weights = np.zeros((2 * AVERAGE_HARMONICS + 1, joints))
    rests: list[tuple[np.ndarray, np.ndarray, int]] = [None] * joints  # type: ignore[list-item]
    spikes, residual = np.zeros(joints, dtype=int), np.zeros(joints)
    # Joints that come in the same messages have the same samples.
    groups: dict[bytes, list[int]] = {}
    for joint, column in enumerate(np.packbits(finite, axis=0).T):
        groups.setdefault(column.tobytes(), []).append(joint)
    for columns in groups.values():
        mask = finite[:, columns[0]]
        # A view where it can be: a long recording is large.
        at, x = phases[mask], (positions.T if len(columns) == joints and mask.all()
                               else positions.T[np.ix_(columns, mask)])
        weights[:, columns], rest, bins = _fit(at, x)
        for row, joint in enumerate(columns):
            deviation, variance = np.abs(rest[row]), float(x[row].var())
            keep = deviation <= max(SPIKE_MEDIAN_RATIO * np.median(deviation),
                                    SPIKE_STD_RATIO * np.sqrt(variance))
            rests[joint] = at, rest[row], bins
            if not keep.all():
                weight, rows, size = _fit(at[keep], x[row:row + 1, keep])
                weights[:, joint], rests[joint] = weight[:, 0], (at[keep], rows[0], size)
            spikes[joint] = np.count_nonzero(~keep)
            residual[joint] = rests[joint][1].var() / max(variance, 1e-300)
    c = coefficients_of(weights)
    first_harmonic = c[1, list(first)]
    zero = -float(np.angle(first_harmonic[np.argmax(np.abs(first_harmonic))])) / (2.0 * np.pi)
    coefficients = c * np.exp(2j * np.pi * zero * np.arange(len(c)))[:, None]
    scatter = [_scatter(at - zero, rest, bins, theta) for at, rest, bins in rests]
    spread, error = (np.array(values) for values in zip(*scatter, strict=True))
    return PhaseAverage(zero, coefficients, spread, error, spikes, residual)


def _fit(phases: np.ndarray, x: np.ndarray) -> tuple[np.ndarray, np.ndarray, int]:
    """Fit the series of joints with the same samples; return weights, rest and its bins."""
    n = min(resolvable_harmonics(phases - phases[0], 1.0),
            AVERAGE_HARMONICS) if phases.size > 4 else 0
    if n < 1:
        raise InputError(f'{phases.size} samples leave too much of the cycle empty')
    fit = mean_weights(x, phases, n)
    rest = np.empty_like(x)
    for part in blocks(phases):
        rest[:, part] = x[:, part] - evaluate_series(fit, rows_of(phases[part], n))
    weights = np.zeros((2 * AVERAGE_HARMONICS + 1, len(x)))
    weights[:1 + n], weights[1 + AVERAGE_HARMONICS:1 + AVERAGE_HARMONICS
                             + n] = fit[:1 + n], fit[1 + n:]
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
    square = (np.full(bins, pooled) if np.median(number) < MIN_CYCLES
              else (square + PRIOR_CYCLES * pooled) / (free + PRIOR_CYCLES))
    spread = np.sqrt(square)
    error = np.sqrt(square / np.maximum(number, 1) + middle**2)
    centres = (np.arange(bins) + 0.5) / bins
    return (np.interp(theta % 1.0, centres, spread, period=1.0),
            np.interp(theta % 1.0, centres, error, period=1.0))
