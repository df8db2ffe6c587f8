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

"""Two oscillators driven by a state that folds, at c = 1 where m = 1/4 and x = 1/2.

The pair is on the axis where n = -x, so the curve ends at m = 1/4, n = -1/2.
"""

from dataclasses import dataclass
from fractions import Fraction

from cpg_ros.networks.network import known, Network, Preset, Range
from cpg_ros.networks.symmetry import Group, Symmetry

OTHER = (1, 0)
Z2 = Group(2, (('side', OTHER),))
SHIFTS = {'hop': Fraction(0), 'walk': Fraction(1, 2)}
WIDE = Range(-50.0, 50.0, '')


@dataclass(frozen=True)
class FoldingSwing(Network):
    """x' = m - x + c x_other^2, z' = (n + x + i omega) z, z = u + i v."""

    m: float
    n: float
    c: float
    omega: float

    name = 'folding_swing'
    cells = 2
    states = ('u', 'v', 'x')
    readout = 'phase'
    step = 0.01
    ranges = dict.fromkeys(('m', 'n', 'c', 'omega'), WIDE)
    couplings = ('c',)
    legs = {'ankle': {'left': (1,), 'right': (2,)}}
    usual_gait = 'walk'
    free = ('m', 'n')
    line = 'm'
    span = (-1.0, 3.0)

    @staticmethod
    def equations(cell, p):
        u, v, x = cell.now()
        *_, x_other = cell.now(OTHER)
        return ((p.n + x) * u - p.omega * v, (p.n + x) * v + p.omega * u,
                p.m - x + p.c * x_other ** 2)

    @classmethod
    def gaits(cls):
        return tuple(SHIFTS)

    def symmetry(self, gait):
        return Symmetry.of(Z2, {'side': SHIFTS[known(gait, self.gaits())]})

    @classmethod
    def presets(cls):
        return {gait: Preset(gait, cls(0.1, 0.2, 1.0, 3.0)) for gait in SHIFTS}
