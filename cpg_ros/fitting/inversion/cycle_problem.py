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

"""The fit of a gait to a mean cycle as a least-squares problem in its free numbers alone."""

from collections.abc import Sequence
from copy import copy
from dataclasses import dataclass

from cpg_ros.common.errors import ShortRepr
from cpg_ros.dynamics.arclength import NoOrbit
from cpg_ros.dynamics.orbit import Orbit
from cpg_ros.dynamics.solve_orbit import solve_beside, solve_orbit
from cpg_ros.fitting.inversion.fit_data import (
    basis,
    basis_moved,
    Joints,
    project,
    Signals,
    signals,
    WEIGHTS,
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

#: SHIFTS: number of phases among which the initial one between recording and orbit is chosen.
SHIFTS = 32
#: KEPT: number of orbits that are kept, the last ones.
KEPT = 64
#: ERRORS: number of harmonics of a waveform that may differ from the model's.
ERRORS = 4


@dataclass(frozen=True)
class Period:
    """A measured period, in model time, and its standard error."""

    value: float
    error: float


@dataclass(frozen=True, eq=False, repr=False)
class ReadoutFit(ShortRepr):
    """The best readouts for some values.

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


class CycleProblem:
    """Values are those of the free numbers, then the phase of the orbit where theta is 0.

    The gait's duty, if it is free, is the last of the free numbers.

    Attributes:
        joints, network, gait, free, order, readout: data and unknowns of the fit.
        coordinates: in which a trust region moves.
        sizes: standard error of each joint's mean cycle as far as it counts, rad, (joints,).

    """

    def __init__(self, joints: Joints, sizes: np.ndarray, network: Network, gait: str,
                 free: Sequence[Free], order: int, readout: GaitReadout,
                 period: Period | None = None) -> None:
        self.joints, self.sizes, self.free = joints, sizes, tuple(free)
        self.network, self.gait, self._period = network, gait, period
        self._symmetry = network.symmetry(gait)
        self.coordinates = Coordinates(network, gait, self.free)
        self.order, self.readout = order, readout
        names = network.parameters()
        self._members = np.array([[float(name in one.members) for one in free]
                                  for name in names])
        self._of_duty = np.array([float(one.name == GAIT_DUTY) for one in free])
        #: Number of values that belong to the network.
        self._own = len(free) - int(self._of_duty.sum())
        leading = np.array([readout.leading.get(int(cell) + 1, int(cell) + 1) - 1
                            for cell in joints.cells])
        waves, phases = self._symmetry.waves, self._symmetry.phases
        keys = [(int(waves[cell]), float(phases[cell]), int(waves[lead]), float(phases[lead]))
                for cell, lead in zip(joints.cells, leading, strict=True)]
        self._places = {(int(joints.cells[keys.index(key)]), int(leading[keys.index(key)])):
                        [j for j, other in enumerate(keys) if other == key]
                        for key in dict.fromkeys(keys)}
        self._solved: dict[bytes, tuple[Orbit, Signals]] = {}
        self._held: dict[bytes, tuple[Orbit, Signals]] = {}
        self._placed: tuple[bytes, ReadoutFit] | None = None

    def duty(self, values: np.ndarray) -> float | None:
        """Return the share of the stride that legs are to stand; None for what they do."""
        return float(values[self._own]) if self._of_duty.any() else self.readout.duty

    @property
    def weights(self) -> int:
        """Numbers that each joint's readout takes, with its offset."""
        return 1 + WEIGHTS[self.order]

    def begin(self, values: np.ndarray) -> None:
        """Solve for an orbit from nothing, to start near, unless that has been done.

        Raises:
            NoOrbit: there is none, or none was found.

        """
        if values[:self._own].tobytes() not in self._solved:
            self._keep(values, solve_orbit(self._network(values), self.gait))

    def _network(self, values: np.ndarray) -> Network:
        network = with_values(self.network, self.free[:self._own], values[:self._own])
        if network.symmetry(self.gait) != self._symmetry:
            raise NoOrbit(f'the wave of the {self.gait} would run the other way')
        return network

    def _keep(self, values: np.ndarray, orbit: Orbit) -> tuple[Orbit, Signals]:
        while len(self._solved) >= KEPT:
            del self._solved[next(iter(self._solved))]
        numbers = np.array(values[:self._own])
        self._solved[numbers.tobytes()] = orbit, signals(orbit, self.readout.harmonics)
        return self._solved[numbers.tobytes()]

    def hold(self, values: np.ndarray) -> None:
        """Keep the orbit at these values as a start: it may be out of reach from later ones."""
        self._held[values[:self._own].tobytes()] = self._solve(values)

    def _solve(self, values: np.ndarray) -> tuple[Orbit, Signals]:
        """Solve for an orbit, from the nearest one known, and for the signals of the joints.

        Raises:
            NoOrbit: there is none that Newton's method reaches from there.

        """
        key = values[:self._own].tobytes()
        if key in self._held:
            return self._held[key]
        if key not in self._solved:
            network = self._network(values)
            near = self._nearest(values)
            if near is None or network.delay_parameter:
                # With a delay the way from the onset is as short as that from a neighbour.
                return self._keep(values, solve_orbit(network, self.gait, near))
            # A step too long for Newton's method is one too long for the trust region.
            return self._keep(values, solve_beside(network, near))
        return self._solved[key]

    def _nearest(self, values: np.ndarray) -> Orbit | None:
        if not self._solved:
            return None
        known = np.array([np.frombuffer(key) for key in self._solved])
        size = np.abs(known).max(axis=0) + 1e-12
        gaps = np.sum(((known - values[:self._own]) / size)**2, axis=1)
        return list(self._solved.values())[int(gaps.argmin())][0]

    def best_readouts(self, values: np.ndarray) -> ReadoutFit:
        """Return the best readouts; raises NoOrbit as ``begin`` does."""
        key = np.asarray(values).tobytes()
        if self._placed is None or self._placed[0] != key:
            orbit, seen = self._solve(values)
            self._placed = key, ReadoutFit(orbit, *self._read(orbit, seen, values, self._members,
                                                              self._of_duty))
        return self._placed[1]

    def by_waveform(self, values: np.ndarray) -> np.ndarray:
        """Return the derivative of the residual over its sizes by errors of the waveforms.

        By the cosine and sine terms of the first ``ERRORS`` harmonics of every waveform, relative
        to half its range, readouts staying the best; shape (residuals, terms).
        """
        orbit, seen = self._solve(values)
        waves, count = len(seen.terms), min(ERRORS, seen.terms.shape[1] - 1) + 1
        slopes = np.zeros((waves, seen.terms.shape[1], waves, 2, count), dtype=complex)
        for wave in range(waves):
            slopes[wave, :count, wave] = np.eye(count)[:, None] * np.array([1.0, -1j])[:, None]
        slopes = slopes.reshape(*seen.terms.shape, -1)
        terms = slopes.shape[-1]
        jacobian = self._read(orbit, Signals(seen.terms, slopes), values, np.eye(terms),
                              np.zeros(terms))[2][..., :-1]
        found = (jacobian / self.sizes[:, None]).reshape(-1, terms)
        return found if self._period is None else np.vstack([found, np.zeros(terms)])

    def stance_share(self, values: np.ndarray) -> float:
        """Return the share of the stride that the leg of the first joint stands."""
        duty = self.duty(values)
        if duty is not None:
            return duty
        (orbit, seen), (_, lead) = self._solve(values), next(iter(self._places))
        return self._own_stance(orbit, seen, lead).fraction

    def _own_stance(self, orbit: Orbit, seen: Signals, lead: int) -> OwnStance:
        return own_stance(seen, int(orbit.waves[lead]), orbit.network.readout == 'waveform',
                          self.readout.stance)

    def _retimed(self, orbit: Orbit, seen: Signals, cell: int, lead: int, values: np.ndarray,
                 members: np.ndarray, of_duty: np.ndarray
                 ) -> tuple[np.ndarray, np.ndarray, np.ndarray] | None:
        """Return the phases of a cell retimed by the gait's duty, or None without a duty.

        Phases at which joints are read on theta, cycles, and their derivatives as of
        leg_duty.retimed.
        """
        duty, place = self.duty(values), float(orbit.phases[cell])
        if duty is None:
            return None
        return retimed(self.joints.theta + place + values[-1], duty,
                       self._own_stance(orbit, seen, lead), place - float(orbit.phases[lead]),
                       members, of_duty)

    def _read(self, orbit: Orbit, seen: Signals, values: np.ndarray, members: np.ndarray,
              of_duty: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        m, joints = self.joints.data.shape
        weights = np.empty((self.weights, joints))
        residual, jacobian = np.empty((m, joints)), np.empty((m, joints, of_duty.size + 1))
        for (cell, lead), columns in self._places.items():
            wave = int(orbit.waves[cell])
            theta, shift = self.joints.theta, float(orbit.phases[cell] + values[-1])
            mapped = self._retimed(orbit, seen, cell, lead, values, members, of_duty)
            if mapped is not None:
                theta, shift = mapped[0], 0.0
            x, y, z = seen.values(theta, shift, wave)
            psi, by_phase = basis(self.order, x, y, z)
            moved = basis_moved(self.order, x, y, seen.derivatives(theta, shift, wave, members))
            if mapped is not None:
                moved += by_phase[..., None] * mapped[1][:, None]
                by_phase *= mapped[2][:, None]
            weights[:, columns], residual[:, columns], jacobian[:, columns] = project(
                psi, np.concatenate([moved, by_phase[..., None]], axis=-1),
                self.joints.data[:, columns])
        return weights, residual, jacobian

    def at_order(self, order: int) -> 'CycleProblem':
        """Return the same problem with readouts of another order."""
        found = copy(self)
        found.order, found._placed = order, None
        return found

    def __call__(self, values: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Residual over its standard errors, joint by joint within each instant, and derivative.

        The last entry is that of the period, where it is data.
        """
        placed = self.best_readouts(values)
        left = (placed.residual / self.sizes).ravel()
        slopes = (placed.jacobian / self.sizes[:, None]).reshape(left.size, -1)
        if self._period is None:
            return left, slopes
        by_period = np.append(placed.orbit.d_period @ self._members, 0.0) / self._period.error
        off = (placed.orbit.period - self._period.value) / self._period.error
        return np.append(left, off), np.vstack([slopes, by_period])

    def cost(self, values: np.ndarray) -> float:
        """Return half the sum of squares; raise NoOrbit as ``begin`` does."""
        left = self(values)[0]
        return 0.5 * float(left @ left)

    def first_phase(self, values: np.ndarray) -> float:
        """Guess the phase: of an even grid, the one whose readouts explain most."""
        return self.explained(values)[0]

    def explained(self, values: np.ndarray) -> tuple[float, float]:
        """Return the phase of an even grid whose readouts explain most, and how much they do.

        As a sum of squares over the squares of the sizes, the mean of each joint included.
        """
        (orbit, seen), m = self._solve(values), self.joints.theta.size
        # Shifts by whole instants: what a cell gives is worked out once for all of them.
        steps = np.unique(np.arange(SHIFTS) * m // SHIFTS)
        rows, found = (np.arange(m) + steps[:, None]) % m, np.zeros(steps.size)
        values = np.append(values[:-1], 0.0)
        for (cell, lead), columns in self._places.items():
            theta, shift = self.joints.theta, float(orbit.phases[cell])
            mapped = self._retimed(orbit, seen, cell, lead, values, self._members,
                                   self._of_duty)
            if mapped is not None:
                theta, shift = mapped[0], 0.0
            psi = basis(self.order, *seen.values(theta, shift, int(orbit.waves[cell])))[0]
            sums = np.einsum('smn,mj->snj', psi[rows],
                             (self.joints.data / self.sizes)[:, columns])
            found += np.sum(sums * np.linalg.solve(psi.T @ psi, sums), axis=(1, 2))
        best = int(found.argmax())
        return float(steps[best] / m), float(found[best])

    def rephased(self, values: np.ndarray) -> np.ndarray:
        """Return values with the guessed phase if it leaves less than their own does.

        Close to a cosine any phase does nearly as well, and none is the best one nearby for sure.
        """
        there = np.append(values[:-1], self.first_phase(values))
        here_left, there_left = self(values)[0], self(there)[0]
        return there if there_left @ there_left < here_left @ here_left else values
