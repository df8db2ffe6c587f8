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

"""The signals of a gait that drive joints, as harmonics, and their derivatives by parameters.

The generator's joints are polynomials in x and in y, its derivative by phase in radians: x is the
cell over the gait's peak where that drives them (motion.readout), and the cell's waveform up to
a few harmonics, running from -1 to 1, where its phase does (motion.phase_readout). Both are
short Fourier series, ``x(theta) = Re sum_k terms_k exp(2 pi i k theta)``.
"""

from dataclasses import dataclass
from functools import lru_cache

from cpg_ros.dynamics.periodic import Orbit
from cpg_ros.motion.phase_readout import evaluate, POINTS, smooth_terms
from cpg_ros.short_repr import ShortRepr
import numpy as np

TURN = 2.0 * np.pi
#: Points of a cycle from which the harmonics' derivatives are made.
SAMPLES = 2048


@dataclass(frozen=True, eq=False, repr=False)
class Signals(ShortRepr):
    """x of every waveform of a gait.

    Attributes:
        terms: complex, shape (waves, 1 + H).
        slopes: their derivatives by the network's parameters, shape (waves, 1 + H, parameters).

    """

    terms: np.ndarray
    slopes: np.ndarray

    def values(self, theta: np.ndarray, shift: float | np.ndarray, wave: int
               ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """x, y and the derivative of y by phase in radians.

        Args:
            theta: cycles, shape (m,); few different ones, since what they give is kept.
            shift: added to them, cycles, a number or several.
            wave: number of the waveform.

        Returns:
            Three arrays of shape (m,), or (m, shifts).

        """
        k = np.arange(self.terms.shape[1])
        terms = (self.terms[wave] * np.exp(TURN * 1j * np.multiply.outer(shift, k))).T
        k = k.reshape(-1, *[1] * (terms.ndim - 1))
        turns = _turns(theta.tobytes(), k.size)
        return ((turns @ terms).real, (turns @ (1j * k * terms)).real,
                (turns @ (-k * k * terms)).real)

    def derivatives(self, theta: np.ndarray, shift: float, wave: int, members: np.ndarray
                    ) -> np.ndarray:
        """Return the derivatives of x and y by numbers that move the parameters.

        Args:
            theta: as above.
            shift: as above.
            wave: number of the waveform.
            members: how much each parameter moves with each number, (parameters, numbers).

        Returns:
            An array of shape (2, m, numbers).

        """
        k = np.arange(self.terms.shape[1])
        slopes = (self.slopes[wave] @ members) * np.exp(TURN * 1j * k * shift)[:, None]
        return (_turns(theta.tobytes(), k.size)
                @ np.stack([slopes, 1j * k[:, None] * slopes])).real


@lru_cache(maxsize=16)
def _turns(theta: bytes, count: int) -> np.ndarray:
    """``exp(2 pi i k theta)``, shape (m, count)."""
    return np.exp(TURN * 1j * np.multiply.outer(np.frombuffer(theta), np.arange(count)))


def signals(orbit: Orbit, harmonics: int) -> Signals:
    """Return the signals of a gait that drive joints.

    Args:
        orbit: the gait, with its derivatives.
        harmonics: of a Morris-Lecar cell's waveform that joints follow.

    """
    one = _whole if orbit.network.readout == 'waveform' else _smooth
    waves = [one(orbit, wave, harmonics) for wave in range(int(orbit.waves.max()) + 1)]
    return Signals(*(np.array(parts) for parts in zip(*waves, strict=True)))


def _whole(orbit: Orbit, wave: int, harmonics: int) -> tuple[np.ndarray, np.ndarray]:
    """Return the waveform over the peak of cell 1, which stays at phase 0."""
    theta = np.arange(orbit.samples) / orbit.samples
    terms = np.fft.rfft(orbit.waveform(theta, 0, wave)) / theta.size
    slopes = np.fft.rfft(orbit.d_waveform(theta, wave), axis=0) / theta.size
    terms[1:] *= 2.0
    slopes[1:] *= 2.0
    d_peak = orbit.d_waveform(np.zeros(1))[0]
    return (terms / orbit.peak,
            (slopes - np.multiply.outer(terms / orbit.peak, d_peak)) / orbit.peak)


def _smooth(orbit: Orbit, wave: int, harmonics: int) -> tuple[np.ndarray, np.ndarray]:
    """Return the first harmonics from -1 to 1; their ends move the middle and half the range."""
    theta = np.arange(POINTS) / POINTS
    values = orbit.waveform(theta, 0, wave)
    pairs = smooth_terms(values, harmonics)
    share = np.sinc(np.arange(harmonics + 1) / (harmonics + 1))
    sums = np.fft.rfft(values)[:harmonics + 1] * share * (2.0 / POINTS)
    half = float(np.linalg.norm(sums[1:]) / np.linalg.norm(pairs[1:]))
    slopes = np.fft.rfft(orbit.d_waveform(np.arange(SAMPLES) / SAMPLES, wave), axis=0)
    slopes = slopes[:harmonics + 1] * share[:, None] * (2.0 / SAMPLES)
    slopes[0] *= 0.5
    x = evaluate(pairs, theta)
    ends = np.exp(TURN * 1j * np.multiply.outer(theta[[x.argmax(), x.argmin()]],
                                                np.arange(harmonics + 1)))
    high, low = (ends @ slopes).real
    terms = pairs[:, 0] - 1j * pairs[:, 1]
    slopes[0] -= 0.5 * (high + low)
    return terms, (slopes - np.multiply.outer(terms, 0.5 * (high - low))) / half
