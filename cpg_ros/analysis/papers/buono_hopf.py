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

"""Buono & Golubitsky (2001), sections 4 to 6: Tables 5 to 12, the stand, Theorems 4.1 to 4.3.

The formulas of section 5.2 are compared as printed with the blocks of the network's Jacobian, at a
random state with equal cells and random couplings, so that no formula holds by chance.
"""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Any, cast

from cpg_ros.analysis.papers.row import (
    Citation,
    Picture,
    printed_values,
    ReproducedRow,
    Value,
    value_of,
)
from cpg_ros.dynamics.equilibrium import equilibrium
from cpg_ros.dynamics.hopf import hopf_at, hopf_points, HopfPoint
from cpg_ros.dynamics.isotypic import Block, blocks, everywhere
from cpg_ros.networks.library.quadruped import Quadruped
from cpg_ros.networks.network import known, Network, ParameterLine
from cpg_ros.networks.symmetry import GAITS
import numpy as np
from scipy.optimize import brentq

AUTHORS = 'Buono & Golubitsky 2001'
PRINTED = printed_values('buono_golubitsky')


def square_root(phi: float, psi: float) -> complex:
    """Return the square root of ``phi + i psi`` as in eq. 5.3, which holds for psi >= 0 only."""
    size = np.hypot(phi, psi)
    return complex(np.sqrt((phi + size) / 2.0), np.sqrt((size - phi) / 2.0))


#: X of Propositions 5.2 and 5.7.
ROOT = 'sqrt((Phi + sqrt(Phi^2 + Psi^2))/2)'
UNCOUPLED = Quadruped(0.0, 0.0, 0.0, 0.0)
#: v and w at the stand of section 6, approximately.
NEAR_STAND = np.array([0.31, 0.52])


class Sample:
    """Couplings, a state of all cells, the blocks of the linearisation, and the printed formulas.

    Attributes:
        network: the couplings.
        state: (v, w) of every cell.
        blocks: by their name.
        names: of the formulas -> value: the couplings; A, the derivatives of an uncoupled cell's
            rates, with its entries a to d, trace nu and determinant Delta; B, C, D of Table 6.

    """

    def __init__(self, network: Quadruped, state: np.ndarray) -> None:
        self.network, self.state = network, state
        self.blocks: dict[str, Block] = {block.name: block for block in blocks(network, state)}
        alone = blocks(UNCOUPLED, state)[0].now.real
        (a, b), (c, d) = alone.tolist()
        along, across, ring = map(np.diag, np.reshape([*network.as_dict().values()], (3, 2)))
        self.names: dict[str, Value] = {
            **network.as_dict(), 'a': a, 'b': b, 'c': c, 'd': d, 'bc': b * c, 'nu': a + d,
            'Delta': a * d - b * c, 'A': alone, 'B': along, 'Bi': 1j * along, 'C': across,
            'D': ring}

    def printed(self, text: str) -> Any:
        """Return the value of a printed formula."""
        return value_of(text, self.names)

    def root(self, name: str) -> float:
        """Return the root in Proposition 5.2 of a complex block."""
        phi, psi = (self.printed(PRINTED[table][name]) for table in ('table_9', 'table_10'))
        return value_of(ROOT, {'Phi': phi, 'Psi': psi})

    def trace(self, name: str) -> complex:
        """Trace of a block."""
        return complex(np.trace(self.blocks[name].now))

    def discriminant(self, name: str) -> complex:
        """``(tr L)^2 - 4 det L`` of a block."""
        return complex(self.trace(name)**2 - 4.0 * np.linalg.det(self.blocks[name].now))

    def largest(self, name: str) -> float:
        """Return the largest real part of a block's eigenvalues."""
        return float(self.blocks[name].roots(2).real.max())


