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

"""Curves of Hopf points in two parameters, and the codimension-two points on them.

The critical root is an unknown beside both parameters: ``det Delta(i omega; p1, p2) = 0`` is two
real equations in three unknowns, whose curve is followed by pseudo-arclength (Keller 1977; as
AUTO-07p and DDE-BIFTOOL do). For the delayed network Delta = i omega - A - B exp(-i omega tau).

Between two points of a curve at which a test function has different signs its zero is bracketed,
each place corrected onto the curve: the first Lyapunov coefficient of the gait's own class at a
Bautin point, the real part of another root at a Hopf-Hopf or zero-Hopf point (Kuznetsov, *Elements
of Applied Bifurcation Theory*, sections 8.3 to 8.6). A curve also ends inside the plane, where its
pair meets in 0 (Bogdanov-Takens), or where the equilibrium folds (zero-Hopf).
"""

from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, replace
from functools import partial
from itertools import chain, pairwise
import math

from cpg_ros.analysis.atlas.chart import CodimensionTwo, LossOnCurve, ParameterPlane
from cpg_ros.common.errors import CpgError, ShortRepr
from cpg_ros.dynamics import arclength
from cpg_ros.dynamics.characteristic import characteristic_matrix
from cpg_ros.dynamics.equilibrium import equilibrium, odd, Quotient
from cpg_ros.dynamics.hopf import AXIS_TOLERANCE, hopf_points, HopfPoint, NUM_SPARE, tracked_roots
from cpg_ros.dynamics.isotypic import Block, block_at, block_of, blocks, classes, Expansion
from cpg_ros.networks.symmetry import Symmetry
import numpy as np

# The equations of a Hopf point in two parameters, and Newton's method for them.

#: Tolerance and differences of Newton's method are fractions of the ranges.
NEWTON_ITERATIONS, NEWTON_TOLERANCE, DIFFERENCE_STEP = 12, 1e-12, 1e-6


class HopfCondition:
    """Two real equations in (p1, p2, omega), the parameters in fractions of their ranges."""

    def __init__(self, chart: ParameterPlane, mode: tuple[int, ...]) -> None:
        """Take the plane and the critical class."""
        self.chart, self.mode = chart, mode

    def values(self, fraction: np.ndarray) -> np.ndarray:
        """Return the real and the imaginary part of the determinant, shape (2,)."""
        network = self.chart.at_fractions(fraction[:2])
        block = block_at(network, equilibrium(network), self.mode)
        matrix = characteristic_matrix(1j * fraction[2], block.now, block.past, network.delay)[0]
        determinant = np.linalg.det(matrix)
        return np.array([determinant.real, determinant.imag])

    def tangent(self, fraction: np.ndarray) -> np.ndarray:
        """Return the unit tangent of the curve, either way, shape (3,)."""
        return np.linalg.svd(arclength.derivatives(self.values, fraction, DIFFERENCE_STEP))[2][-1]

    def corrected(self, guess: np.ndarray, tangent: np.ndarray) -> np.ndarray | None:
        """Solve in the plane normal to a tangent; None where Newton's method is lost."""
        try:
            return arclength.newton(
                lambda fraction: np.append(self.values(fraction), tangent @ (fraction - guess)),
                guess, steps=NEWTON_ITERATIONS, tolerance=NEWTON_TOLERANCE,
                difference=DIFFERENCE_STEP, longest=0.5)
        except (np.linalg.LinAlgError, CpgError, ArithmeticError):
            return None


def condition_of(chart: ParameterPlane, gait: str, fraction: np.ndarray) -> HopfCondition:
    """Return the condition of a gait's class at a Hopf point, for the direction of its wave.

    Args:
        chart: the plane.
        gait: of the Hopf point.
        fraction: (p1, p2, omega), the parameters in fractions of their ranges.

    """
    network = chart.at_fractions(fraction[:2])
    conditions = [HopfCondition(chart, block.mode)
                  for block in blocks(network, equilibrium(network)) if block.gait == gait]
    return min(conditions, key=lambda each: float(np.abs(each.values(fraction)).max()))


