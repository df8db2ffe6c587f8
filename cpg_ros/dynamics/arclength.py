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

"""Pseudo-arclength continuation of solution curves, past their folds.

n equations in n + 1 unknowns, the last of which is a parameter, define a curve of solutions. The
tangent at a point predicts the next point, and Newton's method corrects it in the hyperplane
normal to the tangent (Keller 1977; Doedel, Keller & Kernevez, *Numerical analysis and control of
bifurcation problems*, 1991). A fold is a regular point of the curve.
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from functools import cache, partial
import math
from typing import Any, Protocol, TypeVar

from cpg_ros.common.errors import CpgError, ShortRepr
import numpy as np
import scipy

#: A point of a curve, in the representation of that curve.
Point = TypeVar('Point')

# Zeros of functions of one variable.

#: Absolute and relative tolerance of a zero.
ROOT_TOLERANCE = 1e-13
#: Distance of an extremum from zero over its difference from its neighbours on the grid.
MAX_EXTREMUM_RATIO = 4.0


def locate(event: Callable[[Point], float], point_at: Callable[[float], Point], low: float,
           high: float, tolerance: float) -> Point:
    """Return the point of a curve at which an event function is zero.

    It locates folds, Hopf points, period doublings, branch points, tori and points of codimension
    two.

    Args:
        event: function of a point that changes sign between the ends.
        point_at: coordinate -> point of the curve; called once for each coordinate.
        low: coordinate of one end.
        high: coordinate of the other end.
        tolerance: of the coordinate.

    """
    solved = cache(point_at)
    return solved(float(scipy.optimize.brentq(lambda s: event(solved(s)), low, high,
                                              xtol=tolerance, rtol=ROOT_TOLERANCE)))


def crossings(function: Callable[[float], float], grid: np.ndarray,
              values: np.ndarray | None = None) -> list[float]:
    """Find the zeros of a continuous function, in the order of the grid.

    An extremum near zero is refined, so that two zeros between neighbouring points are found.

    Args:
        function: of a number; nan where it is undefined.
        grid: ascending numbers, shape (n,).
        values: of the function on the grid; computed by default.

    """
    values = np.array([function(x) for x in grid]) if values is None else np.asarray(values)
    points, ordinates = list(grid), list(values)
    sizes = np.abs(values)
    bend = np.maximum(sizes[:-2], sizes[2:]) - sizes[1:-1]
    bends = np.flatnonzero((sizes[1:-1] <= MAX_EXTREMUM_RATIO * bend) & (sizes[1:-1] <= sizes[:-2])
                           & (sizes[1:-1] <= sizes[2:])
                           & (np.sign(values[:-2]) == np.sign(values[1:-1]))
                           & (np.sign(values[1:-1]) == np.sign(values[2:]))) + 1
    for k in bends[::-1]:
        side = np.sign(values[k])
        lowest = scipy.optimize.minimize_scalar(
            lambda x, side=side: side * function(x), method='bounded',
            bounds=(grid[k - 1], grid[k + 1]), options={'xatol': 1e-9})
        if lowest.fun < 0.0:
            at = int(np.searchsorted(points, lowest.x))
            points.insert(at, float(lowest.x))
            ordinates.insert(at, side * lowest.fun)
    signs = np.sign(ordinates)
    signs[signs == 0.0] = 1.0
    # Signs are NaN where the function has no value; their products differ from -1.
    crossed = np.flatnonzero(signs[:-1] * signs[1:] == -1.0)
    return [root for k in crossed for root in _roots(function, *points[k:k + 2])]


def _roots(function: Callable[[float], float], low: float, high: float) -> list[float]:
    """Find the zeros between two numbers with values of different sign, also beside a gap."""
    gap: list[float] = []

    def whole(x: float) -> float:
        value = function(x)
        if np.isnan(value):
            gap.append(x)
            # 0 ends the search; its result is not used.
            return 0.0
        return value

    root = float(scipy.optimize.brentq(whole, low, high, xtol=ROOT_TOLERANCE, rtol=ROOT_TOLERANCE))
    if not gap:
        return [root]
    edges = [(end, _last(function, end, gap[0])) for end in (low, high)]
    return [root for end, edge in edges if function(end) * function(edge) < 0.0
            for root in _roots(function, *sorted((end, edge)))]


def _last(function: Callable[[float], float], inside: float, outside: float) -> float:
    """Return the last number at which the function is defined, towards one where it is not."""
    while abs(outside - inside) > ROOT_TOLERANCE * max(1.0, abs(inside)):
        middle = 0.5 * (inside + outside)
        if np.isnan(function(middle)):
            outside = middle
        else:
            inside = middle
    return inside


#: Newton's method ends after a step this short; the error is of the order of its square.
TOLERANCE = 1e-9
NEWTON_ITERATIONS = 8
#: Without an exact tangent it ends where the next step would be shorter than this.
NEXT_STEP_TOLERANCE = 1e-4 * TOLERANCE
#: Lengths of steps along the curve, each unknown relative to its scale.
FIRST_STEP, MIN_STEP, MAX_STEP = 0.02, 1e-6, 0.2
#: Once the period or the amplitude has grown by this factor, steps grow with it.
STEP_GROWTH_RATIO = 3.0
#: Of the angle between the tangents at neighbouring points.
MIN_COSINE = 0.9
#: Fraction of the amplitude in a step, so that no step leaps over the equilibrium.
MAX_AMPLITUDE_DROP = 0.6


def derivatives(values: Callable[[np.ndarray], Any], x: np.ndarray, difference: float
                ) -> np.ndarray:
    """Return derivatives of a function by central differences.

    Args:
        values: function with m values, or one.
        x: argument, shape (n,).
        difference: of the argument.

    Returns:
        Shape (m, n), or (n,) for one value.

    """
    return np.array([(values(x + step) - values(x - step)) / (2.0 * difference)
                     for step in difference * np.eye(x.size)]).T


def newton(equations: Callable[[np.ndarray], np.ndarray], x: np.ndarray, *, steps: int,
           tolerance: float, difference: float, longest: float) -> np.ndarray | None:
    """Solve n equations in n unknowns by Newton's method; None if it does not converge.

    Args:
        equations: residuals, shape (n,), of unknowns, shape (n,).
        x: initial unknowns.
        steps: largest number of steps.
        tolerance: largest change in the last step.
        difference: of the unknowns, for the derivatives.
        longest: change of an unknown at which the method counts as diverged.

    Raises:
        LinAlgError: the derivatives are singular.

    """
    for _ in range(steps):
        change = np.linalg.solve(derivatives(equations, x, difference), equations(x))
        x = x - change
        if not np.abs(change).max() < longest:
            return None
        if np.abs(change).max() < tolerance:
            return x
    return None


def continue_steps(advance: Callable[[Point, float], Point | None], point: Point, first: float,
                   shortest: float, longest: float) -> Iterator[Point]:
    """Yield the points that follow on a curve; halve a step that fails.

    Args:
        advance: (point, step) -> next point, or None.
        point: start.
        first: first step.
        shortest: step below which the continuation ends.
        longest: longest step.

    """
    step = first
    while step >= shortest:
        ahead = advance(point, step)
        if ahead is None:
            step *= 0.5
            continue
        yield ahead
        point, step = ahead, min(1.5 * step, longest)


def continue_along_tangents(
        correct: Callable[[np.ndarray, np.ndarray], tuple[np.ndarray, np.ndarray] | None],
        start: np.ndarray, tangent: np.ndarray, steps: tuple[float, float, float], *,
        aligned: float, most: int) -> Iterator[np.ndarray]:
    """Yield the points that follow on a curve, until it ends or returns to the start.

    Args:
        correct: (guess, tangent at the last point) -> point of the curve and its unit tangent, in
            either direction, or None.
        start: point of the curve, shape (n,).
        tangent: unit tangent at the start, in the direction to follow.
        steps: first, shortest and longest.
        aligned: smallest cosine of the angle between neighbouring tangents.
        most: largest number of points.

    """
    def advance(last: tuple[np.ndarray, np.ndarray], step: float
                ) -> tuple[np.ndarray, np.ndarray] | None:
        point, before = last
        ahead = correct(point + step * before, before)
        if ahead is None or np.linalg.norm(ahead[0] - point) > 2.0 * step:
            return None
        cosine = ahead[1] @ before
        return (ahead[0], np.sign(cosine) * ahead[1]) if abs(cosine) >= aligned else None

    for count, (point, _) in enumerate(continue_steps(advance, (start, tangent), *steps), 1):
        yield point
        if count == most or (count > 5 and np.linalg.norm(point - start) < 0.5 * steps[2]):
            return


def on_curve(curve: np.ndarray, point: np.ndarray, reach: float) -> bool:
    """Whether a point lies on a curve, up to a distance in each component.

    Args:
        curve: points in order, shape (n, d), joined by chords.
        point: shape (d,).
        reach: the distance.

    """
    ends = curve if len(curve) > 1 else np.repeat(curve, 2, axis=0)
    chords = np.diff(ends, axis=0)
    fractions = np.clip(((point - ends[:-1]) * chords).sum(axis=1) / np.maximum(
        (chords**2).sum(axis=1), 1e-30), 0.0, 1.0)
    gaps = np.abs(ends[:-1] + fractions[:, None] * chords - point)
    return bool((gaps.max(axis=1) < reach).any())


class NoOrbit(CpgError):
    """The parameter set has no such gait; the message gives the reason."""


class SolutionCurve(Protocol):
    """A curve in a fixed discretisation; the last two unknowns are a period and the parameter."""

    def product(self, first: np.ndarray, second: np.ndarray) -> float:
        """Inner product of two vectors of unknowns."""

    def step(self, z: np.ndarray, border: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Linearise at z: Newton's increment normal to the border, and the tangent.

        The tangent's product with the border is 1.

        Raises:
            LinAlgError: the bordered equations are singular.

        """

    def amplitude(self, z: np.ndarray) -> float:
        """Half the range of the orbit or state over the curve's size; 0 at a birth from rest."""

    def orbit(self, z: np.ndarray) -> Any:
        """Make an orbit of a solution."""

    def renewed(self, z: np.ndarray, border: np.ndarray, again: bool
                ) -> tuple['SolutionCurve', np.ndarray, np.ndarray] | None:
        """Return a finer discretisation, with z and border in it; None if z is resolved.

        ``again``: this discretisation was itself made to resolve z.

        Raises:
            NoOrbit: z cannot be resolved.

        """


