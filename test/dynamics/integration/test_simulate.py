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

"""Simulation against the equation solved by other means, and its symmetries."""

from dataclasses import replace
from itertools import pairwise

from cpg_ros.dynamics.integration.simulate import simulate
from cpg_ros.dynamics.solve_orbit import solve_orbit
from cpg_ros.networks.library.delayed import Delayed
from depth import examples
from hypothesis import given
from hypothesis import strategies as st
from jitcdde import jitcdde, t, y
from modes import class_of, MODES
import numpy as np
import pytest
from scipy.integrate import solve_ivp
import symengine

WALK = Delayed(-4.5, 1.0, 6.5, -2.0, 0.4)
START = np.array([0.1, -0.1, 0.1, -0.1, -0.1, 0.1, -0.1, 0.1])
SWAP = [1, 0, 3, 2, 5, 4, 7, 6]

rates = st.floats(-3.0, 3.0)
networks = st.builds(Delayed, st.floats(-5.0, 0.5), rates, rates, rates, st.floats(0.2, 0.8))
states = st.lists(st.floats(-1.5, 1.5), min_size=8, max_size=8).map(np.array)


def by_steps(network, history, spans):
    """Solution over spans delays with scipy, one delay at a time; a function of times."""
    a, b, c, d, tau = network.as_dict().values()
    pieces = [history]
    for start in np.arange(spans) * tau:
        def slope(time, x, last=pieces[-1]):
            past = last(time - tau)
            return a * x + b * np.tanh(x) + d * np.tanh(np.roll(x, 2)) + c * np.tanh(past[SWAP])
        pieces.append(solve_ivp(slope, (start, start + tau), pieces[-1](start), 'DOP853',
                                dense_output=True, rtol=1e-11, atol=1e-12).sol)
    return lambda times: np.array([pieces[min(int(s / tau), spans - 1) + 1](s) for s in times])


@pytest.fixture(scope='module')
def published():
    """Return Example 1's walk from START by jitcdde: times, most off any grid, and states."""
    a, b, c, d, tau = WALK.as_dict().values()
    f = [a * y(i) + b * symengine.tanh(y(i)) + d * symengine.tanh(y((i - 2) % 8))
         + c * symengine.tanh(y(SWAP[i], t - tau)) for i in range(8)]
    dde = jitcdde(f, delays=[0.0, tau], max_delay=tau, verbose=False)
    dde.compile_C(simplify=False, extra_compile_args=['-O1', '-w'])
    dde.constant_past(START)
    dde.adjust_diff(1e-8)
    dde.integrate_blindly(2.0, 1e-4)  # over the kinks at the first delays
    dde.set_integration_parameters(rtol=1e-11, atol=1e-12, max_step=0.02, first_step=1e-3)
    times = np.append(np.linspace(3.003, 19.99, 60), 20.0)
    return times, np.array([dde.integrate(time) for time in times])


def test_error_after_twenty_units(published):
    # docs/numbers_and_errata.md, section Step and readout: 7.5e-7 at h = tau / 40, between the
    # nodes as well.
    times, states = published
    assert 1e-8 < np.abs(simulate(WALK, START, 20.0, 0.01)(times) - states).max() < 1e-6
    assert np.abs(simulate(WALK, START, 20.0, 0.4 / 500)(times) - states).max() < 1e-9


def test_fourth_order_from_a_constant_history(published):
    times, states = published
    errors = [np.abs(simulate(WALK, START, 20.0, 0.4 / n)(times) - states).max()
              for n in (20, 40, 80, 160)]
    assert all(14.0 < coarse / fine < 18.0 for coarse, fine in pairwise(errors))


def test_fourth_order_where_the_delay_falls_between_nodes():
    orbit = solve_orbit(WALK, 'walk')
    times = np.linspace(0.0, 7.9, 200)
    errors = [np.abs(simulate(WALK, orbit, 8.0, 0.4 / n)(times) - orbit(times)).max()
              for n in (20.37, 40.74, 81.48, 162.96)]
    assert all(13.0 < coarse / fine < 19.0 for coarse, fine in pairwise(errors))


@examples(25)
@given(networks, states, st.integers(60, 90))
def test_solves_the_equation(network, start, divisions):
    # Every term and index, at random parameters; a constant history has its kinks on nodes.
    exact = by_steps(network, lambda s: start, 3)
    times = np.linspace(0.0, 3.0 * network.tau, 31)[:-1]
    run = simulate(network, start, 3.0 * network.tau, network.tau / divisions)
    assert np.abs(run(times) - exact(times)).max() < 1e-6


