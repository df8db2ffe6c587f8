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

"""Parameters of the delayed network from one cycle."""

from dataclasses import replace

from cpg_ros.dynamics.arclength import NoOrbit
from cpg_ros.dynamics.integration.simulate import simulate
from cpg_ros.dynamics.solve_orbit import solve_orbit as solve
from cpg_ros.fitting.inversion.paper_fit import cycle_samples, fit_cycle
from cpg_ros.networks.library.delayed import Delayed
import numpy as np
import pytest
from scipy.optimize import minimize_scalar

TROT = Delayed(-2.0, 1.0, 6.43, -2.0, 0.25)
WALK = Delayed(-2.0, 1.0, 6.5, -2.0, 0.245)
THETA = np.arange(20) / 20


def test_samples_are_those_of_the_simulated_network():
    orbit = solve(WALK, 'walk')
    run = simulate(WALK, orbit, 2.0, 0.0025, progress=False)
    assert cycle_samples(orbit, THETA)[0] == pytest.approx(run(THETA * orbit.period), abs=1e-6)


def test_derivatives_are_those_of_the_samples():
    _, slopes = cycle_samples(solve(WALK, 'walk'), THETA)
    for column, name in enumerate(WALK.parameters()):
        value, step = getattr(WALK, name), 1e-5
        ahead, behind = (cycle_samples(solve(replace(WALK, **{name: value + way * step}), 'walk'),
                                       THETA)[0] for way in (1.0, -1.0))
        assert slopes[..., column] == pytest.approx((ahead - behind) / (2.0 * step), abs=1e-6)


@pytest.mark.parametrize(('truth', 'gait', 'names', 'start'), [
    (TROT, 'trot', ('c',), {'c': 7.2}), (WALK, 'walk', ('tau',), {'tau': 0.4}),
    (WALK, 'walk', ('c', 'tau'), {'c': 7.0, 'tau': 0.26})])
def test_the_parameters_of_a_network_are_found_again(truth, gait, names, start):
    samples = cycle_samples(solve(truth, gait), THETA)[0]
    fit = fit_cycle(samples, THETA, replace(truth, **start), gait, names)
    assert fit.values == pytest.approx([getattr(truth, name) for name in names], abs=1e-8)
    assert fit.trial.converged and fit.cost < 1e-15
    assert fit.orbit.network.as_dict() == pytest.approx(truth.as_dict(), abs=1e-8)


def test_a_recording_that_no_orbit_explains_has_the_least_error_there():
    rng = np.random.default_rng(3)
    samples = cycle_samples(solve(TROT, 'trot'), THETA)[0] + 0.2 * rng.standard_normal((20, 8))

    def half_squares(c):
        states, _ = cycle_samples(solve(replace(TROT, c=c), 'trot'), THETA)
        return 0.5 * np.sum((samples - states)**2)

    best = minimize_scalar(half_squares, bounds=(5.9, 7.5), method='bounded',
                           options={'xatol': 1e-9})
    for start in (6.1, 7.2):
        fit = fit_cycle(samples, THETA, replace(TROT, c=start), 'trot', ['c'])
        assert fit.values[0] == pytest.approx(best.x, abs=1e-5)
        assert fit.cost == pytest.approx(best.fun, abs=1e-10)
        assert abs(fit.gradient[0]) < 1e-6


def test_a_step_to_where_there_is_no_orbit_is_shortened():
    # The critical delay of the walk is 0.2048.
    samples = cycle_samples(solve(replace(WALK, tau=0.21), 'walk'), THETA)[0]
    fit = fit_cycle(samples, THETA, replace(WALK, tau=0.6), 'walk', ['tau'])
    assert fit.values[0] == pytest.approx(0.21, abs=1e-7)


@pytest.mark.parametrize(('change', 'message'), [
    ({'samples': np.zeros((20, 7))}, 'shape'), ({'theta': THETA[:-1]}, 'shape'),
    ({'samples': np.full((20, 8), np.nan)}, 'not finite'), ({'names': ['x']}, "'x'"),
    ({'names': []}, 'names'), ({'names': ['c', 'c']}, "'c, c'"),
    ({'start': replace(TROT, c=99.0)}, 'c 99 to start from')])
def test_nonsense_is_refused(change, message):
    arguments = {'samples': np.zeros((20, 8)), 'theta': THETA, 'start': TROT, 'gait': 'trot',
                 'names': ['c'], **change}
    with pytest.raises(ValueError, match=message):
        fit_cycle(**arguments)


def test_a_start_without_the_gait_is_refused():
    with pytest.raises(NoOrbit, match='critical delay'):
        fit_cycle(np.zeros((20, 8)), THETA, replace(TROT, tau=0.2), 'trot', ['c'])
