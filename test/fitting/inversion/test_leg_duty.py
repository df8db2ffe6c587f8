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

"""Recordings of the generator that retimes its legs: parameters and duty are found again."""

from dataclasses import replace
import re

from cpg_ros.dynamics.solve_orbit import solve_beside, solve_preset
from cpg_ros.fitting.inversion import cycle_problem
from cpg_ros.fitting.inversion.cycle_problem import CycleProblem
from cpg_ros.fitting.inversion.fit_data import Joints
from cpg_ros.fitting.inversion.free_parameters import Free, free_numbers
from cpg_ros.fitting.inversion.leg_duty import GAIT_DUTY, GaitReadout
from cpg_ros.fitting.inversion.parameter_files import (
    robot_file_of,
    running_parameters,
    write_fitted,
)
from cpg_ros.fitting.inversion.recording_fit import fit_recording
from cpg_ros.fitting.recordings.recording import Recording
from cpg_ros.motion.robot_file import load_robot, read_robot
from cpg_ros.networks.registry import NETWORKS, PRESETS
from generated import generated
import numpy as np
import pytest

QUADRUPED = load_robot('quadruped')


def held(found, **truth):
    """Whether the intervals hold the true values."""
    return all(found.fit.parameters[name].low <= value <= found.fit.parameters[name].high
               for name, value in truth.items())


@pytest.mark.parametrize(('name', 'gait', 'free'), [
    ('delayed', 'walk', ('c', 'tau')), ('quadruped', 'walk', ('alpha', 'beta')),
    ('hopf', 'trot', ('duty',)), ('biped', 'walk', ('current', 'phi')), ('phase', 'walk', ())])
@pytest.mark.parametrize('stance', [None, (-0.04, 0.55)])
def test_the_jacobian_of_retimed_legs_is_that_of_the_residual(name, gait, free, stance):
    network = PRESETS[name][gait].network
    numbers = (*(free_numbers(network, gait, free) if free else ()),
               Free(GAIT_DUTY, (), 0.3, 0.9))
    cells, rng = np.arange(4), np.random.default_rng(0)
    joints = Joints(tuple('abcd'), np.arange(32) / 32, rng.standard_normal((32, 4)), cells,
                    np.ones(4))
    readout = replace(GaitReadout.of(type(network), gait), stance=stance)
    problem = CycleProblem(joints, np.ones(4), network, gait, numbers, 3, readout)
    values = np.array([*(one.value(network) for one in numbers[:-1]), 0.62, 0.13])
    problem.begin(values)
    slopes = problem(values)[1]
    for k in range(values.size):
        step = 1e-5 * max(1.0, abs(values[k])) * (np.arange(values.size) == k)
        ahead, behind = problem(values + step)[0], problem(values - step)[0]
        assert slopes[:, k] == pytest.approx((ahead - behind) / (2.0 * step[k]),
                                             abs=1e-5 * np.abs(slopes[:, k]).max() + 1e-8)


def test_a_walk_whose_robot_file_has_a_duty(tmp_path):
    found = fit_recording(generated('quadruped', 'delayed', 'walk'), QUADRUPED)
    assert held(found, c=6.5, tau=0.4, gait_duty=0.68)
    assert found.fit.parameters['c'].value == pytest.approx(6.5, abs=0.01)
    assert found.fit.duty == pytest.approx(0.68, abs=1e-3) and found.fit.mean_rms_share < 1e-3
    # What is written has the legs stand as recorded, and is not retimed twice.
    write_fitted(tmp_path / 'walk.yaml', found, QUADRUPED)
    written = read_robot(robot_file_of(tmp_path / 'walk.yaml')).motion('walk', 'walk')
    assert written.duty == pytest.approx(0.68, abs=1e-3)
    assert running_parameters(found, QUADRUPED)['duty'] == found.fit.duty


@pytest.mark.parametrize('seed', [0, 4])
def test_intervals_follow_a_curved_valley(seed):
    """Straight lines ended c at 6.35 and tau at 0.404; -c and a half cycle later is the same."""
    found = fit_recording(generated('quadruped', 'delayed', 'walk', seed), QUADRUPED)
    assert held(found, c=6.5, tau=0.4, gait_duty=0.68)
    assert found.fit.parameters['c'].low > 0.0


def test_a_walk_at_another_duty_than_that_of_the_file():
    found = fit_recording(generated('quadruped', 'delayed', 'walk', duty=0.55), QUADRUPED)
    assert held(found, c=6.5, tau=0.4, gait_duty=0.55)


@pytest.mark.parametrize('robot', [QUADRUPED, None])
def test_a_duty_that_no_file_states_is_found_where_the_recording_has_one(robot):
    trot = fit_recording(generated('quadruped', 'delayed', 'trot', duty=0.6), robot)
    assert held(trot, c=6.5, tau=0.4, gait_duty=0.6)
    own = fit_recording(generated('quadruped', 'delayed', 'trot'), robot)
    assert held(own, c=6.5, tau=0.4) and GAIT_DUTY not in own.fit.parameters
    assert own.fit.duty is None


