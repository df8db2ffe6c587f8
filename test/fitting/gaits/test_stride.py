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

"""The stride of recordings whose motion is known: found, measured, named, or refused."""

import re

from cpg_ros.fitting.gaits.leg_names import legs_of
from cpg_ros.fitting.gaits.stride import find_stride, NoSteadyGait
from cpg_ros.networks.library.biped import Biped
from cpg_ros.networks.library.delayed import Delayed
from cpg_ros.networks.library.quadruped import Quadruped
from cpg_ros.networks.registry import NETWORKS, PRESETS
from depth import examples, spread
from hypothesis import given
from hypothesis import strategies as st
from motion import BY_LEG, Driven, GAITS, leg, NAMES, noisy, quadruped, Recorded, stamps
import numpy as np
import pytest

EVERY = [(network, name) for network in PRESETS for name in PRESETS[network]]
seeds = st.integers(0, 2**32)


def around(phases):
    return np.abs((np.asarray(phases) + 0.5) % 1.0 - 0.5)


def walked(x, t, names=NAMES):
    return find_stride(Recorded(tuple(names), t, x), legs_of(names), Delayed)


def trot(rng, duration=15.0, rate=200.0, frequency=2.0, gait='trot', **how):
    t = stamps(rng, duration, rate, **how)
    return t, noisy(rng, quadruped(frequency * t, gait))


@pytest.mark.parametrize(('network', 'name'), spread(EVERY, 4), ids=lambda value: value)
def test_every_preset_is_measured_and_named(network, name):
    driven, rng = Driven(network, name), np.random.default_rng(1)
    t = stamps(rng, 15.0, 200.0)
    recording = Recorded(tuple(driven.joints), t, noisy(rng, driven(0.3 + 1.7 * t)))
    kind = NETWORKS[network]
    stride = find_stride(recording, driven.by_leg, kind, driven.cells, driven.gains)
    if name == kind.unnamed:
        assert stride.gait is None
    else:
        assert stride.gait == stride.nearest == PRESETS[network][name].gait
        assert stride.distance < 0.01 < 0.04 < stride.margin
    assert stride.frequency == pytest.approx(1.7, rel=2e-3)
    assert stride.cycles == int(1.7 * t[-1])
    cells = [own[0] - 1 for own in next(iter(kind.legs.values())).values()]
    phases, waves = driven.orbit.phases[cells], driven.orbit.waves[cells]
    same = waves == waves[0]
    ahead = np.array(list(stride.phases.values()))
    assert around(ahead - phases + phases[0])[same].max() < 0.01
    within = np.abs(stride.mean - driven(stride.theta + driven.zero).T) <= 1.96 * stride.error
    assert within.mean() > 0.85


def test_errors_cover_the_truth_and_spread_is_the_scatter_of_cycles():
    driven, covered, phases, z = Driven('delayed', 'walk'), [], [], []
    for seed in range(20):
        rng = np.random.default_rng(seed)
        t = stamps(rng, 12.0, 200.0)
        # No stride lasts as long as the last, nor is as large.
        knots = np.concatenate([[0.0], np.cumsum(0.5 * (1.0 + 0.03 * rng.standard_normal(60)))])
        phase = np.interp(t, knots, np.arange(61.0))
        sizes = 1.0 + 0.05 * rng.standard_normal((62, len(driven.joints)))
        x = driven(phase)
        mean = x.mean(axis=0)
        x = noisy(rng, mean + (x - mean) * sizes[phase.astype(int)])
        stride = find_stride(Recorded(tuple(driven.joints), t, x), driven.by_leg, Delayed,
                             driven.cells)
        truth = driven(stride.theta + driven.zero).T
        covered.append((np.abs(stride.mean - truth) <= 1.96 * stride.error).mean())
        phases.append(around(np.array(list(stride.phases.values())) - GAITS['walk']).max())
        # Meant is the mean over these strides, whatever the usual one takes.
        begin, end = np.interp([stride.begin, stride.end], knots, np.arange(61.0))
        z.append((stride.frequency - (end - begin) / (stride.end - stride.begin))
                 / stride.frequency_error)
        inner = stride.error * np.sqrt(stride.cycles)
        assert np.median(stride.spread / inner) == pytest.approx(1.0, abs=0.1)
    assert 0.9 <= np.mean(covered) <= 0.99
    assert max(phases) < 0.01
    assert np.mean(np.abs(z) < 2.0) >= 0.8