def drawn(equal: bool = False) -> Sample:
    """Draw a sample; with alpha = beta, gamma = delta and xi = eta if equal is set."""
    rng = np.random.default_rng(2001)
    network = Quadruped(*rng.uniform(-0.5, 0.5, 6))
    if equal:
        network = replace(network, beta=network.alpha, delta=network.gamma, eta=network.xi)
    # Near the stand, where nu^2 < 4 Delta as section 5 assumes.
    return Sample(network, NEAR_STAND + rng.uniform(-0.05, 0.05, 2))


def phases() -> Iterator[ReproducedRow | Picture]:
    """Table 5: eigenvectors of the whole linearisation."""
    sample = drawn()
    whole = sample.network.jacobian(everywhere(sample.network, sample.state))
    values, vectors = np.linalg.eig(whole)
    roots = np.concatenate([block.roots(2) for block in sample.blocks.values()])
    gap = max(np.abs(values - root).min() for root in roots)
    yield Citation(AUTHORS, 'section 5.2').holds(
        'the eight blocks hold all eigenvalues of L',
        gap < 1e-9 and max(np.abs(roots - root).min() for root in values) < 1e-9,
        note=f'largest difference {gap:.1e}')
    at = Citation(AUTHORS, 'Table 5')
    for name, (gait, printed) in PRINTED['table_5'].items():
        block = sample.blocks[name]
        (j, k), eigenvalue = block.mode, block.roots(2)[0]
        vector = vectors[:8, np.abs(values - eigenvalue).argmin()]
        yield at.phases(f'U_{j % 2 or j}{k}: phases of cells 1 to 8, {gait}', printed,
                        np.angle(vector / vector[0]) / (2.0 * np.pi),
                        note='from the eigenvector of the 16 x 16 matrix')


def tables() -> Iterator[ReproducedRow | Picture]:
    """Tables 6 to 10, and the eigenvalues that the paper derives from them."""
    sample = drawn()
    names = sample.names
    for name, text in PRINTED['table_6'].items():
        yield Citation(AUTHORS, 'Table 6').formula(name, text, names, sample.blocks[name].now)
    for name, text in PRINTED['table_7'].items():
        yield Citation(AUTHORS, 'Table 7').formula(
            f'trace of {name}', text, names, sample.trace(name).real,
            erratum=(12, f'{text} + 2(xi + eta)') if name == 'L_21' else None)
    for name, text in PRINTED['table_8'].items():
        yield Citation(AUTHORS, 'Table 8').formula(f'D of {name}', text, names,
                                                   sample.discriminant(name).real)
    for name in PRINTED['table_9']:
        whole = sample.discriminant(name)
        for table, what, ours in (('9', 'Phi', whole.real), ('10', 'Psi', whole.imag)):
            yield Citation(AUTHORS, f'Table {table}').formula(
                f'{what} of {name}', 'as printed',
                sample.printed(PRINTED[f'table_{table}'][name]), ours)
        root = square_root(whole.real, whole.imag)
        yield Citation(AUTHORS, 'eq. 5.3').formula(
            f'square of the root of Phi + i Psi, {name}', 'Phi + i Psi', whole, root**2,
            erratum=(24, whole.conjugate()),
            note=f'Psi is {"positive" if whole.imag > 0.0 else "negative"}')
    for k, text in enumerate(PRINTED['proposition_5_2']):
        real = sorted((value.real for value in sample.blocks[f'L_1{k}'].roots(2)), reverse=True)
        for equation, sign, ours in zip(('eq. 5.4', 'eq. 5.5'), (1.0, -1.0), real, strict=True):
            theirs = sample.printed(text) + sign * sample.root(f'L_1{k}')
            yield Citation(AUTHORS, 'Proposition 5.2').formula(
                f'real part of an eigenvalue in U_1{k}', equation, theirs, ours,
                erratum=(13, theirs / 2.0))
            yield Citation(AUTHORS, 'Proposition 5.2').formula(
                f'twice the real part of an eigenvalue in U_1{k}', equation, theirs, 2.0 * ours)
        yield Citation(AUTHORS, 'Corollary 5.4').holds(
            f'in U_1{k} one pair lies to the right of the other', real[0] > real[1])


