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

"""Curves of folds and of unbounded periods of a gait's orbits in two parameters, with cusps.

At a fold the second parameter turns round along the branch: its component of the tangent is zero.
From a fold the next one is found by holding the unknowns in the plane normal to the last tangent
while the first parameter moves a step, and then going along the branch to where it turns.
"""

from collections.abc import Callable, Iterable, Iterator
from dataclasses import replace
from itertools import pairwise
from typing import Any

from cpg_ros.analysis.atlas.chart import COARSE, CodimensionTwo, ParameterPlane
from cpg_ros.analysis.atlas.grid import GaitMap, grid_indices
from cpg_ros.analysis.atlas.hopf_curves import Boundary, condition_of, HopfCondition, on_curve
from cpg_ros.analysis.atlas.orbit_curves import Edge
from cpg_ros.analysis.atlas.row_job import NONE, solve_from_wave
from cpg_ros.common.errors import CpgError
from cpg_ros.dynamics.arclength import (
    continue_steps,
    CurvePoint,
    fixed_unknown,
    NoOrbit,
    predict_and_correct,
    rate_along,
    resolve_point,
)
from cpg_ros.dynamics.continuation import (
    Branch,
    BranchPoint,
    continue_from_hopf,
    continue_orbit,
    law_of_growth,
)
from cpg_ros.dynamics.hopf import hopf_at
import numpy as np
from scipy.optimize import brentq, minimize_scalar

# Cusps of fold curves: points at which two folds of a branch meet and vanish.

#: CUSP_REACHES: distances, as fractions of the first parameter's range, along a branch in which
#: the second fold is searched for, and beyond the last fold of a curve in which its cusp is.
CUSP_REACHES = tuple(np.geomspace(0.01, 0.5, 16))
BEYOND = (0.00125, 0.005, 0.02)
#: ALONG: tolerance of the extremum along a branch; EXACT: tolerance of the cusp, as a fraction.
ALONG, EXACT = 1e-7, 1e-13
#: SMALLEST: amplitude below which orbits end in rest, not in a cusp.
SMALLEST = 0.02


def cusp_beyond(chart: ParameterPlane, gait: str, fold: CurvePoint, first: float, way: float
                ) -> CodimensionTwo | None:
    """Locate the cusp in which a fold curve ends; None if it ends otherwise.

    Args:
        chart: the plane.
        gait: whose.
        fold: the curve's last fold, along the second axis.
        first: value on the first axis there.
        way: 1 or -1, the direction in which the curve was followed.

    """
    if fold.amplitude < SMALLEST:
        return None
    try:
        reach, sign = _pair(fold)
        middle, _ = _extremum(rate_along(fold), reach, sign)
        base = predict_and_correct(fold, middle)
        if base.amplitude < SMALLEST:
            return None

        def place(value: float) -> CurvePoint:
            curve: Any = base.curve
            moved = replace(curve, network=chart.at(value, base.value))
            point = resolve_point(moved, base.z, base.tangent)
            if point is None:
                raise NoOrbit('the branch is lost')
            return point

        def dip(value: float) -> float:
            return _extremum(rate_along(place(value)), reach, sign)[1]

        for fraction in BEYOND:
            far = first + way * fraction * chart.size[0]
            if not chart.first.low <= far <= chart.first.high:
                return None
            if dip(far) > 0.0 > dip(first):
                cusp = brentq(dip, *sorted((first, far)), xtol=EXACT * chart.size[0], rtol=1e-15)
                there = place(cusp)
                middle, left = _extremum(rate_along(there), reach, sign)
                point = predict_and_correct(there, middle)
                if abs(left) > 1e-6 or abs(middle) > 0.9 * reach:
                    return None
                return CodimensionTwo('cusp', gait, (float(cusp), point.value), abs(left))
    except (NoOrbit, np.linalg.LinAlgError, ValueError):
        return None
    return None


