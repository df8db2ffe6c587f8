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

"""Trigonometric collocation on one period: n odd, nodes theta_m = m / n, theta in cycles."""

from functools import lru_cache

import numpy as np


def _waves(n: int) -> np.ndarray:
    """Return the factors by which d/dtheta multiplies the harmonics, shape ((n + 1) / 2,)."""
    return 2j * np.pi * np.arange((n + 1) // 2)


@lru_cache(maxsize=16)
def _circulant(n: int) -> np.ndarray:
    """Which entry of a column each entry of its circulant matrix is, shape (n, n)."""
    return (np.arange(n)[:, None] - np.arange(n)) % n


@lru_cache(maxsize=16)
def derivative_matrix(n: int) -> np.ndarray:
    """Matrix of d/dtheta on nodal values, shape (n, n)."""
    return np.fft.irfft(_waves(n), n)[_circulant(n)]


@lru_cache(maxsize=16)
def shift_matrix(n: int, shift: float) -> np.ndarray:
    """Matrix that takes nodal values of u to those of u(theta + shift), shape (n, n)."""
    return np.fft.irfft(np.exp(_waves(n) * shift), n)[_circulant(n)]


def evaluate(values: np.ndarray, theta: np.ndarray, order: int = 0,
             shifts: np.ndarray | None = None) -> np.ndarray:
    """Evaluate the interpolant, or its derivative of the given order in theta.

    Args:
        values: nodal values, shape (n,).
        theta: where, in cycles, any shape.
        order: 0 for the value, 1 and 2 for derivatives.
        shifts: phases to add in turn, in cycles, shape (m,), or none.

    Returns:
        An array of shape theta.shape, or theta.shape + (m,) with shifts.

    """
    coefficients = np.fft.rfft(values) / values.size
    coefficients[1:] *= 2.0
    factor = 2j * np.pi * np.arange(coefficients.size)
    coefficients *= factor**order
    if shifts is not None:
        coefficients = coefficients[:, None] * np.exp(np.outer(factor, shifts))
    waves = np.exp(np.multiply.outer(np.asarray(theta, dtype=float), factor))
    return (waves @ coefficients).real


def tail(values: np.ndarray) -> float:
    """Largest of the last six harmonics over the largest of all: how well it is resolved."""
    size = np.abs(np.fft.rfft(values))
    return float(size[-6:].max() / (size.max() or 1.0))


def resample(values: np.ndarray, n: int) -> np.ndarray:
    """Nodal values on n nodes, more than there are, of the same interpolant."""
    return np.fft.irfft(np.fft.rfft(values), n) * (n / values.size)
