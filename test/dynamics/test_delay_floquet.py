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

"""Floquet multipliers of the delayed network against growth in simulation and laws near onset."""

from dataclasses import replace
from functools import cache

from cpg_ros.dynamics.equilibrium import equilibrium
from cpg_ros.dynamics.floquet import multipliers, smallest_gain
from cpg_ros.dynamics.hopf import first_hopf
from cpg_ros.dynamics.integration.simulate import simulate
from cpg_ros.dynamics.isotypic import blocks
from cpg_ros.dynamics.orbit import Orbit
from cpg_ros.dynamics.solve_orbit import solve_orbit, solve_preset
from cpg_ros.dynamics.stability import stability
from cpg_ros.networks.library.delayed import Delayed, PRESETS
from depth import examples
from hypothesis import given
from hypothesis import strategies as st
from modes import class_of
import numpy as np
import pytest

EVERY = pytest.mark.parametrize('name', PRESETS)
STEPS = 400
#: A disturbance that has a part in every symmetry class.
SHAPE = np.array([1.0, 0.5, 0.7, 1.1, -0.3, 1.2, 0.4, 0.9])


@cache
def solved(name) -> Orbit:
    return solve_preset(PRESETS[name])


class Disturbed:
    """The orbit as a history, with a small disturbance that varies along the delay."""

    def __init__(self, orbit, shape, size):
        self.orbit, self.shape, self.size = orbit, shape, size

    def __call__(self, times):
        turn = np.cos(0.7 * times / self.orbit.network.delay)
        return self.orbit(times) + self.size * turn[:, None] * self.shape

    def derivative(self, times):
        rate = 0.7 / self.orbit.network.delay
        turn = -rate * np.sin(rate * times)
        return self.orbit.derivative(times) + self.size * turn[:, None] * self.shape


def disturbances(orbit, shape, size, strides, gain):
    """Return how states grow with the disturbance, stride by stride, (strides, STEPS, 8)."""
    runs = simulate(orbit.network, [Disturbed(orbit, shape, s) for s in (size, -size)],
                    strides * orbit.period, orbit.period / STEPS, lock=(gain, orbit.symmetry))
    apart = (runs.x[0] - runs.x[1])[1:] / (2.0 * size)
    return apart.reshape(strides, STEPS, 8)


def projector(orbit):
    """On the gait's class, from its phases."""
    wave = np.exp(2j * np.pi * orbit.phases)
    rows = np.array([wave.real, wave.imag])
    return np.linalg.pinv(rows) @ rows


def leading_modes(series, count):
    """Multipliers of a linear sequence of states, by dynamic mode decomposition."""
    flat = series.reshape(len(series), -1)
    before, after = flat[:-1].T, flat[1:].T
    u, s, v = np.linalg.svd(before, full_matrices=False)
    u, s, v = u[:, :count], s[:count], v[:count]
    found = np.linalg.eigvals(u.T @ after @ v.T / s)
    return found[np.argsort(-np.abs(found))]


@EVERY
@pytest.mark.parametrize('fraction', [0.0, 0.3])
def test_transverse_disturbances_grow_in_simulation_as_the_multipliers_say(name, fraction):
    orbit = solved(name)
    gain = fraction * smallest_gain(orbit)
    mine = multipliers(orbit, gain)
    outside = np.eye(8) - projector(orbit)
    shape = outside @ SHAPE
    # Long enough for the few fastest to stand alone, not so long that they drown in rounding.
    grows = max(mine.leading_transverse, 1.5)
    strides = int(np.clip(np.log(1e7) / np.log(grows), 5, 14))
    size = 1e-4 * grows**-strides
    series = disturbances(orbit, shape, size, strides, gain)
    # They stay outside the class.
    assert np.abs(series @ projector(orbit)).max() < 1e-3 * np.abs(series).max()
    grown = leading_modes(series[-5:], 3)[0]
    assert abs(grown) == pytest.approx(mine.leading_transverse, rel=1e-3)


