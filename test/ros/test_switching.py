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

"""Gaits and parameters changed while the robot moves, through the real parameter services."""

from pathlib import Path

from ament_index_python.packages import get_package_share_directory
from cpg_ros.motion.plan import plan
from cpg_ros.motion.robot_file import read_robot
from cpg_ros.networks.library.delayed import PRESETS
from cpg_ros.networks.symmetry import GAITS
from graph import until
import numpy as np
import pytest
from std_srvs.srv import SetBool
from switches import by_leg, check_switches, off

ROBOT = read_robot(Path(get_package_share_directory('cpg_ros')) / 'config' / 'quadruped.yaml')
OFFSET, LOWER, UPPER = (ROBOT.column(key) for key in ('offset', 'lower', 'upper'))
# Phases of LH, RH, LF, RF (docs/theory.md, section The delayed network); walk and jump run
# backward round the ring, as d > 0.
PHASES = {'pronk': (0, 0, 0, 0), 'pace': (0, .5, 0, .5), 'bound': (0, 0, .5, .5),
          'trot': (0, .5, .5, 0), 'jump': (0, 0, .75, .75), 'walk': (0, .5, .75, .25)}


@pytest.fixture(scope='module')
def plans():
    return {gait: plan(ROBOT, gait, PRESETS[gait], PRESETS[gait].network, 2.0) for gait in GAITS}


def test_gaits_switch_without_a_jerk(running, plans):
    check_switches(running[1], ROBOT, plans, PHASES, 0.6, slack=1e-6)


def test_gait_loads_its_preset_and_the_batch_overrides_it(running):
    _, watcher = running
    assert watcher.set_together(gait='walk', delayed_tau=0.5).successful
    names = [f'delayed.{key}' for key in 'abcd'] + ['delayed.tau', 'gait']
    assert watcher.get(*names) == [-4.5, 1.0, 6.5, 2.0, 0.5, 'walk']
    # Network parameters alone keep the gait.
    assert watcher.set(delayed_c=7.0)[0].successful
    assert watcher.get(*names) == [-4.5, 1.0, 7.0, 2.0, 0.5, 'walk']
    assert watcher.set(gait='walk')[0].successful
    assert watcher.get(*names) == [-4.5, 1.0, 6.5, 2.0, 0.4, 'walk']


def test_the_papers_walk_is_the_diagonal_sequence_one(running):
    _, watcher = running
    assert watcher.set(gait='liu2024_walk')[0].successful
    watcher.record(0.7)
    assert off(watcher.next_phases(40), (0, .5, .25, .75)) < 1e-4


@pytest.mark.parametrize('changes, reason', [
    ({'gait': 'trot', 'delayed_tau': 0.2}, "below the trot's critical delay 0.2852"),
    ({'gait': 'gallop'}, "gait 'gallop' is not one of"),
    ({'gait': 'pronk', 'delayed_c': 6.5}, "below the pronk's critical delay 0.7819"),
    ({'gait': 'trot', 'delayed_c': 1.0}, 'must be above 1.5'),
    ({'delayed_tau': float('nan')}, 'out of range'),
    ({'frequency': -1.0}, 'out of range'),
    ({'amplitude': 'much'}, 'Wrong parameter type'),
    ({'amplitude': 2.9, 'frequency': 9.0}, 'above its limit'),
    ({'robot': 'goat'}, 'read-only'),
    ({'gait': 'walk', 'no_such': 1.0}, 'no_such'),
])
def test_refused_with_the_reason_and_as_a_whole(running, changes, reason):
    _, watcher = running
    names = ['gait', 'frequency', 'amplitude', 'robot', 'delayed.c', 'delayed.tau', 'delayed.d']
    before = watcher.get(*names)
    result = watcher.set_together(**changes)
    assert not result.successful
    assert reason in result.reason
    assert watcher.get(*names) == before


def test_whole_numbers_are_taken_for_doubles(running):
    _, watcher = running
    assert watcher.set(frequency=3)[0].successful
    assert watcher.get('frequency') == [3.0]
    assert watcher.set(frequency=2)[0].successful


def test_rate_changes_live(running):
    _, watcher = running
    assert watcher.set(rate=500.0)[0].successful
    watcher.record(0.2)
    times, _, _ = watcher.record(1.0)
    assert np.median(np.diff(times)) == pytest.approx(0.002, rel=1e-3)
    assert watcher.set(rate=200.0)[0].successful


def test_enable_ramps_to_the_stand_and_back(running):
    _, watcher = running
    _, _, swinging = watcher.record(1.0)
    first = len(watcher.samples)
    answer = watcher.call(SetBool, '/cpg_generator/enable', SetBool.Request(data=False))
    assert answer.success and 'down' in answer.message
    until(lambda: not np.any(watcher.samples[-1][2]), 'the stand')
    assert by_leg(watcher, ROBOT, np.array([watcher.samples[-1][1]]))[0] == pytest.approx(OFFSET)
    watcher.call(SetBool, '/cpg_generator/enable', SetBool.Request(data=True))
    watcher.record(1.5)
    positions = np.array([sample[1] for sample in watcher.samples[first:]])
    velocities = np.array([sample[2] for sample in watcher.samples[first:]])
    assert np.ptp(positions[-100:], axis=0).max() > 0.4
    # Up and down without a step: velocities change no faster than they do in the gait.
    own = np.abs(np.diff(swinging, axis=0)).max()
    assert np.abs(np.diff(velocities, axis=0)).max() < 1.05 * own < np.abs(velocities).max() / 4.0


def test_a_transition_of_zero_leaves_it_to_the_network(running):
    _, watcher = running
    assert watcher.set(gait='trot')[0].successful
    watcher.record(0.6)
    assert watcher.set(transition=0.0)[0].successful
    first = len(watcher.samples)
    assert watcher.set(gait='walk')[0].successful
    watcher.record(6.0)
    positions = by_leg(watcher, ROBOT, np.array([sample[1] for sample in watcher.samples[first:]]))
    limit = ROBOT.column('velocity')
    assert (np.abs(np.diff(positions, axis=0)) <= 0.005 * limit).all()
    assert off(watcher.next_phases(40), PHASES['walk']) < 0.02
    assert watcher.set(transition=0.4)[0].successful
