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

"""Monitoring of a process's ticks by its watchdog."""

import struct

import numpy as np

#: A tick is missing this many periods after the last one: two should have come, and had time to.
MISSING = 2.5


class TickMonitor:
    """Measures the time since the last tick, and decides when to damp the joints.

    Attributes:
        kd: gains for damping, N m s / rad, as sent with the last tick.
        alarms: how often ticks have been missing.
        ended: whether the process has announced its end, the robot at rest.

    """

    def __init__(self, period: float, timeout: float) -> None:
        """Wait for the first tick of a process.

        Args:
            period: between two ticks, s.
            timeout: since the last tick after which damping begins, s; 2.5 periods at least.

        """
        self._period, self._timeout = period, timeout
        self._last = self._sent = np.inf
        self._missing = False
        self.kd = np.zeros(0, '<f4')
        self.alarms, self.ended = 0, False

    @staticmethod
    def tick(kd: np.ndarray) -> bytes:
        """Return the message of a tick: the gains for damping if no other tick follows."""
        return kd.astype('<f4').tobytes()

    #: Message of a process that ends.
    END = b'end'
    #: Message that only checks whether a watchdog is connected; it may bring a new timeout.
    HELLO = b'hello'
    #: Message to the process: the joints have been damped in its absence.
    ACTED = b'acted'

    @staticmethod
    def hello(timeout: float) -> bytes:
        """Return the message that connects a process with a timeout of its own, s."""
        return TickMonitor.HELLO + struct.pack('<d', timeout)

    def receive(self, message: bytes, now: float) -> None:
        """Take a message of the process, now in s."""
        if message == self.END:
            self.ended = True
        elif message.startswith(self.HELLO):
            if len(message) == len(self.hello(0.0)):
                self._timeout = struct.unpack('<d', message[len(self.HELLO):])[0]
        elif len(message) % 4 == 0:
            self.kd = np.frombuffer(message, '<f4')
            self._last, self._missing = now, False

    def timeout(self, now: float) -> float | None:
        """Return how long to wait for a message, s; None: without limit."""
        if self._last == np.inf:
            return None
        due = self._sent + self._period if self._missing else self._last + max(
            self._timeout, MISSING * self._period)
        return max(0.0, due - now)

    def due(self, now: float) -> bool:
        """Return whether to send a damping command now; the caller then sends it."""
        if self._last == np.inf or self.timeout(now):
            return False
        self.alarms += not self._missing
        self._missing, self._sent = True, now
        return True