@dataclass(frozen=True, eq=False, repr=False)
class CurvePoint(ShortRepr):
    """A point of a curve and its unit tangent.

    Attributes:
        curve: its discretisation.
        z: unknowns; the last two are a period and the parameter.
        tangent: in the direction of the continuation.
        steps: of Newton's method.
        cosine: of the angle between tangent and border, if the border is a unit vector.

    """

    curve: SolutionCurve
    z: np.ndarray
    tangent: np.ndarray
    steps: int = 0
    cosine: float = 1.0

    @property
    def value(self) -> float:
        """The parameter."""
        return float(self.z[-1])

    @property
    def rate(self) -> float:
        """Derivative of the parameter by the arclength; it changes sign at a fold."""
        return float(self.tangent[-1])

    @property
    def amplitude(self) -> float:
        """Half the range of the continued orbit or state over the curve's size."""
        return self.curve.amplitude(self.z)

    def reversed(self) -> 'CurvePoint':  # noqa: A003
        """Return the same point with the opposite tangent."""
        return replace(self, tangent=-self.tangent)


def correct_point(curve: SolutionCurve, z: np.ndarray, border: np.ndarray, *, exact: bool = True
                  ) -> CurvePoint | None:
    """Find the curve's point z + v with (v, border) = 0; None if Newton's method diverges.

    Args:
        curve: fixed discretisation.
        z: unknowns near the point.
        border: normal to v.
        exact: compute the tangent at the point itself, as needed to locate a fold; otherwise it is
            that before Newton's last step, which suffices to continue.

    """
    before = 0.0
    with np.errstate(all='ignore'):
        for count in range(1, NEWTON_ITERATIONS + 1):
            try:
                increment, direction = curve.step(z, border)
            except np.linalg.LinAlgError:
                return None
            size = math.sqrt(curve.product(increment, increment))
            z = z + increment
            if not size < 1.0 or z[-2] <= 0.0:
                return None
            # Newton's next step is C size^2, with C = size / before^2 as in this one.
            if size <= TOLERANCE or (not exact and size**3 <= NEXT_STEP_TOLERANCE * before**2):
                length = math.sqrt(curve.product(direction, direction))
                return CurvePoint(curve, z, direction / length, count, 1.0 / length)
            before = size
    return None