def coupled_variable() -> Iterator[ReproducedRow | Picture]:
    """Compute the variable that delta multiplies in equation 4.4."""
    sample = drawn()
    network, at = sample.network, Citation(AUTHORS, 'eq. 4.4')
    theirs = sample.printed(PRINTED['table_7']['L_00'])
    # Seen by all cells alike, delta acts on w by way of w; or, as printed, by way of v.
    printed = sample.blocks['L_00'].now + network.delta * np.array([[0, 0], [1, -1]])
    yield at.formula('trace of L_00 if delta multiplies y', 'Table 7', theirs,
                     sample.trace('L_00').real)
    yield at.formula('trace of L_00 if delta multiplies x, as printed', 'Table 7', theirs,
                     float(np.trace(printed).real), erratum=(19, theirs - network.delta))


def equal_couplings() -> Iterator[ReproducedRow | Picture]:
    """Table 11 and Lemma 5.8: alpha = beta, gamma = delta, xi = eta."""
    sample = drawn(equal=True)
    names, at = sample.names, Citation(AUTHORS, 'Table 11')
    for name, text in PRINTED['table_11'].items():
        yield at.formula(f'real part of the eigenvalues of {name}', text, names,
                         sample.largest(name), erratum=(13, f'({text})/2'))
        yield at.formula(f'twice the real part of the eigenvalues of {name}', text, names,
                         2.0 * sample.largest(name))
    at = Citation(AUTHORS, 'Lemma 5.8')
    # nu enters each trace once: take it for which tr L_21 vanishes.
    critical = sample.printed('nu') - sample.trace('L_21').real
    yield at.formula('nu at which the trace of L_21 vanishes', '2 alpha + 2 gamma - xi', names,
                     critical, erratum=(20, '2(alpha + gamma - xi)'))
    for name, text, *wrong in PRINTED['lemma_5_8']:
        trace = sample.trace(name).real - sample.printed('nu') + critical
        yield at.formula(f'trace of {name} (real part) with that nu', text, names, trace,
                         erratum=(20, wrong[0]) if wrong else None)


#: Section 6. STAND: v_0 and w_0 at the stand; NU_0: trace of a cell there.
STAND, NU_0 = ('0.31', '0.52'), '-1.24'
#: 'Approximate values': this much of them.
APPROXIMATE_TOLERANCE = 0.1
#: Erratum 6: alpha, gamma and xi of the trot's Hopf point, with the signs that are right.
TROT = (-0.15, -0.16, 0.31)

#: Point at which theorem 4.2 does not hold, by its gait and alpha.
FAILED_PROOF = ('walk', 0.05)


def stand_sample(network: Network) -> Sample:
    """Return the linearisation at the stand of a network."""
    return Sample(cast(Quadruped, network), equilibrium(network))


def hopf(network: Quadruped, line: str, gait: str, low: float, high: float) -> HopfPoint:
    """Find the Hopf point of a gait between two values of parameters.

    Args:
        network: the other parameters.
        line: the parameters that move, as in ``ParameterLine``.
        gait: one of the six.
        low: value on one side of the point.
        high: value on the other side.

    """
    along, (j, k) = ParameterLine.parse(line, Quadruped), GAITS[gait]

    def largest(value: float) -> float:
        return stand_sample(along.at(network, value)).largest(f'L_{j}{k}')

    critical = along.at(network, float(brentq(largest, low, high, xtol=1e-13)))
    # The direction of the wave is that of the eigenvalue with positive imaginary part.
    blocks = stand_sample(critical).blocks
    root, mode = min(((root, (sense, k)) for sense in {j, -j % 4}
                      for root in blocks[f'L_{sense}{k}'].roots(2) if root.imag > 0.0),
                     key=lambda pair: abs(pair[0].real))
    return hopf_at(critical, along, mode, root.imag)


