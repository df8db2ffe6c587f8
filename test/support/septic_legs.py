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

"""Two oscillators whose radii obey a polynomial, so that all of their orbits are in closed form.

On the walk ``mu - k + rho (a + rho (b - rho)) = 0`` with rho the square of the radius; on the hop
-k is k.
"""

from dataclasses import dataclass

from cpg_ros.networks.network import Preset
import numpy as np
from two_sided import OTHER, SHIFTS, TwoSided, WIDE


@dataclass(frozen=True)
class SepticLegs(TwoSided):
    """z' = (mu + i omega + a rho + b rho^2 - rho^3) z + (k + i kappa) z_other, rho = |z|^2."""

    mu: float
    omega: float
    k: float
    kappa: float
    a: float
    b: float

    name = 'septic_legs'
    ranges = dict.fromkeys(('mu', 'omega', 'k', 'kappa', 'a', 'b'), WIDE)
    couplings = ('k', 'kappa')
    usual_gait = 'walk'
    free = ('mu', 'k')
    line = 'mu'

    @staticmethod
    def equations(cell, p):
        x, y = cell.now()
        u, v = cell.now(OTHER)
        rho = x ** 2 + y ** 2
        rest = p.mu + p.a * rho + p.b * rho ** 2 - rho ** 3
        return (rest * x - p.omega * y + p.k * u - p.kappa * v,
                rest * y + p.omega * x + p.k * v + p.kappa * u)

    def at_rest(self):
        return np.zeros(2)

    @classmethod
    def presets(cls):
        return {gait: Preset(gait, cls(1.0, 6.0, -0.5, 0.0, -1.0, 0.0)) for gait in SHIFTS}
