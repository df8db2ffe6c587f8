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

"""Curves of Hopf points in two parameters.

The critical root is an unknown beside both parameters: ``det Delta(i omega; p1, p2) = 0`` is two
real equations in three unknowns, whose curve is followed by pseudo-arclength (Keller 1977; as
AUTO-07p and DDE-BIFTOOL do). For the delayed network Delta = i omega - A - B exp(-i omega tau).
"""

from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from itertools import chain

from cpg_ros.analysis.atlas.chart import CodimensionTwo, ParameterPlane
from cpg_ros.analysis.atlas.orbit_plane import LossOnCurve
from cpg_ros.common.errors import CpgError, ShortRepr
from cpg_ros.dynamics.arclength import (
    continue_along_tangents,
    derivatives,
    newton,
    offsets,
)
from cpg_ros.dynamics.characteristic import characteristic_matrix
from cpg_ros.dynamics.equilibrium import equilibrium
from cpg_ros.dynamics.hopf import hopf_points
from cpg_ros.dynamics.isotypic import block_at, blocks
import numpy as np

# The equations of a Hopf point in two parameters, and Newton's method for them.

#: Newton's method: steps, and where it ends; differences for its matrix, in fractions.
NEWTON, EXACT, DIFFERENCE = 12, 1e-12, 1e-6


class HopfCondition:
    """Two real equations in (p1, p2, omega), the parameters in fractions of their ranges."""

    def __init__(self, chart: ParameterPlane, mode: tuple[int, ...]) -> None:
        """Take the plane and the class whose root crosses."""
        self.chart, self.mode = chart, mode

    def values(self, fraction: np.ndarray) -> np.ndarray:
        """Return the real and the imaginary part of the determinant, shape (2,)."""
        network = self.chart.at_fractions(fraction[:2])
        block = block_at(network, equilibrium(network), self.mode)
        matrix = characteristic_matrix(1j * fraction[2], block.now, block.past, network.delay)[0]
        found = np.linalg.det(matrix)
        return np.array([found.real, found.imag])

    def tangent(self, fraction: np.ndarray) -> np.ndarray:
        """Return the unit tangent of the curve, either way, shape (3,)."""
        return np.linalg.svd(derivatives(self.values, fraction, DIFFERENCE))[2][-1]

    def corrected(self, guess: np.ndarray, tangent: np.ndarray) -> np.ndarray | None:
        """Solve in the plane normal to a tangent; None where Newton's method is lost."""
        try:
            return newton(
                lambda fraction: np.append(self.values(fraction), tangent @ (fraction - guess)),
                guess, steps=NEWTON, tolerance=EXACT, difference=DIFFERENCE, longest=0.5)
        except (np.linalg.LinAlgError, CpgError, ArithmeticError):
            return None


def condition_of(chart: ParameterPlane, gait: str, fraction: np.ndarray) -> HopfCondition:
    """Return the condition of a gait's class at a Hopf point, of a wave's senses that which holds.

    Args:
        chart: the plane.
        gait: whose.
        fraction: (p1, p2, omega), the parameters in fractions of their ranges.

    """
    network = chart.at_fractions(fraction[:2])
    conditions = [HopfCondition(chart, block.mode)
                  for block in blocks(network, equilibrium(network)) if block.gait == gait]
    return min(conditions, key=lambda one: float(np.abs(one.values(fraction)).max()))


# Hopf points on lines across the plane of an atlas, from which curves are followed.

#: Lines along each axis.
LINES = 41


