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

"""The bridge's line to its watchdog: starts it, tells it every tick, hears if it is gone."""

import contextlib
import os
import socket
import subprocess
import sys
import time

from cpg_ros.unitree.vigil import Vigil
import numpy as np

#: A watchdog has this long to get ready, s: it loads ROS.
READY = 20.0
#: One that reads nothing for this long hangs, s.
HANGS = 0.5


def address(kind: str, domain: int, topic: str) -> str:
    """Return the name of a socket of this machine, one for each robot that is commanded.

    Args:
        kind: of whom: ``bridge`` or ``watchdog``.
        domain: of ROS.
        topic: on which commands are sent, resolved.

    """
    return f'\0cpg_ros/unitree/{kind}/{domain}{topic}'


class WatchdogLink:
    """A socket to a process that damps the robot when it hears nothing.

    A watchdog outlives its bridge; the next bridge for the same robot takes it over.
    """

    def __init__(self, domain: int, topic: str, period: float) -> None:
        """Prepare; arguments as of ``address``, and the bridge's period in s."""
        self._address = address('watchdog', domain, topic)
        self._command = [sys.executable, '-m', 'cpg_ros.nodes.unitree.watchdog', str(domain),
                         topic, str(period), str(os.getpid())]
        self._socket = socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM)
        self._socket.setblocking(False)
        self._process: subprocess.Popen | None = None
        self._read = float('inf')
        self._told = False

    def start(self) -> str:
        """Start a watchdog, or find one that is there; return why not, or ''."""
        if self._connected():
            return ''
        # A session of its own: what ends the bridge and its launch must not end it.
        self._process = subprocess.Popen(self._command, start_new_session=True,
                                         stdin=subprocess.DEVNULL)
        end = time.monotonic() + READY
        while not self._connected():
            if self._process.poll() is not None or time.monotonic() > end:
                return 'the watchdog does not start'
            time.sleep(0.05)
        return ''

    def _connected(self) -> bool:
        try:
            self._socket.connect(self._address)
            self._socket.send(Vigil.HELLO)
        except (ConnectionRefusedError, FileNotFoundError):
            return False
        return True

    def tick(self, kd: np.ndarray, now: float) -> str:
        """Tell it that the bridge lives; return what is wrong with it, or ''.

        Args:
            kd: how to damp if this was the last tick, N m s / rad.
            now: s.

        """
        try:
            self._socket.send(Vigil.tick(kd))
        except BlockingIOError:
            self._read = min(self._read, now)
            return 'the watchdog hangs' if now - self._read > HANGS else ''
        except OSError:
            return 'the watchdog is gone'
        self._read, self._told = now, True
        return ''

    def end(self) -> None:
        """Tell it that the robot rests, and wait for its end.

        One that damps for a bridge of before goes on if this one has never driven the robot.
        """
        if self._process is None and not self._told:
            return
        end = time.monotonic() + HANGS
        while time.monotonic() < end:
            try:
                self._socket.send(Vigil.END)
                break
            except BlockingIOError:
                time.sleep(0.01)
            except OSError:
                break
        if self._process is not None:
            with contextlib.suppress(subprocess.TimeoutExpired):
                self._process.wait(1.0)
        self._socket.close()
