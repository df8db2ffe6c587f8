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

"""A humanoid whose sensors fail in a walk stops or crouches, within its limits, and goes on."""

import importlib.util

from depth import in_depth
import numpy as np
import pytest

pytest.importorskip('mujoco')

from humanoid_under_fault import HumanoidUnderFault  # noqa: E402


@pytest.mark.parametrize('fault', [
    'dropped imu', 'dropped joints', 'spikes', 'stalled 0.2 s', *in_depth(
        'none', 'NaN imu', 'NaN joints', 'frozen joints', 'NaN feet', 'dropped feet',
        'no velocities', '0.2 s without imu')])
def test_it_goes_on_walking_after(fault):
    humanoid = HumanoidUnderFault(fault, begins=3.0)
    assert humanoid.run(7.0) == 'walk'
    assert not humanoid.crossed and not humanoid.pattern.falls


def test_its_state_says_what_it_does_beside_the_fault():
    humanoid = HumanoidUnderFault('dropped imu', speed=0.0, begins=1.0)
    for until, doing in ((0.9, 'on'), (1.1, 'coming to a stand: imu: no messages for '),
                         (2.1, 'crouching: imu: no messages for ')):
        humanoid.run(until)
        assert humanoid.loop.state.startswith(doing)


@pytest.mark.skipif(importlib.util.find_spec('mjlab') is None,
                    reason='mjlab, which has the G1, is not installed')
@pytest.mark.parametrize('fault, end', [('0.2 s without imu', 'walk'), ('NaN imu', 'crouch')])
def test_a_unitree_g1_walks_on_or_crouches_without_its_imu(fault, end):
    humanoid = HumanoidUnderFault(fault, 2, name='unitree_g1', begins=3.0 + 0.4 / 1.65)
    assert humanoid.run(humanoid.faults.ends + 2.5) == end
    assert not humanoid.crossed and not humanoid.pattern.falls


@pytest.mark.parametrize('fault', ['delay 20 ms', *in_depth('delay 50 ms', 'delay 90 ms')])
def test_late_sensors_make_it_crouch(fault):
    humanoid = HumanoidUnderFault(fault)
    assert humanoid.run(4.0) == 'crouch'
    assert not humanoid.crossed and not humanoid.pattern.falls


@pytest.mark.parametrize('begins', [3.202, *in_depth(3.354, 3.454)])
def test_without_any_sensor_it_repeats_its_last_stride_until_it_can_crouch(begins):
    humanoid = HumanoidUnderFault('publisher dies 3 s', begins=begins)
    assert humanoid.run(begins + 2.5) == 'crouch'
    assert not humanoid.crossed and not humanoid.pattern.falls


@pytest.mark.parametrize('fault', ['feet swapped', *in_depth('encoder off .25', 'encoder stuck')])
def test_an_input_that_contradicts_the_others_makes_it_crouch(fault):
    humanoid = HumanoidUnderFault(fault, begins=3.0)
    assert humanoid.run(6.5) == 'crouch'
    assert not humanoid.crossed and not humanoid.pattern.falls
    assert humanoid.loop.faults


@pytest.mark.parametrize('fault', ['IMU pitch negated', *in_depth(
    'tilt 9 degrees', 'IMU turned 90 about z', 'IMU turned 180 about z')])
def test_an_imu_that_is_mounted_otherwise_is_seen_before_the_first_step(fault):
    humanoid = HumanoidUnderFault(fault)
    assert humanoid.run(3.0) == 'crouch'
    assert not humanoid.crossed and not humanoid.pattern.falls
    assert 'mounting of the IMU' in humanoid.loop.faults


def test_swapped_names_of_joints_are_seen_before_the_first_step():
    humanoid = HumanoidUnderFault('two names swapped')
    assert humanoid.run(2.3) == 'crouch'
    assert not humanoid.crossed and 'names of joints' in humanoid.loop.faults


def test_a_push_is_not_taken_for_an_imu_that_is_mounted_otherwise():
    humanoid, doubts = HumanoidUnderFault('none', 1, speed=0.0), []
    humanoid.run(1.5)
    humanoid.body.push(np.array([141.0, 141.0, 0.0]), 0.1)
    while humanoid.time < 7.0:
        humanoid.step()
        doubts.extend(humanoid.pattern.doubts.values())
    assert any('a push' in one for one in doubts) and not humanoid.fell
    assert humanoid.pattern.balancing and not humanoid.loop.faults


def test_after_a_push_that_felled_a_stand_it_walks_at_once():
    humanoid = HumanoidUnderFault('none', 1, speed=0.0)
    humanoid.run(1.5)
    humanoid.body.push(np.array([0.0, 1500.0, 0.0]), 0.1)
    humanoid.run(3.5)
    assert humanoid.fell and humanoid.pattern.fallen
    # Like robot_sim's ~/reset.
    humanoid.body.reset()
    humanoid.pattern.enable(True, 1.0)
    # It balances within .5 s, and shifts its weight for 1 s before the first step.
    humanoid.run(5.2)
    assert humanoid.pattern.level and not humanoid.loop.faults and humanoid.pattern.falls == 1
