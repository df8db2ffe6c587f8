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

"""Meshes whose ends lie where the rates have a kink, so that collocation keeps its order.

Where a network's rates are smooth but for kinks, as of ``max(0, u)`` at ``u = 0``, a polynomial
across one is of second order only. With an end of an interval at every kink all intervals are
smooth, and the method is of its full order again. The kinks are found on the solution, an end is
put on each, and the orbit is solved for anew: what a misplaced end does wrong is of the square of
how far it is off, so that a few rounds place them to the last digit.
"""

import numpy as np
from numpy.polynomial import polynomial

#: Places of an interval between which a change of sign is looked for.
PLACES = np.linspace(0.0, 1.0, 9)
#: An end this near to a kink, over the whole, is on it.
ON = 1e-13
#: An end is moved that is nearer than this share of the shorter interval beside it.
NEAR = 0.4


def places_of(mesh: np.ndarray, coefficients: np.ndarray) -> np.ndarray:
    """Return the places, 0 to 1, at which variables change sign, rising.

    Args:
        mesh: ends of the intervals, shape (n + 1,).
        coefficients: of the variables' polynomials on each, shape (S + 1, n, variables).

    """
    values = polynomial.polyval(PLACES[:, None, None], coefficients[:, None], tensor=False)
    begin, interval, variable = np.nonzero(values[:-1] * values[1:] < 0.0)
    low, high = PLACES[begin], PLACES[begin + 1]
    terms = coefficients[:, interval, variable]
    rising = values[begin + 1, interval, variable] > 0.0
    for _ in range(60):
        middle = 0.5 * (low + high)
        above = (polynomial.polyval(middle, terms, tensor=False) > 0.0) == rising
        low, high = np.where(above, low, middle), np.where(above, middle, high)
    found = np.sort(mesh[interval] + 0.5 * (low + high) * np.diff(mesh)[interval])
    # Cells that are in phase, and ends that a kink lies on, are met twice.
    return found[np.diff(found, prepend=-1.0) > 1e-9]


def aligned(mesh: np.ndarray, kinks: np.ndarray) -> np.ndarray | None:
    """Return a mesh with an end on each kink, or None if it has one there.

    Args:
        mesh: ends of the intervals, from 0 to 1, shape (n + 1,).
        kinks: their places, rising, shape (m,).

    """
    gaps = np.abs(mesh[:, None] - kinks).min(axis=0) if kinks.size else np.zeros(0)
    if not (gaps > ON).any():
        return None
    fixed = [0.0, 1.0, *(kink for kink in kinks if ON < kink < 1.0 - ON)]
    free = [end for k, end in enumerate(mesh[1:-1], 1) if not any(
        abs(end - one) < NEAR * min(end - mesh[k - 1], mesh[k + 1] - end) for one in fixed)]
    return np.array(sorted({*fixed, *free}))
