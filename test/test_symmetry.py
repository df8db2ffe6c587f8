"""Groups, H/K pairs and gaits as symmetries; and signals recognised by their symmetry."""

from dataclasses import dataclass
from fractions import Fraction
from itertools import chain, combinations, product
from math import gcd

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from cpg_ros.fitting.cycle import mean_cycle
from cpg_ros.fitting.period import find_period
from cpg_ros.fitting.recognise import nearest_gait, recognise
from cpg_ros.networks.pairs import admissible_pairs, label, subgroups, symmetries
from cpg_ros.networks.symmetry import D2, Z4_Z2, Group, Symmetry

Z6 = Group(6, (('w', (1, 2, 3, 4, 5, 0)),))
GROUPS = (Z4_Z2, D2, Z6)
QUADRUPED = {name: Symmetry.of(Z4_Z2, {'omega': omega, 'kappa': kappa})
             for name, omega, kappa in (
                 ('pronk', 0, 0), ('pace', 0, 0.5), ('bound', 0.5, 0), ('trot', 0.5, 0.5),
                 ('jump', 0.75, 0), ('walk', 0.75, 0.5))}
BIPED = {name: Symmetry.of(D2, shifts) for name, shifts in (
    ('walk', {'rho': 0.5, 'tau': 0.5}), ('run', {'rho': 0.5, 'tau': 0}),
    ('jump', {'rho': 0, 'tau': 0.5}), ('hop', {'rho': 0, 'tau': 0}), ('skip', {'rho': 0.5}),
    ('gallop', {'tau': 0.5}), ('hesitation_walk', {'rho tau': 0.5}),
    ('asymmetric_hop', {'rho tau': 0}), ('one_legged_hop', {'tau': 0}))}
NAMED = [(table, name) for table in (QUADRUPED, BIPED) for name in table]
EVERY = [symmetry for group in (Z4_Z2, D2) for symmetry in symmetries(group)]


def times(a, b):
    """The permutation a after b."""
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


# DESIGN 2.1 and Buono & Golubitsky, Tables 1 and 2: mode (j, k), phases of LH, RH, LF, RF, which
# are cells 1 to 4. Of +- the paper has + and our gaits -.
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
        # The eigenvector (1, (-1)^k, i^j, (-1)^k i^j, ...) of DESIGN 2.1, or its conjugate.
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
    # DESIGN 2.3.
    ('walk', (1, 1, 1, 1), (0, 0.5, 0.5, 0)), ('run', (1, 1, 1, 1), (0, 0.5, 0, 0.5)),
    ('jump', (1, 1, 1, 1), (0, 0, 0.5, 0.5)), ('hop', (1, 1, 1, 1), (0, 0, 0, 0)),
    ('skip', (1, 1, 2, 2), (0, 0.5, 0, 0.5)), ('gallop', (1, 2, 1, 2), (0, 0, 0.5, 0.5)),
    ('hesitation_walk', (1, 2, 2, 1), (0, 0, 0.5, 0.5)),
    ('asymmetric_hop', (1, 2, 2, 1), (0, 0, 0, 0)),
    ('one_legged_hop', (1, 2, 1, 2), (0, 0, 0, 0))])
def test_waveforms_and_phases_of_the_biped(gait, waves, phases):
    assert tuple(BIPED[gait].waves + 1) == waves
    assert tuple(BIPED[gait].phases) == phases


def test_two_waveforms_are_possible_in_six_ways_and_one_in_four():
    # Rashidi et al., section 5: four primary gaits, and six responses with two waveforms.
    counts = [one.waves.max() + 1 for one in symmetries(D2)]
    assert (counts.count(1), counts.count(2)) == (4, 6)


