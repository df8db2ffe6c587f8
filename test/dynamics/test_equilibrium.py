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

"""Stands against scipy on all equations, and blocks against the whole linearisation."""

from dataclasses import replace

from cpg_ros.analysis.papers.buono_hopf import PRINTED, Sample, square_root
from cpg_ros.dynamics.equilibrium import equilibria, equilibrium, NoEquilibrium
from cpg_ros.dynamics.isotypic import blocks, everywhere, group_of
from cpg_ros.networks.library.biped import Biped
from cpg_ros.networks.library.quadruped import Quadruped
from depth import examples
from hypothesis import given
from hypothesis import strategies as st
import numpy as np
import pytest
from scipy.optimize import fsolve

COUPLINGS = st.builds(Quadruped, *[st.floats(-0.4, 0.4)] * 6)
BIPEDS = st.builds(Biped.symmetric, st.floats(0.15, 0.6), st.floats(0.05, 1.0),
                   *[st.floats(-1.0, 1.0)] * 3)


def apart(found, wanted):
    """Largest distance of each wanted number to the found one that is left for it."""
    found, gaps = list(found), []
    for one in wanted:
        gaps.append(min(abs(np.array(found) - one)))
        found.pop(int(np.abs(np.array(found) - one).argmin()))
    return max(gaps)


def alone(state):
    """Linearisation of an uncoupled cell, shape (2, 2)."""
    network = Quadruped(0.0, 0.0, 0.0, 0.0)
    return network.jacobian(everywhere(network, state))[::8, ::8]


def scalar_roots(network):
    """Stands' v for the quadruped from the equations of section 6, w eliminated by hand."""
    v = np.linspace(-2.0, 2.0, 400_001)
    m, n = (1 + np.tanh((v - 0.2) / 0.4)) / 2, (1 + np.tanh((v - 0.3) / 0.2)) / 2
    speed = 0.2 * np.cosh((v - 0.3) / 0.4)
    w = speed * n / (speed - network.beta - network.delta - network.eta)
    rest = (-3.0 * m * (v - 1) - 0.6 * (v + 1.8) - 1.8 * w * (v + 0.8) + 1
            + (network.alpha + network.gamma + network.xi) * v)
    jumps = np.flatnonzero((rest[1:] * rest[:-1] < 0) & (np.abs(np.diff(rest)) < 0.1))
    return v[jumps]


@pytest.mark.parametrize('network', [Quadruped(0, 0, 0, 0), Quadruped(0.2, 0.2, -0.2, -0.2),
                                     Quadruped(-0.15, -0.15, -0.16, -0.16, 0.31, 0.31)])
def test_the_stand_of_the_paper(network):
    # Section 6, to more digits; where the couplings add up to nothing it does not move.
    state = equilibrium(network)
    assert state == pytest.approx([0.3096, 0.5240], abs=5e-5)
    assert np.trace(alone(state)) == pytest.approx(-1.2407, abs=5e-5)


@examples(40)
@given(COUPLINGS)
def test_stands_are_all_equilibria_with_equal_cells(network):
    found = equilibria(network)
    assert np.abs(network.rates(everywhere(network, found))).max(initial=0.0) < 1e-9
    inside = found[np.abs(found[:, 0]) < 2.0]
    wanted = scalar_roots(network)
    assert len(inside) >= len(wanted)
    assert all(np.abs(inside[:, 0] - v).min() < 2e-5 for v in wanted)


@examples(25)
@given(COUPLINGS)
def test_the_stand_is_followed_from_the_uncoupled_cells(network):
    # Small steps of fsolve on all sixteen equations.
    state, fractions = np.repeat([0.30962696, 0.52404883], 8), np.linspace(0.0, 1.0, 401)
    for fraction in fractions:
        part = Quadruped(*(fraction * value for value in network.as_dict().values()))
        new, _, ok, _ = fsolve(part.rates, state, fprime=part.jacobian, full_output=True)
        lost = ok != 1 or np.abs(new - state).max() > 0.05 * (1.0 + np.abs(state).max())
        if lost:
            with pytest.raises(NoEquilibrium, match='the equilibrium is lost'):
                equilibrium(network)
            return
        state = new
    assert np.abs(everywhere(network, equilibrium(network)) - state).max() < 1e-8


def test_a_fold_is_told():
    with pytest.raises(NoEquilibrium,
                       match=r'lost in a fold at 0\.785[67] of the couplings, v -0\.48'):
        equilibrium(Quadruped(0.3, 0.3, 0.6, 0.6))
    # alpha + gamma = 0.7071: two equilibria vanish there.
    before, after = (scalar_roots(Quadruped(0.3, 0.3, gamma, gamma)) for gamma in (0.407, 0.4072))
    assert len(before) - len(after) == 2 and np.abs(before + 0.486).min() < 0.02


