"""Unitree's messages as bytes, and the machine that keeps a robot safe; no ROS graph."""

import math

import numpy as np
import pytest
from stand_in import C_STRUCT, COMMAND, STATE, check_sum, mpeg2

from cpg_ros.errors import CpgError
from cpg_ros.robots.robot_file import find_robot
from cpg_ros.unitree.crc import crc32
from cpg_ros.unitree.low_cmd import LowCmd
from cpg_ros.unitree.low_state import BUTTONS, LowState
from cpg_ros.unitree.models import JOINTS, MODELS
from cpg_ros.unitree.settings import settings_of
from cpg_ros.unitree.supervisor import Phase, Supervisor
from cpg_ros.unitree.vigil import Vigil

DT = 0.002
GO2 = settings_of(find_robot('unitree_go2'), MODELS['go2'], [60.0], [2.0])
LIE = np.tile([0.0, 1.36, -2.65], 4)


def filled(seed):
    """A command of random numbers."""
    rng, command = np.random.default_rng(seed), LowCmd()
    for part in (command.q, command.dq, command.tau, command.kp, command.kd):
        part[:] = rng.normal(0.0, 30.0, 12)
    return command


# -- bytes ------------------------------------------------------------------------------------

def test_crc_of_the_standard():
    # The check value of CRC-32/MPEG-2 in the catalogues of check sums.
    assert mpeg2(b'123456789') == 0x0376E6E7
    assert crc32(b'43218765') == mpeg2(b'12345678')


def test_crc_of_200_random_commands_is_the_table_driven_one():
    for seed in range(200):
        fields = COMMAND.unpack(filled(seed).sealed()[4:])
        assert check_sum(C_STRUCT.pack(*fields)[:808]) == fields[-1]


def test_a_command_is_what_rclpy_serialises():
    messages = pytest.importorskip('unitree_go.msg', reason='make unitree has not been run')
    from rclpy.serialization import deserialize_message, serialize_message
    command = filled(7)
    sealed = command.sealed()
    message = deserialize_message(sealed, messages.LowCmd)
    assert message.head.tolist() == [0xfe, 0xef] and message.level_flag == 0xff
    for k, motor in enumerate(message.motor_cmd):
        assert motor.mode == 1
        want = (tuple(float(part[k]) for part in (
            command.q, command.dq, command.tau, command.kp, command.kd)) if k < 12
            else (np.float32(2.146e9), 16000.0, 0.0, 0.0, 0.0))
        assert (motor.q, motor.dq, motor.tau, motor.kp, motor.kd) == want
    # rclpy leaves rubbish in the padding; everything else is the same, byte for byte.
    pads = COMMAND.pack(*[0xff if code in 'BH' else 0xffffffff if code == 'I' else -1e30
                          for code in codes(COMMAND.format)])
    again = serialize_message(message)[4:]
    places = [k for k, byte in enumerate(pads) if byte]
    assert len(again) == len(sealed) - 4 == 808
    assert [again[k] for k in places] == [sealed[4 + k] for k in places]


def codes(form):
    """One letter for each number of a struct's format."""
    import re
    return [code for count, code in re.findall(r'(\d*)([a-zA-Z])', form) if code != 'x'
            for _ in range(int(count or 1))]


def state_bytes(**given):
    """A state with random numbers, as struct packs it."""
    rng = np.random.default_rng(3)
    values = [float(np.float32(rng.normal())) if code == 'f' else int(rng.integers(0, 100))
              for code in codes(STATE.format)]
    for place, value in given.items():
        values[int(place[1:])] = value
    return values, b'\0\1\0\0' + STATE.pack(*values)


def test_a_state_is_read_as_rclpy_reads_it():
    messages = pytest.importorskip('unitree_go.msg', reason='make unitree has not been run')
    from rclpy.serialization import deserialize_message
    _, data = state_bytes()
    message, state = deserialize_message(data, messages.LowState), LowState()
    assert state.read(data)
    motors = message.motor_state[:12]
    for mine, name in ((state.q, 'q'), (state.dq, 'dq'), (state.torque, 'tau_est'),
                       (state.temperature, 'temperature'), (state.lost, 'lost')):
        assert mine.tolist() == [getattr(motor, name) for motor in motors]
    assert state.modes == tuple(motor.mode for motor in motors)
    imu, battery = message.imu_state, message.bms_state
    assert state.quaternion.tolist() == imu.quaternion.tolist()
    assert state.gyroscope.tolist() == imu.gyroscope.tolist()
    assert state.accelerometer.tolist() == imu.accelerometer.tolist()
    assert state.imu_temperature == imu.temperature
    assert state.feet.tolist() == message.foot_force.tolist()
    assert state.tick == message.tick and state.voltage == message.power_v
    assert state.charge == battery.soc / 100 and state.current == battery.current / 1000
    assert state.cells == [cell / 1000 for cell in battery.cell_vol if cell]
    assert state.buttons == int.from_bytes(bytes(message.wireless_remote[2:4]), 'little')


def test_what_is_no_state_is_not_read():
    assert not LowState().read(b'\0\1\0\0' + bytes(100))
    assert not LowState().read(bytes(1180))