def the_stand() -> Iterator[ReproducedRow | Picture]:
    """Section 6: the stand of the uncoupled cells, and hypothesis 4.6."""
    at = Citation(AUTHORS, 'section 6')
    sample = stand_sample(UNCOUPLED)
    for name, printed, value in zip(('v_0', 'w_0'), STAND, sample.state, strict=True):
        yield at.number(f'{name} of the stand', printed, float(value))
    yield at.number('nu_0, the trace of a cell there', NU_0, sample.trace('L_00').real)
    roots = sample.blocks['L_00'].roots(2)
    yield at.holds('the stand is a spiral sink, hypothesis 4.6',
                   bool((roots.real < 0.0).all() and (roots.imag != 0.0).all()))


def existence() -> Iterator[ReproducedRow | Picture]:
    """Theorems 4.1 and 4.3: the points of the proofs, where the stand stays in place."""
    nu = {'nu_0': stand_sample(UNCOUPLED).trace('L_00').real}
    for theorem, gait, line, text, speed in PRINTED['existence']:
        value = value_of(text, nu)
        point = hopf(UNCOUPLED, line, gait, value - 0.1, value + 0.1)
        at = Citation(AUTHORS, theorem)
        yield at.formula(f'{gait}: {line.split("=")[0]} at the Hopf point, {line}', text, nu,
                         point.value)
        if speed:
            yield at.formula(f'{gait}: speed at which the eigenvalues cross', speed, {},
                             point.normal_form.k1.real, erratum=(13, f'{speed}/2'))
    # On xi = -(alpha + gamma) with gamma fixed, nu - 2 (alpha + gamma) + 2 xi by xi is 4, of
    # which the proof takes the part by xi alone.
    point = hopf(UNCOUPLED, 'xi=eta=-alpha=-beta', 'trot', 0.2, 0.4)
    yield Citation(AUTHORS, 'Theorem 4.1').formula(
        'trot: speed at which the eigenvalues cross, xi = -(alpha + gamma)', '2', {},
        point.normal_form.k1.real, note='2 is E_xi at fixed alpha + gamma; along the line E '
        'grows by 4, the real part by 2')
    half = nu['nu_0'] / 2.0
    walk = hopf(UNCOUPLED, 'gamma=delta=-alpha=-beta', 'walk', half - 0.1, half + 0.1)
    sample = stand_sample(walk.network)
    at = Citation(AUTHORS, 'Proposition 5.6')
    zero = [name for name in ('L_10', 'L_11') if abs(sample.trace(name).real) < 1e-9]
    yield at.word('block whose trace vanishes (real part) where nu = 2 gamma', 'L_10',
                  ', '.join(zero), erratum=(21, 'L_11'))
    yield at.formula('trace of L_01 there', '2 alpha', sample.names, sample.trace('L_01').real)
    yield at.formula('trace of L_21 there', '-2 alpha', sample.names, sample.trace('L_21').real)
    yield at.holds('an eigenvalue has a positive real part there', walk.unstable_roots > 0)


