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

from cpg_ros.networks.network import Preset
from two_sided import OTHER, SHIFTS, TwoSided, WIDE


@dataclass(frozen=True)
class FoldingSwing(TwoSided):
    """x' = m - x + c x_other^2, z' = (n + x + i omega) z, z = u + i v."""

    m: float
    n: float
    c: float
    omega: float

    name = 'folding_swing'
    states = ('u', 'v', 'x')
    ranges = dict.fromkeys(('m', 'n', 'c', 'omega'), WIDE)
    couplings = ('c',)
    usual_gait = 'walk'
    free = ('m', 'n')
    line = 'm'

    @staticmethod
    def equations(cell, p):
        u, v, x = cell.now()
        *_, x_other = cell.now(OTHER)
        return ((p.n + x) * u - p.omega * v, (p.n + x) * v + p.omega * u,
                p.m - x + p.c * x_other ** 2)

    @classmethod
    def presets(cls):
        return {gait: Preset(gait, cls(0.1, 0.2, 1.0, 3.0)) for gait in SHIFTS}