#: Lines along each axis on which the starts of curves are searched.
NUM_LINES = 41


@dataclass(frozen=True, eq=False, repr=False)
class ChartLine(ShortRepr):
    """A line across the plane of an atlas, parallel to one of its axes.

    Attributes:
        chart: the plane.
        gaits: whose Hopf points are searched on it.
        axis: 0 or 1.
        fixed: value on the other axis.
        low: least value on this one.
        high: greatest value.

    """

    chart: ParameterPlane
    gaits: tuple[str, ...]
    axis: int
    fixed: float
    low: float
    high: float

    def values_at(self, value: float) -> tuple[float, float]:
        """Return the values on both axes."""
        return (value, self.fixed) if self.axis == 0 else (self.fixed, value)


@dataclass(frozen=True, eq=False, repr=False)
class HopfStart(ShortRepr):
    """A Hopf point from which a curve is followed.

    Attributes:
        gait: whose.
        mode: its class.
        fraction: (p1, p2, omega), the parameters in fractions of their ranges.

    """

    gait: str
    mode: tuple[int, ...]
    fraction: np.ndarray


def lines_across(chart: ParameterPlane, gaits: tuple[str, ...]) -> Iterator[ChartLine]:
    """Yield evenly spaced lines along both axes: lines along one may all miss a curve."""
    axes = chart.first, chart.second
    for along, across in ((1, 0), (0, 1)):
        for fixed in np.linspace(axes[across].low, axes[across].high, NUM_LINES):
            yield ChartLine(chart, gaits, along, float(fixed), axes[along].low, axes[along].high)


def hopf_starts(segment: ChartLine) -> list[HopfStart]:
    """Return the Hopf points of some gaits on a line across the plane."""
    chart = segment.chart
    network = chart.at(*segment.values_at(segment.low))
    if not network.rests:
        return []
    line = (chart.first, chart.second)[segment.axis].line
    gaits = {frozenset(network.symmetry(gait).shifts): gait for gait in segment.gaits}
    try:
        points = hopf_points(network, line, segment.low, segment.high)
    except CpgError:
        return []
    starts = []
    for point in points:
        gait = gaits.get(frozenset(point.block.symmetry.shifts))
        if gait is not None:
            fraction = chart.fractions_of(segment.values_at(point.value))
            starts.append(HopfStart(gait, point.mode, np.append(fraction, point.omega)))
    return starts


#: Steps along a curve, as fractions of the ranges; points of it.
FIRST_STEP, MAX_STEP, MIN_STEP, MAX_POINTS = 0.01, 0.04, 1e-5, 400
#: Distance, as a fraction of the ranges, up to which a start lies on a known curve. Two classes
#: share a curve if SHARED_POINTS points on it are solutions of both to SHARED_TOLERANCE.
CURVE_TOLERANCE, SHARED_TOLERANCE, SHARED_POINTS = 5e-3, 1e-8, 8


@dataclass(frozen=True, eq=False, repr=False)
class Boundary(ShortRepr):
    """A boundary in the plane of an atlas.

    Attributes:
        kind: 'Hopf', 'torus', 'period doubling', 'branch point', 'fold', or where the period grows
            without bound, 'homoclinic' or 'SNIC'.
        gaits: that it bounds; classes with the same eigenvalues share a curve.
        points: values on both axes, and omega for Hopf points, shape (n, 2 or 3).
        codimension_two: points on it where a second condition holds.
        losses: normal forms at points on it where stable orbits lose their stability.

    """

    kind: str
    gaits: tuple[str, ...]
    points: np.ndarray
    codimension_two: tuple[CodimensionTwo, ...] = ()
    losses: tuple[LossOnCurve, ...] = ()

    def passes(self, chart: ParameterPlane, point: np.ndarray, reach: float) -> bool:
        """Whether the curve passes a point within a distance, both in fractions of a plane."""
        return arclength.on_curve(chart.fractions_of(self.points), point, reach)

    def __str__(self) -> str:
        kinds = [name for name, soft in (('supercritical', True), ('subcritical', False))
                 if any(loss.soft is soft for loss in self.losses)]
        return (f'{self.kind} of {" and ".join(self.gaits)}'
                + (f' ({" and ".join(kinds)})' if kinds else ''))


