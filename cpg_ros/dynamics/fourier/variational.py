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

"""The variational equation along a gait of a network with a delay, with sources, as a matrix.

``y'(t) = A(t) y(t) + B(t) y(t - tau) + r(t)`` with ``y(T) = turn y(0)``: with
``y = exp(sigma t) u``, sigma = log(turn) / T, u has the period of the orbit, and the orbit's nodes
do for it, too.
"""

from cpg_ros.dynamics.fourier import collocation
from cpg_ros.dynamics.fourier.floquet import mode
from cpg_ros.dynamics.fourier.newton import MOST_NODES
from cpg_ros.dynamics.fourier.orbit import FourierOrbit
from cpg_ros.dynamics.periodic import NoOrbit
from cpg_ros.networks.field import Field, States
import numpy as np

#: Unknowns at most: the matrices are dense.
MOST = 4096


class Variational:
    """The variational equation of an orbit in all components, on its nodes or on more.

    Attributes:
        at: states at the nodes now and a delay ago, shape (n, components) each.
        slope: their derivatives by time.
        delay: model time.
        flaw: why derivatives of the rates do not tell how disturbances interact, or ''.

    """

    def __init__(self, orbit: FourierOrbit, halvings: int = 0) -> None:
        """Linearise about an orbit.

        Args:
            orbit: of a network with a delay.
            halvings: of the distances of nodes.

        Raises:
            NoOrbit: there would be more unknowns than there may be.

        """
        network = orbit.network
        n = (orbit.samples + 1) * 2**halvings - 1
        if n > MOST_NODES or n * network.components > MOST:
            raise NoOrbit('the waveform is too steep')
        self._orbit, self._n, self.delay = orbit, n, network.delay
        self._times = np.arange(n) / n * orbit.period
        late = self._times - self.delay
        self.at: States = orbit(self._times), orbit(late)
        self.slope: States = orbit.derivative(self._times), orbit.derivative(late)
        field: Field = Field(network)
        _, self._now, self._past = field.linearised(*self.at)
        self._shift = collocation.shift_matrix(n, -self.delay / orbit.period)
        self.flaw = 'the rates have kinks' if network.kinks else ''

    def critical(self, part: int, multiplier: complex) -> tuple[complex, np.ndarray]:
        """Return the factor over a period of the disturbance with a multiplier, and about that.

        Args:
            part: number of its subspace, as in floquet.mode.
            multiplier: over a period.

        Returns:
            The factor, and the disturbance at the unknowns, shape (n components,).

        """
        # Of a pair the real part, which is enough for a guess.
        values = mode(self._orbit, part, multiplier)(self._times / self._orbit.period)
        return multiplier, (values * self._wave(multiplier, -1.0)).ravel()

    def _sigma(self, turn: complex) -> complex:
        return complex(np.log(complex(turn))) / self._orbit.period

    def _wave(self, turn: complex, sign: float) -> np.ndarray:
        return np.exp(sign * self._sigma(turn) * self._times)[:, None]

    def along(self) -> np.ndarray:
        """Return the derivative of the orbit by time at the unknowns, shape (n components,)."""
        return self.slope[0].ravel()

    def matrix(self, turn: complex) -> np.ndarray:
        """Return the matrix of the unknowns.

        Args:
            turn: factor over a period.

        """
        n, d = self.at[0].shape
        sigma, nodes = self._sigma(turn), np.arange(n)
        matrix = np.zeros((n, d, n, d), dtype=complex)
        derive = collocation.derivative_matrix(n) / self._orbit.period + sigma * np.eye(n)
        for k in range(d):
            matrix[:, k, :, k] = derive
        matrix[nodes, :, nodes, :] -= self._now
        matrix -= (np.exp(-sigma * self.delay) * self._shift)[:, None, :, None] * self._past[
            :, :, None, :]
        return matrix.reshape(n * d, n * d)

    def right(self, rates: np.ndarray, turn: complex) -> np.ndarray:
        """Return the right-hand side for sources at the nodes, shape (n components,)."""
        return (rates * self._wave(turn, -1.0)).ravel()

    def values(self, unknowns: np.ndarray, rates: np.ndarray, turn: complex) -> States:
        """Return a solution at the nodes, now and a delay ago.

        Args:
            unknowns: shape (n components,).
            rates: the sources, which are in the unknowns already.
            turn: factor over a period.

        """
        periodic, sigma = unknowns.reshape(self._n, -1), self._sigma(turn)
        return (periodic * self._wave(turn, 1.0),
                self._shift @ periodic * np.exp(sigma * (self._times - self.delay))[:, None])

    def derivative(self, values: States, turn: complex) -> States:
        """Return the derivative by time of a disturbance, now and a delay ago."""
        sigma = self._sigma(turn)
        derive = collocation.derivative_matrix(self._n) / self._orbit.period
        waves = np.exp(sigma * self._times)[:, None]
        now, past = (waves * (derive @ (some / waves)) + sigma * some
                     for some in values if some is not None)
        return now, past

    def delayed(self, values: States) -> np.ndarray:
        """Return what the part a delay ago adds to the rates."""
        assert values[1] is not None
        found: np.ndarray = np.einsum('tij,tj->ti', self._past, values[1])
        return found
