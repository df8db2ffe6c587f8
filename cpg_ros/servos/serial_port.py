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

"""A serial port without a library: raw bytes at a baud rate, by termios."""

import os
import select
import termios
import time
import tty

from cpg_ros.servos.servo_board import ServoError


class SerialPort:
    """A serial port that never waits for longer than it is told to."""

    def __init__(self, path: str, baud: int) -> None:
        """Open a port such as ``/dev/ttyUSB0``.

        Raises:
            ServoError: the baud rate is none that Linux knows by name.
            OSError: the port cannot be opened, or is no serial port.

        """
        speed = getattr(termios, f'B{baud}', None)
        if speed is None:
            known = sorted(int(name[1:]) for name in dir(termios)
                           if name[0] == 'B' and name[1:].isdecimal() and int(name[1:]) >= 9600)
            raise ServoError(f'baud {baud} is not one of {", ".join(map(str, known))}')
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
        """Drop what has been received: it answers an earlier question."""
        termios.tcflush(self._file, termios.TCIFLUSH)

    def receive(self, until: float) -> bytes:
        """Return what arrives next; b'' if nothing does before an instant of the steady clock."""
        ready, _, _ = select.select([self._file], [], [], max(0.0, until - time.monotonic()))
        return os.read(self._file, 4096) if ready else b''

    def close(self) -> None:
        """Close the port."""
        os.close(self._file)
