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

"""Where a fit begins: every start of the paper, those that lack an orbit, steps and bounds."""

from dataclasses import replace

from cpg_ros.dynamics.arclength import NoOrbit
from cpg_ros.dynamics.solve_orbit import solve_orbit
from cpg_ros.fitting.inversion.invert import invert
from cpg_ros.fitting.inversion.paper_fit import cycle_samples, fit_cycle
from cpg_ros.networks.registry import PRESETS
from noisy_cycles import TROT, trot
import numpy as np
import pytest

GOAT_TROT = PRESETS['delayed']['goat_trot'].network
GOAT_WALK = PRESETS['delayed']['goat_slope_walk'].network


@pytest.mark.parametrize(('network', 'gait', 'name', 'starts'), [
    (GOAT_TROT, 'trot', 'c', (6.1, 6.3, 6.5, 7.2)),
    (GOAT_WALK, 'walk', 'tau', (0.25, 0.28, 0.39, 0.40))])
def test_every_start_of_the_paper_reaches_one_minimum_near_the_truth(network, gait, name, starts):
    theta = np.arange(20) / 20
    states = cycle_samples(solve_orbit(network, gait), theta)[0]
    noisy = states + 0.02 * np.ptp(states) * np.random.default_rng(1).standard_normal(
        states.shape)
    fits = [fit_cycle(noisy, theta, replace(network, **{name: start}), gait, [name])
            for start in starts]
    values = [fit.values[0] for fit in fits]
    assert np.ptp(values) < 1e-4 * values[0]
    assert values[0] == pytest.approx(getattr(network, name), rel=0.01)
    for fit, start in zip(fits, starts, strict=True):
        assert fit.trial.path[0, 1] == pytest.approx(start)
        assert (np.diff(fit.trial.path[:, 0]) <= 0.0).all()
        assert fit.trial.path[-1, 0] == pytest.approx(fit.cost)
        assert fit.cost == pytest.approx(0.5 * np.sum(fit.errors**2))


def test_starts_are_kept_with_their_way():
    recording, cells = trot(None)
    told = []
    fit = invert(recording, cells, TROT, 'trot', ('c', 'tau'), 3,
                 [{'c': 6.1}, {'tau': 0.2}, {'c': 7.2, 'tau': 0.5}], done=told.append)
    assert told[0] == 0.0 and told[-1] == 1.0 and told == sorted(told) and len(told) > 3
    first, lost, last = fit.starts
    assert "below the trot's critical delay" in lost.reason and lost.cost == np.inf
    assert not len(lost.path) and lost.iterations == 0
    for trial, start in ((first, (6.1, 0.4)), (last, (7.2, 0.5))):
        assert trial.path[0, 1:3] == pytest.approx(start)
        assert trial.values[:2] == pytest.approx([TROT.c, TROT.tau], rel=1e-3)
        assert trial.converged and (np.diff(trial.path[:, 0]) <= 0.0).all()


def test_starts_that_all_lack_an_orbit_are_refused():
    recording, cells = trot(None)
    with pytest.raises(NoOrbit, match=r"tau 0\.2 is below the trot's critical delay 0\.28"):
        invert(recording, cells, replace(TROT, tau=0.2), 'trot', ('c',))


def test_steps_out_of_the_hopf_set_are_shortened():
    recording, cells = trot(None, network=replace(TROT, tau=0.3))
    fit = invert(recording, cells, replace(TROT, tau=1.5), 'trot', ('c', 'tau'), 3,
                 [{'c': 5.0, 'tau': 1.5}])
    assert fit.rms_share['joint_0'] < 1e-3


def test_a_single_number_is_found_near_the_edge_of_the_hopf_set():
    # At this delay the trot is born at c = 4.93.
    recording, cells = trot(None, network=replace(TROT, c=5.0))
    fit = invert(recording, cells, TROT, 'trot', ('c',))
    assert fit.parameters['c'].value == pytest.approx(5.0, abs=1e-3)


def test_a_number_at_its_bound_is_said():
    recording, cells = trot(0)
    fit = invert(recording, cells, replace(TROT, c=6.0), 'trot', ('c',), bounds={'c': (5.5, 6.2)})
    one = fit.parameters['c']
    assert one.value == pytest.approx(6.2, abs=1e-4) and one.high == pytest.approx(6.2)
    assert not one.bounded
    assert any('c ends at its upper bound 6.2' in line for line in fit.warnings)


def test_a_number_at_its_bound_beside_another_is_said():
    recording, cells = trot(0, network=replace(TROT, c=8.0))
    fit = invert(recording, cells, replace(TROT, c=6.0), 'trot', ('c', 'tau'),
                 bounds={'c': (5.5, 6.2)})
    one = fit.parameters['c']
    assert one.value == pytest.approx(6.2) == one.high and one.low <= one.value
    assert not one.bounded
    assert fit.parameters['tau'].low <= fit.parameters['tau'].value <= fit.parameters['tau'].high
