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

A multiplier that crosses the unit circle at 1 lets another branch leave (or this one fold), one
at -1 a branch of twice the period, and a pair a torus (Kuznetsov, *Elements of Applied Bifurcation
Theory*, chapter 5). Symmetry keeps subspaces apart, so crossings are counted in each by itself:
what happens in two of them at one place is not mistaken for a pair.
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
import scipy

#: EXACT: tolerance of a crossing, as a share of the way between two points of a branch.
EXACT = 1e-7
#: NEUTRAL: logarithm of a multiplier's modulus up to which it is neutral and does not cross.
NEUTRAL = 1e-6
#: REAL: imaginary part up to which a multiplier is real.
REAL = 1e-3


@dataclass(frozen=True, eq=False, repr=False)
class Bifurcation(ShortRepr):
    """A point of a branch where a multiplier crosses the unit circle.

    Attributes:
        kind: 'torus', 'period doubling' or 'branch point'.
        point: of the branch.
        multiplier: that crosses; of a pair the one with positive imaginary part.
        part: number of the subspace it belongs to: 0 the gait's class, then those transverse.

    """

    kind: str
    point: BranchPoint
    multiplier: complex
    part: int

    @property
    def value(self) -> float:
        """Value on the line."""
        return self.point.value


def bifurcations(branch: Branch, judged: Sequence[Multipliers] | None = None,
                 exact: float = EXACT) -> tuple[Bifurcation, ...]:
    """Locate all crossings of the unit circle between the points of a branch, in its order.

    Two that lie between the same points in one subspace and take each other back are not seen.

    Args:
        branch: of orbits.
        judged: multipliers of its points, where they are known already.
        exact: fraction of the way between two points to which a crossing is located.

    """
    spectra = [spectrum.subspaces for spectrum in judged or map(
        multipliers, (point.orbit for point in branch.points))]
    crossings: list[Bifurcation] = []
    gaps: dict[int, _Gap] = {}
    for k, part, rank in _crossings(branch, spectra):
        gap = gaps.setdefault(k, _Gap(branch.points[k:k + 2], spectra[k:k + 2]))
        try:
            crossing = _located(gap, part, rank, exact)
        except NoOrbit:
            # Two curves that cross are hard to tell apart right there.
            continue
        # Both of a pair cross, and what symmetry makes alike crosses in several subspaces.
        if crossing is not None and not any(
                crossing.kind == other.kind
                and np.isclose(crossing.value, other.value, 1e-7, max(1e-9, exact * gap.width))
                and np.isclose(crossing.point.orbit.period, other.point.orbit.period,
                               max(1e-5, exact))
                for other in crossings):
            crossings.append(crossing)
    return tuple(crossings)


def _crossings(branch: Branch, spectra: list[list[np.ndarray]]
               ) -> Iterator[tuple[int, int, int]]:
    """Yield the number of the point before, of the subspace, and how many there are larger."""
    for k, (left, right) in enumerate(pairwise(spectra)):
        for part, (old, new) in enumerate(zip(left, right, strict=True)):
            before, after = (int((np.abs(some) > 1.0).sum()) for some in (old, new))
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


class _Gap:
    """The curve between two neighbouring points of a branch, solved once at each place."""

    def __init__(self, ends: Sequence[BranchPoint], spectra: Sequence[list[np.ndarray]]) -> None:
        self._left, self._right = (end.place for end in ends)
        self._known = dict(zip((0.0, 1.0), zip(ends, spectra, strict=True), strict=True))
        self.width = abs(ends[1].value - ends[0].value)

    def at(self, fraction: float) -> tuple[BranchPoint, list[np.ndarray]]:
        """Return the point at a fraction of the way, with the multipliers of each subspace.

        Raises:
            NoOrbit: it cannot be resolved.

        """
        if fraction not in self._known:
            located = _between(self._left, self._right, fraction)
            if located is None:
                raise NoOrbit('no orbit between two points of a branch')
            point = BranchPoint(located.value, located.curve.orbit(located.z), located)
            self._known[fraction] = point, multipliers(point.orbit).subspaces
        return self._known[fraction]


def _located(gap: _Gap, part: int, rank: int, exact: float) -> Bifurcation | None:
    """Return the crossing between two points of a multiplier with so many that are larger."""
    def size(fraction: float) -> float:
        """Logarithm of the multiplier's modulus."""
        return float(np.log(np.abs(gap.at(fraction)[1][part][rank])))

    if size(0.0) * size(1.0) >= 0.0:
        return None
    point, spectrum = gap.at(float(scipy.optimize.brentq(size, 0.0, 1.0, xtol=exact)))
    mu = complex(spectrum[part][rank])
    if abs(mu.imag) > REAL:
        kind, mu = 'torus', complex(mu.real, abs(mu.imag))
    else:
        kind = 'period doubling' if mu.real < 0.0 else 'branch point'
    return Bifurcation(kind, point, mu, part)
