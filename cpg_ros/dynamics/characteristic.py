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

"""Characteristic roots of a linear equation with a delay, ``h' = L0 h(t) + L1 h(t - tau)``.

There ``Delta(lambda) = lambda - L0 - L1 exp(-lambda tau)`` is singular. Without a delay they are
eigenvalues. With one variable ``(lambda - A) tau`` is a branch of Lambert's W at
``B tau exp(-A tau)``: ``lambda_n = A + W_n(B tau exp(-A tau)) / tau``, whose real parts fall as n
goes from 0 to either side. With several variables they are eigenvalues of the infinitesimal
generator on Chebyshev points (Breda, Maset & Vermiglio 2005), refined by Newton's method on
det Delta.
"""

import cmath
import math

import numpy as np
import scipy

#: Distance from the unit circle, and from the axis, that is due to rounding.
CIRCLE_TOLERANCE = 1e-7


def frequencies(a: complex, b: complex) -> list[float]:
    """Return omega > 0 of the crossings, ``Im A +- sqrt(|B|^2 - (Re A)^2)``, fast one first."""
    square = abs(b)**2 - a.real**2
    if square <= 0.0:
        return []
    return [omega for omega in (a.imag + math.sqrt(square), a.imag - math.sqrt(square))
            if omega > 0.0]


def critical_delay(a: complex, b: complex, omega: float) -> float:
    """Return the smallest critical delay, ``(-arg((i omega - A)/B) mod 2 pi) / omega``."""
    return _delay((1j * omega - a) / b, omega)


def _delay(z: complex, omega: float) -> float:
    return -cmath.phase(z) % (2.0 * math.pi) / omega


def delay_crossings(now: np.ndarray, past: np.ndarray) -> list[tuple[float, float]]:
    """Return omega > 0 and the smallest delay of every crossing, the fast ones first.

    Further crossings at the same omega follow at multiples of 2 pi / omega.

    Args:
        now: L0, shape (n, n).
        past: L1, shape (n, n).

    """
    if len(now) == 1:
        a, b = complex(now[0, 0]), complex(past[0, 0])
        return [(omega, critical_delay(a, b, omega)) for omega in frequencies(a, b)]
    unit = np.eye(len(now))
    crossings: list[tuple[float, float]] = []
    first, middle, last = (np.kron(past, unit),
                           np.kron(now, unit) + np.kron(unit, now.conj()),
                           np.kron(unit, past.conj()))
    size = len(first)
    # z^2 first + z middle + last = 0, written for (v, z v).
    left = np.block([[np.zeros((size, size)), np.eye(size)], [-last, -middle]])
    right = np.block([[np.eye(size), np.zeros((size, size))], [np.zeros((size, size)), first]])
    with np.errstate(all='ignore'):
        values = scipy.linalg.eigvals(left, right)
    for z in values[np.isfinite(values) & (np.abs(np.abs(values) - 1.0) < CIRCLE_TOLERANCE)]:
        z = complex(z / abs(z))
        for root in np.linalg.eigvals(now + past * z):
            close = CIRCLE_TOLERANCE * (1.0 + abs(root))
            crossing = ((float(root.imag), _delay(z, float(root.imag)))
                        if root.imag > close else None)
            if crossing and abs(root.real) < close and not any(
                    np.allclose(crossing, other, 1e-6, 0.0) for other in crossings):
                crossings.append(crossing)
    return sorted(crossings, reverse=True)


#: Exponent above which exp overflows, so that W is computed from a logarithm.
MAX_EXPONENT = 690.0
#: Numbers of Chebyshev points; relative change by Newton's method up to which a root is resolved.
MIN_POINTS, MAX_POINTS, NEWTON_TOLERANCE = 24, 192, 1e-6
#: Roots computed first in the search for all to the right of a line.
NUM_ROOTS = 9


def rightmost_first(values: np.ndarray) -> np.ndarray:
    """Sort roots by descending real part; of a pair, positive imaginary part first."""
    scale = np.abs(values[np.isfinite(values)]).max(initial=0.0) or 1.0
    return values[np.lexsort((-values.imag, -np.round(values.real / scale, 12)))]


