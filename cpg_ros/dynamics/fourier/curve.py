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

"""The orbits of a gait along a line of parameters as waveforms, a curve for continuation.

Their collocation equations, the parameter as one more unknown and the border as one more equation.
Unknowns are counted against their scales: states against 1, where cells saturate, the period and
the parameter against what is given.
"""

from collections.abc import Callable
from dataclasses import dataclass

from cpg_ros.dynamics.fourier import collocation
from cpg_ros.dynamics.fourier.newton import (
    by_parameter,
    complete,
    equations,
    MOST_NODES,
    NODES,
    RESOLVED,
    rows_of,
)
from cpg_ros.dynamics.fourier.orbit import FourierOrbit
from cpg_ros.dynamics.periodic import NoOrbit
from cpg_ros.networks.network import Network
from cpg_ros.networks.parameter_line import ParameterLine
from cpg_ros.networks.symmetry import Symmetry
from cpg_ros.short_repr import ShortRepr
import numpy as np

#: States, shape (m, components), as a function of times in cycles, shape (m,).
States = Callable[[np.ndarray], np.ndarray]


@dataclass(frozen=True, eq=False, repr=False)
class FourierCurve(ShortRepr):
    """Orbits by waveforms: unknowns u at n nodes of each row, T, and the value on the line.

    Attributes:
        network: any on the line.
        symmetry: of the gait.
        along: the line.
        scales: of period and value.

    """

    network: Network
    symmetry: Symmetry
    along: ParameterLine
    scales: tuple[float, float]

    def _rows(self, z: np.ndarray) -> np.ndarray:
        """Return the waveforms, a row for each variable of each wave, shape (rows, n)."""
        return z[:-2].reshape((int(self.symmetry.waves.max()) + 1) * self.network.variables, -1)

    def product(self, one: np.ndarray, other: np.ndarray) -> float:
        """Mean over the cycle and the rows plus period plus value."""
        return float(self._weights(one.size) * one @ other)

    def _weights(self, size: int) -> np.ndarray:
        weights = np.full(size, 1.0 / (size - 2))
        weights[-2:] = np.array(self.scales)**-2.0
        return weights

    def step(self, z: np.ndarray, border: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Newton's increment normal to the border, and the tangent."""
        network = self.along.at(self.network, z[-1])
        residual, jacobian, point = equations(network, self.symmetry, self._rows(z),
                                              float(z[-2]))
        matrix = np.zeros((z.size, z.size))
        matrix[:-1, :-1] = jacobian
        slopes = by_parameter(network, self.symmetry, point)
        matrix[:-1, -1] = slopes @ self.along.direction(network)
        matrix[-1] = self._weights(z.size) * border
        right = np.zeros((z.size, 2))
        right[:-1, 0], right[-1, 1] = -residual, 1.0
        found = np.linalg.solve(matrix, right)
        return found[:, 0], found[:, 1]

    def amplitude(self, z: np.ndarray) -> float:
        """Half the range of cell 1's first variable; of an odd one its peak."""
        row = self._rows(z)[0]
        return float(row[0] if self.symmetry.odd else 0.5 * np.ptp(row))

    def renewed(self, z: np.ndarray, border: np.ndarray, again: bool
                ) -> tuple['FourierCurve', np.ndarray, np.ndarray] | None:
        """Twice the nodes where the waveforms ask for it, from cell 1's highest peak."""
        rows = self._rows(z)
        n = rows.shape[1]
        fine = collocation.resample(rows[0], 4 * n)
        start = (0.0 if fine.max() <= rows[0, 0] + 1e-9 * np.ptp(rows[0])
                 else fine.argmax() / (4 * n))
        more = max(collocation.tail(row) for row in rows) > RESOLVED
        if not more and not start:
            return None
        if more and n >= MOST_NODES:
            raise NoOrbit(f'the waveform is too steep for {MOST_NODES} nodes')
        nodes = 2 * n + 1 if more else n
        theta = start + np.arange(nodes) / nodes
        moved = [np.concatenate([*(collocation.evaluate(row, theta) for row in self._rows(part)),
                                 part[-2:]]) for part in (z, border)]
        return self, moved[0], moved[1]

    def orbit(self, z: np.ndarray) -> FourierOrbit:
        """Complete a solution by its derivatives and its residual."""
        network, u, period = self.along.at(self.network, float(z[-1])), self._rows(z), float(z[-2])
        return complete(network, self.symmetry, u, period,
                        *equations(network, self.symmetry, u, period))


def through(orbit: FourierOrbit, line: ParameterLine, scales: tuple[float, float]
            ) -> tuple[FourierCurve, np.ndarray]:
    """Return the curve of the orbits along a line, and the place of one of them on it."""
    return (FourierCurve(orbit.network, orbit.symmetry, line, scales),
            np.array([*orbit.values.ravel(), orbit.period, line.value(orbit.network)]))


def beside(network: Network, symmetry: Symmetry, line: ParameterLine,
           scales: tuple[float, float], path: States, disturbance: States, period: float
           ) -> tuple[FourierCurve, np.ndarray, np.ndarray]:
    """Return the orbits near a state or an orbit: their curve, that on it, and how they leave it.

    Args:
        network: at the place.
        symmetry: of the orbits.
        line: of parameters.
        scales: as of the curve.
        path: states of what they leave, shape (m, components), over times in cycles.
        disturbance: the direction in which, the same.
        period: of the orbits, model time.

    """
    theta = np.arange(NODES) / NODES
    return (FourierCurve(network, symmetry, line, scales),
            np.append(rows_of(network, symmetry, path(theta)), [period, line.value(network)]),
            np.append(rows_of(network, symmetry, disturbance(theta)), [0.0, 0.0]))
