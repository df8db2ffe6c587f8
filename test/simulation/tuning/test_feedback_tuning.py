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

"""The search for a robot's own gains, on bodies whose best gains are known."""

from dataclasses import replace
import importlib.util
import math
from types import SimpleNamespace

from cpg_ros.feedback.gains import Gains, robot_gains
from cpg_ros.motion.body_file import OwnFeedback
from go2 import GO2
import numpy as np
import pytest

if any(importlib.util.find_spec(name) is None for name in ('mujoco', 'cma')):
    pytest.skip('the extra [sim] is not installed', allow_module_level=True)

from cpg_ros.simulation.tuning import feedback  # noqa: I100
from cpg_ros.simulation.tuning.feedback import FeedbackTrial, NUM_CALM, tune_feedback
from cpg_ros.simulation.tuning.gaits import Survivors

#: The step, s, with which the bodies survive most, and that of robots before the search.
BEST, BEGIN = 0.2, 0.08
#: Of its time in seconds: sqrt(l/g) with the Go2's legs.
TIME = math.sqrt(0.426 / 9.81)


class Body(FeedbackTrial):
    """Survives a push of a draw from 0 to 1 the likelier, the nearer its step is to BEST."""

    flat, falls_undisturbed, alone = False, False, 0.1
    draws: list = []

    def __init__(self, robot, model, gait, kp, kd):
        self.loop, self.length, self.speed = self, 0.426, 0.4

    def pushed(self, rng, count, impulses):
        found = rng.uniform(size=count * len(impulses)).tolist()
        self.draws.append(found)
        return found

    def run(self, scenarios, duration, gains=None, noise=None):
        off = 0.0 if gains is None or self.flat else math.log(gains.step / BEST)
        fraction = self.alone if gains is None else math.exp(-2.0 * off * off)
        upright = [one < fraction if isinstance(one, float) else
                   gains is None or not self.falls_undisturbed for one in scenarios]
        return SimpleNamespace(upright=np.array(upright), fell=np.where(upright, math.inf, 1.0),
                               cost=np.ones(len(scenarios)),
                               velocity=np.full((len(scenarios), 10, 3), self.speed),
                               place=np.full((len(scenarios), 10, 2), 9.0))


#: As many runs survived as before.
SAME = Survivors(42, 30, 30, 0)


@pytest.fixture
def body(monkeypatch):
    for module in (feedback, feedback):
        monkeypatch.setattr(module, 'FeedbackTrial', Body)
    monkeypatch.setattr(Body, 'draws', [])
    return Body


ROBOT = replace(GO2, feedback=OwnFeedback(laws={'speed': False}, gains={'step': BEGIN / TIME}))


def test_the_search_finds_gains_that_survive_more_on_draws_that_it_has_not_seen(body):
    told = []
    robot, found = tune_feedback(ROBOT, 'go2', ['trot', 'walk'], 160, 5, update=told.append)
    assert told[-1] == 160
    assert found.better and found.pushes.after > found.pushes.before > found.without
    assert abs(math.log(robot_gains(robot).step / BEST)) < 0.5 * math.log(BEST / BEGIN)
    own = robot.feedback
    assert own.enabled and 'trot, walk, seed 5' in own.made and str(found) in own.made
    # A law that is off has no gains of its own, and stays off.
    assert not own.laws['speed'] and 'speed_share' not in own.gains and 'roll' in own.gains
    # Of two gaits each: pushes that compare, and those that judge whether feedback helps at all.
    *trained, judged, again, _, _ = body.draws
    assert judged == again and len(judged) == found.pushes.runs // 2
    assert not any(set(judged) & set(draw) for draw in trained)
    # Every generation meets others, each of its jobs and gaits the same ones.
    assert len({tuple(draw) for draw in trained}) == 1 + math.ceil(157 / 12)
    again, _ = tune_feedback(ROBOT, 'go2', ['trot', 'walk'], 160, 5)
    assert again == robot


def test_where_nothing_is_better_gains_stay(body, monkeypatch):
    monkeypatch.setattr(body, 'flat', True)
    robot, found = tune_feedback(ROBOT, 'go2', ['trot'], 20, 5)
    assert not found.better and found.pushes.after == found.pushes.before
    assert robot_gains(robot) == robot_gains(ROBOT)
    assert robot.feedback.enabled


def test_feedback_that_fells_undisturbed_robots_is_off(body, monkeypatch):
    monkeypatch.setattr(body, 'falls_undisturbed', True)
    robot, found = tune_feedback(ROBOT, 'go2', ['trot'], 20, 5)
    assert found.fell == NUM_CALM and not found.better and not robot.feedback.enabled
    assert '4 undisturbed runs fell' in robot.feedback.made


def test_better_gains_of_a_feedback_that_does_not_help_leave_it_off(body, monkeypatch):
    monkeypatch.setattr(body, 'alone', 1.0)
    robot, found = tune_feedback(ROBOT, 'go2', ['trot'], 160, 5)
    assert found.better and 'step' in robot.feedback.gains and not robot.feedback.enabled
    assert '(without feedback 24; 0 with it only' in robot.feedback.made


@pytest.mark.parametrize('after, lost, fell, better', [
    (55, 0, 0, True), (54, 0, 0, False), (62, 5, 0, True), (56, 5, 0, False), (50, 0, 0, False),
    (45, 5, 0, False), (70, 0, 1, False)])
def test_gains_are_better_only_where_chance_does_not_make_them_so(after, lost, fell, better):
    """Of n pushes that only one survives, all n after: p = 2^-n, below 0.05 from n = 5 on."""
    assert feedback.TunedFeedback(Survivors(96, 50, after, lost), SAME, 20, fell).better is better


def test_gains_with_which_less_ground_is_crossed_are_no_better():
    pushes = Survivors(96, 50, 90, 0)
    for lost, better in ((5, False), (4, True)):
        found = feedback.TunedFeedback(pushes, Survivors(42, 30, 30 - lost, lost), 20, 0)
        assert found.better is better
        assert f'crossed: before 30 of 42, after {30 - lost}' in str(found)


def test_every_gain_that_is_searched_for_exists():
    for law, names in feedback.GAIN_NAMES.items():
        assert getattr(Gains(), law) and all(getattr(Gains(), name) > 0.0 for name in names)
