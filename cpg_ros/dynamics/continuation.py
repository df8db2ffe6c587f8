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

"""Branches of periodic orbits: a gait followed along a line of parameters, past its folds.

A branch says over which range of parameters a gait exists, where two orbits of it coexist, and
how it ends: at a Hopf point of the rest state, where its amplitude falls to zero, at an orbit of
more symmetry, near a homoclinic orbit, where its period has no bound, or at the ends of the range.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace

from cpg_ros.common.errors import InputError, ShortRepr
from cpg_ros.dynamics import arclength
from cpg_ros.dynamics.arclength import CurvePoint, NoOrbit
from cpg_ros.dynamics.orbit import extra_symmetry, Orbit
from cpg_ros.dynamics.orbit_method import orbit_method
from cpg_ros.networks.network import Network, ParameterLine
from cpg_ros.networks.symmetry import Symmetry
import numpy as np

# How branches of orbits end, and where: what lies beyond the last orbit is extrapolated.

#: A branch that is no longer resolved ends at an orbit of unbounded period if the period has grown
#: by the factor GROWN, and the value changes by less than STILL of its scale per period.
GROWN, STILL = 3.0, 1e-2
#: It has also ended there if, in a step, the period grows by more than the share LONGER while the
#: value changes by less than ROUNDING of its scale.
LONGER, ROUNDING = 0.01, 1e-9
#: STEEPER: power of the period's inverse from which on the fall of the value's slope counts as
#: exponential (homoclinic); near a saddle-node the power is 3.
STEEPER = 4.0


@dataclass(frozen=True)
class BranchEnd:
    """The end of a branch and its reason.

    Attributes:
        why: 'rest' (the amplitude falls to zero: a Hopf point), 'symmetry' (it runs into an
            orbit that has more of it, where it turns back as its own mirror image), 'period'
            (it grows without bound: near a homoclinic orbit), 'bound' (an end of the range),
            'steps', 'steep' (the waveform cannot be resolved), 'lost' (Newton's method fails
            however short the step), 'start' (it was not followed that way).
        value: where; of a Hopf point extrapolated to amplitude 0, of 'period' to no period.
        period: at the Hopf point; else that of the last orbit.

    """

    why: str
    value: float
    period: float

    def __str__(self) -> str:
        texts = {'rest': 'Hopf point', 'symmetry': 'orbit of more symmetry',
                 'bound': 'followed to',
                 'period': 'homoclinic end near', 'steps': 'not followed beyond', 'start':
                 'not followed from', 'steep': 'too steep beyond', 'lost': 'lost at'}[self.why]
        grows = ', period grows' if self.why == 'period' else ''
        return f'{texts} {self.value:.7g}{grows}'


def grows_alone(values: np.ndarray, periods: np.ndarray, scale: float) -> bool:
    """Whether from one point to the next the period grows and the value no longer moves."""
    return bool(len(values) > 1 and abs(np.diff(periods)) > LONGER * periods[0]
                and abs(np.diff(values)) < ROUNDING * scale)


def without_period(values: np.ndarray, periods: np.ndarray, scale: float) -> float | None:
    """Return the value towards which a branch's period grows without bound; None if not so.

    Args:
        values: of the parameter at the last points, shape (points,).
        periods: of the orbits there, shape (points,).
        scale: of the values.

    """
    if periods.size < 4 or not periods[-1] > GROWN * periods.min():
        return None
    slopes, middle = _slopes(values, periods)
    if not abs(slopes[-1]) * periods[-1] < STILL * scale:
        return None
    if _winds(slopes):
        # The value spirals in, in ever smaller turns: the last one is the best estimate.
        return float(values[-1])
    fall = np.log(slopes[0] / slopes[2])
    power = fall / np.log(middle[2] / middle[0])
    if power <= 1.5:
        return None
    if power < STEEPER:
        last = slopes[2] * (middle[2] / periods[-1])**power
        return float(values[-1] + last * periods[-1] / (power - 1.0))
    rate = fall / (middle[2] - middle[0])
    last = slopes[2] * np.exp(-rate * (periods[-1] - middle[2]))
    return float(values[-1] + last / rate)


def law_of_growth(values: np.ndarray, periods: np.ndarray) -> str | None:
    """Return the law by which a branch's period grows without bound, from its last points.

    Args:
        values: of the parameter, shape (points,).
        periods: of the orbits there, shape (points,).

    Returns:
        'homoclinic', 'SNIC' (a saddle node on the invariant circle), or None.

    """
    if periods.size < 4:
        return None
    slopes, middle = _slopes(values, periods)
    if _winds(slopes):
        return 'homoclinic'
    power = np.log(slopes[0] / slopes[2]) / np.log(middle[2] / middle[0])
    return None if power <= 1.5 else 'SNIC' if power < STEEPER else 'homoclinic'


def _slopes(values: np.ndarray, periods: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Derivatives of the value by the period between the last four points, and periods there."""
    return (np.diff(values[-4:]) / np.diff(periods[-4:]),
            0.5 * (periods[-4:-1] + periods[-3:]))


