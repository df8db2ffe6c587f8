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

"""Curves of folds of a gait's orbits in two parameters.

At a fold the second parameter turns round along the branch: its component of the tangent is zero.
From a fold the next one is found by holding the unknowns in the plane normal to the last tangent
while the first parameter moves a step, and then going along the branch to where it turns.
"""

from dataclasses import replace
from itertools import pairwise
from typing import Any

from cpg_ros.atlas.chart import Chart, COARSE
from cpg_ros.atlas.fold_cusps import cusp_beyond
from cpg_ros.atlas.grid_refinement import grid_indices, Sheet
from cpg_ros.atlas.hopf_curves import Boundary
from cpg_ros.atlas.infinite_periods import infinite_periods
from cpg_ros.atlas.orbit_curves import Edge
from cpg_ros.atlas.row_job import NONE, solve_from_wave
from cpg_ros.dynamics.arclength import CurvePoint, predict_and_correct, resolve_point
from cpg_ros.dynamics.continuation import Branch, continue_orbit
from cpg_ros.dynamics.orbit import NoOrbit
from cpg_ros.errors import CpgError
import numpy as np
from scipy.optimize import brentq

#: Steps of the first parameter in shares of its range, and how far along a branch its turn is
#: looked for.
STEP, SHORTEST, REACHES = 1.0 / 24.0, 1.0 / 800.0, (0.01, 0.03, 0.1, 0.3)
#: Smaller orbits are rest.
REST = 5e-3
#: Edges that are tried for a gait, points of a branch, and curves this close, in shares, are one.
TRIED, MOST, SAME = 8, 80, 0.02


def lost_edges(chart: Chart, sheet: Sheet) -> list[Edge]:
    """Return neighbours on the coarse grid, along the second axis, one of which has no orbit."""
    columns = grid_indices(chart.second.count, COARSE)
    found = []
    for row in grid_indices(chart.first.count, COARSE):
        for one, other in pairwise(columns):
            for at, there in (((row, one), (row, other)), ((row, other), (row, one))):
                if at in sheet.waves and sheet.label[there] == NONE:
                    found.append(Edge(chart.share(at), chart.share(there), *sheet.waves[at]))
    return found


def fold_curves(job: tuple[Chart, str, list[Edge]]) -> list[Boundary]:
    """Follow the folds at which a gait is lost over some edges; most are lost at Hopf points.

    Where the branch ends in orbits without a period these are followed, too.
    """
    chart, gait, edges = job
    found: list[Boundary] = []
    for edge in edges[::max(1, len(edges) // TRIED)]:
        try:
            branch = _branch(chart, gait, edge)
        except (CpgError, np.linalg.LinAlgError):
            continue
        one = chart.first.low + edge.here[0] * chart.size[0]
        for fold in branch.folds:
            if not _known(chart, found, one, fold.value):
                found.append(fold_curve(chart, gait, fold.place, one))
        if any(end.why == 'period' and not _known(chart, found, one, end.value)
               for end in branch.ends):
            found += infinite_periods(chart, gait, branch, one)
    return found


def _known(chart: Chart, found: list[Boundary], one: float, other: float) -> bool:
    return any((np.abs(curve.points - (one, other)) / chart.size).max(axis=1).min() < SAME
               for curve in found)


def fold_curve(chart: Chart, gait: str, fold: CurvePoint, one: float) -> Boundary:
    """Follow the folds on both sides of one, with the cusps in which they end.

    Args:
        chart: the plane.
        gait: whose.
        fold: a fold along the second axis.
        one: value on the first axis there.

    """
    back, ahead = (followed(chart, fold, one, way) for way in (-1.0, 1.0))
    points = [(value, place.value) for value, place in
              [*back[::-1], (one, fold), *ahead]]
    ends = [(back or [(one, fold)])[-1], (ahead or [(one, fold)])[-1]]
    cusps = [cusp_beyond(chart, gait, place, value, way)
             for (value, place), way in zip(ends, (-1.0, 1.0), strict=True)]
    # A cusp is the last point of its curve.
    return Boundary('fold', (gait,), np.array([
        *(cusp.values for cusp in cusps[:1] if cusp), *points,
        *(cusp.values for cusp in cusps[1:] if cusp)]), tuple(filter(None, cusps)))


def _branch(chart: Chart, gait: str, edge: Edge) -> Branch:
    """Return the branch in the row of an edge."""
    orbit = solve_from_wave(chart.at_share(edge.here), gait, edge.wave, edge.period)
    return continue_orbit(orbit, chart.second.line, chart.second.low, chart.second.high,
                          most=MOST)


def followed(chart: Chart, fold: CurvePoint, one: float, way: float
             ) -> list[tuple[float, CurvePoint]]:
    """Follow folds from one on in a direction of the first parameter.

    Args:
        chart: the plane.
        fold: a fold along the second axis.
        one: value on the first axis there.
        way: 1 or -1, the direction.

    Returns:
        The value on the first axis and the fold, of each.

    """
    found: list[tuple[float, CurvePoint]] = []
    size, step = chart.size[0], STEP
    before: tuple[Any, float] | None = None
    while step >= SHORTEST:
        new = one + way * step * size
        guess = fold.z
        if before is not None and before[0].size == fold.z.size:
            guess = fold.z + (fold.z - before[0]) * (new - one) / (one - before[1])
        ahead = None
        if chart.first.low <= new <= chart.first.high:
            ahead = _next(chart, fold, new, guess)
        if ahead is None or ahead.amplitude < REST or not _on_course(chart, [
                *found[-2:], (new, ahead)], step):
            # Another fold of the branch is none of this curve.
            # Beyond a Bautin point what is left is the Hopf point, where branches turn, too.
            # Beyond the edge, too: up to it.
            step *= 0.5
            continue
        if not chart.second.low <= ahead.value <= chart.second.high:
            break
        before = fold.z, one
        fold, one = ahead, new
        found.append((one, ahead))
        step = min(STEP, 1.5 * step)
    return found


def _on_course(chart: Chart, last: list[tuple[float, CurvePoint]], step: float) -> bool:
    """Whether a fold lies about where the two before it lead, a step in shares later."""
    if len(last) < 3:
        return True
    (a, one), (b, two), (c, three) = last
    ahead = two.value + (two.value - one.value) * (c - b) / (b - a)
    return bool(abs(three.value - ahead) < 0.5 * step * chart.size[1])


def _next(chart: Chart, fold: CurvePoint, new: float, guess: np.ndarray) -> CurvePoint | None:
    """Return the fold at a value of the first parameter, from one nearby, or None."""
    curve: Any = fold.curve
    moved = replace(curve, network=chart.at(new, fold.value))
    try:
        near = resolve_point(moved, guess, fold.tangent)
        if near is None:
            return None

        def rate(step: float) -> float:
            place = predict_and_correct(near, step)
            if place is None:
                raise np.linalg.LinAlgError('no point')
            return place.rate

        for reach in REACHES:
            if rate(-reach) * rate(reach) < 0.0:
                return predict_and_correct(near, brentq(rate, -reach, reach, xtol=1e-11))
    except (NoOrbit, np.linalg.LinAlgError):
        return None
    return None
