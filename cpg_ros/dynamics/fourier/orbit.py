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

"""Orbits as trigonometric polynomials: the gaits of networks with a delay."""

from dataclasses import dataclass

from cpg_ros.dynamics.fourier import collocation
from cpg_ros.dynamics.periodic import Orbit
import numpy as np


@dataclass(frozen=True, eq=False, repr=False)
class FourierOrbit(Orbit):
    """An orbit by its waveforms on evenly spaced nodes.

    Attributes:
        values: waveforms at the nodes theta = m / n, shape (waves, variables, n); that of
            cell 1's first variable peaks at the first one.
        derivatives: of the nodal values by the parameters, at fixed theta, then of the period,
            shape (waves variables n + 1, parameters).

    """

    values: np.ndarray
    derivatives: np.ndarray

    def _summary(self) -> str:
        return f'{super()._summary()}, {self.samples} nodes'

    @property
    def d_period(self) -> np.ndarray:
        """Derivatives of the period by the network's parameters, shape (parameters,)."""
        return self.derivatives[-1]

    @property
    def d_values(self) -> np.ndarray:
        """Those of the nodal values, shape (waves, variables, n, parameters)."""
        return self.derivatives[:-1].reshape(*self.values.shape, -1)

    @property
    def peak(self) -> float:
        """The largest value of cell 1."""
        return float(self.values[0, 0, 0])

    @property
    def levels(self) -> np.ndarray:
        """Middle and half the range of each waveform, shape (waves, variables, 2)."""
        if self.symmetry.odd and self.values.shape[:2] == (1, 1):
            # The symmetry x -> -x puts the middle at 0.
            return np.array([[[0.0, self.peak]]])
        return super().levels

    @property
    def samples(self) -> int:
        """How many evenly spaced points of a cycle resolve a waveform: the nodes."""
        return int(self.values.shape[-1])

    def waveform(self, theta: np.ndarray, order: int = 0, wave: int = 0, variable: int = 0
                 ) -> np.ndarray:
        """Return a waveform, or its derivative in theta of the given order, at theta in cycles."""
        return collocation.evaluate(self.values[wave, variable], theta, order)

    def d_waveform(self, theta: np.ndarray, wave: int = 0, variable: int = 0) -> np.ndarray:
        """Return the derivatives by the parameters, shape theta.shape + (parameters,)."""
        return np.stack([collocation.evaluate(column, theta)
                         for column in self.d_values[wave, variable].T], -1)

    def _states(self, times: np.ndarray, order: int) -> np.ndarray:
        theta = np.asarray(times, dtype=float) / self.period
        if self.values.shape[:2] == (1, 1):
            return collocation.evaluate(self.values[0, 0], theta, order, self.phases)
        return super()._states(times, order)