@dataclass
class Rhythm:
    """Signals with a symmetry: series drawn at random, one for each waveform."""

    symmetry: Symmetry
    seed: int
    harmonics: int = 5

    def __post_init__(self):
        draw = np.random.default_rng(self.seed)
        group = self.symmetry.group
        self.series, self.place = [], {}
        for cell in range(group.cells):
            if cell not in self.place:
                series = draw.uniform(-0.6, 0.6, (self.harmonics, 2)) @ [1, 1j]
                series[0] = np.exp(2j * np.pi * draw.uniform())
                # Own offset and size, so that two waveforms are never nearly one.
                wave = len(self.series)
                self.series.append((wave, (1.0 + 0.3 * wave) * series))
                for name, shift in self.symmetry.shifts:
                    self.place[group.elements[name][cell]] = (wave, float(shift))

    def __call__(self, phases):
        """Values at phases in cycles, shape (m, cells)."""
        n = np.arange(1, self.harmonics + 1)
        columns = []
        for cell in range(self.symmetry.group.cells):
            wave, shift = self.place[cell]
            offset, series = self.series[wave]
            columns.append(offset + (np.exp(2j * np.pi * np.outer(phases + shift, n))
                                     @ series).real)
        return np.stack(columns, axis=1)


@st.composite
def recordings(draw, noise=0.0):
    """Times, period and a generator of noise: even and uneven, short and long."""
    period = 10.0 ** draw(st.floats(-3.0, 3.0))
    cycles = draw(st.floats(2.1, 14.0))
    random = np.random.default_rng(draw(st.integers(0, 2 ** 32)))
    t = np.arange(int(cycles * draw(st.integers(30, 80))) + 1.0)
    if draw(st.booleans()):
        t += random.uniform(-0.4, 0.4, t.size)
    t = (t - t[0]) * cycles * period / (t[-1] - t[0]) + draw(st.floats(-50.0, 50.0)) * period
    return t, period, lambda x: x + noise * x.std() * random.standard_normal(x.shape)


def around(phases):
    """Distances from whole cycles."""
    return np.abs((np.asarray(phases) + 0.5) % 1.0 - 0.5)


def phase_error(phases, symmetry):
    """Largest error among the phases of cells with one waveform."""
    off = phases - symmetry.phases
    return max(around(off - off[np.argmax(symmetry.waves == wave)])[symmetry.waves == wave].max()
               for wave in range(symmetry.waves.max() + 1))


seeds = st.integers(0, 2 ** 32)


@settings(max_examples=40, deadline=None)
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


@pytest.mark.parametrize(('table', 'name'), NAMED, ids=lambda value: value
                         if isinstance(value, str) else '')
@settings(max_examples=12, deadline=None)
@given(recordings(), seeds)
def test_clean_gaits_are_recognised(table, name, recording, seed):
    gait, (t, period, _) = table[name], recording
    found = recognise(t, Rhythm(gait, seed)(t / period), gait.group, table)
    assert (found.name, found.nearest, found.h, found.k) == (name, name, gait.h, gait.k)
    assert found.period == pytest.approx(period, rel=1e-6)
    assert phase_error(found.phases, gait) < 1e-5
    assert found.phases[0] == 0.0
    assert found.distance < 1e-5
    # The second is none of those that this gait is anyway; a walk is a skip and a gallop too.
    second = table[found.second]
    assert not set(second.shifts) <= set(gait.shifts)
    assert found.margin > 0.1
    for element, shift in gait.shifts:
        assert around(found.distances[element][0] - float(shift)) < 1e-5
        assert found.distances[element][1] < 1e-5


@settings(max_examples=60, deadline=None)
@given(st.sampled_from(NAMED), recordings(noise=0.01), seeds)
def test_gaits_in_noise_are_recognised(which, recording, seed):
    (table, name), (t, period, noisy) = which, recording
    gait = table[name]
    found = recognise(t, noisy(Rhythm(gait, seed)(t / period)), gait.group, table)
    assert (found.name, found.h, found.k) == (name, gait.h, gait.k)
    assert found.period == pytest.approx(period, rel=2e-3)
    assert phase_error(found.phases, gait) < 5e-3
    assert found.distance < 0.03


@settings(max_examples=60, deadline=None)
@given(st.sampled_from(EVERY), recordings(), seeds)
def test_h_and_k_of_any_symmetry_named_or_not(symmetry, recording, seed):
    t, period, _ = recording
    table = QUADRUPED if symmetry.group is Z4_Z2 else BIPED
    found = recognise(t, Rhythm(symmetry, seed)(t / period), symmetry.group, table)
    assert (found.h, found.k) == (symmetry.h, symmetry.k)
    held = [name for name, gait in table.items() if set(gait.shifts) <= set(symmetry.shifts)]
    assert found.name == max(held, key=lambda name: len(table[name].h), default=None)
    assert found.nearest in table
    if not held:
        assert found.distance > 0.05
        if len(symmetry.h) == 1:
            assert min(d for name, (_, d) in found.distances.items() if name != '1') > 0.05