# -- the machine ------------------------------------------------------------------------------

class Rig:
    """A supervisor and joints that do at once what they are told."""

    def __init__(self, q=LIE, settings=GO2):
        self.told = []
        self.machine = Supervisor(settings, lambda phase, reason: self.told.append(phase))
        self.state, self.now, self.tick = self.machine.state, 10.0, 0
        self.state.q[:] = q
        self.state.quaternion[:] = 1.0, 0.0, 0.0, 0.0
        self.mute, self.target, self.commands = False, None, []

    def run(self, seconds, every=1):
        for _ in range(round(seconds / DT)):
            self.now += DT
            self.tick += 1
            if not self.mute:
                self.machine.heard(self.now)
            if self.target is not None and not self.tick % every:
                self.machine.ask(np.array(self.target, dtype=float), self.now)
            if self.machine.step(self.now):
                command = self.machine.command
                self.commands.append(np.array([command.q, command.kp, command.kd]))
                if command.kp.any():
                    self.state.q[:] = command.q
        return self

    def following(self):
        self.run(0.01)
        assert not self.machine.rise(self.now)
        self.run(2.1)
        assert self.machine.phase is Phase.STANDING
        self.target = GO2.stand + 0.1
        self.run(1.2)
        assert self.machine.phase is Phase.FOLLOWING
        assert np.allclose(self.machine.command.q, GO2.stand + 0.1, atol=1e-6)
        return self


def test_nothing_is_sent_before_it_rises():
    rig = Rig()
    rig.target = GO2.stand
    assert not rig.run(0.5).commands and rig.machine.phase is Phase.IDLE


def test_it_rises_from_where_it_is_follows_and_sits():
    rig = Rig().following()
    assert np.allclose(rig.commands[0][0], LIE, atol=0.01)
    steps = np.abs(np.diff([row[0] for row in rig.commands], axis=0))
    assert steps.max() < 0.01
    rig.machine.sit(rig.now, 'SIGINT')
    rig.run(1.4)
    assert rig.machine.phase is Phase.SITTING
    rig.run(0.2)
    assert rig.machine.phase is Phase.DAMPING
    assert not rig.machine.command.kp.any() and (rig.machine.command.kd == 5.0).all()
    assert np.allclose(rig.state.q, LIE, atol=0.02)
    assert rig.told == [Phase.RISING, Phase.STANDING, Phase.FOLLOWING, Phase.SITTING,
                        Phase.DAMPING]


def test_slow_commands_are_interpolated():
    rig = Rig().following()
    first, rig.target = len(rig.commands), GO2.stand
    rig.run(0.02, every=5)
    rig.target = GO2.stand + 0.03
    rig.run(0.04, every=5)
    steps = np.diff([row[0][1] for row in rig.commands[first + 12:]])
    assert steps.max() == pytest.approx(0.006, rel=0.01)


def test_no_fresh_target_holds_then_sits_then_damps():
    rig = Rig().following()
    rig.target = None
    rig.run(0.096)
    assert rig.machine.phase is Phase.FOLLOWING
    assert np.allclose(rig.machine.command.q, GO2.stand + 0.1, atol=1e-6)
    rig.run(0.008)
    assert rig.machine.phase is Phase.SITTING and 'no fresh target' in rig.machine.reason
    # A generator that comes back does not lift it again.
    rig.target = GO2.stand
    rig.run(1.6)
    assert rig.machine.phase is Phase.DAMPING
    rig.run(1.0)
    assert rig.machine.phase is Phase.DAMPING
    assert not rig.machine.rise(rig.now)
    rig.run(2.1)
    assert rig.machine.phase is Phase.FOLLOWING


def test_a_leap_of_a_target_is_not_followed():
    rig = Rig().following()
    held = rig.machine.command.q.copy()
    rig.target = GO2.stand + 1.0
    rig.run(0.09)
    assert np.allclose(rig.machine.command.q, held)
    rig.run(0.02)
    assert rig.machine.phase is Phase.SITTING and 'leapt by 0.' in rig.machine.reason
    again = Rig().following()
    again.target = GO2.stand - 0.8
    again.run(0.05)
    again.target = GO2.stand + 0.1
    again.run(0.2)
    assert again.machine.phase is Phase.FOLLOWING


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
    (set_('lost', 1000), 'FR_thigh_joint does not hear'),
    (lambda rig: setattr(rig, 'target', GO2.stand * np.nan), 'a target is not a number'),
    (lambda rig: rig.machine.refuse('joint a is missing', rig.now), 'joint a is missing'),
    (lambda rig: rig.machine.damp(rig.now, '~/stop'), '~/stop')])
def test_it_damps_at_once(what, reason):
    rig = Rig().following()
    what(rig)
    rig.run(DT)
    assert rig.machine.phase is Phase.DAMPING and reason in rig.machine.reason
    assert not rig.machine.command.kp.any() and rig.machine.command.kd.all()