def table_12() -> Iterator[ReproducedRow | Picture]:
    """Compute Table 12: Hopf points to pace, bound and trot, and the gaits that branch off."""
    at = Citation(AUTHORS, 'Table 12')
    points = {}
    for gait, name, line, (alpha, gamma) in (
            ('pace', 'gamma = delta', 'gamma=delta', (0.3, 0.0)),
            ('bound', 'alpha = beta', 'alpha=beta', (0.0, 0.3))):
        printed = PRINTED['table_12'][gait][1 if name.startswith('gamma') else 0]
        points[gait] = hopf(Quadruped(alpha, alpha, gamma, gamma), line, gait, -0.35, -0.2)
        yield at.number(f'{gait}: {name} at the Hopf point', printed, points[gait].value,
                        within=APPROXIMATE_TOLERANCE * abs(float(printed)),
                        note='the table says approximate; the other coupling as printed')
    alpha, gamma, xi = (float(row) for row in PRINTED['table_12']['trot'])
    sample = stand_sample(Quadruped(alpha, alpha, gamma, gamma, xi, xi))
    leading = max(sample.largest(name) for name in sample.blocks)
    yield at.number('trot: leading real part of the stand at the couplings printed', '0.00',
                    leading, within=0.1, erratum=(6, '-0.449'))
    alpha, gamma, xi = TROT
    for n, (name, line) in enumerate((('alpha = beta', 'alpha=beta'),
                                      ('gamma = delta', 'gamma=delta'), ('xi = eta', 'xi=eta'))):
        near = TROT[n]
        point = hopf(Quadruped(alpha, alpha, gamma, gamma, xi, xi), line, 'trot', near - 0.05,
                     near + 0.05)
        yield at.number(f'trot: {name} at the Hopf point', PRINTED['table_12']['trot'][n],
                        point.value, erratum=(6, f'{near:g}'),
                        note=f'the others at {alpha}, {gamma}, {xi}')
        points['trot'] = point
    for gait, point in points.items():
        yield at.word(f'{gait}: Hopf bifurcation, by the other eigenvalues', 'stable',
                      'stable' if point.stable else 'unstable',
                      note=f'leading one {point.leading_other:.4f}')
        yield Citation(AUTHORS, 'Proposition 5.5' if gait != 'trot' else 'Lemma 5.8').word(
            f'{gait}: the solution that branches off at Table 12', 'stable',
            'stable' if point.stable and point.supercritical else 'unstable',
            erratum=(22, 'unstable'),
            note=f'first Lyapunov coefficient {point.lyapunov:.3f}')


def theorem_4_2() -> Iterator[ReproducedRow | Picture]:
    """Theorem 4.2 at computed Hopf points, and the numbers of its proofs."""
    points: dict[str, HopfPoint] = {}
    for clause, gait, alpha, sign, (low, high), stable in PRINTED['theorem_4_2']:
        point = hopf(Quadruped(alpha, sign * alpha, 0.0, 0.0), 'gamma=delta', gait, low, high)
        points.setdefault(gait, point)
        yield Citation(AUTHORS, f'Theorem 4.2 ({clause})').word(
            f'Hopf bifurcation to the {gait}, alpha {alpha:g}, beta {sign * alpha:g}, gamma '
            f'{point.value:.4f}', 'stable' if stable else 'unstable',
            'stable' if point.stable else 'unstable',
            erratum=(23, 'unstable') if (gait, alpha) == FAILED_PROOF else None,
            note=f'{point.unstable_roots} other eigenvalues with positive real part')
    trot = points['trot']
    sample = stand_sample(trot.network)
    for name, text in PRINTED['proposition_5_5'].items():
        yield Citation(AUTHORS, 'Proposition 5.5').formula(
            f'trace of {name} (real part) at the Hopf point to the trot', text, sample.names,
            sample.trace(name).real)
    for gait, formulas in PRINTED['proposition_5_7'].items():
        sample = stand_sample(points[gait].network)
        names = sample.names | {'X': sample.root('L_10')}
        for name, text in formulas.items():
            # Of the gait's conjugate class, twice the real part that counts.
            ours = (2.0 * sample.largest(name) if name.startswith('L_1')
                    else sample.trace(name).real)
            yield Citation(AUTHORS, 'Proposition 5.7').formula(
                f'sigma of {name} at the Hopf point to the {gait}', text, names, ours,
                note='X = sqrt((Phi + sqrt(Phi^2 + Psi^2))/2)')


#: Gait -> sign of beta against alpha, and the signs that alpha and gamma must have; 0 is any.
SIGNS = {'pronk': (1, 1, 1), 'pace': (1, 1, -1), 'bound': (1, -1, 1), 'trot': (1, -1, -1),
         'jump': (-1, 0, 1), 'walk': (-1, 0, -1)}
#: Difference up to which couplings are equal, and eigenvalues on the imaginary axis.
EQUALITY_TOLERANCE = 1e-7