def _inside(fraction: np.ndarray) -> bool:
    return bool((fraction[:2] >= -1e-12).all() and (fraction[:2] <= 1.0 + 1e-12).all()
                and fraction[2] > 1e-4)


def _continue_hopf(condition: HopfCondition, start: np.ndarray, direction: float
                   ) -> list[np.ndarray]:
    def correct(guess: np.ndarray, tangent: np.ndarray) -> tuple[np.ndarray, np.ndarray] | None:
        point = condition.corrected(guess, tangent)
        return (None if point is None or not _inside(point) else (point, condition.tangent(point)))

    return [*arclength.continue_along_tangents(
        correct, start, direction * condition.tangent(start), (FIRST_STEP, MIN_STEP, MAX_STEP),
        aligned=0.95, most=MAX_POINTS)]


@dataclass(eq=False)
class _HopfCurve:
    gaits: list[str]
    modes: set[tuple[int, ...]]
    fractions: np.ndarray

    def holds(self, chart: ParameterPlane, start: HopfStart) -> bool:
        """Whether a point lies on the curve, and its class shares all of the curve."""
        scale = np.array([1.0, 1.0, max(1.0, abs(start.fraction[2]))])
        if not arclength.on_curve(self.fractions / scale, start.fraction / scale, CURVE_TOLERANCE):
            return False
        if start.mode not in self.modes:
            condition = HopfCondition(chart, start.mode)
            for fraction in self.fractions[::max(1, len(self.fractions) // SHARED_POINTS)]:
                exact = condition.corrected(fraction, condition.tangent(fraction))
                if exact is None or np.abs(exact - fraction).max() > SHARED_TOLERANCE:
                    return False
            self.modes.add(start.mode)
        if start.gait not in self.gaits:
            self.gaits.append(start.gait)
        return True


def curves_from(chart: ParameterPlane, starts: Iterable[HopfStart]) -> list[Boundary]:
    """Follow the curves through some Hopf points; each appears once, with all its gaits."""
    curves: list[_HopfCurve] = []
    for start in starts:
        if any(curve.holds(chart, start) for curve in curves):
            continue
        condition = HopfCondition(chart, start.mode)
        exact = condition.corrected(start.fraction, condition.tangent(start.fraction))
        if exact is None:
            continue
        back, ahead = (_continue_hopf(condition, exact, direction) for direction in (-1.0, 1.0))
        curves.append(_HopfCurve([start.gait], {start.mode},
                                 np.array([*back[::-1], exact, *ahead])))
    low, size = np.append(chart.low, 0.0), np.append(chart.size, 1.0)
    return [Boundary('Hopf', tuple(curve.gaits), low + curve.fractions * size) for curve in curves]


def hopf_curves(chart: ParameterPlane, gaits: tuple[str, ...],
                run: Callable[..., Iterable[list[HopfStart]]] = map) -> list[Boundary]:
    """Follow all curves of Hopf points of some gaits that cross a few lines.

    Args:
        chart: the plane.
        gaits: of its network.
        run: applies a function to jobs, as ``map`` does.

    """
    return curves_from(chart, chain(*run(hopf_starts, [*lines_across(chart, gaits)])))


# Bogdanov-Takens and zero-Hopf points, in which a curve of Hopf points ends inside the plane.

#: Largest distance of a curve's end from its last point, in fractions of the ranges.
MAX_END_DISTANCE = 0.03
#: Of Newton's method at the end of a curve.
END_ITERATIONS, MAX_RESIDUAL = 30, 1e-9
#: Imaginary part of the root at which the derivative of a real determinant is taken.
IMAGINARY_STEP = 1e-6

Equations = Callable[[np.ndarray], np.ndarray]


class _End:
    """Equations in (state, p1, p2, ...), the parameters in fractions of their ranges."""

    def __init__(self, chart: ParameterPlane, symmetry: Symmetry, fraction: np.ndarray) -> None:
        self.chart, self.symmetry = chart, symmetry
        network = chart.at_fractions(fraction[:2])
        self.rest = equilibrium(network)
        self.moves = not odd(network) and network.at_rest() is None
        self.together = classes(network)[0]
        self.free = len(self.rest) if self.moves else 0

    def _split(self, unknowns: np.ndarray) -> tuple[np.ndarray, Expansion]:
        """Return the rates of the state, where it moves, and the expansion about it."""
        fraction = unknowns[self.free:self.free + 2]
        network = self.chart.at_fractions(fraction)
        if not self.moves:
            return np.zeros(0), Expansion(network, equilibrium(network))
        state = unknowns[:self.free]
        return Quotient(network).together(state)[0], Expansion(network, state)

    def takens(self, unknowns: np.ndarray) -> np.ndarray:
        """Equations of a Bogdanov-Takens point in (state, p1, p2)."""
        rates, expansion = self._split(unknowns)
        block = block_of(expansion, self.symmetry)
        return np.array([*rates, _determinant(block, 0.0).real,
                         _determinant(block, 1j * IMAGINARY_STEP).imag / IMAGINARY_STEP])

    def zero_hopf(self, unknowns: np.ndarray) -> np.ndarray:
        """Equations of a zero-Hopf point in (state, p1, p2, omega)."""
        rates, expansion = self._split(unknowns)
        pair = _determinant(block_of(expansion, self.symmetry), 1j * unknowns[-1])
        fold = _determinant(block_of(expansion, self.together), 0.0)
        return np.array([*rates, pair.real, pair.imag, fold.real])


def _determinant(block: Block, root: complex) -> complex:
    return complex(np.linalg.det(characteristic_matrix(root, block.now, block.past,
                                                       block.network.delay)[0]))


def _solved(equations: Equations, start: np.ndarray) -> tuple[np.ndarray, float] | None:
    """Apply Newton's method; return the solution and its largest residual, or None."""
    try:
        solution = arclength.newton(equations, start, steps=END_ITERATIONS, longest=1.0,
                                    tolerance=NEWTON_TOLERANCE, difference=DIFFERENCE_STEP)
        residual = math.inf if solution is None else float(np.abs(equations(solution)).max())
    except (np.linalg.LinAlgError, CpgError, ArithmeticError):
        return None
    return None if solution is None or not residual < MAX_RESIDUAL else (solution, residual)


def curve_ends(chart: ParameterPlane, gait: str, mode: tuple[int, ...], fractions: np.ndarray
               ) -> Iterator[CodimensionTwo]:
    """Yield the Bogdanov-Takens and zero-Hopf points in which a curve of Hopf points ends.

    Args:
        chart: the plane.
        gait: of the curve.
        mode: of the critical class.
        fractions: points of the curve, (p1, p2, omega), the parameters in fractions, shape (n, 3).

    """
    if len(fractions) < 3:
        return
    for last, before in ((fractions[0], fractions[1]), (fractions[-1], fractions[-2])):
        network = chart.at_fractions(last[:2])
        block = block_at(network, equilibrium(network), mode)
        end = _End(chart, block.symmetry, last)
        start = np.concatenate([end.rest[:end.free], last])
        ahead = last[2] - before[2]
        if block.real and ahead < 0.0:
            solution = _solved(end.takens, start[:-1])
            if solution and _here(solution[0][end.free:], last):
                yield CodimensionTwo('Bogdanov-Takens', gait,
                                     chart.values_at(solution[0][end.free:]), solution[1], 0.0)
                continue
        if end.moves:
            solution = _solved(end.zero_hopf, start)
            if (solution and _here(solution[0][end.free:-1], last)
                    and solution[0][-1] > 0.5 * last[2]):
                folds = block_of(Expansion(network, end.rest), end.together).gait
                yield CodimensionTwo('zero-Hopf', gait, chart.values_at(solution[0][end.free:-1]),
                                     solution[1], float(solution[0][-1]), (folds,), 0.0)


def _here(fraction: np.ndarray, last: np.ndarray) -> bool:
    """Return whether a solution lies in the plane, close to the end of the curve."""
    return bool((fraction >= -1e-9).all() and (fraction <= 1.0 + 1e-9).all()
                and np.abs(fraction - last[:2]).max() < MAX_END_DISTANCE)


#: Tolerance of a zero, as a fraction of the way between two points of a curve.
ZERO_TOLERANCE = 1e-14
#: Size of a test function at a zero, relative to its neighbours; at a pole it is larger.
MAX_ZERO_RATIO = 1e-5
#: Rounding error of a Lyapunov coefficient, relative to the curve's largest.
ROUNDING = 1e-9
#: Difference of equal points in fractions of the ranges, and of equal frequencies.
POINT_TOLERANCE = 1e-7
#: Imaginary part of a real root, over omega.
REAL_ROOT_TOLERANCE = 1e-6

Test = Callable[[np.ndarray], float]


class _Curve:
    """A curve of Hopf points of a class; each point is solved once."""

    def __init__(self, condition: HopfCondition, fractions: np.ndarray) -> None:
        self.condition, self.fractions = condition, fractions
        self.chart = condition.chart
        self._solved: dict[bytes, tuple[HopfPoint, tuple[Block, ...]]] = {}

    def at(self, fraction: np.ndarray) -> tuple[HopfPoint, tuple[Block, ...]]:
        """Return the Hopf point at (p1, p2, omega), and the blocks of all classes."""
        key = fraction.tobytes()
        if key not in self._solved:
            network, line = self.chart.at_fractions(fraction[:2]), self.chart.second.line
            rest = equilibrium(network)
            split = blocks(network, rest)
            block = next(block for block in split if block.mode == self.condition.mode)
            self._solved[key] = HopfPoint(network, line, line.value(network), block,
                                          float(fraction[2]), rest), split
        return self._solved[key]

    def between(self, left: np.ndarray, right: np.ndarray, fraction: float) -> np.ndarray:
        """Return the curve's point at a fraction of the way between two of its points.

        Raises:
            ArithmeticError: Newton's method has lost it.

        """
        tangent = (right - left) / np.linalg.norm(right - left)
        point = self.condition.corrected(left + fraction * (right - left), tangent)
        if point is None:
            raise ArithmeticError('the curve is lost')
        return point

    def zeros(self, test: Test, small: float) -> Iterator[np.ndarray]:
        """Yield the points at which a test function changes its sign through 0.

        Args:
            test: of a point.
            small: rounding error of its values; points with smaller values are skipped, so that
                their neighbours bracket the zero.

        """
        values = [(fraction, test(fraction)) for fraction in self.fractions]
        clear = [(fraction, value) for fraction, value in values if abs(value) > small]
        for (start, left), (end, right) in pairwise(clear):
            if not left * right < 0.0:
                continue
            try:
                zero = arclength.locate(test, partial(self.between, start, end), 0.0, 1.0,
                                        ZERO_TOLERANCE)
            except (ArithmeticError, ValueError, CpgError):
                continue
            if abs(test(zero)) < MAX_ZERO_RATIO * min(abs(left), abs(right)):
                yield zero


def with_degeneracies(job: tuple[ParameterPlane, Boundary]) -> Boundary:
    """Return a curve of Hopf points with the points at which a second condition holds."""
    chart, curve = job
    return replace(curve, codimension_two=hopf_degeneracies(chart, curve))


def hopf_degeneracies(chart: ParameterPlane, curve: Boundary) -> tuple[CodimensionTwo, ...]:
    """Find the codimension-two points on a curve of Hopf points, in the order of the curve.

    Two zeros of a test function between neighbouring points of the curve are not found, nor are
    any of a first Lyapunov coefficient that is 0 along the curve, as where the rates are linear
    about the equilibrium. Zeros of the frequency of a travelling wave (walk, jump) are not
    searched.

    Args:
        chart: the plane.
        curve: of Hopf points, as ``hopf_curves`` returns it.

    """
    fractions = np.column_stack([chart.fractions_of(curve.points), curve.points[:, 2]])
    points: list[CodimensionTwo] = []
    for k, gait in enumerate(curve.gaits):
        condition = condition_of(chart, gait, fractions[len(fractions) // 2])
        whole = _Curve(condition, fractions)
        points += _bautin(whole, gait)
        if k == 0:
            # The classes of a curve have the same roots.
            points += _other_roots(whole, gait)
            points += curve_ends(chart, gait, condition.mode, fractions)
    return tuple(sorted(points, key=lambda point: np.abs(
        fractions[:, :2] - chart.fractions_of(point.values)).max(axis=1).argmin()))


def _bautin(curve: _Curve, gait: str) -> Iterator[CodimensionTwo]:
    def test(fraction: np.ndarray) -> float:
        try:
            return curve.at(fraction)[0].lyapunov
        except (np.linalg.LinAlgError, CpgError):
            return math.nan  # At a pole, which is skipped.

    small = ROUNDING * float(np.nanmax([0.0,
                                        *(abs(test(fraction)) for fraction in curve.fractions)]))
    for zero in curve.zeros(test, small):
        yield CodimensionTwo('Bautin', gait, curve.chart.values_at(zero[:2]), test(zero),
                             float(zero[2]))


def _other_roots(curve: _Curve, gait: str) -> list[CodimensionTwo]:
    """Return where other roots of any class cross: pairs, or a real one."""
    crossings: list[CodimensionTwo] = []
    small = AXIS_TOLERANCE * float(curve.fractions[:, 2].max())
    points = [curve.at(fraction) for fraction in curve.fractions]
    for which in range(len(points[0][1])):
        count = tracked_roots([split[which] for _, split in points], NUM_SPARE + 2)

        def others(fraction: np.ndarray, which: int = which, count: int = count) -> np.ndarray:
            point, split = curve.at(fraction)
            return point.but_critical(split[which], split[which].roots(count))

        for rank in range(min(len(others(fraction)) for fraction in curve.fractions)):
            def test(fraction: np.ndarray, rank: int = rank, others: Callable = others) -> float:
                return float(others(fraction)[rank].real)

            for zero in curve.zeros(test, small):
                block, root = curve.at(zero)[1][which], complex(others(zero)[rank])
                # Of a pair in two conjugate classes, the root with positive imaginary part.
                if root.imag > -REAL_ROOT_TOLERANCE * zero[2] or block.real:
                    _enter(crossings, _crossing(curve, gait, zero, block, root), curve.chart)
    return crossings


def _crossing(curve: _Curve, gait: str, zero: np.ndarray, block: Block, root: complex
              ) -> CodimensionTwo:
    kind, omega = 'Hopf-Hopf', abs(root.imag)
    if omega < REAL_ROOT_TOLERANCE * zero[2]:
        kind, omega = 'zero-Hopf', 0.0
    return CodimensionTwo(kind, gait, curve.chart.values_at(zero[:2]), root.real,
                          float(zero[2]), (block.gait,), omega)


def _enter(points: list[CodimensionTwo], new: CodimensionTwo, chart: ParameterPlane) -> None:
    """Enter a point, or add its classes to an equal point."""
    for k, point in enumerate(points):
        gap = np.abs(np.subtract(point.values, new.values) / chart.size).max()
        if (point.kind == new.kind and gap < POINT_TOLERANCE
                and np.isclose(point.other_omega, new.other_omega, rtol=POINT_TOLERANCE,
                               atol=POINT_TOLERANCE)):
            points[k] = replace(point, other=tuple(dict.fromkeys((*point.other, *new.other))))
            return
    points.append(new)
