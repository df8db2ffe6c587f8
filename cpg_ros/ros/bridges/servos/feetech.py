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

"""Feetech's serial servos: packets of the SCS protocol, and the memory of STS, SMS and SCS.

From Feetech's Communication Protocol User Manual: packets (1.1, 1.2), READ DATA, SYNC WRITE and
SYNC READ (1.3.2, 1.3.6, 1.3.7), and from the memory tables of STS3215 and SCS15. Servos with a
magnetic encoder (STS, SMS) send the low byte first, others (SCS) the high byte.
"""

from collections.abc import Iterator, Sequence
from typing import Literal

from cpg_ros.ros.bridges.servos.serial_board import Reply, ServoProtocol

HEADER = b'\xff\xff'
BROADCAST = 0xFE
#: Codes of instructions.
READ, SYNC_READ, SYNC_WRITE = 0x02, 0x82, 0x83
#: Fields of the memory: address and length in bytes.
TORQUE_SWITCH, GOAL_POSITION, PRESENT_POSITION = (40, 1), (42, 2), (56, 2)
#: SIGN_BIT: bit that marks a negative position of STS and SMS.
SIGN_BIT = 0x8000
#: MAX_LENGTH: largest length of an expected answer, bytes.
MAX_LENGTH = 32


def checksum(data: bytes) -> int:
    """Return the check sum of the bytes between the header and it."""
    return ~sum(data) & 0xFF


def packet(servo: int, instruction: int, parameters: bytes = b'') -> bytes:
    """Return a packet."""
    data = bytes((servo, len(parameters) + 2, instruction, *parameters))
    return HEADER + data + bytes((checksum(data),))


def sync_write(field: tuple[int, int], servos: Sequence[int], values: Sequence[bytes]) -> bytes:
    """Return the packet that writes bytes to the same field of several servos."""
    data = b''.join(bytes((servo,)) + value for servo, value in zip(servos, values, strict=True))
    return packet(BROADCAST, SYNC_WRITE, bytes(field) + data)


class Feetech(ServoProtocol):
    """STS and SMS in steps of 1/4096 turn, SCS in steps of its own range / 1024."""

    def __init__(self, encoder: bool) -> None:
        """Speak to servos with a magnetic encoder, or to those with a potentiometer."""
        self._encoder = encoder
        self._order: Literal['little', 'big'] = 'little' if encoder else 'big'

    def goals(self, servos: Sequence[int], units: Sequence[int]) -> bytes:
        """Return a SYNC WRITE of the goal position, at the speed that the servo has."""
        return sync_write(GOAL_POSITION, servos,
                          [value.to_bytes(2, self._order) for value in units])

    def torque(self, servos: Sequence[int], on: bool) -> bytes:
        """Return a SYNC WRITE of the torque switch."""
        return sync_write(TORQUE_SWITCH, servos, [bytes((on,))] * len(servos))

    def questions(self, servos: Sequence[int]) -> Iterator[tuple[bytes, int]]:
        """Return one SYNC READ; servos with a potentiometer have none and are asked singly."""
        if self._encoder:
            yield packet(BROADCAST, SYNC_READ, bytes((*PRESENT_POSITION, *servos))), len(servos)
            return
        for servo in servos:
            yield packet(servo, READ, bytes(PRESENT_POSITION)), 1

    def replies(self, received: bytearray) -> Iterator[Reply]:
        """Remove and return all answers with a position and a right check sum."""
        while (start := received.find(HEADER)) >= 0:
            del received[:start]
            if len(received) < 4:
                return
            servo, length = received[2], received[3]
            end = 4 + length
            if servo >= BROADCAST or not 2 <= length <= MAX_LENGTH:
                del received[0]
                continue
            if len(received) < end:
                return
            if checksum(bytes(received[2:end - 1])) != received[end - 1]:
                del received[0]
                continue
            error, data = received[4], bytes(received[5:end - 1])
            # An adapter may return what was sent, too: a READ, whose length is another one.
            own = received[:end] == packet(servo, READ, bytes(PRESENT_POSITION))
            del received[:end]
            if not own:
                yield Reply(servo, error, data)

    def position(self, reply: Reply) -> int:
        """Return the position of an answer."""
        value = int.from_bytes(reply.data[:2], self._order)
        return SIGN_BIT - value if self._encoder and value & SIGN_BIT else value
