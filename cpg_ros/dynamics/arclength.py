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

"""Pseudo-arclength continuation of curves of solutions past folds; roots of scalar functions.

n equations in n + 1 unknowns, the last of which is a parameter, have a curve of solutions. From a
point on it the tangent predicts the next one, and Newton's method corrects it in the hyperplane
that the tangent is normal to (Keller 1977; Doedel, Keller & Kernevez, *Numerical analysis and
control of bifurcation problems*, 1991). The parameter is an unknown like all others, so that a
fold, where it turns round, is a point like all others.
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
import math
from typing import Any, Protocol, TypeVar

from cpg_ros.common.errors import CpgError, ShortRepr
import numpy as np
import scipy

# Sign changes of functions of one variable, searched for on a grid and refined.

#: EXACT: absolute and relative tolerance of roots.
EXACT = 1e-13
#: REACH: an extremum on the grid is refined if its distance from zero is at most this multiple of
#: its difference from its neighbours.
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
    places, ordinates = list(grid), list(values)
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
            ordinates.insert(at, side * lowest.fun)
    signs = np.sign(ordinates)
    signs[signs == 0.0] = 1.0
    # Signs are NaN where the function has no value; their products differ from -1.
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


#: TOLERANCE: size of Newton's step at which it stops; the remaining error is of order its square.
#: NEWTON: most of these steps.
TOLERANCE = 1e-9
NEWTON = 8
#: NEGLIGIBLE: size of the predicted next step at which it stops if the tangent need not be new.
NEGLIGIBLE = 1e-4 * TOLERANCE
#: FIRST, SHORTEST, LONGEST: lengths of steps along the curve, each unknown relative to its scale.
FIRST, SHORTEST, LONGEST = 0.02, 1e-6, 0.2
#: GROWN: factor of the period's growth beyond which steps grow with it.
GROWN = 3.0
#: ALIGNED: least cosine of the angle between the tangents of two neighbours.
ALIGNED = 0.9
#: SHARE: largest share of the amplitude that a step may take, so that none leaps over the rest.
SHARE = 0.6


Place = TypeVar('Place')


def derivatives(values: Callable[[np.ndarray], Any], x: np.ndarray, difference: float
                ) -> np.ndarray:
    """Return the derivatives of a function by its arguments, from central differences.

    Args:
        values: function of m numbers, or of one.
        x: its argument, shape (n,).
        difference: of the argument.

    Returns:
        Shape (m, n), or (n,) if the function has one number.

    """
    return np.array([(values(x + step) - values(x - step)) / (2.0 * difference)
                     for step in difference * np.eye(x.size)]).T


def newton(equations: Callable[[np.ndarray], np.ndarray], x: np.ndarray, *, steps: int,
           tolerance: float, difference: float, longest: float) -> np.ndarray | None:
    """Solve n equations in n unknowns by Newton's method; None where it does not converge.

    Args:
        equations: residuals, shape (n,), at unknowns, shape (n,).
        x: unknowns to start from.
        steps: at most.
        tolerance: largest change in the last step.
        difference: of the unknowns, for the derivatives.
        longest: change of an unknown in a step from which on the solution is lost.

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


def continue_steps(advance: Callable[[Place, float], Place | None], here: Place, first: float,
                   shortest: float, longest: float) -> Iterator[Place]:
    """Yield solutions ahead of one, with shorter steps where one fails and longer ones after.

    Args:
        advance: from a solution by a step to the next one; None where none is found.
        here: solution to start from.
        first: first step.
        shortest: step below which the continuation ends, as at the edge of the range.
        longest: step.

    """
    step = first
    while step >= shortest:
        ahead = advance(here, step)
        if ahead is None:
            step *= 0.5
            continue
        yield ahead
        here, step = ahead, min(1.5 * step, longest)


def continue_along_tangents(
        correct: Callable[[np.ndarray, np.ndarray], tuple[np.ndarray, np.ndarray] | None],
        start: np.ndarray, tangent: np.ndarray, steps: tuple[float, float, float], *,
        aligned: float, most: int) -> Iterator[np.ndarray]:
    """Yield points ahead on a curve, until it ends, is lost or returns to the start.

    Args:
        correct: from a guess and the tangent it was predicted along to a point of the curve and
            the unit tangent there, either way; None where there is none.
        start: point of the curve, shape (n,).
        tangent: unit tangent there, in the direction to continue in.
        steps: first, shortest and longest.
        aligned: least cosine of the angle between the tangents of two neighbours.
        most: points.

    """
    def advance(here: tuple[np.ndarray, np.ndarray], step: float
                ) -> tuple[np.ndarray, np.ndarray] | None:
        point, before = here
        ahead = correct(point + step * before, before)
        if ahead is None or np.linalg.norm(ahead[0] - point) > 2.0 * step:
            return None
        cosine = ahead[1] @ before
        return (ahead[0], np.sign(cosine) * ahead[1]) if abs(cosine) >= aligned else None

    for count, (point, _) in enumerate(continue_steps(advance, (start, tangent), *steps), 1):
        yield point
        if count == most or (count > 5 and np.linalg.norm(point - start) < 0.5 * steps[2]):
            return


