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

"""Branches of periodic orbits along a line of parameters, past folds.

A branch shows over which range of parameters a gait exists, where two orbits coexist, and how it
ends: at a Hopf point, at an orbit of more symmetry, near a homoclinic orbit, where the period has
no bound, or at the ends of the range.

Where a multiplier crosses the unit circle at 1 another branch begins (or this one folds), at -1 a
branch of twice the period, and where a pair crosses a torus (Kuznetsov, *Elements of Applied
Bifurcation Theory*, chapter 5). Symmetry keeps subspaces apart, so crossings are counted in each.
"""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import TypedDict, Unpack

from cpg_ros.common.errors import InputError, ShortRepr
from cpg_ros.dynamics import arclength
from cpg_ros.dynamics.arclength import CurvePoint, NoOrbit
from cpg_ros.dynamics.floquet import Multipliers, multipliers
from cpg_ros.dynamics.hopf import HopfPoint
from cpg_ros.dynamics.orbit import extra_symmetry, Orbit
from cpg_ros.dynamics.orbit_method import orbit_method
from cpg_ros.networks.network import Network, ParameterLine
from cpg_ros.networks.symmetry import Symmetry
import numpy as np

# The ends of branches, extrapolated beyond the last orbit.

#: A branch ends near a homoclinic orbit if its period has grown by this factor while the value
#: changes by less than this fraction of its scale per period.
MIN_PERIOD_RATIO, VALUE_TOLERANCE = 3.0, 1e-2
#: The period grows alone in a step in which it grows by this fraction while the value changes by
#: less than ROUNDING of its scale.
MIN_PERIOD_GROWTH, ROUNDING = 0.01, 1e-9
#: Near a saddle-node the slope of the value falls as the period to the power -3; a fall from this
#: power on is taken for an exponential one.
MAX_SNIC_POWER = 4.0


@dataclass(frozen=True)
class BranchEnd:
    """The end of a branch and its reason.

    Attributes:
        why: 'rest' (the amplitude falls to zero: a Hopf point), 'symmetry' (an orbit with more
            symmetry, where the branch meets its own mirror image), 'period' (it grows without
            bound: near a homoclinic orbit), 'bound' (an end of the range), 'steps', 'steep' (the
            waveform cannot be resolved), 'lost' (Newton's method fails with the shortest step),
            'start' (the branch was not followed in this direction).
        value: of the parameter; extrapolated for 'rest' and 'period'.
        period: at the Hopf point; otherwise that of the last orbit.

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
    """Whether between two points the period grows and the value no longer changes."""
    return bool(len(values) > 1 and abs(np.diff(periods)) > MIN_PERIOD_GROWTH * periods[0]
                and abs(np.diff(values)) < ROUNDING * scale)


def without_period(values: np.ndarray, periods: np.ndarray, scale: float) -> float | None:
    """Return the value towards which a branch's period grows without bound; None if not so.

    Args:
        values: of the parameter at the last points, shape (points,).
        periods: of the orbits there, shape (points,).
        scale: of the values.

    """
    if periods.size < 4 or not periods[-1] > MIN_PERIOD_RATIO * periods.min():
        return None
    slopes, middle = _slopes(values, periods)
    if not abs(slopes[-1]) * periods[-1] < VALUE_TOLERANCE * scale:
        return None
    if _winds(slopes):
        # In ever smaller windings: the last value is the best estimate.
        return float(values[-1])
    fall = np.log(slopes[0] / slopes[2])
    power = fall / np.log(middle[2] / middle[0])
    if power <= 1.5:
        return None
    if power < MAX_SNIC_POWER:
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
    return None if power <= 1.5 else 'SNIC' if power < MAX_SNIC_POWER else 'homoclinic'


def _slopes(values: np.ndarray, periods: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the value's slopes by the period between the last four points, and periods there."""
    return (np.diff(values[-4:]) / np.diff(periods[-4:]), 0.5 * (periods[-4:-1] + periods[-3:]))


def _winds(slopes: np.ndarray) -> bool:
    """Return whether the value spirals in, or no longer changes."""
    return bool(not slopes.all() or (np.sign(slopes) != np.sign(slopes[-1])).any())