def test_a_file_less_recording_says_that_stance_may_be_swing():
    walk = fit_recording(generated('quadruped', 'delayed', 'walk'))
    assert held(walk, c=6.5, tau=0.4, gait_duty=0.68)
    assert any('does not tell stance from swing' in line and 'gait_duty 0.32' in line
               for line in walk.warnings)


def test_a_robot_file_tells_stance_from_swing_where_joints_are_weighted_anew():
    for seed in (0, 1):
        found = fit_recording(generated('hexapod', 'phase6', 'tripod', seed),
                              load_robot('hexapod'), 'phase6', 'tripod')
        assert held(found, gait_duty=0.573)


@pytest.mark.parametrize('duty', [0.45, 0.7, 0.75, 0.8])
@pytest.mark.parametrize('seed', [None, 1])
def test_several_starts_find_the_duty_of_hopf(duty, seed):
    """A start at 0.6 ended at 0.54 to 0.56, with intervals of 0.002."""
    found = fit_recording(generated('quadruped', 'hopf', 'trot', seed,
                                    changes=(('duty', duty),)), QUADRUPED, 'hopf')
    assert held(found, duty=duty)
    assert found.fit.parameters['duty'].value == pytest.approx(duty, abs=0.01)
    minima = found.as_dict()['minima']
    assert len(minima) > 1 and minima[0]['cost'] <= minima[-1]['cost']


@pytest.mark.parametrize(('robot', 'network', 'gait'), [
    ('hexapod', 'delayed6', 'tripod'), ('hexapod', 'phase6', 'wave'),
    ('quadruped', 'matsuoka', 'walk'), ('unitree_go2', 'delayed', 'trot')])
def test_shipped_presets_are_found_again(robot, network, gait):
    found = fit_recording(generated(robot, network, gait, 0), load_robot(robot), network, gait)
    truth = NETWORKS[network].presets()[gait].network.as_dict()
    stated = load_robot(robot).motion(gait, gait).duty
    wide = {name: one for name, one in found.fit.parameters.items() if name in found.fit.free}
    assert set(wide) >= set(NETWORKS[network].free)
    for name, one in wide.items():
        value = stated if name == GAIT_DUTY else truth[name]
        assert abs(one.value - value) < 3.0 * max(one.stderr, one.high - one.low), name


@pytest.mark.parametrize(('robot', 'network', 'gait', 'name'), [
    ('goat', 'delayed', 'walk', 'tau'), ('goat', 'delayed', 'pace', 'tau'),
    ('hexapod', 'delayed6', 'lurch', 'c')])
def test_wide_intervals_hold_the_truth_where_costs_are_not_quadratic(robot, network, gait, name):
    found = fit_recording(generated(robot, network, gait, 21), load_robot(robot), network, gait)
    estimate = found.fit.parameters[name]
    truth = NETWORKS[network].presets()[gait].network.as_dict()[name]
    assert estimate.low <= estimate.value <= estimate.high
    assert estimate.low <= truth <= estimate.high


def test_a_start_that_leads_nowhere_is_left(monkeypatch):
    """Two of them took 200 orbits of 270."""
    solved = []

    def counted(network, near):
        solved.append(network)
        return solve_beside(network, near)

    monkeypatch.setattr(cycle_problem, 'solve_beside', counted)
    found = fit_recording(generated('unitree_go2', 'quadruped', 'trot', 0),
                          load_robot('unitree_go2'), 'quadruped')
    assert held(found, alpha=-0.6, beta=-0.6) and len(solved) < 90


@pytest.mark.parametrize('seed', [2, 4])
def test_joints_that_lag_their_cells_are_told(seed):
    """Calves that lag give a tau of 0.34 +- 0.02 without leaving more than noise."""
    rng, times = np.random.default_rng(seed), np.arange(0.0, 12.0, 0.01)
    orbit = solve_preset(PRESETS['delayed']['trot'])
    seen = [orbit((1.7 * times - lag) * orbit.period) / orbit.peak for lag in (0.0, 0.0, 0.2)]
    angles = np.array([joint.offset + 0.25 * seen[k % 3][:, joint.cell - 1]
                       for k, joint in enumerate(QUADRUPED.joints)]).T
    recording = Recording(tuple(QUADRUPED.order), times,
                          angles + rng.normal(0.0, 0.005, angles.shape), source='lagging calves')
    found = fit_recording(recording, QUADRUPED, free=['tau'])
    told = [re.search('tau may be from (.*) to (.*) if the joints of a leg lag', line)
            for line in found.warnings]
    low, high = next(map(float, one.groups()) for one in told if one)
    assert low <= 0.4 <= high
