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

"""Which gait is this? The spatio-temporal symmetry of a recorded or simulated rhythm.

A symmetry g with shift theta means ``x_{g(i)}(t) = x_i(t + theta T)`` for every cell (Buono &
Golubitsky 2001, section 2.1). Here its violation is measured, for every g and theta, on the
mean cycle; H and K are what is violated by less than the tolerance and forms a homomorphism.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction

from cpg_ros.errors import InputError
from cpg_ros.gaits.mean_cycle import HarmonicCycle, mean_cycle
from cpg_ros.gaits.period import find_period, holds_two
from cpg_ros.gaits.waveform_comparison import best_shift
from cpg_ros.networks.hk_theorem import symmetries
from cpg_ros.networks.symmetry import Group, Permutation, Symmetry
from cpg_ros.short_repr import ShortRepr
import numpy as np

#: Fewest samples of a rhythm.
FEWEST = 8
#: Largest distance of a symmetry that holds in whatever noise; the distance, in what noise and
#: tolerance explain, at which a gait is as likely as none; and the largest distance of several in
#: noise, over the usual.
MOST, NONE, LARGER = 0.3, 3.0, 1.25


@dataclass(frozen=True, eq=False, repr=False)
class Recognition(ShortRepr):
    """What a rhythm is.

    Distances are the RMS violation of a symmetry over cells and cycle, in units of the
    signals' RMS about their means: 0 where it holds, 1.4 where nothing does.

    Attributes:
        name: the gait, or None if no named one is within the tolerance.
        nearest: the gait; if there is none, the one with the smallest distance, or one that
            includes its symmetry at a distance larger by no more than the tolerance.
        distance: of the nearest gait, the largest over the elements of its H.
        margin: how much larger the distance of the second is; inf if there is none, negative
            if it fits better with a smaller H.
        second: the best of the named gaits whose symmetry is not part of the nearest one's, or
            None if there is none.
        noise: what noise alone makes of a distance, by what the mean cycle leaves.
        confidence: probability that it is the nearest gait, not another nor none of them.
        period: in the unit of the times.
        phases: of the cells against cell 1 in cycles, [0, 1), shape (cells,): the shift of best
            correlation; between different waveforms it is no more than that. Cells to which H
            gives one waveform are compared with the first of them.
        h: names of the elements of H, the largest consistent set within the tolerance.
        k: those among them with shift 0.
        distances: element name -> (its best shift in cycles, its distance there). An element
            below the tolerance that h lacks fits no homomorphism with the others.

    """

    name: str | None
    nearest: str
    distance: float
    margin: float
    second: str | None
    noise: float
    confidence: float
    period: float
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
    return round(best_shift(cross)[0] % 1.0, 12) % 1.0


class _Violations:
    """Distances of a mean cycle from the symmetries of a group."""

    def __init__(self, coefficients: np.ndarray, group: Group) -> None:
        self.coefficients, self.elements = coefficients, group.elements
        self._n = np.arange(len(coefficients))
        # Of a real series: every coefficient but the mean counts twice.
        self._weights = np.where(self._n > 0, 2.0, 1.0)[:, None]
        self._power = np.sum(2.0 * np.abs(coefficients[1:]) ** 2)
        self._known: dict[tuple[str, Fraction], float] = {}

    def at(self, element: Permutation, shift: float) -> float:
        turned = self.coefficients * np.exp(2j * np.pi * self._n * shift)[:, None]
        apart = np.abs(self.coefficients[:, list(element)] - turned)
        return float(np.sqrt(np.sum(self._weights * apart * apart) / self._power))

    def best(self, element: Permutation) -> tuple[float, float]:
        shift = _best_shift(self.coefficients[:, list(element)], self.coefficients)
        return shift, self.at(element, shift)

    def of(self, symmetry: Symmetry) -> float:
        """Return the largest distance over the elements of H."""
        for name, shift in symmetry.shifts:
            if (name, shift) not in self._known:
                self._known[name, shift] = self.at(self.elements[name], float(shift))
        return max(self._known[one] for one in symmetry.shifts)


def _checked(t: np.ndarray, signals: np.ndarray, group: Group, gaits: Mapping[str, Symmetry],
             period: float | None, tolerance: float) -> None:
    if t.ndim != 1 or signals.shape != (t.size, group.cells):
        raise ValueError(f'signals have the shape {signals.shape}, times {t.shape}; '
                         f'{group.cells} cells need (m, {group.cells}) and (m,)')
    if t.size < FEWEST:
        raise InputError(f'{t.size} samples are not enough, at least {FEWEST} are needed')
    for name, values in (('t', t), ('signals', signals)):
        if not np.isfinite(values).all():
            raise InputError(f'{name} holds {np.count_nonzero(~np.isfinite(values))} values '
                             f'that are not finite')
    if not (np.diff(t) > 0.0).all():
        late = int(np.argmin(np.diff(t) > 0.0))
        raise InputError(f't does not increase: {t[late]:g} is followed by {t[late + 1]:g}')
    spread = signals.std(axis=0)
    still = np.flatnonzero(spread <= np.maximum(1e-6 * spread.max(),
                                                1e-12 * np.abs(signals).max()))
    if still.size:
        raise ValueError(f'channel {still[0] + 1} is constant')
    if not gaits:
        raise ValueError('gaits is empty')
    for name, gait in gaits.items():
        if gait.group != group:
            raise ValueError(f'the gait {name!r} belongs to another group')
    if not (np.isfinite(tolerance) and tolerance > 0.0):
        raise InputError(f'tolerance is {tolerance}, it must be positive')
    if period is not None and not (np.isfinite(period) and period > 0.0):
        raise InputError(f'period is {period}, it must be positive')
    if period is not None and not holds_two(t, period):
        raise InputError(f'the recording lasts {t[-1] - t[0]:g}, less than two periods of '
                         f'{period:g}')


def recognise(t: np.ndarray, signals: np.ndarray, group: Group, gaits: Mapping[str, Symmetry],
              period: float | None = None, tolerance: float = 0.05) -> Recognition:
    """Find the symmetry of a rhythm, and the named gait that has it.

    Of several gaits within the tolerance the one with the largest H is meant, and among those
    the one that fits best: every walk is also a skip, which has fewer symmetries.

    Args:
        t: increasing times, evenly or unevenly spaced, shape (m,).
        signals: the first variable of each cell, shape (m, cells).
        group: of the network.
        gaits: name -> symmetry, of that group. A wave and the same one run backwards count as
            two gaits.
        period: in the unit of t; found if not given.
        tolerance: largest distance of a symmetry that holds; see Recognition. What noise makes
            of a distance comes on top.

    Raises:
        InputError: a value is not finite, t does not increase, a channel is constant, or there
            are fewer than two periods or too few samples.
        ValueError: shapes do not fit, or gaits do not belong to the group.

    """
    t, signals = np.asarray(t, dtype=float), np.asarray(signals, dtype=float)
    _checked(t, signals, group, gaits, period, tolerance)
    if period is None:
        period = find_period(t, signals)
    whole = mean_cycle(t, signals, period)
    cycle = whole.coefficients
    violations, noise = _Violations(cycle, group), _noise(whole, t.size)
    alone = tolerance
    tolerance = min(float(np.hypot(alone, LARGER * noise)), max(MOST, alone))
    # Out of all homomorphisms, so that what is found is a group and its shifts are consistent.
    found = max((one for one in symmetries(group) if violations.of(one) <= tolerance),
                key=lambda one: (len(one.h), -violations.of(one)))
    apart = {name: violations.of(gait) for name, gait in gaits.items()}
    best = min(gaits, key=apart.__getitem__)
    known = apart[best] <= tolerance
    # A gait that includes another has more constraints and fits no better; that is no demerit.
    fitting = [name for name, gait in gaits.items()
               if (apart[name] <= tolerance if known else apart[name] <= apart[best] + tolerance
                   and set(gait.shifts) >= set(gaits[best].shifts))]
    nearest = min(fitting, key=lambda name: (-len(gaits[name].h), apart[name],
                                             -len(gaits[name].k)))
    others = [name for name, gait in gaits.items()
              if not set(gait.shifts) <= set(gaits[nearest].shifts)]
    second = min(others, key=apart.__getitem__, default=None)
    sure = _sure(apart[nearest], [apart[name] for name in others], float(np.hypot(alone, noise)))
    return Recognition(nearest if known else None, nearest, apart[nearest],
                       apart[second] - apart[nearest] if second is not None else np.inf, second,
                       noise, sure, period, _phases(cycle, found), found.h, found.k,
                       {name: violations.best(element)
                        for name, element in group.elements.items()})


def _phases(cycle: np.ndarray, symmetry: Symmetry) -> np.ndarray:
    """Return the phases of the cells against cell 1 in cycles, [0, 1).

    Two waveforms may correlate equally well at several shifts, among which noise would choose
    anew for each cell.
    """
    first = [int(np.argmax(symmetry.waves == wave)) for wave in symmetry.waves]
    ahead = {cell: _best_shift(cycle[:, [cell]], cycle[:, :1]) for cell in set(first)}
    phases = [ahead[head] + _best_shift(cycle[:, [cell]], cycle[:, [head]])
              for cell, head in enumerate(first)]
    # As in _best_shift: a rounding error below 1 is 0.
    return np.round(phases, 12) % 1.0


def _noise(cycle: HarmonicCycle, samples: int) -> float:
    """Distance that noise makes where a symmetry holds: two cells have it, in every term."""
    terms, left = 2 * len(cycle.coefficients) - 1, min(cycle.residual, 0.999)**2
    return float(np.sqrt(2.0 * terms / samples * left / (1.0 - left)))


def _sure(nearest: float, others: Sequence[float], scatter: float) -> float:
    """Probability of the nearest gait, from distances and their scatter; none is one of them."""
    odds = [np.exp(-0.5 * (other**2 - nearest**2) / scatter**2) for other in others]
    none = np.exp(min(0.5 * ((nearest / scatter)**2 - NONE**2), 30.0))
    return float(1.0 / (1.0 + sum(odds) + none))
