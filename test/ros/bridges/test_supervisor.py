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

"""The machine that keeps a robot and people safe, and its watchdog; no ROS graph."""

from dataclasses import replace
import math

from cpg_ros.common.errors import CpgError
from cpg_ros.motion.robot_file import load_robot
from cpg_ros.ros.bridges.supervisor import BridgeState, Supervisor
from cpg_ros.ros.bridges.unitree.messages import LowCmd, LowState, MODELS, settings_of
from cpg_ros.ros.bridges.watchdog_link import TickMonitor
import numpy as np
import pytest

DT = 0.002
GO2 = settings_of(load_robot('unitree_go2'), MODELS['go2'], [60.0], [2.0])
LIE = np.tile([0.0, 1.36, -2.65], 4)


class Rig:
    """A supervisor and joints that do at once what they are told."""

    def __init__(self, q=LIE, settings=GO2, model=MODELS['go2']):
        self.states = []
        self.state, self.now, self.tick = LowState(model), 10.0, 0
        self.machine = Supervisor(settings, self.state, LowCmd(model),
                                  lambda state, reason: self.states.append(state))
        self.state.q[:] = q
        self.state.quaternion[:] = 1.0, 0.0, 0.0, 0.0
        self.mute, self.target, self.commands, self.stuck = False, None, [], None

    def run(self, seconds, every=1):
        for _ in range(round(seconds / DT)):
            self.now += DT
            self.tick += 1
            if not self.mute:
                self.machine.state_received(self.now)
            if self.target is not None and not self.tick % every:
                self.machine.set_target(np.array(self.target, dtype=float), self.now)
            if self.machine.step(self.now):
                command = self.machine.command
                self.commands.append(np.array([command.q, command.kp, command.kd]))
                if command.kp.any():
                    self.state.q[:] = command.q
                if self.stuck is not None:
                    self.state.q[self.stuck[0]] = self.stuck[1]
        return self

    def following(self):
        self.run(0.01)
        assert not self.machine.rise(self.now)
        self.run(2.1)
        assert self.machine.state is BridgeState.STANDING
        self.target = GO2.stand + 0.1
        self.run(1.2)
        assert self.machine.state is BridgeState.FOLLOWING
        assert np.allclose(self.machine.command.q, GO2.stand + 0.1, atol=1e-6)
        return self


def test_nothing_is_sent_before_it_rises():
    rig = Rig()
    rig.target = GO2.stand
    assert not rig.run(0.5).commands and rig.machine.state is BridgeState.IDLE


def test_it_rises_from_where_it_is_follows_and_sits():
    rig = Rig().following()
    assert np.allclose(rig.commands[0][0], LIE, atol=0.01)
    steps = np.abs(np.diff([row[0] for row in rig.commands], axis=0))
    assert steps.max() < 0.01
    rig.machine.sit(rig.now, 'SIGINT')
    # The gait fades while its targets come.
    rig.run(0.25)
    assert np.allclose(rig.machine.command.q, GO2.stand + 0.05, atol=1e-3)
    rig.run(1.65)
    assert rig.machine.state is BridgeState.SITTING
    rig.run(0.2)
    assert rig.machine.state is BridgeState.DAMPING
    assert not rig.machine.command.kp.any() and (rig.machine.command.kd == 5.0).all()
    assert np.allclose(rig.state.q, LIE, atol=0.02)
    assert rig.states == [BridgeState.RISING, BridgeState.STANDING, BridgeState.FOLLOWING,
                          BridgeState.SITTING, BridgeState.DAMPING]


def test_slow_commands_are_interpolated():
    rig = Rig().following()
    first, rig.target = len(rig.commands), GO2.stand
    rig.run(0.02, every=5)
    rig.target = GO2.stand + 0.03
    rig.run(0.04, every=5)
    steps = np.diff([row[0][1] for row in rig.commands[first + 12:]])
    assert steps.max() == pytest.approx(0.006, rel=0.01)


def test_no_fresh_target_holds_then_gathers_then_sits_then_damps():
    rig = Rig().following()
    rig.target = None
    rig.run(0.026)
    assert np.allclose(rig.machine.command.q, GO2.stand + 0.1, atol=1e-6)
    rig.run(0.07)
    assert rig.machine.state is BridgeState.FOLLOWING
    assert np.allclose(rig.machine.command.q, GO2.stand, atol=1e-6)
    rig.run(0.008)
    assert rig.machine.state is BridgeState.SITTING and 'no fresh target' in rig.machine.reason
    # A generator that comes back does not lift it again.
    rig.target = GO2.stand
    rig.run(1.6)
    assert rig.machine.state is BridgeState.DAMPING
    rig.run(1.0)
    assert rig.machine.state is BridgeState.DAMPING
    assert not rig.machine.rise(rig.now)
    rig.run(2.1)
    assert rig.machine.state is BridgeState.FOLLOWING


