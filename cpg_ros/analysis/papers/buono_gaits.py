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

"""Buono & Golubitsky (2001): the primary gaits, sections 2.3, 3 and 7, and appendix A.

Phases are measured on simulations of all eight cells that start off the gait and run free of any
lock; they are not prescribed to a solver. Results on groups come from an exhaustive search.
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from fractions import Fraction
from functools import cache
from itertools import permutations

from cpg_ros.analysis.papers.buono_hopf import AUTHORS, PRINTED
from cpg_ros.analysis.papers.row import (
    cell_constants,
    Citation,
    disturbed_start,
    Picture,
    primary_gaits,
    ReproducedRow,
    Rhythm,
    rhythm,
    trajectories,
)
from cpg_ros.dynamics.floquet import multipliers
from cpg_ros.dynamics.solve_orbit import solve_orbit
from cpg_ros.networks.library.delayed import Delayed
from cpg_ros.networks.library.quadruped import Quadruped
from cpg_ros.networks.symmetry import admissible_pairs, compose, GAITS, label, Permutation, Z4_Z2
import numpy as np
from sympy.combinatorics import PermutationGroup
from sympy.combinatorics import permutations as sympy_permutations

#: Periods in which a disturbed gait settles: for some gaits, and for the others.
SETTLING = {'jump': 150.0}
DEFAULT_SETTLING = 60.0
#: Periods in which a wave reverses.
REVERSAL = 150.0

LEGS = ('LH', 'RH', 'LF', 'RF')
#: Cells (from 1) that share the left hind leg in Table 4.
LEFT_HIND = {'zig-zag': (1, 5), 'criss-cross': (1, 6)}
#: Erratum 9: gait -> phase in the criss-cross network, where that section is wrong.
WRONG_PHASES = {'pronk': '0', 'bound': '0', 'jump': '1/2'}
CURRENT = '1'


@dataclass(frozen=True)
class SolvedGait:
    """A gait of Table 13 as simulated."""

    name: str
    network: Quadruped
    rhythm: Rhythm

    @property
    def phases(self) -> np.ndarray:
        """Phases of the eight cells relative to cell 1, cycles."""
        return self.rhythm.end.phases


def settled(name: str) -> SolvedGait:
    """Simulate a gait of Table 13 from near its orbit, with every cell disturbed."""
    network = Quadruped(*(float(value) for value in PRINTED['table_13'][name]))
    preset = Quadruped.presets()[name]
    span = SETTLING.get(name, DEFAULT_SETTLING) * preset.period
    return SolvedGait(name, network, rhythm(network, disturbed_start(preset), span, Z4_Z2,
                                            primary_gaits(variables=2)))


def _table_13(gait: SolvedGait) -> Iterator[ReproducedRow]:
    at, name = Citation(AUTHORS, 'Table 13'), gait.name
    couplings = ', '.join(PRINTED['table_13'][name])
    yield at.word(f'gait that is found with the couplings {couplings}', name, gait.rhythm.kind,
                  note=f'period {gait.rhythm.cycle.period:.4f}; phases measured')
    yield at.stable(f'the {name} that is found',
                    multipliers(solve_orbit(gait.network, name)).leading)


def _table_1(gait: SolvedGait) -> Iterator[ReproducedRow]:
    at, name = Citation(AUTHORS, 'Table 1'), gait.name
    printed = [Fraction(part) for part in PRINTED['table_1'][name].split()]
    for cell in range(1, 4):
        wrong = name == 'walk' and cell >= 2
        yield at.phases(f'{name}: phase of u_{cell + 1} ({LEGS[cell]}) against u_1 (LH)',
                        str((printed[cell] - printed[0]) % 1), [gait.phases[cell]],
                        erratum=(10, ('3/4', '1/4')[cell - 2]) if wrong else None)


def _reversed(gait: SolvedGait) -> ReproducedRow:
    """Start the walk as in Table 1, with the opposite wave, and measure its final phases."""
    preset = Quadruped.presets()[gait.name]
    start = np.array(preset.start).reshape(2, -1)[:, [0, 1, 6, 7, 4, 5, 2, 3]]
    final = rhythm(gait.network, start.ravel(), REVERSAL * preset.period, Z4_Z2,
                   primary_gaits(variables=2))
    return Citation(AUTHORS, 'Table 1').phases(
        'walk started with u_3(t) = u_1(t + 1/4): phase of u_3 (LF) in the end', '1/4',
        [final.end.phases[2]], erratum=(10, '3/4'))


def _table_2(gait: SolvedGait) -> Iterator[ReproducedRow]:
    at, name = Citation(AUTHORS, 'Table 2'), gait.name
    how = 'with gamma U(t) = U(t - theta) as in eqs. 2.1 and 3.1'
    shifts = PRINTED['table_2'][name]
    for symbol, cell, printed in zip(('omega', 'kappa'), (2, 1), shifts, strict=True):
        yield at.phases(f'{name}: phase shift of {symbol}', printed, [-gait.phases[cell] % 1.0],
                        note=f'u_{cell + 1}(t) = u_1(t - theta), {how}')


def _section_7(gait: SolvedGait) -> Iterator[ReproducedRow]:
    at, name = Citation(AUTHORS, 'section 7'), gait.name
    for assignment, (first, second) in LEFT_HIND.items():
        wrong = assignment == 'criss-cross' and name in WRONG_PHASES
        yield at.phases(f'{name}: phase between the two cells of a leg, {assignment} network',
                        PRINTED['section_7'][assignment][name],
                        [gait.phases[second - 1] - gait.phases[first - 1]],
                        erratum=(9, WRONG_PHASES[name]) if wrong else None,
                        note=f'cells {first} and {second}')


def _figure_2(gait: SolvedGait) -> Iterator[ReproducedRow | Picture]:
    order = ' '.join(f'u_{cell + 1}' for cell in np.argsort(-gait.phases[:4] % 1.0,
                                                            kind='stable'))
    where = 'top' if gait.name == 'walk' else 'bottom'
    if gait.name == 'walk':
        yield Citation(AUTHORS, 'Figure 2').word('order in which the cells peak in the walk',
                                                 'u_1 u_3 u_2 u_4', order)
    run, period = gait.rhythm.run, gait.rhythm.cycle.period
    drawn = run.t >= run.t[-1] - 4.0 * period
    cells = gait.network.cells
    yield Picture(AUTHORS, f'Figure 2, {where}', f'The {gait.name} of Table 13, four periods.',
                  trajectories(f'{AUTHORS}, Figure 2, {where}: {gait.name}',
                               run.t[drawn] - run.t[drawn][0], run.x[drawn, :cells][:, :4],
                               [f'$u_{cell + 1}$ ({leg})' for cell, leg in enumerate(LEGS)],
                               variable='v'))


def gaits(*names: str) -> Iterator[ReproducedRow | Picture]:
    """Compute the rows of some gaits of Table 13."""
    for name in names:
        gait = settled(name)
        for rows in (_table_1, _table_2, _table_13, _section_7):
            yield from rows(gait)
        if name == 'walk':
            yield _reversed(gait)
        if name in ('walk', 'trot'):
            yield from _figure_2(gait)
        if name == 'trot':
            at = Citation(AUTHORS, 'section 2.1')
            h, k = gait.rhythm.end.h, gait.rhythm.end.k
            yield at.number('order of H of the trot, Z4 x Z2', '8', len(h))
            yield at.word('K of the trot is generated by', '<omega kappa>', label(Z4_Z2, k))
            yield at.number('order of K of the trot, Z2(omega kappa)', '2', len(k),
                            erratum=(14, '4'))


def constants() -> Iterator[ReproducedRow | Picture]:
    """Yield the cell of section 6, read off the compiled rates."""
    at = Citation(AUTHORS, 'section 6')
    values = cell_constants(Quadruped(0.0, 0.0, 0.0, 0.0), float(CURRENT))
    for name, printed in PRINTED['section_6'].items():
        yield at.number(name, printed, values[name], within=1e-8,
                        note=f'read off the compiled rates, with i = {CURRENT}')
    yield at.formula('tau ten widths v4 from v3, over its least', 'cosh(5)', {}, values['tau_far'])


Subgroup = frozenset[Permutation]


def cycles(text: str, cells: int) -> Permutation:
    """Read a permutation written in cycles of cells from 1, such as '(1 2)(3 8)'."""
    image = list(range(cells))
    for cycle in text.strip('()').split(')('):
        members = [int(part) - 1 for part in cycle.split()]
        for here, there in zip(members, members[1:] + members[:1], strict=True):
            image[here] = there
    return tuple(image)


def inverse(element: Permutation) -> Permutation:
    """Return the inverse."""
    return tuple(sorted(range(len(element)), key=element.__getitem__))


def generated(*generators: Permutation) -> Subgroup:
    """Return the subgroup that permutations generate."""
    group = PermutationGroup(*(sympy_permutations.Permutation(list(g)) for g in generators))
    return frozenset(tuple(element.array_form) for element in group.elements)


def conjugate(by: Permutation, subgroup: Subgroup) -> Subgroup:
    """``g S g^-1``."""
    return frozenset(compose(compose(by, element), inverse(by)) for element in subgroup)


@cache
def all_subgroups(group: Subgroup) -> frozenset[Subgroup]:
    """Every subgroup; those of D4 need two generators at most, and no other group is used."""
    return frozenset(generated(a, b) for a in group for b in group)


def cyclic(h: Subgroup, k: Subgroup) -> bool:
    """Return whether k is normal in h with a cyclic quotient."""
    return k <= h and all(conjugate(g, k) == k for g in h) and any(
        generated(g, *k) == h for g in h)


#: Section 3's D4, and the names of section 2.3.
OMEGA, KAPPA = cycles('(1 3 5 7)(2 4 6 8)', 8), cycles('(1 2)(3 8)(5 6)(7 4)', 8)
HALF = compose(OMEGA, OMEGA)
D4 = generated(OMEGA, KAPPA)
ONE = tuple(range(8))
NAMES = {'D4': D4, 'D2s': generated(KAPPA, HALF), 'D2p': generated(compose(KAPPA, OMEGA), HALF),
         'Z4': generated(OMEGA), '1': generated(ONE), 'Z2s': generated(KAPPA),
         'Z2p': generated(compose(KAPPA, OMEGA)), 'Z2': generated(HALF)}


def _name(subgroup: Subgroup) -> str:
    return next(name for name, representative in NAMES.items()
                if any(conjugate(g, representative) == subgroup for g in D4))


def solutions() -> list[tuple[Subgroup, Subgroup]]:
    """All pairs (K, H) of D4 that Theorem 2.2 admits with H larger than K."""
    every = all_subgroups(D4)
    return [(k, h) for h in every for k in every if k < h and cyclic(h, k)]


def dihedral() -> Iterator[ReproducedRow | Picture]:
    """Compute the rows of section 2.3, and its results that the proof of Theorem 3.2 uses."""
    at = Citation(AUTHORS, 'section 2.3')
    classes = {frozenset(conjugate(g, subgroup) for g in D4) for subgroup in all_subgroups(D4)}
    yield at.number('conjugacy classes of subgroups of D4', '8', len(classes))
    types = {frozenset((conjugate(g, k), conjugate(g, h)) for g in D4) for k, h in solutions()}
    yield at.number('types of periodic solutions with H larger than K', '12', len(types))
    pairs = {f'{_name(k)} in {_name(h)}' for k, h in solutions()}
    printed = PRINTED['types']
    yield at.word('those types', ', '.join(printed), ', '.join(
        [name for name in printed if name in pairs] + sorted(pairs - set(printed))))
    quarter = {f'{_name(k)} in {_name(h)}' for k, h in solutions() if len(h) == 4 * len(k)}
    yield at.word('those with a quarter-period phase shift', '1 in Z4', ', '.join(sorted(quarter)))
    at = Citation(AUTHORS, 'Theorem 3.2')
    yield at.holds('kappa omega = omega^3 kappa',
                   compose(KAPPA, OMEGA) == compose(compose(HALF, OMEGA), KAPPA))
    half = [(k, h) for k, h in solutions()
            if KAPPA in h - k and len(k) > 1 and compose(KAPPA, KAPPA) in k]
    yield at.number('types with kappa as a half-period shift and a spatial symmetry', '3',
                    len(half), erratum=(15, '4'),
                    note='K in H: ' + ', '.join(sorted(f'{_name(k)} in {_name(h)}'
                                                       for k, h in half)))
    for k, h, phase in ((NAMES['D2p'], D4, '0'), (NAMES['Z2'], NAMES['D2s'], '0'),
                        (generated(compose(KAPPA, HALF)), NAMES['D2s'], '1/2')):
        yield at.phases(f'{_name(k)} in {_name(h)}: phase of RH (cell 5) against LH (cell 1)',
                        phase, [0.0 if HALF in k else 0.5 * (HALF in h)],
                        note='H/K is Z2: what is in H but not in K shifts by half a period')


def lattice() -> Iterator[ReproducedRow | Picture]:
    """Figure 4: the subgroups of D4, and which contain which."""
    for name, printed in PRINTED['figure_4'].items():
        below = [group for group in all_subgroups(D4) if group < NAMES[name]]
        largest = {_name(group) for group in below if not any(group < other for other in below)}
        yield Citation(AUTHORS, 'Figure 4').word(
            f'largest subgroups of {name}, up to conjugation', printed,
            ', '.join([group for group in printed.split(', ') if group in largest]
                      + sorted(largest - set(printed.split(', ')))))


def four_cells() -> Iterator[ReproducedRow | Picture]:
    """Theorem 3.1: conjugation by the walk's four-cycle."""
    at = Citation(AUTHORS, 'Theorem 3.1')
    rotation = cycles('(1 3 2 4)', 4)
    for first, second in (('(1 4)(2 3)', '(1 3)(2 4)'), ('(1 3)(2 4)', '(1 4)(2 3)'),
                          ('(1 2)(3 4)', '(1 2)(3 4)')):
        image = compose(compose(rotation, cycles(first, 4)), inverse(rotation))
        yield at.word(f'(1 3 2 4) {first} (1 3 2 4)^-1', second, _written(image))


