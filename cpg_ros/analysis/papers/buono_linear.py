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

"""Buono & Golubitsky (2001), section 5.2: Tables 5 to 11, formulas against the linearisation.

The formulas are compared as printed with the blocks of the network's Jacobian, at a random state
with equal cells and random couplings, so that no formula holds by chance.
"""

from collections.abc import Iterator
from dataclasses import replace
from typing import Any

from cpg_ros.analysis.papers.buono_gaits import AUTHORS, PRINTED
from cpg_ros.analysis.papers.row import Citation, Picture, ReproducedRow, Value, value_of
from cpg_ros.dynamics.equilibrium import everywhere
from cpg_ros.dynamics.isotypic import Block, blocks
from cpg_ros.networks.library.quadruped import Quadruped
import numpy as np

# Tables 6 to 11 of Buono & Golubitsky (2001) exactly as printed, for linear synaptic coupling.

def square_root(phi: float, psi: float) -> complex:
    """Return the square root of ``phi + i psi`` as in eq. 5.3, which holds for psi >= 0 only."""
    size = np.hypot(phi, psi)
    return complex(np.sqrt((phi + size) / 2.0), np.sqrt((size - phi) / 2.0))


#: X of Propositions 5.2 and 5.7.
ROOT = 'sqrt((Phi + sqrt(Phi^2 + Psi^2))/2)'
UNCOUPLED = Quadruped(0.0, 0.0, 0.0, 0.0)
#: STAND: v and w at the stand of section 6, approximately.
STAND = np.array([0.31, 0.52])


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
    return Sample(network, STAND + rng.uniform(-0.05, 0.05, 2))


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
