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

"""Gait recognition: the spatio-temporal symmetry of a recorded or simulated rhythm.

A symmetry g with shift theta means ``x_{g(i)}(t) = x_i(t + theta T)`` for every cell (Buono &
Golubitsky 2001, section 2.1). Its violation is measured for every g and theta on one cycle; H
and K are the symmetries whose violation is below the tolerance, as a homomorphism.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from fractions import Fraction

from cpg_ros.common.errors import InputError, ShortRepr
from cpg_ros.networks.symmetry import Group, Permutation, symmetries, Symmetry
import numpy as np

# Comparison of waveforms: their lag, their difference in shape, the steadiness of their turning.

TWO_PI = 2.0 * np.pi
#: GRID_SIZE: shifts of a cycle that are tried; a mean cycle has far fewer harmonics.
GRID_SIZE, NEWTON_ITERATIONS = 1024, 6
#: CENTRES: centres of a closed curve that are tried in each direction, over half its extent.
CENTRES = np.linspace(-0.6, 0.6, 13)


def best_shift(terms: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the shift of the largest cross-correlation, cycles, and the correlation there.

    Newton's method refines the maximum on an even grid.

    Args:
        terms: of the cross-correlation by order, complex, shape (..., n + 1): those of the first
            signal times the conjugate ones of the second, the constant 0. The first leads by the
            shift.

    Returns:
        Two arrays of shape (...).

    """
    k = np.arange(terms.shape[-1])
    start = np.fft.fft(terms, GRID_SIZE).real.argmax(axis=-1) / GRID_SIZE
    theta = start
    for _ in range(NEWTON_ITERATIONS):
        shifted_terms = terms * np.exp(-TWO_PI * 1j * k * theta[..., None])
        slope, bend = shifted_terms.imag @ k, -TWO_PI * (shifted_terms.real @ (k * k))
        peak = bend < 0.0
        theta = np.clip(theta - np.where(peak, slope / np.where(peak, bend, 1.0), 0.0),
                        start - 1.0 / GRID_SIZE, start + 1.0 / GRID_SIZE)
    return theta, np.sum(terms * np.exp(-TWO_PI * 1j * k * theta[..., None]), axis=-1).real


