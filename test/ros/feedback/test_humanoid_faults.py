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

from depth import in_depth
import pytest

pytest.importorskip('mujoco')

from humanoid_under_fault import HumanoidUnderFault  # noqa: E402


@pytest.mark.parametrize('fault', ['dropped imu', 'dropped joints', *in_depth(
    'none', 'NaN imu', 'NaN joints', 'frozen joints', 'NaN feet', 'dropped feet', 'stamps 1 s old',
    'no velocities')])
def test_it_goes_on_walking_after(fault):
    humanoid = HumanoidUnderFault(fault, begins=3.0)
    assert humanoid.run(7.0) == 'walk'
    assert not humanoid.crossed and not humanoid.pattern.falls


@pytest.mark.parametrize('fault', ['delay 20 ms', *in_depth('delay 50 ms', 'delay 90 ms')])
def test_late_sensors_make_it_crouch(fault):
    humanoid = HumanoidUnderFault(fault)
    assert humanoid.run(4.0) == 'crouch'
    assert not humanoid.crossed and not humanoid.pattern.falls


@pytest.mark.parametrize('fault', ['feet swapped', *in_depth('encoder off .25')])
def test_an_input_that_contradicts_the_others_makes_it_crouch(fault):
    humanoid = HumanoidUnderFault(fault, begins=3.0)
    assert humanoid.run(6.5) == 'crouch'
    assert not humanoid.crossed and not humanoid.pattern.falls
    assert humanoid.loop.faults
