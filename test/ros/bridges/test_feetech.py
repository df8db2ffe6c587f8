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

"""Packets of Feetech's servos: the examples of the maker's manual, byte by byte."""

from cpg_ros.ros.bridges.servos.feetech import Feetech, packet, sync_write
import pytest

STS, SCS = Feetech(encoder=True), Feetech(encoder=False)


def test_packets_of_the_manual():
    # Example 1, PING; example 2, READ of the position; example 4, WRITE of a goal.
    assert packet(1, 0x01) == bytes.fromhex('FFFF 01 02 01 FB')
    assert packet(1, 0x02, bytes((0x38, 2))) == bytes.fromhex('FFFF 01 04 02 38 02 BE')
    assert packet(1, 0x03, bytes.fromhex('2A 0008 0000 E803')) == bytes.fromhex(
        'FFFF 01 09 03 2A 0008 0000 E803 D5')
    # Example 7, SYNC WRITE: position, time and speed of ID 1 to 4.
    assert sync_write((0x2A, 6), (1, 2, 3, 4), [bytes.fromhex('0008 0000 E803')] * 4) == (
        bytes.fromhex('FFFF FE 20 83 2A 06 01 00080000E803 02 00080000E803 '
                      '03 00080000E803 04 00080000E803 58'))


def test_goals_are_the_low_byte_first_with_an_encoder_and_the_high_byte_without():
    # Check sums by hand: ~(FE + 0A + 83 + 2A + 02 + 01 + 00 + 08 + 02 + FF + 07) and so on.
    assert STS.goals([1, 2], [0x0800, 0x07FF]) == bytes.fromhex(
        'FFFF FE 0A 83 2A 02 01 0008 02 FF07 37')
    assert SCS.goals([1], [0x0203]) == bytes.fromhex('FFFF FE 07 83 2A 02 01 0203 45')


def test_torque_is_a_byte_at_40():
    assert STS.torque([1, 2], True) == bytes.fromhex('FFFF FE 08 83 28 01 01 01 02 01 48')
    assert STS.torque([1, 2], False)[-4:-1] == bytes.fromhex('00 02 00')


def test_questions():
    # Example 8 asks for 8 bytes; the position alone is two: the check sum grows by 6.
    assert list(STS.questions([1, 2])) == [(bytes.fromhex('FFFF FE 06 82 38 02 01 02 3C'), 2)]
    assert list(SCS.questions([1, 2])) == [
        (bytes.fromhex('FFFF 01 04 02 38 02 BE'), 1), (bytes.fromhex('FFFF 02 04 02 38 02 BD'), 1)]


def test_answers_of_the_manual_in_any_pieces_after_an_echo():
    # Examples 2 and 8.
    stream = bytes.fromhex('FFFF FE 06 82 38 02 01 02 3C FFFF 01 04 02 38 02 BE '
                           'FFFF 01 04 00 1805 DD FFFF 01 0A 00 0008 0000 0000 79 1E 55 '
                           'FFFF 02 0A 00 FF07 0000 0000 77 23 53')
    received, found = bytearray(), []
    for byte in stream:
        received.append(byte)
        found += STS.replies(received)
    assert [(one.servo, one.error, STS.position(one)) for one in found] == [
        (1, 0, 1304), (1, 0, 2048), (2, 0, 2047)]


@pytest.mark.parametrize('place', range(2, 8))
def test_a_damaged_answer_is_left_out_and_the_next_one_is_found(place):
    answer = bytes.fromhex('FFFF 01 04 00 1805 DD')
    damaged = bytearray(answer)
    damaged[place] ^= 0x10
    found = list(STS.replies(bytearray(damaged + answer * 8)))
    assert found and {(one.servo, STS.position(one)) for one in found} == {(1, 1304)}


def test_signs_and_orders_of_positions():
    # Bit 15 is the sign, not part of a complement: -100 is 8064h.
    (reply,) = STS.replies(bytearray(packet(3, 0, bytes.fromhex('6480'))))
    assert STS.position(reply) == -100
    (reply,) = SCS.replies(bytearray(packet(3, 0, bytes.fromhex('0203'))))
    assert SCS.position(reply) == 0x0203
