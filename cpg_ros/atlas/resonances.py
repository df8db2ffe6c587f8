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

"""Strong resonances on a curve of torus points: 1:1 to 1:4.

There the pair of multipliers is exp(2 pi i / n) and its conjugate, n = 1 to 4: the product of both
is 1, their sum 2 cos(2 pi / n). Both are smooth functions of the parameters also where the pair
meets on the real axis, at 1:1 and 1:2, in which torus curves end (Kuznetsov, *Elements of Applied
Bifurcation Theory*, section 9.5). Newton's method solves for both.
"""

from collections.abc import Iterator, Sequence
from itertools import pairwise

from cpg_ros.atlas.codimension_two import CodimensionTwo
from cpg_ros.atlas.hopf_condition import slopes
from cpg_ros.atlas.orbit_plane import OrbitPlane, spectrum
from cpg_ros.dynamics.bifurcation import REAL
from cpg_ros.errors import CpgError
import numpy as np

#: n of 1:n -> 2 cos(2 pi / n).
SUMS = {1: 2.0, 2: -2.0, 3: -1.0, 4: 0.0}
#: Newton's method: steps, where it ends, differences for its matrix, all in shares.
NEWTON, EXACT, DIFFERENCE = 12, 1e-10, 1e-5
#: How far from a point of the curve a resonance may lie, in shares, and from how close to its sum
#: an end is tried.
REACH, CLOSE = 0.08, 0.5
#: What product and sum may miss by, and resonances this close are one.
LEFT, SAME = 1e-8, 1e-5


def resonances(plane: OrbitPlane, part: int, rank: int, shares: Sequence[np.ndarray]
               ) -> Iterator[CodimensionTwo]:
    """Yield the resonances on a curve of torus points, in the order of its points.

    Args:
        plane: its last orbit is that at the first point.
        part: number of the subspace of the pair.
        rank: how many larger multipliers that has.
        shares: points of the curve in shares of the ranges.

    """
    found: list[np.ndarray] = []
    for place, n, at in [*_candidates(plane, part, rank, shares)]:
        plane.last = at
        solved = _solved(plane, part, n, place)
        if solved is None:
            continue
        share, left = solved
        if (np.abs(share - place).max() < REACH and (share >= 0.0).all() and (share <= 1.0).all()
                and not any(np.abs(share - one).max() < SAME for one in found)):
            found.append(share)
            yield CodimensionTwo(f'1:{n} resonance', plane.gait, plane.chart.values_at(share),
                                 left)


def _candidates(plane: OrbitPlane, part: int, rank: int, shares: Sequence[np.ndarray]
                ) -> Iterator[tuple]:
    """Yield places beside resonances: (share, n, the orbit closest to it)."""
    along = []
    for share in shares:
        try:
            plane.last = plane.orbit(share)
            along.append((share, complex(spectrum(plane.last)[part][rank]), plane.last))
        except (CpgError, IndexError):
            break
    for (one, left, orbit), (other, right, _) in pairwise(along):
        complexes = [abs(mu.imag) > REAL for mu in (left, right)]
        for n in (3, 4):
            gaps = [2.0 * mu.real - SUMS[n] for mu in (left, right)]
            if all(complexes) and gaps[0] * gaps[1] <= 0.0 and gaps[0] != gaps[1]:
                yield one + gaps[0] / (gaps[0] - gaps[1]) * (other - one), n, orbit
        if complexes == [True, False]:
            # Where it has met on the real axis the curve is no torus's any more.
            yield one, 1 if right.real > 0.0 else 2, orbit
            return
    if along and abs(along[-1][1].imag) > REAL:
        last, mu, orbit = along[-1]
        for n in (1, 2):
            if abs(2.0 * mu.real - SUMS[n]) < CLOSE:
                yield last, n, orbit


def _solved(plane: OrbitPlane, part: int, n: int, share: np.ndarray
            ) -> tuple[np.ndarray, float] | None:
    """Solve for product 1 and the sum of n; also the larger residual. None where that fails."""
    target = np.exp(2j * np.pi / n)

    def gaps(share: np.ndarray) -> np.ndarray:
        some = spectrum(plane.orbit(share))[part]
        one = complex(some[np.abs(some - target).argmin()])
        if abs(one.imag) > REAL * REAL:
            product, total = abs(one)**2, 2.0 * one.real
        else:
            real = some[np.abs(some.imag) <= REAL * REAL].real
            pair = real[np.abs(real - target.real).argsort()[:2]]
            product, total = float(pair.prod()), float(pair.sum())
        return np.array([product - 1.0, total - SUMS[n]])

    try:
        for _ in range(NEWTON):
            plane.last = plane.orbit(share)
            move = np.linalg.solve(slopes(gaps, share, DIFFERENCE), gaps(share))
            share = share - move
            if not np.abs(move).max() < REACH:
                return None
            if np.abs(move).max() < EXACT:
                left = float(np.abs(gaps(share)).max())
                return (share, left) if left < LEFT else None
    except (CpgError, np.linalg.LinAlgError, IndexError):
        return None
    return None
