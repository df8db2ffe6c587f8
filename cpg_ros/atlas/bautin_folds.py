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

"""The curve of folds of orbits that is born at a Bautin point.

Where the first Lyapunov coefficient has changed its sign the branch from a Hopf point turns, close
to rest, and both of its parts meet in a fold (Kuznetsov, *Elements of Applied Bifurcation Theory*,
section 8.3). The branch is followed from a Hopf point beside the Bautin point, and the folds from
the first one that it has.
"""

from collections.abc import Iterable, Iterator
from dataclasses import replace

from cpg_ros.atlas.chart import Chart
from cpg_ros.atlas.codimension_two import CodimensionTwo
from cpg_ros.atlas.fold_curves import fold_curve
from cpg_ros.atlas.hopf_condition import condition_of, HopfCondition
from cpg_ros.atlas.hopf_curves import Boundary, crossed
from cpg_ros.dynamics.arclength import CurvePoint
from cpg_ros.dynamics.continuation import continue_from_hopf
from cpg_ros.dynamics.hopf_search import hopf_at
from cpg_ros.errors import CpgError
import numpy as np

#: How far beside the Bautin point a branch is started, in shares of the ranges, the amplitude of
#: its first orbit, its longest step, and points at most.
BESIDE, AMPLITUDE, LONGEST, MOST = (0.03, 0.06, 0.12), 0.01, 0.05, 80
#: A fold this far, in shares, from its Hopf point is another one; the curve's end that is this
#: close to the Bautin point ends there.
NEAR, END = 0.2, 0.02
#: A curve that stays this close to another one, in shares, is that.
SAME = 3e-3


def bautin_folds(job: tuple[Chart, Boundary]) -> list[Boundary]:
    """Follow the fold curves that are born at the Bautin points of a curve of Hopf points.

    Each begins with the Bautin point. Of one that cannot be started there is none, as where the
    branch does not turn within the plane.
    """
    chart, curve = job
    found = []
    for point in curve.codimension_two:
        if point.kind == 'Bautin':
            born = _born(chart, point)
            if born is not None:
                found.append(born)
    return found


def distinct(chart: Chart, curves: Iterable[Boundary]) -> list[Boundary]:
    """Leave out fold curves that run along one before them, which may have been met elsewhere."""
    kept: list[Boundary] = []
    for curve in curves:
        shares = (curve.points[:, :2] - chart.low) / chart.size
        some = shares[[len(shares) * k // 4 for k in (1, 2, 3)]]
        if curve.kind != 'fold' or not any(
                one.kind == 'fold' and one.gaits == curve.gaits
                and all(crossed(one, chart, share - 0.5 * SAME, share + 0.5 * SAME)
                        for share in some) for one in kept):
            kept.append(curve)
    return kept


def _born(chart: Chart, point: CodimensionTwo) -> Boundary | None:
    share = np.append((np.array(point.values) - chart.low) / chart.size, point.omega)
    condition = condition_of(chart, point.gait, share)
    tangent = condition.tangent(share)
    if abs(tangent[0]) < abs(tangent[1]):
        # Branches have to cross the Hopf curve, not to run along it.
        born = _born(replace(chart, first=chart.second, second=chart.first), _turned(point))
        return born and Boundary('fold', born.gaits, born.points[:, ::-1],
                                 tuple(map(_turned, born.codimension_two)))
    for fold, one in _folds(condition, share, tangent):
        whole = fold_curve(chart, point.gait, fold, one)
        points = whole.points
        gaps = [(np.abs(end - point.values) / chart.size).max()
                for end in (points[0], points[-1])]
        if min(gaps) > END:
            continue
        if gaps[1] < gaps[0]:
            points = points[::-1]
        return Boundary('fold', whole.gaits, np.array([point.values, *points]),
                        (point, *whole.codimension_two))
    return None


def _turned(point: CodimensionTwo) -> CodimensionTwo:
    """Return a point of the plane with its axes exchanged."""
    return replace(point, values=point.values[::-1])


def _folds(condition: HopfCondition, share: np.ndarray, tangent: np.ndarray
           ) -> Iterator[tuple[CurvePoint, float]]:
    """Yield the first folds of branches from Hopf points on both sides, and the first value."""
    chart, mode = condition.chart, condition.mode
    line = chart.second.line
    for beside in BESIDE:
        for way in (-1.0, 1.0):
            place = condition.corrected(share + way * beside * tangent, tangent)
            if place is None:
                continue
            one, other = chart.values_at(place[0][:2])
            if not (chart.first.low <= one <= chart.first.high
                    and chart.second.low <= other <= chart.second.high):
                continue
            try:
                hopf = hopf_at(chart.at(one, other), line, mode, float(place[0][2]))
                branch = continue_from_hopf(
                    hopf.network, hopf.block.symmetry, hopf.omega, line, chart.second.low,
                    chart.second.high, rest=hopf.state, vector=hopf.eigenvector,
                    amplitude=AMPLITUDE, longest_step=LONGEST, most=MOST)
            except (CpgError, np.linalg.LinAlgError):
                continue
            for fold in branch.folds[:1]:
                if abs(fold.value - other) < NEAR * chart.size[1]:
                    yield fold.place, one
