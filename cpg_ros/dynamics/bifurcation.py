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

"""Bifurcations of the orbits on a branch, other than folds.

Where a multiplier crosses the unit circle at 1 another branch begins (or this one folds), at -1 a
branch of twice the period, and where a pair crosses a torus (Kuznetsov, *Elements of Applied
Bifurcation Theory*, chapter 5). Symmetry keeps subspaces apart, so crossings are counted in each
subspace: simultaneous crossings in two of them are not mistaken for a pair.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import pairwise

from cpg_ros.common.errors import ShortRepr
from cpg_ros.dynamics import arclength
from cpg_ros.dynamics.arclength import CurvePoint, NoOrbit
from cpg_ros.dynamics.continuation import Branch, BranchPoint
from cpg_ros.dynamics.floquet import Multipliers, multipliers
import numpy as np

#: Tolerance of a crossing, as a fraction of the way between two points of a branch.
EXACT = 1e-7
#: A multiplier whose logarithm stays below this is neutral and does not cross.
NEUTRAL = 1e-6
#: REAL: imaginary part up to which a multiplier is real.
REAL = 1e-3


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
                 exact: float = EXACT) -> tuple[Bifurcation, ...]:
    """Locate all crossings of the unit circle between the points of a branch, in its order.

    Two opposite crossings in the same subspace between the same points are not found.

    Args:
        branch: of orbits.
        spectra: multipliers of its points; by default they are computed.
        exact: tolerance, as a fraction of the way between two points.

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
                and np.isclose(crossing.value, other.value, 1e-7, max(1e-9, exact * width))
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
            folds = {k, k + 1} & set(branch.turns)
            for rank in range(min(before, after), max(before, after)):
                pair = old[rank], new[rank]
                # At a fold one multiplier of the class is 1, to rounding.
                if part == 0 and folds and any(abs(mu - 1.0) < 1e-3 for mu in pair):
                    continue
                if max(abs(np.log(np.abs(mu))) for mu in pair) > NEUTRAL:
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
    known = dict(zip((0.0, 1.0), zip(ends, spectra, strict=True), strict=True))

    def point_at(fraction: float) -> tuple[BranchPoint, list[np.ndarray]]:
        if fraction in known:
            return known[fraction]
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
    return ('torus' if abs(multiplier.imag) > REAL else
            'period doubling' if multiplier.real < 0.0 else 'branch point')