def _written(element: Permutation) -> str:
    """Return a permutation in cycles from 1, without fixed cells."""
    cycles = sympy_permutations.Permutation(list(element)).cyclic_form
    return ''.join(f'({" ".join(str(i + 1) for i in cycle)})' for cycle in cycles)


@cache
def assignments() -> tuple[tuple[str, ...], ...]:
    """All assignments F of two cells to each leg with F(1) = LH that satisfy eq. 3.2.

    Cells that share a leg are carried by every symmetry to cells that share one.
    """
    symmetries = list(Z4_Z2.elements.values())
    accepted = []
    for partition in _pairings(tuple(range(8))):
        pairs = {frozenset(pair) for pair in partition}
        if all(frozenset(g[i] for i in pair) in pairs for g in symmetries for pair in pairs):
            first = next(pair for pair in partition if 0 in pair)
            others = [pair for pair in partition if pair != first]
            for legs in permutations(LEGS[1:]):
                leg = {i: name for pair, name in zip((first, *others), (LEGS[0], *legs),
                                                     strict=True) for i in pair}
                accepted.append(tuple(leg[i] for i in range(8)))
    return tuple(accepted)


def _pairings(cells: tuple[int, ...]) -> Iterator[list[tuple[int, int]]]:
    if not cells:
        yield []
        return
    first, rest = cells[0], cells[1:]
    for other in rest:
        for more in _pairings(tuple(i for i in rest if i != other)):
            yield [(first, other), *more]


