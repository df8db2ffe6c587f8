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

"""The Morris-Lecar networks: the papers' equations, their symmetries, and the integrator."""

from dataclasses import replace
from itertools import pairwise
import math
import pickle

from cpg_ros.analysis import analyze
from cpg_ros.dynamics.hopf import hopf_points
from cpg_ros.dynamics.integration.simulate import simulate
from cpg_ros.networks.library.biped import Biped
from cpg_ros.networks.library.quadruped import Quadruped
from cpg_ros.networks.registry import NETWORKS, PRESETS
from depth import examples
from hypothesis import assume, given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.optimize import brentq, root
from vector_functions import exp, over

KINDS = pytest.mark.parametrize('kind', [Quadruped, Biped])
START = {Quadruped: np.linspace(0.8, -0.4, 16), Biped: np.linspace(-0.4, 0.8, 8)}
WALK = {kind: PRESETS[kind.name]['walk'].network for kind in START}
# Cells i -> i + 2, and 1-2, 3-4, ... of the quadruped; all but the identity of D2.
Z4_Z2 = (2, 3, 4, 5, 6, 7, 0, 1), (1, 0, 3, 2, 5, 4, 7, 6)
D2 = (1, 0, 3, 2), (2, 3, 0, 1), (3, 2, 1, 0)


def fraction(v, middle, width):
    return (1 + np.tanh((v - middle) / width)) / 2


def equations(kind, values, x):
    """Return the paper's equations, cell by cell; complex numbers are for derivatives."""
    p, (v, w) = dict(zip(kind.parameters(), values, strict=True)), x.reshape(2, -1)
    out = np.zeros((2, kind.cells), np.result_type(x, np.asarray(values)))
    for i in range(kind.cells):
        if kind is Quadruped:
            last, beside, across = i - 2, i + 1 - 2 * (i % 2), (i + 4) % 8
            out[:, i] = (-3 * fraction(v[i], 0.2, 0.4) * (v[i] - 1) - 0.6 * (v[i] + 1.8)
                         - 1.8 * w[i] * (v[i] + 0.8) + 1
                         + p['alpha'] * v[last] + p['gamma'] * v[beside] + p['xi'] * v[across],
                         0.2 * np.cosh((v[i] - 0.3) / 0.4) * (fraction(v[i], 0.3, 0.2) - w[i])
                         + p['beta'] * w[last] + p['delta'] * w[beside] + p['eta'] * w[across])
        else:
            out[:, i] = (-0.9 * fraction(v[i], 0.01, 0.15) * (v[i] - 1) - 2 * w[i] * (v[i] + 0.7)
                         - 0.5 * (v[i] + 0.5) + p['current']
                         - sum(p[f'w_{j + 1}{i + 1}'] * (v[i] - v[j]) for j in {*range(4)} - {i}),
                         p['phi'] * (1 + np.cosh((v[i] - 0.1) / 0.3)) / 2
                         * (fraction(v[i], 0.1, 0.15) - w[i]))
    return out.ravel()


def networks(kind, reach):
    speeds = 2 if kind is Biped else 0
    return st.builds(kind, *[st.floats(0.1, 0.5)] * speeds, *[st.floats(-reach, reach)] * (
        len(kind.parameters()) - speeds))


def states(kind, reach, lanes):
    return arrays(float, (lanes, kind.cells * 2), elements=st.floats(-reach, reach))


def numbers(network):
    return np.array(list(network.as_dict().values()))


def close(got, want, fraction):
    return np.allclose(got, want, 0.0, fraction * (1.0 + np.abs(want).max()))


@KINDS
@examples(25)
@given(data=st.data())
def test_rates_and_derivatives_are_those_of_the_papers_equations(kind, data):
    # One alone, and full and half empty blocks of lanes, each with parameters of its own.
    lanes = data.draw(st.sampled_from([1, 3, 8, 11]))
    sets = [data.draw(networks(kind, 1.0)) for _ in range(lanes)]
    run = simulate(sets, data.draw(states(kind, 2.0, lanes)), 0.05, 0.01)
    alone = simulate(sets[0], run.x[0, 0], 0.05, 0.01)
    for network, x, slopes in [*zip(sets, run.x, run.slopes, strict=True),
                               (sets[0], alone.x, alone.slopes)]:
        want = np.array([equations(kind, numbers(network), row) for row in x])
        assert close(slopes, want, 1e-11) and close(network.rates(x), want, 1e-12)
    # Derivatives by steps in the complex plane, exact to rounding.
    p, by_state, by_set = numbers(sets[0]), sets[0].jacobian(x), sets[0].by_parameter(x)
    for k in (0, -1):
        wanted = [equations(kind, p, x[k] + 1e-30j * one).imag for one in np.eye(x[k].size)]
        assert close(by_state[k], np.transpose(wanted) * 1e30, 1e-12)
        wanted = [equations(kind, p + 1e-30j * one, x[k]).imag for one in np.eye(p.size)]
        assert close(by_set[k], np.transpose(wanted) * 1e30, 1e-12)