def _winds(slopes: np.ndarray) -> bool:
    """Whether the value spirals in, or no longer changes."""
    return bool(not slopes.all() or (np.sign(slopes) != np.sign(slopes[-1])).any())


#: REST: amplitude below which an orbit counts as its Hopf point.
REST = 2e-3


@dataclass(frozen=True, eq=False, repr=False)
class BranchPoint(ShortRepr):
    """A point of a branch.

    Attributes:
        value: where on the line.
        orbit: of the network there. At a fold its derivatives by parameters have no bound.
        place: the same as continuation has it, with the tangent along the branch.

    """

    value: float
    orbit: Orbit
    place: CurvePoint

    def _summary(self) -> str:
        return f'{self.value:.6g}, {self.orbit!r}'

    @property
    def amplitude(self) -> float:
        """Half the range of cell 1's first variable."""
        return float(self.orbit.levels[0, 0, 1])


@dataclass(frozen=True, eq=False, repr=False)
class Branch(ShortRepr):
    """Periodic orbits of one gait along a line of parameters.

    Attributes:
        along: the line.
        points: in the order in which they follow one another on the branch.
        turns: which of them are folds.
        ends: of the branch, before the first point and after the last.

    """

    along: ParameterLine
    points: tuple[BranchPoint, ...]
    turns: tuple[int, ...]
    ends: tuple[BranchEnd, BranchEnd]

    def _summary(self) -> str:
        orbit, values = self.points[0].orbit, self.values
        return (f'{orbit.gait} of {orbit.network.name} along {self.along} '
                f'{values.min():.6g} to {values.max():.6g}: {len(self.points)} points, '
                f'folds: {len(self.turns)}, ends: {self.ends[0]}; {self.ends[1]}')

    @property
    def folds(self) -> tuple[BranchPoint, ...]:
        """Folds of the branch, with two orbits on one side and none on the other."""
        return tuple(self.points[k] for k in self.turns)

    @property
    def values(self) -> np.ndarray:
        """Values of the parameter at the points, shape (points,)."""
        return np.array([point.value for point in self.points])

    @property
    def periods(self) -> np.ndarray:
        """Periods of the orbits in model time, shape (points,)."""
        return np.array([point.orbit.period for point in self.points])

    @property
    def amplitudes(self) -> np.ndarray:
        """Half the range of cell 1's first variable at the points, shape (points,)."""
        return np.array([point.amplitude for point in self.points])

    def at(self, value: float) -> tuple[Orbit, ...]:
        """All orbits of the branch at a value, in its order; at a fold it may be one or two.

        Raises:
            NoOrbit: between two points that the value lies between, Newton's method found none.

        """
        points = []
        for left, right in zip(self.points, self.points[1:], strict=False):
            if left.value == value:
                points.append(left.orbit)
            elif (left.value - value) * (right.value - value) < 0.0:
                # Start from the end nearer to a fold, from which the value's rate grows.
                located = (arclength.next_crossing(left.place, 1.0, value)
                           if abs(left.place.rate) < abs(right.place.rate) else
                           arclength.next_crossing(right.place, -1.0, value))
                if located is None:
                    raise NoOrbit(f'no orbit was found at {self.along} {value:g}')
                points.append(_point(located).orbit)
        if self.points[-1].value == value:
            points.append(self.points[-1].orbit)
        return tuple(points)


