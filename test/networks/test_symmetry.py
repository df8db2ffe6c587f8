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

"""Symmetry groups of the networks: subgroups, admissible pairs, gaits as homomorphisms."""

from fractions import Fraction
from itertools import chain, combinations, product
from math import gcd

from cpg_ros.networks.symmetry import (
    admissible_pairs,
    D2,
    Group,
    label,
    subgroups,
    symmetries,
    Symmetry,
    Z4_Z2,
)
from depth import examples
from hypothesis import given
from hypothesis import strategies as st
import numpy as np
import pytest
from rhythm import BIPED, GROUPS, QUADRUPED, seeds, Z6


def times(a, b):
    """Return the permutation a after b."""
    return tuple(a[i] for i in b)


def closed_subsets(group):
    """All subsets of the group's permutations that are closed, found by trying every subset."""
    elements = list(group.elements.values())
    every = chain.from_iterable(combinations(elements, n) for n in range(1, len(elements) + 1))
    return {frozenset(subset) for subset in every
            if all(times(a, b) in subset for a in subset for b in subset)}


def permutations_of(group, names):
    return frozenset(group.elements[name] for name in names)


def is_cyclic(h, k):
    """Whether some element needs as many steps to come back into k as there are cosets."""
    for element in h:
        power, steps = element, 1
        while power not in k:
            power, steps = times(power, element), steps + 1
        if steps * len(k) == len(h):
            return True
    return False


@pytest.mark.parametrize(('group', 'count'), [(Z4_Z2, 8), (D2, 5), (Z6, 4)])
def test_subgroups_are_all_the_closed_subsets(group, count):
    found = subgroups(group)
    assert len(found) == len(set(found)) == count
    assert {permutations_of(group, names) for names in found} == closed_subsets(group)
    order = list(group.elements)
    assert all(sorted(names, key=order.index) == list(names) for names in found)


def test_labels():
    assert {label(Z4_Z2, names) for names in subgroups(Z4_Z2)} == {
        '1', '<kappa>', '<omega^2>', '<omega^2 kappa>', '<omega^2, kappa>', '<omega>',
        '<omega kappa>', '<omega, kappa>'}
    assert {label(D2, names) for names in subgroups(D2)} == {
        '1', '<tau>', '<rho>', '<rho tau>', '<rho, tau>'}
    for group in GROUPS:
        for names in subgroups(group):
            members = permutations_of(group, names)
            text = label(group, names).strip('<>')
            generating = permutations_of(group, text.split(', '))
            # The smallest closed set with the generators in it, and no fewer generators do.
            assert min((s for s in closed_subsets(group) if generating <= s), key=len) == members
            for fewer in combinations(members, len(text.split(', ')) - 1):
                assert any(set(fewer) <= s < members for s in closed_subsets(group)) or not fewer


# A pair with a given H is a cyclic subgroup of H's dual: 1 for the trivial group, 2 for Z2, 3 for
# Z4, 4 for Z2 x Z2 and Z6, 6 for Z4 x Z2. So 1 + 3*2 + (4 + 2*3) + 6, 1 + 3*2 + 4, 1 + 2 + 2 + 4.
@pytest.mark.parametrize(('group', 'count'), [(Z4_Z2, 23), (D2, 11), (Z6, 9)])
def test_admissible_pairs_by_brute_force(group, count):
    subsets = closed_subsets(group)
    wanted = {(h, k) for h, k in product(subsets, repeat=2) if k <= h and is_cyclic(h, k)}
    pairs = admissible_pairs(group)
    assert len(pairs) == len(wanted) == count
    assert {(permutations_of(group, p.h), permutations_of(group, p.k)) for p in pairs} == wanted
    for pair in pairs:
        assert pair.labels == (label(group, pair.h), label(group, pair.k))
        assert pair.order * len(pair.k) == len(pair.h)
        for names, images in ((pair.h, pair.waveforms), (pair.k, pair.signals)):
            # Cells that no element of the subgroup takes to one another.
            assert images == len({frozenset(group.elements[name][cell] for name in names)
                                  for cell in range(group.cells)})


def test_the_theorem_leaves_out_a_quotient_that_is_not_cyclic():
    pairs = {pair.labels for pair in admissible_pairs(Z4_Z2)}
    assert ('<omega, kappa>', '<omega kappa>') in pairs  # the trot: Buono & Golubitsky, 2.1
    assert ('<omega, kappa>', '<omega^2>') not in pairs
    assert ('<omega, kappa>', '1') not in pairs
    assert ('<omega^2, kappa>', '1') not in pairs