def test_the_stretch_leaves_standing_and_starts_out():
    rng = np.random.default_rng(2)
    t = stamps(rng, 25.0, 200.0)
    size = np.clip((t - 4.0) / 1.0, 0.0, 1.0) * np.clip((20.0 - t) / 1.0, 0.0, 1.0)
    x = quadruped(2.0 * t) * size[:, None] + quadruped(0.0 * t, size=0.0) * (1.0 - size[:, None])
    stride = walked(noisy(rng, x), t)
    # Strides that are only half as large are no part of it.
    assert 4.4 <= stride.begin <= 5.6
    assert 18.4 <= stride.end <= 19.6
    assert stride.frequency == pytest.approx(2.0, rel=1e-3)
    assert stride.gait == 'trot'


@pytest.mark.parametrize('slip', [0.15, 0.2])
def test_a_single_slip_of_the_phase_does_not_make_three_strides_one(slip):
    driven, t = Driven('delayed', 'walk'), stamps(np.random.default_rng(23), 7.0, 100.0)
    # A generator that was held up goes on where it was.
    angles = driven(0.97 * t - slip * (t > 3.4))
    stride = find_stride(Recorded(tuple(driven.joints), t, angles), driven.by_leg, Delayed,
                         driven.cells)
    assert stride.gait == 'walk' and stride.frequency == pytest.approx(0.97, rel=0.05)


def test_a_drift_of_the_frequency_is_followed():
    rng = np.random.default_rng(3)
    t = stamps(rng, 25.0, 200.0)
    phase = 2.0 * (t + 0.05 * (t * t / 25.0 - t))
    stride = walked(noisy(rng, quadruped(phase, 'walk')), t)
    assert (stride.begin, stride.end) == pytest.approx((0.0, 25.0), abs=0.05)
    assert stride.frequency == pytest.approx(2.0, rel=2e-3)
    assert 'the frequency drifts from 1.9 to 2.1 Hz' in stride.notes
    # Averaged over phase: nothing is smeared.
    assert np.ptp(stride.mean, axis=1) == pytest.approx(
        np.ptp(quadruped(np.arange(64) / 64, 'walk'), axis=0), rel=0.02)
    at = stride.warp(t[1:-1]) - phase[1:-1]
    assert np.ptp(at) < 0.01


@pytest.mark.parametrize(('other', 'frequency'), [('pace', 2.0), ('walk', 2.0), ('trot', 1.4)])
def test_of_two_gaits_the_longer_is_taken_and_the_other_told(other, frequency):
    rng = np.random.default_rng(4)
    t = stamps(rng, 25.0, 200.0)
    x = np.where((t < 14.0)[:, None], quadruped(2.0 * t), quadruped(frequency * t, other))
    stride = walked(noisy(rng, x), t)
    assert stride.begin < 0.6
    assert 13.0 <= stride.end <= 14.5
    assert stride.gait == 'trot'
    assert stride.frequency == pytest.approx(2.0, rel=2e-3)
    told = [note for note in stride.notes if note.startswith('another steady stretch')]
    assert len(told) == 1
    assert f'of {frequency:g} Hz' in told[0]


def standing(t):
    return quadruped(0.0 * t, size=0.0)


def poses(t):
    """Pitch down, pitch up, roll and crouch: once each, all legs together."""
    x = standing(t)
    for middle, joints, sizes in (
            (5.0, 1, (0.6, 0.6, 0.1, 0.1)), (10.0, 2, (-0.6, -0.6, 0.4, 0.4)),
            (16.0, 0, (0.3, -0.3, 0.3, -0.3)), (21.0, 2, (0.3, 0.3, 0.3, 0.3))):
        x[:, joints::3] += np.array(sizes) * np.exp(-((t - middle) / 0.9)**2)[:, None]
    return x


