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

"""The gait, H and K of a cycle of signals: with noise, in pulses, and none to be found."""

from cpg_ros.fitting.gaits.recognition import recognise
from cpg_ros.networks.network import nearest_gait
from cpg_ros.networks.symmetry import D2, Symmetry, Z4_Z2
from depth import examples
from hypothesis import given
from hypothesis import strategies as st
import numpy as np
import pytest
from rhythm import around, BIPED, EVERY, NAMED, phase_error, QUADRUPED, Rhythm, seeds

#: Even points of a cycle.
CYCLE = np.arange(60) / 60


@pytest.mark.parametrize(('table', 'name'), NAMED, ids=lambda value: value
                         if isinstance(value, str) else '')
@examples(12)
@given(st.floats(-3.0, 3.0), st.integers(24, 80), seeds)
def test_clean_gaits_are_recognised(table, name, begin, points, seed):
    gait = table[name]
    found = recognise(Rhythm(gait, seed)(begin + np.arange(points) / points), gait.group, table)
    assert (found.name, found.nearest, found.h, found.k) == (name, name, gait.h, gait.k)
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


@examples(60)
@given(st.sampled_from(NAMED), seeds)
def test_gaits_in_noise_are_recognised(which, seed):
    table, name = which
    gait, clean = table[name], Rhythm(table[name], seed)(CYCLE)
    noise = 0.01 * clean.std() * np.random.default_rng(seed).standard_normal(clean.shape)
    found = recognise(clean + noise, gait.group, table)
    assert (found.name, found.h, found.k) == (name, gait.h, gait.k)
    assert phase_error(found.phases, gait) < 5e-3
    assert found.distance < 0.05


@examples(20)
@given(st.lists(st.floats(0.0, 1.0), min_size=7, max_size=7))
def test_phases_of_any_size(later):
    phases = np.array([0.0, *later])
    angles = 2.0 * np.pi * (CYCLE[:, None] + phases)
    found = recognise(np.cos(angles) + 0.3 * np.sin(2.0 * angles), Z4_Z2, QUADRUPED)
    assert around(found.phases - phases).max() < 1e-6
    assert ((found.phases >= 0.0) & (found.phases < 1.0)).all()


@pytest.mark.parametrize('width', [0.2, 0.05, 0.02])
def test_pulses(width):
    phases = np.arange(256)[:, None] / 256 + QUADRUPED['walk'].phases
    x = np.exp(-0.5 * (np.sin(np.pi * phases) / (np.pi * width)) ** 2)
    assert recognise(x, Z4_Z2, QUADRUPED).name == 'walk'


def test_cells_of_one_waveform_keep_their_shift_where_another_waveform_leaves_a_choice():
    # The waveforms of this gallop correlate almost equally well at two shifts 0.19 apart.
    gait, clean = BIPED['gallop'], Rhythm(BIPED['gallop'], 1000001)(CYCLE)
    for seed in (4, 5, 6):
        noise = np.random.default_rng(seed).standard_normal(clean.shape)
        found = recognise(clean + 0.01 * clean.std() * noise, gait.group, BIPED)
        assert found.name == 'gallop' and phase_error(found.phases, gait) < 5e-3


@examples(60)
@given(st.sampled_from(EVERY), seeds)
def test_h_and_k_of_any_symmetry_named_or_not(symmetry, seed):
    table = QUADRUPED if symmetry.group is Z4_Z2 else BIPED
    found = recognise(Rhythm(symmetry, seed)(CYCLE), symmetry.group, table)
    assert (found.h, found.k) == (symmetry.h, symmetry.k)
    held = [name for name, gait in table.items() if set(gait.shifts) <= set(symmetry.shifts)]
    assert found.name == max(held, key=lambda name: len(table[name].h), default=None)
    assert found.nearest in table
    if not held:
        assert found.distance > 0.05
        if len(symmetry.h) == 1:
            assert min(d for name, (_, d) in found.distances.items() if name != '1') > 0.05


