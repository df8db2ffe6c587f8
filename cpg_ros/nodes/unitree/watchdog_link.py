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
import subprocess
import sys
import time

from cpg_ros.errors import CpgError
from cpg_ros.nodes.unitree.local_socket import address, of_this_user, peer, unconnected
from cpg_ros.unitree.vigil import Vigil
import numpy as np

#: A watchdog has this long to get ready, s: it loads ROS.
READY = 20.0
#: One that reads nothing for this long hangs, s.
HANGS = 0.5
#: Exit code of a watchdog whose name another program has.
NAME_TAKEN = 3


class NotOurs(CpgError):
    """What listens under the watchdog's name belongs to another user; one line for the user."""


class WatchdogLink:
    """A connection to a process that damps the robot when it hears nothing.

    A watchdog outlives its bridge; the next bridge of its user for the same robot takes it over.
    """

    def __init__(self, domain: int, topic: str, period: float) -> None:
        """Prepare; arguments as of ``local_socket.address``, and the bridge's period in s."""
        self._address = address('watchdog', domain, topic)
        self._command = [sys.executable, '-m', 'cpg_ros.nodes.unitree.watchdog', str(domain),
                         topic, str(period), str(os.getpid())]
        self._socket = unconnected()
        self._process: subprocess.Popen | None = None
        self._read = float('inf')
        self._told = False

    def start(self) -> str:
        """Start a watchdog, or find one that is there; return why not, or ''."""
        try:
            if self._connected():
                return ''
            # A session of its own: what ends the bridge and its launch must not end it.
            self._process = subprocess.Popen(self._command, start_new_session=True,
                                             stdin=subprocess.DEVNULL)
            end = time.monotonic() + READY
            while not self._connected():
                if (code := self._process.poll()) is not None or time.monotonic() > end:
                    return 'the watchdog does not start' + (
                        ': another program on this computer has taken its name and does not '
                        'answer' if code == NAME_TAKEN else '')
                time.sleep(0.05)
        except NotOurs as error:
            return str(error)
        return ''

    def _connected(self) -> bool:
        """Connect to a watchdog, or tell whether it is connected.

        Raises:
            NotOurs: another user's process would hear the bridge, and not damp the robot.

        """
        with contextlib.suppress(OSError):
            self._socket.send(Vigil.HELLO)
            return True
        line, before = unconnected(), self._socket
        try:
            line.connect(self._address)
        # All that may wait do wait: it is asked again.
        except (ConnectionRefusedError, BlockingIOError):
            line.close()
            return False
        if not of_this_user(line):
            who = peer(line)
            line.close()
            raise NotOurs(f'what answers as the watchdog of this robot is {who}, another user '
                          'than the bridge: end it')
        self._socket = line
        before.close()
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
