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

"""The search for a biped's own gains: on a body whose best gains are known, and on a real one."""

from dataclasses import replace
import importlib.util
import math

from cpg_ros.common.errors import InputError
from cpg_ros.feedback.biped.gains import BipedGains
from cpg_ros.motion.robot_file import load_robot, read_robot
import numpy as np
import pytest

if any(importlib.util.find_spec(name) is None for name in ('mujoco', 'cma')):
    pytest.skip('the extra [sim] is not installed', allow_module_level=True)

from cpg_ros.simulation.biped_run import BipedOutcome
from cpg_ros.simulation.tuning import biped  # noqa: I100
from cpg_ros.simulation.tuning import tune as tool
from cpg_ros.simulation.tuning.biped import tune_biped, TunedBiped, Walk, walked, WalkJob
from cpg_ros.simulation.tuning.gaits import Survivors

HUMANOID = load_robot('humanoid')
BAD = replace(HUMANOID, biped=replace(HUMANOID.biped, gains={'place_x': 0.5}))
#: The best gain of the body, and how many times it may be off before it survives nothing.
BEST = 0.9


class Body:
    """Survives a walk the likelier, the nearer place_x is to BEST."""

    def __init__(self, flat=False):
        self.flat, self.seeds, self.walks = flat, [], []

    def __call__(self, job):
        self.walks.append(job.walks)
        found = []
        for gains in job.candidates:
            own = BipedGains.of_body(biped.with_gains(job.robot, gains).biped)
            off = 0.0 if self.flat else math.log(own.place_x / BEST)
            found.append([BipedOutcome(
                speed=(walk.speed, 0.0), tilt=0.1 * abs(off), fell=math.inf if (
                    walk.seed / 2**31 < math.exp(-4.0 * off * off)) else 6.0)
                for walk in job.walks])
        return found


def test_better_gains_are_found_and_found_again(monkeypatch):
    monkeypatch.setattr(biped, 'walked', body := Body())
    told = []
    robot, found = tune_biped(BAD, 'humanoid', 240, 5, update=told.append)
    assert found.better and found.pushes.after > found.pushes.before and told[-1] == 240
    assert found.pushes.runs == 72 and found.walks.runs == 20
    assert robot.biped.gains['place_x'] == pytest.approx(BEST, rel=0.15)
    assert tune_biped(BAD, 'humanoid', 240, 5) == (robot, found)
    # What judges has not been met by the search, whatever its speed or push.
    judged = {walk.seed for walks in body.walks if len(walks) == biped.WALKS_PER_JOB
              for walk in walks}
    met = {walk.seed for walks in body.walks if len(walks) > biped.WALKS_PER_JOB for walk in walks}
    assert len(judged) >= 88 and met and not judged & met


def test_gains_that_are_no_better_stay(monkeypatch):
    monkeypatch.setattr(biped, 'walked', Body(flat=True))
    robot, found = tune_biped(BAD, 'humanoid', 12, 1)
    assert not found.better and robot is BAD
    # One more of two is chance.
    walks = Survivors(20, 20, 20, 0)
    assert not TunedBiped(Survivors(72, 40, 41, 1), walks).better
    assert TunedBiped(Survivors(72, 40, 52, 1), walks).better
    # Neither pushes nor walks are enough alone.
    assert TunedBiped(Survivors(72, 40, 43, 0), Survivors(20, 15, 17, 0)).better
    assert not Survivors(72, 40, 43, 0).better


def test_pushes_and_speeds_go_with_the_size_of_the_robot():
    large = replace(HUMANOID, biped=replace(HUMANOID.biped, scale=(1.44, 1.0)))
    for one, other in zip(biped._walks(HUMANOID, 7, 2, 1),
                          biped._walks(large, 7, 2, 1), strict=True):
        assert other.speed == pytest.approx(1.2 * one.speed) and other.seed == one.seed
        assert other.tiles == pytest.approx(1.44 * one.tiles)
        if one.push:
            # m sqrt(g h)
            assert np.array(other.push[1:]) == pytest.approx(1.2 * np.array(one.push[1:]))


def test_walks_are_those_of_the_gains():
    push = biped.impulse(5.0, 0.0, 20.0)
    job = WalkJob(HUMANOID, 'humanoid', [{}, {'place_x': 0.0, 'place_y': 0.0}],
                  [Walk(0.3, 3, push), Walk(0.3, 4, tiles=0.03)])
    (stood, crossed), (fell, _) = walked(job)
    assert math.isinf(stood.fell) and math.isinf(crossed.fell) and fell.fell < 9.0
    assert crossed.speed[0] == pytest.approx(0.3, abs=0.05)
    with pytest.raises(InputError, match="robot file 'biped' has no part biped: check_robot"):
        tune_biped(load_robot('biped'), 'humanoid', 1, 0)


def test_the_file_says_what_it_was_found_by(tmp_path, capsys, monkeypatch):
    found = TunedBiped(Survivors(72, 40, 55, 1), Survivors(20, 17, 20, 0))
    monkeypatch.setattr(tool, 'tune_biped', lambda robot, *_, **__: (
        biped.with_gains(robot, {'place_x': 0.8}), found))
    out = tmp_path / 'own.yaml'
    given = ['--feedback', '--robot', 'humanoid', '--model', 'humanoid', '--out', str(out)]
    assert tool.main([*given, '--jobs', '1']) == 0
    assert read_robot(out).biped.gains == {'place_x': 0.8}
    said = capsys.readouterr().out
    for text in (said, out.read_text()):
        assert 'fresh pushes survived: 40 of 72 before, 55 after; of 20 walks without' in text
    assert tool.main([*given, '--gait', 'walk', 'trot']) == 2
    assert "of a biped's feedback the walk is tuned, not trot" in capsys.readouterr().err
    assert tool.main([*given, '--kp', '80']) == 2
    assert 'biped.links' in capsys.readouterr().err