def test_groups_that_the_theorem_is_not_about():
    with pytest.raises(ValueError, match='2 symmetries of 4 cells'):
        admissible_pairs(Group(4, (('rho', (1, 0, 3, 2)),)))
    with pytest.raises(ValueError, match='2 symmetries of 3 cells'):
        admissible_pairs(Group(3, (('swap', (1, 0, 2)),)))
    with pytest.raises(ValueError, match='not abelian'):
        # The symmetries of a triangle, on six cells.
        admissible_pairs(Group(6, (('turn', (1, 2, 0, 4, 5, 3)), ('flip', (3, 5, 4, 0, 2, 1)))))


@pytest.mark.parametrize(('group', 'count'), [(Z4_Z2, 27), (D2, 11), (Z6, 12)])
def test_symmetries_are_all_the_homomorphisms_into_the_circle(group, count):
    found = symmetries(group)
    # As many as H has elements, for every H.
    assert len(found) == count == sum(len(names) for names in subgroups(group))
    size = 12 if group is Z6 else 4
    for names in subgroups(group):
        place = {group.elements[name]: n for n, name in enumerate(names)}
        sums = [(place[a], place[b], place[times(a, b)]) for a in place for b in place]
        wanted = set()
        if len(names) <= 4:
            # Every choice of shifts that are multiples of 1/4 (of 1/12 for six cells).
            wanted = {choice for choice in product(range(size), repeat=len(names))
                      if all((choice[a] + choice[b] - choice[c]) % size == 0
                             for a, b, c in sums)}
        shifts = [one.shifts for one in found if one.h == names]
        given_here = {tuple(int(shift * size) for _, shift in one) for one in shifts}
        assert len(given_here) == len(shifts) == len(names)
        assert given_here == wanted or len(names) > 4
        for choice in given_here:
            assert all((choice[a] + choice[b] - choice[c]) % size == 0 for a, b, c in sums)


@pytest.mark.parametrize('group', GROUPS)
def test_every_pair_has_phi_of_m_symmetries(group):
    for pair in admissible_pairs(group):
        own = [one for one in symmetries(group) if (one.h, one.k) == (pair.h, pair.k)]
        phi = sum(gcd(n, pair.order) == 1 for n in range(1, pair.order + 1))
        assert len(own) == phi
        assert all(one.order == pair.order for one in own)
        assert all(one.waves.max() + 1 == pair.waveforms for one in own)
        assert all(one.classes.max() + 1 == pair.signals for one in own)


# Buono & Golubitsky (2001), Tables 1 and 2: mode (j, k), phases of LH, RH, LF, RF, which are
# cells 1 to 4. Of +- the paper has + and our gaits -.
@pytest.mark.parametrize(('gait', 'j', 'k', 'phases'), [
    ('pronk', 0, 0, (0, 0, 0, 0)), ('pace', 0, 1, (0, 0.5, 0, 0.5)),
    ('bound', 2, 0, (0, 0, 0.5, 0.5)), ('trot', 2, 1, (0, 0.5, 0.5, 0)),
    ('jump', 1, 0, (0, 0, 0.25, 0.25)), ('walk', 1, 1, (0, 0.5, 0.25, 0.75))])
