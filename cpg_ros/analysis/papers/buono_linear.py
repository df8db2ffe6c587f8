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
from dataclasses import dataclass, replace

from cpg_ros.analysis.papers.buono_gaits import AUTHORS, PRINTED
from cpg_ros.analysis.papers.row import Citation, Picture, ReproducedRow
from cpg_ros.dynamics.equilibrium import everywhere
from cpg_ros.dynamics.isotypic import Block, blocks
from cpg_ros.networks.library.quadruped import Quadruped
import numpy as np

# Tables 6 to 11 of Buono & Golubitsky (2001) exactly as printed, for linear synaptic coupling.

#: Table 6: L_jk = A + sum of these multiples of B, C and D.
TABLE_6_FACTORS = {(0, 0): (1, 1, 1), (0, 1): (1, -1, 1), (2, 0): (-1, 1, 1), (2, 1): (-1, -1, 1),
           (1, 0): (-1j, 1, -1), (1, 1): (-1j, -1, -1), (3, 0): (1j, 1, -1),
           (3, 1): (1j, -1, -1)}
#: Table 7: signs of alpha + beta, gamma + delta and xi + eta in the trace. The last sign of L_21
#: contradicts Tables 6, 8 and 11: it should be +1.
TABLE_7 = {(0, 0): (1, 1, 1), (0, 1): (1, -1, 1), (2, 0): (-1, 1, 1), (2, 1): (-1, -1, -1)}
#: Table 8: signs of alpha - beta, gamma - delta and xi - eta in D_jk.
TABLE_8 = {(0, 0): (1, 1, 1), (0, 1): (1, -1, 1), (2, 0): (-1, 1, 1), (2, 1): (-1, -1, 1)}
#: Table 11: multiples of alpha, gamma and xi that are added to nu.
TABLE_11_FACTORS = {(0, 0): (2, 2, 2), (0, 1): (2, -2, 2), (2, 0): (-2, 2, 2), (2, 1): (-2, -2, 2),
            (1, 0): (0, 2, -2), (1, 1): (0, -2, -2)}


@dataclass(frozen=True)
class Tables:
    """The tables' entries for a network.

    Attributes:
        network: couplings.
        a, b, c, d: A, the derivatives of an uncoupled cell's rates at the stand.

    """

    network: Quadruped
    a: float
    b: float
    c: float
    d: float

    @classmethod
    def at(cls, network: Quadruped, linearisation: np.ndarray) -> 'Tables':
        """Take a, b, c, d from the linearisation of an uncoupled cell at the stand, (2, 2)."""
        return cls(network, *(float(entry) for entry in linearisation.ravel()))

    @property
    def _sums(self) -> np.ndarray:
        n = self.network
        return np.array([n.alpha + n.beta, n.gamma + n.delta, n.xi + n.eta])

    @property
    def _differences(self) -> np.ndarray:
        n = self.network
        return np.array([n.alpha - n.beta, n.gamma - n.delta, n.xi - n.eta])

    @property
    def nu(self) -> float:
        """Trace of A."""
        return self.a + self.d

    @property
    def determinant(self) -> float:
        """Determinant of A, the paper's Delta."""
        return self.a * self.d - self.b * self.c

    def block(self, j: int, k: int) -> np.ndarray:
        """Table 6: L_jk, shape (2, 2)."""
        n = self.network
        coupled = np.array([[n.alpha, n.beta], [n.gamma, n.delta], [n.xi, n.eta]])
        return np.array([[self.a, self.b], [self.c, self.d]]) + np.diag(
            np.array(TABLE_6_FACTORS[j, k]) @ coupled)

    def trace(self, j: int, k: int) -> float:
        """Table 7: trace of a real block."""
        return float(self.nu + np.dot(TABLE_7[j, k], self._sums))

    def discriminant(self, j: int, k: int) -> float:
        """Table 8: D_jk of a real block, ``(tr L_jk)^2 - 4 det L_jk``."""
        first = self.a - self.d + np.dot(TABLE_8[j, k], self._differences)
        return float(first**2 + 4.0 * self.b * self.c)

    def phi(self, j: int, k: int) -> float:
        """Table 9: real part of ``(tr L_jk)^2 - 4 det L_jk`` of a complex block, j = 1 or 3."""
        along, across, ring = self._differences
        whole, apart = self.nu**2 - 4.0 * self.determinant - along**2, 2.0 * (self.a - self.d)
        if k == 0:
            return float(whole + (across - ring) * (apart + across - ring))
        return float(whole + (across + ring) * (across + ring - apart))

    def psi(self, j: int, k: int) -> float:
        """Table 10: imaginary part of ``(tr L_jk)^2 - 4 det L_jk`` of a complex block."""
        along, across, ring = self._differences
        sign = {1: -2.0, 3: 2.0}[j]
        return float(sign * along * (self.a - self.d + (across if k == 0 else -across) - ring))

    def sigma(self, j: int, k: int) -> float:
        """Table 11: "real part of the eigenvalue" where alpha = beta, gamma = delta, xi = eta.

        It is the trace, twice the real part of either eigenvalue.
        """
        n = self.network
        return float(self.nu + np.dot(TABLE_11_FACTORS[j, k], [n.alpha, n.gamma, n.xi]))

    def real_parts(self, k: int) -> tuple[float, float]:
        """Proposition 5.2, eqs. 5.4 and 5.5: real parts in the component U_1k, the larger first.

        Twice the real parts: the factor 1/2 of the quadratic formula is missing.
        """
        _, across, ring = self._sums
        trace = self.nu + (across if k == 0 else -across) - ring
        phi, psi = self.phi(1, k), self.psi(1, k)
        root = np.sqrt((phi + np.hypot(phi, psi)) / 2.0)
        return float(trace + root), float(trace - root)