def characteristic_roots(now: np.ndarray, past: np.ndarray, delay: float, count: int,
                         real: bool = False) -> np.ndarray:
    """Return the rightmost roots, 1/model time.

    Args:
        now: L0, shape (n, n).
        past: L1, shape (n, n).
        delay: tau, model time, not negative.
        count: number of roots.
        real: whether the matrices are real, whatever their type.

    Returns:
        Complex numbers by falling real part, shape (count,), or all if there are fewer.

    """
    if real:
        now, past = now.real, past.real
    if delay == 0.0 or not past.any():
        roots = np.linalg.eigvals(now + past).astype(complex)
    elif len(now) == 1:
        a, b = complex(now[0, 0]), complex(past[0, 0])
        roots = a + _branches(a, b, delay, np.arange(-count, count + 1)) / delay
        return roots[np.argsort(-roots.real, kind='stable')][:count]
    else:
        roots = _discretised(now, past, delay, count)
    return rightmost_first(roots)[:count]


def roots_right_of(bound: float, now: np.ndarray, past: np.ndarray, delay: float,
                   real: bool = False) -> np.ndarray:
    """Return all roots whose real part is above a bound, by descending real part."""
    count = NUM_ROOTS
    while True:
        roots = characteristic_roots(now, past, delay, count, real)
        if len(roots) < count or roots[-1].real <= bound:
            return roots[roots.real > bound]
        count *= 2


def characteristic_matrix(root: complex, now: np.ndarray, past: np.ndarray, delay: float
                          ) -> tuple[np.ndarray, np.ndarray]:
    """Return Delta and its derivative ``1 + tau L1 exp(-lambda tau)``, shapes (n, n)."""
    unit, late = np.eye(len(now)), past * np.exp(-root * delay)
    return root * unit - now - late, unit + delay * late


def _branches(a: complex, b: complex, tau: float, n: np.ndarray) -> np.ndarray:
    """W_n(b tau exp(-a tau)), shape like n."""
    exponent = -a * tau
    if abs(exponent.real) <= MAX_EXPONENT:
        return scipy.special.lambertw(b * tau * np.exp(exponent), n)
    # W_n(z) = L - log L + ... with L = log z + 2 pi i n large (Corless et al. 1996);
    # Newton's method on w + log w = L, whatever the sheet of the logarithm.
    argument = np.angle(b * np.exp(1j * exponent.imag))
    target = np.log(abs(b) * tau) + exponent.real + 1j * (argument + 2.0 * np.pi * n)
    w = target - np.log(target)
    for _ in range(6):
        gap = w + np.log(w) - target
        w = w - (gap - 2j * np.pi * np.round(gap.imag / (2.0 * np.pi))) / (1.0 + 1.0 / w)
    return w if exponent.real > 0.0 else np.where(n == 0, 0.0, w)


def chebyshev(degree: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return Chebyshev points of [0, 1], the derivative matrix there, and barycentric weights."""
    k = np.arange(degree + 1)
    points = 0.5 * (1.0 - np.cos(np.pi * k / degree))
    weights = (-1.0) ** k
    weights[[0, -1]] *= 0.5
    gaps = points[:, None] - points + np.eye(degree + 1)
    matrix = weights / weights[:, None] / gaps
    np.fill_diagonal(matrix, 0.0)
    np.fill_diagonal(matrix, -matrix.sum(axis=1))
    return points, matrix, weights


def _generator(now: np.ndarray, past: np.ndarray, delay: float, points: int) -> np.ndarray:
    """Return the generator on Chebyshev points of [-tau, 0], the n components at 0 first."""
    n, slope = len(now), chebyshev(points)[1][::-1, ::-1]
    whole = np.kron(slope / delay, np.eye(n)).astype(now.dtype)
    whole[:n] = 0.0
    whole[:n, :n] = now
    whole[:n, -n:] += past
    return whole


def _discretised(now: np.ndarray, past: np.ndarray, delay: float, count: int) -> np.ndarray:
    """Return at least count rightmost roots, with more points until these are resolved."""
    points = max(MIN_POINTS, 2 * count)
    while True:
        rough = rightmost_first(np.linalg.eigvals(
            _generator(now, past, delay, points)).astype(complex))[:count + 1]
        exact = np.array([_refined(root, now, past, delay) for root in rough])
        moved = np.abs(exact - rough) <= NEWTON_TOLERANCE * (1.0 + np.abs(exact))
        if moved.all() or points >= MAX_POINTS:
            return exact
        points *= 2


def _refined(root: complex, now: np.ndarray, past: np.ndarray, delay: float) -> complex:
    """Newton's method on det Delta, whose logarithm has the slope tr(Delta^-1 Delta')."""
    for _ in range(8):
        matrix, slope = characteristic_matrix(root, now, past, delay)
        try:
            move = 1.0 / np.trace(np.linalg.solve(matrix, slope))
        except np.linalg.LinAlgError:
            break
        if not abs(move) < 0.1 * (1.0 + abs(root)):
            break
        root -= move
        if abs(move) < 1e-14 * (1.0 + abs(root)):
            break
    return complex(root)
