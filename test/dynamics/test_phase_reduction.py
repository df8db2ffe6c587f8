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

"""Gaits reduced to their phase, against forced and noisy simulations and closed forms."""

from cpg_ros.dynamics.integration.simulate import simulate
from cpg_ros.dynamics.phase_response import locking, phase_diffusion, phase_response
from cpg_ros.dynamics.solve_orbit import solve_preset
from cpg_ros.networks.registry import PRESETS
from depth import in_depth
import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.special import chdtri
from sheared_legs import closed_walk, ShearedLegs, solved_walk

LEGS = ShearedLegs()
#: Phase response of a leg: one sinusoid for each variable, of this size.
SIZE = np.hypot(LEGS.shear, 1.0) / (4.0 * np.pi * closed_walk(LEGS)[1])


def beat(orbit, frequency, amplitude):
    """Return how often a second a gait slips by a cycle against an input to v of cell 1."""
    network = orbit.network
    v = orbit(np.linspace(0.0, orbit.period, 400))[:, 0]
    middle = 0.5 * (v.max() + v.min())

    def rates(t, x):
        found = network.rates(x)
        found[0] += amplitude * np.cos(2.0 * np.pi * frequency * t)
        return found

    def rising(_, x):
        return x[0] - middle

    rising.direction = 1.0
    crossings = solve_ivp(rates, (0.0, 110.0 * orbit.period), orbit(np.array(0.0)), 'DOP853',
                          rtol=1e-8, atol=1e-9, events=rising).t_events[0]
    slipped = np.arange(crossings.size) - frequency * crossings
    slipped = np.sign(slipped[-1]) * (slipped - slipped[5])
    whole = np.floor(slipped[-1])
    if whole < 1.0:
        return 0.0
    at = np.interp(whole, np.maximum.accumulate(slipped), crossings)
    return whole / (at - crossings[5])


@pytest.mark.deep
def test_a_gait_is_locked_up_to_the_edge_of_the_tongue():
    """Beyond it the beat is sqrt(detuning^2 - half-width^2), which gives the half-width."""
    orbit = solve_preset(PRESETS['biped']['run'])
    amplitude = 0.01
    middle, half = 1.0 / orbit.period, amplitude * locking(phase_response(orbit))[0, 0]
    assert beat(orbit, middle + 0.9 * half, amplitude) == 0.0
    beyond = beat(orbit, middle + 1.5 * half, amplitude)
    assert np.sqrt((1.5 * half)**2 - beyond**2) == pytest.approx(half, rel=0.05)


def test_the_range_of_locking_of_oscillators_is_the_closed_one():
    response = phase_response(solved_walk(LEGS))
    assert locking(response) == pytest.approx(np.full((2, 2), 0.5 * SIZE), rel=1e-8)


def simulated_diffusion(orbit, noise, *, runs=256, cycles=40, lock=None, seed=0):
    """Estimate the coefficient from simulations: value, and ends of its 95 % interval.

    The phase is that of the first harmonic of cell 1 over a cycle.
    """
    kept = 32
    every = max(1, int(np.ceil(2.0 * orbit.period / orbit.network.step / kept)))
    histories = ([orbit] * runs if orbit.network.delay
                 else np.repeat(orbit(np.zeros(1)), runs, axis=0))
    run = simulate(orbit.network, histories, (cycles + 1) * orbit.period,
                   orbit.period / (kept * every), every=every, noise=noise, lock=lock, seed=seed,
                   progress=False)
    signal = run.x[:, :kept * (cycles + 1), 0].reshape(runs, cycles + 1, kept)
    waves = signal @ np.exp(-2j * np.pi * np.arange(kept) / kept)
    phases = np.unwrap(np.angle(waves), axis=1) / (2.0 * np.pi)
    sizes = np.array([1.0, *(chdtri(runs - 1, p) / (runs - 1) for p in (0.025, 0.975))])
    return np.var(phases[:, -1] - phases[:, 0], ddof=1) / (2.0 * cycles * orbit.period) / sizes


def test_noise_makes_the_phase_of_oscillators_diffuse_as_in_closed_form():
    response = phase_response(solved_walk(LEGS))
    # Two legs, each of which has a response of constant size.
    assert phase_diffusion(response, 0.02) == pytest.approx(0.5 * 0.02**2 * 2.0 * SIZE**2)


@pytest.mark.parametrize(('network', 'name'), [
    ('delayed', 'walk'), *in_depth(('biped', 'run'))])
def test_noise_makes_the_phase_diffuse_as_in_simulations(network, name):
    orbit = solve_preset(PRESETS[network][name])
    noise = 2e-3
    gain = orbit.network.sufficient_gain(0.5)
    lock = None if gain is None else (gain, orbit.symmetry)
    value, low, high = simulated_diffusion(orbit, noise, lock=lock, seed=3)
    wanted = phase_diffusion(phase_response(orbit), noise)
    assert low < value < high < 1.5 * low
    assert 0.95 * low < wanted < 1.05 * high