def square_root(phi: float, psi: float) -> complex:
    """Return the square root of ``phi + i psi`` as in eq. 5.3, which holds for psi >= 0 only."""
    size = np.hypot(phi, psi)
    return complex(np.sqrt((phi + size) / 2.0), np.sqrt((size - phi) / 2.0))


UNCOUPLED = Quadruped(0.0, 0.0, 0.0, 0.0)
#: STAND: v and w at the stand of section 6, approximately.
STAND = np.array([0.31, 0.52])


class Sample:
    """Couplings, a state of all cells, the blocks of the linearisation, and the tables there.

    Attributes:
        network: the couplings.
        state: (v, w) of every cell.
        blocks: by their name.
        tables: the printed formulas.

    """

    def __init__(self, network: Quadruped, state: np.ndarray) -> None:
        self.network, self.state = network, state
        self.blocks: dict[str, Block] = {block.name: block for block in blocks(network, state)}
        alone = blocks(UNCOUPLED, state)[0]
        self.tables = Tables.at(network, alone.now.real)

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


def _signed(signs: tuple[int, ...], operator: str) -> str:
    pairs = (('alpha', 'beta'), ('gamma', 'delta'), ('xi', 'eta'))
    return ' '.join(f'{"+" if sign > 0 else "-"} ({a} {operator} {b})'
                    for sign, (a, b) in zip(signs, pairs, strict=True))