def test_targets_that_come_back_in_time_are_joined_smoothly():
    rig = Rig().following()
    rig.target = None
    rig.run(0.096)
    first, rig.target = len(rig.commands), GO2.stand + 0.1
    rig.run(0.1)
    assert rig.machine.state is BridgeState.FOLLOWING
    assert np.allclose(rig.machine.command.q, GO2.stand + 0.1, atol=1e-6)
    assert np.abs(np.diff([row[0] for row in rig.commands[first:]], axis=0)).max() < 0.01


def test_a_generator_that_ends_amid_the_fading_is_not_waited_for():
    rig = Rig().following()
    rig.machine.sit(rig.now, 'SIGINT')
    rig.run(0.2)
    rig.target = None
    rig.run(1.55)
    assert rig.machine.state is BridgeState.DAMPING


def test_a_leap_of_a_target_is_not_followed():
    rig = Rig().following()
    held = rig.machine.command.q.copy()
    rig.target = GO2.stand + 1.0
    rig.run(0.026)
    assert np.allclose(rig.machine.command.q, held)
    rig.run(0.084)
    assert rig.machine.state is BridgeState.SITTING and 'jumped by 0.' in rig.machine.reason
    again = Rig().following()
    again.target = GO2.stand - 0.8
    again.run(0.05)
    again.target = GO2.stand + 0.1
    again.run(0.2)
    assert again.machine.state is BridgeState.FOLLOWING


@pytest.mark.parametrize(('beyond', 'followed'), [(-0.01, True), (0.01, False)])
def test_a_target_leaps_no_further_than_joints_move_and_a_twentieth_of_a_radian(beyond, followed):
    rig = Rig().following()
    rig.target = rig.target + GO2.velocity * DT + 0.05 + beyond
    rig.run(0.2)
    assert (rig.machine.state is BridgeState.FOLLOWING) is followed


def set_(name, value):
    def do(rig):
        if name == 'machine':
            value(rig)
        else:
            getattr(rig.state, name)[1] = value
    return do


def lean(rig):
    half = math.radians(51.0) / 2.0
    rig.state.quaternion[:] = math.cos(half), 0.0, math.sin(half), 0.0


@pytest.mark.parametrize(('what', 'reason'), [
    (set_('q', np.nan), 'not a number'), (set_('dq', np.inf), 'not a number'),
    (set_('quaternion', np.nan), 'no orientation'), (lean, 'leans by 51 degrees'),
    (set_('temperature', 85), 'FR_thigh_joint has 85 deg C'),
    (set_('lost', 1000), 'FR_thigh_joint receives no commands'),
    (lambda rig: setattr(rig, 'target', GO2.stand * np.nan), 'a target is not a number'),
    (lambda rig: rig.machine.reject_target('joint a is missing', rig.now), 'joint a is missing'),
    (lambda rig: rig.machine.damp(rig.now, '~/stop'), '~/stop')])
def test_it_damps_at_once(what, reason):
    rig = Rig().following()
    what(rig)
    rig.run(DT)
    assert rig.machine.state is BridgeState.DAMPING and reason in rig.machine.reason
    assert not rig.machine.command.kp.any() and rig.machine.command.kd.all()


def test_joints_beyond_their_limits_damp_at_once():
    rig = Rig().following()
    rig.state.q[2] = GO2.lower[2] - 0.22
    rig.machine.state_received(rig.now)
    rig.machine.step(rig.now + DT)
    assert rig.machine.state is BridgeState.DAMPING
    assert 'FR_calf_joint is at -2.94 rad' in rig.machine.reason


def test_a_mute_robot_damps_after_20_ms():
    rig = Rig().following()
    rig.mute = True
    rig.run(0.018)
    assert rig.machine.state is BridgeState.FOLLOWING
    rig.run(0.006)
    assert rig.machine.state is BridgeState.DAMPING and 'no fresh state' in rig.machine.reason


def test_without_a_fresh_state_joints_are_held_where_they_were_told_last():
    rig = Rig().following()
    first = len(rig.commands)
    for k in range(14):
        rig.target, rig.mute = GO2.stand + 0.1 - 0.01 * k, k >= 5
        rig.run(DT)
    wanted = np.array([row[0] for row in rig.commands[first:]])
    assert rig.machine.state is BridgeState.FOLLOWING
    # Two periods without a state may be a late one.
    assert np.allclose(np.diff(wanted[:7], axis=0), -0.01, atol=1e-6)
    assert not np.diff(wanted[6:], axis=0).any()


