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

"""Curves of torus points, period doublings and branch points of a gait in two parameters.

On a curve the modulus of one multiplier is 1. Away from folds orbits are a function of both
parameters, and so is its logarithm g: the curve g = 0 is followed by steps along its tangent and
Newton's method normal to it.
"""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from itertools import chain, pairwise

from cpg_ros.analysis.atlas.chart import COARSE, CodimensionTwo, ParameterPlane
from cpg_ros.analysis.atlas.grid import GaitMap, grid_indices
from cpg_ros.analysis.atlas.hopf_curves import Boundary, on_curve
from cpg_ros.analysis.atlas.orbit_plane import OrbitPlane, spectrum, stability_losses
from cpg_ros.analysis.atlas.row_job import NONE, solve_from_wave
from cpg_ros.common.errors import CpgError, ShortRepr
from cpg_ros.dynamics.arclength import continue_along_tangents, derivatives, newton, NoOrbit
from cpg_ros.dynamics.bifurcation import REAL
from cpg_ros.dynamics.floquet import ATTRACTS
import numpy as np
from scipy.optimize import brentq

# Strong resonances on a curve of torus points: 1:1 to 1:4.

#: SUMS: n of the resonance 1:n -> sum of the two multipliers, 2 cos(2 pi / n).
SUMS = {1: 2.0, 2: -2.0, 3: -1.0, 4: 0.0}
#: Newton's method: most steps, tolerance, and step of finite differences, as fractions.
RESONANCE_STEPS, RESONANCE_TOLERANCE, RESONANCE_DIFFERENCE = 12, 1e-10, 1e-5
#: REACH: largest distance of a resonance from a point of the curve, as a fraction; CLOSE:
#: difference of the multipliers' sum from SUMS within which the end of a curve is tried.
REACH, CLOSE = 0.08, 0.5
#: LEFT: largest residual of the multipliers' product and sum; SAME: distance, as a fraction, up to
#: which two resonances are one.
LEFT, SAME = 1e-8, 1e-5


def resonances(plane: OrbitPlane, part: int, rank: int, fractions: Sequence[np.ndarray]
               ) -> Iterator[CodimensionTwo]:
    """Yield the resonances on a curve of torus points, in the order of its points.

    Args:
        plane: its last orbit is that at the first point.
        part: number of the subspace of the pair.
        rank: how many larger multipliers that has.
        fractions: points of the curve in fractions of the ranges.

    """
    points: list[np.ndarray] = []
    for guess, n, at in [*_candidates(plane, part, rank, fractions)]:
        plane.last = at
        solved = _solved(plane, part, n, guess)
        if solved is None:
            continue
        fraction, left = solved
        if (np.abs(fraction - guess).max() < REACH and (fraction >= 0.0).all()
            and (fraction <= 1.0).all()
                and not any(np.abs(fraction - point).max() < SAME for point in points)):
            points.append(fraction)
            yield CodimensionTwo(f'1:{n} resonance', plane.gait, plane.chart.values_at(fraction),
                                 left)


def _candidates(plane: OrbitPlane, part: int, rank: int, fractions: Sequence[np.ndarray]
                ) -> Iterator[tuple]:
    """Yield places beside resonances: (share, n, the orbit closest to it)."""
    along = []
    for fraction in fractions:
        try:
            plane.last = plane.orbit(fraction)
            along.append((fraction, complex(spectrum(plane.last)[part][rank]), plane.last))
        except (CpgError, IndexError):
            break
    for (here, left, orbit), (there, right, _) in pairwise(along):
        complexes = [abs(mu.imag) > REAL for mu in (left, right)]
        for n in (3, 4):
            gaps = [2.0 * mu.real - SUMS[n] for mu in (left, right)]
            if all(complexes) and gaps[0] * gaps[1] <= 0.0 and gaps[0] != gaps[1]:
                yield here + gaps[0] / (gaps[0] - gaps[1]) * (there - here), n, orbit
        if complexes == [True, False]:
            # The pair has met on the real axis: the curve of torus points ends.
            yield here, 1 if right.real > 0.0 else 2, orbit
            return
    if along and abs(along[-1][1].imag) > REAL:
        last, mu, orbit = along[-1]
        for n in (1, 2):
            if abs(2.0 * mu.real - SUMS[n]) < CLOSE:
                yield last, n, orbit


def _solved(plane: OrbitPlane, part: int, n: int, fraction: np.ndarray
            ) -> tuple[np.ndarray, float] | None:
    """Solve for product 1 and the sum of n; also the larger residual. None where that fails."""
    target = np.exp(2j * np.pi / n)

    def gaps(fraction: np.ndarray) -> np.ndarray:
        plane.last = plane.orbit(fraction)
        some = spectrum(plane.last)[part]
        root = complex(some[np.abs(some - target).argmin()])
        if abs(root.imag) > REAL * REAL:
            product, total = abs(root)**2, 2.0 * root.real
        else:
            real = some[np.abs(some.imag) <= REAL * REAL].real
            pair = real[np.abs(real - target.real).argsort()[:2]]
            product, total = float(pair.prod()), float(pair.sum())
        return np.array([product - 1.0, total - SUMS[n]])

    try:
        solution = newton(gaps, fraction, steps=RESONANCE_STEPS, tolerance=RESONANCE_TOLERANCE,
                          difference=RESONANCE_DIFFERENCE, longest=REACH)
        left = np.inf if solution is None else float(np.abs(gaps(solution)).max())
    except (CpgError, np.linalg.LinAlgError, IndexError):
        return None
    return None if solution is None or not left < LEFT else (solution, left)


