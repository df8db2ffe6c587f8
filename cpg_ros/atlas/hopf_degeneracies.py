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

"""Bautin, Hopf-Hopf, zero-Hopf and Bogdanov-Takens points on a curve of Hopf points.

Between two points of the curve at which a test function has different signs its zero is bracketed,
each place corrected onto the curve: the first Lyapunov coefficient of the gait's own class at a
Bautin point, the real part of another root at a Hopf-Hopf or zero-Hopf point (Kuznetsov, *Elements
of Applied Bifurcation Theory*, sections 8.3 to 8.6). A curve also ends inside the plane, where its
pair meets in 0, or where the equilibrium folds; ``hopf_curve_ends`` solves for these.
"""

from collections.abc import Callable, Iterator
from dataclasses import replace
from functools import cache
from itertools import pairwise
import math

from cpg_ros.atlas.chart import Chart
from cpg_ros.atlas.codimension_two import CodimensionTwo
from cpg_ros.atlas.hopf_condition import condition_of, HopfCondition
from cpg_ros.atlas.hopf_curve_ends import curve_ends
from cpg_ros.atlas.hopf_curves import Boundary
from cpg_ros.dynamics.equilibrium import equilibrium
from cpg_ros.dynamics.hopf_point import HopfPoint, ON_AXIS
from cpg_ros.dynamics.hopf_search import SPARE
from cpg_ros.dynamics.isotypic import Block, blocks
from cpg_ros.errors import CpgError
import numpy as np
from scipy.optimize import brentq

#: Share of the way between two points of a curve to which a zero is bracketed.
BRACKET = 1e-14
#: At a pole a test function changes its sign, too; at a zero it is this small against both sides.
VANISHED = 1e-5
#: A Lyapunov coefficient this small against the curve's largest one is 0 but for rounding.
ROUNDING = 1e-9
#: Two points this close in shares of the ranges, with frequencies this close, are one.
SAME = 1e-7
#: A root's imaginary part this small against omega is that of a real one.
REAL = 1e-6

Test = Callable[[np.ndarray], float]


class _Curve:
    """A curve of Hopf points of one class, solved at each place once."""

    def __init__(self, condition: HopfCondition, shares: np.ndarray) -> None:
        self.condition, self.shares = condition, shares
        self.chart = condition.chart
        self._known: dict[bytes, tuple[HopfPoint, tuple[Block, ...]]] = {}

    def at(self, share: np.ndarray) -> tuple[HopfPoint, tuple[Block, ...]]:
        """Return the Hopf point at (p1, p2, omega), and the blocks of all classes."""
        key = share.tobytes()
        if key not in self._known:
            network, line = self.chart.at_share(share[:2]), self.chart.second.line
            rest = equilibrium(network)
            split = blocks(network, rest)
            block = next(block for block in split if block.mode == self.condition.mode)
            self._known[key] = HopfPoint(network, line, line.value(network), block,
                                         float(share[2]), rest), split
        return self._known[key]

    def between(self, one: np.ndarray, other: np.ndarray, way: float) -> np.ndarray:
        """Return the curve's point at a share of the way between two of its points.

        Raises:
            ArithmeticError: Newton's method has lost it.

        """
        tangent = (other - one) / np.linalg.norm(other - one)
        found = self.condition.corrected(one + way * (other - one), tangent)
        if found is None:
            raise ArithmeticError('the curve is lost')
        return found[0]

    def zeros(self, test: Test, small: float) -> Iterator[np.ndarray]:
        """Yield the places at which a test function changes its sign through 0.

        Args:
            test: of a place.
            small: values that are 0 but for rounding: such a point is passed over, so that its
                neighbours bracket what lies there.

        """
        values = [(share, test(share)) for share in self.shares]
        clear = [(share, value) for share, value in values if abs(value) > small]
        for (one, left), (other, right) in pairwise(clear):
            if not left * right < 0.0:
                continue
            try:
                way = brentq(lambda s, one=one, other=other: test(self.between(one, other, s)),
                             0.0, 1.0, xtol=BRACKET, rtol=1e-14)
                place = self.between(one, other, way)
            except (ArithmeticError, ValueError, CpgError):
                continue
            if abs(test(place)) < VANISHED * min(abs(left), abs(right)):
                yield place


def with_degeneracies(job: tuple[Chart, Boundary]) -> Boundary:
    """Return a curve of Hopf points with the points at which a second condition holds."""
    chart, curve = job
    return replace(curve, codimension_two=hopf_degeneracies(chart, curve))