def _pair(fold: CurvePoint) -> tuple[float, float]:
    """Return how far along the branch another fold is passed, and the sign of the rates beyond.

    Raises:
        NoOrbit: there is none so close.

    """
    rate = rate_along(fold)
    for reach in CUSP_REACHES:
        left, right = rate(-reach), rate(reach)
        if left * right > 0.0:
            return 1.5 * reach, float(np.sign(left))
    raise NoOrbit('no other fold')


def _extremum(rate: Callable[[float], float], reach: float, sign: float) -> tuple[float, float]:
    """Return the place at which the rate, with a sign, is least, and its value there."""
    extremum = minimize_scalar(lambda step: sign * rate(step), method='bounded',
                               bounds=(-reach, reach), options={'xatol': ALONG})
    return float(extremum.x), float(extremum.fun)


# Curves in two parameters on which the period of a gait's orbits grows without bound.

#: STEP, SHORTEST: longest and shortest step of the first parameter, as fractions of its range.
STEP, SHORTEST = 1.0 / 24.0, 1.0 / 800.0
#: SHARES: law of growth -> shares of the largest period at which the second parameter is solved
#: for.
SHARES = {'homoclinic': (1.0, 0.95, 0.9), 'SNIC': (1.0, 0.9, 0.8, 0.7)}
#: POWERS: powers of 1/T in the series of a saddle-node.
POWERS = 0, 2, 3, 4
#: ROUNDING: difference, as a fraction of the range, up to which the limit has been reached.
ROUNDING = 1e-11


def infinite_periods(chart: ParameterPlane, gait: str, branch: Branch,
                     first: float) -> list[Boundary]:
    """Follow the ends of a branch at which its period grows without bound.

    Args:
        chart: the plane.
        gait: whose.
        branch: along the second axis.
        first: value on the first axis there.

    Returns:
        Boundaries 'homoclinic' and 'SNIC' (a saddle node on the invariant circle).

    """
    curves = []
    for end, points in ((branch.ends[0], branch.points[::-1]), (branch.ends[1], branch.points)):
        if end.why == 'period' and (law := _law(points)):
            start = points[-1].place
            ways = [_continue_long_period(chart, start, first, way,
                                          SHARES[law]) for way in (-1.0, 1.0)]
            here = _limit(chart, start, first, SHARES[law])
            curves.append(Boundary(law, (gait,), np.array([
                *ways[0][::-1], *([] if here is None else [(first, here[0])]), *ways[1]])))
    return [curve for curve in curves if len(curve.points) > 1]


def _law(points: tuple[BranchPoint, ...]) -> str | None:
    return law_of_growth(np.array([point.value for point in points]),
                         np.array([point.orbit.period for point in points]))


def _continue_long_period(chart: ParameterPlane, point: CurvePoint, first: float, way: float,
                          fractions: tuple[float, ...]
              ) -> list[tuple[float, float]]:
    """Follow orbits of one large period from a place on, in a direction of the first parameter."""
    def advance(here: tuple[float, tuple[float, CurvePoint]], step: float
                ) -> tuple[float, tuple[float, CurvePoint]] | None:
        value = here[0] + way * step * chart.size[0]
        limit = (_limit(chart, here[1][1], value, fractions)
                 if chart.first.low <= value <= chart.first.high else None)
        return limit and (value, limit)

    limits: list[tuple[float, float]] = []
    for value, (limit, _) in continue_steps(advance, (first, (point.value, point)), STEP, SHORTEST,
                                            STEP):
        if not chart.second.low <= limit <= chart.second.high:
            break
        limits.append((value, limit))
    return limits


