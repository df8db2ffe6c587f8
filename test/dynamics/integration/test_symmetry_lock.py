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

"""The symmetry lock, noise, and what the network ends in without the lock."""

from cpg_ros.dynamics.integration.simulate import simulate
from cpg_ros.dynamics.integration.stepper import Stepper
from cpg_ros.dynamics.solve_orbit import solve_orbit
from cpg_ros.networks.library.delayed import Delayed, PRESETS
from cpg_ros.networks.symmetry import GAITS
from depth import examples
from hypothesis import given
from hypothesis import strategies as st
from modes import eigenvalue_terms, Mode, MODES
import numpy as np
import pytest
from scipy.special import lambertw

SWAP = [1, 0, 3, 2, 5, 4, 7, 6]
rates = st.floats(-4.0, 4.0)
networks = st.builds(Delayed, st.floats(-6.0, 1.0), rates, rates, rates, st.floats(0.05, 1.0))


def field(network, x, past):
    """Liu & Zhang (2024), eq. 1.1."""
    return (network.a * x + network.b * np.tanh(x) + network.d * np.tanh(np.roll(x, 2))
            + network.c * np.tanh(past[SWAP]))


def rhythm(run, period, start):
    """First harmonic of each cell, stride period and phases of the cells, from start on."""
    # In windows of one expected period, so that a phase wandering with the noise does not blur.
    window = round(period / run.t[1])
    x = run.x[run.t >= start]
    x = x[:len(x) // window * window].reshape(-1, window, 8)
    turn = np.exp(-2j * np.pi * np.arange(window) / window)
    c = np.einsum('mwi,w->mi', x, turn) / window
    ahead = np.angle((c[1:] * c[:-1].conj()).mean()) / (2.0 * np.pi)
    return (2.0 * np.abs(c).mean(axis=0), window * run.t[1] / (1.0 + ahead),
            np.angle((c * c[:, :1].conj()).mean(axis=0)) / (2.0 * np.pi))


def phase_error(phases, wanted):
    return np.abs((phases - wanted + 0.5) % 1.0 - 0.5).max()


def test_projectors_split_the_cells_into_the_six_classes():
    projectors = [mode.basis.T @ mode.basis for mode in (Mode(*jk) for jk in GAITS.values())]
    for projector in projectors:
        assert np.allclose(projector @ projector, projector.T, 0.0, 1e-14)
        for symmetry in (np.roll(np.eye(8), 2, axis=0), np.eye(8)[SWAP]):
            assert np.allclose(projector @ symmetry, symmetry @ projector, 0.0, 1e-14)
    assert np.allclose(sum(projectors), np.eye(8), 0.0, 1e-14)


@pytest.mark.parametrize('mode', MODES, ids=str)
@examples(20)
@given(network=networks, fraction=st.lists(st.floats(-2.0, 2.0), min_size=4, max_size=4))
def test_the_vector_field_keeps_each_class(mode, network, fraction):
    basis = mode.basis
    out = field(network, fraction[:len(basis)] @ basis, fraction[2:2 + len(basis)] @ basis)
    assert np.allclose(basis.T @ (basis @ out), out, 0.0, 1e-12)


@examples(100)
@given(networks)
def test_default_gain_outweighs_every_transverse_root_at_rest(network):
    tau, gain = network.tau, network.sufficient_gain(0.5)
    assert gain >= 0.0
    for mode in MODES:
        a, b = eigenvalue_terms(network, mode)
        a -= gain
        if abs(b) > 1e-6:
            roots = a + lambertw(b * tau * np.exp(-a * tau), np.arange(-3, 4)) / tau
            assert roots.real.max() <= -0.5 + 1e-9


@pytest.mark.parametrize('gait', GAITS)
def test_the_lock_changes_neither_waveform_nor_period(gait):
    network = PRESETS[gait].network
    orbit = solve_orbit(network, gait)
    for gain in (network.sufficient_gain(0.5), 8.0, 30.0):
        run = simulate(network, orbit, 20.5 * orbit.period, 0.0025, lock=(gain, orbit.symmetry))
        assert np.abs(run.x - orbit(run.t)).max() < 1e-8
        assert rhythm(run, orbit.period, 0.0)[1] == pytest.approx(orbit.period, rel=1e-6)


@pytest.mark.parametrize('gait', GAITS)
def test_noise_with_and_without_the_lock(gait):
    # docs/theory_orbits.md, section Why the published gaits freeze.
    network = PRESETS[gait].network
    orbit = solve_orbit(network, gait)
    locked, free = (simulate(network, orbit, 200.0, orbit.period / 400, noise=0.02, seed=7,
                             lock=(gain, orbit.symmetry))
                    for gain in (network.sufficient_gain(0.5), 0.0))
    amplitude, period, phases = rhythm(locked, orbit.period, 100.0)
    # The first harmonic is 1 % below the peak here.
    assert np.allclose(amplitude, orbit.peak, 0.05, 0.0)
    assert period == pytest.approx(orbit.period, rel=0.01)
    assert phase_error(phases, orbit.phases) < 0.02
    latched = free.x[free.t > 150.0].mean(axis=0)
    assert np.abs(latched).min() > 0.5
    assert np.abs(free.x[free.t > 150.0] - latched).max() < 0.1
    assert np.abs(field(network, latched, latched)).max() < 0.05


def test_a_small_disturbance_kills_the_trot_without_the_lock():
    network = PRESETS['trot'].network
    orbit = solve_orbit(network, 'trot')
    steppers = [Stepper(network, orbit, gain=gain, symmetry=orbit.symmetry)
                for gain in (0.0, network.sufficient_gain(0.5))]
    outside = np.eye(8)[0] - np.eye(8)[0] @ orbit.symmetry.basis.T @ orbit.symmetry.basis
    for stepper in steppers:
        stepper.disturb(1e-6 * outside / np.linalg.norm(outside))
        stepper.advance(60.0)
    free, locked = (np.array([stepper.advance(orbit.period / 50)[0].copy() for _ in range(50)])
                    for stepper in steppers)
    assert np.ptp(free, axis=0).max() < 1e-3
    assert np.abs(free).min() > 0.5
    assert np.allclose(locked.max(axis=0), orbit.peak, 1e-2, 0.0)


FIGURE_7, FIGURE_3 = ([0.1, -0.1, p, -p, q, -q, 0.2, -0.2] for p, q in ((0.1, 0.2), (0.2, 0.1)))
QUARTERS, HALVES = (np.arange(8) // 2 * p + np.arange(8) % 2 / 2 for p in (0.25, 0.5))


@pytest.mark.parametrize(('network', 'start', 'period', 'phases'), [
    (Delayed(-4.5, 1.0, 6.5, -2.0, 0.4), FIGURE_7, 1.09048163, QUARTERS),
    (Delayed(-4.5, 1.0, 6.5, -2.0, 0.4), FIGURE_3, 1.27827056, HALVES),
    # Figure 7 was to show the trot of its parameters, but not from these values (erratum 4).
    (Delayed(-2.0, 1.0, 6.43, -2.0, 0.25), FIGURE_7, None, QUARTERS),
    (Delayed(-2.0, 1.0, 6.43, -2.0, 0.25), FIGURE_3, None, HALVES),
    (Delayed(-2.0, 1.0, 6.5, -2.0, 0.245), FIGURE_7, 0.86761962, QUARTERS)])
def test_start_values_of_the_published_figures(network, start, period, phases):
    run = simulate(network, np.array(start), 150.0, network.tau / 100)
    _, found, angles = rhythm(run, period or 1.0, 100.0)
    assert phase_error(angles, phases) < 1e-2
    assert period is None or found == pytest.approx(period, rel=1e-3)


def test_noise_is_white_with_the_deviation_given():
    # An uncoupled cell is an Ornstein-Uhlenbeck process of variance noise^2 / (2 |a|).
    network = Delayed(-1.0, 0.0, 0.0, 0.0, 0.1)
    run = simulate(network, np.zeros((20, 8)), 150.0, 0.01, noise=0.3)
    settled = run.x[:, run.t > 5.0].transpose(0, 2, 1).reshape(160, -1)
    assert settled.var() == pytest.approx(0.3**2 / 2.0, rel=0.05)
    assert np.abs(np.corrcoef(settled) - np.eye(160)).max() < 0.8


def test_seeds_share_no_noise():
    # Wherever a trajectory stands in a batch of more than one block.
    first, again, second = (simulate(PRESETS['trot'].network, np.zeros((16, 8)), 1.0, 0.01,
                                     noise=0.1, seed=seed).x for seed in (0, 0, 1))
    assert np.array_equal(first, again)
    assert not any(np.array_equal(one, other) for one in first for other in second)