def lag(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Return the shift theta in cycles, -0.5 to 0.5, that brings b(t + theta) nearest to a(t).

    Args:
        a: waveforms on even points of a cycle, shape (..., m).
        b: others, of the same shape.

    Returns:
        The shifts, shape (...).

    """
    cross = np.fft.rfft(a) * np.fft.rfft(b).conj()
    cross[..., 0] = 0.0
    return (best_shift(cross)[0] + 0.5) % 1.0 - 0.5


def shifted(a: np.ndarray, theta: float) -> np.ndarray:
    """Return a(t + theta), theta in cycles, by its Fourier series."""
    terms = np.fft.rfft(a)
    return np.fft.irfft(terms * np.exp(TWO_PI * 1j * np.arange(terms.size) * theta), a.size)


def shape_difference(a: np.ndarray, b: np.ndarray, plain: bool = False) -> float:
    """Return the difference of two waveforms: the smallest RMS over all shifts.

    Args:
        a: waveform on even points of a cycle, shape (m,).
        b: another one.
        plain: compare unscaled waveforms, over the RMS of the stronger one about its mean; by
            default both are first given mean 0 and RMS 1.

    """
    sizes = a.std(), b.std()
    if min(sizes) == 0.0:
        return 0.0 if max(sizes) == 0.0 else 1.0
    if plain:
        return float(np.sqrt(np.mean((a - shifted(b, float(lag(a, b))))**2)) / max(sizes))
    a, b = (a - a.mean()) / sizes[0], (b - b.mean()) / sizes[1]
    return float(np.sqrt(np.mean((a - shifted(b, float(lag(a, b))))**2)))


def steadiness(v: np.ndarray, w: np.ndarray) -> float:
    """Return the smallest angular speed, over the mean, of a closed curve about a centre.

    It is the best over several centres, with both variables scaled to -1 to 1. It is at most 1,
    and not positive if the curve reverses or goes round twice, so that the angle does not
    determine the phase.

    Args:
        v: a cell's first variable on even points of a cycle, shape (m,).
        w: its second one.

    """
    if min(np.ptp(v), np.ptp(w)) == 0.0:
        return 0.0
    v, w = ((2.0 * q - q.max() - q.min()) / np.ptp(q) for q in (v, w))
    x, y = v - CENTRES[:, None, None], w - CENTRES[:, None]
    speed = (x * np.roll(y, -1, -1) - y * np.roll(x, -1, -1)) / (x * x + y * y)
    # About a centre outside the curve the sum is 0, and where it turns twice in a cycle 4 pi.
    one_turn = np.abs(speed.sum(-1) - TWO_PI) < np.pi
    return float(np.where(one_turn, speed.min(-1), -1.0).max()) * v.size / TWO_PI


MIN_POINTS = 8


@dataclass(frozen=True, eq=False, repr=False)
class Recognition(ShortRepr):
    """The gait of a rhythm, and its symmetry.

    Distances are the RMS violation of a symmetry over cells and cycle, in units of the signals'
    RMS about their means: 0 where it holds, 1.4 for unrelated signals.

    Attributes:
        name: of the gait, or None if no named one is within the tolerance.
        nearest: the gait or, if there is none, the one with the smallest distance, or one that
            includes its symmetry at a distance larger by no more than the tolerance.
        distance: of the nearest gait, the largest over the elements of its H.
        margin: additional distance of the second; inf if there is none, negative if it fits better
            with a smaller H.
        second: best of the named gaits whose symmetry is not part of the nearest one's, or None.
        phases: of the cells relative to cell 1 in cycles, [0, 1), shape (cells,): the shift of
            best correlation. Cells with one waveform under H are compared with the first of them.
        h: names of the elements of H, the largest consistent set within the tolerance.
        k: those among them with shift 0.
        distances: element name -> (best shift in cycles, distance). An element below the tolerance
            that is not in h fits no homomorphism with the others.

    """

    name: str | None
    nearest: str
    distance: float
    margin: float
    second: str | None
    phases: np.ndarray
    h: tuple[str, ...]
    k: tuple[str, ...]
    distances: dict[str, tuple[float, float]]


def _best_shift(ahead: np.ndarray, behind: np.ndarray) -> float:
    """Return theta in cycles with ahead(t) most like behind(t + theta T), [0, 1).

    Both are Fourier coefficients, shape (harmonics + 1, channels).
    """
    cross = np.sum(ahead * behind.conj(), axis=1)
    cross[0] = 0.0
    # A rounding error below 0 is 0, not 1.
    return round(float(best_shift(cross)[0]) % 1.0, 12) % 1.0


class _Violations:
    """Distances of a mean cycle from the symmetries of a group."""

    def __init__(self, coefficients: np.ndarray, group: Group) -> None:
        self.coefficients, self.elements = coefficients, group.elements
        self._n = np.arange(len(coefficients))
        # In a real series every coefficient but the mean counts twice.
        self._weights = np.where(self._n > 0, 2.0, 1.0)[:, None]
        self._power = np.sum(2.0 * np.abs(coefficients[1:]) ** 2)
        self._cache: dict[tuple[str, Fraction], float] = {}

    def at(self, element: Permutation, shift: float) -> float:
        target = self.coefficients * np.exp(2j * np.pi * self._n * shift)[:, None]
        difference = np.abs(self.coefficients[:, list(element)] - target)
        return float(np.sqrt(np.sum(self._weights * difference * difference) / self._power))

    def best(self, element: Permutation) -> tuple[float, float]:
        shift = _best_shift(self.coefficients[:, list(element)], self.coefficients)
        return shift, self.at(element, shift)

    def of(self, symmetry: Symmetry) -> float:
        """Return the largest distance over the elements of H."""
        for name, shift in symmetry.shifts:
            if (name, shift) not in self._cache:
                self._cache[name, shift] = self.at(self.elements[name], float(shift))
        return max(self._cache[element] for element in symmetry.shifts)


def _check(signals: np.ndarray, group: Group, gaits: Mapping[str, Symmetry], tolerance: float
           ) -> None:
    if signals.ndim != 2 or signals.shape[1] != group.cells:
        raise ValueError(f'signals have the shape {signals.shape}; {group.cells} cells need '
                         f'(m, {group.cells})')
    if len(signals) < MIN_POINTS:
        raise InputError(f'{len(signals)} points are not enough, at least {MIN_POINTS} are needed')
    if not np.isfinite(signals).all():
        raise InputError(f'signals holds {np.count_nonzero(~np.isfinite(signals))} values that '
                         'are not finite')
    std = signals.std(axis=0)
    constant = np.flatnonzero(std <= np.maximum(1e-6 * std.max(),
                                                1e-12 * np.abs(signals).max()))
    if constant.size:
        raise ValueError(f'channel {constant[0] + 1} is constant')
    if not gaits:
        raise ValueError('gaits is empty')
    for name, gait in gaits.items():
        if gait.group != group:
            raise ValueError(f'the gait {name!r} belongs to another group')
    if not (np.isfinite(tolerance) and tolerance > 0.0):
        raise InputError(f'tolerance is {tolerance}, it must be positive')


def recognise(signals: np.ndarray, group: Group, gaits: Mapping[str, Symmetry],
              tolerance: float = 0.05) -> Recognition:
    """Find the symmetry of one cycle of a rhythm, and the named gait that has it.

    Among several gaits within the tolerance, the one with the largest H is taken, and among those
    the one that fits best: every walk is also a skip, which has fewer symmetries.

    Args:
        signals: first variable of each cell on even points of one cycle, shape (m, cells).
        group: of the network.
        gaits: name -> symmetry, of that group. A wave and its reverse count as two gaits.
        tolerance: largest distance of a symmetry that holds; see Recognition.

    Raises:
        InputError: a value is not finite, or there are too few points.
        ValueError: shapes do not fit, a channel is constant, or gaits do not belong to the group.

    """
    signals = np.asarray(signals, dtype=float)
    _check(signals, group, gaits, tolerance)
    cycle = np.fft.rfft(signals, axis=0)[:(len(signals) + 1) // 2] / len(signals)
    violations = _Violations(cycle, group)
    # Search all homomorphisms, so that the result is a group with consistent shifts.
    symmetry = max((candidate for candidate in symmetries(group)
                    if violations.of(candidate) <= tolerance),
                key=lambda candidate: (len(candidate.h), -violations.of(candidate)))
    distances = {name: violations.of(gait) for name, gait in gaits.items()}
    best = min(gaits, key=distances.__getitem__)
    matches = distances[best] <= tolerance
    # A gait that includes another has more constraints and fits no better; that is no demerit.
    fitting = [name for name, gait in gaits.items()
               if (distances[name] <= tolerance if matches else distances[name] <= distances[best]
                   + tolerance and set(gait.shifts) >= set(gaits[best].shifts))]
    nearest = min(fitting, key=lambda name: (-len(gaits[name].h), distances[name],
                                             -len(gaits[name].k)))
    others = [name for name, gait in gaits.items()
              if not set(gait.shifts) <= set(gaits[nearest].shifts)]
    second = min(others, key=distances.__getitem__, default=None)
    return Recognition(nearest if matches else None, nearest, distances[nearest],
                       distances[second] - distances[nearest] if second is not None else np.inf,
                       second, _phases(cycle, symmetry), symmetry.h, symmetry.k,
                       {name: violations.best(element)
                        for name, element in group.elements.items()})


def _phases(cycle: np.ndarray, symmetry: Symmetry) -> np.ndarray:
    """Return the phases of the cells relative to cell 1 in cycles, [0, 1).

    Two waveforms may correlate equally well at several shifts, between which noise would decide
    for each cell.
    """
    first = [int(np.argmax(symmetry.waves == wave)) for wave in symmetry.waves]
    ahead = {cell: _best_shift(cycle[:, [cell]], cycle[:, :1]) for cell in set(first)}
    phases = [ahead[head] + _best_shift(cycle[:, [cell]], cycle[:, [head]])
              for cell, head in enumerate(first)]
    # As in _best_shift: a rounding error below 1 is 0.
    return np.round(phases, 12) % 1.0
