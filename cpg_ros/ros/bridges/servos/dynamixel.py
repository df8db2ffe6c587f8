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

"""Dynamixel servos: packets of Protocol 2.0, and the control table of the X series.

From ROBOTIS's e-manual: the pages Protocol 2.0 (packets, byte stuffing, Sync Read, Sync Write),
CRC Calculation, and XM430-W210 (control table). MX servos with protocol 2.0 have the same.
"""

from collections.abc import Iterator, Sequence

from cpg_ros.ros.bridges.servos.serial_board import Reply, ServoProtocol

HEADER = b'\xff\xff\xfd\x00'
#: Byte stuffing: UNSTUFFED, data that look like a header, is sent as STUFFED.
UNSTUFFED, STUFFED = b'\xff\xff\xfd', b'\xff\xff\xfd\xfd'
BROADCAST = 0xFE
#: Codes of instructions.
STATUS, SYNC_READ, SYNC_WRITE = 0x55, 0x82, 0x83
#: Fields of the control table: address and length in bytes.
TORQUE_ENABLE, GOAL_POSITION, PRESENT_POSITION = (64, 1), (116, 4), (132, 4)
#: PREAMBLE_SIZE: bytes of a packet before its instruction; MAX_LENGTH: of an expected answer.
PREAMBLE_SIZE, MAX_LENGTH = 7, 64


def _crc_table() -> tuple[int, ...]:
    """Return the check sums of single bytes: CRC-16 with x^16 + x^15 + x^2 + 1, from 0."""
    table = []
    for byte in range(256):
        value = byte << 8
        for _ in range(8):
            value = (value << 1) ^ (0x8005 if value & 0x8000 else 0)
        table.append(value & 0xFFFF)
    return tuple(table)


_CRC_TABLE = _crc_table()


def crc(data: bytes) -> int:
    """Return the check sum of a packet without its last two bytes."""
    value = 0
    for byte in data:
        value = ((value << 8) & 0xFFFF) ^ _CRC_TABLE[(value >> 8) ^ byte]
    return value


def packet(servo: int, instruction: int, parameters: bytes = b'') -> bytes:
    """Return a packet: stuffed first, then its length, then its check sum."""
    body = bytes((instruction, *parameters)).replace(UNSTUFFED, STUFFED)
    data = HEADER + bytes((servo,)) + (len(body) + 2).to_bytes(2, 'little') + body
    return data + crc(data).to_bytes(2, 'little')


def sync_write(field: tuple[int, int], servos: Sequence[int], values: Sequence[int]) -> bytes:
    """Return the packet that writes a value to the same field of several servos."""
    _, length = field
    data = b''.join(bytes((servo,)) + (value % (1 << 8 * length)).to_bytes(length, 'little')
                    for servo, value in zip(servos, values, strict=True))
    return packet(BROADCAST, SYNC_WRITE, _field(field) + data)


def _field(field: tuple[int, int]) -> bytes:
    return b''.join(number.to_bytes(2, 'little') for number in field)


class Dynamixel(ServoProtocol):
    """X series, in steps of 1/4096 turn."""

    def goals(self, servos: Sequence[int], units: Sequence[int]) -> bytes:
        """Return a Sync Write of Goal Position."""
        return sync_write(GOAL_POSITION, servos, units)

    def torque(self, servos: Sequence[int], on: bool) -> bytes:
        """Return a Sync Write of Torque Enable."""
        return sync_write(TORQUE_ENABLE, servos, [int(on)] * len(servos))

    def questions(self, servos: Sequence[int]) -> Iterator[tuple[bytes, int]]:
        """Return one Sync Read of Present Position, which all servos answer."""
        yield packet(BROADCAST, SYNC_READ, _field(PRESENT_POSITION) + bytes(servos)), len(servos)

    def replies(self, received: bytearray) -> Iterator[Reply]:
        """Remove and return all status packets with a right check sum."""
        while (start := received.find(HEADER)) >= 0:
            del received[:start]
            if len(received) < PREAMBLE_SIZE:
                return
            length = int.from_bytes(received[5:7], 'little')
            end = PREAMBLE_SIZE + length
            if length > MAX_LENGTH or (len(received) >= end and crc(bytes(received[:end - 2]))
                                    != int.from_bytes(received[end - 2:end], 'little')):
                del received[:len(HEADER)]
                continue
            if len(received) < end:
                return
            servo = received[4]
            body = bytes(received[PREAMBLE_SIZE:end - 2]).replace(STUFFED, UNSTUFFED)
            del received[:end]
            # An adapter may return what was sent, too.
            if body[0] == STATUS:
                yield Reply(servo, body[1], body[2:])

    def position(self, reply: Reply) -> int:
        """Return Present Position, which has a sign: it may count several turns."""
        return int.from_bytes(reply.data, 'little', signed=True)
