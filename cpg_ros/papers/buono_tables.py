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

"""Tables 6 to 11 of Buono & Golubitsky (2001) exactly as printed, for linear synaptic coupling.

They are compared with the blocks of the linearisation; their errors are kept, and noted where
they occur. Couplings are alpha, beta, gamma, delta, xi, eta of
the network, (j, k) the class; j is 0 to 3, or 0 and 2 for the real blocks.
"""

from dataclasses import dataclass

from cpg_ros.networks.quadruped import Quadruped
import numpy as np

#: Table 6: L_jk = A + sum of these multiples of B, C and D.
TABLE_6 = {(0, 0): (1, 1, 1), (0, 1): (1, -1, 1), (2, 0): (-1, 1, 1), (2, 1): (-1, -1, 1),
           (1, 0): (-1j, 1, -1), (1, 1): (-1j, -1, -1), (3, 0): (1j, 1, -1),
           (3, 1): (1j, -1, -1)}
#: Table 7: signs of alpha + beta, gamma + delta and xi + eta in the trace. The last sign of L_21
#: contradicts Tables 6, 8 and 11: it should be +1.
TABLE_7 = {(0, 0): (1, 1, 1), (0, 1): (1, -1, 1), (2, 0): (-1, 1, 1), (2, 1): (-1, -1, -1)}
#: Table 8: signs of alpha - beta, gamma - delta and xi - eta in D_jk.
TABLE_8 = {(0, 0): (1, 1, 1), (0, 1): (1, -1, 1), (2, 0): (-1, 1, 1), (2, 1): (-1, -1, 1)}
#: Table 11: multiples of alpha, gamma and xi that are added to nu.
TABLE_11 = {(0, 0): (2, 2, 2), (0, 1): (2, -2, 2), (2, 0): (-2, 2, 2), (2, 1): (-2, -2, 2),
            (1, 0): (0, 2, -2), (1, 1): (0, -2, -2)}


@dataclass(frozen=True)
class Tables:
    """The tables' entries for a network.

    Attributes:
        network: couplings.
        a, b, c, d: A, the derivatives of an uncoupled cell's rates at the stand.

    """

    network: Quadruped
    a: float
    b: float
    c: float
    d: float

    @classmethod
    def at(cls, network: Quadruped, linearisation: np.ndarray) -> 'Tables':
        """Take a, b, c, d from the linearisation of an uncoupled cell at the stand, (2, 2)."""
        return cls(network, *(float(entry) for entry in linearisation.ravel()))

    @property
    def _sums(self) -> np.ndarray:
        n = self.network
        return np.array([n.alpha + n.beta, n.gamma + n.delta, n.xi + n.eta])

    @property
    def _differences(self) -> np.ndarray:
        n = self.network
        return np.array([n.alpha - n.beta, n.gamma - n.delta, n.xi - n.eta])

    @property
    def nu(self) -> float:
        """Trace of A."""
        return self.a + self.d

    @property
    def determinant(self) -> float:
        """Determinant of A, the paper's Delta."""
        return self.a * self.d - self.b * self.c

    def block(self, j: int, k: int) -> np.ndarray:
        """Table 6: L_jk, shape (2, 2)."""
        n = self.network
        coupled = np.array([[n.alpha, n.beta], [n.gamma, n.delta], [n.xi, n.eta]])
        return np.array([[self.a, self.b], [self.c, self.d]]) + np.diag(
            np.array(TABLE_6[j, k]) @ coupled)

    def trace(self, j: int, k: int) -> float:
        """Table 7: trace of a real block."""
        return float(self.nu + np.dot(TABLE_7[j, k], self._sums))

    def discriminant(self, j: int, k: int) -> float:
        """Table 8: D_jk of a real block, ``(tr L_jk)^2 - 4 det L_jk``."""
        first = self.a - self.d + np.dot(TABLE_8[j, k], self._differences)
        return float(first**2 + 4.0 * self.b * self.c)

    def phi(self, j: int, k: int) -> float:
        """Table 9: real part of ``(tr L_jk)^2 - 4 det L_jk`` of a complex block, j = 1 or 3."""
        along, across, ring = self._differences
        whole, apart = self.nu**2 - 4.0 * self.determinant - along**2, 2.0 * (self.a - self.d)
        if k == 0:
            return float(whole + (across - ring) * (apart + across - ring))
        return float(whole + (across + ring) * (across + ring - apart))

    def psi(self, j: int, k: int) -> float:
        """Table 10: imaginary part of ``(tr L_jk)^2 - 4 det L_jk`` of a complex block."""
        along, across, ring = self._differences
        sign = {1: -2.0, 3: 2.0}[j]
        return float(sign * along * (self.a - self.d + (across if k == 0 else -across) - ring))

    def sigma(self, j: int, k: int) -> float:
        """Table 11: "real part of the eigenvalue" where alpha = beta, gamma = delta, xi = eta.

        It is the trace, twice the real part of either eigenvalue.
        """
        n = self.network
        return float(self.nu + np.dot(TABLE_11[j, k], [n.alpha, n.gamma, n.xi]))

    def real_parts(self, k: int) -> tuple[float, float]:
        """Proposition 5.2, eqs. 5.4 and 5.5: real parts in the component U_1k, the larger first.

        Twice the real parts: the factor 1/2 of the quadratic formula is missing.
        """
        _, across, ring = self._sums
        trace = self.nu + (across if k == 0 else -across) - ring
        phi, psi = self.phi(1, k), self.psi(1, k)
        root = np.sqrt((phi + np.hypot(phi, psi)) / 2.0)
        return float(trace + root), float(trace - root)


def square_root(phi: float, psi: float) -> complex:
    """Square root of ``phi + i psi`` as in eq. 5.3, which holds for psi >= 0 only."""
    size = np.hypot(phi, psi)
    return complex(np.sqrt((phi + size) / 2.0), np.sqrt((size - phi) / 2.0))
