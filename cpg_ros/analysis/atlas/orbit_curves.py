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

On a curve the modulus of one multiplier is 1. Away from folds, orbits are a function of both
parameters, and so is the logarithm g of the modulus: the curve g = 0 is followed by steps along
its tangent and Newton's method normal to it.
"""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from itertools import chain, pairwise

from cpg_ros.analysis.atlas.chart import CodimensionTwo, LossOnCurve, ParameterPlane
from cpg_ros.analysis.atlas.grid import GaitMap, NONE, solve_from_wave
from cpg_ros.analysis.atlas.hopf_curves import Boundary
from cpg_ros.common.errors import CpgError, ShortRepr
from cpg_ros.dynamics import arclength
from cpg_ros.dynamics.continuation import IMAGINARY_TOLERANCE, kind_of
from cpg_ros.dynamics.floquet import MAX_STABLE_MODULUS, multipliers
from cpg_ros.dynamics.fourier.floquet import Accuracy
from cpg_ros.dynamics.orbit import Orbit
from cpg_ros.dynamics.orbit_normal_form import loses_stability, orbit_normal_form
from cpg_ros.dynamics.solve_orbit import solve_beside
import numpy as np

#: Accuracy of multipliers on curves.
ACCURACY = Accuracy(4, 1e-12, 1e-8, 5)


def spectrum(orbit: Orbit) -> list[np.ndarray]:
    """Return the multipliers of each subspace, largest first; the class first, without 1."""
    return multipliers(orbit, accuracy=ACCURACY).subspaces


class OrbitPlane:
    """Orbits over the plane, each solved beside the last one."""

    def __init__(self, chart: ParameterPlane, gait: str) -> None:
        """Take the plane; the first orbit is set as the last."""
        self.chart, self.gait = chart, gait
        self.last: Orbit | None = None

    def orbit(self, fraction: np.ndarray) -> Orbit:
        """Solve at a point given in fractions of the ranges.

        Raises:
            NoOrbit: there is none beside the last one.

        """
        assert self.last is not None
        solved = solve_beside(self.chart.at_fractions(fraction), self.last)
        if solved.levels[0, 0, 1] < 0.3 * self.last.levels[0, 0, 1]:
            raise arclength.NoOrbit('the orbit has shrunk')
        return solved


#: Points on a curve at which the normal form is computed.
NUM_FORMS = 5


def stability_losses(plane: OrbitPlane, part: int, rank: int,
                     curve: Sequence[tuple[np.ndarray, Orbit]]) -> Iterator[LossOnCurve]:
    """Yield the normal forms at evenly spaced points of a curve.

    Points with other multipliers outside the unit circle are skipped: there the gait is unstable
    on both sides.

    Args:
        plane: of the curve.
        part: index of the subspace in which a multiplier crosses the unit circle.
        rank: of the multiplier in it, by size.
        curve: its points in fractions of the ranges, and orbits beside them.

    """
    indices = np.unique(((np.arange(NUM_FORMS) + 0.5) / NUM_FORMS * len(curve)).astype(int))
    for fraction, beside in (curve[k] for k in indices):
        plane.last = beside
        try:
            orbit = plane.orbit(fraction)
        except arclength.NoOrbit:
            continue
        if loses_stability(orbit):
            multiplier = complex(spectrum(orbit)[part][rank])
            form = orbit_normal_form(orbit, multiplier, part)
            yield LossOnCurve(plane.chart.values_at(fraction), form.soft, form.why)


# Strong resonances on a curve of torus points: 1:1 to 1:4.

#: n of the resonance 1:n -> sum of the two multipliers, 2 cos(2 pi / n).
RESONANCE_SUMS = {1: 2.0, 2: -2.0, 3: -1.0, 4: 0.0}
#: Of Newton's method, in fractions.
RESONANCE_ITERATIONS, RESONANCE_TOLERANCE, RESONANCE_DIFFERENCE = 12, 1e-10, 1e-5
#: Distance of a resonance from a point of the curve, as a fraction; difference of the multipliers'
#: sum from RESONANCE_SUMS within which an end of the curve is tried.
MAX_RESONANCE_DISTANCE, SUM_TOLERANCE = 0.08, 0.5
#: Residual of the multipliers' product and sum; distance of equal resonances.
MAX_RESIDUAL, POINT_TOLERANCE = 1e-8, 1e-5


def resonances(plane: OrbitPlane, part: int, rank: int, fractions: Sequence[np.ndarray]
               ) -> Iterator[CodimensionTwo]:
    """Yield the resonances on a curve of torus points, in the order of its points.

    Args:
        plane: its last orbit is that at the first point.
        part: index of the subspace of the pair.
        rank: of the pair in it, by size.
        fractions: points of the curve in fractions of the ranges.

    """
    points: list[np.ndarray] = []
    for guess, n, orbit in [*_candidates(plane, part, rank, fractions)]:
        plane.last = orbit
        fraction, residual = _solved(plane, part, n, guess) or (guess, np.inf)
        if (residual < MAX_RESIDUAL and np.abs(fraction - guess).max() < MAX_RESONANCE_DISTANCE
                and (fraction >= 0.0).all() and (fraction <= 1.0).all()
                and not any(np.abs(fraction - point).max() < POINT_TOLERANCE for point in points)):
            points.append(fraction)
            yield CodimensionTwo(f'1:{n} resonance', plane.gait, plane.chart.values_at(fraction),
                                 residual)


def _candidates(plane: OrbitPlane, part: int, rank: int, fractions: Sequence[np.ndarray]
                ) -> Iterator[tuple]:
    """Yield points beside resonances: (fraction, n, the closest orbit)."""
    along = []
    for fraction in fractions:
        try:
            plane.last = plane.orbit(fraction)
            along.append((fraction, complex(spectrum(plane.last)[part][rank]), plane.last))
        except (CpgError, IndexError):
            break
    for (start, left, orbit), (end, right, _) in pairwise(along):
        complexes = [abs(mu.imag) > IMAGINARY_TOLERANCE for mu in (left, right)]
        for n in (3, 4):
            gaps = [2.0 * mu.real - RESONANCE_SUMS[n] for mu in (left, right)]
            if all(complexes) and gaps[0] * gaps[1] <= 0.0 and gaps[0] != gaps[1]:
                yield start + gaps[0] / (gaps[0] - gaps[1]) * (end - start), n, orbit
        if complexes == [True, False]:
            # The pair has met on the real axis, where the curve of torus points ends.
            yield start, 1 if right.real > 0.0 else 2, orbit
            return
    if along and abs(along[-1][1].imag) > IMAGINARY_TOLERANCE:
        last, mu, orbit = along[-1]
        for n in (1, 2):
            if abs(2.0 * mu.real - RESONANCE_SUMS[n]) < SUM_TOLERANCE:
                yield last, n, orbit


def _solved(plane: OrbitPlane, part: int, n: int, fraction: np.ndarray
            ) -> tuple[np.ndarray, float] | None:
    """Solve for product 1 and the sum of n; also return the larger residual. None if it fails."""
    target = np.exp(2j * np.pi / n)

    def gaps(fraction: np.ndarray) -> np.ndarray:
        plane.last = plane.orbit(fraction)
        roots = spectrum(plane.last)[part]
        root = complex(roots[np.abs(roots - target).argmin()])
        if abs(root.imag) > IMAGINARY_TOLERANCE * IMAGINARY_TOLERANCE:
            product, total = abs(root)**2, 2.0 * root.real
        else:
            real = roots[np.abs(roots.imag) <= IMAGINARY_TOLERANCE * IMAGINARY_TOLERANCE].real
            pair = real[np.abs(real - target.real).argsort()[:2]]
            product, total = float(pair.prod()), float(pair.sum())
        return np.array([product - 1.0, total - RESONANCE_SUMS[n]])

    try:
        solution = arclength.newton(
            gaps, fraction, steps=RESONANCE_ITERATIONS, tolerance=RESONANCE_TOLERANCE,
            difference=RESONANCE_DIFFERENCE, longest=MAX_RESONANCE_DISTANCE)
        return None if solution is None else (solution, float(np.abs(gaps(solution)).max()))
    except (CpgError, np.linalg.LinAlgError, IndexError):
        return None


#: Curves of a gait; points of each; steps, as fractions of the ranges.
MAX_CURVES, MAX_POINTS, MAX_STEP, MIN_STEP = 6, 120, 0.03, 2e-3
#: Tolerance of g = 0; step of its finite differences, as a fraction.
CURVE_TOLERANCE, DIFFERENCE_STEP, NEWTON_ITERATIONS = 1e-8, 1e-5, 8

Distance = Callable[[np.ndarray], float]


@dataclass(frozen=True, eq=False, repr=False)
class Edge(ShortRepr):
    """Two neighbours on the grid in fractions of the ranges, with an orbit at the first one."""

    start: np.ndarray
    end: np.ndarray
    wave: list[list[float]]
    period: float


def edges(chart: ParameterPlane, sheet: GaitMap) -> list[Edge]:
    """Return neighbours on the coarse grid that differ in the number of unstable multipliers."""
    unstable = sheet.numbers['unstable']
    return [Edge(chart.fraction(at), chart.fraction(other), *sheet.waves[at])
            for _, at, other in chart.neighbours() if at in sheet.waves
            and sheet.label[other] != NONE and unstable[at] != unstable[other]]


def orbit_curves(job: tuple[ParameterPlane, str, list[Edge]]) -> list[Boundary]:
    """Follow the curves that some edges cross; those that cannot be followed are left out."""
    chart, gait, crossed = job
    curves: list[Boundary] = []
    for edge in crossed:
        middle = 0.5 * (edge.start + edge.end)
        reach = float(np.abs(edge.start - edge.end).max())
        if any(curve.passes(chart, middle, 1.5 * reach) for curve in curves):
            continue
        try:
            curves += _through(chart, gait, edge)
        except (arclength.NoOrbit, np.linalg.LinAlgError):
            continue
        if len(curves) >= MAX_CURVES:
            break
    return curves


def _through(chart: ParameterPlane, gait: str, edge: Edge) -> Iterator[Boundary]:
    plane = OrbitPlane(chart, gait)
    plane.last = solve_from_wave(chart.at_fractions(edge.start), gait, edge.wave, edge.period)
    before, after = spectrum(plane.last), spectrum(plane.orbit(edge.end))
    for part, ends in enumerate(zip(before, after, strict=True)):
        counts = [int((np.abs(roots) >= MAX_STABLE_MODULUS).sum()) for roots in ends]
        if counts[0] == counts[1]:
            continue
        rank = min(counts)

        def g(fraction: np.ndarray, part: int = part, rank: int = rank) -> float:
            orbit = plane.orbit(fraction)
            roots = spectrum(orbit)[part]
            plane.last = orbit
            return float(np.log(np.abs(roots[rank]))) if len(roots) > rank else -10.0

        start = plane.last
        crosses = g(edge.start) * g(edge.end) < 0.0
        plane.last = start
        if not crosses:
            # A neutral multiplier, as of uncoupled rings, may be below 1 by rounding.
            continue
        fraction = arclength.locate(g, partial(_between, edge.start, edge.end), 0.0, 1.0, 1e-9)
        crossing = complex(spectrum(plane.orbit(fraction))[part][rank])
        kind = kind_of(crossing)
        crossing_orbit = plane.last
        halves, special = [], []
        for direction in (-1.0, 1.0):
            plane.last = crossing_orbit
            halves.append([(new, plane.last) for new in _continue_edge(g, fraction, direction)])
            if kind == 'torus':
                plane.last = crossing_orbit
                along = [fraction, *(new for new, _ in halves[-1])]
                special.append([*resonances(plane, part, rank, along)][::int(direction)])
        curve = [*halves[0][::-1], (fraction, crossing_orbit), *halves[1]]
        yield Boundary(kind, (gait,), chart.low + np.array([new for new, _ in curve]) * chart.size,
                       tuple(chain(*special)),
                       tuple(stability_losses(plane, part, rank, curve)))
        plane.last = start


def _between(start: np.ndarray, end: np.ndarray, s: float) -> np.ndarray:
    return start + s * (end - start)


def _continue_edge(g: Distance, start: np.ndarray, direction: float) -> Iterator[np.ndarray]:
    """Yield the points of g = 0 that follow one, until the plane ends or the orbit is lost."""
    def correct(guess: np.ndarray, tangent: np.ndarray) -> tuple[np.ndarray, np.ndarray] | None:
        try:
            point, slope = _onto(g, guess, _normal(tangent))
        except (arclength.NoOrbit, np.linalg.LinAlgError):
            return None
        return None if (point < 0.0).any() or (point > 1.0).any() else (point, _normal(slope))

    tangent = direction * _normal(arclength.derivatives(g, start, DIFFERENCE_STEP))
    return arclength.continue_along_tangents(
        correct, start, tangent, (MAX_STEP, MIN_STEP, MAX_STEP), aligned=0.8, most=MAX_POINTS)


def _normal(vector: np.ndarray) -> np.ndarray:
    """Return the unit vector perpendicular to one in the plane, to its left."""
    return np.array([-vector[1], vector[0]]) / np.linalg.norm(vector)


def _onto(g: Distance, fraction: np.ndarray, normal: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Apply Newton's method along a unit vector; return the point on it and the slope of g."""
    for _ in range(NEWTON_ITERATIONS):
        value = g(fraction)
        if abs(value) < CURVE_TOLERANCE:
            return fraction, arclength.derivatives(g, fraction, DIFFERENCE_STEP)
        along = (g(fraction + DIFFERENCE_STEP * normal) - value) / DIFFERENCE_STEP
        fraction = fraction - value / along * normal
    raise arclength.NoOrbit('the curve is lost')