SILENCE = {
    'standing': (lambda t, rng: standing(t), 'stand, none moves by more than'),
    'trembling': (lambda t, rng: standing(t) + 1e-4 * np.sin(12.0 * t)[:, None], 'stand'),
    'noise': (lambda t, rng: standing(t) + 0.3 * rng.standard_normal((t.size, 12)),
              'no stride of up to'),
    'ramp': (lambda t, rng: standing(t) + 0.1 * t[:, None], 'no stride of up to'),
    'step': (lambda t, rng: standing(t) + np.tanh(t - 12.0)[:, None], 'no stride of up to'),
    'poses': (lambda t, rng: poses(t), 'no stride of up to')}


@pytest.mark.parametrize(('motion', 'message'), SILENCE.values(), ids=SILENCE)
def test_what_is_no_gait_is_refused(motion, message):
    rng = np.random.default_rng(5)
    t = stamps(rng, 25.0, 200.0)
    with pytest.raises(NoSteadyGait, match=f'^made up: no steady gait: .*{message}') as error:
        walked(motion(t, rng) + 1e-4 * rng.standard_normal((t.size, 12)), t)
    assert '\n' not in str(error.value)


@examples(15)
@given(seeds, st.sampled_from([0.02, 0.1, 0.5, 2.0]))
def test_smooth_noise_is_refused(seed, seconds):
    rng = np.random.default_rng(seed)
    t = np.arange(4000) / 200.0
    kernel = np.hanning(int(400 * seconds) + 1)
    x = np.stack([np.convolve(rng.standard_normal(t.size), kernel, 'same') for _ in NAMES], 1)
    with pytest.raises(NoSteadyGait):
        walked(x / x.std(), t)


@pytest.mark.parametrize(('cycles', 'frequency'), [(1.3, None), (1.6, 2.0), (2.4, 2.0)])
def test_few_cycles(cycles, frequency):
    rng = np.random.default_rng(6)
    t, x = trot(rng, cycles / 2.0, 150.0)
    if frequency is None:
        with pytest.raises(NoSteadyGait, match=r'repeats for 1[.]4 cycles'):
            walked(x, t)
        return
    stride = walked(x, t)
    assert stride.frequency == pytest.approx(2.0, rel=5e-3)
    assert (stride.gait, stride.cycles) == ('trot', int(2.0 * t[-1]))
    assert any(note.startswith(f'only {2.0 * t[-1]:.1f} cycles') for note in stride.notes)
    # One figure for the whole cycle; of the mean more where it is there once.
    assert np.ptp(stride.spread, axis=1).max() == 0.0
    # The noise, of which a bin averages one or two samples.
    assert 0.5 * 0.0132 < stride.spread[1, 0] < 1.1 * 0.0132


@pytest.mark.parametrize('how', ['dropouts', 'slow', 'in turn', 'missing', 'gap', 'spikes'])
def test_imperfect_samples(how):
    rng = np.random.default_rng(7)
    t, x = trot(rng, dropouts=0.05, **({'rate': 20.0, 'jitter': 0.4} if how == 'slow' else {}))
    if how == 'in turn':
        for k in range(4):
            x[np.arange(t.size) % 4 != k, 3 * k:3 * k + 3] = np.nan
    elif how == 'missing':
        x[rng.random(x.shape) < 0.6] = np.nan
    elif how == 'gap':
        t, x = (one[(t < 6.0) | (t > 6.3)] for one in (t, x))
    elif how == 'spikes':
        x[rng.integers(0, t.size, 20), rng.integers(0, 12, 20)] += 20.0
    stride = walked(x, t)
    assert stride.frequency == pytest.approx(2.0, rel=2e-3)
    assert around(np.array(list(stride.phases.values())) - GAITS['trot']).max() < 0.01
    assert stride.gait == 'trot'
    assert stride.end - stride.begin > 14.0
    off = stride.mean - quadruped(stride.theta).T
    assert (np.abs(off) <= 2.5 * stride.error + 0.002).mean() > 0.9