#: Amplitude, over the curve's sizes, below which an orbit counts as its Hopf point; points of a
#: cycle over which these are taken.
MIN_AMPLITUDE, POINTS = 1e-3, 256


@dataclass(frozen=True, eq=False, repr=False)
class BranchPoint(ShortRepr):
    """A point of a branch.

    Attributes:
        value: of the parameter.
        orbit: of the network there. At a fold its derivatives by parameters have no bound.
        curve_point: the same as a point of the continuation, with the tangent along the branch.

    """

    value: float
    orbit: Orbit
    curve_point: CurvePoint

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
        points: in their order on the branch.
        fold_indices: of the folds.
        ends: before the first point and after the last.

    """

    along: ParameterLine
    points: tuple[BranchPoint, ...]
    fold_indices: tuple[int, ...]
    ends: tuple[BranchEnd, BranchEnd]

    def _summary(self) -> str:
        orbit, values = self.points[0].orbit, self.values
        return (f'{orbit.gait} of {orbit.network.name} along {self.along} '
                f'{values.min():.6g} to {values.max():.6g}: {len(self.points)} points, '
                f'folds: {len(self.fold_indices)}, ends: {self.ends[0]}; {self.ends[1]}')

    @property
    def folds(self) -> tuple[BranchPoint, ...]:
        """Folds of the branch, with two orbits on one side and none on the other."""
        return tuple(self.points[k] for k in self.fold_indices)

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

    @property
    def table(self) -> dict[str, np.ndarray]:
        """Columns with a row for each point, for numpy.savez or a data frame.

        Value of the parameter, period in model time, amplitude, and whether it is a fold.
        """
        return {'value': self.values, 'period': self.periods, 'amplitude': self.amplitudes,
                'fold': np.isin(np.arange(len(self.points)), self.fold_indices)}

    def at(self, value: float) -> tuple[Orbit, ...]:
        """All orbits of the branch at a value, in its order; at a fold one or two.

        Raises:
            NoOrbit: Newton's method fails between two points.

        """
        points = []
        for left, right in zip(self.points, self.points[1:], strict=False):
            if left.value == value:
                points.append(left.orbit)
            elif (left.value - value) * (right.value - value) < 0.0:
                # From the end that is nearer to a fold.
                located = (arclength.next_crossing(left.curve_point, 1.0, value)
                           if abs(left.curve_point.rate) < abs(right.curve_point.rate) else
                           arclength.next_crossing(right.curve_point, -1.0, value))
                if located is None:
                    raise NoOrbit(f'no orbit was found at {self.along} {value:g}')
                points.append(_point(located).orbit)
        if self.points[-1].value == value:
            points.append(self.points[-1].orbit)
        return tuple(points)


class StepLimits(TypedDict, total=False):
    """Limits of a continuation.

    Attributes:
        first_step: arclength of the first step. States count against half the range of the first
            orbit, the period against the first one's, the value against high - low.
        longest_step: arclength of any step.
        most: points in each direction.
        longest: period at which the branch ends, over the first one's; by default 20.

    """

    first_step: float
    longest_step: float
    most: int
    longest: float


def continue_orbit(orbit: Orbit, along: ParameterLine | str, low: float, high: float, *,
                   both: bool = True, **limits: Unpack[StepLimits]) -> Branch:
    """Follow a gait's orbit along a line of parameters, past folds.

    Args:
        orbit: of a network on the line; the symmetry of its gait is kept.
        along: the line, or its text: 'tau', 'alpha=-beta', or a group of the network.
        low: least value, in the parameter's unit.
        high: greatest value, in the parameter's unit.
        both: also in the direction in which the value falls at first; its points come first.
        **limits: first_step, longest_step, most and longest; see StepLimits.

    Raises:
        InputError: no such parameter, the orbit's network is not on the line or not in the
            range, or the line breaks the gait's symmetry.
        NoOrbit: Newton's method fails at the given orbit.

    """
    along = ParameterLine.of(along, type(orbit.network))
    _check(orbit.network, orbit.symmetry, along, low, high)
    value, scales = along.value(orbit.network), (orbit.period, high - low)
    curve, z = orbit_method(orbit.network).solve.through(orbit, along, scales, _sizes(
        np.abs(orbit.levels[..., 1]).max(axis=0)))
    # At a fold the value cannot be held, but the period can.
    start = (arclength.resolve_point(curve, z, arclength.fixed_unknown(z.size, -1))
             or arclength.resolve_point(curve, z, arclength.fixed_unknown(z.size, -2)))
    if start is None:
        raise NoOrbit(f"Newton's method fails at the orbit given, {along} {value:g}")
    start = start if start.rate >= 0.0 else start.reversed()
    points, folds, end = _run(start, low, high, orbit.period, limits)
    before: list[BranchPoint] = []
    back: list[int] = []
    begin = BranchEnd('start', value, orbit.period)
    if both:
        before, back, begin = _run(start.reversed(), low, high, orbit.period, limits)
    n = len(before)
    earlier = [replace(point, curve_point=point.curve_point.reversed())
               for point in reversed(before)]
    return Branch(along, (*earlier, _point(start), *points),
                  (*(n - 1 - k for k in reversed(back)), *(n + 1 + k for k in folds)),
                  (begin, end))


def continue_from_hopf(point: HopfPoint, along: ParameterLine, low: float, high: float, *,
                       amplitude: float = 0.02, **limits: Unpack[StepLimits]) -> Branch:
    """Follow the orbits that bifurcate at a Hopf point, whichever side of it they are on.

    The first orbit has a given amplitude and the value that goes with it, which near the Hopf
    point is better conditioned than the reverse.

    Args:
        point: the Hopf point.
        along: the line.
        low: least value.
        high: greatest value.
        amplitude: of the first orbit, over the point's natural one.
        **limits: as in continue_orbit.

    Raises:
        InputError: the network is not on the line or not in the range, or the line breaks the
            gait's symmetry.
        NoOrbit: Newton's method finds no orbit of this amplitude.

    """
    # Cell 1 peaks at phase 0.
    vector, period = point.eigenvector / point.eigenvector[0], float(2.0 * np.pi / point.omega)
    vector = point.natural_amplitude * vector
    sizes = _sizes(np.abs(vector).reshape(-1, point.network.cells).max(axis=1))
    branch = continue_from_disturbance(
        point.network, point.symmetry, along, low, high,
        lambda theta: np.tile(point.state, (theta.size, 1)),
        lambda theta: np.outer(np.exp(2j * np.pi * theta), vector).real, period,
        amplitude=amplitude, sizes=sizes, **limits)
    begin = BranchEnd('rest', along.value(point.network), period)
    return replace(branch, ends=(begin, branch.ends[1]))


def continue_from_disturbance(network: Network, symmetry: Symmetry, along: ParameterLine,
                              low: float, high: float, path: Callable[[np.ndarray], np.ndarray],
                              disturbance: Callable[[np.ndarray], np.ndarray], period: float, *,
                              amplitude: float = 0.02, sizes: np.ndarray | None = None,
                              **limits: Unpack[StepLimits]) -> Branch:
    """Follow the orbits that branch off a state or another orbit, on whichever side they are.

    Args:
        network: at the bifurcation.
        symmetry: of the new orbits.
        along: the line.
        low: least value.
        high: greatest value.
        path: states of the old solution, shape (m, components), over times in cycles.
        disturbance: critical disturbance of it, the same.
        period: at the bifurcation, model time.
        amplitude: factor of the disturbance in the first orbit.
        sizes: of the variables, against which states count; by default half the old solution's
            ranges.
        **limits: as in continue_orbit.

    Raises:
        InputError: the network is not on the line or not in the range, or the line breaks the
            symmetry.
        NoOrbit: Newton's method finds no such orbit.

    """
    _check(network, symmetry, along, low, high)
    value = along.value(network)
    if sizes is None:
        ranges = np.ptp(path(np.linspace(0.0, 1.0, POINTS, endpoint=False)), axis=0)
        sizes = _sizes(0.5 * ranges.reshape(-1, network.cells).max(axis=1))
    curve, still, border = orbit_method(network).solve.curve_beside(
        network, symmetry, along, (period, high - low), sizes, path, disturbance, period)
    start = arclength.resolve_point(curve, still + amplitude * border, border)
    if start is None:
        raise NoOrbit(f'no orbit of amplitude {amplitude:g} was found near {along} {value:g}')
    points, folds, end = _run(start, low, high, period, limits)
    return Branch(along, (_point(start), *points), tuple(1 + k for k in folds),
                  (BranchEnd('start', value, period), end))


def _sizes(ranges: np.ndarray) -> np.ndarray:
    """Return the sizes of variables, the largest one for those that do not move."""
    largest = ranges.max() or 1.0
    return np.where(ranges > ROUNDING * largest, ranges, largest)


def _point(located: CurvePoint) -> BranchPoint:
    return BranchPoint(located.value, located.curve.orbit(located.z), located)


def _values_and_periods(points: list[BranchPoint]) -> tuple[np.ndarray, np.ndarray]:
    """Values and periods, each of shape (points,)."""
    return (np.array([point.value for point in points]),
            np.array([point.orbit.period for point in points]))


def _run(start: CurvePoint, low: float, high: float, period: float, limits: StepLimits
         ) -> tuple[list[BranchPoint], list[int], BranchEnd]:
    """Follow in one direction: the points after start, the indices of folds, and the end."""
    steps: dict = {**limits}
    longest = steps.pop('longest', 20.0) * period
    points: list[BranchPoint] = []

    def visit(located: CurvePoint) -> str:
        points.append(_point(located))
        orbit = points[-1].orbit
        if located.amplitude < MIN_AMPLITUDE:
            return 'rest'
        if orbit.period > longest or grows_alone(*_values_and_periods(points[-2:]), high - low):
            return 'period'
        return 'symmetry' if extra_symmetry(orbit) else ''

    folds, why = arclength.continue_curve(start, low, high, visit, **steps)
    last = points[-1] if points else _point(start)
    value, period = last.value, last.orbit.period
    if why in ('period', 'steep', 'lost'):
        limit = without_period(*_values_and_periods(points), high - low)
        why, value = ('period', limit) if limit is not None else (why, value)
    if why == 'rest':
        # Near a Hopf point value and period are linear in the square of the amplitude.
        before = points[-2] if len(points) > 1 else _point(start)
        size = last.curve_point.amplitude**2
        fraction = size / (before.curve_point.amplitude**2 - size)
        value += fraction * (value - before.value)
        period += fraction * (period - before.orbit.period)
    return points, folds, BranchEnd(why, value, period)


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


#: Tolerance of a crossing, as a fraction of the way between two points of a branch.
CROSSING_TOLERANCE = 1e-7
#: A multiplier whose logarithm stays below this is neutral and does not cross.
NEUTRAL_TOLERANCE = 1e-6
#: Imaginary part up to which a multiplier is real.
IMAGINARY_TOLERANCE = 1e-3


@dataclass(frozen=True, eq=False, repr=False)
class Bifurcation(ShortRepr):
    """A point of a branch where a multiplier crosses the unit circle.

    Attributes:
        kind: 'torus', 'period doubling' or 'branch point'.
        point: of the branch.
        multiplier: that crosses; of a pair, the one with positive imaginary part.
        part: index of its subspace: 0 for the gait's class, then the transverse ones.

    """

    kind: str
    point: BranchPoint
    multiplier: complex
    part: int

    @property
    def value(self) -> float:
        """Value on the line."""
        return self.point.value


def bifurcations(branch: Branch, spectra: Sequence[Multipliers] | None = None,
                 exact: float = CROSSING_TOLERANCE) -> tuple[Bifurcation, ...]:
    """Locate all crossings of the unit circle between the points of a branch, in its order.

    Two opposite crossings in the same subspace between the same points are not found.

    Args:
        branch: of orbits.
        spectra: multipliers of its points; by default they are computed.
        exact: tolerance, in ratio to the distance between two points.

    """
    subspaces = [spectrum.subspaces for spectrum in spectra or map(
        multipliers, (point.orbit for point in branch.points))]
    crossings: list[Bifurcation] = []
    for k, part, rank in _crossings(branch, subspaces):
        ends = branch.points[k:k + 2]
        width = abs(ends[1].value - ends[0].value)
        try:
            crossing = _located(ends, subspaces[k:k + 2], part, rank, exact)
        except NoOrbit:
            # Newton's method may fail where two curves cross.
            continue
        # Both of a pair cross, and symmetry may make multipliers of several subspaces equal.
        if crossing is not None and not any(
                crossing.kind == other.kind
                and np.isclose(crossing.value, other.value, 1e-7, exact * width)
                and np.isclose(crossing.point.orbit.period, other.point.orbit.period,
                               max(1e-5, exact))
                for other in crossings):
            crossings.append(crossing)
    return tuple(crossings)


def _crossings(branch: Branch, spectra: list[list[np.ndarray]]) -> Iterator[tuple[int, int, int]]:
    """Yield the index of the point before, of the subspace, and of the multiplier by its size."""
    for k, (left, right) in enumerate(pairwise(spectra)):
        for part, (old, new) in enumerate(zip(left, right, strict=True)):
            before, after = (int((np.abs(spectrum) > 1.0).sum()) for spectrum in (old, new))
            folds = {k, k + 1} & set(branch.fold_indices)
            for rank in range(min(before, after), max(before, after)):
                pair = old[rank], new[rank]
                # At a fold one multiplier of the class is 1, to rounding.
                if part == 0 and folds and any(abs(mu - 1.0) < 1e-3 for mu in pair):
                    continue
                if max(abs(np.log(np.abs(mu))) for mu in pair) > NEUTRAL_TOLERANCE:
                    yield k, part, rank


def _between(left: CurvePoint, right: CurvePoint, fraction: float) -> CurvePoint | None:
    """Return the point a fraction of the way in the value or, if that stays, in the period.

    Raises:
        NoOrbit: it cannot be resolved.

    """
    gaps = [(right.z[which] - left.z[which]) / scale
            for which, scale in ((-1, 1.0), (-2, left.z[-2]))]
    which = -1 if abs(gaps[0]) >= 1e-3 * abs(gaps[1]) else -2
    target = left.z[which] + fraction * (right.z[which] - left.z[which])
    near = left if fraction < 0.5 else right
    z = near.z + (target - near.z[which]) / near.tangent[which] * near.tangent
    z[which] = target
    return arclength.resolve_point(near.curve, z, arclength.fixed_unknown(z.size, which),
                                   exact=False)


def _located(ends: Sequence[BranchPoint], spectra: Sequence[list[np.ndarray]], part: int,
             rank: int, exact: float) -> Bifurcation | None:
    """Return the crossing of a multiplier between two points of a branch; None if there is none.

    Raises:
        NoOrbit: a point between them cannot be resolved.

    """
    spectrum_at = dict(zip((0.0, 1.0), zip(ends, spectra, strict=True), strict=True))

    def point_at(fraction: float) -> tuple[BranchPoint, list[np.ndarray]]:
        if fraction in spectrum_at:
            return spectrum_at[fraction]
        located = _between(ends[0].curve_point, ends[1].curve_point, fraction)
        if located is None:
            raise NoOrbit('no orbit between two points of a branch')
        point = BranchPoint(located.value, located.curve.orbit(located.z), located)
        return point, multipliers(point.orbit).subspaces

    def growth(point: tuple[BranchPoint, list[np.ndarray]]) -> float:
        """Logarithm of the multiplier's modulus."""
        return float(np.log(np.abs(point[1][part][rank])))

    if growth(point_at(0.0)) * growth(point_at(1.0)) >= 0.0:
        return None
    point, spectrum = arclength.locate(growth, point_at, 0.0, 1.0, exact)
    mu = complex(spectrum[part][rank])
    kind = kind_of(mu)
    return Bifurcation(kind, point, complex(mu.real, abs(mu.imag)) if kind == 'torus' else mu,
                       part)


def kind_of(multiplier: complex) -> str:
    """Return the kind of bifurcation at which a multiplier crosses the unit circle."""
    return ('torus' if abs(multiplier.imag) > IMAGINARY_TOLERANCE else
            'period doubling' if multiplier.real < 0.0 else 'branch point')
