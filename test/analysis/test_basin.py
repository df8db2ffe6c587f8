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

"""Basins against the same states integrated by scipy, and the verdicts on single runs."""

from cpg_ros.analysis.basin import basin, end_of, random_states
from cpg_ros.common.errors import InputError
from cpg_ros.dynamics.integration.simulate import simulate
from cpg_ros.dynamics.solve_orbit import solve_preset
from cpg_ros.networks.registry import PRESETS
import numpy as np
import pytest
from scipy.integrate import solve_ivp

STATES = 4


def test_what_returns_and_what_rests_is_what_scipy_finds():
    """The quadruped's pace coexists with rest; an end is told by its range and its period."""
    orbit = solve_preset(PRESETS['quadruped']['pace'])
    found = basin(orbit, STATES, 5)
    rests = returns = 0
    for start in random_states(orbit, STATES, 5):
        run = solve_ivp(lambda _, x: orbit.network.rates(x), (0.0, 40.0 * orbit.period), start,
                        'LSODA', rtol=1e-7, atol=1e-9, dense_output=True)
        last = run.sol(run.t[-1] - np.linspace(0.0, 2.0 * orbit.period, 801))
        still = np.ptp(last) < 1e-3 or np.ptp(last, axis=1).max() < 1e-3
        rests += still
        # Legs of a side agree, those of the other are half a period later.
        legs = last[:8]
        half = legs[:, 200:601]
        returns += (not still and np.abs(legs[:, 400:] - legs[:, :401]).max() < 0.05
                    and np.abs(half[:, :201] - half[[1, 0, 3, 2, 5, 4, 7, 6], 200:]).max() < 0.05
                    and np.abs(legs[0] - legs[2]).max() < 0.05)
    assert (found.returned, found.others.get('rest', 0)) == (returns, rests)
    assert found.returned + sum(found.others.values()) == found.states == STATES
    assert rests > 0


def test_the_interval_is_wilsons():
    orbit = solve_preset(PRESETS['quadruped']['pace'])
    found = basin(orbit, 3, 5)
    n, p, z = 3, found.fraction, 1.959964
    middle, half = p + z * z / (2 * n), z * np.sqrt(p * (1 - p) / n + z * z / (4 * n * n))
    low, high = ((middle + side * half) / (1 + z * z / n) for side in (-1.0, 1.0))
    assert found.interval == pytest.approx((low, high), abs=1e-6)


def test_states_are_drawn_over_twice_the_range_of_the_orbit():
    orbit = solve_preset(PRESETS['biped']['run'])
    cycle = orbit(np.linspace(0.0, orbit.period, 2000))
    low, high = cycle.min(axis=0), cycle.max(axis=0)
    states = random_states(orbit, 20_000, 0)
    middle, size = 0.5 * (low + high), high - low
    assert states.min(axis=0) == pytest.approx(middle - size, abs=2e-3)
    assert states.max(axis=0) == pytest.approx(middle + size, abs=2e-3)
    assert np.array_equal(states, random_states(orbit, 20_000, 0))


def test_ends_have_the_names_of_gaits():
    walk, run = (solve_preset(PRESETS['biped'][name]) for name in ('walk', 'run'))

    def followed(orbit):
        return simulate(orbit.network, orbit(np.array(0.3)), 40.0 * orbit.period,
                        orbit.period / 640, every=10, progress=False)

    assert end_of(followed(run), run) == 'run'
    assert end_of(followed(run), walk) == 'run'
    assert end_of(followed(walk), run) == 'walk'


def test_no_states_are_refused():
    with pytest.raises(InputError, match='0 random states: there must be at least 1'):
        basin(solve_preset(PRESETS['quadruped']['pace']), 0)