def resolve_point(curve: SolutionCurve, z: np.ndarray, border: np.ndarray, *, exact: bool = True
                  ) -> CurvePoint | None:
    """Return the curve's point near z in a discretisation that resolves it.

    Raises:
        NoOrbit: it cannot be resolved.

    """
    point = first = correct_point(curve, z, border, exact=exact)
    while point is not None and first is not None:
        new = point.curve.renewed(point.z, border, point is not first)
        if new is None:
            return point if point is first else replace(point, steps=first.steps,
                                                        cosine=first.cosine)
        border = new[2]
        point = correct_point(*new, exact=exact)
    return None


def fixed_unknown(size: int, which: int) -> np.ndarray:
    """Return the border that holds an unknown, given by its index."""
    border = np.zeros(size)
    border[which] = 1.0
    return border


def predict_and_correct(point: CurvePoint, step: float) -> CurvePoint:
    """Return the point a step along the tangent, in the same discretisation.

    Raises:
        NoOrbit: Newton's method does not converge.

    """
    ahead = correct_point(point.curve, point.z + step * point.tangent, point.tangent)
    if ahead is None:
        raise NoOrbit('the curve is lost')
    return ahead


def point_at_value(point: CurvePoint, value: float) -> CurvePoint | None:
    """Return the curve's point at a parameter value, from a point nearby; None if it is lost."""
    z = point.z + (value - point.value) / point.rate * point.tangent
    z[-1] = value
    ahead = resolve_point(point.curve, z, fixed_unknown(z.size, -1))
    if ahead is None:
        return None
    ahead.z[-1] = value
    # The border makes the value rise.
    return ahead if point.rate > 0.0 else ahead.reversed()