def test_primary_gaits_of_the_quadruped(gait, j, k, phases):
    own = QUADRUPED[gait]
    paper = Symmetry.of(Z4_Z2, {'omega': Fraction(j, 4), 'kappa': Fraction(k, 2)})
    assert np.allclose(paper.phases[:4], phases)
    assert np.allclose(own.phases, -paper.phases % 1.0)
    for one in (paper, own):
        assert not one.waves.any()
        assert one.h == tuple(Z4_Z2.elements)
        assert one.k == paper.k
        # The eigenvector (1, (-1)^k, i^j, (-1)^k i^j, ...), or its conjugate.
        vector = np.exp(2j * np.pi * (one.phases if one is paper else -one.phases))
        cells = np.arange(8)
        assert np.allclose(vector, 1j ** (j * (cells // 2)) * (-1.0) ** (k * (cells % 2)))


@pytest.mark.parametrize(('gait', 'h', 'k'), [
    # Rashidi et al. (2016), Table 5: D is the whole group, I the trivial one.
    ('walk', 'D', 'rho tau'), ('run', 'D', 'tau'), ('jump', 'D', 'rho'), ('hop', 'D', 'D'),
    ('skip', 'rho', 'I'), ('gallop', 'tau', 'I'), ('hesitation_walk', 'rho tau', 'I'),
    # Not in that table; from the waveforms of Table 4.
    ('asymmetric_hop', 'rho tau', 'rho tau'), ('one_legged_hop', 'tau', 'tau')])
def test_h_and_k_of_the_biped(gait, h, k):
    names = {'D': {'1', 'rho', 'tau', 'rho tau'}, 'I': {'1'}}
    assert set(BIPED[gait].h) == names.get(h, {'1', h})
    assert set(BIPED[gait].k) == names.get(k, {'1', k})


@pytest.mark.parametrize(('gait', 'waves', 'phases'), [
    # Rashidi et al. (2016), Tables 4 and 5.
    ('walk', (1, 1, 1, 1), (0, 0.5, 0.5, 0)), ('run', (1, 1, 1, 1), (0, 0.5, 0, 0.5)),
    ('jump', (1, 1, 1, 1), (0, 0, 0.5, 0.5)), ('hop', (1, 1, 1, 1), (0, 0, 0, 0)),
    ('skip', (1, 1, 2, 2), (0, 0.5, 0, 0.5)), ('gallop', (1, 2, 1, 2), (0, 0, 0.5, 0.5)),
    ('hesitation_walk', (1, 2, 2, 1), (0, 0, 0.5, 0.5)),
    ('asymmetric_hop', (1, 2, 2, 1), (0, 0, 0, 0)),
    ('one_legged_hop', (1, 2, 1, 2), (0, 0, 0, 0))])
def test_waveforms_and_phases_of_the_biped(gait, waves, phases):
    assert tuple(BIPED[gait].waves + 1) == waves
    assert tuple(BIPED[gait].phases) == phases


@pytest.mark.parametrize('gait', BIPED)
def test_the_first_cell_of_each_waveform(gait):
    waves = BIPED[gait].waves.tolist()
    assert BIPED[gait].first.tolist() == [waves.index(wave) for wave in sorted(set(waves))]


@pytest.mark.parametrize(('name', 'modulo', 'order'), [
    ('1', ('1',), 1), ('omega', ('1',), 4), ('omega^2', ('1',), 2), ('omega kappa', ('1',), 4),
    ('omega', ('1', 'omega^2'), 2), ('omega', ('1', 'omega^2 kappa'), 4),
    ('omega kappa', ('1', 'kappa'), 4), ('omega', tuple(Z4_Z2.elements), 1)])
def test_orders_of_elements(name, modulo, order):
    assert Z4_Z2.order(name, modulo) == order


def test_two_waveforms_are_possible_in_six_ways_and_one_in_four():
    # Rashidi et al., section 5: four primary gaits, and six responses with two waveforms.
    counts = [one.waves.max() + 1 for one in symmetries(D2)]
    assert (counts.count(1), counts.count(2)) == (4, 6)


@examples(40)
@given(st.sampled_from([one for group in GROUPS for one in symmetries(group)]), seeds)
def test_waves_and_phases_have_the_symmetry(symmetry, seed):
    grid = np.arange(60) / 60
    draw = np.random.default_rng(seed)
    series = draw.standard_normal((symmetry.group.cells, 4, 2)) @ [1, 1j]

    def cells(phases):
        turns = np.exp(2j * np.pi * np.outer(phases, np.arange(1, 5)))
        return np.stack([(turns * np.exp(2j * np.pi * phase * np.arange(1, 5)) @ series[wave]).real
                         for wave, phase in zip(symmetry.waves, symmetry.phases, strict=True)])

    for name, shift in symmetry.shifts:
        image = list(symmetry.group.elements[name])
        assert np.allclose(cells(grid)[image], cells(grid + float(shift)))
    shifts = dict(symmetry.shifts)
    names = {element: name for name, element in symmetry.group.elements.items()}
    for a, b in product(symmetry.h, repeat=2):
        together = names[times(symmetry.group.elements[a], symmetry.group.elements[b])]
        assert shifts[together] == (shifts[a] + shifts[b]) % 1