#: CURVES: most curves of a gait; MOST: most points of each; STEP, SHORTEST: longest and shortest
#: step, as fractions of the ranges.
CURVES, MOST, STEP, SHORTEST = 6, 120, 0.03, 2e-3
#: EXACT: tolerance of g = 0; DIFFERENCE: step of its finite differences, as a fraction; NEWTON:
#: most steps of Newton's method.
EXACT, DIFFERENCE, NEWTON = 1e-8, 1e-5, 8

Distance = Callable[[np.ndarray], float]


@dataclass(frozen=True, eq=False, repr=False)
class Edge(ShortRepr):
    """Two neighbours on the grid between which multipliers cross, in fractions of the ranges."""

    here: np.ndarray
    there: np.ndarray
    wave: list[list[float]]
    period: float


def edges(chart: ParameterPlane, sheet: GaitMap) -> list[Edge]:
    """Return neighbours on the coarse grid that differ in the number of unstable multipliers."""
    rows, columns = grid_indices(chart.first.count, COARSE), grid_indices(chart.second.count,
                                                                          COARSE)
    crossed = []
    for k, row in enumerate(rows):
        for m, column in enumerate(columns):
            for other in ((row, columns[m + 1]) if m + 1 < len(columns) else None,
                          (rows[k + 1], column) if k + 1 < len(rows) else None):
                at = (row, column)
                if other is None or at not in sheet.waves or sheet.label[other] == NONE:
                    continue
                if sheet.numbers['unstable'][at] != sheet.numbers['unstable'][other]:
                    crossed.append(Edge(chart.fraction(at), chart.fraction(other),
                                        *sheet.waves[at]))
    return crossed


def orbit_curves(job: tuple[ParameterPlane, str, list[Edge]]) -> list[Boundary]:
    """Follow the curves that some edges cross; those that cannot be followed are left out."""
    chart, gait, crossed = job
    curves: list[Boundary] = []
    for edge in crossed:
        middle = 0.5 * (edge.here + edge.there)
        reach = np.abs(edge.here - edge.there).max()
        if any(on_curve(curve, chart, middle, 1.5 * reach) for curve in curves):
            continue
        try:
            curves += _through(chart, gait, edge)
        except (NoOrbit, np.linalg.LinAlgError):
            continue
        if len(curves) >= CURVES:
            break
    return curves


def _through(chart: ParameterPlane, gait: str, edge: Edge) -> Iterator[Boundary]:
    plane = OrbitPlane(chart, gait)
    here, there = edge.here, edge.there
    plane.last = solve_from_wave(chart.at_fractions(here), gait, edge.wave, edge.period)
    before, after = spectrum(plane.last), spectrum(plane.orbit(there))
    for part, (left, right) in enumerate(zip(before, after, strict=True)):
        counts = [int((np.abs(some) >= ATTRACTS).sum()) for some in (left, right)]
        if counts[0] == counts[1]:
            continue
        rank = min(counts)

        def g(fraction: np.ndarray, part: int = part, rank: int = rank) -> float:
            orbit = plane.orbit(fraction)
            some = spectrum(orbit)[part]
            plane.last = orbit
            return float(np.log(np.abs(some[rank]))) if len(some) > rank else -10.0

        start = plane.last
        root = brentq(lambda s: g(here + s * (there - here)), 0.0, 1.0, xtol=1e-9)
        fraction = here + root * (there - here)
        crossing = complex(spectrum(plane.orbit(fraction))[part][rank])
        kind = ('torus' if abs(crossing.imag) > REAL else
                'branch point' if crossing.real > 0.0 else 'period doubling')
        crossing_orbit = plane.last
        ways, special = [], []
        for way in (-1.0, 1.0):
            plane.last = crossing_orbit
            ways.append([(new, plane.last) for new in _continue_edge(g, fraction, way)])
            if kind == 'torus':
                plane.last = crossing_orbit
                along = [fraction, *(new for new, _ in ways[-1])]
                special.append([*resonances(plane, part, rank, along)][::int(way)])
        curve = [*ways[0][::-1], (fraction, crossing_orbit), *ways[1]]
        yield Boundary(kind, (gait,), chart.low + np.array([new for new, _ in curve]) * chart.size,
                       tuple(chain(*special)),
                       tuple(stability_losses(plane, part, rank, curve)))
        plane.last = start


def _continue_edge(g: Distance, start: np.ndarray, way: float) -> Iterator[np.ndarray]:
    """Yield points of g = 0 from one on, until the plane ends or the orbit is lost."""
    def correct(guess: np.ndarray, tangent: np.ndarray) -> tuple[np.ndarray, np.ndarray] | None:
        try:
            point, slope = _onto(g, guess, _normal(tangent))
        except (NoOrbit, np.linalg.LinAlgError):
            return None
        return None if (point < 0.0).any() or (point > 1.0).any() else (point, _normal(slope))

    return continue_along_tangents(
        correct, start, way * _normal(derivatives(g, start, DIFFERENCE)), (STEP, SHORTEST, STEP),
        aligned=0.8, most=MOST)


def _normal(vector: np.ndarray) -> np.ndarray:
    """Return the unit vector a quarter turn ahead of one in the plane."""
    return np.array([-vector[1], vector[0]]) / np.linalg.norm(vector)


def _onto(g: Distance, fraction: np.ndarray, normal: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Apply Newton's method along a unit vector; return the point on it and the slope of g."""
    for _ in range(NEWTON):
        value = g(fraction)
        if abs(value) < EXACT:
            return fraction, derivatives(g, fraction, DIFFERENCE)
        along = (g(fraction + DIFFERENCE * normal) - value) / DIFFERENCE
        fraction = fraction - value / along * normal
    raise NoOrbit('the curve is lost')