def _limit(chart: ParameterPlane, start: CurvePoint, first: float, fractions: tuple[float, ...]
           ) -> tuple[float, CurvePoint] | None:
    """Return the second parameter's limit at a value of the first, and the orbit nearest to it.

    Args:
        chart: the plane.
        start: an orbit of the large period, at a value of the first parameter nearby.
        first: the first parameter.
        fractions: of that period, falling.

    """
    length = float(start.z[-2])
    places: list[CurvePoint] = []
    for fraction in fractions:
        last = places[-1] if places else start
        curve: Any = last.curve
        z = last.z.copy()
        z[-2] = fraction * length
        try:
            solved = resolve_point(replace(curve, network=chart.at(first, last.value)), z,
                                   fixed_unknown(z.size, -2))
        except (NoOrbit, np.linalg.LinAlgError):
            return None
        if solved is None:
            return None
        places.append(solved)
    return _extrapolated(np.array([point.value for point in places]), np.array(fractions),
                         ROUNDING * chart.size[1]), places[0]


def _extrapolated(values: np.ndarray, fractions: np.ndarray, rounding: float) -> float:
    """Return the limit of values at shares of a period, by the law that has as many."""
    if len(values) == len(POWERS):
        return float(np.linalg.solve(fractions[:, None] ** -np.array(POWERS, dtype=float),
                                     values)[0])
    first, second, third = values
    bend = first - 2.0 * second + third
    if abs(first - second) <= rounding or not bend:
        return float(first)
    return float(first - (first - second)**2 / bend)


#: REACHES: arclengths along a branch within which its fold is searched for, one after another.
REACHES = (0.01, 0.03, 0.1, 0.3)
#: REST: amplitude below which an orbit counts as rest.
REST = 5e-3
#: TRIED: edges of the grid that are tried for a gait; MOST: most points of a branch; SAME:
#: distance, as a fraction of the ranges, up to which curves are equal.
TRIED, MOST, SAME = 8, 80, 0.02


def edges_without_orbit(chart: ParameterPlane, sheet: GaitMap) -> list[Edge]:
    """Return neighbours on the coarse grid, along the second axis, one of which has no orbit."""
    columns = grid_indices(chart.second.count, COARSE)
    edges = []
    for row in grid_indices(chart.first.count, COARSE):
        for column, other in pairwise(columns):
            for at, there in (((row, column), (row, other)), ((row, other), (row, column))):
                if at in sheet.waves and sheet.label[there] == NONE:
                    edges.append(Edge(chart.fraction(at), chart.fraction(there), *sheet.waves[at]))
    return edges


