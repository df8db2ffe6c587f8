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

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

from cpg_ros.dynamics.orbit import solve_beside, solve_orbit
from cpg_ros.dynamics.periodic import NoOrbit, Orbit
from cpg_ros.inversion.coordinates import Coordinates
from cpg_ros.inversion.fit_data import Joints
from cpg_ros.inversion.free_parameters import Free, with_values
from cpg_ros.inversion.variable_projection import basis, basis_moved, project, WEIGHTS
from cpg_ros.inversion.waveform_harmonics import Signals, signals
from cpg_ros.networks.network import Network
from cpg_ros.short_repr import ShortRepr
import numpy as np

#: Phases among which the first guess of the one between recording and orbit is chosen.
SHIFTS = 32
#: Orbits kept of those solved last.
KEPT = 64


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

    Attributes:
        joints, network, gait, free, order, harmonics: what is fitted to what.
        coordinates: in which a trust region moves.
        sizes: standard error of each joint's mean cycle as far as it counts, rad, (joints,).

    """

    def __init__(self, joints: Joints, sizes: np.ndarray, network: Network, gait: str,
                 free: Sequence[Free], order: int, harmonics: int, period: Period | None = None
                 ) -> None:
        self.joints, self.sizes, self.free = joints, sizes, tuple(free)
        self.network, self.gait, self._period = network, gait, period
        self._symmetry = network.symmetry(gait)
        self.coordinates = Coordinates(network, gait, self.free)
        self.order, self.harmonics = order, harmonics
        names = network.parameters()
        self._members = np.array([[float(name in one.members) for one in free]
                                  for name in names])
        keys = [(int(self._symmetry.waves[cell]), float(self._symmetry.phases[cell]))
                for cell in joints.cells]
        self._places = {key: [j for j, other in enumerate(keys) if other == key]
                        for key in dict.fromkeys(keys)}
        self._solved: dict[bytes, tuple[Orbit, Signals]] = {}
        self._held: dict[bytes, tuple[Orbit, Signals]] = {}
        self._placed: tuple[bytes, ReadoutFit] | None = None

    @property
    def weights(self) -> int:
        """Numbers that each joint's readout takes, with its offset."""
        return 1 + WEIGHTS[self.order]

    def begin(self, values: np.ndarray) -> None:
        """Solve for an orbit from nothing, to start near.

        Raises:
            NoOrbit: there is none, or none was found.

        """
        self._keep(values, solve_orbit(self._network(values), self.gait))

    def _network(self, values: np.ndarray) -> Network:
        network = with_values(self.network, self.free, values[:len(self.free)])
        if network.symmetry(self.gait) != self._symmetry:
            raise NoOrbit(f'the wave of the {self.gait} would run the other way')
        return network

    def _keep(self, values: np.ndarray, orbit: Orbit) -> tuple[Orbit, Signals]:
        while len(self._solved) >= KEPT:
            del self._solved[next(iter(self._solved))]
        numbers = np.array(values[:len(self.free)])
        self._solved[numbers.tobytes()] = orbit, signals(orbit, self.harmonics)
        return self._solved[numbers.tobytes()]

    def hold(self, values: np.ndarray) -> None:
        """Keep the orbit at values, whatever is solved for next: not every way leads back."""
        self._held[values[:len(self.free)].tobytes()] = self._solve(values)

    def _solve(self, values: np.ndarray) -> tuple[Orbit, Signals]:
        """Solve for an orbit, and what joints see of it, from the nearest one solved for.

        Raises:
            NoOrbit: there is none that Newton's method reaches from there.

        """
        key = values[:len(self.free)].tobytes()
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
        gaps = np.sum(((known - values[:len(self.free)]) / size)**2, axis=1)
        return list(self._solved.values())[int(gaps.argmin())][0]

    def best_readouts(self, values: np.ndarray) -> ReadoutFit:
        """Return the best readouts; raises NoOrbit as ``begin`` does."""
        key = np.asarray(values).tobytes()
        if self._placed is None or self._placed[0] != key:
            orbit, seen = self._solve(values)
            self._placed = key, ReadoutFit(orbit, *self._read(orbit, seen, float(values[-1])))
        return self._placed[1]

    def _placed_by(self, orbit: Orbit) -> Iterator[tuple[int, float, list[int]]]:
        """Yield wave, phase in the orbit, and columns of the joints that cells alike drive."""
        for (wave, _), columns in self._places.items():
            yield wave, float(orbit.phases[self.joints.cells[columns[0]]]), columns

    def _read(self, orbit: Orbit, seen: Signals, phase: float
              ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        m, joints = self.joints.data.shape
        weights = np.empty((self.weights, joints))
        residual, jacobian = np.empty((m, joints)), np.empty((m, joints, len(self.free) + 1))
        for wave, place, columns in self._placed_by(orbit):
            theta, shift = self.joints.theta, place + phase
            x, y, z = seen.values(theta, shift, wave)
            psi, by_phase = basis(self.order, x, y, z)
            moved = basis_moved(self.order, x, y, seen.derivatives(theta, shift, wave,
                                                                   self._members))
            weights[:, columns], residual[:, columns], jacobian[:, columns] = project(
                psi, np.concatenate([moved, by_phase[..., None]], axis=-1),
                self.joints.data[:, columns])
        return weights, residual, jacobian

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
        """Half the sum of squares; raises NoOrbit as ``begin`` does."""
        left = self(values)[0]
        return 0.5 * float(left @ left)

    def first_phase(self, values: np.ndarray) -> float:
        """Guess the phase: of an even grid, the one whose readouts explain most."""
        (orbit, seen), shifts = self._solve(values), np.arange(SHIFTS) / SHIFTS
        explained = np.zeros(SHIFTS)
        for wave, place, columns in self._placed_by(orbit):
            psi = basis(self.order, *seen.values(self.joints.theta, place + shifts, wave))[0]
            data = (self.joints.data / self.sizes)[:, columns]
            sums = np.einsum('msn,mj->snj', psi, data)
            gram = np.einsum('msn,msk->snk', psi, psi)
            explained += np.sum(sums * np.linalg.solve(gram, sums), axis=(1, 2))
        return float(shifts[explained.argmax()])

    def rephased(self, values: np.ndarray) -> np.ndarray:
        """Return values with the guessed phase if it leaves less than their own does.

        Close to a cosine any phase does nearly as well, and none is the best one nearby for sure.
        """
        there = np.append(values[:-1], self.first_phase(values))
        here_left, there_left = self(values)[0], self(there)[0]
        return there if there_left @ there_left < here_left @ here_left else values
