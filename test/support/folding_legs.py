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

"""Two cells whose stand folds: with x = y = 0 moved to x = m + c x_other^2.

The pair of the hop is on the axis where n = x, and 0 is a double root at c = 1, m = 1/4, n = 1/2.
"""

from dataclasses import dataclass

from cpg_ros.networks.network import Preset
from two_sided import OTHER, SHIFTS, TwoSided, WIDE


@dataclass(frozen=True)
class FoldingLegs(TwoSided):
    """x' = y, y' = m - x + c x_other^2 + (n - x) y."""

    m: float
    n: float
    c: float

    name = 'folding_legs'
    ranges = dict.fromkeys(('m', 'n', 'c'), WIDE)
    couplings = ('c',)
    usual_gait = 'walk'
    free = ('m', 'n')
    line = 'm'

    @staticmethod
    def equations(cell, p):
        x, y = cell.now()
        x_other, _ = cell.now(OTHER)
        return y, p.m - x + p.c * x_other ** 2 + (p.n - x) * y

    @classmethod
    def presets(cls):
        return {gait: Preset(gait, cls(0.1, 0.2, 1.0)) for gait in SHIFTS}