@dataclass(frozen=True, eq=False, repr=False)
class ChartLine(ShortRepr):
    """A line across the plane of an atlas, parallel to one of its axes.

    Attributes:
        chart: the plane.
        gaits: whose Hopf points are searched on it.
        axis: along which: 0 or 1.
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

    def place(self, value: float) -> tuple[float, float]:
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
        for fixed in np.linspace(axes[across].low, axes[across].high, LINES):
            yield ChartLine(chart, gaits, along, float(fixed), axes[along].low, axes[along].high)


def hopf_starts(segment: ChartLine) -> list[HopfStart]:
    """Return the Hopf points of some gaits on a line across the plane."""
    chart = segment.chart
    network = chart.at(*segment.place(segment.low))
    if not network.rests:
        return []
    line = (chart.first, chart.second)[segment.axis].line
    gaits = {frozenset(network.symmetry(gait).shifts): gait for gait in segment.gaits}
    try:
        points = hopf_points(network, line, segment.low, segment.high)
    except CpgError:
        return []
    found = []
    for point in points:
        gait = gaits.get(frozenset(point.block.symmetry.shifts))
        if gait is not None:
            fraction = (np.array(segment.place(point.value)) - chart.low) / chart.size
            found.append(HopfStart(gait, point.mode, np.append(fraction, point.omega)))
    return found


#: Steps in fractions of the ranges, and points of a curve at most.
FIRST, LONGEST, SHORTEST, MOST = 0.01, 0.04, 1e-5, 400
#: A beginning this close to a curve, in fractions of the ranges, lies on it. Two classes share a
#: curve if a few points on it, so many, are solutions of both.
SAME, SHARED, CHECKED = 5e-3, 1e-8, 8


@dataclass(frozen=True, eq=False, repr=False)
class Boundary(ShortRepr):
    """A boundary in the plane of an atlas.

    Attributes:
        kind: 'Hopf', 'torus', 'period doubling', 'branch point', 'fold', or where the period grows
            without bound, 'homoclinic' or 'SNIC'.
        gaits: whose: several, where classes with the same eigenvalues share it.
        points: values on both axes, and of a Hopf point omega, shape (n, 2 or 3).
        codimension_two: points on it where a second condition holds.
        losses: whether the loss is supercritical at points on it where a multiplier of
            stable orbits crosses the unit circle, other than by a fold.

    """

    kind: str
    gaits: tuple[str, ...]
    points: np.ndarray
    codimension_two: tuple[CodimensionTwo, ...] = ()
    losses: tuple[LossOnCurve, ...] = ()

    def fractions(self, chart: ParameterPlane) -> np.ndarray:
        """Return the points in fractions of the ranges of a plane, shape (n, 2)."""
        return np.asarray((self.points[:, :2] - chart.low) / chart.size)

    def __str__(self) -> str:
        met = [name for name, soft in (('supercritical', True), ('subcritical', False))
               if any(loss.soft is soft for loss in self.losses)]
        return (f'{self.kind} of {" and ".join(self.gaits)}'
                + (f' ({" and ".join(met)})' if met else ''))


def _inside(fraction: np.ndarray) -> bool:
    return bool((fraction[:2] >= -1e-12).all() and (fraction[:2] <= 1.0 + 1e-12).all()
                and fraction[2] > 1e-4)


def _continue_hopf(condition: HopfCondition, start: np.ndarray, way: float) -> list[np.ndarray]:
    def correct(guess: np.ndarray, tangent: np.ndarray) -> tuple[np.ndarray, np.ndarray] | None:
        point = condition.corrected(guess, tangent)
        return (None if point is None or not _inside(point) else
                (point, condition.tangent(point)))

    return [*continue_along_tangents(correct, start, way * condition.tangent(start),
                                     (FIRST, SHORTEST, LONGEST), aligned=0.95, most=MOST)]


@dataclass(eq=False)
class _HopfCurve:
    gaits: list[str]
    modes: set[tuple[int, ...]]
    fractions: np.ndarray

    def holds(self, chart: ParameterPlane, start: HopfStart) -> bool:
        """Whether a point lies on the curve, as one of a class that has all of the curve."""
        if not _on(self.fractions, start.fraction):
            return False
        if start.mode not in self.modes:
            condition = HopfCondition(chart, start.mode)
            for fraction in self.fractions[::max(1, len(self.fractions) // CHECKED)]:
                exact = condition.corrected(fraction, condition.tangent(fraction))
                if exact is None or np.abs(exact - fraction).max() > SHARED:
                    return False
            self.modes.add(start.mode)
        if start.gait not in self.gaits:
            self.gaits.append(start.gait)
        return True


def curves_from(chart: ParameterPlane, starts: Iterable[HopfStart]) -> list[Boundary]:
    """Follow the curves of Hopf points through some; each is listed once, with all its gaits."""
    curves: list[_HopfCurve] = []
    for start in starts:
        if any(curve.holds(chart, start) for curve in curves):
            continue
        condition = HopfCondition(chart, start.mode)
        exact = condition.corrected(start.fraction, condition.tangent(start.fraction))
        if exact is None:
            continue
        back, ahead = (_continue_hopf(condition, exact, way) for way in (-1.0, 1.0))
        curves.append(_HopfCurve([start.gait], {start.mode},
                                 np.array([*back[::-1], exact, *ahead])))
    low, size = np.append(chart.low, 0.0), np.append(chart.size, 1.0)
    return [Boundary('Hopf', tuple(curve.gaits), low + curve.fractions * size) for curve in curves]


def hopf_curves(chart: ParameterPlane, gaits: tuple[str, ...],
                run: Callable[..., Iterable[list[HopfStart]]] = map) -> list[Boundary]:
    """Follow all curves of Hopf points of some gaits that a few lines across the plane meet.

    Args:
        chart: the plane.
        gaits: of its network.
        run: applies a function to jobs, as ``map`` does, or ``Fleet.map``.

    """
    return curves_from(chart, chain(*run(hopf_starts, [*lines_across(chart, gaits)])))


def on_curve(curve: Boundary, chart: ParameterPlane, point: np.ndarray, reach: float) -> bool:
    """Whether a point lies on a curve, up to a distance; both in fractions of the ranges."""
    return bool((np.abs(offsets(curve.fractions(chart), point)).max(axis=1) < reach).any())


def _on(curve: np.ndarray, start: np.ndarray) -> bool:
    """Whether a Hopf point, (p1, p2, omega), lies on a curve, between its points."""
    gap = np.abs(offsets(curve, start))
    gap[:, 2] /= max(1.0, abs(start[2]))
    return bool((gap.max(axis=1) < SAME).any())