def hopf_degeneracies(chart: Chart, curve: Boundary) -> tuple[CodimensionTwo, ...]:
    """Find the codimension-two points on a curve of Hopf points, in the order of the curve.

    Two zeros of one test function between neighbouring points of the curve are not seen. A
    first Lyapunov coefficient that is 0 all along, as where the rates are linear about the
    equilibrium, has none. What happens where the frequency of a class that turns (walk, jump)
    passes through 0 is not looked at.

    Args:
        chart: the plane.
        curve: of Hopf points, as ``hopf_curves`` returns it.

    """
    shares = np.column_stack([(curve.points[:, :2] - chart.low) / chart.size, curve.points[:, 2]])
    found: list[CodimensionTwo] = []
    for k, gait in enumerate(curve.gaits):
        condition = condition_of(chart, gait, shares[len(shares) // 2])
        whole = _Curve(condition, shares)
        found += _bautin(whole, gait)
        if k == 0:
            # The classes of a curve have the same roots.
            found += _other_roots(whole, gait)
            found += curve_ends(chart, gait, condition.mode, shares)
    return tuple(sorted(found, key=lambda one: _along(chart, shares, one.values)))


def _along(chart: Chart, shares: np.ndarray, values: tuple[float, float]) -> int:
    share = (np.array(values) - chart.low) / chart.size
    return int(np.abs(shares[:, :2] - share).max(axis=1).argmin())


def _bautin(curve: _Curve, gait: str) -> Iterator[CodimensionTwo]:
    @cache
    def known(key: bytes) -> float:
        try:
            return curve.at(np.frombuffer(key))[0].lyapunov
        except (np.linalg.LinAlgError, CpgError):
            return math.nan  # At a pole; it is passed over.

    def test(share: np.ndarray) -> float:
        return known(share.tobytes())

    small = ROUNDING * float(np.nanmax([0.0, *(abs(test(share)) for share in curve.shares)]))
    for place in curve.zeros(test, small):
        yield CodimensionTwo('Bautin', gait, curve.chart.values_at(place[:2]), test(place),
                             float(place[2]))


def _other_roots(curve: _Curve, gait: str) -> list[CodimensionTwo]:
    """Return where other roots of any class cross: pairs, or a real one."""
    found: list[CodimensionTwo] = []
    small = ON_AXIS * max(1.0, float(curve.shares[:, 2].max()))
    points = [curve.at(share) for share in curve.shares]
    for which in range(len(points[0][1])):
        count = _followed([split[which] for _, split in points])

        def others(share: np.ndarray, which: int = which, count: int = count) -> np.ndarray:
            point, split = curve.at(share)
            return point.but_critical(split[which], split[which].roots(count))

        for rank in range(min(len(others(share)) for share in curve.shares)):
            def test(share: np.ndarray, rank: int = rank, others: Callable = others) -> float:
                return float(others(share)[rank].real)

            for place in curve.zeros(test, small):
                block, root = curve.at(place)[1][which], complex(others(place)[rank])
                # Of a pair in two conjugate classes that with positive imaginary part counts.
                if root.imag > -REAL * place[2] or block.real:
                    _enter(found, _crossing(curve, gait, place, block, root), curve.chart)
    return found


def _followed(along: list[Block]) -> int:
    """How many roots of a class can cross on the curve, the critical ones among them."""
    if not any(one.past.any() for one in along):
        return along[0].network.variables
    return SPARE + 2 + max(len(one.right_of(0.0)) for one in along)


def _crossing(curve: _Curve, gait: str, place: np.ndarray, block: Block, root: complex
              ) -> CodimensionTwo:
    kind, omega = 'Hopf-Hopf', abs(root.imag)
    if omega < REAL * place[2]:
        kind, omega = 'zero-Hopf', 0.0
    return CodimensionTwo(kind, gait, curve.chart.values_at(place[:2]), root.real,
                          float(place[2]), (block.gait,), omega)


def _enter(found: list[CodimensionTwo], new: CodimensionTwo, chart: Chart) -> None:
    """Enter a point, unless it is known: then only what it adds to that one's classes."""
    for k, one in enumerate(found):
        gap = np.abs(np.subtract(one.values, new.values) / chart.size).max()
        if (one.kind == new.kind and gap < SAME
                and np.isclose(one.other_omega, new.other_omega, rtol=SAME, atol=SAME)):
            found[k] = replace(one, other=tuple(dict.fromkeys((*one.other, *new.other))))
            return
    found.append(new)