@examples(25)
@given(seeds, st.integers(30, 200))
def test_distances_are_those_of_the_definition(seed, points):
    # The symmetry of a trot, spoiled; the distance by sums over a grid, for every shift of it.
    trot, other = (Rhythm(one, seed + n, harmonics=4)
                   for n, one in enumerate((QUADRUPED['trot'], Symmetry.of(Z4_Z2, {}))))

    def signals(phases):
        return trot(phases) + 0.2 * other(phases)

    found = recognise(signals(np.arange(points) / points), Z4_Z2, QUADRUPED)
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
    """Return a trot whose cells differ in size along the ring: d(omega^2) is sqrt(2) d(omega)."""
    gait = QUADRUPED['trot']
    sizes = 1.0 + amplitude * np.cos(np.pi * (np.arange(8) // 2) / 2.0)
    return sizes * np.cos(2.0 * np.pi * (CYCLE[:, None] + gait.phases))


def test_what_fits_no_group_is_left_out_of_h():
    found = recognise(ring(0.04), Z4_Z2, QUADRUPED)
    assert found.distances['omega'][1] == pytest.approx(0.04, rel=1e-2)
    assert found.distances['omega^2'][1] == pytest.approx(0.04 * np.sqrt(2.0), rel=1e-2)
    # With omega its square would have to be there.
    assert (found.h, found.k) == (('1', 'kappa'), ('1',))
    assert (found.name, found.nearest) == (None, 'trot')
    assert found.distance == found.distances['omega^2'][1]


@pytest.mark.parametrize(('tolerance', 'name'), [(0.05, 'trot'), (0.02, None)])
def test_the_tolerance_decides(tolerance, name):
    found = recognise(ring(0.02), Z4_Z2, QUADRUPED, tolerance=tolerance)
    assert (found.name, found.nearest) == (name, 'trot')
    assert 0.02 < found.distance < 0.05


def test_the_nearest_of_no_gait_is_not_merely_the_one_that_asks_least():
    # A hop with cells of four sizes; tau alone, the one-legged hop, is violated a little less.
    wave = np.cos(2.0 * np.pi * CYCLE)[:, None]
    x = wave * [1.0, 0.9, 1.1, 1.02]
    found = recognise(x, D2, BIPED)
    assert max(found.distances[name][1] for name in ('rho', 'rho tau')) == found.distance
    assert 0.05 < found.distances['tau'][1] < found.distance < found.distances['tau'][1] + 0.05
    assert (found.name, found.nearest, found.h) == (None, 'hop', ('1',))
    # But a gait that asks for more of something else is not preferred.
    sizes = np.tile([1.035, 0.965], 4) * (1.0 + 0.07 * np.cos(np.pi * (np.arange(8) // 2) / 2.0))
    gaits = {'pairs': Symmetry.of(Z4_Z2, {'kappa': 0}), 'ring': Symmetry.of(Z4_Z2, {'omega': 0})}
    found = recognise(wave * sizes, Z4_Z2, gaits)
    assert (found.name, found.nearest, found.second) == (None, 'pairs', 'ring')
    assert (found.distance, found.margin) == pytest.approx((0.07, 0.029), abs=1e-3)


def test_the_opposite_wave_is_another_gait():
    mirrored = Symmetry.of(Z4_Z2, {'omega': 0.25, 'kappa': 0.5})
    signals = Rhythm(mirrored, 5)(CYCLE)
    found = recognise(signals, Z4_Z2, QUADRUPED)
    assert (found.name, found.h, found.k) == (None, mirrored.h, QUADRUPED['walk'].k)
    found = recognise(signals, Z4_Z2, {**QUADRUPED, 'mirrored': mirrored})
    assert found.name == 'mirrored'


def test_a_gait_alone_has_no_second():
    found = recognise(ring(0.0), Z4_Z2, {'trot': QUADRUPED['trot']})
    assert (found.name, found.second, found.margin) == ('trot', None, np.inf)


GOOD = Rhythm(BIPED['walk'], 0)(CYCLE)


def spoiled(index, value):
    x = GOOD.copy()
    x[index] = value
    return x


@pytest.mark.parametrize(('change', 'words'), [
    ({'signals': spoiled((3, 1), np.nan)}, 'signals holds 1 values that are not finite'),
    ({'signals': spoiled((3, 1), np.inf)}, 'not finite'),
    ({'signals': spoiled((slice(None), 2), 0.7)}, 'channel 3 is constant'),
    ({'signals': GOOD[:, :3]}, r'\(60, 3\).*4 cells'), ({'signals': GOOD[:, 0]}, 'shape'),
    ({'signals': GOOD[:6]}, '6 points are not enough'),
    ({'gaits': {}}, 'gaits is empty'), ({'gaits': QUADRUPED}, "'pronk' belongs to another group"),
    ({'tolerance': 0.0}, 'tolerance is 0.0'), ({'tolerance': np.nan}, 'tolerance is nan')])
def test_refusals(change, words):
    arguments = {'signals': GOOD, 'group': D2, 'gaits': BIPED}
    assert recognise(**arguments).name == 'walk'
    with pytest.raises(ValueError, match=words):
        recognise(**{**arguments, **change})


LEGS = {'walk': (0, 0.5, 0.75, 0.25), 'diagonal': (0, 0.5, 0.25, 0.75), 'trot': (0, 0.5, 0.5, 0),
        'pace': (0, 0.5, 0, 0.5), 'bound': (0, 0, 0.5, 0.5), 'pronk': (0, 0, 0, 0)}


@examples(100)
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


@examples(50)
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
