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

"""Buono & Golubitsky (2001), appendix A: Theorem A.1 with its conditions, by computation.

The conditions are worked out on the matrices of a group: fixed-point subspaces by projectors, and
the components of Fix(K) - L_K by the signs that random points of it have at its hyperplanes.
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass

from cpg_ros.dynamics.floquet import multipliers
from cpg_ros.dynamics.orbit import solve_orbit
from cpg_ros.networks.delayed import Delayed
from cpg_ros.networks.hk_theorem import admissible_pairs
from cpg_ros.networks.symmetry import GAITS, Permutation, Z4_Z2
from cpg_ros.papers.buono_gaits import AUTHORS
from cpg_ros.papers.buono_groups import all_subgroups, conjugate, cyclic, D4, generated, Subgroup
from cpg_ros.papers.row import Citation, Picture, ReproducedRow
import numpy as np

#: Points of Fix(K) at random, and what is 0.
POINTS, ZERO = 400, 1e-9
#: Names of the conditions, in the order of the paper.
CONDITIONS = ('A.2', 'A.3', 'A.5', 'A.6')
#: A multiplier this far from the unit circle belongs to a hyperbolic orbit.
HYPERBOLIC = 1e-3

Representation = Callable[[Permutation], np.ndarray]


@dataclass(frozen=True, eq=False)
class Action:
    """A finite group that acts on R^n by orthogonal matrices."""

    group: Subgroup
    matrix: Representation

    def fixed(self, subgroup: Subgroup) -> np.ndarray:
        """Return an orthonormal basis of Fix(subgroup), shape (n, dimension)."""
        projector = np.mean([self.matrix(g) for g in subgroup], axis=0)
        values, vectors = np.linalg.eigh(0.5 * (projector + projector.T))
        basis: np.ndarray = vectors[:, values > 0.5]
        return basis

    def normaliser(self, subgroup: Subgroup) -> Subgroup:
        """Return N(subgroup)."""
        return frozenset(g for g in self.group if conjugate(g, subgroup) == subgroup)

    def failing(self, k: Subgroup, h: Subgroup) -> list[str]:
        """Return which of the conditions A.2, A.3, A.5 and A.6 a pair does not meet."""
        basis = self.fixed(k)
        points = basis @ np.random.default_rng(0).standard_normal((basis.shape[1], POINTS))
        isotropy = all(np.abs(self.matrix(g) @ points - points).max() > ZERO
                       for g in self.group - k)
        dimension = basis.shape[1]
        met = {'A.2': isotropy, 'A.3': dimension >= 2,
               'A.5': isotropy and self._keeps_a_component(k, h, basis, points),
               'A.6': dimension != 2 or h in (k, self.normaliser(k))}
        return [name for name in CONDITIONS if not met[name]]

    def _keeps_a_component(self, k: Subgroup, h: Subgroup, basis: np.ndarray, points: np.ndarray
                           ) -> bool:
        """Whether h fixes a component of Fix(K) - L_K, which only hyperplanes divide."""
        normals = []
        for g in self.group - k:
            # (g - 1) on Fix(K) has rank 1 where Fix(g) meets it in a hyperplane.
            _, sizes, rows = np.linalg.svd((self.matrix(g) - np.eye(len(basis))) @ basis)
            if (sizes > ZERO).sum() == 1:
                normals.append(basis @ rows[0])
        if not normals:
            return True
        signs = np.sign(np.array(normals) @ points)
        same = np.ones(points.shape[1], dtype=bool)
        for g in h:
            same &= (np.sign(np.array(normals) @ (self.matrix(g) @ points)) == signs).all(axis=0)
        return bool(same.any())


def of_cells(group: Subgroup, variables: int) -> Action:
    """Return how permutations act on cells with some variables."""
    def matrix(g: Permutation) -> np.ndarray:
        found: np.ndarray = np.kron(np.eye(variables), np.eye(len(g))[np.argsort(g)])
        return found

    return Action(group, matrix)


def _quadruped_pairs() -> list[tuple[Subgroup, Subgroup]]:
    named = Z4_Z2.elements
    return [(frozenset(named[name] for name in pair.k), frozenset(named[name] for name in pair.h))
            for pair in admissible_pairs(Z4_Z2)]


def conditions() -> Iterator[ReproducedRow | Picture]:
    """Theorem A.1: conditions A.2 to A.6 for cells with two variables, and the example."""
    at = Citation(AUTHORS, 'Theorem A.1')
    pairs = _quadruped_pairs()
    every = frozenset(Z4_Z2.elements.values())
    dihedral = [(k, h) for k in all_subgroups(D4) for h in all_subgroups(D4) if cyclic(h, k)]
    for name, group, some in (('Z4 x Z2', every, pairs), ('D4', D4, dihedral)):
        action = of_cells(group, 2)
        failing = [set(action.failing(k, h)) for k, h in some]
        for condition in CONDITIONS:
            yield at.holds(f'{name}, eight cells with two variables: all pairs with cyclic H/K '
                           f'meet ({condition})',
                           not any(condition in one for one in failing),
                           note=f'{len(some)} pairs')
        gaps = [action.fixed(k).shape[1] - action.fixed(generated(g, *k)).shape[1]
                for k, _ in some for g in group - k]
        yield Citation(AUTHORS, 'eq. A.7').holds(
            f'{name}: a further symmetry takes at least two dimensions from Fix(K)',
            min(gaps) >= 2, note=f'at least {min(gaps)}')
        full = [action.fixed(k).shape[1] == 2 for k, _ in some]
        yield Citation(AUTHORS, 'appendix A').holds(
            f'{name}: dim Fix(K) = 2 only where K is the whole group',
            all(len(k) == len(group) for (k, _), two in zip(some, full, strict=True) if two))
    turn = (1, 2, 3, 0)
    z4 = generated(turn)

    def rotation(g: Permutation) -> np.ndarray:
        angle = 0.5 * np.pi * g[0]
        return np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])

    half = generated(tuple(turn[i] for i in turn))
    yield Citation(AUTHORS, 'eq. A.6').word(
        'conditions that H = Z2, K = 1 of Z4 acting on the plane by rotations does not meet',
        'A.6', ', '.join(Action(z4, rotation).failing(generated(tuple(range(4))), half)))


def one_variable() -> Iterator[ReproducedRow | Picture]:
    """Section 4: no robust trot with one-dimensional cells, unless there is a delay."""
    at = Citation(AUTHORS, 'section 4')
    every, named = frozenset(Z4_Z2.elements.values()), Z4_Z2.elements
    action = of_cells(every, 1)
    failing = {}
    for gait, (j, k) in GAITS.items():
        shifts = {name: (j * a + 2 * k * b) % 4 for name, (a, b) in _exponents().items()}
        spatial = frozenset(named[name] for name, shift in shifts.items() if not shift)
        failing[gait] = action.failing(spatial, every)
    ruled_out = ', '.join(gait for gait in GAITS if failing[gait])
    yield at.holds('robust trots cannot occur with one-dimensional cells, by Theorem A.1',
                   bool(failing['trot']),
                   note=f'({", ".join(failing["trot"])}) is not met; ruled out: {ruled_out}')
    network = Delayed.presets()['liu2024_trot'].network
    orbit = solve_orbit(network, 'trot')
    found = multipliers(orbit)
    gap = float(np.abs(np.abs(np.concatenate([found.within, found.transverse])) - 1.0).min())
    yield at.holds('a delay escapes that: one-dimensional cells have a hyperbolic trot with it',
                   network.variables == 1 and orbit.residual < 1e-8 and gap > HYPERBOLIC,
                   note=f'Liu & Zhang (2024), period {orbit.period:.4f}, residual '
                        f'{orbit.residual:.0e}; the theorem is on ordinary differential equations')


def _exponents() -> dict[str, tuple[int, int]]:
    """Name of an element of Z4 x Z2 -> its exponents of omega and kappa."""
    return {name: (element[0] // 2, element[0] % 2) for name, element in Z4_Z2.elements.items()}