def test_exponential_over_its_whole_range():
    rng, few = np.random.default_rng(4), [0.0, -0.0, 5e-324, 0.5 * math.log(2.0), 700.0, -700.0]
    values = np.concatenate([rng.uniform(-700.0, 700.0, 100_000), rng.uniform(-1.0, 1.0, 20_001),
                             10 ** rng.uniform(-308, 0, 10_000), few])
    out = over('exp', values)
    assert (np.abs(out - np.exp(values)) <= 4.0 * np.spacing(np.exp(values))).all()
    # Limited beyond, so that 1 / exp is never 0 and never infinite; a NaN beside numbers stays.
    wild = np.array([701.0, 1e308, np.inf, np.nan, -701.0, -1e308, -np.inf, -np.nan] * 3)
    out = over('exp', wild)
    ends = np.tile(np.exp([700.0] * 3 + [np.nan] + [-700.0] * 3 + [np.nan]), 3)
    assert np.allclose([out, [exp(x) for x in wild]], ends, 1e-15, 0.0, equal_nan=True)


def shared(network, group):
    """Return the biped with one weight for all pairs that the group takes to one another."""
    def weight(name):
        j, k = (int(digit) - 1 for digit in name[2:])
        return getattr(network, 'w_{}{}'.format(*min((h[j] + 1, h[k] + 1) for h in group)))
    return replace(network, **{name: weight(name) for name in Biped.parameters()[2:]})


@examples(40)
@given(st.data(), st.sampled_from([*Z4_Z2, *D2]))
def test_equivariance(data, g):
    # The quadruped's under Z4 x Z2, the biped's under what of D2 leaves its weights alone.
    kind = Quadruped if len(g) == 8 else Biped
    network, (x,) = data.draw(networks(kind, 0.3)), data.draw(states(kind, 1.0, 1))
    if kind is Biped:
        network = shared(network, ((0, 1, 2, 3), *(D2 if data.draw(st.booleans()) else [g])))
    places = [*g, *(len(g) + i for i in g)]
    straight, turned = (simulate(network, y, 4.0, 0.02).x for y in (x, x[np.argsort(places)]))
    # Outside the cells' range a state may grow without bound.
    assume(np.isfinite(straight).all())
    assert close(turned[:, places], straight, 1e-9)


@KINDS
def test_solves_the_equations_with_fourth_order(kind):
    p, times = numbers(WALK[kind]), np.linspace(0.0, 15.0, 151)
    exact = solve_ivp(lambda t, x: equations(kind, p, x), (0.0, 15.0), START[kind], 'DOP853',
                      times, rtol=1e-11, atol=1e-12).y.T
    *errors, own = (np.abs(simulate(WALK[kind], START[kind], 15.0, step)(times) - exact).max()
                    for step in (0.05, 0.025, 0.0125, kind.step))
    assert all(15.0 < coarse / fine < 19.0 for coarse, fine in pairwise(errors))
    assert own < 2e-6


@KINDS
@pytest.mark.parametrize('batch', [1, 2, 8, 9, 20])
def test_batches_single_runs_and_some_of_their_rows_agree(kind, batch, monkeypatch):
    rng = np.random.default_rng(batch)
    starts = rng.uniform(-0.3, 0.8, (batch, 2 * kind.cells))
    sets = [kind(*numbers(WALK[kind]) * rng.uniform(0.8, 1.2)) for _ in starts]
    single = [simulate(*pair, 10.0, 0.02).x for pair in zip(sets, starts, strict=True)]
    for chunk in (50_000, 10**7):
        monkeypatch.setattr('cpg_ros.dynamics.integration.simulate.CHUNK_WORK', chunk)
        run, few = (simulate(sets, starts, 9.94, 0.02, every=every) for every in (1, 7))
        assert np.allclose(run.x, np.array(single)[:, :498], 0.0, 1e-12)
        assert np.array_equal([few.x, few.slopes], [run.x[:, ::7], run.slopes[:, ::7]])
        assert np.allclose(few.t, run.t[::7], 1e-15, 0.0)
    first, again, other, few = (
        simulate(sets, starts, 2.0, 0.02, noise=0.1, seed=seed, every=every).x
        for seed, every in ((3, 1), (3, 1), (4, 1), (3, 10)))
    assert np.array_equal(first, again) and np.array_equal(few, first[:, ::10])
    assert not (first[:, 1:] == other[:, 1:]).any()


