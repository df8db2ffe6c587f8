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

"""Recordings that change their gait: cut, fitted, written as a schedule, and repeated."""

from bags import joint_state, START, write_bag
from cpg_ros.fitting.gaits.stride import NoSteadyGait
from cpg_ros.fitting.inversion import inversion
from cpg_ros.fitting.inversion.gait_schedule import (
    cut,
    fit_stretches,
    read_schedule,
    schedule_of,
    ScheduleError,
    write_schedule,
)
from cpg_ros.fitting.recordings.recording import Recording
from cpg_ros.motion.pattern import Pattern
from cpg_ros.motion.plan import plan
from cpg_ros.motion.robot_file import load_robot, read_robot
from cpg_ros.networks.registry import find_network, PRESETS
import numpy as np
import pytest
import yaml

RATE = 200.0
GO2 = load_robot('unitree_go2')
THERE_AND_BACK = (('walk', 1.5, 8.0), ('trot', 2.0, 8.0), ('walk', 1.5, 8.0))


def recorded(course, noise=0.01, seed=0):
    """Record the generator's own pattern in gaits, each at a frequency in Hz for a time in s."""
    plans = [plan(GO2, gait, PRESETS['delayed'][gait], PRESETS['delayed'][gait].network,
                     frequency) for gait, frequency, _ in course]
    pattern, rows = Pattern(plans[0], 1.0), []
    for gait_plan, (_, _, seconds) in zip(plans, course, strict=True):
        if rows:
            pattern.apply(gait_plan, 1.0)
        for _ in range(round(seconds * RATE)):
            pattern.advance(1.0 / RATE)
            rows.append(pattern.position[GO2.order_indices])
    x, rng = np.array(rows), np.random.default_rng(seed)
    x += noise * np.ptp(x, axis=0) * rng.standard_normal(x.shape)
    return Recording(GO2.order, np.arange(len(x)) / RATE, x, 'made up')


@pytest.fixture(scope='module')
def there_and_back():
    return recorded(THERE_AND_BACK)


@pytest.fixture(scope='module')
def fitted(there_and_back):
    return fit_stretches(there_and_back, GO2)


@pytest.mark.parametrize(('course', 'seed'), [
    (THERE_AND_BACK, 0),
    # At one frequency only the legs' phases tell the gaits apart.
    ((('walk', 1.5, 7.0), ('trot', 1.5, 7.0), ('pace', 1.5, 7.0)), 1),
    ((('trot', 2.0, 6.0), ('bound', 2.0, 6.0), ('pronk', 2.0, 6.0), ('trot', 2.5, 6.0)), 2),
    ((('trot', 2.0, 10.0),), 3)])
def test_every_gait_is_a_stretch(course, seed):
    found = cut(recorded(course, seed=seed), GO2)
    assert [stride.gait for _, _, stride in found] == [gait for gait, _, _ in course]
    starts = np.cumsum([0.0, *(seconds for _, _, seconds in course)])
    for k, (begin, end, stride) in enumerate(found):
        assert stride.frequency == pytest.approx(course[k][1], rel=0.01)
        assert stride.confidence > 0.9
        # A change takes a second, and where it is seen depends on the window of one stride.
        assert starts[k] - 0.6 < begin < starts[k] + 1.6
        assert starts[k + 1] - 1.2 < end < starts[k + 1] + 0.6


def test_where_nothing_is_steady_that_is_said():
    times = np.arange(1000) / RATE
    angles = np.cumsum(np.random.default_rng(4).normal(0.0, 0.05, (1000, 12)), axis=0)
    with pytest.raises(NoSteadyGait, match='made up: '):
        cut(Recording(GO2.order, times, angles, 'made up'), GO2)


