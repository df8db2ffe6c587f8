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

"""Curves in two parameters on which the period of a gait's orbits grows without bound.

There an orbit becomes homoclinic to an equilibrium, or a saddle node appears on it. With a large
period held, the second parameter is an unknown while the first one moves, as in AUTO's way to such
orbits (Doedel & Friedman 1989). Near a homoclinic orbit the parameter comes to its limit as
``exp(-lambda T)``, and from three periods at equal steps Aitken's formula gives it; near a saddle
node it does as a series in 1/T that begins with ``T^-2``, which is fitted to four (Kuznetsov,
*Elements of Applied Bifurcation Theory*, chapters 6 and 7).
"""

from dataclasses import replace
from typing import Any

from cpg_ros.atlas.chart import Chart
from cpg_ros.atlas.hopf_curves import Boundary
from cpg_ros.dynamics.arclength import CurvePoint, fixed_unknown, resolve_point
from cpg_ros.dynamics.branch_end import law_of_growth
from cpg_ros.dynamics.continuation import Branch, BranchPoint
from cpg_ros.dynamics.orbit import NoOrbit
import numpy as np

#: Steps of the first parameter in shares of its range.
STEP, SHORTEST = 1.0 / 24.0, 1.0 / 800.0
#: Shares of the largest period at which the second parameter is solved for, by law.
SHARES = {'homoclinic': (1.0, 0.95, 0.9), 'SNIC': (1.0, 0.9, 0.8, 0.7)}
#: Powers of 1/T in the series of a saddle node.
POWERS = 0, 2, 3, 4
#: Differences this small, in shares of the range, are rounding: the limit has been reached.
ROUNDING = 1e-11


def infinite_periods(chart: Chart, gait: str, branch: Branch, one: float) -> list[Boundary]:
    """Follow the ends of a branch at which its period grows without bound.

    Args:
        chart: the plane.
        gait: whose.
        branch: along the second axis.
        one: value on the first axis there.

    Returns:
        Boundaries 'homoclinic' and 'SNIC' (a saddle node on the invariant circle).

    """
    found = []
    for end, points in ((branch.ends[0], branch.points[::-1]), (branch.ends[1], branch.points)):
        if end.why == 'period' and (law := _law(points)):
            start = points[-1].place
            ways = [_followed(chart, start, one, way, SHARES[law]) for way in (-1.0, 1.0)]
            here = _limit(chart, start, one, SHARES[law])
            found.append(Boundary(law, (gait,), np.array([
                *ways[0][::-1], *([] if here is None else [(one, here[0])]), *ways[1]])))
    return [curve for curve in found if len(curve.points) > 1]


def _law(points: tuple[BranchPoint, ...]) -> str | None:
    return law_of_growth(np.array([point.value for point in points]),
                         np.array([point.orbit.period for point in points]))


def _followed(chart: Chart, place: CurvePoint, one: float, way: float, shares: tuple[float, ...]
              ) -> list[tuple[float, float]]:
    """Follow orbits of one large period from a place on, in a direction of the first parameter."""
    found: list[tuple[float, float]] = []
    step = STEP
    while step >= SHORTEST:
        new = one + way * step * chart.size[0]
        limit = (_limit(chart, place, new, shares)
                 if chart.first.low <= new <= chart.first.high else None)
        if limit is None:
            # Beyond the edge, too: up to it.
            step *= 0.5
            continue
        if not chart.second.low <= limit[0] <= chart.second.high:
            break
        found.append((new, limit[0]))
        place, one, step = limit[1], new, min(STEP, 1.5 * step)
    return found


def _limit(chart: Chart, place: CurvePoint, one: float, shares: tuple[float, ...]
           ) -> tuple[float, CurvePoint] | None:
    """Return the second parameter's limit at a value of the first, and the orbit nearest to it.

    Args:
        chart: the plane.
        place: an orbit of the large period, at a value of the first parameter nearby.
        one: the first parameter.
        shares: of that period, falling.

    """
    length = float(place.z[-2])
    places: list[CurvePoint] = []
    for share in shares:
        last = places[-1] if places else place
        curve: Any = last.curve
        z = last.z.copy()
        z[-2] = share * length
        try:
            found = resolve_point(replace(curve, network=chart.at(one, last.value)), z,
                                  fixed_unknown(z.size, -2))
        except (NoOrbit, np.linalg.LinAlgError):
            return None
        if found is None:
            return None
        places.append(found)
    return _extrapolated(np.array([point.value for point in places]), np.array(shares),
                         ROUNDING * chart.size[1]), places[0]


def _extrapolated(values: np.ndarray, shares: np.ndarray, rounding: float) -> float:
    """Return the limit of values at shares of a period, by the law that has as many."""
    if len(values) == len(POWERS):
        return float(np.linalg.solve(shares[:, None] ** -np.array(POWERS, dtype=float),
                                     values)[0])
    first, second, third = values
    bend = first - 2.0 * second + third
    if abs(first - second) <= rounding or not bend:
        return float(first)
    return float(first - (first - second)**2 / bend)
