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
import os
import select
import termios
import time
import tty
from typing import Protocol

from cpg_ros.common.errors import CpgError
import numpy as np

# The interface of every board of servos, and its error.

class ServoError(CpgError):
    """A servo or its bus cannot be used; the message names it and the reason."""


class ServoBoard(Protocol):
    """A board of servos, in its own units: microseconds of a pulse, or steps of an encoder.

    All methods raise an OSError if the bus fails, and ServoError if a servo reports a fault.
    """

    def write(self, units: np.ndarray) -> None:
        """Drive all servos to positions, whole numbers of shape (servos,)."""

    def read(self) -> np.ndarray | None:
        """Return the measured positions, shape (servos,); None if a servo does not answer."""

    def detach(self) -> None:
        """Disable the torque of all servos."""

    def close(self) -> None:
        """Close the board."""


# A serial port without a library: raw bytes at a baud rate, by termios.

class SerialPort:
    """A serial port with a time limit for every operation."""

    def __init__(self, path: str, baud: int) -> None:
        """Open a port such as ``/dev/ttyUSB0``.

        Raises:
            ServoError: Linux does not support the baud rate.
            OSError: the port cannot be opened, or is no serial port.

        """
        speed = getattr(termios, f'B{baud}', None)
        if speed is None:
            rates = sorted(int(name[1:]) for name in dir(termios)
                           if name[0] == 'B' and name[1:].isdecimal() and int(name[1:]) >= 9600)
            raise ServoError(f'baud {baud} is not one of {", ".join(map(str, rates))}')
        self._file = os.open(path, os.O_RDWR | os.O_NOCTTY | os.O_NONBLOCK)
        try:
            tty.setraw(self._file)
            modes = termios.tcgetattr(self._file)
            modes[2] |= termios.CLOCAL | termios.CREAD
            modes[4] = modes[5] = speed
            termios.tcsetattr(self._file, termios.TCSANOW, modes)
        except termios.error as error:
            os.close(self._file)
            raise OSError(*error.args) from error

    def send(self, data: bytes) -> None:
        """Send bytes; raise an OSError if the port does not take all of them at once."""
        if os.write(self._file, data) != len(data):
            raise OSError('the serial port takes no more bytes')

    def forget(self) -> None:
        """Discard received bytes, which answer an earlier question."""
        termios.tcflush(self._file, termios.TCIFLUSH)

    def receive(self, until: float) -> bytes:
        """Return the next bytes; b'' if none arrive before an instant of the steady clock."""
        ready, _, _ = select.select([self._file], [], [], max(0.0, until - time.monotonic()))
        return os.read(self._file, 4096) if ready else b''

    def close(self) -> None:
        """Close the port."""
        os.close(self._file)


#: Time in which all servos asked by one packet must have answered, s.
RESPONSE_TIMEOUT = 0.015


@dataclass(frozen=True)
class Reply:
    """A servo's answer: its identity, the byte that reports errors, and the requested data."""

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
        """Remove and return all complete answers; drop bytes that are not part of one."""

    def position(self, reply: Reply) -> int:
        """Return the position in an answer."""


class SerialBoard(ServoBoard):
    """Servos of one maker on one port."""

    def __init__(self, port: SerialPort, protocol: ServoProtocol, servos: Sequence[int]) -> None:
        """Address servos by their identities; their torque stays as it is."""
        self._port, self._protocol, self._servos = port, protocol, servos
        self._attached = False

    def write(self, units: np.ndarray) -> None:
        """Set the goals; the first time, enable torque after that."""
        self._port.send(self._protocol.goals(self._servos, units.tolist()))
        if not self._attached:
            self._port.send(self._protocol.torque(self._servos, True))
            self._attached = True

    def read(self) -> np.ndarray | None:
        """Return the positions of all servos; None if one exceeds RESPONSE_TIMEOUT."""
        values: dict[int, int] = {}
        for question, count in self._protocol.questions(self._servos):
            self._port.forget()
            self._port.send(question)
            until, received = time.monotonic() + RESPONSE_TIMEOUT, bytearray()
            missing = len(values) + count
            while len(values) < missing and (data := self._port.receive(until)):
                received += data
                for reply in self._protocol.replies(received):
                    if reply.servo in self._servos:
                        values[reply.servo] = self._value(reply)
            if len(values) < missing:
                return None
        return np.array([values[servo] for servo in self._servos])

    def _value(self, reply: Reply) -> int:
        if reply.error:
            raise ServoError(f'servo {reply.servo} reports the error 0x{reply.error:02X}')
        return self._protocol.position(reply)

    def detach(self) -> None:
        """Disable torque, even if it was not enabled here."""
        self._attached = False
        self._port.send(self._protocol.torque(self._servos, False))

    def close(self) -> None:
        """Close the port."""
        self._port.close()
