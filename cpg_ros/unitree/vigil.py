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

"""What a watchdog knows of the process that it watches: when its ticks are missing."""

import numpy as np

#: A tick is missing this many periods after the last one: two should have come, and had time to.
MISSING = 2.5


class Vigil:
    """Counts the time since the last tick, and what damping is due meanwhile.

    Attributes:
        kd: with which the joints are to be damped, N m s / rad; as the last tick said.
        alarms: how often ticks have been missing.
        over: whether the process has said that it ends, the robot at rest.

    """

    def __init__(self, period: float) -> None:
        """Wait for the first tick of a process that ticks every ``period`` s."""
        self._period = period
        self._last = self._sent = np.inf
        self._missing = False
        self.kd = np.zeros(0, '<f4')
        self.alarms, self.over = 0, False

    @staticmethod
    def tick(kd: np.ndarray) -> bytes:
        """Return what a process says every period: how to damp if it says no more."""
        return kd.astype('<f4').tobytes()

    #: What it says when it ends.
    END = b'end'
    #: What it says to see whether somebody watches.
    HELLO = b'hello'

    def hear(self, word: bytes, now: float) -> None:
        """Take what the process has said, now in s."""
        if word == self.END:
            self.over = True
        elif word != self.HELLO and len(word) % 4 == 0:
            self.kd = np.frombuffer(word, '<f4')
            self._last, self._missing = now, False

    def wait(self, now: float) -> float | None:
        """Return for how long, s, nothing need be done unless something is heard; None: ever."""
        if self._last == np.inf:
            return None
        due = self._sent + self._period if self._missing else self._last + MISSING * self._period
        return max(0.0, due - now)

    def due(self, now: float) -> bool:
        """Return whether damping is to be sent now; it is taken as sent."""
        if self._last == np.inf or self.wait(now):
            return False
        self.alarms += not self._missing
        self._missing, self._sent = True, now
        return True