def test_joints_beyond_their_limits_damp_at_once():
    rig = Rig().following()
    rig.state.q[2] = GO2.lower[2] - 0.22
    rig.machine.heard(rig.now)
    rig.machine.step(rig.now + DT)
    assert rig.machine.phase is Phase.DAMPING
    assert 'FR_calf_joint is at -2.94 rad' in rig.machine.reason


def test_a_mute_robot_damps_after_20_ms():
    rig = Rig().following()
    rig.mute = True
    rig.run(0.018)
    assert rig.machine.phase is Phase.FOLLOWING
    rig.run(0.006)
    assert rig.machine.phase is Phase.DAMPING and 'no fresh state' in rig.machine.reason


def test_a_frozen_robot_is_mute():
    counter = len(codes(STATE.format)) - 1 - 1 - 4 - 2 - 2 - 1 - 1 - 40 - 1
    rig = Rig()
    assert rig.state.read(state_bytes(**{f'_{counter}': 77})[1]) and rig.state.tick == 77
    rig.machine.heard(1.0)
    rig.machine.heard(2.0)
    assert 'no fresh state' in rig.machine.rise(2.0)


def test_a_bridge_that_stood_still_damps():
    rig = Rig().following()
    rig.now += 0.03
    rig.run(DT)
    assert rig.machine.phase is Phase.DAMPING and 'itself stood still' in rig.machine.reason


def test_it_does_not_rise_in_danger_and_rises_after_it():
    rig = Rig()
    rig.state.temperature[3] = 90
    rig.run(0.01)
    assert 'FL_hip_joint has 90' in rig.machine.rise(rig.now)
    assert rig.machine.phase is Phase.IDLE and not rig.commands
    rig.state.temperature[3] = 40
    assert not rig.machine.rise(rig.now)
    assert 'rising already' in rig.machine.rise(rig.now)


@pytest.mark.parametrize('seed', range(5))
def test_no_command_asks_for_more_torque_than_joints_bear(seed):
    """Whatever is measured and asked for: |kp (q - angle) - kd speed| is within the limits."""
    rng = np.random.default_rng(seed)
    rig = Rig().following()
    limit = np.tile([23.7, 23.7, 45.43], 4)
    for _ in range(300):
        rig.state.q[:] = rng.uniform(GO2.lower, GO2.upper)
        rig.state.dq[:] = rng.normal(0.0, 15.0, 12)
        rig.now += DT
        rig.machine.heard(rig.now)
        rig.machine.ask(GO2.stand + 0.1 + rng.uniform(-0.05, 0.05, 12), rig.now)
        rig.machine.step(rig.now)
        command, state = rig.machine.command, rig.state
        torque = command.kp * (command.q - state.q) - command.kd * state.dq
        assert (np.abs(torque) <= limit * (1.0 + 1e-4)).all()
    assert rig.machine.phase is Phase.FOLLOWING
    rig.machine.damp(rig.now, 'now')
    rig.machine.step(rig.now)
    assert (np.abs(command.kd * state.dq) <= limit * (1.0 + 1e-4)).all()
    assert not command.kp.any()


@pytest.mark.parametrize(('kp', 'words'), [
    ([60.0, 60.0], 'kp has 2 numbers'), ([200.0], 'kp: 200 is not from 0 to 150'),
    ([math.nan], 'kp: nan is not')])
def test_gains_are_limited(kp, words):
    with pytest.raises(CpgError, match=words):
        settings_of(find_robot('unitree_go2'), MODELS['go2'], kp, [2.0])


def test_gains_for_each_kind_of_joint():
    settings = settings_of(find_robot('unitree_go2'), MODELS['go2'], [10.0, 20.0, 30.0], [2.0])
    assert dict(zip(JOINTS, settings.kp, strict=True))['RL_thigh_joint'] == 20.0


def test_another_robot_is_refused():
    with pytest.raises(CpgError, match="'goat' has no joint 'FR_hip_joint'"):
        settings_of(find_robot('goat'), MODELS['go2'], [60.0], [2.0])


def test_buttons():
    for name, byte, bit in (('R1', 2, 0), ('L2', 2, 5), ('A', 3, 0), ('B', 3, 1), ('left', 3, 7)):
        assert BUTTONS[name] == 1 << bit + 8 * (byte - 2)


# -- the watchdog ------------------------------------------------------------------------------

def test_the_watchdog_damps_after_two_missing_ticks_until_the_next():
    vigil, kd = Vigil(DT), np.full(12, 5.0)
    assert vigil.wait(0.0) is None and not vigil.due(100.0)
    vigil.hear(Vigil.HELLO, 100.0)
    assert vigil.wait(100.0) is None
    vigil.hear(Vigil.tick(kd), 100.0)
    assert not vigil.due(100.0 + 2.4 * DT) and vigil.due(100.0 + 2.6 * DT)
    assert vigil.kd.tolist() == kd.tolist() and vigil.alarms == 1
    assert not vigil.due(100.0 + 3.5 * DT) and vigil.due(100.0 + 3.7 * DT)
    vigil.hear(Vigil.tick(kd), 100.1)
    assert not vigil.due(100.1 + DT) and not vigil.over
    vigil.hear(Vigil.END, 100.2)
    assert vigil.over and vigil.alarms == 1
