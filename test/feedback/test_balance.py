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

"""A biped's pattern with its feedback: it stands, walks, falls, is put on its feet, walks."""

import math

from cpg_ros.common.errors import InputError
from cpg_ros.feedback.biped import crouch
from cpg_ros.feedback.biped.feedback import BipedFeedback, gait_plan
from cpg_ros.feedback.biped.links import links_of
from cpg_ros.motion.plan import plan
from cpg_ros.motion.robot_file import load_robot
from cpg_ros.networks.library.biped import Biped
import numpy as np
import pytest
from ticked_pattern import TickedPattern

pytest.importorskip('mujoco')

from cpg_ros.simulation.biped_run import BipedRun  # noqa: E402
from cpg_ros.simulation.scenario import PUSH_DURATION  # noqa: E402

DT = 0.002


class Walker:
    """A simulated humanoid that a balanced pattern moves."""

    def __init__(self):
        self.run = BipedRun('humanoid', load_robot('humanoid'))
        robot, preset = self.run.robot, Biped.presets()['walk']
        gait_plan = plan(robot, 'walk', preset, preset.network, 1.65)
        self.pattern = TickedPattern(gait_plan, 1.0, enabled=False)
        self.pattern.balance = BipedFeedback(robot, plan=gait_plan)
        self.before = self.run.body.rates[None].copy()
        self.blind, self.tilt, self.turned = False, 0.0, 0.0
        self.lower, self.upper, self.fastest = (robot.column(name) for name in (
            'lower', 'upper', 'velocity'))
        servos = [robot.biped.links[name] for name in robot.order]
        self.kp, self.effort = np.array([(one.kp, one.effort) for one in servos]).T
        self.crossed, self.last = [], self.pattern.position.copy()
        self.held = self.pattern.held_angles.copy()

    def go(self, seconds):
        """Go on; return by how much the base moved forward, m."""
        body, pattern = self.run.body, self.pattern
        start, self.tilt = body.base[0], 0.0
        for _ in range(round(seconds / DT)):
            sensors = self.run.measure(self.before)
            self.before[0] = body.rates
            sensors.rpy[0, 1] += self.turned
            pattern.sense(None if self.blind else sensors)
            pattern.advance(DT)
            self.check()
            body.command(pattern.position[pattern.robot.order_indices])
            body.step()
            body.hold(self.held)
            self.tilt = max(self.tilt, math.acos(min(body.axes[2, 2], 1.0)))
        return body.base[0] - start

    def check(self):
        """Note limits that are crossed, and published speeds that are not those of the joints."""
        pattern = self.pattern
        position, step = pattern.position, (pattern.position - self.last) / DT
        if (position < self.lower - 1e-9).any() or (position > self.upper + 1e-9).any():
            self.crossed.append('position')
        if (np.abs(step) > self.fastest * (1.0 + 1e-6)).any():
            self.crossed.append('speed')
        if pattern.balance is not None and np.abs(step - pattern.velocity).max() > 1e-6:
            self.crossed.append('published speed')
        pull = self.kp * np.abs(position[pattern.robot.order_indices] - self.run.body.position)
        if pattern.balancing and (pull > 1.02 * self.effort).any():
            self.crossed.append('torque')
        held = pattern.held_angles
        if np.abs(held - self.held).max() > 20.0 * DT:
            self.crossed.append('held joint')
        self.last, self.held = position.copy(), held.copy()


@pytest.fixture
def walker():
    made = Walker()
    yield made
    assert not made.crossed


def test_it_stands_walks_as_commanded_and_stops(walker):
    pattern = walker.pattern
    assert abs(walker.go(1.0)) < 0.03 and pattern.balancing and pattern.standing
    pattern.command = 0.3, 0.0, 0.0
    pattern.enable(True, 1.0)
    walker.go(3.0)
    assert pattern.level == 1.0 and not pattern.standing
    assert walker.go(5.0) == pytest.approx(1.5, rel=0.1)
    pattern.enable(False, 1.0)
    walker.go(4.0)
    assert pattern.standing and abs(walker.go(2.0)) < 0.02
    assert walker.tilt < 0.1 and not pattern.falls


def test_commands_keep_to_what_was_tried(walker):
    pattern = walker.pattern
    pattern.command = 9.0, -9.0, 9.0
    pattern.enable(True, 1.0)
    walker.go(1.5)
    assert pattern.balance.biped.velocities[1] == pytest.approx([0.6, -0.2, 0.5])


def test_after_a_fall_it_holds_the_stand_until_it_is_put_on_its_feet(walker):
    pattern, body = walker.pattern, walker.run.body
    pattern.command = 0.2, 0.0, 0.0
    pattern.enable(True, 1.0)
    walker.go(4.0)
    body.push(np.array([0.0, 1200.0, 0.0]), PUSH_DURATION)
    walker.go(2.5)
    assert pattern.falls == 1 and pattern.fallen and not pattern.balancing
    np.testing.assert_allclose(pattern.position, pattern.robot.column('offset'))
    assert not pattern.velocity.any()
    # Like robot_sim's ~/reset.
    body.reset()
    walker.go(1.0)
    assert pattern.balancing and not pattern.fallen
    walker.go(3.0)
    assert walker.go(4.0) > 0.5 and pattern.falls == 1


def test_a_robot_that_is_moved_in_mid_stride_starts_from_the_stand(walker):
    pattern, body = walker.pattern, walker.run.body
    pattern.command = 0.3, 0.0, 0.0
    pattern.enable(True, 1.0)
    walker.go(5.05)
    body.reset()
    walker.go(0.02)
    assert not pattern.balancing and not pattern.falls
    walker.go(4.0)
    assert walker.go(3.0) > 0.6 and not pattern.falls


