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

"""The period of signals, and their mean cycle: never a half, never a double."""

from cpg_ros.fitting.gaits.mean_cycle import find_period, mean_cycle
from cpg_ros.fitting.gaits.recognition import recognise
from cpg_ros.networks.symmetry import D2, Z4_Z2
from depth import examples
from hypothesis import given
from hypothesis import strategies as st
import numpy as np
import pytest
from rhythm import around, BIPED, QUADRUPED, recordings, Rhythm, seeds


@pytest.mark.parametrize('gait', ['pronk', 'trot', 'walk'])
@pytest.mark.parametrize('noise', [0.0, 0.01])
@examples(12)
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


@pytest.mark.parametrize('seed', [*range(30), 60, 136, 142, 239])
def test_periods_of_few_samples(seed):
    # 7.6 to 14 a cycle, and a cycle whose halves differ by 10 %.
    draw = np.random.default_rng(seed)
    samples, cycles = draw.uniform(7.6, 14.0), draw.uniform(5.0, 20.0)
    phases = np.arange(int(cycles * samples))[:, None] / samples + [0.0, 0.5]
    x = (np.cos(4.0 * np.pi * phases + 1.0)
         + 0.07 * (np.cos(2.0 * np.pi * phases) + np.cos(6.0 * np.pi * phases + 2.0)))
    assert find_period(np.arange(len(x)) / samples, x) == pytest.approx(1.0, rel=1e-6)


@pytest.mark.parametrize('seed', [*range(10), 34])
def test_periods_of_few_samples_and_many_cycles(seed):
    # 3 to 6 a cycle: a first guess that slips by cycles later on.
    draw = np.random.default_rng(seed)
    samples, cycles = draw.uniform(3.0, 6.0), 10.0 ** draw.uniform(2.5, 3.3)
    t = np.arange(int(cycles * samples) + 1) / samples
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


@examples(20)
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


@examples(25)
@given(recordings(), seeds)
def test_the_mean_cycle_is_the_signal(recording, seed):
    t, period, _ = recording
    rhythm, grid = Rhythm(BIPED['skip'], seed), np.linspace(-1.0, 2.0, 77)
    cycle = mean_cycle(t, rhythm(t / period), period)
    assert np.allclose(cycle(grid), rhythm(cycle.start / period + grid), 0.0, 1e-6)
    assert cycle.residual < 1e-6
