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

"""Servos on a serial bus: goals to all in one packet, and positions from each."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
import time
from typing import Protocol

from cpg_ros.servos.serial_port import SerialPort
from cpg_ros.servos.servo_board import ServoBoard, ServoError
import numpy as np

#: Time in which all servos asked by one packet must have answered, s.
ANSWER = 0.015


@dataclass(frozen=True)
class Reply:
    """A servo's answer: its identity, the byte that reports errors, and the data asked for."""

    servo: int
    error: int
    data: bytes


class ServoProtocol(Protocol):
    """The packets of a maker."""

    def goals(self, servos: Sequence[int], units: Sequence[int]) -> bytes:
        """Return the packet that drives servos to positions."""

    def torque(self, servos: Sequence[int], on: bool) -> bytes:
        """Return the packet that switches the torque of servos on or off."""

    def questions(self, servos: Sequence[int]) -> Iterator[tuple[bytes, int]]:
        """Return packets that ask for positions, each with the number of its answers."""

    def replies(self, received: bytearray) -> Iterator[Reply]:
        """Take all complete answers out of what was received, and drop what is none."""

    def position(self, reply: Reply) -> int:
        """Return the position in an answer."""


class SerialBoard(ServoBoard):
    """Servos of one maker on one port."""

    def __init__(self, port: SerialPort, protocol: ServoProtocol, servos: Sequence[int]) -> None:
        """Talk to servos by their identities; their torque stays as it is."""
        self._port, self._protocol, self._servos = port, protocol, servos
        self._attached = False

    def write(self, units: np.ndarray) -> None:
        """Set the goals; the first time, switch the torque on once the goals are there."""
        self._port.send(self._protocol.goals(self._servos, units.tolist()))
        if not self._attached:
            self._port.send(self._protocol.torque(self._servos, True))
            self._attached = True

    def read(self) -> np.ndarray | None:
        """Ask all servos where they are; None if one does not answer within ANSWER s."""
        found: dict[int, int] = {}
        for question, count in self._protocol.questions(self._servos):
            self._port.forget()
            self._port.send(question)
            until, received = time.monotonic() + ANSWER, bytearray()
            missing = len(found) + count
            while len(found) < missing and (data := self._port.receive(until)):
                received += data
                for reply in self._protocol.replies(received):
                    if reply.servo in self._servos:
                        found[reply.servo] = self._value(reply)
            if len(found) < missing:
                return None
        return np.array([found[servo] for servo in self._servos])

    def _value(self, reply: Reply) -> int:
        if reply.error:
            raise ServoError(f'servo {reply.servo} reports the error 0x{reply.error:02X}')
        return self._protocol.position(reply)

    def detach(self) -> None:
        """Switch the torque off, also where it was not switched on from here."""
        self._attached = False
        self._port.send(self._protocol.torque(self._servos, False))

    def close(self) -> None:
        """Close the port."""
        self._port.close()