@dataclass(frozen=True)
class TheoremVerdict:
    """The theorem's statement on a Hopf bifurcation.

    Attributes:
        gait: that branches off.
        unmet: hypotheses of the theorem that do not hold, as text.
        condition: on the signs, as text.
        met: whether it holds.
        overlooked: assumptions of the proof that do not hold, as text: the theorem may be wrong
            there.

    """

    gait: str
    unmet: tuple[str, ...]
    condition: str
    met: bool
    overlooked: tuple[str, ...]

    @property
    def applies(self) -> bool:
        """Whether all hypotheses hold."""
        return not self.unmet

    @property
    def stable(self) -> bool | None:
        """Whether the theorem calls the bifurcation stable; None where it does not apply."""
        return self.met if self.applies else None

    def __str__(self) -> str:
        if self.unmet:
            return (f'theorem 4.2 does not apply to this {self.gait}: it requires '
                    f'{", ".join(self.unmet)}')
        text = (f'theorem 4.2: the bifurcation to {self.gait} is '
                f'{"stable" if self.met else "not stable"}, as {self.condition} '
                f'{"holds" if self.met else "does not hold"}')
        if self.overlooked:
            text += f'; but its proof takes for granted that {" and ".join(self.overlooked)}'
        return text


def theorem_verdict(network: Quadruped, gait: str) -> TheoremVerdict:
    """Apply the theorem at a Hopf point of the gait, which is not checked.

    For jump and walk the proof holds only for the rightmost pair of the class ("we always refer
    to the real part of the eigenvalue with greatest real part", corollary 5.4) and for alpha so
    small that the real blocks have complex eigenvalues ("if we choose alpha small enough").
    Where alpha is 0 the cells of a ring are not coupled, classes coincide, and no
    bifurcation is simple.

    Raises:
        InputError: the gait is not one of the six, or a parameter is not finite.
        NoEquilibrium: the network has no stand.

    """
    mirror, along, across = SIGNS[known(gait, tuple(GAITS))]
    required = {'delta = gamma': network.delta - network.gamma,
                'xi = 0': network.xi, 'eta = 0': network.eta,
                'beta = alpha' if mirror > 0 else 'beta = -alpha':
                    network.beta - mirror * network.alpha}
    unmet = [text for text, gap in required.items() if not abs(gap) <= EQUALITY_TOLERANCE]
    if abs(network.alpha) <= EQUALITY_TOLERANCE:
        unmet.append('alpha different from 0')
    signs = [('alpha', along, network.alpha), ('gamma', across, network.gamma)]
    condition = ' and '.join(f'{name} {">" if sign > 0 else "<"} 0'
                             for name, sign, _ in signs if sign)
    holds = all(sign * value > 0.0 for _, sign, value in signs if sign)

    overlooked = []
    split = blocks(network, equilibrium(network))
    if max(block.leading.real for block in split if block.gait == gait) > EQUALITY_TOLERANCE:
        overlooked.append('the critical pair is the rightmost of its class')
    # For beta = alpha all real blocks have the discriminant of the critical one.
    if mirror < 0 and any(block.real and block.leading.imag == 0.0 for block in split):
        overlooked.append('the real blocks have complex eigenvalues')
    return TheoremVerdict(gait, tuple(unmet), condition, holds, tuple(overlooked))


# Buono & Golubitsky (2001), sections 4 and 5: claims of the proofs.

#: Gait -> the line of the proof, the parameter that eq. 5.6 differentiates by, what it multiplies
#: in E = nu + ..., and the Hopf point on the line in units of nu_0.
PROOFS = {'walk': ('gamma=delta=-alpha=-beta', 'gamma=delta', -2.0, 0.5),
          'jump': ('gamma=delta=-alpha=-beta', 'gamma=delta', 2.0, -0.5),
          'pace': ('gamma=delta=-alpha=-beta', 'gamma=delta', -2.0, 0.25),
          'bound': ('gamma=delta=-alpha=-beta', 'gamma=delta', 2.0, -0.25),
          'trot': ('xi=eta=-alpha=-beta', 'xi=eta', 2.0, -0.25)}
