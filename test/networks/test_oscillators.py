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

"""The oscillator networks against their papers' equations, and all that every network shows.

Matsuoka's trot is followed exactly from kink to kink by matrix exponentials.
"""

from dataclasses import replace

from cpg_ros.dynamics.arclength import NoOrbit
from cpg_ros.dynamics.floquet import multipliers
from cpg_ros.dynamics.hopf import hopf_points
from cpg_ros.dynamics.integration.simulate import simulate
from cpg_ros.dynamics.solve_orbit import solve_orbit, solve_preset
from cpg_ros.dynamics.stability import stability
from cpg_ros.motion.pattern import Pattern
from cpg_ros.motion.plan import plan
from cpg_ros.motion.robot_file import load_robot
from cpg_ros.networks.library import shipped
from cpg_ros.networks.network import ParameterLine, stated_gait
from cpg_ros.networks.registry import NETWORKS, PRESETS
from depth import examples, in_depth, spread
from hypothesis import given
from hypothesis import strategies as st
import numpy as np
from oscillator_equations import logistic, neurons, polar, TURN
import pytest
from scipy.integrate import quad, solve_ivp
from scipy.linalg import expm
from scipy.optimize import brentq

NAMES = tuple(network.name for network in shipped()
              if network.name not in ('delayed', 'quadruped', 'biped'))
ALL = [(network, gait) for network in NAMES for gait in PRESETS[network]]
HEXAPODS = [(f'{network}6', gait) for network in NAMES for gait in ('tripod', 'ripple', 'wave')]
LEGS = ('lh', 'rh', 'lf', 'rf')
PAPERS = {'phase': polar, 'hopf': logistic, 'matsuoka': neurons}


def followed(network, start, duration):
    """The paper's equations from a state on."""
    run = solve_ivp(PAPERS[type(network).name.rstrip('0123456789')](network), (0.0, duration),
                    start, method='DOP853', rtol=1e-11, atol=1e-12, max_step=duration / 400)
    return run.y[:, -1]


@pytest.mark.parametrize(('network', 'gait'), spread(ALL, 2) + in_depth(*HEXAPODS))
def test_every_gait_is_an_orbit_of_the_papers_equations_and_attracts(network, gait):
    preset = PRESETS[network][gait]
    orbit = solve_preset(preset)
    end = followed(preset.network, orbit(np.zeros(1))[0], orbit.period)
    assert np.abs(end - orbit(np.zeros(1))[0]).max() < 1e-7
    assert orbit.residual < 1e-9 and stability(orbit).reason == ''
    assert multipliers(orbit, stability(orbit).lock_gain).attracts
    assert multipliers(orbit).trivial == pytest.approx(1.0, abs=1e-9)
    # Cell 1 peaks at phase 0, and every cell does what its phase and wave say.
    theta = np.linspace(0.0, 1.0, 37)
    states = orbit(theta * orbit.period)[:, :preset.network.cells]
    assert orbit.waveform(np.zeros(1))[0] == pytest.approx(orbit.waveform(theta).max(), abs=1e-9)
    for cell, (phase, wave) in enumerate(zip(orbit.phases, orbit.waves, strict=True)):
        assert np.allclose(states[:, cell], orbit.waveform(theta + phase, 0, int(wave)), 0, 1e-12)


