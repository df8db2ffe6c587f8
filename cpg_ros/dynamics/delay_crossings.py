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

"""Where the roots of ``h' = L0 h(t) + L1 h(t - tau)`` cross the imaginary axis, in closed form.

The linearisation in a symmetry class (docs/theory.md). With one variable a root i omega of
``lambda = A + B exp(-lambda tau)`` has ``|i omega - A| = |B|``, which is quadratic in omega. With
several, ``z = exp(-i omega tau)`` makes i omega an eigenvalue of ``L0 + L1 z`` and -i omega one of
its conjugate, so their Kronecker sum is singular: a quadratic eigenvalue problem for z, of which
those on the unit circle count (Chen, Gu & Nett 1995).
"""

import cmath
import math

import numpy as np
import scipy

#: How far from the unit circle, and from the axis, a solution may lie by rounding.
ON_CIRCLE = 1e-7


def frequencies(a: complex, b: complex) -> list[float]:
    """Return omega > 0 of the crossings, ``Im A +- sqrt(|B|^2 - (Re A)^2)``, fast one first."""
    square = abs(b)**2 - a.real**2
    if square <= 0.0:
        return []
    return [omega for omega in (a.imag + math.sqrt(square), a.imag - math.sqrt(square))
            if omega > 0.0]


def critical_delay(a: complex, b: complex, omega: float, n: int = 0) -> float:
    """Return ``tau_n = (-arg((i omega - A)/B) mod 2 pi + 2 pi n) / omega``."""
    return _delay((1j * omega - a) / b, omega, n)


def _delay(z: complex, omega: float, n: int) -> float:
    return (-cmath.phase(z) % (2.0 * math.pi) + 2.0 * math.pi * n) / omega


def delay_crossings(now: np.ndarray, past: np.ndarray) -> list[tuple[float, float]]:
    """Return omega > 0 and the smallest delay of every crossing, the fast ones first.

    The others with the same omega have delays that are longer by multiples of 2 pi / omega.

    Args:
        now: L0, shape (n, n).
        past: L1, shape (n, n).

    """
    if len(now) == 1:
        a, b = complex(now[0, 0]), complex(past[0, 0])
        return [(omega, critical_delay(a, b, omega)) for omega in frequencies(a, b)]
    unit = np.eye(len(now))
    found: list[tuple[float, float]] = []
    first, middle, last = (np.kron(past, unit),
                           np.kron(now, unit) + np.kron(unit, now.conj()),
                           np.kron(unit, past.conj()))
    size = len(first)
    # z^2 first + z middle + last = 0, written for (v, z v).
    left = np.block([[np.zeros((size, size)), np.eye(size)], [-last, -middle]])
    right = np.block([[np.eye(size), np.zeros((size, size))], [np.zeros((size, size)), first]])
    with np.errstate(all='ignore'):
        values = scipy.linalg.eigvals(left, right)
    for z in values[np.isfinite(values) & (np.abs(np.abs(values) - 1.0) < ON_CIRCLE)]:
        z = complex(z / abs(z))
        for root in np.linalg.eigvals(now + past * z):
            close = ON_CIRCLE * (1.0 + abs(root))
            one = (float(root.imag), _delay(z, float(root.imag), 0)) if root.imag > close else None
            if one and abs(root.real) < close and not any(
                    np.allclose(one, other, 1e-6, 0.0) for other in found):
                found.append(one)
    return sorted(found, reverse=True)
