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

"""Comparing waveforms: how far one lags another, how much they differ, how steadily they turn."""

import numpy as np

TURN = 2.0 * np.pi
#: Places of a cycle at which shifts are tried; a mean cycle has far fewer harmonics.
GRID = 1024
#: Centres that are tried in each direction, over the middle part of a closed curve's extent.
CENTRES = np.linspace(-0.6, 0.6, 13)


def lag(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Shift theta in cycles, -0.5 to 0.5, that brings b(t + theta) nearest to a(t).

    The largest circular cross-correlation, refined by Newton's method on its Fourier series: no
    single harmonic or extreme decides.

    Args:
        a: waveforms on even points of a cycle, shape (..., m).
        b: others, of the same shape.

    Returns:
        The shifts, shape (...).

    """
    m = a.shape[-1]
    cross = np.fft.rfft(a) * np.fft.rfft(b).conj()
    cross[..., 0] = 0.0
    k = np.arange(cross.shape[-1])
    theta = -np.fft.irfft(cross, m).argmax(axis=-1) / m
    for _ in range(4):
        turned = cross * np.exp(-TURN * 1j * k * theta[..., None])
        slope, bend = turned.imag @ k, -TURN * (turned.real @ (k * k))
        peak = bend < 0.0
        step = np.clip(slope / np.where(peak, bend, 1.0), -0.5 / m, 0.5 / m)
        theta = theta - np.where(peak, step, 0.0)
    return (theta + 0.5) % 1.0 - 0.5


def best_shift(terms: np.ndarray) -> tuple[float, float]:
    """Return the shift of the largest cross-correlation, in cycles, and the correlation there.

    Refined by Newton's method from the best place of an even grid.

    Args:
        terms: of the cross-correlation by order, complex, shape (n + 1,): those of the first
            signal times the conjugate ones of the second, the constant 0. The first is ahead by
            the shift.

    """
    turn = 2j * np.pi * np.arange(terms.size)
    theta = float(np.argmax(np.fft.fft(terms, GRID).real)) / GRID
    at = theta
    for _ in range(8):
        there = terms * np.exp(-turn * theta)
        slope, bend = -np.sum(turn * there).real, np.sum(turn * turn * there).real
        if bend < 0.0:
            theta = float(np.clip(theta - slope / bend, at - 1.0 / GRID, at + 1.0 / GRID))
    return theta, float(np.sum(terms * np.exp(-turn * theta)).real)


def shifted(a: np.ndarray, theta: float) -> np.ndarray:
    """a(t + theta), theta in cycles, by its Fourier series."""
    terms = np.fft.rfft(a)
    return np.fft.irfft(terms * np.exp(TURN * 1j * np.arange(terms.size) * theta), a.size)


def shape_difference(a: np.ndarray, b: np.ndarray, plain: bool = False) -> float:
    """How much two waveforms differ, whatever their shift: the smallest RMS over all shifts.

    Args:
        a: a waveform on even points of a cycle, shape (m,).
        b: another one.
        plain: compare them as they are, over the RMS of the stronger one about its mean; by
            default both are first given mean 0 and RMS 1, so that only shape counts.

    """
    sizes = a.std(), b.std()
    if min(sizes) == 0.0:
        return 0.0 if max(sizes) == 0.0 else 1.0
    if plain:
        return float(np.sqrt(np.mean((a - shifted(b, float(lag(a, b))))**2)) / max(sizes))
    a, b = (a - a.mean()) / sizes[0], (b - b.mean()) / sizes[1]
    return float(np.sqrt(np.mean((a - shifted(b, float(lag(a, b))))**2)))


def steadiness(v: np.ndarray, w: np.ndarray) -> float:
    """Smallest angular speed, over its mean, at which a closed curve turns about a centre.

    The best of the centres tried; both variables are scaled to run from -1 to 1. At most 1; not
    positive where the curve turns back somewhere or turns twice, so that the angle does not tell
    the phase.

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
    once = np.abs(speed.sum(-1) - TURN) < np.pi
    return float(np.where(once, speed.min(-1), -1.0).max()) * v.size / TURN
