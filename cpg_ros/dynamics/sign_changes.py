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

"""Where functions of one variable change their sign, looked for on a grid and refined."""

from collections.abc import Callable

import numpy as np
import scipy

#: Places are refined to this, absolute and relative to them.
EXACT = 1e-13
#: A turn on the grid may reach this many times further than it differs from its neighbours.
REACH = 4.0


def crossings(function: Callable[[float], float], grid: np.ndarray,
              values: np.ndarray | None = None) -> list[float]:
    """Find sign changes of a continuous function, in the order of the grid.

    Where it turns back before it reaches zero, its extremum is looked up as well: two crossings
    between neighbouring points of the grid are found, too.

    Args:
        function: of a place; nan where it has no value.
        grid: rising places, shape (n,).
        values: of the function there, where they are already known.

    """
    values = np.array([function(x) for x in grid]) if values is None else np.asarray(values)
    places, found = list(grid), list(values)
    sizes = np.abs(values)
    bend = np.maximum(sizes[:-2], sizes[2:]) - sizes[1:-1]
    turns = np.flatnonzero((sizes[1:-1] <= REACH * bend) & (sizes[1:-1] <= sizes[:-2])
                           & (sizes[1:-1] <= sizes[2:])
                           & (np.sign(values[:-2]) == np.sign(values[1:-1]))
                           & (np.sign(values[1:-1]) == np.sign(values[2:]))) + 1
    for k in turns[::-1]:
        side = np.sign(values[k])
        lowest = scipy.optimize.minimize_scalar(
            lambda x, side=side: side * function(x), method='bounded',
            bounds=(grid[k - 1], grid[k + 1]), options={'xatol': 1e-9})
        if lowest.fun < 0.0:
            at = int(np.searchsorted(places, lowest.x))
            places.insert(at, float(lowest.x))
            found.insert(at, side * lowest.fun)
    signs = np.sign(found)
    signs[signs == 0.0] = 1.0
    # Not a number where there is no value, whose product differs from -1.
    crossed = np.flatnonzero(signs[:-1] * signs[1:] == -1.0)
    return [root for k in crossed for root in _roots(function, *places[k:k + 2])]


def _roots(function: Callable[[float], float], low: float, high: float) -> list[float]:
    """Find where a function changes sign between two places; on both sides of a gap in it."""
    gap: list[float] = []

    def whole(x: float) -> float:
        value = function(x)
        if np.isnan(value):
            gap.append(x)
            # Any number ends the search: what it finds is not used.
            return 0.0
        return value

    root = float(scipy.optimize.brentq(whole, low, high, xtol=EXACT, rtol=EXACT))
    if not gap:
        return [root]
    edges = [(end, _last(function, end, gap[0])) for end in (low, high)]
    return [root for end, edge in edges if function(end) * function(edge) < 0.0
            for root in _roots(function, *sorted((end, edge)))]


def _last(function: Callable[[float], float], inside: float, outside: float) -> float:
    """Return the last place with a value, on the way to one without."""
    while abs(outside - inside) > EXACT * max(1.0, abs(inside)):
        middle = 0.5 * (inside + outside)
        if np.isnan(function(middle)):
            outside = middle
        else:
            inside = middle
    return inside
