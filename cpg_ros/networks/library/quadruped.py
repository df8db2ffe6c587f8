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

"""The quadruped network: eight Morris-Lecar cells in two rings (Buono & Golubitsky 2001).

Coupling is linear synaptic (their eq. 4.4): to v_i' is added ``alpha v_{i-2} + gamma v_{s(i)} +
xi v_{i+4}``, to w_i' ``beta w_{i-2} + delta w_{s(i)} + eta w_{i+4}``, indices cyclic in 1..8, s
swapping 1-2, 3-4, 5-6, 7-8. The network is equivariant under Z4 (i -> i + 2) x Z2 (s).
"""

from dataclasses import dataclass
from fractions import Fraction
from typing import Any, ClassVar

from cpg_ros.networks.definition import Cell, Number, Range
from cpg_ros.networks.leg_numbers import leg_positions
from cpg_ros.networks.library.morris_lecar import constants, excess, rates
from cpg_ros.networks.network import known, Network
from cpg_ros.networks.symmetry import GAITS, Symmetry, Z4_Z2

CELLS = 8

#: The inputs of cell i: i - 2 behind it, s(i) on the other side, i + 4 across its ring.
BEHIND = tuple((i - 2) % CELLS for i in range(CELLS))
ACROSS = tuple(i ^ 1 for i in range(CELLS))
OPPOSITE = tuple((i + 4) % CELLS for i in range(CELLS))


@dataclass(frozen=True)
class Quadruped(Network):
    """Couplings of the quadruped network, in 1/model time."""

    alpha: float
    beta: float
    gamma: float
    delta: float
    xi: float = 0.0
    eta: float = 0.0

    name: ClassVar[str] = 'quadruped'
    cells: ClassVar[int] = CELLS
    states: ClassVar[tuple[str, ...]] = ('v', 'w')
    readout: ClassVar = 'phase'
    step: ClassVar[float] = 0.01
    ranges: ClassVar[dict[str, Range]] = {
        key: Range(-5.0, 5.0, f'coupling of {variable} from {source}')
        for key, variable, source in (
            ('alpha', 'v', 'the preceding cell on the same side'),
            ('beta', 'w', 'the preceding cell on the same side'),
            ('gamma', 'v', 'the opposite cell'), ('delta', 'w', 'the opposite cell'),
            ('xi', 'v', 'the cell across its ring'), ('eta', 'w', 'the cell across its ring'))}
    #: Those of section 6.
    constants: ClassVar[dict[str, tuple[float, Range]]] = constants(
        g_ca=3.0, v_ca=1.0, g_k=1.8, v_k=-0.8, g_l=0.6, v_l=-1.8, v1=0.2, v2=0.4, v3=0.3, v4=0.2,
        base=0.0, current=1.0, phi=0.2, diffusion=0.0)
    couplings: ClassVar[tuple[str, ...]] = ('alpha', 'beta', 'gamma', 'delta', 'xi', 'eta')
    #: The assignments of Table 3 and of Theorem 3.3 (Table 4).
    legs: ClassVar[dict[str, dict[str, tuple[int, ...]]]] = {
        'implicit': {'lh': (1, 7), 'rh': (2, 8), 'lf': (3, 5), 'rf': (4, 6)},
        'zigzag': {'lh': (1, 5), 'rh': (2, 6), 'lf': (3, 7), 'rf': (4, 8)},
        'crisscross': {'lh': (1, 6), 'rh': (2, 5), 'lf': (3, 8), 'rf': (4, 7)}}
    sides: ClassVar[dict[str, str]] = leg_positions(4)['sides']
    girdles: ClassVar[dict[str, str]] = leg_positions(4)['girdles']
    usual_gait: ClassVar[str] = 'trot'
    usual_robot: ClassVar[str] = 'quadruped'
    free: ClassVar[tuple[str, ...]] = ('alpha', 'beta')
    line: ClassVar[str] = 'alpha=beta'
    span: ClassVar[tuple[float, float] | None] = (-1.0, 1.0)
    #: About what Table 13 uses for most gaits, where xi and eta are 0.
    searched: ClassVar[dict[str, tuple[float, float]]] = {
        **dict.fromkeys(('alpha', 'beta', 'gamma', 'delta'), (-0.8, 0.8)),
        'xi': (0.0, 0.0), 'eta': (0.0, 0.0)}
    typical_cycle: ClassVar[tuple[tuple[float, float, float], ...]] = (
        (0.2, 0.5, 0.0), (0.45, 0.3, 0.2))

    @staticmethod
    def equations(cell: Cell, p: Any) -> tuple[Number, ...]:
        """Section 6 and eq. 4.4; see the module."""
        v, w = cell.now()
        dv, dw = rates(v, w, p)
        for source, a, b in ((BEHIND, p.alpha, p.beta), (ACROSS, p.gamma, p.delta),
                             (OPPOSITE, p.xi, p.eta)):
            v_j, w_j = cell.now(source)
            dv, dw = dv - a * excess(v, v_j, p), dw - b * excess(w, w_j, p)
        return dv, dw

    @classmethod
    def gaits(cls) -> tuple[str, ...]:
        """Return the names of the six primary gaits."""
        return tuple(GAITS)

    def symmetry(self, gait: str) -> Symmetry:
        """Return the gait's symmetry.

        In walk and jump each cell follows its input for alpha >= 0 (LH leads LF), and precedes it
        for alpha < 0.

        Raises:
            ValueError: the gait is not one of the six primary ones.

        """
        j, k = GAITS[known(gait, self.gaits())]
        j = 3 if j == 1 and self.alpha >= 0.0 else j
        return Symmetry.of(Z4_Z2, {'omega': Fraction(j, 4), 'kappa': Fraction(k, 2)})