def legs() -> Iterator[ReproducedRow | Picture]:
    """Theorem 3.3, Tables 3 and 4."""
    at = Citation(AUTHORS, 'Theorem 3.3')
    allowed = assignments()
    yield at.number('assignments with F(1) = LH and eq. 3.2, no more asked', '2', len(allowed),
                    erratum=(16, '18'))
    proven = [' '.join(F) for F in allowed if F[1:4] == LEGS[1:]]
    yield at.number('assignments if also F(2) = RH, F(3) = LF, F(4) = RF, as in the proof', '2',
                    len(proven))
    at = Citation(AUTHORS, 'Table 4')
    proven.sort(key=lambda F: F.split()[4] != 'LH')
    names = dict(zip(PRINTED['table_4'], proven, strict=True))
    for name, printed in PRINTED['table_4'].items():
        yield at.word(f'legs of cells 1 to 8, {name} network', printed, names[name])
    shared = PRINTED['table_3'].split()
    pairs = {frozenset(i for i in range(8) if shared[i] == leg) for leg in LEGS}
    preserved = all(frozenset(g[i] for i in pair) in pairs
                    for g in Z4_Z2.elements.values() for pair in pairs)
    yield Citation(AUTHORS, 'Table 3').holds(
        'the assignment of Table 3 is none that eq. 3.2 allows', not preserved)