def continue_orbit(orbit: Orbit, along: ParameterLine | str, low: float, high: float, *,
                   first_step: float = arclength.FIRST, longest_step: float = arclength.LONGEST,
                   most: int = 200, both: bool = True, longest: float = 20.0) -> Branch:
    """Follow a gait's orbit along a line of parameters, past folds.

    Args:
        orbit: of a network on the line; its gait's symmetry is kept.
        along: the line, or its text: 'tau', 'alpha=-beta', or a group of the network.
        low: least value, in the parameter's unit.
        high: greatest value, in the parameter's unit.
        first_step: arclength of the first step. States count as they are, the period against
            the first one's, the value against high - low.
        longest_step: arclength of any step.
        most: number of points in each direction, at most.
        both: also in the direction in which the value falls at first; its points come first.
        longest: period at which the branch ends, as a ratio to the first one's.

    Raises:
        InputError: no such parameter, the orbit's network is not on the line or not in the
            range, or the line breaks the gait's symmetry.
        NoOrbit: Newton's method fails at the given orbit.

    """
    along = ParameterLine.of(along, type(orbit.network))
    _check(orbit.network, orbit.symmetry, along, low, high)
    value, scales = along.value(orbit.network), (orbit.period, high - low)
    curve, z = orbit_method(orbit.network).solve.through(orbit, along, scales)
    # At a fold the value cannot be held, but the period can.
    start = (arclength.resolve_point(curve, z, arclength.fixed_unknown(z.size, -1))
             or arclength.resolve_point(curve, z, arclength.fixed_unknown(z.size, -2)))
    if start is None:
        raise NoOrbit(f"Newton's method fails at the orbit given, {along} {value:g}")
    start = start if start.rate >= 0.0 else start.reversed()
    limits = (low, high, longest * orbit.period)
    steps = {'first_step': first_step, 'longest_step': longest_step, 'most': most}
    points, turns, end = _run(start, limits, steps)
    before: list[BranchPoint] = []
    back: list[int] = []
    begin = BranchEnd('start', value, orbit.period)
    if both:
        before, back, begin = _run(start.reversed(), limits, steps)
    here = _point(start)
    n = len(before)
    earlier = [replace(point, place=point.place.reversed()) for point in reversed(before)]
    return Branch(along, (*earlier, here, *points),
                  (*(n - 1 - k for k in reversed(back)), *(n + 1 + k for k in turns)),
                  (begin, end))


def continue_from_hopf(network: Network, symmetry: Symmetry, omega: float,
                       along: ParameterLine, low: float, high: float, *,
                       rest: np.ndarray | None = None, vector: np.ndarray | None = None,
                       amplitude: float = 0.02, first_step: float = arclength.FIRST,
                       longest_step: float = arclength.LONGEST, most: int = 200,
                       longest: float = 20.0) -> Branch:
    """Follow the orbits that bifurcate at a Hopf point, whichever side of it they are on.

    The first orbit has a given amplitude and the value that goes with it, which near the Hopf
    point is better conditioned than the reverse.

    Args:
        network: at the Hopf point.
        symmetry: of the critical class.
        omega: its angular frequency, rad per model time.
        along: the line.
        low: least value.
        high: greatest value.
        rest: equilibrium, shape (components,); by default 0.
        vector: critical eigenvector, complex, shape (components,); by default that of cells with
            one variable, which their phases give.
        amplitude: of the first orbit.
        first_step: arclength of the first step, as in continue_orbit.
        longest_step: arclength of any step.
        most: points, at most.
        longest: period, over that of the Hopf point, at which the branch ends.

    Raises:
        InputError: the network is not on the line or not in the range, the line breaks the
            gait's symmetry, or the eigenvector does not have it.
        NoOrbit: Newton's method finds no orbit of this amplitude.

    """
    _check(network, symmetry, along, low, high)
    value, period = along.value(network), float(2.0 * np.pi / omega)
    rest = np.zeros(network.components) if rest is None else rest
    if vector is None:
        if network.variables > 1:
            raise InputError(f'with {network.variables} variables a cell, a Hopf point needs the '
                             'stand and the eigenvector')
        vector = np.exp(2j * np.pi * symmetry.phases)
    # Cell 1 peaks at phase 0.
    vector = vector / vector[0]
    _check_vector(vector, symmetry, network)
    branch = continue_from_disturbance(
        network, symmetry, along, low, high, lambda theta: np.tile(rest, (theta.size, 1)),
        lambda theta: np.outer(np.exp(2j * np.pi * theta), vector).real, period,
        amplitude=amplitude, first_step=first_step, longest_step=longest_step, most=most,
        longest=longest)
    return replace(branch, ends=(BranchEnd('rest', value, period), branch.ends[1]))


