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

"""Data of a fit: linear readouts, a gait's signals as harmonics, joints' mean cycles, cells."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from cpg_ros.common.errors import InputError, ShortRepr
from cpg_ros.dynamics.orbit import Orbit
from cpg_ros.fitting.gaits.stride import Stride
from cpg_ros.motion.phase_readout import evaluate, POINTS, smooth_terms
from cpg_ros.motion.readout import monomials
from cpg_ros.motion.robot import Robot
from cpg_ros.networks.network import Network
import numpy as np

# The linear readout of joints and its elimination from a fit: variable projection.

#: NUM_WEIGHTS: of a readout, by its order.
NUM_WEIGHTS = {1: 2, 2: 4, 3: 6}


def basis(order: int, x: np.ndarray, y: np.ndarray, z: np.ndarray
          ) -> tuple[np.ndarray, np.ndarray]:
    """Return 1 and the monomials of an order, and their derivatives by phase in cycles.

    Args:
        order: 1 to 3.
        x: signal, any shape.
        y: its derivative by phase in radians.
        z: the second one.

    Returns:
        Two arrays of shape (..., 1 + weights).

    """
    values, by_phase = monomials(x, y, z)
    count = NUM_WEIGHTS[order]
    return (np.stack([np.ones_like(x), *values[:count]], axis=-1),
            np.stack([np.zeros_like(x), *by_phase[:count]], axis=-1))


def basis_slope(order: int, x: np.ndarray, y: np.ndarray, slopes: np.ndarray) -> np.ndarray:
    """Return the derivatives of 1 and the monomials, shape (..., 1 + weights, numbers).

    Args:
        order: 1 to 3.
        x: signal, any shape.
        y: its derivative by phase in radians.
        slopes: derivatives of x and y by some numbers, shape (2, ..., numbers).

    """
    ones, zero = np.ones_like(x), np.zeros_like(x)
    by_x = np.stack([zero, ones, zero, 2.0 * x, y, 3.0 * x * x, 2.0 * x * y], axis=-1)
    by_y = np.stack([zero, zero, ones, zero, x, zero, x * x], axis=-1)
    count = 1 + NUM_WEIGHTS[order]
    return (by_x[..., :count, None] * slopes[0][..., None, :]
            + by_y[..., :count, None] * slopes[1][..., None, :])


def project(psi: np.ndarray, derivative: np.ndarray, data: np.ndarray, rows: np.ndarray
            ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Fit linear readouts of bases to joints, and differentiate the residual.

    Args:
        psi: bases, shape (bases, m, n).
        derivative: their derivatives, shape (bases, m, n, variables).
        data: of the joints, shape (m, joints).
        rows: number of each joint's basis, shape (joints,).

    Returns:
        Offset and weights of each joint, shape (n, joints); the residual, fitted minus recorded,
        (m, joints); and its derivative, the readout staying the best, (m, joints, variables).

    Raises:
        numpy.linalg.LinAlgError: a basis is not independent.

    """
    q, r = np.linalg.qr(psi)
    q, inverse, derivative = q[rows], np.linalg.inv(r)[rows], derivative[rows]
    transposed = q.transpose(0, 2, 1)
    weights = inverse @ (transposed @ data.T[..., None])
    residual = psi[rows] @ weights - data.T[..., None]
    along = (derivative.swapaxes(2, 3) @ weights[:, None])[..., 0]
    along -= q @ (transposed @ along)
    pull = (derivative.transpose(0, 2, 3, 1) @ residual[:, None])[..., 0]
    # The second part vanishes with the residual: it is what Kaufman (1975) leaves out.
    along -= q @ (inverse.transpose(0, 2, 1) @ pull)
    return weights[..., 0].T, residual[..., 0].T, along.swapaxes(0, 1)


# The signals of a gait that drive joints, as harmonics, and their derivatives by parameters.

TWO_PI = 2.0 * np.pi
#: SAMPLES: points of a cycle from which the harmonics' derivatives are computed.
SAMPLES = 2048


