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

"""Packets of Dynamixel's Protocol 2.0: the examples of ROBOTIS's e-manual, byte by byte."""

from cpg_ros.ros.bridges.servos.dynamixel import crc, Dynamixel, packet
import numpy as np

CHAIN = Dynamixel()
#: The status packets of the example of Sync Read: ID 1 at 166, ID 2 at 2079.
FIRST = bytes.fromhex('FFFFFD00 01 0800 55 00 A6000000 8CC0')
SECOND = bytes.fromhex('FFFFFD00 02 0800 55 00 1F080000 BABE')


def test_check_sum_of_the_catalogue():
    # CRC-16/UMTS, polynomial 8005h from 0: its check value.
    assert crc(b'123456789') == 0xFEE8


def test_packets_of_the_manual():
    assert packet(1, 0x01) == bytes.fromhex('FFFFFD00 01 0300 01 194E')
    assert packet(1, 0x03, bytes.fromhex('7400 00020000')) == bytes.fromhex(
        'FFFFFD00 01 0900 03 7400 00020000 CA89')
    # Sync Write: 150 and 170 to Goal Position of ID 1 and 2.
    assert CHAIN.goals([1, 2], [150, 170]) == bytes.fromhex(
        'FFFFFD00 FE 1100 83 7400 0400 01 96000000 02 AA000000 8287')
    # Sync Read of Present Position.
    assert list(CHAIN.questions([1, 2])) == [(bytes.fromhex(
        'FFFFFD00 FE 0900 82 8400 0400 01 02 CEFA'), 2)]


def test_torque_is_a_byte_at_64():
    assert CHAIN.torque([3, 7], True)[:-2] == bytes.fromhex(
        'FFFFFD00 FE 0B00 83 4000 0100 03 01 07 01')
    assert CHAIN.torque([3], False)[-3] == 0


def test_data_that_look_like_a_header_are_stuffed():
    sent = packet(1, 0x03, bytes.fromhex('7400 FFFFFD00'))
    assert sent[5:7] == (10).to_bytes(2, 'little') and sent[7:-2] == bytes.fromhex(
        '03 7400 FFFFFDFD00')
    answer = packet(1, 0x55, bytes.fromhex('00 FFFFFD00'))
    (reply,) = CHAIN.replies(bytearray(answer))
    assert reply.data == bytes.fromhex('FFFFFD00')


def test_answers_of_the_manual_in_any_pieces_after_an_echo():
    (question, _), = CHAIN.questions([1, 2])
    stream, received, found = question + FIRST + SECOND, bytearray(), []
    for byte in stream:
        received.append(byte)
        found += CHAIN.replies(received)
    assert [(one.servo, one.error, CHAIN.position(one)) for one in found] == [
        (1, 0, 166), (2, 0, 2079)]
    assert not received


def test_damaged_answers_are_left_out_and_the_next_one_is_found():
    rng = np.random.default_rng(34)
    for _ in range(200):
        damaged = bytearray(FIRST)
        damaged[rng.integers(4, len(FIRST))] ^= 1 << rng.integers(8)
        noise = rng.integers(0, 256, rng.integers(8), dtype=np.uint8).tobytes()
        received = bytearray(noise + damaged + SECOND + SECOND * 5)
        found = list(CHAIN.replies(received))
        assert found and all(CHAIN.position(one) == 2079 and one.servo == 2 for one in found)


def test_a_position_below_zero():
    answer = packet(5, 0x55, b'\x00' + (-100).to_bytes(4, 'little', signed=True))
    assert [CHAIN.position(one) for one in CHAIN.replies(bytearray(answer))] == [-100]