def test_the_stand_of_the_quadruped():
    # Section 6: where an uncoupled cell rests, found on w = n(v) of this file's equations.
    def on_nullcline(v):
        return np.repeat([v, fraction(v, 0.3, 0.2)], 8)
    v = brentq(lambda v: equations(Quadruped, [0.0] * 6, on_nullcline(v))[0], 0.2, 0.4, xtol=1e-15)
    assert (v, fraction(v, 0.3, 0.2)) == pytest.approx((0.3096, 0.5240), abs=5e-5)
    stand, network = on_nullcline(v), Quadruped(0.0, 0.0, 0.0, 0.0)
    assert np.trace(network.jacobian(stand)) / 8 == pytest.approx(-1.2407, abs=5e-5)
    assert np.abs(simulate(network, stand, 10.0, 0.01).x - stand).max() < 1e-13


# -- constants of the cells ----------------------------------------------------------------------

VARYING = NETWORKS['quadruped+current+v4+diffusion']


@KINDS
def test_constants_do_not_change_what_they_are_in(kind):
    varying = kind.varying(*kind.constants)
    assert not varying.constants
    network = varying(**WALK[kind].as_dict())
    x = START[kind] + 0.1
    assert network.rates(x) == pytest.approx(WALK[kind].rates(x), abs=1e-13)
    assert set(varying.presets()) == set(kind.presets())


def test_a_constant_is_a_parameter_of_the_network_that_names_it():
    network = VARYING(**WALK[Quadruped].as_dict(), current=0.7, v4=0.25, diffusion=0.3)
    assert pickle.loads(pickle.dumps(network)) == network
    v, w = START[Quadruped].reshape(2, -1)
    p, cells = WALK[Quadruped], np.arange(8)
    last, beside, across = (cells - 2) % 8, cells ^ 1, (cells + 4) % 8
    rates = np.stack([
        -3 * fraction(v, 0.2, 0.4) * (v - 1) - 0.6 * (v + 1.8) - 1.8 * w * (v + 0.8) + 0.7
        + p.alpha * (v[last] - 0.3 * v) + p.gamma * (v[beside] - 0.3 * v)
        + p.xi * (v[across] - 0.3 * v),
        0.2 * np.cosh((v - 0.3) / 0.5) * (fraction(v, 0.3, 0.25) - w)
        + p.beta * (w[last] - 0.3 * w) + p.delta * (w[beside] - 0.3 * w)
        + p.eta * (w[across] - 0.3 * w)])
    assert network.rates(START[Quadruped]) == pytest.approx(rates.ravel(), abs=1e-13)


def test_diffusive_coupling_does_not_act_between_equal_cells():
    network = VARYING(**WALK[Quadruped].as_dict(), diffusion=1.0)
    alone = VARYING(0.0, 0.0, 0.0, 0.0)
    equal = np.repeat([0.3, 0.1], 8)
    assert network.rates(equal) == pytest.approx(alone.rates(equal), abs=1e-15)


def test_hopf_points_over_the_current_are_those_of_the_linearised_cell():
    network = NETWORKS['quadruped+current'](**PRESETS['quadruped']['trot'].network.as_dict())
    point = next(point for point in hopf_points(network, 'current', 0.5, 1.5)
                 if point.gait == 'trot')
    at = network.replace(current=point.value)
    rest = root(lambda cell: at.rates(np.repeat(cell, 8))[[0, 8]], (0.2, 0.4)).x
    eigenvalues = np.linalg.eigvals(at.jacobian(np.repeat(rest, 8)))
    assert np.abs(eigenvalues - 1j * point.omega).min() < 1e-6


def test_constants_on_the_command_line(capsys):
    assert analyze.main(['--network', 'quadruped', '--preset', 'trot', '--set', 'current=1.02',
                         '--json']) == 0
    assert '"current": 1.02' in capsys.readouterr().out
    assert analyze.main(['--network', 'quadruped', '--along', 'current']) == 2
    assert 'parameter of quadruped+current' in capsys.readouterr().err
    assert analyze.main(['--network', 'quadruped+mass']) == 2
    assert "'mass' is not a constant of the network quadruped" in capsys.readouterr().err