def fold_curves(job: tuple[ParameterPlane, str, list[Edge]]) -> list[Boundary]:
    """Follow the folds at which a gait is lost over some edges; most are lost at Hopf points.

    Where the branch ends in orbits without a period these are followed, too.
    """
    chart, gait, edges = job
    curves: list[Boundary] = []
    for edge in edges[::max(1, len(edges) // TRIED)]:
        try:
            branch = _branch(chart, gait, edge)
        except (CpgError, np.linalg.LinAlgError):
            continue
        first = chart.first.low + edge.here[0] * chart.size[0]
        for fold in branch.folds:
            if not _known(chart, curves, first, fold.value):
                curves.append(fold_curve(chart, gait, fold.place, first))
        if any(end.why == 'period' and not _known(chart, curves, first, end.value)
               for end in branch.ends):
            curves += infinite_periods(chart, gait, branch, first)
    return curves


def _known(chart: ParameterPlane, curves: list[Boundary], first: float, second: float) -> bool:
    point = (np.array([first, second]) - chart.low) / chart.size
    return any(on_curve(curve, chart, point, SAME) for curve in curves)


def fold_curve(chart: ParameterPlane, gait: str, fold: CurvePoint, first: float) -> Boundary:
    """Follow the folds on both sides of one, with the cusps in which they end.

    Args:
        chart: the plane.
        gait: whose.
        fold: a fold along the second axis.
        first: value on the first axis there.

    """
    back, ahead = (continue_fold(chart, fold, first, way) for way in (-1.0, 1.0))
    points = [(value, member.value) for value, member in
              [*back[::-1], (first, fold), *ahead]]
    ends = [(back or [(first, fold)])[-1], (ahead or [(first, fold)])[-1]]
    cusps = [cusp_beyond(chart, gait, member, value, way)
             for (value, member), way in zip(ends, (-1.0, 1.0), strict=True)]
    # A cusp is the last point of its curve.
    return Boundary('fold', (gait,), np.array([
        *(cusp.values for cusp in cusps[:1] if cusp), *points,
        *(cusp.values for cusp in cusps[1:] if cusp)]), tuple(filter(None, cusps)))


def _branch(chart: ParameterPlane, gait: str, edge: Edge) -> Branch:
    """Return the branch in the row of an edge."""
    orbit = solve_from_wave(chart.at_fractions(edge.here), gait, edge.wave, edge.period)
    return continue_orbit(orbit, chart.second.line, chart.second.low, chart.second.high,
                          most=MOST)


def continue_fold(chart: ParameterPlane, fold: CurvePoint, first: float, way: float
             ) -> list[tuple[float, CurvePoint]]:
    """Follow folds from one on in a direction of the first parameter.

    Args:
        chart: the plane.
        fold: a fold along the second axis.
        first: value on the first axis there.
        way: 1 or -1, the direction.

    Returns:
        The value on the first axis and the fold, of each.

    """
    path = [(first, fold)]

    def advance(here: tuple[float, CurvePoint], step: float) -> tuple[float, CurvePoint] | None:
        (value, last), guess = here, here[1].z
        new = value + way * step * chart.size[0]
        if not chart.first.low <= new <= chart.first.high:
            return None
        if len(path) > 1 and path[-2][1].z.size == guess.size:
            guess = guess + (guess - path[-2][1].z) * (new - value) / (value - path[-2][0])
        ahead = _next(chart, last, new, guess)
        # Beyond a Bautin point the Hopf point remains, where branches turn, too. A fold off the
        # course is another one of the branch.
        if ahead is None or ahead.amplitude < REST or not _on_course(
                chart, [*path[1:][-2:], (new, ahead)], step):
            return None
        return new, ahead

    for here in continue_steps(advance, (first, fold), STEP, SHORTEST, STEP):
        if not chart.second.low <= here[1].value <= chart.second.high:
            break
        path.append(here)
    return path[1:]


def _on_course(chart: ParameterPlane, last: list[tuple[float, CurvePoint]], step: float) -> bool:
    """Tell whether a fold lies close to the extrapolation of the two folds before it."""
    if len(last) < 3:
        return True
    (a, one), (b, two), (c, three) = last
    ahead = two.value + (two.value - one.value) * (c - b) / (b - a)
    return bool(abs(three.value - ahead) < 0.5 * step * chart.size[1])


def _next(chart: ParameterPlane, fold: CurvePoint, new: float,
          guess: np.ndarray) -> CurvePoint | None:
    """Return the fold at a value of the first parameter, from one nearby, or None."""
    curve: Any = fold.curve
    moved = replace(curve, network=chart.at(new, fold.value))
    try:
        near = resolve_point(moved, guess, fold.tangent)
        if near is None:
            return None
        rate = rate_along(near)
        for reach in REACHES:
            if rate(-reach) * rate(reach) < 0.0:
                return predict_and_correct(near, brentq(rate, -reach, reach, xtol=1e-11))
    except (NoOrbit, np.linalg.LinAlgError):
        return None
    return None


# The curve of folds of orbits that is born at a Bautin point.

#: BESIDE: distances from the Bautin point, as fractions of the ranges, at which a branch starts;
#: AMPLITUDE: of its first orbit; LONGEST: its longest step; MOST_POINTS: its most points.
BESIDE, AMPLITUDE, LONGEST, MOST_POINTS = (0.03, 0.06, 0.12), 0.01, 0.05, 80
#: NEAR: largest distance of a fold from its Hopf point, as a fraction; END: largest distance of a
#: curve's end from the Bautin point at which it ends there.
NEAR, END = 0.2, 0.02
#: SAME_CURVE: distance, as a fraction, up to which two curves are one.
SAME_CURVE = 3e-3


def bautin_folds(job: tuple[ParameterPlane, Boundary]) -> list[Boundary]:
    """Follow the fold curves that are born at the Bautin points of a curve of Hopf points.

    Each begins with the Bautin point. Of one that cannot be started there is none, as where the
    branch does not turn within the plane.
    """
    chart, curve = job
    curves = []
    for point in curve.codimension_two:
        if point.kind == 'Bautin':
            born = _born(chart, point)
            if born is not None:
                curves.append(born)
    return curves


def distinct(chart: ParameterPlane, curves: Iterable[Boundary]) -> list[Boundary]:
    """Leave out fold curves that run along one before them, which may have been met elsewhere."""
    kept: list[Boundary] = []
    for curve in curves:
        fractions = curve.fractions(chart)
        some = fractions[[len(fractions) * k // 4 for k in (1, 2, 3)]]
        if curve.kind != 'fold' or not any(
                other.kind == 'fold' and other.gaits == curve.gaits
                and all(on_curve(other, chart, fraction, SAME_CURVE) for fraction in some)
                for other in kept):
            kept.append(curve)
    return kept


def _born(chart: ParameterPlane, point: CodimensionTwo) -> Boundary | None:
    fraction = np.append((np.array(point.values) - chart.low) / chart.size, point.omega)
    condition = condition_of(chart, point.gait, fraction)
    tangent = condition.tangent(fraction)
    if abs(tangent[0]) < abs(tangent[1]):
        # Branches have to cross the Hopf curve, not to run along it.
        born = _born(replace(chart, first=chart.second, second=chart.first), _turned(point))
        return born and Boundary('fold', born.gaits, born.points[:, ::-1],
                                 tuple(map(_turned, born.codimension_two)))
    for fold, first in _folds(condition, fraction, tangent):
        whole = fold_curve(chart, point.gait, fold, first)
        points = whole.points
        gaps = [(np.abs(end - point.values) / chart.size).max()
                for end in (points[0], points[-1])]
        if min(gaps) > END:
            continue
        if gaps[1] < gaps[0]:
            points = points[::-1]
        return Boundary('fold', whole.gaits, np.array([point.values, *points]),
                        (point, *whole.codimension_two))
    return None


def _turned(point: CodimensionTwo) -> CodimensionTwo:
    """Return a point of the plane with its axes exchanged."""
    return replace(point, values=point.values[::-1])


def _folds(condition: HopfCondition, fraction: np.ndarray, tangent: np.ndarray
           ) -> Iterator[tuple[CurvePoint, float]]:
    """Yield the first folds of branches from Hopf points on both sides, and the first value."""
    chart, mode = condition.chart, condition.mode
    line = chart.second.line
    for beside in BESIDE:
        for way in (-1.0, 1.0):
            place = condition.corrected(fraction + way * beside * tangent, tangent)
            if place is None:
                continue
            one, other = chart.values_at(place[:2])
            if not (chart.first.low <= one <= chart.first.high
                    and chart.second.low <= other <= chart.second.high):
                continue
            try:
                hopf = hopf_at(chart.at(one, other), line, mode, float(place[2]))
                branch = continue_from_hopf(
                    hopf.network, hopf.block.symmetry, hopf.omega, line, chart.second.low,
                    chart.second.high, rest=hopf.state, vector=hopf.eigenvector,
                    amplitude=AMPLITUDE, longest_step=LONGEST, most=MOST_POINTS)
            except (CpgError, np.linalg.LinAlgError):
                continue
            for fold in branch.folds[:1]:
                if abs(fold.value - other) < NEAR * chart.size[1]:
                    yield fold.place, one