@settings(max_examples=25, deadline=None)
@given(seeds, st.floats(2.1, 9.0))
def test_distances_are_those_of_the_definition(seed, cycles):
    # The symmetry of a trot, spoiled; the distance by sums over a grid, for every shift of it.
    trot, other = (Rhythm(one, seed + n, harmonics=4)
                   for n, one in enumerate((QUADRUPED['trot'], Symmetry.of(Z4_Z2, {}))))
    t = np.linspace(0.0, cycles, int(60 * cycles))

    def signals(phases):
        return trot(phases) + 0.2 * other(phases)

    found = recognise(t, signals(t), Z4_Z2, QUADRUPED, period=1.0)
    grid = np.arange(240) / 240
    x = signals(grid)
    size = np.sqrt(np.mean((x - x.mean(axis=0)) ** 2))

    def distance(element, moved):
        apart = x[:, list(Z4_Z2.elements[element])] - moved
        return np.sqrt(np.mean(apart * apart)) / size

    for element, (shift, least) in found.distances.items():
        assert least == pytest.approx(distance(element, signals(grid + shift)), abs=1e-9)
        for places in range(0, 240, 3):
            assert distance(element, np.roll(x, -places, axis=0)) >= least - 1e-9
    for which, name in (('nearest', found.nearest), ('second', found.second)):
        gait = QUADRUPED[name]
        worst = max(distance(element, signals(grid + float(shift)))
                    for element, shift in gait.shifts)
        have = found.distance + (found.margin if which == 'second' else 0.0)
        assert have == pytest.approx(worst, abs=1e-9)


