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

"""Two legs with a second rhythm that meets half of the gait's pace, where both multipliers are -1.

``w' = (1 + i omega - |w|^2) w + k (w_other - w)``, w = x + i y, and ``z' = (growth + i nu) z
+ m w conj(z) - |z|^2 z + h z_other``, z = u + i v. On the hop w = exp(i omega t); with
z = exp(i omega t / 2) eta in both legs, ``eta' = (growth + h + i (nu - omega / 2)) eta
+ m conj(eta)``, of which the multipliers over a period are minus those of constant rates: on
growth = -h a torus is born where |nu - omega / 2| > m, and both are -1 where that is m.
"""

from dataclasses import dataclass

from cpg_ros.networks.network import Preset
from two_sided import OTHER, SHIFTS, TwoSided, WIDE


@dataclass(frozen=True)
class HalfTurns(TwoSided):
    """The two rhythms."""

    growth: float
    nu: float
    m: float
    h: float
    k: float
    omega: float

    name = 'half_turns'
    states = ('x', 'y', 'u', 'v')
    ranges = dict.fromkeys(('growth', 'nu', 'm', 'h', 'k', 'omega'), WIDE)
    couplings = ('h', 'k')
    usual_gait = 'hop'
    free = ('growth', 'nu')
    line = 'growth'

    @staticmethod
    def equations(cell, p):
        x, y, u, v = cell.now()
        x_other, y_other, u_other, v_other = cell.now(OTHER)
        rest, size = 1.0 - x ** 2 - y ** 2, u ** 2 + v ** 2
        return (rest * x - p.omega * y + p.k * (x_other - x),
                rest * y + p.omega * x + p.k * (y_other - y),
                (p.growth - size) * u - p.nu * v + p.m * (x * u + y * v) + p.h * u_other,
                (p.growth - size) * v + p.nu * u + p.m * (y * u - x * v) + p.h * v_other)

    @classmethod
    def presets(cls):
        return {gait: Preset(gait, cls(-1.0, 3.7, 0.5, 0.6, 0.4, 6.0)) for gait in SHIFTS}
