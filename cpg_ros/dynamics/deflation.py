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

"""Deflation: Newton's method kept off the orbits that are known.

The equations are multiplied by ``m(T) = prod(1 + (w / (T/T_k - 1))^2)`` over the known
periods T_k, which has no bound there, so that the same start leads to another solution, if to any
(Farrell, Birkisson & Funke 2015, SIAM J. Sci. Comput. 37, A2026). Periods distinguish
orbits whatever the phase. The deflated step is Newton's own times a number.
"""

from collections.abc import Sequence

#: Width w, relative to a known period, of what deflation keeps free about it.
WIDTH = 0.1
#: The factor is at most this large: near a pole the step says little.
LARGEST = 3.0


def deflation_factor(period: float, step: float, known: Sequence[float]) -> float:
    """Return what Newton's step is multiplied by; 1 where no orbit is known.

    Args:
        period: the current one, in any unit of time.
        step: Newton's own step of it, in the same unit.
        known: periods of the orbits to be kept off, the same.

    """
    slope = 0.0
    for one in known:
        x = period / one - 1.0 or 1e-12
        slope -= 2.0 * WIDTH**2 / (x * (x * x + WIDTH**2)) / one
    factor = 1.0 / (1.0 - slope * step or 1e-12)
    return max(-LARGEST, min(LARGEST, factor))
