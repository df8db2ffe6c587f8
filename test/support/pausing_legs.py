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

"""Two oscillators that come to rest on their circle, where the angle stands still.

Coupling is diffusive: the hop is the orbit of one cell whatever k is.
"""

from dataclasses import dataclass

from two_sided import OTHER, TwoSided, WIDE


@dataclass(frozen=True)
class PausingLegs(TwoSided):
    """On the unit circle the angle obeys ``phi' = a - b cos phi``: T = 2 pi/sqrt(a^2 - b^2)."""

    a: float = 2.0
    b: float = 1.0
    k: float = 0.1

    name = 'pausing_legs'
    ranges = dict.fromkeys(('a', 'b', 'k'), WIDE)
    free = ('a', 'b')
    couplings = ('k',)
    usual_gait = 'hop'
    line = 'a'

    @staticmethod
    def equations(cell, p):
        x, y = cell.now()
        u, v = cell.now(OTHER)
        rest, turn = 1.0 - x ** 2 - y ** 2, p.a - p.b * x
        return rest * x - turn * y + p.k * (u - x), rest * y + turn * x + p.k * (v - y)
