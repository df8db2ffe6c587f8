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

from cpg_ros.common.errors import InputError
from cpg_ros.dynamics.phase_response import (
    coupling_function,
    entrainment_range,
    locking,
    phase_diffusion,
    phase_response,
    simulated_diffusion,
)
from cpg_ros.dynamics.solve_orbit import solve_preset
from cpg_ros.networks.registry import PRESETS
from depth import in_depth
import numpy as np
import pytest
from scipy.integrate import solve_ivp
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
    low, high = entrainment_range(phase_response(orbit), 1, 'v', amplitude)
    middle, half = 0.5 * (low + high), 0.5 * (high - low)
    assert middle == pytest.approx(1.0 / orbit.period)
    assert beat(orbit, middle + 0.9 * half, amplitude) == 0.0
    beyond = beat(orbit, middle + 1.5 * half, amplitude)
    assert np.sqrt((1.5 * half)**2 - beyond**2) == pytest.approx(half, rel=0.05)


def test_the_range_of_locking_of_oscillators_is_the_closed_one():
    response = phase_response(solved_walk(LEGS))
    assert locking(response) == pytest.approx(np.full((2, 2), 0.5 * SIZE), rel=1e-8)
    assert np.abs(locking(response, 2)).max() < 1e-10
    low, high = entrainment_range(response, 2, 'y', -0.1)
    assert high - low == pytest.approx(0.1 * SIZE)
    with pytest.raises(InputError, match="'z' is not one of x, y"):
        entrainment_range(response, 1, 'z', 0.1)
    with pytest.raises(InputError, match='cell 3 is not from 1 to 2'):
        entrainment_range(response, 3, 'x', 0.1)


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
    found = simulated_diffusion(orbit, noise, lock=lock, seed=3)
    wanted = phase_diffusion(phase_response(orbit), noise)
    assert found.low < found.value < found.high < 1.5 * found.low
    assert 0.95 * found.low < wanted < 1.05 * found.high


def test_the_coupling_of_two_generators_is_the_closed_one():
    """With k (z_other - z) in every cell: k / 2 pi (sin - shear (cos - 1)) of the lead."""
    orbit = solved_walk(LEGS)
    leads = np.linspace(-0.5, 0.5, 21)
    found = coupling_function(phase_response(orbit), orbit, lambda other, own: 0.3 * (other - own),
                              leads)
    angle = 2.0 * np.pi * leads
    exact = 0.3 / (2.0 * np.pi) * (np.sin(angle) - LEGS.shear * (np.cos(angle) - 1.0))
    assert np.abs(found - exact).max() < 1e-9