def test_without_sensors_it_holds_the_stand(walker):
    pattern = walker.pattern
    walker.blind = True
    walker.go(0.3)
    np.testing.assert_allclose(pattern.position, pattern.robot.column('offset'))
    assert not pattern.balancing and pattern.level == 0.0
    walker.blind = False
    walker.go(2.0)
    assert pattern.balancing and walker.tilt < 0.1


@pytest.mark.parametrize('fault', ['none', 'blind', 'tilted', 'switched off'])
def test_limits_hold_in_a_walk_and_at_its_end(walker, fault):
    pattern = walker.pattern
    pattern.command = 0.5, 0.0, 0.0
    pattern.enable(True, 1.0)
    walker.go(4.1)
    if fault == 'none':
        # In a step the targets would be 7 times too fast, and beyond the limits of the ankles.
        assert pattern.held and not pattern.falls
    walker.blind, walker.turned = fault == 'blind', 1.5 if fault == 'tilted' else 0.0
    if fault == 'switched off':
        pattern.balance = None
    walker.go(1.5)
    assert pattern.balancing == (fault == 'none')


def test_without_feedback_it_is_the_open_loop_pattern(walker):
    pattern = walker.pattern
    pattern.balance = None
    pattern.enable(True, 0.1)
    for _ in range(1000):
        pattern.advance(DT)
    angles = []
    for _ in range(303):
        pattern.advance(DT)
        angles.append(pattern.position.copy())
    # The hips swing as the robot file says: by the weight of the waveform, which is -1 to 1.
    hip = [joint.name for joint in pattern.robot.joints].index('left_hip_pitch_joint')
    weight = pattern.robot.joints[hip].weights[0]
    assert np.ptp(np.array(angles)[:, hip]) == pytest.approx(2.0 * abs(weight), rel=0.02)


def test_another_frequency_keeps_the_phase(walker):
    pattern = walker.pattern
    pattern.command = 0.2, 0.0, 0.0
    pattern.enable(True, 1.0)
    walker.go(4.0)
    phase, preset = pattern.phases[0], Biped.presets()['walk']
    pattern.apply(plan(pattern.robot, 'walk', preset, preset.network, 1.8), 1.0)
    walker.go(DT)
    assert (pattern.phases[0] - phase - 1.8 * DT + 0.5) % 1.0 == pytest.approx(0.5, abs=0.01)
    assert pattern.balance.gains.frequency == 1.8
    walker.go(4.0)
    assert walker.tilt < 0.2 and not pattern.falls


@pytest.mark.parametrize('speed', [math.nan, 0.3])
def test_before_the_end_it_crouches_and_stays_up_without_commands(walker, speed):
    pattern = walker.pattern
    if speed > 0.0:
        pattern.command = speed, 0.0, 0.0
        pattern.enable(True, 1.0)
    walker.go(3.4)
    pattern.enable(False, 0.5)
    assert pattern.lower() and not pattern.standing
    for _ in range(60):
        if not pattern.standing:
            walker.go(0.1)
    assert pattern.standing and pattern.crouching and not pattern.falls
    # Servos hold the last targets; nobody commands any more.
    for _ in range(1500):
        walker.run.body.step()
    assert not walker.run.body.fallen
    assert math.acos(walker.run.body.axes[2, 2]) < 0.5


def test_servos_that_give_way_hold_a_crouch_short_of_the_end_of_the_knees(walker, monkeypatch):
    # As of a robot whose thighs would point downward at the end, such as the Unitree G1.
    monkeypatch.setattr(crouch, 'KNEE_FRACTIONS', np.array([0.75]))
    walker.go(2.0)
    assert walker.pattern.lower()
    walker.go(3.0)
    assert walker.pattern.crouching and not walker.run.body.fallen
    assert math.acos(walker.run.body.axes[2, 2]) < 0.5


def test_the_thighs_of_a_crouching_g1_are_at_most_level():
    robot = load_robot('unitree_g1')
    targets, depth = crouch.crouch_pose(robot, links_of(robot))
    thigh = targets[[joint.name for joint in robot.joints].index('left_ankle_pitch_joint')] + (
        targets[[joint.name for joint in robot.joints].index('left_knee_joint')])
    assert depth > 0.2 and 0.8 < thigh < 0.5 * math.pi


def test_a_run_ends_in_the_crouch_too(walker):
    pattern = walker.pattern
    pattern.apply(gait_plan(pattern.robot, 'run'), 0.0)
    pattern.command = 1.0, 0.0, 0.0
    pattern.enable(True, 1.0)
    walker.go(6.0)
    pattern.enable(False, 0.5)
    assert pattern.lower()
    for _ in range(60):
        if not pattern.standing:
            walker.go(0.1)
    assert pattern.standing and pattern.crouching and not walker.run.body.fallen


def test_from_the_crouch_it_stands_up_and_walks(walker):
    pattern = walker.pattern
    walker.go(1.0)
    walker.blind = True
    walker.go(1.0)
    assert pattern.crouching and not walker.run.body.fallen
    walker.blind = False
    pattern.command = 0.3, 0.0, 0.0
    pattern.enable(True, 1.0)
    walker.go(4.0)
    assert pattern.balancing and walker.go(2.0) > 0.4 and not pattern.falls


def test_a_robot_without_soles_has_no_balance():
    robot = load_robot('biped')
    preset = Biped.presets()['walk']
    with pytest.raises(InputError, match='no part biped'):
        BipedFeedback(robot, plan=plan(robot, 'walk', preset, preset.network, 1.0))