def rhythm(run, period, cells):
    """Period of cell 1 and phases of the cells from the first harmonic, a period a window."""
    window = round(period / run.t[1])
    x = run.x[:len(run.x) // window * window, :cells].reshape(-1, window, cells)
    c = np.einsum('mwi,w->mi', x, np.exp(-1j * TURN * np.arange(window) / window))
    ahead = np.angle((c[1:, 0] * c[:-1, 0].conj()).sum()) / TURN
    return window * run.t[1] / (1.0 + ahead), np.angle((c * c[:, :1].conj()).sum(axis=0)) / TURN


def off(phases, wanted):
    return np.abs((phases - phases[0] - wanted + wanted[0] + 0.5) % 1.0 - 0.5).max()


#: Share by which periods of simulation and orbit agree.
AGREE = 1e-6


@pytest.mark.parametrize(('network', 'gait'), spread(ALL))
def test_simulation_and_orbit_agree_and_noise_is_survived(network, gait):
    preset = PRESETS[network][gait]
    orbit, kind = solve_preset(preset), NETWORKS[network]
    run = simulate(preset.network, orbit, 40.0 * orbit.period, orbit.period / round(
        orbit.period / kind.step), progress=False)
    period, phases = rhythm(run, orbit.period, kind.cells)
    assert period == pytest.approx(orbit.period, rel=AGREE)
    assert off(phases, orbit.phases) < 1e-3
    judged = stability(orbit)
    noisy = simulate(preset.network, orbit, 200.0, orbit.period / 400, noise=0.02, seed=3,
                     lock=(judged.lock_gain, orbit.symmetry), progress=False)
    period, phases = rhythm(noisy, orbit.period, kind.cells)
    assert period == pytest.approx(orbit.period, rel=0.01)
    assert off(phases, orbit.phases) < 0.03


@pytest.mark.parametrize('network', [name for name in NAMES if name != 'phase']
                         + in_depth('phase'))
def test_every_ordered_pair_switches_within_the_two_gaits_speeds(network):
    robot = load_robot('quadruped')
    plans = {name: plan(robot, name, preset, preset.network, 2.0)
                for name, preset in PRESETS[network].items()}
    for old in plans:
        for new in (name for name in plans if name != old):
            pattern = Pattern(plans[old], ramp=0.05)
            for _ in range(20):
                pattern.advance(0.02)
            pattern.apply(plans[new], 0.3)
            speed = np.maximum(plans[old].speed, plans[new].speed) * (1.0 + 1e-3) + 1e-9
            for _ in range(45):
                before = pattern.position.copy()
                pattern.advance(0.02)
                assert (np.abs(pattern.position - before) <= 0.02 * speed).all(), (old, new)
                assert (np.abs(pattern.velocity) <= speed).all(), (old, new)
            wanted = plans[new].orbit.phases[:4]
            assert off(np.array(pattern.phases), wanted) < 0.01, (old, new)


# -- phase ------------------------------------------------------------------------------------

offsets = st.lists(st.floats(-0.5, 0.5), min_size=4, max_size=4)


@examples(15)
@given(offsets, st.floats(0.3, 5.0), st.floats(0.2, 3.0), st.floats(2.0, 60.0),
       st.floats(0.05, 3.0))
def test_any_phases_are_a_gait(phases, nu, r, a, w):
    network = NETWORKS['phase'](nu, r, a, w, *phases)
    orbit = solve_orbit(network, stated_gait(network))
    assert orbit.period == pytest.approx(1.0 / nu, rel=1e-9)
    assert orbit.peak == pytest.approx(r, rel=1e-9)
    assert off(orbit.phases, np.array(phases)) < 1e-12
    found = np.sort(np.abs(multipliers(orbit).within))[::-1]
    # Phases decay at 4 w R; amplitudes at a/2, twice each, which numerics split a little.
    wanted = np.sort([*[np.exp(-4.0 * w * r / nu)] * 3, *[np.exp(-0.5 * a / nu)] * 8])[::-1]
    assert np.allclose(found[:11], wanted, 0.0, 2e-4)
    by_offset = dict(zip(network.parameters(), orbit.d_period, strict=True))
    assert by_offset['nu'] == pytest.approx(-1.0 / nu**2, rel=1e-8)


def test_phase_differences_converge_and_amplitudes_come_back_critically_damped():
    network = PRESETS['phase']['trot'].network
    start = network.on_orbit('trot')[0]
    turned = np.array([0.0, 0.01, -0.02, 0.03]) * TURN
    angle = np.arctan2(start[4:8], start[:4]) + turned
    small = 0.4
    state = np.concatenate([small * np.cos(angle), small * np.sin(angle), np.zeros(4)])
    run = simulate(network, state, 1.0, 0.001, progress=False)
    r = np.hypot(run.x[:, :4], run.x[:, 4:8])
    half = 0.5 * network.a * run.t
    damped = network.r - (network.r - small) * (1.0 + half) * np.exp(-half)
    assert np.abs(r - damped[:, None]).max() < 1e-9
    # Small differences decay at w times the sum of all amplitudes.
    theta = np.arctan2(run.x[:, 4:8], run.x[:, :4]) - angle + turned
    apart = (theta - theta[:, :1] + np.pi) % TURN - np.pi
    way = np.concatenate([[0.0], np.cumsum(0.5 * (r[1:].sum(1) + r[:-1].sum(1)) * np.diff(run.t))])
    kept = apart[:, 1:] / apart[0, 1:]
    assert np.abs(kept - np.exp(-network.w * way)[:, None]).max() < 5e-3


def test_a_change_without_transition_is_left_to_the_oscillators():
    robot, presets = load_robot('quadruped'), PRESETS['phase']
    walk, canter = (plan(robot, name, presets[name], presets[name].network, 1.0)
                    for name in ('walk', 'canter_right'))
    pattern = Pattern(walk, ramp=0.05)
    for _ in range(100):
        pattern.advance(0.01)
    pattern.apply(canter, 0.0)
    for _ in range(800):
        pattern.advance(0.01)
    assert off(np.array(pattern.phases), canter.orbit.phases) < 1e-3


# -- hopf -------------------------------------------------------------------------------------

def alone(kind, gait, **changes):
    """A preset whose legs do not hear each other."""
    return replace(PRESETS[kind][gait].network, **{
        **dict.fromkeys(NETWORKS[kind].couplings, 0.0), **changes})


@pytest.mark.parametrize(('duty', 'b', 'mu'), [(0.6, 20.0, 1.0), (0.75, 50.0, 1.0),
                                               (0.3, 30.0, 2.0)])
def test_a_hopf_oscillator_alone_stands_for_its_duty(duty, b, mu):
    network = alone('hopf', 'trot', duty=duty, b=b, mu=mu, nu=1.5)
    orbit = solve_orbit(network, 'trot')
    stance, swing = np.pi * 1.5 / duty, np.pi * 1.5 / (1.0 - duty)

    def slowness(angle):
        y = np.sqrt(mu) * np.sin(angle)
        return 1.0 / (stance / (np.exp(-b * y) + 1.0) + swing / (np.exp(b * y) + 1.0))

    stands = quad(slowness, 0.0, np.pi, points=[1e-2, np.pi - 1e-2], epsabs=1e-13)[0]
    swings = quad(slowness, np.pi, TURN, points=[np.pi + 1e-2, TURN - 1e-2], epsabs=1e-13)[0]
    assert orbit.period == pytest.approx(stands + swings, rel=1e-9)
    assert orbit.peak == pytest.approx(np.sqrt(mu), rel=1e-9)
    # x falls in stance; y crosses 0 where swing begins.
    begins = brentq(lambda theta: float(orbit.waveform(np.array([theta]), 0, 0, 1)[0]), 0.1, 0.9)
    assert begins == pytest.approx(stands / (stands + swings), abs=1e-9)
    assert begins == pytest.approx(duty, abs=0.3 / b)


def test_hopf_points_are_where_the_trace_vanishes():
    network = PRESETS['hopf']['trot'].network
    line = ParameterLine.parse('mu', NETWORKS['hopf'])
    found = {point.gait: point for point in hopf_points(network, line, -1.0, 1.0)}
    # Class of the gait: eigenvalue of k for its pattern, 3 for the trot and -1 for the others.
    for gait, eigenvalue in (('trot', 3.0), ('pace', -1.0), ('bound', -1.0), ('pronk', -1.0)):
        assert found[gait].value == pytest.approx(-eigenvalue / 55.0, abs=1e-9)
    with pytest.raises(NoOrbit):
        solve_orbit(replace(network, mu=-0.5), 'trot')


# -- matsuoka ---------------------------------------------------------------------------------

def exact_period(tau, tau_v, beta, a, c, k=0.0):
    """Period of two neurons that inhibit each other, k (y - y_e) added: exact between kinks."""
    def matrices(on):
        m = np.zeros((5, 5))
        for i, e in ((0, 1), (1, 0)):
            m[i, i], m[i, 2 + i], m[i, 4] = -1.0, -beta, c
            m[i, i] += k * on[i]
            m[i, e] -= (a + k) * on[e]
            m[i] /= tau
            m[2 + i, i], m[2 + i, 2 + i] = on[i] / tau_v, -1.0 / tau_v
        return m

    state, t, rises = np.array([0.5, -0.3, 0.1, 0.2, 1.0]), 0.0, []
    while len(rises) < 60:
        flow = matrices(state[:2] > 0.0)
        step = 0.02 * tau_v
        while True:
            after = expm(flow * step) @ state
            if (after[:2] > 0.0).tolist() != (state[:2] > 0.0).tolist():
                break
            state, t = after, t + step
        one = int(np.argmax((after[:2] > 0.0) != (state[:2] > 0.0)))
        at = brentq(lambda s, one=one, flow=flow, state=state: (expm(flow * s) @ state)[one],
                    0.0, step, xtol=1e-15)
        rising = after[one] > 0.0
        state, t = expm(flow * at) @ state, t + at
        state[one] = 1e-15 if rising else -1e-15
        if one == 0 and rising:
            rises.append(t)
    return rises[-1] - rises[-2]


def test_kinks_cost_the_orbit_no_accuracy():
    network = PRESETS['matsuoka']['trot'].network
    # On the trot legs in phase and out of phase push alike: 3 weights of 0.05.
    wanted = exact_period(0.15, 0.6, 2.5, 2.0, 1.0, 0.15)
    orbit = solve_orbit(network, 'trot')
    assert orbit.period == pytest.approx(wanted, rel=1e-12)
    more, less = (solve_orbit(replace(network, beta=2.5 + step), 'trot').period
                  for step in (1e-4, -1e-4))
    slope = dict(zip(network.parameters(), orbit.d_period, strict=True))['beta']
    assert slope == pytest.approx((more - less) / 2e-4, rel=1e-6)


def test_a_simulation_over_kinks_is_of_second_order():
    network = PRESETS['matsuoka']['trot'].network
    wanted = exact_period(0.15, 0.6, 2.5, 2.0, 1.0, 0.15)
    orbit = solve_orbit(network, 'trot')

    def off_by(step):
        # A kink is anywhere in its step: several that hardly differ.
        each = [rhythm(simulate(network, orbit, 20.0 * wanted, wanted / (round(wanted / step) + k),
                                progress=False), wanted, 8)[0] / wanted - 1.0 for k in range(6)]
        return np.sqrt(np.mean(np.square(each)))

    order = np.log(off_by(0.016) / off_by(0.002)) / np.log(8.0)
    assert order == pytest.approx(2.0, abs=0.35)


@pytest.mark.deep  # the papers' reproduction has the same
@pytest.mark.parametrize('fraction', [0.5, 1.0, 2.0])
def test_two_neurons_obey_matsuokas_laws(fraction):
    """Scale with c, speed with the time constants, oscillate for 1 + tau/tau_v < a < 1 + beta."""
    network = alone('matsuoka', 'trot')
    known, scaled = (solve_orbit(one, 'trot') for one in (
        network, replace(network, c=fraction, tau=0.15 * fraction, tau_v=0.6 * fraction)))
    assert scaled.period == pytest.approx(fraction * known.period, rel=1e-9)
    assert scaled.peak == pytest.approx(fraction * known.peak, rel=1e-9)
    for a in (1.25 - 0.01, 3.5 + 0.01):
        with pytest.raises(NoOrbit):
            solve_orbit(replace(network, a=a), 'trot')


def test_the_frequency_formula_holds_near_onset():
    for a, close in ((1.52, 1e-3), (1.6, 2e-2)):
        network = alone('matsuoka', 'trot', tau=0.3, tau_v=0.6, a=a)
        period = solve_orbit(network, 'trot').period
        assert period == pytest.approx(exact_period(0.3, 0.6, 2.5, a, 1.0), rel=1e-8)
        assert TURN / period == pytest.approx(network.omega, rel=close)
