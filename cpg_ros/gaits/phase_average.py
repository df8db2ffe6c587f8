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

"""The mean cycle of a motion whose phase is known, and how far each cycle is from it.

The mean is a harmonic series fitted to a joint's own samples at their phases: nothing is
interpolated across dropouts, and times may be as uneven as they like. Scatter is taken from what
it leaves, averaged in as many bins of a cycle as the series has terms.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

from cpg_ros.errors import InputError
from cpg_ros.gaits.mean_cycle import (
    coefficients_of,
    evaluate_coefficients,
    evaluate_series,
    fit_series,
    resolvable_harmonics,
    rows_of,
)
from cpg_ros.short_repr import ShortRepr
import numpy as np

#: Most harmonics of a mean cycle.
HARMONICS = 24
#: Samples further off than this many times the median distance, and than this many standard
#: deviations of the joint, are none of the motion (spikes).
FAR, WILD = 30.0, 3.0
#: Samples of a long recording that are fitted at once, and fewest cycles in them.
BLOCK, CYCLES = 1 << 15, 20.0
#: Fewest cycles for the scatter to be estimated at every phase by itself, and as how many cycles
#: that of all phases together counts there: that of a few may be small by chance.
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
    weights = np.zeros((2 * HARMONICS + 1, joints))
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
    spread, error = (np.array(one) for one in zip(*scatter, strict=True))
    return PhaseAverage(zero, turned, spread, error, there.sum(axis=0) - spikes, spikes, left)


def _fitted(phases: np.ndarray, x: np.ndarray) -> tuple[np.ndarray, np.ndarray, int]:
    """Fit the series of joints with the same samples; return weights, rest and its bins."""
    n = min(resolvable_harmonics(phases - phases[0], 1.0), HARMONICS) if phases.size > 4 else 0
    if n < 1:
        raise InputError(f'{phases.size} samples leave too much of the cycle empty')
    some = mean_weights(x, phases, n)
    rest = np.empty_like(x)
    for part in blocks(phases):
        rest[:, part] = x[:, part] - evaluate_series(some, rows_of(phases[part], n))
    weights = np.zeros((2 * HARMONICS + 1, len(x)))
    weights[:1 + n], weights[1 + HARMONICS:1 + HARMONICS + n] = some[:1 + n], some[1 + n:]
    return weights, rest, 2 * n + 1


def _scatter(phases: np.ndarray, rest: np.ndarray, bins: int, theta: np.ndarray
             ) -> tuple[np.ndarray, np.ndarray]:
    """Return spread and standard error at theta from what one joint's samples leave."""
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