def test_history_given_as_a_function_without_slopes():
    def history(times):
        return 0.3 * np.sin(np.multiply.outer(times, np.arange(1.0, 9.0)) + START)
    times = np.linspace(0.0, 1.59, 40)
    run = simulate(WALK, history, 1.6, 0.4 / 160)
    assert np.allclose(run(times), by_steps(WALK, history, 4)(times), 0.0, 1e-7)


@pytest.mark.parametrize('batch', [1, 2, 5, 8, 9, 17, 20])
def test_a_batch_equals_single_runs(batch, monkeypatch):
    # Lanes and blocks, full ones and not, with delays of their own, in chunks and at once.
    rng = np.random.default_rng(batch)
    starts = rng.normal(0.0, 0.5, (batch, 8))
    sets = [replace(WALK, c=rng.uniform(-7, 7), tau=rng.uniform(0.1, 0.9)) for _ in starts]
    for one, many in ((WALK, starts), (sets, START), (sets, starts)):
        pairs = zip(sets if one is sets else [WALK] * batch,
                    starts if many is starts else [START] * batch, strict=True)
        single = [simulate(*pair, 3.0, 0.01)(np.linspace(0.0, 3.0, 323)) for pair in pairs]
        for chunk in (7 * 64, 10**7):
            monkeypatch.setattr('cpg_ros.dynamics.integration.simulate.CHUNK_WORK', chunk)
            runs = simulate(one, many, 3.0, 0.01)(np.linspace(0.0, 3.0, 323))
            assert np.allclose(runs, single, 0.0, 1e-10)


@examples(40)
@given(networks, states)
def test_equivariance(network, start):
    straight = simulate(network, start, 4.0, 0.02).x
    for turn in (lambda x: np.roll(x, 2, axis=-1), lambda x: x[..., SWAP], np.negative):
        turned = simulate(network, turn(start), 4.0, 0.02).x
        assert np.allclose(turned, turn(straight), 1e-9, 1e-9)


@pytest.mark.parametrize('mode', MODES, ids=str)
@examples(10)
@given(network=networks, fraction=st.lists(st.floats(-1.0, 1.0), min_size=2, max_size=2))
def test_symmetry_classes_are_invariant(mode, network, fraction):
    # Said without the class: x_{i+2} = +-x_i, or x_{i+4} = -x_i for j = 1, 3; x_s(i) = +-x_i.
    x = simulate(network, np.array(fraction[:len(mode.basis)]) @ mode.basis, 3.0, 0.02).x
    j, k = class_of(mode)
    steps, sign = (4, -1) if j % 2 else (2, 1 - j)
    assert np.allclose(np.roll(x, steps, axis=1), sign * x, 1e-9, 1e-9)
    assert np.allclose(x[:, SWAP], (-1) ** k * x, 1e-9, 1e-9)


@pytest.mark.parametrize(('network', 'history', 't_end', 'step', 'words'), [
    (replace(WALK, tau=0.005), START, 1.0, 0.01, r'delay 0.005 .* step 0.01'),
    (replace(WALK, b=np.nan), START, 1.0, 0.01, 'b=nan'),
    (WALK, START[:7], 1.0, 0.01, r'\(8,\), not \(7,\)'),
    (WALK, START * np.nan, 1.0, 0.01, r'history .* not finite'),
    ([WALK, WALK], np.zeros((3, 8)), 1.0, 0.01, r'2 networks .* 3 histories'),
    (WALK, START, 0.0, 0.01, r't_end 0\.0'),
    (WALK, START, np.inf, 0.01, 't_end inf'),
    (WALK, START, 1.0, 0.0, r'step 0\.0'),
    (WALK, START, 1.0, np.nan, 'step nan')])
def test_refuses(network, history, t_end, step, words):
    with pytest.raises(ValueError, match=words):
        simulate(network, history, t_end, step)


def test_what_runs_away_is_said():
    growing = replace(WALK, a=9.0)
    with pytest.warns(RuntimeWarning, match=r'2 of 3 simulations end .* steps of 0\.01 '):
        run = simulate([growing, WALK, growing], START, 100.0, 0.01)
    assert [np.isfinite(x[-1]).all() for x in run.x] == [False, True, False]


@pytest.mark.parametrize('time', [-0.01, 1.02, np.nan])
def test_no_value_outside_the_simulated_span(time):
    with pytest.raises(ValueError, match='from 0 to 1'):
        simulate(WALK, START, 1.0, 0.01)([0.5, time])