@EVERY
def test_disturbances_within_the_class_decay_in_simulation_as_the_multipliers_say(name):
    orbit = solved(name)
    mine = multipliers(orbit)
    assert abs(mine.trivial - 1.0) < 1e-6
    assert mine.leading_within < 1.0
    shape = projector(orbit) @ [1.0, -0.8, 0.5, 0.3, -0.2, 0.9, 0.1, 0.4]
    # What two strides differ by is free of the shift along the orbit.
    series = np.diff(disturbances(orbit, shape, 1e-4, 10, 8.0), axis=0)
    assert np.abs(series @ (np.eye(8) - projector(orbit))).max() < 1e-9
    grown = leading_modes(series[1:8], 5 if class_of(orbit.symmetry)[0] % 2 else 2)[0]
    assert grown == pytest.approx(mine.within[0], rel=1e-3)


@EVERY
def test_the_smallest_gain_parts_growth_from_decay(name):
    orbit = solved(name)
    smallest = smallest_gain(orbit)
    assert 0.0 < smallest < orbit.network.sufficient_gain(0.5)
    assert multipliers(orbit, smallest).leading_transverse == pytest.approx(1.0, abs=1e-6)
    assert multipliers(orbit, stability(orbit).lock_gain).leading < 1.0
    outside = np.eye(8) - projector(orbit)
    shape = outside @ SHAPE
    for factor, sign in ((0.95, 1.0), (1.05, -1.0)):
        series = disturbances(orbit, shape, 1e-6, 24, factor * smallest)
        sizes = np.log(np.linalg.norm(series, axis=(1, 2)))
        assert np.sign(sizes[-1] - sizes[-4]) == sign


networks = st.builds(Delayed, st.floats(-4.0, -2.0), st.floats(-1.0, 1.5), st.floats(5.5, 9.0),
                     st.floats(-3.0, -0.5), st.just(0.1))


@examples(15)
@given(networks, st.sampled_from(['trot', 'walk']))
def test_near_onset_the_multipliers_are_those_of_normal_form_and_rest(network, gait):
    point = first_hopf(network, gait)
    mu = 2e-4 * point.value
    here = replace(network, tau=point.value + mu)
    orbit = solve_orbit(here, gait)
    mine = multipliers(orbit)
    assert abs(mine.trivial - 1.0) < 1e-6
    # r' = k1 mu r + k2 r^3: r - r0 decays at -2 k1 mu.
    decay = 2.0 * point.normal_form.k1.real * mu * orbit.period
    assert -np.log(mine.within[0].real) == pytest.approx(decay, rel=2e-2)
    # Transverse ones are those of the rest state, to first order in mu.
    j, k = point.mode
    own = {(j, k), (-j % 4, k)}
    roots = np.concatenate([block.roots(5) for block in blocks(here, equilibrium(here))
                            if block.mode not in own])
    rest = np.exp(roots.real.max() * orbit.period)
    assert np.log(mine.leading_transverse / rest) == pytest.approx(0.0, abs=2e-2)


@examples(15)
@given(networks, st.floats(1.05, 2.0), st.floats(0.0, 6.0))
def test_gaits_of_one_waveform_have_one_set_of_multipliers(network, factor, gain):
    # A sign moved from the phases into c or d (and x -> -x of some cells) leaves them.
    a, b, c, d, _ = network.as_dict().values()
    for family in ((('trot', c, d), ('pace', c, -d), ('pronk', -c, -d), ('bound', -c, d)),
                   (('walk', c, d), ('walk', c, -d), ('jump', -c, d), ('jump', -c, -d))):
        tau = factor * first_hopf(network, family[0][0]).value
        first, *others = (multipliers(solve_orbit(Delayed(a, b, c, d, tau), gait), gain)
                          for gait, c, d in family)
        for other in others:
            assert other.leading_transverse == pytest.approx(first.leading_transverse, rel=1e-7)
            assert other.within[0] == pytest.approx(first.within[0], rel=1e-7, abs=1e-9)