# Buono & Golubitsky (2001), appendix A: Theorem A.1 with its conditions, by computation.

#: POINTS: number of random points of Fix(K); ZERO_TOLERANCE: size up to which a value is 0.
POINTS, ZERO_TOLERANCE = 400, 1e-9
#: Names of the conditions, in the order of the paper.
CONDITIONS = ('A.2', 'A.3', 'A.5', 'A.6')
#: Distance of the multipliers from the unit circle above which an orbit is hyperbolic.
HYPERBOLIC_THRESHOLD = 1e-3

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
        isotropy = all(np.abs(self.matrix(g) @ points - points).max() > ZERO_TOLERANCE
                       for g in self.group - k)
        dimension = basis.shape[1]
        conditions = {'A.2': isotropy, 'A.3': dimension >= 2,
                      'A.5': isotropy and self._keeps_a_component(k, h, basis, points),
                      'A.6': dimension != 2 or h in (k, self.normaliser(k))}
        return [name for name in CONDITIONS if not conditions[name]]

    def _keeps_a_component(self, k: Subgroup, h: Subgroup, basis: np.ndarray, points: np.ndarray
                           ) -> bool:
        """Return whether h fixes a component of Fix(K) - L_K, which only hyperplanes divide."""
        normals = []
        for g in self.group - k:
            # (g - 1) on Fix(K) has rank 1 where Fix(g) meets it in a hyperplane.
            _, sizes, rows = np.linalg.svd((self.matrix(g) - np.eye(len(basis))) @ basis)
            if (sizes > ZERO_TOLERANCE).sum() == 1:
                normals.append(basis @ rows[0])
        if not normals:
            return True
        signs = np.sign(np.array(normals) @ points)
        fixed = np.ones(points.shape[1], dtype=bool)
        for g in h:
            fixed &= (np.sign(np.array(normals) @ (self.matrix(g) @ points)) == signs).all(axis=0)
        return bool(fixed.any())