#: Step of finite differences for the gradient of nu; distance from its line to which a Hopf point
#: is followed; size above which determinants and speeds are not 0.
DIFFERENCE_STEP, LINE_OFFSET, NONZERO_THRESHOLD = 1e-5, 0.02, 1e-6
#: Real part up to which a critical pair is on the imaginary axis.
AXIS_TOLERANCE = 1e-7
#: Deviations of beta and delta with which it is checked that theorem 4.2 'remains valid if
#: |alpha - beta| and |gamma - delta| are nonzero and small'.
SMALL_DEVIATIONS = (0.004, -0.003)
#: ALPHAS: values of alpha at which Hopf points are searched for; GAMMAS: range of gamma.
ALPHAS, GAMMAS = (-0.3, 0.1), (-1.2, 0.5)


def genericity_matrix(gait: str) -> np.ndarray:
    """Return the matrix of eq. 5.6 for a gait, at the uncoupled stand, shape (3, 3).

    Rows are the gradients of F, G and E by x, y and the gait's coupling.
    """
    sample = stand_sample(UNCOUPLED)
    matrix = np.empty((3, 3))
    matrix[:2, :2] = sample.blocks['L_00'].now.real
    matrix[2, :2] = [
        (_nu(sample.state + step) - _nu(sample.state - step)) / (2.0 * DIFFERENCE_STEP)
        for step in DIFFERENCE_STEP * np.eye(2)]
    matrix[:2, 2], matrix[2, 2] = sample.state, PROOFS[gait][2]
    return matrix


def _nu(state: np.ndarray) -> float:
    return Sample(UNCOUPLED, state).trace('L_00').real


def _on_line(gait: str) -> HopfPoint:
    line, _, _, fraction = PROOFS[gait]
    value = fraction * stand_sample(UNCOUPLED).trace('L_00').real
    return hopf(UNCOUPLED, line, gait, value - 0.05, value + 0.05)


def genericity() -> Iterator[ReproducedRow | Picture]:
    """Eq. 5.6, and Hopf points beyond the lines of the proofs."""
    for gait, (_, free, _, _) in PROOFS.items():
        determinant = float(np.linalg.det(genericity_matrix(gait)))
        theorem = ('section 6', 'easily verified') if gait in ('pace', 'bound', 'trot') else (
            'eq. 5.6', 'generically nonzero')
        yield Citation(AUTHORS, theorem[0]).holds(
            f'{gait}: the determinant of eq. 5.6, of the genericity condition, is not 0',
            abs(determinant) > NONZERO_THRESHOLD, note=f'{theorem[1]}: {determinant:.4f}')
        point = _on_line(gait)
        network = point.network
        assert isinstance(network, Quadruped)
        beside = network.replace(alpha=network.alpha + LINE_OFFSET,
                                 beta=network.beta + LINE_OFFSET)
        start = getattr(network, free.split('=')[0])
        near = hopf(beside, free, gait, start - 4.0 * LINE_OFFSET, start + 4.0 * LINE_OFFSET)
        speed = near.normal_form.k1.real
        yield Citation(AUTHORS, 'Theorem 4.1').holds(
            f'{gait}: a branch of Hopf points leaves the line of the proof, at nonzero speed',
            abs(speed) > NONZERO_THRESHOLD,
            note=f'at alpha = beta = {beside.alpha:.4f}: {free} = {near.value:.4f}, speed '
                 f'{speed:.3f}')


def jump() -> Iterator[ReproducedRow | Picture]:
    """Theorem 4.1 for the jump, 'done in a similar way'."""
    nu, point = stand_sample(UNCOUPLED).trace('L_00').real, _on_line('jump')
    at = Citation(AUTHORS, 'Theorem 4.1')
    yield at.formula('jump: gamma at the Hopf point, gamma=delta=-alpha=-beta', '-nu_0/2',
                     {'nu_0': nu}, point.value, note='where sigma_10 = nu + 2 gamma vanishes')
    yield at.word('jump: gait of the class whose eigenvalues cross', 'jump', point.gait)
    yield at.formula('jump: speed at which the eigenvalues cross', '2', {},
                     point.normal_form.k1.real, erratum=(13, '1'))


