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

"""The real-time stepper against the simulation and against the equation."""

from dataclasses import replace

from cpg_ros.dynamics.integration.simulate import simulate
from cpg_ros.dynamics.integration.stepper import Stepper
from cpg_ros.dynamics.solve_orbit import solve_orbit
from cpg_ros.networks.library.delayed import Delayed, STEP
from depth import examples
from hypothesis import given
from hypothesis import strategies as st
from modes import Mode
import numpy as np
import pytest

WALK = Delayed(-4.5, 1.0, 6.5, -2.0, 0.4)
START = np.array([0.1, -0.1, 0.1, -0.1, -0.1, 0.1, -0.1, 0.1])
SWAP = [1, 0, 3, 2, 5, 4, 7, 6]
LOCK = Mode(1, 1)


def snapshot(stepper):
    """Everything a stepper holds, copied; it must all be found by name for the tests' sake."""
    arrays = {name: value.copy() for name, value in vars(stepper).items()
              if isinstance(value, np.ndarray)}
    assert sum(array.nbytes for array in arrays.values()) > 3 * 8 * stepper.max_delay / STEP
    return arrays, stepper.network, stepper.gain, stepper.symmetry


def same(one, other):
    arrays, others = one[0], other[0]
    return one[1:] == other[1:] and arrays.keys() == others.keys() and all(
        np.array_equal(arrays[name], others[name]) for name in arrays)


@pytest.mark.parametrize('lock', [None, (3.0, LOCK)])
@examples(20)
@given(tau=st.floats(0.01, 1.0), durations=st.lists(st.floats(0.0, 0.7), min_size=1, max_size=30))
def test_agrees_with_simulate(lock, tau, durations):
    # The ring wraps round several times here: it holds one time unit.
    network = replace(WALK, tau=tau)
    stepper = Stepper(network, START, 0.01, 1.0, *(lock or ()))
    run = simulate(network, START, sum(durations) + 0.02, 0.01, lock=lock)
    now = 0.0
    for duration in durations:
        now += duration
        assert np.allclose(stepper.advance(duration)[0], run(now)[0], 0.0, 1e-9)


@examples(20)
@given(st.lists(st.floats(1e-6, 0.05), min_size=2, max_size=200))
def test_many_small_advances_equal_a_large_one(durations):
    small, large = (Stepper(WALK, START, max_delay=1.0) for _ in range(2))
    for duration in durations:
        small.advance(duration)
    assert np.allclose(small.now, large.advance(sum(durations)), 0.0, 1e-9)


def test_advance_by_nothing_changes_nothing():
    stepper = Stepper(WALK, START)
    before = stepper.advance(1.2345).copy()
    assert np.array_equal(stepper.advance(0.0), before)


@pytest.mark.parametrize('network', [WALK, replace(WALK, a=-1.0, tau=0.1234)])
def test_rows_are_derivatives_of_one_another(network):
    # Central differences of x give x', those of x' give x'': inside the intervals between
    # nodes, where the interpolant is smooth.
    stepper, width = Stepper(network, START), 1e-5
    stepper.advance(1.0 + 0.1 * STEP)
    for place in (0.2, 0.37, 0.5, 0.61, 0.83):
        rows = [stepper.copy().advance(STEP * (place - 0.1) + shift * width).copy()
                for shift in (-1, 0, 1)]
        slope = (rows[2] - rows[0]) / (2.0 * width)
        assert np.allclose(slope[:2], rows[1][1:], 0.0, 1e-7)


def test_rows_satisfy_the_equation():
    # x' is what the equation says of x and of the state a delay ago, and x'' its derivative.
    a, b, c, d, tau = WALK.as_dict().values()
    now, past = Stepper(WALK, START), Stepper(WALK, START)
    now.advance(3.0 + tau)
    past.advance(3.0)
    for _ in range(50):
        x, slope, curve = now.advance(0.0317)
        old, old_slope, _ = past.advance(0.0317)
        wanted = a * x + b * np.tanh(x) + d * np.tanh(np.roll(x, 2)) + c * np.tanh(old)[SWAP]
        assert np.allclose(slope, wanted, 0.0, 1e-7)
        bend = a * slope + b * slope / np.cosh(x) ** 2 + c * (old_slope / np.cosh(old) ** 2)[SWAP]
        assert np.allclose(curve, bend + np.roll(d * slope / np.cosh(x) ** 2, 2), 0.0, 1e-3)


@pytest.mark.parametrize('changed', [replace(WALK, tau=0.7331), replace(WALK, tau=0.0456),
                                     Delayed(-2.0, 1.0, 6.5, 2.0, 0.245)])
def test_parameters_changed_while_it_runs(changed):
    # It goes on as a simulation started from the history so far, without resampling.
    stepper = Stepper(WALK, START, max_delay=0.75)
    stepper.advance(4.0)
    record = simulate(WALK, START, 4.0, STEP)
    stepper.set(changed)
    run = simulate(changed, lambda times: record(4.0 + times), 3.0, STEP)
    for now in np.arange(0.0123, 2.9, 0.0123):
        assert np.allclose(stepper.advance(0.0123)[0], run(now)[0], 0.0, 1e-7)


def test_a_refused_change_changes_nothing():
    stepper = Stepper(WALK, START, max_delay=1.0, gain=2.0, symmetry=LOCK)
    stepper.advance(2.3456)
    before, twin = snapshot(stepper), stepper.copy()
    for network, gain, mode, words in (
            (replace(WALK, tau=1.01), 2.0, LOCK, r'tau 1\.01 .* 1\.0'),
            (replace(WALK, tau=0.002), 2.0, LOCK, 'tau 0.002 must be from 0.0025'),
            (replace(WALK, c=np.nan), 2.0, LOCK, 'c=nan'), (WALK, np.inf, LOCK, 'gain inf'),
            (WALK, 2.0, None, 'symmetry class')):
        with pytest.raises(ValueError, match=words):
            stepper.set(network, gain, mode)
        assert same(snapshot(stepper), before)
    assert np.array_equal(stepper.advance(1.0), twin.advance(1.0))


@pytest.mark.parametrize(('change', 'words'), [
    ({'step': 0.0}, 'step 0'), ({'step': np.nan}, 'step nan'), ({'max_delay': 0.001}, '0.001'),
    ({'max_delay': 0.3}, r'tau 0\.4 .* 0\.3'), ({'history': START[:5]}, r'\(5,\)')])
def test_a_bad_start_is_refused(change, words):
    with pytest.raises(ValueError, match=words):
        Stepper(**{'network': WALK, 'history': START, **change})


def test_memory_is_constant():
    stepper = Stepper(WALK, solve_orbit(WALK, 'walk'), gain=10.0, symmetry=LOCK)
    arrays = {name: id(value) for name, value in vars(stepper).items()
              if isinstance(value, np.ndarray)}
    sizes = {name: array.shape for name, array in snapshot(stepper)[0].items()}
    for _ in range(100_000):
        stepper.advance(0.0031)
    assert arrays == {name: id(vars(stepper)[name]) for name in arrays}
    assert sizes == {name: array.shape for name, array in snapshot(stepper)[0].items()}
    # Still on its orbit after some 280 periods of it, so the ring was really used.
    assert np.abs(stepper.now[0]).max() > 0.7


def test_a_copy_is_independent():
    stepper = Stepper(WALK, START)
    stepper.advance(1.0)
    twin, before = stepper.copy(), snapshot(stepper)
    twin.disturb(np.ones(8))
    twin.advance(0.5)
    assert same(snapshot(stepper), before)
    assert np.abs(twin.now[0] - stepper.advance(0.5)[0]).max() > 0.1