def test_joints_without_angles_are_left_out_and_said():
    rng = np.random.default_rng(8)
    t, x = trot(rng)
    x[:, [0, 4]] = np.nan
    stride = walked(x, t)
    assert stride.joints == tuple(name for name in NAMES if name not in ('lh_hip', 'rh_thigh'))
    assert 'left out, without angles: lh_hip, rh_thigh' in stride.notes
    assert stride.gait == 'trot'
    assert around(stride.phases['rh'] - 0.5) < 0.01
    x[:, :3] = np.nan
    with pytest.raises(NoSteadyGait, match=r'none of the joints of lh \(lh_hip, lh_thigh'):
        walked(x, t)
    with pytest.raises(NoSteadyGait, match='7 samples are not enough'):
        walked(x[:7], t[:7])


def test_phase_zero_is_the_first_harmonic_of_the_first_legs_main_joint():
    stride = walked(*trot(np.random.default_rng(9), gait='walk')[::-1])
    first = np.fft.rfft(stride.mean[NAMES.index('lh_thigh')])[1]
    assert np.angle(first) == pytest.approx(0.0, abs=1e-9)
    assert stride.theta == pytest.approx(np.arange(64) / 64)


def test_joints_that_count_in_the_opposite_sense():
    rng = np.random.default_rng(10)
    t, x = trot(rng, gait='walk')
    # The right hips, and both fore legs' thighs and calves.
    mirrored = [NAMES.index(name) for name in ('rh_hip', 'rf_hip', 'lf_thigh', 'rf_thigh',
                                               'lf_calf', 'rf_calf')]
    x[:, mirrored] *= -1.0
    stride = walked(x, t)
    assert around(np.array(list(stride.phases.values())) - GAITS['walk']).max() < 0.01
    assert any(note.startswith('taken to count angles in the opposite sense of lh: ')
               and 'rf_thigh' in note for note in stride.notes)


def test_legs_with_other_joints_are_compared_by_first_harmonics():
    names = [name.replace('f_thigh', 'f_shoulder').replace('f_calf', 'f_elbow')
             for name in NAMES if 'hip' not in name]
    rng = np.random.default_rng(11)
    t, x = trot(rng, gait='walk')
    stride = walked(x[:, [k for k, name in enumerate(NAMES) if 'hip' not in name]], t, names)
    assert around(np.array(list(stride.phases.values())) - GAITS['walk']).max() < 0.01
    assert ('lf has no joint named like one of lh: its phase is that of lf_shoulder against '
            'lh_thigh, half a cycle off if their senses differ') in stride.notes
    assert not any(note.startswith('rf has no joint') for note in stride.notes)


def test_between_two_gaits_there_is_none():
    t = np.arange(3000) / 200.0
    # Half way from trot to walk.
    x = np.concatenate([leg(2.0 * t + ahead) for ahead in (0.0, 0.5, 0.63, 0.13)]).T
    stride = walked(x, t)
    assert (stride.gait, stride.nearest) == (None, 'walk')
    assert stride.distance == pytest.approx(0.06, abs=2e-3)
    assert stride.margin < 0.02


def test_sense_of_a_walk():
    rng = np.random.default_rng(12)
    t, x = trot(rng, gait='walk')
    assert 'lateral sequence: LH, LF, RH, RF' in walked(x, t).notes
    fore = {'lf': 'rf', 'rf': 'lf'}
    names = [fore.get(name[:2], name[:2]) + name[2:] for name in NAMES]
    assert 'diagonal sequence: LH, RF, RH, LF' in walked(x, t, names).notes


def test_a_biped_without_cells_says_what_cannot_be_told():
    driven, rng = Driven('biped', 'run'), np.random.default_rng(13)
    t = stamps(rng, 10.0, 200.0)
    # Named so that nobody knows the knee.
    names = [name.replace('knee', 'lower') for name in driven.joints]
    legs = {leg: tuple(name.replace('knee', 'lower') for name in listed)
            for leg, listed in driven.by_leg.items()}
    recording = Recorded(tuple(names), t, noisy(rng, driven(1.7 * t)))
    stride = find_stride(recording, legs, Biped)
    assert stride.verdict == 'walk or run: cannot tell' and stride.confidence <= 0.5
    assert any('move alike in walk, run' in note for note in stride.notes)
    with pytest.raises(ValueError, match='legs are left, right; the network quadruped has lh'):
        find_stride(recording, legs, Quadruped)