def offsets(curve: np.ndarray, point: np.ndarray) -> np.ndarray:
    """Return the vectors from a point to the nearest point of each chord of a curve.

    Args:
        curve: points in order, shape (n, d).
        point: shape (d,).

    Returns:
        Shape (n - 1, d), or (1, d) for a curve of one point.

    """
    if len(curve) < 2:
        return curve - point
    chords = np.diff(curve, axis=0)
    fraction = np.clip(((point - curve[:-1]) * chords).sum(axis=1) / np.maximum(
        (chords**2).sum(axis=1), 1e-30), 0.0, 1.0)
    return np.asarray(curve[:-1] + fraction[:, None] * chords - point)


class NoOrbit(CpgError):
    """The parameter set has no such gait; the message gives the reason."""


class SolutionCurve(Protocol):
    """A curve in a fixed discretisation; the last two unknowns are a period and the parameter."""

    def product(self, one: np.ndarray, other: np.ndarray) -> float:
        """Inner product of two vectors of unknowns."""

    def step(self, z: np.ndarray, border: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Linearise at z: Newton's increment normal to the border, and the tangent.

        The tangent's product with the border is 1.

        Raises:
            LinAlgError: the bordered equations are singular.

        """

    def amplitude(self, z: np.ndarray) -> float:
        """Half the range of what is continued; zero at a bifurcation from rest."""

    def orbit(self, z: np.ndarray) -> Any:
        """Make an orbit of a solution."""

    def renewed(self, z: np.ndarray, border: np.ndarray, again: bool
                ) -> tuple['SolutionCurve', np.ndarray, np.ndarray] | None:
        """Discretise anew where z is not resolved: curve, z and border; None if it is.

        Again: this discretisation was itself made to resolve z, and may have failed.

        Raises:
            NoOrbit: it cannot be resolved.

        """


@dataclass(frozen=True, eq=False, repr=False)
class CurvePoint(ShortRepr):
    """A point of a curve and the unit tangent there.

    Attributes:
        curve: the discretisation that it is a point of.
        z: unknowns; the last two are a period and the parameter.
        tangent: in the direction in which the curve is followed.
        steps: that Newton's method took to it.
        cosine: of the angle between the tangent and the border, if that was a unit vector.

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
        """Half the range of what is continued."""
        return self.curve.amplitude(self.z)

    def reversed(self) -> 'CurvePoint':  # noqa: A003
        """Return the same point, to be left the other way."""
        return replace(self, tangent=-self.tangent)


def correct_point(curve: SolutionCurve, z: np.ndarray, border: np.ndarray, *, exact: bool = True
                  ) -> CurvePoint | None:
    """Find the curve's point z + v with (v, border) = 0; None if Newton's method has lost it.

    Args:
        curve: in a fixed discretisation.
        z: unknowns near the point.
        border: that v is normal to.
        exact: take the tangent at the point itself. Otherwise it is taken before Newton's last
            step, which saves a step: precise enough to continue from, not to locate a fold.

    """
    before = 0.0
    with np.errstate(all='ignore'):
        for count in range(1, NEWTON + 1):
            try:
                increment, direction = curve.step(z, border)
            except np.linalg.LinAlgError:
                return None
            size = math.sqrt(curve.product(increment, increment))
            z = z + increment
            # Steps of more than the scale of everything have lost the curve.
            if not size < 1.0 or z[-2] <= 0.0:
                return None
            # Newton's next step is C size^2, with C = size / before^2 as in this one.
            if size <= TOLERANCE or (not exact and size**3 <= NEGLIGIBLE * before**2):
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
    """Return the border that holds one of the unknowns."""
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
    """Return the curve's point with a value of the parameter, from one nearby; None if lost."""
    z = point.z + (value - point.value) / point.rate * point.tangent
    z[-1] = value
    ahead = resolve_point(point.curve, z, fixed_unknown(z.size, -1))
    if ahead is None:
        return None
    ahead.z[-1] = value
    # The border makes the value rise.
    return ahead if point.rate > 0.0 else ahead.reversed()


def next_crossing(here: CurvePoint, way: float, value: float) -> CurvePoint | None:
    """Return the next point with a value of the parameter; None if Newton's method finds none.

    Args:
        here: a point before it, which may be a fold.
        way: 1 or -1, along the tangent or back.
        value: that the parameter reaches monotonically from here.

    """
    def gap(step: float) -> float:
        return predict_and_correct(here, way * step).value - value

    reach, sign = 1e-3, math.copysign(1.0, here.value - value)
    try:
        while sign * gap(reach) > 0.0:
            reach *= 2.0
        # Newton's method may put the point itself beyond a value that is next to it.
        ahead = (scipy.optimize.brentq(gap, 0.0, reach, xtol=1e-2 * reach)
                 if sign * gap(0.0) > 0.0 else 0.0)
        near = predict_and_correct(here, way * ahead)
    except NoOrbit:
        return None
    return point_at_value(near, value) if near.rate else None


def locate_fold(after: CurvePoint, step: float) -> CurvePoint | None:
    """Return the fold that lies up to about a step before a point; None if it cannot be found."""
    rate = rate_along(after)
    try:
        # If the fold is the point itself, rounding may put it after the point.
        last = 0.0 if rate(0.0) * after.rate > 0.0 else 0.1 * step
        if rate(last) * after.rate <= 0.0:
            return None
        for reach in (1.1, 1.4, 2.0):
            if rate(-reach * step) * after.rate < 0.0:
                fold = predict_and_correct(after, scipy.optimize.brentq(
                    rate, -reach * step, last, xtol=1e-9 * step, rtol=1e-12))
                return resolve_point(fold.curve, fold.z, fold.tangent)
    except NoOrbit:
        # Near a crossing of curves, as where symmetry is gained, Newton's method may fail.
        return None
    return None


def rate_along(point: CurvePoint) -> Callable[[float], float]:
    """Return the derivative of the parameter by the arclength, as a function of the step.

    The function raises NoOrbit where Newton's method does not converge.
    """
    return lambda step: predict_and_correct(point, step).rate


def _room(here: CurvePoint) -> float:
    """Longest step that takes no more than its share of the amplitude."""
    size = here.amplitude
    ahead = here.curve.amplitude(here.z + 1e-3 * size * here.tangent)
    falling = (size - ahead) / (1e-3 * size)
    return SHARE * size / falling if falling > 0.0 else math.inf


def continue_curve(start: CurvePoint, low: float, high: float, visit: Callable[[CurvePoint], str],
                   *, first_step: float = FIRST, longest_step: float = LONGEST, most: int = 200
                   ) -> tuple[list[int], str]:
    """Follow a curve from a point in the direction of its tangent.

    Args:
        start: a resolved point.
        low: least value of the parameter.
        high: greatest value of the parameter.
        visit: gets every point after start; it returns why to end there, or ''.
        first_step: arclength of the first step.
        longest_step: of any step.
        most: points, at most.

    Returns:
        The indices of the points that are folds, and why it ended: what visit returned,
        'bound' (the last point is on it), 'steps', 'steep' (it cannot be resolved) or 'lost'
        (Newton fails however short the step).

    """
    folds: list[int] = []
    count, here, step = 0, start, first_step
    while count < most:
        # Towards a homoclinic orbit only the period moves, and may move by ever more.
        longer = max(1.0, float(here.z[-2] / start.z[-2]) / GROWN)
        step = min(step, longest_step * longer, _room(here))
        if step < SHORTEST:
            return folds, 'lost'
        try:
            ahead = resolve_point(here.curve, here.z + step * here.tangent, here.tangent,
                                  exact=False)
        except NoOrbit:
            return folds, 'steep'
        if ahead is None or ahead.cosine < ALIGNED:
            step *= 0.5
            continue
        stations = [ahead]
        if ahead.rate * here.rate < 0.0:
            between = locate_fold(ahead, step)
            if between is None and step > 100.0 * SHORTEST:
                step *= 0.5
                continue
            if between is not None:
                stations.insert(0, between)
        for station in stations:
            if not low <= station.value <= high:
                edge = point_at_value(station, low if station.value < low else high)
                # A start on the bound is no second point of the branch.
                if edge is None or edge.value == here.value:
                    return folds, 'bound'
                return folds, visit(edge) or 'bound'
            why = visit(station)
            if why:
                return folds, why
            if station is not ahead:
                folds.append(count)
            count += 1
        here = ahead
        if ahead.steps <= 3 and ahead.cosine > 1.0 - 0.3 * (1.0 - ALIGNED):
            step *= 1.5
    return folds, 'steps'