def next_crossing(start: CurvePoint, direction: float, value: float) -> CurvePoint | None:
    """Return the next point at a parameter value; None if Newton's method finds none.

    Args:
        start: a point before it, which may be a fold.
        direction: 1 or -1, along the tangent or back.
        value: of the parameter, which reaches it monotonically.

    """
    def ahead(step: float) -> CurvePoint:
        return predict_and_correct(start, direction * step)

    reach, sign = 1e-3, math.copysign(1.0, start.value - value)
    try:
        while sign * (ahead(reach).value - value) > 0.0:
            reach *= 2.0
        # Newton's method may put the start itself beyond a value that is next to it.
        near = ahead(0.0)
        if sign * (near.value - value) > 0.0:
            near = locate(lambda point: point.value - value, ahead, 0.0, reach, 1e-2 * reach)
    except NoOrbit:
        return None
    return point_at_value(near, value) if near.rate else None


def locate_fold(after: CurvePoint, step: float) -> CurvePoint | None:
    """Return the fold that lies up to about a step before a point; None if it cannot be found."""
    rate = rate_along(after)
    try:
        # Rounding may put a fold at the point itself behind it.
        last = 0.0 if rate(0.0) * after.rate > 0.0 else 0.1 * step
        if rate(last) * after.rate <= 0.0:
            return None
        for reach in (1.1, 1.4, 2.0):
            if rate(-reach * step) * after.rate < 0.0:
                fold = locate(lambda point: point.rate, partial(predict_and_correct, after),
                              -reach * step, last, 1e-9 * step)
                return resolve_point(fold.curve, fold.z, fold.tangent)
    except NoOrbit:
        # Newton's method may fail where two curves cross.
        return None
    return None


def rate_along(point: CurvePoint) -> Callable[[float], float]:
    """Return the derivative of the parameter by the arclength, as a function of the step.

    The function raises NoOrbit where Newton's method does not converge.
    """
    return lambda step: predict_and_correct(point, step).rate


def _longest_step(point: CurvePoint) -> float:
    """Return the longest step in which the amplitude falls by no more than MAX_AMPLITUDE_DROP."""
    size = point.amplitude
    ahead = point.curve.amplitude(point.z + 1e-3 * size * point.tangent)
    falling = (size - ahead) / (1e-3 * size)
    return MAX_AMPLITUDE_DROP * size / falling if falling > 0.0 else math.inf


def continue_curve(start: CurvePoint, low: float, high: float, visit: Callable[[CurvePoint], str],
                   *, first_step: float = FIRST_STEP, longest_step: float = MAX_STEP,
                   most: int = 200
                   ) -> tuple[list[int], str]:
    """Follow a curve from a point in the direction of its tangent.

    Args:
        start: a resolved point.
        low: smallest value of the parameter.
        high: largest value of the parameter.
        visit: called with every point after start; returns why to end there, or ''.
        first_step: arclength of the first step.
        longest_step: of any step.
        most: largest number of points.

    Returns:
        Indices of the folds, and why the curve ended: the result of visit, 'bound' (the last point
            is on it), 'steps', 'steep' (a point cannot be resolved) or 'lost' (Newton's method
            fails at any step length).

    """
    folds: list[int] = []
    count, point, step = 0, start, first_step
    while count < most:
        # Towards a homoclinic orbit only the period changes, ever faster.
        longer = max(1.0, float(point.z[-2] / start.z[-2]) / STEP_GROWTH_RATIO,
                     point.amplitude / STEP_GROWTH_RATIO)
        step = min(step, longest_step * longer, _longest_step(point))
        if step < MIN_STEP:
            return folds, 'lost'
        try:
            ahead = resolve_point(point.curve, point.z + step * point.tangent, point.tangent,
                                  exact=False)
        except NoOrbit:
            return folds, 'steep'
        if ahead is None or ahead.cosine < MIN_COSINE:
            step *= 0.5
            continue
        stations = [ahead]
        if ahead.rate * point.rate < 0.0:
            between = locate_fold(ahead, step)
            if between is None and step > 100.0 * MIN_STEP:
                step *= 0.5
                continue
            if between is not None:
                stations.insert(0, between)
        for station in stations:
            if not low <= station.value <= high:
                edge = point_at_value(station, low if station.value < low else high)
                # A start on the bound is no second point of the branch.
                if edge is None or edge.value == point.value:
                    return folds, 'bound'
                return folds, visit(edge) or 'bound'
            why = visit(station)
            if why:
                return folds, why
            if station is not ahead:
                folds.append(count)
            count += 1
        point = ahead
        if ahead.steps <= 3 and ahead.cosine > 1.0 - 0.3 * (1.0 - MIN_COSINE):
            step *= 1.5
    return folds, 'steps'