def test_a_schedule_repeats_the_recording(tmp_path, there_and_back, fitted):
    path, robot_file = write_schedule(tmp_path / 'gaits.yaml', fitted, GO2)
    schedule, robot = read_schedule(path), read_robot(robot_file)
    assert schedule.network == 'delayed' and schedule.robot == str(robot_file)
    assert [one.parameters['gait'] for one in schedule.entries] == ['walk', 'trot', 'walk']
    # Half of the change that takes a second.
    assert [one.at for one in schedule.entries] == pytest.approx([0.0, 8.5, 16.5], abs=0.4)
    kind = find_network('delayed')
    for one, stretch in zip(schedule.entries, fitted, strict=True):
        values = {name.partition('.')[2]: value for name, value in one.parameters.items()
                  if name.startswith('delayed.')}
        gait, network = one.parameters['gait'], kind(**values)
        pattern = Pattern(plan(robot, gait, PRESETS['delayed'][gait], network,
                               one.parameters['frequency']), 1.0)
        rows = []
        for k in range(round(8.0 * RATE)):
            pattern.advance(1.0 / RATE)
            if k > 3.0 * RATE:
                rows.append(pattern.position[GO2.order_indices])
        again = np.array(rows)
        # Its first strides belong to the change.
        first = np.searchsorted(there_and_back.times, stretch.begin + 2.0)
        was = there_and_back.positions[first:first + round(2.0 * RATE)]
        lags = range(0, len(again) - len(was))
        off = min(float(np.sqrt(np.mean((again[k:k + len(was)] - was)**2, axis=0)).mean())
                  for k in lags)
        # Noise of 1 % is in the recording.
        assert off < 0.05 * float(np.ptp(was, axis=0).mean())


def test_gaits_that_follow_on_one_another_are_one_entry(fitted):
    walk, trot, _ = fitted
    assert len(schedule_of([walk, walk, trot, trot], 'robot').entries) == 2


def test_the_executable_says_what_it_found(tmp_path, there_and_back, capsys):
    one = there_and_back
    stamps = START + np.round(1e9 * one.times).astype(np.int64)
    bag = write_bag(tmp_path / 'bag', [
        ('/joint_states', int(stamp), joint_state(int(stamp), list(one.joints), row))
        for stamp, row in zip(stamps, one.positions, strict=True)])
    out = tmp_path / 'gaits.yaml'
    given = ['--bag', str(bag), '--robot', 'unitree_go2', '--schedule', str(out)]
    assert inversion.main(given) == 0
    lines = capsys.readouterr().out.splitlines()
    assert [line.split()[2] for line in lines[1:4]] == ['walk', 'trot', 'walk']
    assert lines[-1] == f'written: {out}, {out.with_name("gaits_robot.yaml")}'
    assert inversion.main([*given, '--report', str(tmp_path / 'r.html')]) == 2
    assert 'argument --report: not with --schedule' in capsys.readouterr().err


@pytest.mark.parametrize(('change', 'message'), [
    ({'network': None}, 'network: must be a name, not nothing'),
    ({'schedule': []}, 'schedule: '),
    ({'schedule': [{'at': 1.0, 'parameters': {}}]}, 'schedule[0].parameters: must be a mapping'),
    ({'schedule': [{'at': -1.0, 'parameters': {'gait': 'walk'}}]},
     'schedule[0].at: -1 s is not after 0 s'),
    ({'schedule': [{'at': 1.0, 'parameters': {'gait': 'walk'}}] * 2},
     'schedule[1].at: 1 s is not after 1 s'),
    ({'schedule': [{'at': 0.0, 'parameters': {'gait': [1]}}]},
     'schedule[0].parameters.gait: must be a number or a text, not [1]'),
    ({'speed': 1.0}, 'file.speed: unknown key')])
def test_a_bad_schedule_is_named(tmp_path, change, message):
    path = tmp_path / 'gaits.yaml'
    good = {'network': 'delayed', 'robot': 'go1',
            'schedule': [{'at': 0.0, 'parameters': {'gait': 'walk'}}]}
    path.write_text(yaml.safe_dump(good | change))
    with pytest.raises(ScheduleError) as caught:
        read_schedule(path)
    assert message in str(caught.value) and str(path) in str(caught.value)