def continue_from_disturbance(network: Network, symmetry: Symmetry, along: ParameterLine,
                              low: float, high: float, path: Callable[[np.ndarray], np.ndarray],
                              disturbance: Callable[[np.ndarray], np.ndarray], period: float, *,
                              amplitude: float = 0.02, first_step: float = arclength.FIRST,
                              longest_step: float = arclength.LONGEST, most: int = 200,
                              longest: float = 20.0) -> Branch:
    """Follow the orbits that leave a state or another orbit, on whichever side of it they are.

    Args:
        network: at the place.
        symmetry: of the orbits that leave.
        along: the line.
        low: least value.
        high: greatest value.
        path: states of what they leave, shape (m, components), over times in cycles.
        disturbance: the direction in which they leave it, the same.
        period: at the place, model time.
        amplitude: share of the disturbance in the first orbit.
        first_step: arclength of the first step, as in continue_orbit.
        longest_step: arclength of any step.
        most: points, at most.
        longest: period, over that at the place, at which the branch ends.

    Raises:
        InputError: the network is not on the line or not in the range, or the line breaks the
            symmetry.
        NoOrbit: Newton's method finds no such orbit.

    """
    _check(network, symmetry, along, low, high)
    value = along.value(network)
    curve, still, border = orbit_method(network).solve.curve_beside(
        network, symmetry, along, (period, high - low), path, disturbance, period)
    start = arclength.resolve_point(curve, still + amplitude * border, border)
    if start is None:
        raise NoOrbit(f'no orbit of amplitude {amplitude:g} was found near {along} {value:g}')
    points, turns, end = _run(start, (low, high, longest * period), {
        'first_step': first_step, 'longest_step': longest_step, 'most': most})
    here = _point(start)
    return Branch(along, (here, *points), tuple(1 + k for k in turns),
                  (BranchEnd('start', value, period), end))


def _check_vector(vector: np.ndarray, symmetry: Symmetry, network: Network) -> None:
    blocks = np.arange(network.variables)[:, None] * network.cells
    for name, shift in symmetry.shifts:
        image = (np.array(symmetry.group.elements[name]) + blocks).ravel()
        turned = vector[image] - vector * np.exp(2j * np.pi * float(shift))
        if not np.abs(turned).max() <= 1e-6 * np.abs(vector).max():
            raise InputError(f'the eigenvector does not have the symmetry: {name} shifts it by '
                             f'something else than {shift}')


def _point(located: CurvePoint) -> BranchPoint:
    return BranchPoint(located.value, located.curve.orbit(located.z), located)


def _course(points: list[BranchPoint]) -> tuple[np.ndarray, np.ndarray]:
    """Values and periods, each of shape (points,)."""
    return (np.array([point.value for point in points]),
            np.array([point.orbit.period for point in points]))


def _run(start: CurvePoint, limits: tuple[float, float, float], steps: dict
         ) -> tuple[list[BranchPoint], list[int], BranchEnd]:
    """Follow in one direction: the points after start, which are folds, and the end."""
    low, high, longest = limits
    points: list[BranchPoint] = []

    def visit(origin: CurvePoint) -> str:
        points.append(_point(origin))
        orbit = points[-1].orbit
        if origin.amplitude < REST:
            return 'rest'
        if orbit.period > longest or grows_alone(*_course(points[-2:]), high - low):
            return 'period'
        return 'symmetry' if extra_symmetry(orbit) else ''

    turns, why = arclength.continue_curve(start, low, high, visit, **steps)
    last = points[-1] if points else _point(start)
    value, period = last.value, last.orbit.period
    if why in ('period', 'steep', 'lost'):
        limit = without_period(*_course(points), high - low)
        why, value = ('period', limit) if limit is not None else (why, value)
    if why == 'rest':
        # Near a Hopf point value and period are linear in the square of the amplitude.
        before = points[-2] if len(points) > 1 else _point(start)
        size = last.place.amplitude**2
        fraction = size / (before.place.amplitude**2 - size)
        value += fraction * (value - before.value)
        period += fraction * (period - before.orbit.period)
    return points, turns, BranchEnd(why, value, period)


def _check(network: Network, symmetry: Symmetry, along: ParameterLine, low: float,
           high: float) -> None:
    value = along.value(network)
    if along.at(network, value) != network:
        raise InputError(f'the network is not on the line {along}')
    if not low <= value <= high:
        raise InputError(f'{along} {value:g} is not from {low:g} to {high:g}')
    broken = along.at(network, high if value != high else low).broken(symmetry)
    if broken:
        raise InputError(f'{along} breaks the symmetry: it needs {broken} to be equal')