def test_a_frozen_robot_is_mute():
    rig = Rig()
    rig.state._all['tick'] = 77
    rig.machine.state_received(1.0)
    rig.machine.state_received(2.0)
    assert 'no fresh state' in rig.machine.rise(2.0)


def test_a_bridge_that_stood_still_damps():
    rig = Rig().following()
    rig.now += 0.03
    rig.run(DT)
    assert rig.machine.state is BridgeState.DAMPING and 'itself stalled' in rig.machine.reason


def test_it_does_not_rise_in_danger_and_rises_after_it():
    rig = Rig()
    rig.state.temperature[3] = 90
    rig.run(0.01)
    assert 'FL_hip_joint has 90' in rig.machine.rise(rig.now)
    assert rig.machine.state is BridgeState.IDLE and not rig.commands
    rig.state.temperature[3] = 40
    assert not rig.machine.rise(rig.now)
    assert 'rising already' in rig.machine.rise(rig.now)


@pytest.mark.parametrize('seed', range(5))
def test_no_command_asks_for_more_torque_than_joints_bear(seed):
    """Whatever is measured and asked for: |kp (q - angle) - kd speed + tau| is within the limits.

    One motor has no stiffness.
    """
    rng = np.random.default_rng(seed)
    kp = np.where(np.arange(12) == seed, 0.0, 60.0)
    rig = Rig(settings=replace(GO2, kp=kp)).following()
    limit = np.tile([23.7, 23.7, 45.43], 4)
    for _ in range(300):
        rig.state.q[:] = rng.uniform(GO2.lower, GO2.upper)
        rig.state.dq[:] = rng.normal(0.0, 15.0, 12)
        rig.now += DT
        rig.machine.state_received(rig.now)
        rig.machine.set_target(GO2.stand + 0.1 + rng.uniform(-0.05, 0.05, 12), rig.now)
        rig.machine.kp_scale = rng.choice([1.0, 2.0, 4.0])
        rig.machine.feedforward = rng.uniform(-1.0, 1.0, 12) * limit
        rig.machine.step(rig.now)
        command, state = rig.machine.command, rig.state
        assert (command.kp == np.minimum(kp * rig.machine.kp_scale, 150.0)).all()
        assert command.tau.any()
        torque = command.kp * (command.q - state.q) - command.kd * state.dq + command.tau
        assert (np.abs(torque) <= limit * (1.0 + 1e-4)).all()
    assert rig.machine.state is BridgeState.FOLLOWING
    rig.machine.damp(rig.now, 'now')
    rig.machine.step(rig.now)
    assert (np.abs(command.kd * state.dq) <= limit * (1.0 + 1e-4)).all()
    assert not command.kp.any() and not command.tau.any()


@pytest.mark.parametrize(('kp', 'words'), [
    ([60.0, 60.0], 'kp has 2 numbers'), ([200.0], 'kp: 200 is not from 0 to 150'),
    ([math.nan], 'kp: nan is not')])
def test_gains_are_limited(kp, words):
    with pytest.raises(CpgError, match=words):
        settings_of(load_robot('unitree_go2'), MODELS['go2'], kp, [2.0])


def test_gains_for_each_kind_of_joint():
    settings = settings_of(load_robot('unitree_go2'), MODELS['go2'], [10.0, 20.0, 30.0], [2.0])
    assert dict(zip(settings.names, settings.kp, strict=True))['RL_thigh_joint'] == 20.0


def test_another_robot_is_refused():
    with pytest.raises(CpgError, match="'goat' has no joint 'FR_hip_joint'"):
        settings_of(load_robot('goat'), MODELS['go2'], [60.0], [2.0])


def test_a_joint_that_does_not_follow_makes_it_sit():
    rig = Rig(settings=replace(GO2, tracking_error=0.1, tracking_time=0.5)).following()
    rig.run(1.0)
    assert rig.machine.state is BridgeState.FOLLOWING
    # 0.2 rad away: the mean of the time constant 0.5 s passes 0.1 rad after 0.5 ln 2 = 0.347 s.
    rig.stuck = 3, rig.state.q[3] + 0.2
    rig.run(0.34)
    assert rig.machine.state is BridgeState.FOLLOWING
    rig.run(0.02)
    assert rig.machine.state is BridgeState.SITTING
    assert rig.machine.reason.startswith('FL_hip_joint does not follow: it is at')


@pytest.mark.parametrize(('swing', 'slack', 'stuck'), [
    (0.06, 0.005, True), (0.06, 0.03, False), (0.03, 0.0, False)])
