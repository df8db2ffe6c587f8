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

"""Where a curve of Hopf points ends inside the plane: Bogdanov-Takens and zero-Hopf points.

At a Bogdanov-Takens point the pair meets in 0: there ``det Delta(0) = 0`` and its derivative by
the root is 0. Where the class is that in which all cells move together, the equilibrium folds at
the same place, as it does where a curve ends in a zero-Hopf point. It is no function of the
parameters there, so the state is an unknown as well (Kuznetsov, *Elements of Applied Bifurcation
Theory*, sections 8.4, 8.5 and 10.2); with the symmetry x -> -x it stays 0.
"""

from collections.abc import Callable, Iterator

from cpg_ros.atlas.chart import Chart
from cpg_ros.atlas.codimension_two import CodimensionTwo
from cpg_ros.atlas.hopf_condition import slopes
from cpg_ros.dynamics.characteristic import characteristic_matrix
from cpg_ros.dynamics.equilibrium import equilibrium, odd, Quotient
from cpg_ros.dynamics.expansion import Expansion
from cpg_ros.dynamics.isotypic import Block, block_at, block_of, classes
from cpg_ros.errors import CpgError
from cpg_ros.networks.symmetry import Symmetry
import numpy as np

#: How far from a curve's last point, in shares of the ranges, its end is looked for.
REACH = 0.03
#: Newton's method: steps, where it ends, differences for its matrix, and what may be left.
NEWTON, EXACT, DIFFERENCE, LEFT = 30, 1e-12, 1e-6, 1e-9
#: Imaginary part of the root at which the derivative of a real determinant is taken.
SLIGHT = 1e-6

Equations = Callable[[np.ndarray], np.ndarray]


class _End:
    """Equations in (state, p1, p2, ...), the parameters in shares of their ranges."""

    def __init__(self, chart: Chart, symmetry: Symmetry, share: np.ndarray) -> None:
        self.chart, self.symmetry = chart, symmetry
        network = chart.at_share(share[:2])
        self.rest = equilibrium(network)
        self.moves = not odd(network) and network.at_rest() is None
        self.together = next(one for one in classes(network)
                             if all(shift == 0 for _, shift in one.shifts))
        self.free = len(self.rest) if self.moves else 0

    def _split(self, unknowns: np.ndarray) -> tuple[np.ndarray, Expansion]:
        """Return the rates of the state, where it moves, and the expansion about it."""
        share = unknowns[self.free:self.free + 2]
        network = self.chart.at_share(share)
        if not self.moves:
            return np.zeros(0), Expansion(network, equilibrium(network))
        state = unknowns[:self.free]
        return Quotient(network).together(state)[0], Expansion(network, state)

    def takens(self, unknowns: np.ndarray) -> np.ndarray:
        """Equations of a Bogdanov-Takens point in (state, p1, p2)."""
        rates, expansion = self._split(unknowns)
        block = block_of(expansion, self.symmetry)
        return np.array([*rates, _determinant(block, 0.0).real,
                         _determinant(block, 1j * SLIGHT).imag / SLIGHT])

    def zero_hopf(self, unknowns: np.ndarray) -> np.ndarray:
        """Equations of a zero-Hopf point in (state, p1, p2, omega)."""
        rates, expansion = self._split(unknowns)
        pair = _determinant(block_of(expansion, self.symmetry), 1j * unknowns[-1])
        fold = _determinant(block_of(expansion, self.together), 0.0)
        return np.array([*rates, pair.real, pair.imag, fold.real])


def _determinant(block: Block, root: complex) -> complex:
    return complex(np.linalg.det(characteristic_matrix(root, block.now, block.past,
                                                       block.network.delay)[0]))


def _solved(equations: Equations, start: np.ndarray) -> tuple[np.ndarray, float] | None:
    """Apply Newton's method; return the solution and its largest residual, or None."""
    unknowns = start
    try:
        for _ in range(NEWTON):
            move = np.linalg.solve(slopes(equations, unknowns, DIFFERENCE), equations(unknowns))
            unknowns = unknowns - move
            if not np.abs(move).max() < 1.0:
                return None
            if np.abs(move).max() < EXACT:
                left = float(np.abs(equations(unknowns)).max())
                return (unknowns, left) if left < LEFT else None
    except (np.linalg.LinAlgError, CpgError, ArithmeticError):
        return None
    return None


def curve_ends(chart: Chart, gait: str, mode: tuple[int, ...], shares: np.ndarray
               ) -> Iterator[CodimensionTwo]:
    """Yield the Bogdanov-Takens and zero-Hopf points in which a curve of Hopf points ends.

    Args:
        chart: the plane.
        gait: whose.
        mode: the class of the critical root.
        shares: points of the curve, (p1, p2, omega), the parameters in shares, shape (n, 3).

    """
    if len(shares) < 3:
        return
    for last, before in ((shares[0], shares[1]), (shares[-1], shares[-2])):
        network = chart.at_share(last[:2])
        block = block_at(network, equilibrium(network), mode)
        end = _End(chart, block.symmetry, last)
        start = np.concatenate([end.rest[:end.free], last])
        ahead = last[2] - before[2]
        if block.real and ahead < 0.0:
            found = _solved(end.takens, start[:-1])
            if found and _here(found[0][end.free:], last):
                yield CodimensionTwo('Bogdanov-Takens', gait,
                                     chart.values_at(found[0][end.free:]), found[1], 0.0)
                continue
        if end.moves:
            found = _solved(end.zero_hopf, start)
            if found and _here(found[0][end.free:-1], last) and found[0][-1] > 0.5 * last[2]:
                folds = block_of(Expansion(network, end.rest), end.together).gait
                yield CodimensionTwo('zero-Hopf', gait, chart.values_at(found[0][end.free:-1]),
                                     found[1], float(found[0][-1]), (folds,), 0.0)


def _here(share: np.ndarray, last: np.ndarray) -> bool:
    """Whether a solution lies in the plane, close to the end of the curve."""
    return bool((share >= -1e-9).all() and (share <= 1.0 + 1e-9).all()
                and np.abs(share - last[:2]).max() < REACH)