def ring(amplitude):
    """A trot whose cells differ in size along the ring: d(omega^2) is sqrt(2) d(omega)."""
    t = np.linspace(0.0, 5.0, 301)
    gait = QUADRUPED['trot']
    sizes = 1.0 + amplitude * np.cos(np.pi * (np.arange(8) // 2) / 2.0)
    return t, sizes * np.cos(2.0 * np.pi * (t[:, None] + gait.phases))


def test_what_fits_no_group_is_left_out_of_h():
    found = recognise(*ring(0.04), Z4_Z2, QUADRUPED)
    assert found.distances['omega'][1] == pytest.approx(0.04, rel=1e-2)
    assert found.distances['omega^2'][1] == pytest.approx(0.04 * np.sqrt(2.0), rel=1e-2)
    # With omega its square would have to be there.
    assert (found.h, found.k) == (('1', 'kappa'), ('1',))
    assert (found.name, found.nearest) == (None, 'trot')
    assert found.distance == found.distances['omega^2'][1]


@pytest.mark.parametrize(('tolerance', 'name'), [(0.05, 'trot'), (0.02, None)])
def test_the_tolerance_decides(tolerance, name):
    found = recognise(*ring(0.02), Z4_Z2, QUADRUPED, tolerance=tolerance)
    assert (found.name, found.nearest) == (name, 'trot')
    assert 0.02 < found.distance < 0.05


def test_the_nearest_of_no_gait_is_not_merely_the_one_that_asks_least():
    # A hop with cells of four sizes; tau alone, the one-legged hop, is violated a little less.
    t = np.linspace(0.0, 5.0, 301)
    x = np.cos(2.0 * np.pi * t)[:, None] * [1.0, 0.9, 1.1, 1.02]
    found = recognise(t, x, D2, BIPED)
    assert max(found.distances[name][1] for name in ('rho', 'rho tau')) == found.distance
    assert 0.05 < found.distances['tau'][1] < found.distance < found.distances['tau'][1] + 0.05
    assert (found.name, found.nearest, found.h) == (None, 'hop', ('1',))
    # Nor one that asks for something else: a gallop is no kind of hop.
    gallop = Rhythm(BIPED['gallop'], 3)(t) * [1.0, 1.0, 1.1, 1.1]
    assert recognise(t, gallop, D2, BIPED).nearest == 'gallop'


def test_the_opposite_wave_is_another_gait():
    mirrored = Symmetry.of(Z4_Z2, {'omega': 0.25, 'kappa': 0.5})
    t = np.linspace(0.0, 4.0, 200)
    signals = Rhythm(mirrored, 5)(t)
    found = recognise(t, signals, Z4_Z2, QUADRUPED)
    assert (found.name, found.h, found.k) == (None, mirrored.h, QUADRUPED['walk'].k)
    found = recognise(t, signals, Z4_Z2, {**QUADRUPED, 'mirrored': mirrored})
    assert found.name == 'mirrored'


def test_a_gait_alone_has_no_second():
    found = recognise(*ring(0.0), Z4_Z2, {'trot': QUADRUPED['trot']})
    assert (found.name, found.second, found.margin) == ('trot', None, np.inf)


@pytest.mark.parametrize('gait', ['pronk', 'trot', 'walk'])
@pytest.mark.parametrize('noise', [0.0, 0.01])
@settings(max_examples=12, deadline=None)
@given(series=st.lists(st.tuples(st.floats(-1.0, 1.0), st.floats(-1.0, 1.0)), min_size=3,
                       max_size=3), odd=st.floats(0.05, 1.0), cycles=st.floats(2.05, 25.0),
       samples=st.integers(30, 60), seed=seeds)
def test_a_period_is_neither_halved_nor_doubled(gait, noise, series, odd, cycles, samples, seed):
    # Nearly twice the same half cycle, the more so the smaller the odd harmonics are.
    weights = np.array([odd, 1.0, *(a + 1j * b for a, b in series)])
    weights[2::2] *= odd
    t = np.linspace(0.0, cycles, int(cycles * samples) + 1)
    phases = t[:, None] + QUADRUPED[gait].phases[:4]
    x = sum((w * np.exp(2j * np.pi * n * phases)).real for n, w in enumerate(weights, 1))
    x += noise * x.std() * np.random.default_rng(seed).standard_normal(x.shape)
    assert find_period(t, x) == pytest.approx(1.0, rel=1e-3 if noise else 1e-6)


@pytest.mark.parametrize('harmonics', [(2, 3), (3, 4, 5), (1,), (1, 2, 3, 4, 5, 6, 7, 8)])
@pytest.mark.parametrize('cycles', [2.0, 3.3, 47.0])
def test_periods_of_signals_without_a_fundamental(harmonics, cycles):
    t = np.linspace(3.0, 3.0 + cycles, int(64 * cycles) + 1)
    x = sum(np.cos(2.0 * np.pi * n * t + n * n) for n in harmonics)[:, None]
    assert find_period(t, x) == pytest.approx(1.0, rel=1e-6)


def test_a_period_to_which_each_channel_alone_is_blind():
    # One channel repeats after 1/2, the other after 1/3.
    t = np.linspace(0.0, 7.0, 500)
    x = np.stack([np.cos(4.0 * np.pi * t), np.sin(6.0 * np.pi * t)], axis=1)
    assert find_period(t, x) == pytest.approx(1.0, rel=1e-6)


@pytest.mark.parametrize('seed', range(40))
def test_periods_of_few_samples(seed):
    # 7.6 to 14 a cycle, and a cycle whose halves differ by 10 %.
    draw = np.random.default_rng(seed)
    samples, cycles = draw.uniform(7.6, 14.0), draw.uniform(5.0, 20.0)
    phases = np.arange(int(cycles * samples))[:, None] / samples + [0.0, 0.5]
    x = (np.cos(4.0 * np.pi * phases + 1.0)
         + 0.07 * (np.cos(2.0 * np.pi * phases) + np.cos(6.0 * np.pi * phases + 2.0)))
    assert find_period(np.arange(len(x)) / samples, x) == pytest.approx(1.0, rel=1e-6)


@pytest.mark.parametrize(('samples', 'cycles'), [(3.1, 1000), (4.3, 1700), (5.9, 400)])
@pytest.mark.parametrize('offset', [0.0, 0.17, 0.41])
def test_periods_of_few_samples_and_many_cycles(samples, cycles, offset):
    t = np.arange(int(samples * cycles)) / (samples + offset)
    x = np.cos(2.0 * np.pi * (t[:, None] + [0.0, 0.5]))
    assert find_period(t, x) == pytest.approx(1.0, rel=1e-6)


@pytest.mark.parametrize('spread', [0.01, 0.02, 0.03, 0.04])
@pytest.mark.parametrize(('strides', 'seeds'), [(7, (1, 21, 23, 53, 55)), (9, (32, 40, 41, 51)),
                                                (12, (5, 24, 51)), (20, (0, 1, 39))])
def test_strides_that_vary_are_not_taken_together(spread, strides, seeds):
    # The seeds are those with which several strides together look the steadiest.
    for seed in seeds:
        draw = np.random.default_rng(seed)
        ends = np.cumsum(1.0 + spread * draw.standard_normal(strides + 2))
        t = np.arange(50 * strides) / 50.0
        phases = np.interp(t, np.append(0.0, ends), np.arange(strides + 3.0))[:, None] + [0.0, 0.5]
        x = (np.cos(2.0 * np.pi * phases) + 0.5 * np.cos(4.0 * np.pi * phases + 1.0)
             + 0.3 * np.cos(6.0 * np.pi * phases))
        assert find_period(t, x) == pytest.approx(1.0, abs=0.05)


@settings(max_examples=20, deadline=None)
@given(recordings(), st.lists(st.floats(0.0, 1.0), min_size=7, max_size=7))
def test_phases_of_any_size(recording, later):
    t, period, _ = recording
    phases = np.array([0.0, *later])
    angles = 2.0 * np.pi * (t[:, None] / period + phases)
    found = recognise(t, np.cos(angles) + 0.3 * np.sin(2.0 * angles), Z4_Z2, QUADRUPED)
    assert around(found.phases - phases).max() < 1e-6
    assert ((found.phases >= 0.0) & (found.phases < 1.0)).all()


@pytest.mark.parametrize('width', [0.2, 0.05, 0.02])
def test_pulses(width):
    t = np.linspace(0.0, 8.3, 1300)
    phases = t[:, None] + QUADRUPED['walk'].phases
    x = np.exp(-0.5 * (np.sin(np.pi * phases) / (np.pi * width)) ** 2)
    found = recognise(t, x, Z4_Z2, QUADRUPED)
    assert found.name == 'walk'
    assert found.period == pytest.approx(1.0, rel=1e-6)


def test_a_long_recording():
    t = np.linspace(0.0, 900.0, 40_000)
    gait = BIPED['gallop']
    found = recognise(t, Rhythm(gait, 1)(t / 1.1), D2, BIPED)
    assert (found.name, found.h, found.k) == ('gallop', gait.h, gait.k)
    assert found.period == pytest.approx(1.1, rel=1e-8)


def test_a_given_period_is_kept():
    t = np.linspace(0.0, 6.0, 400)
    signals = Rhythm(BIPED['run'], 3)(t)
    for period in (1.0, 1.0 + 1e-4):
        found = recognise(t, signals, D2, BIPED, period=period)
        assert (found.name, found.period) == ('run', period)


@settings(max_examples=25, deadline=None)
@given(recordings(), seeds)
def test_the_mean_cycle_is_the_signal(recording, seed):
    t, period, _ = recording
    rhythm, grid = Rhythm(BIPED['skip'], seed), np.linspace(-1.0, 2.0, 77)
    cycle = mean_cycle(t, rhythm(t / period), period)
    assert np.allclose(cycle(grid), rhythm(cycle.start / period + grid), 0.0, 1e-6)
    assert cycle.residual < 1e-6


GOOD_T = np.linspace(0.0, 4.0, 160)
GOOD = Rhythm(BIPED['walk'], 0)(GOOD_T)


def spoiled(index, value):
    x = GOOD.copy()
    x[index] = value
    return x


@pytest.mark.parametrize(('change', 'words'), [
    ({'t': GOOD_T[:80] * 0.5, 'signals': GOOD[:40].repeat(2, axis=0)}, 'at least two periods'),
    ({'t': GOOD_T[:79], 'signals': GOOD[:79]}, 'at least two periods'),
    ({'t': GOOD_T[:60], 'signals': GOOD[:60]}, 'at least two periods'),
    ({'signals': np.random.default_rng(1).standard_normal(GOOD.shape)}, 'no period found'),
    ({'signals': GOOD_T[:, None] * np.ones(4)}, 'no period found'),
    ({'period': 2.1}, 'less than two periods of 2.1'), ({'period': -1.0}, 'period is -1.0'),
    ({'period': np.nan}, 'period is nan'), ({'period': GOOD_T[1]}, 'leave too much'),
    ({'signals': spoiled((3, 1), np.nan)}, 'signals holds 1 values that are not finite'),
    ({'signals': spoiled((3, 1), np.inf)}, 'not finite'),
    ({'t': np.where(GOOD_T > 3.0, np.nan, GOOD_T)}, 't holds 40 values'),
    ({'signals': spoiled((slice(None), 2), 0.7)}, 'channel 3 is constant'),
    ({'signals': GOOD[:, :3]}, r'\(160, 3\).*4 cells'), ({'signals': GOOD[:-1]}, r'\(159, 4\)'),
    ({'t': GOOD_T[:, None]}, 'shape'), ({'t': GOOD_T[::-1]}, 'does not increase: 4 is followed'),
    ({'t': np.round(GOOD_T, 1)}, 'does not increase'),
    ({'t': GOOD_T[:6], 'signals': GOOD[:6]}, '6 samples are not enough'),
    ({'gaits': {}}, 'gaits is empty'), ({'gaits': QUADRUPED}, "'pronk' is one of another group"),
    ({'tolerance': 0.0}, 'tolerance is 0.0'), ({'tolerance': np.nan}, 'tolerance is nan')])
def test_refusals(change, words):
    arguments = {'t': GOOD_T, 'signals': GOOD, 'group': D2, 'gaits': BIPED}
    assert recognise(**arguments).name == 'walk'
    with pytest.raises(ValueError, match=words):
        recognise(**{**arguments, **change})


LEGS = {'walk': (0, 0.5, 0.75, 0.25), 'diagonal': (0, 0.5, 0.25, 0.75), 'trot': (0, 0.5, 0.5, 0),
        'pace': (0, 0.5, 0, 0.5), 'bound': (0, 0, 0.5, 0.5), 'pronk': (0, 0, 0, 0)}


@settings(max_examples=100, deadline=None)
@given(st.sampled_from(sorted(LEGS)), st.floats(-3.0, 3.0),
       st.lists(st.floats(-0.05, 0.05), min_size=4, max_size=4))
def test_nearest_gait(name, common, off):
    phases = np.array(LEGS[name]) + common + off
    found, distance, second, margin = nearest_gait(phases, LEGS)
    assert found == name
    # Small deviations do not wrap: their distance is the standard deviation.
    assert distance == pytest.approx(np.std(off), abs=1e-9)
    # By trying common shifts.
    shifts = np.arange(2000)[:, None] / 2000
    tried = {other: np.sqrt(np.mean(around(phases - LEGS[other] - shifts) ** 2, axis=1)).min()
             for other in LEGS}
    assert distance == pytest.approx(tried[name], abs=3e-4)
    del tried[name]
    assert margin + distance == pytest.approx(min(tried.values()), abs=3e-4)
    assert tried[second] == pytest.approx(min(tried.values()), abs=3e-4)


@settings(max_examples=50, deadline=None)
@given(st.lists(st.floats(0.0, 1.0), min_size=1, max_size=6), st.data())
def test_leg_distance_is_the_least_over_all_common_shifts(phases, data):
    wanted = data.draw(st.lists(st.floats(0.0, 1.0), min_size=len(phases), max_size=len(phases)))
    name, distance, second, margin = nearest_gait(phases, {'only': wanted})
    assert (name, second, margin) == ('only', None, np.inf)
    shifts = np.arange(4000)[:, None] / 4000
    tried = np.sqrt(np.mean(around(np.subtract(phases, wanted) - shifts) ** 2, axis=1)).min()
    assert distance == pytest.approx(tried, abs=3e-4)


@pytest.mark.parametrize(('phases', 'table', 'words'), [
    ((0, 0.5), {}, 'table is empty'), ((0, 0.5), LEGS, "those of 'walk'"),
    ((0, 0.5, np.nan, 0), LEGS, 'not finite'), ((0, 0), {'hop': (0, np.inf)}, 'not finite'),
    (((0, 0.5),), {'walk': ((0, 0.5),)}, 'must be'), ((), {'none': ()}, 'must be')])
def test_nearest_gait_refusals(phases, table, words):
    with pytest.raises(ValueError, match=words):
        nearest_gait(phases, table)
