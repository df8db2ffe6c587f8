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

"""Unitree's messages as bytes, their check sum, and announcements of DDS; no ROS graph."""

import re

from cpg_ros.ros.bridges.unitree.bridge import harmful
from cpg_ros.ros.bridges.unitree.messages import BUTTONS, crc32, LowCmd, LowState, MODELS
import numpy as np
import pytest
from stand_in import (
    C_STRUCT,
    check_sum,
    COMMAND,
    HG_C_STRUCT,
    HG_COMMAND,
    HG_STATE,
    MACHINE,
    mpeg2,
    STATE,
)


def filled(seed, model='go2'):
    """Return a command of random numbers."""
    rng, command = np.random.default_rng(seed), LowCmd(MODELS[model])
    for part in (command.q, command.dq, command.tau, command.kp, command.kd):
        part[:] = rng.normal(0.0, 30.0, len(part))
    command.echo[:] = MACHINE
    return command


def test_crc_of_the_standard():
    # The check value of CRC-32/MPEG-2 in the catalogues of check sums.
    assert mpeg2(b'123456789') == 0x0376E6E7
    assert crc32(b'43218765') == mpeg2(b'12345678')


@pytest.mark.parametrize(('model', 'cdr', 'packed'), [
    ('go2', COMMAND, C_STRUCT), ('g1', HG_COMMAND, HG_C_STRUCT),
    ('h1_2', HG_COMMAND, HG_C_STRUCT)])
def test_crc_of_200_random_commands_is_the_table_driven_one(model, cdr, packed):
    for seed in range(200):
        fields = cdr.unpack(filled(seed, model).encode()[4:])
        assert check_sum(packed.pack(*fields)[:-4]) == fields[-1]


#: Of ``filled`` by seed 0, 1, 2 for G1 and H1-2: what crc32_core and the struct of unitree_ros2
#: (motor_crc_hg) give.
HG_SUMS = {'g1': [3684546565, 3630007603, 2594431448],
           'h1_2': [1450468110, 242326950, 1114928446]}


@pytest.mark.parametrize('model', HG_SUMS)
def test_crc_of_a_humanoids_commands_is_that_of_unitrees_code(model):
    found = [filled(seed, model).encode()[-4:] for seed in range(3)]
    assert [int.from_bytes(one, 'little') for one in found] == HG_SUMS[model]


@pytest.mark.parametrize(('model', 'cdr', 'size'), [
    ('go2', COMMAND, 808), ('g1', HG_COMMAND, 1000), ('h1_2', HG_COMMAND, 1000)])
def test_a_command_is_what_rclpy_serialises(model, cdr, size):
    humanoid, joints = model != 'go2', len(MODELS[model].joints)
    messages = pytest.importorskip('unitree_hg.msg' if humanoid else 'unitree_go.msg',
                                   reason='make messages has not been run')
    from rclpy.serialization import deserialize_message, serialize_message
    command = filled(7, model)
    sealed = command.encode()
    message = deserialize_message(sealed, messages.LowCmd)
    if humanoid:
        assert (message.mode_pr, message.mode_machine) == (0, MACHINE)
    else:
        assert message.head.tolist() == [0xfe, 0xef] and message.level_flag == 0xff
    for k, motor in enumerate(message.motor_cmd):
        assert motor.mode == int(k < joints or not humanoid)
        want = (tuple(float(part[k]) for part in (
            command.q, command.dq, command.tau, command.kp, command.kd)) if k < joints
            else (0.0,) * 5 if humanoid else (np.float32(2.146e9), 16000.0, 0.0, 0.0, 0.0))
        assert (motor.q, motor.dq, motor.tau, motor.kp, motor.kd) == want
    # rclpy leaves rubbish in the padding; everything else is the same, byte for byte.
    pads = cdr.pack(*[0xff if code in 'BH' else 0xffffffff if code == 'I' else -1e30
                      for code in codes(cdr.format)])
    again = serialize_message(message)[4:]
    places = [k for k, byte in enumerate(pads) if byte]
    assert len(again) == len(sealed) - 4 == size
    assert [again[k] for k in places] == [sealed[4 + k] for k in places]


def codes(form):
    """One letter for each number of a struct's format."""
    return [code for count, code in re.findall(r'(\d*)([a-zA-Z])', form) if code != 'x'
            for _ in range(int(count or 1))]


def state_bytes(form):
    """Return a state with random numbers, as struct packs it."""
    rng = np.random.default_rng(3)
    values = [float(np.float32(rng.normal())) if code == 'f' else int(rng.integers(0, 100))
              for code in codes(form.format)]
    return b'\0\1\0\0' + form.pack(*values)


def test_a_humanoids_state_is_read_as_rclpy_reads_it():
    messages = pytest.importorskip('unitree_hg.msg', reason='make messages has not been run')
    from rclpy.serialization import deserialize_message
    data = state_bytes(HG_STATE)
    message, state = deserialize_message(data, messages.LowState), LowState(MODELS['g1'])
    assert state.read(data) and len(data) == 2092
    motors = message.motor_state[:29]
    for mine, name in ((state.q, 'q'), (state.dq, 'dq'), (state.torque, 'tau_est'),
                       (state.error, 'motorstate')):
        assert mine.tolist() == [getattr(motor, name) for motor in motors]
    assert state.temperature.tolist() == [max(motor.temperature) for motor in motors]
    assert state.modes == tuple(motor.mode for motor in motors)
    imu = message.imu_state
    assert state.quaternion.tolist() == imu.quaternion.tolist()
    assert state.gyroscope.tolist() == imu.gyroscope.tolist()
    assert state.accelerometer.tolist() == imu.accelerometer.tolist()
    assert state.imu_temperature == imu.temperature and state.tick == message.tick
    assert state.echo.tolist() == [message.mode_machine]
    assert state.buttons == int.from_bytes(bytes(message.wireless_remote[2:4]), 'little')
    assert not LowState(MODELS['g1']).read(data[:-1])


def test_a_state_is_read_as_rclpy_reads_it():
    messages = pytest.importorskip('unitree_go.msg', reason='make messages has not been run')
    from rclpy.serialization import deserialize_message
    data = state_bytes(STATE)
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


def test_buttons():
    for name, byte, bit in (('R1', 2, 0), ('L2', 2, 5), ('A', 3, 0), ('B', 3, 1), ('left', 3, 7)):
        assert BUTTONS[name] == 1 << bit + 8 * (byte - 2)


# As caught on a loopback: what participants of cyclonedds 0.10.2 and 11.0.1 say of themselves.
@pytest.mark.parametrize(('version', 'found'), [
    ('0.11.0', ''), ('11.0.1', 'cyclonedds 11.0 on vm'), ('12.1.0', 'cyclonedds 12.1 on vm')])
def test_a_cyclonedds_that_crashes_the_firmware_is_recognised(version, found):
    words = f'vm/{version}/Linux/Linux'.encode()
    said = (bytes.fromhex('078030000000000000000000000000000000000000000000000016000000')
            + words + b'\0\0\0')
    head = bytes.fromhex('52545053020501100110e52fa359ff6571c58f16')
    assert harmful(head + said) == found
    # Another vendor's, and what is no announcement.
    assert not harmful(head[:6] + b'\x01\x0f' + head[8:] + said)
    assert not harmful(said) and not harmful(b'')
