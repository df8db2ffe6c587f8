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

"""Least-squares problem of a gait's fit to a mean cycle, with the readouts eliminated."""

from collections.abc import Sequence
from copy import copy
from dataclasses import dataclass, field

from cpg_ros.common.errors import ShortRepr
from cpg_ros.dynamics.arclength import NoOrbit
from cpg_ros.dynamics.orbit import Orbit
from cpg_ros.dynamics.solve_orbit import solve_beside, solve_orbit
from cpg_ros.fitting.inversion.fit_data import (
    basis,
    basis_slope,
    Joints,
    NUM_WEIGHTS,
    project,
    Signals,
    signals,
)
from cpg_ros.fitting.inversion.free_parameters import (
    Coordinates,
    Free,
    with_values,
)
from cpg_ros.fitting.inversion.leg_duty import (
    GAIT_DUTY,
    GaitReadout,
    own_stance,
    OwnStance,
    retimed,
)
from cpg_ros.networks.network import Network
import numpy as np

#: MAX_ORBITS: that are kept, the last ones.
MAX_ORBITS = 64
#: ERROR_HARMONICS: of a waveform that may differ from the model's.
ERROR_HARMONICS = 4


@dataclass(frozen=True, eq=False, repr=False)
class ReadoutFit(ShortRepr):
    """Readouts that fit best at some values of the free numbers.

    Attributes:
        orbit: of the gait.
        weights: offset and weights of each joint, rad, shape (1 + weights, joints).
        residual: fitted minus recorded, rad, shape (m, joints).
        jacobian: its derivative by the free numbers and the phase, shape (m, joints, free + 1).

    """

    orbit: Orbit
    weights: np.ndarray
    residual: np.ndarray
    jacobian: np.ndarray


@dataclass
class Orbits:
    """Orbits by the values of the free parameters, shared by fits of the same parameters.

    Attributes:
        solved: the latest orbits.
        pinned: orbits that are kept as starts.
        missing: reasons why there is no orbit.

    """

    solved: dict[bytes, tuple[Orbit, Signals]] = field(default_factory=dict)
    pinned: dict[bytes, tuple[Orbit, Signals]] = field(default_factory=dict)
    missing: dict[bytes, str] = field(default_factory=dict)