def of_cells(group: Subgroup, variables: int) -> Action:
    """Return how permutations act on cells with some variables."""
    def matrix(g: Permutation) -> np.ndarray:
        permuted: np.ndarray = np.kron(np.eye(variables), np.eye(len(g))[np.argsort(g)])
        return permuted

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
    for name, group, listed in (('Z4 x Z2', every, pairs), ('D4', D4, dihedral)):
        action = of_cells(group, 2)
        failing = [set(action.failing(k, h)) for k, h in listed]
        for condition in CONDITIONS:
            yield at.holds(f'{name}, eight cells with two variables: all pairs with cyclic H/K '
                           f'meet ({condition})',
                           not any(condition in failed for failed in failing),
                           note=f'{len(listed)} pairs')
        gaps = [action.fixed(k).shape[1] - action.fixed(generated(g, *k)).shape[1]
                for k, _ in listed for g in group - k]
        yield Citation(AUTHORS, 'eq. A.7').holds(
            f'{name}: a further symmetry takes at least two dimensions from Fix(K)',
            min(gaps) >= 2, note=f'at least {min(gaps)}')
        full = [action.fixed(k).shape[1] == 2 for k, _ in listed]
        yield Citation(AUTHORS, 'appendix A').holds(
            f'{name}: dim Fix(K) = 2 only where K is the whole group',
            all(len(k) == len(group) for (k, _), two in zip(listed, full, strict=True) if two))
    quarter = (1, 2, 3, 0)
    z4 = generated(quarter)

    def rotation(g: Permutation) -> np.ndarray:
        angle = 0.5 * np.pi * g[0]
        return np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])

    half = generated(tuple(quarter[i] for i in quarter))
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
    roots = multipliers(orbit)
    gap = float(np.abs(np.abs(np.concatenate([roots.within, roots.transverse])) - 1.0).min())
    yield at.holds('a delay escapes that: one-dimensional cells have a hyperbolic trot with it',
                   network.variables == 1 and orbit.residual < 1e-8 and gap > HYPERBOLIC_THRESHOLD,
                   note=f'Liu & Zhang (2024), period {orbit.period:.4f}, residual '
                        f'{orbit.residual:.0e}; the theorem is on ordinary differential equations')


def _exponents() -> dict[str, tuple[int, int]]:
    """Return name of an element of Z4 x Z2 -> its exponents of omega and kappa."""
    return {name: (element[0] // 2, element[0] % 2) for name, element in Z4_Z2.elements.items()}
