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

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from itertools import chain

from cpg_ros.atlas.chart import Chart
from cpg_ros.atlas.codimension_two import CodimensionTwo
from cpg_ros.atlas.hopf_condition import HopfCondition
from cpg_ros.atlas.hopf_starts import hopf_starts, HopfStart, lines_across
from cpg_ros.atlas.stability_losses import LossOnCurve
from cpg_ros.short_repr import ShortRepr
import numpy as np

#: Steps in shares of the ranges, and points of a curve at most.
FIRST, LONGEST, SHORTEST, MOST = 0.01, 0.04, 1e-5, 400
#: A beginning this close to a curve, in shares of the ranges, lies on it. Two classes share a
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
        losses: whether the gait is lost softly or hard at places on it where a multiplier of
            stable orbits crosses the unit circle, other than by a fold.

    """

    kind: str
    gaits: tuple[str, ...]
    points: np.ndarray
    codimension_two: tuple[CodimensionTwo, ...] = ()
    losses: tuple[LossOnCurve, ...] = ()

    def __str__(self) -> str:
        met = [name for name, soft in (('soft', True), ('hard', False))
               if any(loss.soft is soft for loss in self.losses)]
        return (f'{self.kind} of {" and ".join(self.gaits)}'
                + (f' ({" and ".join(met)})' if met else ''))


def _inside(share: np.ndarray) -> bool:
    return bool((share[:2] >= -1e-12).all() and (share[:2] <= 1.0 + 1e-12).all()
                and share[2] > 1e-4)


def _followed(condition: HopfCondition, start: np.ndarray, way: float) -> list[np.ndarray]:
    here, step = start, FIRST
    tangent = way * condition.tangent(start)
    found: list[np.ndarray] = []
    while len(found) < MOST and step >= SHORTEST:
        ahead = condition.corrected(here + step * tangent, tangent)
        new = tangent if ahead is None else condition.tangent(ahead[0])
        if ahead is None or abs(new @ tangent) < 0.95 or not _inside(ahead[0]):
            # Beyond the edge, too: up to it by ever shorter steps.
            step *= 0.5
            continue
        here, tangent = ahead[0], new * np.sign(new @ tangent)
        found.append(here)
        if len(found) > 5 and np.linalg.norm(here - start) < 0.5 * step:
            break
        if ahead[1] <= 4:
            step = min(1.5 * step, LONGEST)
    return found


@dataclass(eq=False)
class _Followed:
    gaits: list[str]
    modes: set[tuple[int, ...]]
    shares: np.ndarray

    def holds(self, chart: Chart, start: HopfStart) -> bool:
        """Whether a point lies on the curve, as one of a class that has all of the curve."""
        if not _on(self.shares, start.share):
            return False
        if start.mode not in self.modes:
            condition = HopfCondition(chart, start.mode)
            for share in self.shares[::max(1, len(self.shares) // CHECKED)]:
                exact = condition.corrected(share, condition.tangent(share))
                if exact is None or np.abs(exact[0] - share).max() > SHARED:
                    return False
            self.modes.add(start.mode)
        if start.gait not in self.gaits:
            self.gaits.append(start.gait)
        return True


def curves_from(chart: Chart, starts: Iterable[HopfStart]) -> list[Boundary]:
    """Follow the curves of Hopf points through some; each is listed once, with all its gaits."""
    curves: list[_Followed] = []
    for start in starts:
        if any(curve.holds(chart, start) for curve in curves):
            continue
        condition = HopfCondition(chart, start.mode)
        exact = condition.corrected(start.share, condition.tangent(start.share))
        if exact is None:
            continue
        back, ahead = (_followed(condition, exact[0], way) for way in (-1.0, 1.0))
        curves.append(_Followed([start.gait], {start.mode},
                                np.array([*back[::-1], exact[0], *ahead])))
    low, size = np.append(chart.low, 0.0), np.append(chart.size, 1.0)
    return [Boundary('Hopf', tuple(curve.gaits), low + curve.shares * size) for curve in curves]


def hopf_curves(chart: Chart, gaits: tuple[str, ...],
                run: Callable[..., Iterable[list[HopfStart]]] = map) -> list[Boundary]:
    """Follow all curves of Hopf points of some gaits that a few lines across the plane meet.

    Args:
        chart: the plane.
        gaits: of its network.
        run: applies a function to jobs, as ``map`` does, or ``Fleet.map``.

    """
    return curves_from(chart, chain(*run(hopf_starts, [*lines_across(chart, gaits)])))


def crossed(curve: Boundary, chart: Chart, here: np.ndarray, there: np.ndarray) -> bool:
    """Whether a curve crosses between two neighbours, given in shares, or close to them."""
    points = (curve.points[:, :2] - chart.low) / chart.size
    middle, reach = 0.5 * (here + there), np.abs(here - there).max()
    one, ahead = points[:-1], np.diff(points, axis=0)
    if not len(ahead):
        return bool(np.abs(points - middle).max() < reach)
    share = np.clip(((middle - one) * ahead).sum(axis=1) / np.maximum(
        (ahead**2).sum(axis=1), 1e-30), 0.0, 1.0)
    return bool((np.abs(one + share[:, None] * ahead - middle).max(axis=1) < reach).any())


def _on(curve: np.ndarray, start: np.ndarray) -> bool:
    """Whether a point lies on a curve, between its points."""
    if len(curve) < 2:
        return bool(np.abs(curve - start).max() < SAME)
    one, other = curve[:-1], curve[1:]
    ahead = other - one
    share = np.clip(((start - one) * ahead).sum(axis=1) / np.maximum(
        (ahead**2).sum(axis=1), 1e-30), 0.0, 1.0)
    gap = np.abs(one + share[:, None] * ahead - start)
    gap[:, 2] /= max(1.0, abs(start[2]))
    return bool((gap.max(axis=1) < SAME).any())