def test_the_biped_stands_where_its_cells_do():
    network = Biped.symmetric(0.229, 0.254, 0.390, -0.681, 0.489)
    alone = Biped.symmetric(0.229, 0.254, 0.0, 0.0, 0.0)
    assert np.abs(equilibrium(network) - equilibrium(alone)).max() < 1e-12
    found = fsolve(network.rates, np.repeat([0.05, 0.3], 4), fprime=network.jacobian)
    assert np.abs(everywhere(network, equilibrium(network)) - found).max() < 1e-9
    with pytest.raises(NoEquilibrium, match='an uncoupled cell has 3 equilibria'):
        equilibrium(replace(network, current=0.095))
    with pytest.raises(ValueError, match='phi is nan'):
        equilibrium(replace(network, phi=np.nan))


@examples(40)
@given(st.one_of(COUPLINGS, BIPEDS))
def test_blocks_split_the_linearisation(network):
    for state in equilibria(network):
        whole = network.jacobian(everywhere(network, state))
        split = blocks(network, state)
        for block in split:
            for column in np.eye(2):
                assert np.allclose(whole @ np.kron(column, block.vector),
                                   np.kron(block.now @ column, block.vector), 0.0,
                                   1e-12 * np.abs(whole).max())
            # The gait's own symmetry: x_i(t) = x_1(t + phase T), whatever way the wave runs.
            gait = network.symmetry(block.gait)
            turned = np.exp(2j * np.pi * gait.phases)
            assert np.allclose(turned, block.vector) or np.allclose(turned, block.vector.conj())
        assert len({block.mode for block in split}) == network.cells
        found = np.concatenate([block.roots(2) for block in split])
        wanted = np.linalg.eigvals(whole)
        assert apart(found, wanted) < 1e-6 * np.abs(whole).max()
        assert max(block.leading.real for block in split) == pytest.approx(wanted.real.max(),
                                                                           abs=1e-7)


def test_unequal_weights_leave_the_classes_of_what_symmetry_is_left():
    whole = Biped.symmetric(0.229, 0.254, 0.39, -0.681, 0.489)
    for network, group in ((replace(whole, w_12=0.3, w_34=0.3), ['1', 'tau']),
                           (replace(whole, w_12=0.3), ['1'])):
        assert list(group_of(network).elements) == group
        rest = everywhere(network, equilibrium(network))
        assert np.abs(network.rates(rest)).max() < 1e-12
        split = blocks(network, rest)
        assert len(split) == len(group)
        found = np.concatenate([block.roots(8) for block in split])
        assert apart(found, np.linalg.eigvals(network.jacobian(rest))) < 1e-9


@examples(40)
@given(COUPLINGS)
def test_printed_tables_and_what_is_wrong_in_them(network):
    # At any state: none of it needs a stand.
    state = np.array([0.2, 0.4])
    sample = Sample(network, state)
    assert np.allclose(sample.names['A'], alone(state))
    for name, block in sample.blocks.items():
        matrix, printed = block.now, {table: sample.printed(PRINTED[table][name]) for table in (
            'table_6', 'table_7', 'table_8', 'table_9', 'table_10') if name in PRINTED[table]}
        trace, determinant = np.trace(matrix), np.linalg.det(matrix)
        under = trace**2 - 4.0 * determinant
        assert np.allclose(printed['table_6'], matrix)
        if not block.real:
            assert printed['table_9'] + 1j * printed['table_10'] == pytest.approx(under)
            # Eq. 5.3 is a root for a positive imaginary part only.
            if abs(under.imag) > 1e-3:
                good = abs(square_root(under.real, under.imag)**2 - under) < 1e-9
                assert good == (under.imag > 0.0)
            # Eqs. 5.4 and 5.5 lack the factor 1/2.
            middle = sample.printed(PRINTED['proposition_5_2'][block.mode[1]])
            assert np.allclose([middle + sample.root(name), middle - sample.root(name)],
                               2.0 * np.sort(block.roots(2).real)[::-1], 0.0, 1e-6)
            continue
        assert printed['table_8'] == pytest.approx(under.real)
        # Table 7, L_21: xi + eta has the wrong sign.
        wrong = 2.0 * (network.xi + network.eta) if block.mode == (2, 1) else 0.0
        assert printed['table_7'] == pytest.approx(trace.real - wrong)


@examples(20)
@given(*[st.floats(-0.4, 0.4)] * 3)
def test_table_11_is_twice_the_real_part(alpha, gamma, xi):
    network, state = Quadruped(alpha, alpha, gamma, gamma, xi, xi), np.array([0.31, 0.52])
    sample = Sample(network, state)
    for name, text in PRINTED['table_11'].items():
        assert np.allclose(sample.printed(text), 2.0 * sample.blocks[name].roots(2).real)