def stable_points() -> Iterator[ReproducedRow | Picture]:
    """Theorem 4.3: the Hopf points of the proof are stable; the trot's by Lemma 5.8."""
    nu = stand_sample(UNCOUPLED).trace('L_00').real
    at = Citation(AUTHORS, 'Theorem 4.3')
    # alpha = gamma = nu_0/8, so that -(alpha + gamma) = -nu_0/4.
    eighth = nu / 8.0
    trot = hopf(Quadruped(eighth, eighth, eighth, eighth), 'xi=eta', 'trot', -nu / 4.0 - 0.05,
                -nu / 4.0 + 0.05)
    yield at.formula('trot: xi at the Hopf point, alpha = gamma = nu_0/8', '-nu_0/4', -nu / 4.0,
                     trot.value)
    yield Citation(AUTHORS, 'Lemma 5.8').holds(
        'trot: alpha_0 < 0, gamma_0 < 0 and xi_0 > alpha_0/2 there',
        eighth < 0.0 and trot.value > eighth / 2.0)
    for gait, point in (('pace', _on_line('pace')), ('bound', _on_line('bound')), ('trot', trot)):
        yield at.word(f'{gait}: Hopf bifurcation at the point of the proof', 'stable',
                      'stable' if point.stable else 'unstable',
                      note=f'leading other eigenvalue {point.leading_other:.4f}')


def near_equal() -> Iterator[ReproducedRow | Picture]:
    """Theorem 4.2 where alpha and beta, gamma and delta differ a little."""
    for clause, gait, alpha, sign, (low, high), stable in PRINTED['theorem_4_2']:
        if not stable or (gait, alpha) == FAILED_PROOF:
            continue
        first = hopf(Quadruped(alpha, sign * alpha, 0.0, 0.0), 'gamma=delta', gait, low, high)
        beta, delta = sign * alpha + SMALL_DEVIATIONS[0], first.value + SMALL_DEVIATIONS[1]
        point = hopf(Quadruped(alpha, beta, 0.0, delta), 'gamma', gait, first.value - 0.05,
                     first.value + 0.05)
        yield Citation(AUTHORS, f'Theorem 4.2 ({clause})').word(
            f'remains valid near: Hopf bifurcation to the {gait}, alpha {alpha:g}, beta '
            f'{beta:.4f}, gamma {point.value:.4f}, delta {delta:.4f}', 'stable',
            'stable' if point.stable else 'unstable',
            note=f'alpha + beta {alpha + beta:+.3f}, gamma + delta {point.value + delta:+.3f}')


def necessary_and_sufficient() -> Iterator[ReproducedRow | Picture]:
    """Theorem 4.2 at all Hopf points with gamma = delta for some alpha = beta, or -beta."""
    points = {mirror: [(alpha, point) for alpha in ALPHAS for point in hopf_points(
        Quadruped(alpha, mirror * alpha, 0.0, 0.0), 'gamma=delta', *GAMMAS)]
        for mirror in (1, -1)}
    for gait, (mirror, along, across) in SIGNS.items():
        agreed = [(along * alpha >= 0.0 and across * point.value > 0.0, point.stable)
                  for alpha, point in points[mirror] if point.gait == gait
                 # 'We always refer to the eigenvalue with greatest real part' (section 5.3).
                  and point.block.roots(2).real.max() < AXIS_TOLERANCE]
        otherwise = sum(predicted != stable for predicted, stable in agreed)
        yield Citation(AUTHORS, 'Theorem 4.2').holds(
            f'{gait}: the conditions are necessary and sufficient at equal couplings',
            bool(agreed) and not otherwise, erratum=23 if mirror < 0 else None,
            note=f'{len(agreed)} Hopf points, {sum(stable for _, stable in agreed)} of them '
                 f'stable, {otherwise} otherwise than by the conditions')


# Tables 6 to 11 of Buono & Golubitsky (2001) exactly as printed, for linear synaptic coupling.