def tables() -> Iterator[ReproducedRow | Picture]:
    """Tables 6 to 10, and the eigenvalues that the paper derives from them."""
    sample = drawn()
    printed, parts = sample.tables, sample.blocks
    for name, text in PRINTED['table_6'].items():
        yield Citation(AUTHORS, 'Table 6').formula(name, text, printed.block(*parts[name].mode),
                                                   parts[name].now)
    for (j, k), signs in TABLE_7.items():
        name, trace, n = f'L_{j}{k}', printed.trace(j, k), sample.network
        yield Citation(AUTHORS, 'Table 7').formula(
            f'trace of {name}', f'(a + d) {_signed(signs, "+")}', trace, sample.trace(name).real,
            erratum=(12, trace + 2.0 * (n.xi + n.eta)) if name == 'L_21' else None)
    for (j, k), signs in TABLE_8.items():
        yield Citation(AUTHORS, 'Table 8').formula(
            f'D of L_{j}{k}', f'((a - d) {_signed(signs, "-")})^2 + 4bc',
            printed.discriminant(j, k), sample.discriminant(f'L_{j}{k}').real)
    for name in ('L_10', 'L_30', 'L_11', 'L_31'):
        mode, whole = parts[name].mode, sample.discriminant(name)
        yield Citation(AUTHORS, 'Table 9').formula(f'Phi of {name}', 'as printed',
                                                   printed.phi(*mode), whole.real)
        yield Citation(AUTHORS, 'Table 10').formula(f'Psi of {name}', 'as printed',
                                                    printed.psi(*mode), whole.imag)
        root = square_root(whole.real, whole.imag)
        yield Citation(AUTHORS, 'eq. 5.3').formula(
            f'square of the root of Phi + i Psi, {name}', 'Phi + i Psi', whole, root**2,
            erratum=(24, whole.conjugate()),
            note=f'Psi is {"positive" if whole.imag > 0.0 else "negative"}')
    for k in (0, 1):
        real = sorted((value.real for value in parts[f'L_1{k}'].roots(2)), reverse=True)
        for text, theirs, ours in zip(('eq. 5.4', 'eq. 5.5'), printed.real_parts(k), real,
                                      strict=True):
            yield Citation(AUTHORS, 'Proposition 5.2').formula(
                f'real part of an eigenvalue in U_1{k}', text, theirs, ours,
                erratum=(13, theirs / 2.0))
            yield Citation(AUTHORS, 'Proposition 5.2').formula(
                f'twice the real part of an eigenvalue in U_1{k}', text, theirs, 2.0 * ours)
        yield Citation(AUTHORS, 'Corollary 5.4').holds(
            f'in U_1{k} one pair lies to the right of the other', real[0] > real[1])


def coupled_variable() -> Iterator[ReproducedRow | Picture]:
    """Compute the variable that delta multiplies in equation 4.4."""
    sample = drawn()
    network, at = sample.network, Citation(AUTHORS, 'eq. 4.4')
    theirs = sample.tables.trace(0, 0)
    # Seen by all cells alike, delta acts on w by way of w; or, as printed, by way of v.
    printed = sample.blocks['L_00'].now + network.delta * np.array([[0, 0], [1, -1]])
    yield at.formula('trace of L_00 if delta multiplies y', 'Table 7', theirs,
                     sample.trace('L_00').real)
    yield at.formula('trace of L_00 if delta multiplies x, as printed', 'Table 7', theirs,
                     float(np.trace(printed).real), erratum=(19, theirs - network.delta))


def equal_couplings() -> Iterator[ReproducedRow | Picture]:
    """Table 11 and Lemma 5.8: alpha = beta, gamma = delta, xi = eta."""
    sample = drawn(equal=True)
    printed, parts = sample.tables, sample.blocks
    at = Citation(AUTHORS, 'Table 11')
    for name, text in PRINTED['table_11'].items():
        value = printed.sigma(*parts[name].mode)
        yield at.formula(f'real part of the eigenvalues of {name}', text, value,
                         sample.largest(name), erratum=(13, value / 2.0))
        yield at.formula(f'twice the real part of the eigenvalues of {name}', text, value,
                         2.0 * sample.largest(name))
    at, n = Citation(AUTHORS, 'Lemma 5.8'), sample.network
    # nu enters each trace once: take it for which tr L_21 vanishes.
    critical = printed.nu - sample.trace('L_21').real
    yield at.formula('nu at which the trace of L_21 vanishes', '2 alpha + 2 gamma - xi',
                     2.0 * n.alpha + 2.0 * n.gamma - n.xi, critical,
                     erratum=(20, 2.0 * (n.alpha + n.gamma - n.xi)))
    for name, text, value, wrong in (
            ('L_00', '4(alpha + gamma)', 4.0 * (n.alpha + n.gamma), None),
            ('L_10', '4 alpha', 4.0 * n.alpha,
             (20, 2.0 * n.alpha + 4.0 * n.gamma - 4.0 * n.xi)),
            ('L_01', '4 alpha, printed of L_10', 4.0 * n.alpha, None),
            ('L_20', '4 gamma', 4.0 * n.gamma, None),
            ('L_11', '2 alpha - 4 xi', 2.0 * n.alpha - 4.0 * n.xi, None),
            ('L_10', '2 alpha + 4 gamma - 4 xi', 2.0 * n.alpha + 4.0 * n.gamma - 4.0 * n.xi,
             None)):
        trace = sample.trace(name).real - printed.nu + critical
        yield at.formula(f'trace of {name} (real part) with that nu', text, value, trace,
                         erratum=wrong)
