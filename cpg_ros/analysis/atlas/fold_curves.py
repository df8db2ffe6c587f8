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

At a fold the component of the tangent along the second parameter is zero. The next fold follows
from a step of the first parameter with the unknowns in the plane normal to the last tangent, and
then along the branch to the zero of that component.
"""

from collections.abc import Iterable, Iterator
from dataclasses import replace
from functools import partial
from typing import Any

from cpg_ros.analysis.atlas.chart import CodimensionTwo, ParameterPlane
from cpg_ros.analysis.atlas.grid import GaitMap, NONE, solve_from_wave
from cpg_ros.analysis.atlas.hopf_curves import Boundary, condition_of, HopfCondition
from cpg_ros.analysis.atlas.orbit_curves import Edge
from cpg_ros.common.errors import CpgError
from cpg_ros.dynamics.arclength import (
    continue_steps,
    CurvePoint,
    fixed_unknown,
    locate,
    NoOrbit,
    predict_and_correct,
    rate_along,
    resolve_point,
)
from cpg_ros.dynamics.continuation import (
    Branch,
    continue_from_hopf,
    continue_orbit,
    law_of_growth,
)
from cpg_ros.dynamics.hopf import hopf_at
import numpy as np
from scipy.optimize import minimize_scalar

# Cusps of fold curves, in which two folds of a branch meet.

#: Distances along a branch at which the second fold is searched, and distances of the cusp beyond
#: the last fold of a curve, in fractions of the first parameter's range.
CUSP_REACHES = tuple(np.geomspace(0.01, 0.5, 16))
CUSP_DISTANCES = (0.00125, 0.005, 0.02)
#: Of the extremum along a branch, and of the cusp, as a fraction.
EXTREMUM_TOLERANCE, CUSP_TOLERANCE = 1e-7, 1e-13
#: Amplitude of the smallest orbits at a cusp.
MIN_CUSP_AMPLITUDE = 0.02


def cusp_beyond(chart: ParameterPlane, gait: str, fold: CurvePoint, first: float,
                direction: float) -> CodimensionTwo | None:
    """Locate the cusp in which a fold curve ends; None if it ends otherwise.

    Args:
        chart: the plane.
        gait: of the curve.
        fold: the curve's last fold, along the second axis.
        first: value on the first axis there.
        direction: 1 or -1, in which the curve was followed along the first axis.

    """
    if fold.amplitude < MIN_CUSP_AMPLITUDE:
        return None
    try:
        reach, sign = _pair(fold)
        base = predict_and_correct(fold, _extremum(fold, reach, sign)[0])
        if base.amplitude < MIN_CUSP_AMPLITUDE:
            return None

        def branch_at(value: float) -> tuple[float, CurvePoint]:
            curve: Any = base.curve
            moved = replace(curve, network=chart.at(value, base.value))
            point = resolve_point(moved, base.z, base.tangent)
            if point is None:
                raise NoOrbit('the branch is lost')
            return value, point

        def least_rate(branch: tuple[float, CurvePoint]) -> float:
            return _extremum(branch[1], reach, sign)[1]

        for fraction in CUSP_DISTANCES:
            far = first + direction * fraction * chart.size[0]
            if far not in chart.first:
                return None
            if least_rate(branch_at(far)) > 0.0 > least_rate(branch_at(first)):
                cusp, branch = locate(least_rate, branch_at, min(first, far), max(first, far),
                                      CUSP_TOLERANCE * chart.size[0])
                middle, residual = _extremum(branch, reach, sign)
                point = predict_and_correct(branch, middle)
                if abs(residual) > 1e-6 or abs(middle) > 0.9 * reach:
                    return None
                return CodimensionTwo('cusp', gait, (float(cusp), point.value), abs(residual))
    except (NoOrbit, np.linalg.LinAlgError, ValueError):
        return None
    return None


def _pair(fold: CurvePoint) -> tuple[float, float]:
    """Return the distance along the branch of another fold, and the sign of the rates beyond.

    Raises:
        NoOrbit: there is none so close.

    """
    rate = rate_along(fold)
    for reach in CUSP_REACHES:
        left, right = rate(-reach), rate(reach)
        if left * right > 0.0:
            return 1.5 * reach, float(np.sign(left))
    raise NoOrbit('no other fold')


def _extremum(point: CurvePoint, reach: float, sign: float) -> tuple[float, float]:
    """Return the step from a point that minimises the rate times a sign, and the minimum."""
    rate = rate_along(point)
    extremum = minimize_scalar(lambda step: sign * rate(step), method='bounded',
                               bounds=(-reach, reach), options={'xatol': EXTREMUM_TOLERANCE})
    return float(extremum.x), float(extremum.fun)


# Curves in two parameters on which the period of a gait's orbits grows without bound.

#: Steps of the first parameter, as fractions of its range.
MAX_STEP, MIN_STEP = 1.0 / 24.0, 1.0 / 800.0
#: Fractions of the largest period at which the second parameter is solved for, by law.
PERIOD_FRACTIONS = {'homoclinic': (1.0, 0.95, 0.9), 'SNIC': (1.0, 0.9, 0.8, 0.7)}
#: Powers of 1/T in the series of a saddle node.
POWERS = 0, 2, 3, 4
#: Rounding error of the second parameter, in fractions of its range.
ROUNDING = 1e-11


def infinite_periods(chart: ParameterPlane, gait: str, branch: Branch,
                     first: float) -> list[Boundary]:
    """Follow the ends of a branch at which its period grows without bound.

    Args:
        chart: the plane.
        gait: of the branch.
        branch: along the second axis.
        first: value on the first axis there.

    Returns:
        Boundaries 'homoclinic' and 'SNIC' (a saddle node on the invariant circle).

    """
    curves = []
    for end, points in ((branch.ends[0], branch.points[::-1]), (branch.ends[1], branch.points)):
        law = None if end.why != 'period' else law_of_growth(
            np.array([point.value for point in points]),
            np.array([point.orbit.period for point in points]))
        if law:
            start, fractions = points[-1].curve_point, PERIOD_FRACTIONS[law]
            back, ahead = (_continue_long_period(chart, start, first, direction, fractions)
                           for direction in (-1.0, 1.0))
            limit = _limit(chart, start, first, fractions)
            curves.append(Boundary(law, (gait,), np.array([
                *back[::-1], *([] if limit is None else [(first, limit[0])]), *ahead])))
    return [curve for curve in curves if len(curve.points) > 1]


def _continue_long_period(chart: ParameterPlane, point: CurvePoint, first: float, direction: float,
                          fractions: tuple[float, ...]) -> list[tuple[float, float]]:
    """Follow orbits of a large period in a direction of the first parameter."""
    def advance(last: tuple[float, tuple[float, CurvePoint]], step: float
                ) -> tuple[float, tuple[float, CurvePoint]] | None:
        value = last[0] + direction * step * chart.size[0]
        limit = _limit(chart, last[1][1], value, fractions) if value in chart.first else None
        return limit and (value, limit)

    limits: list[tuple[float, float]] = []
    for value, (limit, _) in continue_steps(advance, (first, (point.value, point)), MAX_STEP,
                                            MIN_STEP, MAX_STEP):
        if limit not in chart.second:
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
    points: list[CurvePoint] = []
    for fraction in fractions:
        last = points[-1] if points else start
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
        points.append(solved)
    return _extrapolated(np.array([point.value for point in points]), np.array(fractions),
                         ROUNDING * chart.size[1]), points[0]


def _extrapolated(values: np.ndarray, fractions: np.ndarray, rounding: float) -> float:
    """Return the limit of values at fractions of a period, by the law with as many fractions."""
    if len(values) == len(POWERS):
        return float(np.linalg.solve(fractions[:, None] ** -np.array(POWERS, dtype=float),
                                     values)[0])
    first, second, third = values
    bend = first - 2.0 * second + third
    if abs(first - second) <= rounding or not bend:
        return float(first)
    return float(first - (first - second)**2 / bend)


#: Arclengths along a branch within which its fold is searched for, one after another.
SEARCH_LENGTHS = (0.01, 0.03, 0.1, 0.3)
#: Amplitude below which an orbit is an equilibrium.
MIN_AMPLITUDE = 5e-3
#: Edges of the grid that are tried for a gait; points of a branch; distance of equal curves, as a
#: fraction of the ranges.
MAX_EDGES, MAX_POINTS, CURVE_TOLERANCE = 8, 80, 0.02


def edges_without_orbit(chart: ParameterPlane, sheet: GaitMap) -> list[Edge]:
    """Return edges of the coarse grid along the second axis with an orbit at one end only."""
    return [Edge(chart.fraction(at), chart.fraction(other), *sheet.waves[at])
            for axis, left, right in chart.neighbours() if axis == 1
            for at, other in ((left, right), (right, left))
            if at in sheet.waves and sheet.label[other] == NONE]


def fold_curves(job: tuple[ParameterPlane, str, list[Edge]]) -> list[Boundary]:
    """Follow the folds at which a gait is lost on some edges, and its orbits of long period."""
    chart, gait, edges = job
    curves: list[Boundary] = []
    for edge in edges[::max(1, len(edges) // MAX_EDGES)]:
        try:
            branch = _branch(chart, gait, edge)
        except (CpgError, np.linalg.LinAlgError):
            continue
        first = chart.first.low + edge.start[0] * chart.size[0]
        for fold in branch.folds:
            if not _known(chart, curves, first, fold.value):
                curves.append(fold_curve(chart, gait, fold.curve_point, first))
        if any(end.why == 'period' and not _known(chart, curves, first, end.value)
               for end in branch.ends):
            curves += infinite_periods(chart, gait, branch, first)
    return curves


def _known(chart: ParameterPlane, curves: list[Boundary], first: float, second: float) -> bool:
    point = chart.fractions_of((first, second))
    return any(curve.passes(chart, point, CURVE_TOLERANCE) for curve in curves)


def fold_curve(chart: ParameterPlane, gait: str, fold: CurvePoint, first: float) -> Boundary:
    """Follow the folds on both sides of one, with the cusps in which they end.

    Args:
        chart: the plane.
        gait: of the fold.
        fold: along the second axis.
        first: value on the first axis there.

    """
    back, ahead = (continue_fold(chart, fold, first, direction) for direction in (-1.0, 1.0))
    points = [(value, member.value) for value, member in [*back[::-1], (first, fold), *ahead]]
    ends = [(back or [(first, fold)])[-1], (ahead or [(first, fold)])[-1]]
    cusps = [cusp_beyond(chart, gait, member, value, direction)
             for (value, member), direction in zip(ends, (-1.0, 1.0), strict=True)]
    # A cusp ends its curve.
    return Boundary('fold', (gait,), np.array([
        *(cusp.values for cusp in cusps[:1] if cusp), *points,
        *(cusp.values for cusp in cusps[1:] if cusp)]), tuple(filter(None, cusps)))


def _branch(chart: ParameterPlane, gait: str, edge: Edge) -> Branch:
    """Return the branch in the row of an edge."""
    orbit = solve_from_wave(chart.at_fractions(edge.start), gait, edge.wave, edge.period)
    return continue_orbit(orbit, chart.second.line, chart.second.low, chart.second.high,
                          most=MAX_POINTS)


def continue_fold(chart: ParameterPlane, fold: CurvePoint, first: float, direction: float
                  ) -> list[tuple[float, CurvePoint]]:
    """Follow folds in a direction of the first parameter.

    Args:
        chart: the plane.
        fold: a fold along the second axis.
        first: value on the first axis there.
        direction: 1 or -1.

    Returns:
        The value on the first axis and the fold, of each.

    """
    path = [(first, fold)]

    def advance(before: tuple[float, CurvePoint], step: float) -> tuple[float, CurvePoint] | None:
        (value, last), guess = before, before[1].z
        new = value + direction * step * chart.size[0]
        if new not in chart.first:
            return None
        if len(path) > 1 and path[-2][1].z.size == guess.size:
            guess = guess + (guess - path[-2][1].z) * (new - value) / (value - path[-2][0])
        ahead = _next(chart, last, new, guess)
        # Beyond a Bautin point branches turn at their Hopf point. A fold off the course is
        # another fold of the branch.
        if ahead is None or ahead.amplitude < MIN_AMPLITUDE or not _on_course(
                chart, [*path[1:][-2:], (new, ahead)], step):
            return None
        return new, ahead

    for point in continue_steps(advance, (first, fold), MAX_STEP, MIN_STEP, MAX_STEP):
        if point[1].value not in chart.second:
            break
        path.append(point)
    return path[1:]


def _on_course(chart: ParameterPlane, last: list[tuple[float, CurvePoint]], step: float) -> bool:
    """Tell whether a fold lies close to the extrapolation of the two folds before it."""
    if len(last) < 3:
        return True
    (a, first), (b, second), (c, third) = last
    ahead = second.value + (second.value - first.value) * (c - b) / (b - a)
    return bool(abs(third.value - ahead) < 0.5 * step * chart.size[1])


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
        for reach in SEARCH_LENGTHS:
            if rate(-reach) * rate(reach) < 0.0:
                return locate(lambda point: point.rate, partial(predict_and_correct, near),
                              -reach, reach, 1e-11)
    except (NoOrbit, np.linalg.LinAlgError):
        return None
    return None


# The curve of folds of orbits that is born at a Bautin point.

#: Distances from the Bautin point, as fractions of the ranges, at which branches start; amplitude
#: of their first orbit; steps along them.
BAUTIN_OFFSETS, FIRST_AMPLITUDE, MAX_ARCLENGTH = (0.03, 0.06, 0.12), 0.01, 0.05
#: Of a fold from its Hopf point, and of the curve's end from the Bautin point, as fractions.
MAX_FOLD_DISTANCE, MAX_END_DISTANCE = 0.2, 0.02
#: Distance of equal curves in fractions.
BAUTIN_CURVE_TOLERANCE = 3e-3


def bautin_folds(job: tuple[ParameterPlane, Boundary]) -> list[Boundary]:
    """Follow the fold curves that begin at the Bautin points of a curve of Hopf points.

    A curve whose branch does not turn within the plane is left out.
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
    """Leave out fold curves that run along one before them."""
    result: list[Boundary] = []
    for curve in curves:
        fractions = chart.fractions_of(curve.points)
        some = fractions[[len(fractions) * k // 4 for k in (1, 2, 3)]]
        if curve.kind != 'fold' or not any(
                other.kind == 'fold' and other.gaits == curve.gaits
                and all(other.passes(chart, fraction, BAUTIN_CURVE_TOLERANCE) for fraction in some)
                for other in result):
            result.append(curve)
    return result


def _born(chart: ParameterPlane, point: CodimensionTwo) -> Boundary | None:
    fraction = np.append(chart.fractions_of(point.values), point.omega)
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
        gaps = [(np.abs(end - point.values) / chart.size).max() for end in (points[0], points[-1])]
        if min(gaps) > MAX_END_DISTANCE:
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
    for beside in BAUTIN_OFFSETS:
        for direction in (-1.0, 1.0):
            point = condition.corrected(fraction + direction * beside * tangent, tangent)
            if point is None:
                continue
            first, second = chart.values_at(point[:2])
            if first not in chart.first or second not in chart.second:
                continue
            try:
                hopf = hopf_at(chart.at(first, second), line, mode, float(point[2]))
                branch = continue_from_hopf(
                    hopf, line, chart.second.low, chart.second.high, amplitude=FIRST_AMPLITUDE,
                    longest_step=MAX_ARCLENGTH, most=MAX_POINTS)
            except (CpgError, np.linalg.LinAlgError):
                continue
            for fold in branch.folds[:1]:
                if abs(fold.value - second) < MAX_FOLD_DISTANCE * chart.size[1]:
                    yield fold.curve_point, first