def test_a_joint_that_is_stuck_within_a_small_swing_makes_it_sit(swing, slack, stuck):
    # Never 0.1 rad away on average: what tells is that it hardly moves, where it should by enough.
    rig = Rig(settings=replace(GO2, tracking_error=0.1, tracking_time=0.5)).following()
    middle = rig.target[3]
    for tick in range(round(2.5 / DT)):
        wave = np.sin(2.0 * np.pi * 2.0 * DT * tick)
        rig.target[3], rig.stuck = middle + swing * wave, (3, middle + slack * wave)
        rig.run(DT)
    assert (rig.machine.state is BridgeState.FOLLOWING) != stuck
    assert ('FL_hip_joint is stuck at' in rig.machine.reason) == stuck


# -- a humanoid ----------------------------------------------------------------------------------

G1 = settings_of(load_robot('unitree_g1'), MODELS['g1'], [0.0], [0.0])


def humanoid():
    return Rig(np.zeros(29), G1, MODELS['g1'])


def test_a_humanoid_hangs_in_its_rack_until_it_is_sent_on():
    rig = humanoid().run(0.01)
    rig.target = G1.stand + 0.01
    assert not rig.machine.rise(rig.now)
    rig.run(4.0)
    assert rig.machine.state is BridgeState.HANGING
    assert 'hanging already' in rig.machine.rise(rig.now)
    assert np.allclose(rig.machine.command.q, G1.stand, atol=1e-6)
    rig.machine.stand(rig.now)
    rig.run(1.2)
    assert rig.machine.state is BridgeState.FOLLOWING
    assert np.allclose(rig.machine.command.q, G1.stand + 0.01, atol=1e-6)
    rig.machine.sit(rig.now, '~/stop')
    rig.run(2.1)
    assert rig.states == [BridgeState.RISING, BridgeState.HANGING, BridgeState.STANDING,
                          BridgeState.FOLLOWING, BridgeState.SITTING, BridgeState.DAMPING]
    # Arms stay, legs crouch; every joint is damped as the robot file has it.
    assert np.allclose(rig.state.q[15:], G1.stand[15:], atol=0.02)
    assert rig.state.q[3] == pytest.approx(2.02, abs=0.02)
    assert rig.machine.command.kd.tolist() == pytest.approx([*[5.0] * 4, 2.0, 2.0] * 2 + [
        4.8, 4.0, 4.0] + [*[2.0] * 5, 0.4, 0.4] * 2)


def test_stand_is_for_a_robot_in_a_rack_only():
    rig = Rig().run(0.01)
    assert not rig.machine.rise(rig.now)
    rig.machine.stand(rig.now)
    assert rig.machine.state is BridgeState.RISING


@pytest.mark.parametrize(('bits', 'damps'), [(0x40000000, False), (0x40000010, True)])
def test_a_new_error_of_a_motor_damps_at_once(bits, damps):
    # What is set before anything is sent may be that nothing is.
    rig = humanoid()
    rig.state.error[7] = 0x40000000
    rig.run(0.01)
    assert not rig.machine.rise(rig.now)
    rig.run(0.5)
    rig.state.error[7] = bits
    rig.run(DT)
    assert (rig.machine.state is BridgeState.DAMPING) is damps
    assert ('right_hip_roll_joint reports the error 0x10' in rig.machine.reason) is damps


def test_a_humanoid_needs_all_its_joints_in_the_robot_file():
    with pytest.raises(CpgError, match="'humanoid' has no joint 'waist_yaw_joint'"):
        settings_of(load_robot('humanoid'), MODELS['g1'], [0.0], [0.0])
    with pytest.raises(CpgError, match='kd has 3 numbers: give one for all joints, or 29, for'):
        settings_of(load_robot('unitree_g1'), MODELS['g1'], [0.0], [1.0, 1.0, 1.0])


# -- the watchdog ------------------------------------------------------------------------------

def test_the_watchdog_damps_after_two_missing_ticks_until_the_next():
    monitor, kd = TickMonitor(DT, 0.0), np.full(12, 5.0)
    assert monitor.timeout(0.0) is None and not monitor.due(100.0)
    monitor.receive(TickMonitor.HELLO, 100.0)
    assert monitor.timeout(100.0) is None
    monitor.receive(TickMonitor.tick(kd), 100.0)
    assert not monitor.due(100.0 + 2.4 * DT) and monitor.due(100.0 + 2.6 * DT)
    assert monitor.kd.tolist() == kd.tolist() and monitor.alarms == 1
    assert not monitor.due(100.0 + 3.5 * DT) and monitor.due(100.0 + 3.7 * DT)
    monitor.receive(TickMonitor.tick(kd), 100.1)
    assert not monitor.due(100.1 + DT) and not monitor.ended
    monitor.receive(TickMonitor.END, 100.2)
    assert monitor.ended and monitor.alarms == 1
