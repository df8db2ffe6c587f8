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

"""The equations of a Hopf point in two parameters, and Newton's method for them.

The critical root is an unknown beside both parameters: ``det Delta(i omega; p1, p2) = 0`` is two
real equations in three unknowns. Parameters count in shares of their ranges.
"""

from collections.abc import Callable
from typing import Any

from cpg_ros.atlas.chart import Chart
from cpg_ros.dynamics.characteristic import characteristic_matrix
from cpg_ros.dynamics.equilibrium import equilibrium
from cpg_ros.dynamics.isotypic import block_at, blocks
from cpg_ros.errors import CpgError
import numpy as np

#: Newton's method: steps, and where it ends; differences for its matrix, in shares.
NEWTON, EXACT, DIFFERENCE = 12, 1e-12, 1e-6


class HopfCondition:
    """Two real equations in (p1, p2, omega), the parameters in shares of their ranges."""

    def __init__(self, chart: Chart, mode: tuple[int, ...]) -> None:
        """Take the plane and the class whose root crosses."""
        self.chart, self.mode = chart, mode

    def values(self, share: np.ndarray) -> np.ndarray:
        """Return the real and the imaginary part of the determinant, shape (2,)."""
        network = self.chart.at_share(share[:2])
        block = block_at(network, equilibrium(network), self.mode)
        matrix = characteristic_matrix(1j * share[2], block.now, block.past, network.delay)[0]
        found = np.linalg.det(matrix)
        return np.array([found.real, found.imag])

    def slopes(self, share: np.ndarray) -> np.ndarray:
        """Return their derivatives, shape (2, 3)."""
        return slopes(self.values, share, DIFFERENCE)

    def tangent(self, share: np.ndarray) -> np.ndarray:
        """Return the unit tangent of the curve, either way, shape (3,)."""
        return np.linalg.svd(self.slopes(share))[2][-1]

    def corrected(self, share: np.ndarray, tangent: np.ndarray) -> tuple[np.ndarray, int] | None:
        """Solve in the plane normal to a tangent; also how many steps it took; None if lost."""
        for count in range(NEWTON):
            try:
                matrix = np.vstack([self.slopes(share), tangent])
                move = np.linalg.solve(matrix, np.append(-self.values(share), 0.0))
            except (np.linalg.LinAlgError, CpgError, ArithmeticError):
                return None
            share = share + move
            if not np.abs(move).max() < 0.5:
                return None
            if np.abs(move).max() < EXACT:
                return share, count
        return None


def slopes(values: Callable[[np.ndarray], Any], share: np.ndarray, difference: float
           ) -> np.ndarray:
    """Return the derivatives of a function by its arguments, from central differences.

    Args:
        values: of m numbers, or of one.
        share: its argument, shape (n,).
        difference: of the argument.

    Returns:
        Shape (m, n), or (n,) if the function has one number.

    """
    return np.array([(values(share + step) - values(share - step)) / (2.0 * difference)
                     for step in difference * np.eye(share.size)]).T


def condition_of(chart: Chart, gait: str, share: np.ndarray) -> HopfCondition:
    """Return the condition of a gait's class at a Hopf point, of a wave's senses that which holds.

    Args:
        chart: the plane.
        gait: whose.
        share: (p1, p2, omega), the parameters in shares of their ranges.

    """
    network = chart.at_share(share[:2])
    conditions = [HopfCondition(chart, block.mode)
                  for block in blocks(network, equilibrium(network)) if block.gait == gait]
    return min(conditions, key=lambda one: float(np.abs(one.values(share)).max()))
