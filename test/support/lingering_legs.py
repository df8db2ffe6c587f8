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

"""Two oscillators on the level curves of an energy, the last of which goes through a saddle.

Coupling is diffusive: the hop is the orbit of one cell whatever k is.
"""

from dataclasses import dataclass

import numpy as np
from two_sided import OTHER, TwoSided, WIDE


@dataclass(frozen=True)
class LingeringLegs(TwoSided):
    """Orbits are the closed curves ``y^2/2 - x^2/2 + x^3/3 = c + d b``, homoclinic where it is 0.

    ``H' = -b y^2 (H - c - d b)`` along solutions: for b > 0 they attract.
    """

    c: float = -0.1
    d: float = 0.0
    b: float = 2.0
    k: float = 0.1

    name = 'lingering_legs'
    ranges = dict.fromkeys(('c', 'd', 'b', 'k'), WIDE)
    free = ('c', 'd')
    couplings = ('k',)
    usual_gait = 'hop'
    line = 'c'

    @staticmethod
    def equations(cell, p):
        x, y = cell.now()
        u, v = cell.now(OTHER)
        energy = y ** 2 / 2.0 - x ** 2 / 2.0 + x ** 3 / 3.0
        return (y + p.k * (u - x), x - x ** 2 - p.b * y * (energy - p.c - p.d * p.b)
                + p.k * (v - y))

    def at_rest(self):
        return np.array([1.0, 0.0])
