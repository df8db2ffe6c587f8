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

"""Made-up recordings: the generator's own readouts of an exact gait, with noise and dropouts."""

from dataclasses import dataclass

from cpg_ros.motion.phase_readout import joint_readout, standing
from cpg_ros.motion.readout import Duty
from cpg_ros.motion.robot import NUM_HARMONICS
import numpy as np


@dataclass(frozen=True)
class MadeUp:
    """A mean cycle, as a fit takes it; theta in cycles, mean and error in rad."""

    joints: tuple[str, ...]
    theta: np.ndarray
    mean: np.ndarray
    error: np.ndarray
    frequency: float = 2.0
    frequency_error: float = 1e-3


def joint_angles(orbit, cells, weights, theta, duty=0.0):
    """Return angles at theta in cycles from where cell 1 peaks, (joints, *theta.shape).

    cells from 1; weights (joints, 6), without offsets; duty of all legs, 0 for the cells' own.
    """
    cells, maps = np.asarray(cells) - 1, None
    legs = [np.array(own) - 1 for own in next(iter(orbit.network.legs.values())).values()]
    leading = np.array([own[0] for own in legs])
    if duty:
        of_legs = Duty(orbit, leading, *standing(orbit, leading, NUM_HARMONICS),
                       np.full(len(legs), duty))
        maps = of_legs.of_cells(np.array([next(k for k, own in enumerate(legs) if cell in own)
                                          for cell in cells]), cells)
    readout = joint_readout(orbit, cells, weights, leading, NUM_HARMONICS, maps)
    terms = np.fft.rfft(readout.angles) / readout.angles.shape[1]
    terms[:, 1:] *= 2.0
    k = np.arange(64)
    return np.array([(np.exp(2j * np.pi * np.multiply.outer(theta + orbit.phases[cell], k))
                      @ row[:64]).real for cell, row in zip(cells, terms, strict=True)])


def plain_readout(orbit, cells, weights, theta):
    """Joints by three harmonics of each cell's waveform as they are: no Lanczos factors."""
    theta, k = np.asarray(theta)[..., None, :], np.arange(4)[:, None]
    grid = np.arange(1024) / 1024
    found = []
    for cell, row in zip(np.array(cells) - 1, weights, strict=True):
        terms = np.fft.rfft(orbit.waveform(grid, 0, int(orbit.waves[cell])))[:4, None] / 512.0
        terms[0] *= 0.5

        def wave(at, power, terms=terms):
            return np.sum((terms * (1j * k)**power) * np.exp(2j * np.pi * k * at), axis=-2).real

        high, low = wave(grid, 0).max(), wave(grid, 0).min()
        at = theta + orbit.phases[cell]
        x, y = (2.0 * wave(at, 0) - high - low) / (high - low), 2.0 * wave(at, 1) / (high - low)
        found.append(np.tensordot(row, np.array([x, y, x * x, x * y, x**3, x * x * y]), 1))
    return np.array(found)


def record(orbit, cells, weights, rng=None, *, offsets=0.1, noise=0.02, jitter=5e-4,
           dropouts=0.01, cycles=24, points=64, phase=0.2, frequency=2.0, angles=joint_angles):
    """Mean of some cycles of a gait, and joint -> cell.

    Args:
        orbit: the gait.
        cells: the cell behind each joint, from 1.
        weights: of the readouts, rad, shape (joints, 6).
        rng: of the noise; without it there is none.
        offsets: of the joints, rad.
        noise: of each sample, over the joint's range.
        jitter: of the stamps, s.
        dropouts: fraction of the samples that are missing.
        cycles: how many are averaged.
        points: of a cycle.
        phase: of the orbit where the recording's cycle begins.
        frequency: strides per second.
        angles: of the joints, by orbit, cells, weights and theta.

    """
    theta = np.arange(points) / points
    names = tuple(f'joint_{k}' for k in range(len(cells)))
    assigned = dict(zip(names, cells, strict=True))
    if rng is None:
        mean = offsets + angles(orbit, cells, weights, theta + phase)
        return MadeUp(names, theta, mean, np.zeros_like(mean), frequency), assigned
    times = theta + phase + frequency * jitter * rng.standard_normal((cycles, points))
    clean = angles(orbit, cells, weights, times)
    spans = np.ptp(clean, axis=(1, 2))[:, None, None]
    seen = clean + offsets + noise * spans * rng.standard_normal(clean.shape)
    seen[rng.random(seen.shape) < dropouts] = np.nan
    count = np.isfinite(seen).sum(axis=1)
    error = np.nanstd(seen, axis=1, ddof=1) / np.sqrt(count)
    return MadeUp(names, theta, np.nanmean(seen, axis=1), error, frequency), assigned


def weights_of(joints, order=3, seed=7):
    """Readout weights of some joints, rad, shape (joints, 6); zero above the order."""
    weights = 0.2 * np.random.default_rng(seed).standard_normal((joints, 6))
    weights[:, 2 * order:] = 0.0
    return weights