BASE = trot(np.random.default_rng(14), 8.0, 100.0, gait='walk')
FOUND = walked(*BASE[::-1])


@examples(20)
@given(st.floats(0.4, 2.5), st.floats(0.2, 5.0), st.permutations(range(12)))
def test_scaled_angles_and_time_and_permuted_joints(size, speed, order):
    t, x = BASE
    names = [NAMES[k] for k in order]
    found = find_stride(Recorded(tuple(names), t / speed, size * x[:, order]), BY_LEG, Delayed)
    assert found.frequency == pytest.approx(speed * FOUND.frequency, rel=2e-4)
    assert found.joints == tuple(names)
    for key in ('mean', 'spread', 'error'):
        was = size * getattr(FOUND, key)[list(order)]
        assert getattr(found, key) == pytest.approx(was, abs=0.003 * size)
    assert list(found.phases.values()) == pytest.approx(list(FOUND.phases.values()), abs=1e-3)
    assert (found.gait, found.cycles) == (FOUND.gait, FOUND.cycles)


@examples(15)
@given(st.floats(0.0, 1.0), st.integers(1, 3), seeds)
def test_a_later_start_and_fewer_samples_change_little(later, every, seed):
    t, x = BASE
    kept = np.flatnonzero(t >= later)
    kept = np.sort(np.random.default_rng(seed).choice(kept, kept.size // every, replace=False))
    found = walked(x[kept], t[kept] - t[kept[0]])
    assert found.frequency == pytest.approx(2.0, rel=2e-3)
    assert around(np.array(list(found.phases.values())) - GAITS['walk']).max() < 0.01
    off = np.abs(found.mean - FOUND.mean) / np.hypot(found.error, FOUND.error)
    assert np.mean(off <= 2.5) > 0.9
    assert found.gait == 'walk'


def gappy(seed):
    """Return a trot with gaps in its joints, joints of hardly any samples, and wild ones."""
    rng = np.random.default_rng(seed)
    t, x = trot(rng)
    for column in x.T:
        for _ in range(rng.integers(12)):
            start = rng.integers(t.size)
            column[start:start + int(rng.exponential(0.2 * t.size))] = np.nan
        if rng.random() < 0.15:
            column[rng.permutation(t.size)[rng.integers(1, 30):]] = np.nan
        if rng.random() < 0.1:
            column[rng.random(t.size) < 0.5] = 20.0 * rng.normal()
    return t, x


@pytest.mark.parametrize('seed', range(40))
def test_joints_with_gaps_are_left_out_or_the_recording_is_refused(seed):
    t, x = gappy(seed)
    try:
        stride = walked(x, t)
    except NoSteadyGait as refusal:
        assert '\n' not in str(refusal)
        return
    inside = (t >= stride.begin) & (t <= stride.end)
    assert all(np.isfinite(x[inside, NAMES.index(name)]).sum() >= 8 for name in stride.joints)
    assert set(NAMES) - set(stride.joints) <= set(re.findall(
        r'\w+', ' '.join(note for note in stride.notes if 'left out' in note)))
    assert np.isfinite(stride.mean).all() and np.isfinite(list(stride.phases.values())).all()


@pytest.mark.parametrize('seed', [1, 2, 3])
def test_the_phase_goes_evenly_through_missing_samples(seed):
    rng, t = np.random.default_rng(seed), np.arange(2800) / 200.0
    there = np.full(t.size, True)
    # Thirty to 250 ms at a time, 5 % of all.
    while there.mean() > 0.95:
        begin = rng.integers(t.size)
        there[begin:begin + rng.integers(6, 50)] = False
    stride = walked(noisy(rng, quadruped(1.7 * t), 0.01)[there], t[there])
    inside = t[there & (t >= stride.begin) & (t <= stride.end)]
    off = stride.warp(inside) - 1.7 * inside
    assert np.std(off) < 3e-4
