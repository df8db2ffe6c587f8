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

from dataclasses import dataclass

from cpg_ros.atlas.chart import Chart
from cpg_ros.dynamics.characteristic import characteristic_matrix
from cpg_ros.dynamics.equilibrium import equilibrium
from cpg_ros.dynamics.hopf_search import hopf_points
from cpg_ros.dynamics.isotypic import blocks
from cpg_ros.errors import CpgError
from cpg_ros.short_repr import ShortRepr
import numpy as np

#: Lines on which curves begin, steps in shares of the ranges, and points of a curve at most.
BEGINNINGS, FIRST, LONGEST, SHORTEST, MOST = 41, 0.01, 0.04, 1e-5, 400
#: Newton's method: steps, and where it ends; differences for its matrix, in shares.
NEWTON, EXACT, DIFFERENCE = 12, 1e-12, 1e-6
#: A beginning this close to a curve, in shares of the ranges, lies on it.
SAME = 5e-3


@dataclass(frozen=True, eq=False, repr=False)
class Boundary(ShortRepr):
    """A boundary in the plane of an atlas.

    Attributes:
        kind: 'Hopf', 'torus', 'period doubling', 'branch point' or 'fold'.
        gait: whose.
        points: values on both axes, and of a Hopf point omega, shape (n, 2 or 3).

    """

    kind: str
    gait: str
    points: np.ndarray


class _Condition:
    """Two real equations in (p1, p2, omega), counted in shares of the ranges."""

    def __init__(self, chart: Chart, mode: tuple[int, ...], omega: float) -> None:
        self.chart, self.mode = chart, mode
        self.low = np.array([chart.first.low, chart.second.low, 0.0])
        self.size = np.array([chart.first.high - chart.first.low,
                              chart.second.high - chart.second.low, omega])

    def values(self, share: np.ndarray) -> np.ndarray:
        one, other, omega = self.low + share * self.size
        network = self.chart.at(one, other)
        block = next(block for block in blocks(network, equilibrium(network))
                     if block.mode == self.mode)
        matrix = characteristic_matrix(1j * omega, block.now, block.past, network.delay)[0]
        found = np.linalg.det(matrix)
        return np.array([found.real, found.imag])

    def slopes(self, share: np.ndarray) -> np.ndarray:
        steps = DIFFERENCE * np.eye(3)
        return np.array([(self.values(share + step) - self.values(share - step))
                         / (2.0 * DIFFERENCE) for step in steps]).T


def _corrected(condition: _Condition, share: np.ndarray, tangent: np.ndarray
               ) -> tuple[np.ndarray, int] | None:
    for count in range(NEWTON):
        try:
            matrix = np.vstack([condition.slopes(share), tangent])
            move = np.linalg.solve(matrix, np.append(-condition.values(share), 0.0))
        except (np.linalg.LinAlgError, CpgError, ArithmeticError):
            return None
        share = share + move
        if not np.abs(move).max() < 0.5:
            return None
        if np.abs(move).max() < EXACT:
            return share, count
    return None


def _tangent(condition: _Condition, share: np.ndarray) -> np.ndarray:
    return np.linalg.svd(condition.slopes(share))[2][-1]


def _inside(share: np.ndarray) -> bool:
    return bool((share[:2] >= -1e-12).all() and (share[:2] <= 1.0 + 1e-12).all()
                and share[2] > 1e-4)


def _followed(condition: _Condition, start: np.ndarray, way: float) -> list[np.ndarray]:
    here, step = start, FIRST
    tangent = way * _tangent(condition, start)
    found: list[np.ndarray] = []
    while len(found) < MOST:
        ahead = _corrected(condition, here + step * tangent, tangent)
        new = None if ahead is None else _tangent(condition, ahead[0])
        if ahead is None or new is None or abs(new @ tangent) < 0.95:
            step *= 0.5
            if step < SHORTEST:
                break
            continue
        if not _inside(ahead[0]):
            # Up to the edge, by ever shorter steps.
            step *= 0.5
            if step < SHORTEST:
                break
            continue
        here, tangent = ahead[0], new * np.sign(new @ tangent)
        found.append(here)
        if len(found) > 5 and np.linalg.norm(here - start) < 0.5 * step:
            break
        if ahead[1] <= 4:
            step = min(1.5 * step, LONGEST)
    return found


def hopf_curves(job: tuple[Chart, tuple[str, ...]]) -> list[Boundary]:
    """All curves of Hopf points of some gaits in a plane that a few lines across it meet."""
    chart, gaits = job
    found: list[Boundary] = []
    seen: dict[tuple[int, ...], list[np.ndarray]] = {}
    for value in np.linspace(chart.first.low, chart.first.high, BEGINNINGS):
        network = chart.at(float(value), chart.second.low)
        shifts = {frozenset(network.symmetry(gait).shifts): gait for gait in gaits}
        try:
            points = hopf_points(network, chart.second.line, chart.second.low, chart.second.high)
        except CpgError:
            continue
        for point in points:
            gait = shifts.get(frozenset(point.block.symmetry.shifts))
            if gait is None:
                continue
            condition = _Condition(chart, point.mode, 1.0)
            start = (np.array([value, point.value, point.omega]) - condition.low
                     ) / condition.size
            if any(_on(curve, start) for curve in seen.get(point.mode, [])):
                continue
            exact = _corrected(condition, start, _tangent(condition, start))
            if exact is None:
                continue
            back = _followed(condition, exact[0], -1.0)
            shares = np.array([*back[::-1], exact[0], *_followed(condition, exact[0], 1.0)])
            seen.setdefault(point.mode, []).append(shares)
            found.append(Boundary('Hopf', gait, condition.low + shares * condition.size))
    return found


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