@dataclass(frozen=True, eq=False, repr=False)
class Signals(ShortRepr):
    """Signals x of a gait's waveforms, as harmonics.

    Attributes:
        terms: complex, shape (waves, 1 + H).
        slopes: their derivatives by the network's parameters, shape (waves, 1 + H, parameters).

    """

    terms: np.ndarray
    slopes: np.ndarray

    def values(self, theta: np.ndarray, waves: np.ndarray
               ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return x, y and the derivative of y by phase in radians.

        Args:
            theta: cycles, shape (places, m).
            waves: number of the waveform at each place, shape (places,).

        Returns:
            Three arrays of shape (places, m).

        """
        k = np.arange(self.terms.shape[1])
        terms = self.terms[waves]
        series = _waves(theta, k.size) @ np.stack([terms, 1j * k * terms, -k * k * terms], axis=-1)
        return series[..., 0].real, series[..., 1].real, series[..., 2].real

    def derivatives(self, theta: np.ndarray, waves: np.ndarray, members: np.ndarray) -> np.ndarray:
        """Return the derivatives of x and y by numbers that move the parameters.

        Args:
            theta: as above.
            waves: as above.
            members: how much each parameter moves with each number, (parameters, numbers).

        Returns:
            An array of shape (2, places, m, numbers).

        """
        k = np.arange(self.terms.shape[1])
        slopes = (self.slopes @ members)[waves]
        return (_waves(theta, k.size) @ np.stack([slopes, 1j * k[:, None] * slopes])).real


def _waves(theta: np.ndarray, count: int) -> np.ndarray:
    """Return ``exp(2 pi i k theta)``, shape (..., count)."""
    waves = np.empty((*theta.shape, count), dtype=complex)
    waves[..., 0] = 1.0
    waves[..., 1:] = np.exp(TWO_PI * 1j * theta)[..., None]
    return np.cumprod(waves, axis=-1)


def signals(orbit: Orbit, harmonics: int) -> Signals:
    """Return the signals of a gait that drive joints.

    Args:
        orbit: the gait, with its derivatives.
        harmonics: of a Morris-Lecar cell's waveform that joints follow.

    """
    waveform_of = _full_cycle if orbit.network.readout == 'waveform' else _smooth
    waves = [waveform_of(orbit, wave, harmonics) for wave in range(int(orbit.waves.max()) + 1)]
    return Signals(*(np.array(parts) for parts in zip(*waves, strict=True)))


def _full_cycle(orbit: Orbit, wave: int, harmonics: int) -> tuple[np.ndarray, np.ndarray]:
    """Return the terms of a waveform over the peak of cell 1 at phase 0, and their slopes."""
    theta = np.arange(orbit.samples) / orbit.samples
    terms = np.fft.rfft(orbit.waveform(theta, 0, wave)) / theta.size
    slopes = np.fft.rfft(orbit.d_waveform(theta, wave), axis=0) / theta.size
    terms[1:] *= 2.0
    slopes[1:] *= 2.0
    d_peak = orbit.d_waveform(np.zeros(1))[0]
    return (terms / orbit.peak,
            (slopes - np.multiply.outer(terms / orbit.peak, d_peak)) / orbit.peak)


def _smooth(orbit: Orbit, wave: int, harmonics: int) -> tuple[np.ndarray, np.ndarray]:
    """Return the terms of a waveform's first harmonics, scaled to -1 to 1, and their slopes."""
    theta = np.arange(POINTS) / POINTS
    values = orbit.waveform(theta, 0, wave)
    pairs = smooth_terms(values, harmonics)
    fraction = np.sinc(np.arange(harmonics + 1) / (harmonics + 1))
    sums = np.fft.rfft(values)[:harmonics + 1] * fraction * (2.0 / POINTS)
    half = float(np.linalg.norm(sums[1:]) / np.linalg.norm(pairs[1:]))
    slopes = np.fft.rfft(orbit.d_waveform(np.arange(SAMPLES) / SAMPLES, wave), axis=0)
    slopes = slopes[:harmonics + 1] * fraction[:, None] * (2.0 / SAMPLES)
    slopes[0] *= 0.5
    x = evaluate(pairs, theta)
    ends = np.exp(TWO_PI * 1j * np.multiply.outer(theta[[x.argmax(), x.argmin()]],
                                                  np.arange(harmonics + 1)))
    high, low = (ends @ slopes).real
    terms = pairs[:, 0] - 1j * pairs[:, 1]
    slopes[0] -= 0.5 * (high + low)
    return terms, (slopes - np.multiply.outer(terms, 0.5 * (high - low))) / half


#: MIN_RELATIVE_ERROR: standard error of a mean cycle over the joint's range.
MIN_RELATIVE_ERROR = 1e-4


@dataclass(frozen=True, eq=False, repr=False)
class Joints(ShortRepr):
    """Joints over one cycle.

    Attributes:
        names: of the joints.
        theta: cycles, shape (m,).
        data: rad, shape (m, joints).
        cells: the cell behind each joint, from 0, shape (joints,).
        errors: standard error of each joint's mean, over the whole cycle, rad, shape (joints,).

    """

    names: tuple[str, ...]
    theta: np.ndarray
    data: np.ndarray
    cells: np.ndarray
    errors: np.ndarray


def cells_of(source: Robot | Mapping[str, Sequence[str]], network: type[Network],
             assignment: str = '') -> dict[str, int]:
    """Return joint -> cell from 1: of a robot file, or the first cell of each joint's leg.

    Args:
        source: a robot, or leg -> names of its joints.
        network: whose legs they are.
        assignment: of cells to legs, the usual one by default.

    Raises:
        InputError: the network has no such leg or assignment, or does not drive this robot.

    """
    if isinstance(source, Robot):
        if network.name not in source.networks:
            raise InputError(f'robot {source.name} is not for the network {network.name}')
        return {joint.name: joint.cell for joint in source.joints}
    assignment = assignment or next(iter(network.legs))
    if assignment not in network.legs:
        raise InputError(f"assignment '{assignment}' is not one of {', '.join(network.legs)}")
    legs = network.legs[assignment]
    for leg in source:
        if leg not in legs:
            raise InputError(f"the network {network.name} has no leg '{leg}': it has "
                             f'{", ".join(legs)}')
    return {joint: legs[leg][0] for leg, joints in source.items() for joint in joints}


def joints_of(cycle: Stride, cells: Mapping[str, int], network: Network
              ) -> Joints:
    """Return the joints that cells drive.

    Args:
        cycle: the recording's.
        cells: joint -> its cell, from 1.
        network: whose cells.

    Raises:
        InputError: a value is not finite, or a joint or cell is unknown.
        ValueError: shapes do not fit.

    """
    names = list(cells)
    theta = np.asarray(cycle.theta, dtype=float)
    mean, error = (np.asarray(array, dtype=float) for array in (cycle.mean, cycle.error))
    all_joints = list(cycle.joints)
    if mean.shape != (len(all_joints), theta.size) or error.shape != mean.shape:
        raise ValueError(f'mean has the shape {mean.shape} and error {error.shape}; '
                         f'{len(all_joints)} joints on {theta.size} instants need '
                         f'({len(all_joints)}, {theta.size})')
    if not names:
        raise InputError('no joint is assigned to a cell')
    if theta.size < 1 or np.abs((theta - theta[0]) - np.arange(theta.size) / theta.size
                                ).max() > 1e-9:
        raise ValueError('theta must be an even grid over one cycle')
    for name in names:
        if name not in all_joints:
            raise InputError(f"joint '{name}' is not in the recording")
        if not 1 <= cells[name] <= network.cells:
            raise InputError(f"joint '{name}' has the cell {cells[name]}; there are "
                             f'{network.cells}')
        row = all_joints.index(name)
        if not (np.isfinite(mean[row]).all() and np.isfinite(error[row]).all()
                and (error[row] >= 0.0).all()):
            raise InputError(f"joint '{name}' has a mean or error that is not finite")
    rows = [all_joints.index(name) for name in names]
    errors = np.sqrt(np.mean(error[rows]**2, axis=1))
    spans = np.ptp(mean[rows], axis=1)
    floor = MIN_RELATIVE_ERROR * np.where(spans > 0.0, spans, max(float(spans.max()), 1e-12))
    return Joints(tuple(names), theta, mean[rows].T.copy(),
                  np.array([cells[name] - 1 for name in names]), np.maximum(errors, floor))