class CycleProblem:
    """Residuals of a fit and their derivatives, by its values.

    Values are the free numbers, the gait's duty last if it is free, then the phase of the orbit
    where theta is 0.

    Attributes:
        joints, network, gait, free, order, readout: data and unknowns of the fit.
        coordinates: coordinates of the trust region.
        sizes: standard error of each joint's mean cycle by which residuals are divided, rad,
            shape (joints,).

    """

    def __init__(self, joints: Joints, sizes: np.ndarray, network: Network, gait: str,
                 free: Sequence[Free], order: int, readout: GaitReadout,
                 orbits: Orbits | None = None) -> None:
        self.joints, self.sizes, self.free = joints, sizes, tuple(free)
        self.network, self.gait = network, gait
        self._symmetry = network.symmetry(gait)
        self.coordinates = Coordinates(network, gait, self.free)
        self.order, self.readout = order, readout
        names = network.parameters()
        self._members = np.array([[float(name in parameter.members) for parameter in free]
                                  for name in names])
        self._of_duty = np.array([float(parameter.name == GAIT_DUTY) for parameter in free])
        #: Number of values that belong to the network.
        self._own = len(free) - int(self._of_duty.sum())
        leading = np.array([readout.leading.get(int(cell) + 1, int(cell) + 1) - 1
                            for cell in joints.cells])
        waves, phases = self._symmetry.waves, self._symmetry.phases
        keys = [(int(waves[cell]), float(phases[cell]), int(waves[lead]), float(phases[lead]))
                for cell, lead in zip(joints.cells, leading, strict=True)]
        #: Joints that see the same have the same place: which, and cell and leading cell of each.
        self._rows = np.array([list(dict.fromkeys(keys)).index(key) for key in keys])
        first = [keys.index(key) for key in dict.fromkeys(keys)]
        self._cells, self._leads = joints.cells[first], leading[first]
        #: Whether a joint is the first, second, ... of its leg, (joints,).
        self.kinds = np.array([np.count_nonzero(leading[:j] == lead)
                               for j, lead in enumerate(leading)])
        #: Whether the feet bore loads, which move joints off what the network does.
        self.loaded = False
        self._orbits = orbits or Orbits()
        self._best: tuple[bytes, ReadoutFit] | None = None

    def duty(self, values: np.ndarray) -> float | None:
        """Return the duty factor that the fit applies; None for that of the cells."""
        return float(values[self._own]) if self._of_duty.any() else self.readout.duty

    @property
    def weights(self) -> int:
        """Number of values of a joint's readout, with its offset."""
        return 1 + NUM_WEIGHTS[self.order]

    def begin(self, values: np.ndarray) -> None:
        """Solve for a first orbit without one nearby, unless that has been done.

        Raises:
            NoOrbit: there is none, or none was found.

        """
        if values[:self._own].tobytes() not in self._orbits.solved:
            self._keep(values, solve_orbit(self._network(values), self.gait))

    def _network(self, values: np.ndarray) -> Network:
        network = with_values(self.network, self.free[:self._own], values[:self._own])
        if network.symmetry(self.gait) != self._symmetry:
            raise NoOrbit(f'the wave of the {self.gait} would run the other way')
        return network

    def _keep(self, values: np.ndarray, orbit: Orbit) -> tuple[Orbit, Signals]:
        solved = self._orbits.solved
        while len(solved) >= MAX_ORBITS:
            del solved[next(iter(solved))]
        key = values[:self._own].tobytes()
        solved[key] = orbit, signals(orbit, self.readout.harmonics)
        return solved[key]

    def hold(self, values: np.ndarray) -> None:
        """Keep the orbit at these values as a start, as Newton's method may not reach it later."""
        self._orbits.pinned[values[:self._own].tobytes()] = self._solve(values)

    def _solve(self, values: np.ndarray) -> tuple[Orbit, Signals]:
        """Solve for an orbit from the nearest known one; also return the signals of the joints.

        Raises:
            NoOrbit: Newton's method reaches none from there.

        """
        key = values[:self._own].tobytes()
        orbits, pinned, missing = vars(self._orbits).values()
        if key in pinned:
            return pinned[key]
        if key not in orbits:
            network = self._network(values)
            nearest = self._nearest(values)
            if nearest is None or network.delay_parameter:
                # With a delay the way from the onset is as short as that from a neighbour.
                return self._keep(values, solve_orbit(network, self.gait, nearest))
            if key in missing:
                raise NoOrbit(missing[key])
            try:
                # A step too long for Newton's method is one too long for the trust region.
                return self._keep(values, solve_beside(network, nearest))
            except NoOrbit as error:
                missing[key] = str(error)
                raise
        return orbits[key]

    def _nearest(self, values: np.ndarray) -> Orbit | None:
        if not self._orbits.solved:
            return None
        solved = np.array([np.frombuffer(key) for key in self._orbits.solved])
        size = np.abs(solved).max(axis=0) + 1e-12
        gaps = np.sum(((solved - values[:self._own]) / size)**2, axis=1)
        return list(self._orbits.solved.values())[int(gaps.argmin())][0]

    def best_readouts(self, values: np.ndarray) -> ReadoutFit:
        """Return the readouts that fit best; raise NoOrbit as ``begin`` does."""
        key = np.asarray(values).tobytes()
        if self._best is None or self._best[0] != key:
            orbit, signals = self._solve(values)
            self._best = key, ReadoutFit(orbit, *self._readouts(
                orbit, signals, values, self._members, self._of_duty))
        return self._best[1]

    def by_waveform(self, values: np.ndarray) -> np.ndarray:
        """Return the derivative of the residual by errors of the waveforms, rad.

        Errors are the cosine and sine terms of the first ``ERROR_HARMONICS`` harmonics of every
        waveform, relative to half its range. Readouts are refitted. The shape is (m, joints,
        terms).
        """
        orbit, signals = self._solve(values)
        waves, count = len(signals.terms), min(ERROR_HARMONICS, signals.terms.shape[1] - 1) + 1
        slopes = np.zeros((waves, signals.terms.shape[1], waves, 2, count), dtype=complex)
        for wave in range(waves):
            slopes[wave, :count, wave] = np.eye(count)[:, None] * np.array([1.0, -1j])[:, None]
        slopes = slopes.reshape(*signals.terms.shape, -1)
        terms = slopes.shape[-1]
        return self._readouts(orbit, Signals(signals.terms, slopes), values, np.eye(terms),
                              np.zeros(terms))[2][..., :-1]

    @property
    def noise(self) -> float:
        """Sum of squares of the weighted residual that noise alone would leave."""
        return (len(self.joints.data) - self.weights) * float(np.sum(
            (self.joints.errors / self.sizes)**2))

    def residual_rms(self, values: np.ndarray) -> np.ndarray:
        """Return the RMS residual of each joint by its degrees of freedom, rad, (joints,)."""
        residual = self.best_readouts(values).residual
        return np.sqrt(np.sum(residual**2, axis=0) / (len(residual) - self.weights))

    def stance_fraction(self, values: np.ndarray) -> float:
        """Return the fraction of the stride that the leg of the first joint stands."""
        duty = self.duty(values)
        if duty is not None:
            return duty
        orbit, signals = self._solve(values)
        return self._own_stance(orbit, signals, int(orbit.waves[self._leads[0]])).fraction

    def _own_stance(self, orbit: Orbit, signals: Signals, wave: int) -> OwnStance:
        return own_stance(signals, wave, orbit.network.readout == 'waveform', self.readout.stance)

    def _phases(self, orbit: Orbit, signals: Signals, values: np.ndarray, members: np.ndarray,
                of_duty: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return the phases of the cells at which joints are read, and their derivatives.

        Cycles, shape (places, m); by the numbers, (places, m, numbers), and by the phase.
        """
        duty, cells = self.duty(values), orbit.phases[self._cells]
        phases = self.joints.theta + (cells + values[-1])[:, None]
        slope, steep = np.zeros((*phases.shape, of_duty.size)), np.ones_like(phases)
        ahead, waves = (cells - orbit.phases[self._leads])[:, None], orbit.waves[self._leads]
        if duty is None:
            return phases, slope, steep
        for wave in np.unique(waves):
            rows, stance = waves == wave, self._own_stance(orbit, signals, int(wave))
            phases[rows], slope[rows], steep[rows] = retimed(phases[rows], duty, stance,
                                                             ahead[rows], members, of_duty)
        return phases, slope, steep

    def _readouts(self, orbit: Orbit, signals: Signals, values: np.ndarray, members: np.ndarray,
                  of_duty: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        phases, by_number, steep = self._phases(orbit, signals, values, members, of_duty)
        waves = orbit.waves[self._cells]
        x, y, z = signals.values(phases, waves)
        psi, by_phase = basis(self.order, x, y, z)
        slope = basis_slope(self.order, x, y, signals.derivatives(phases, waves, members))
        slope += by_phase[..., None] * by_number[:, :, None]
        return project(psi, np.concatenate([slope, (by_phase * steep[..., None])[..., None]], -1),
                       self.joints.data, self._rows)

    def at_order(self, order: int) -> 'CycleProblem':
        """Return the same problem with readouts of another order."""
        other = copy(self)
        other.order, other._best = order, None
        return other

    def weighted(self, columns: np.ndarray) -> np.ndarray:
        """Divide values of each instant and joint by the sizes; return shape (residuals, n).

        Args:
            columns: rad, shape (m, joints, n).

        """
        return (columns / self.sizes[:, None]).reshape(-1, columns.shape[-1])

    def __call__(self, values: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return residuals over their standard errors, instant by instant, and derivatives."""
        fit = self.best_readouts(values)
        columns = self.weighted(np.concatenate([fit.residual[..., None], fit.jacobian], -1))
        return columns[:, 0], columns[:, 1:]

    def cost(self, values: np.ndarray) -> float:
        """Return half the sum of squares; raise NoOrbit as ``begin`` does."""
        residual = self(values)[0]
        return 0.5 * float(residual @ residual)

    def first_phase(self, values: np.ndarray) -> float:
        """Return the phase of an even grid whose readouts explain most."""
        return self.explained_share(values)[0]

    def explained_share(self, values: np.ndarray) -> tuple[float, float]:
        """Return the phase of an even grid whose readouts explain most, and what they explain.

        That is a sum of squares over the squares of the sizes, with the mean of each joint.
        """
        shares = self.explained_by(values).sum(axis=0)
        best = int(shares.argmax())
        return best / shares.size, float(shares[best])

    def explained_by(self, values: np.ndarray) -> np.ndarray:
        """Return what the readout of each joint explains at phases of an even grid.

        That is a sum of squares over the square of its size, with its mean; shape (joints, m).
        """
        orbit, signals = self._solve(values)
        phases = self._phases(orbit, signals, np.append(values[:-1], 0.0), self._members,
                              self._of_duty)[0]
        psi = basis(self.order, *signals.values(phases, orbit.waves[self._cells]))[0]
        inverse = np.linalg.inv(np.linalg.qr(psi, mode='r'))
        # The basis at all shifts, by the correlation theorem.
        spectra = np.fft.rfft(psi @ inverse, axis=1)[self._rows]
        data = np.fft.rfft(self.joints.data / self.sizes, axis=0).T[..., None]
        return np.sum(np.fft.irfft(spectra * data.conj(), phases.shape[1], axis=1)**2, axis=-1)

    def rephased(self, values: np.ndarray) -> np.ndarray:
        """Return values with the guessed phase if it leaves less than their own does.

        Close to a cosine any phase does nearly as well, and none is the best one nearby for sure.
        """
        shifted = np.append(values[:-1], self.first_phase(values))
        residual, other = self(values)[0], self(shifted)[0]
        return shifted if other @ other < residual @ residual else values
