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

"""The bridge's connection to its watchdog: starts it, sends it a tick every period."""

import contextlib
import os
import subprocess
import sys
import time

from cpg_ros.errors import CpgError
from cpg_ros.nodes.bridge_interface import RobotInterface
from cpg_ros.nodes.local_socket import address, of_this_user, peer, unconnected
from cpg_ros.safety.tick_monitor import TickMonitor
import numpy as np

#: A watchdog has this long to get ready, s: it loads ROS.
READY = 20.0
#: A watchdog that reads nothing for this long hangs, s.
HANGS = 0.5
#: Exit code of a watchdog whose name another program has.
NAME_TAKEN = 3


class ForeignWatchdog(CpgError):
    """Another user's process listens under the watchdog's name; one line for the user."""


class WatchdogLink:
    """A connection to a process that damps the robot while it receives no ticks.

    A watchdog outlives its bridge; the next bridge of its user for the same robot takes it over.
    """

    def __init__(self, interface: type[RobotInterface], domain: int, namespace: str, topic: str,
                 period: float, timeout: float) -> None:
        """Prepare the command line of a watchdog.

        Args:
            interface: of the robot.
            domain: of ROS.
            namespace: of the bridge.
            topic: of the commands, resolved.
            period: of the bridge, s.
            timeout: without a tick, after which the watchdog damps the robot, s.

        """
        self._address = address(interface.maker, 'watchdog', domain, topic)
        self._command = [sys.executable, '-P', '-m', 'cpg_ros.nodes.watchdog',
                         interface.reference(), str(domain), namespace, topic, str(period),
                         str(timeout), str(os.getpid())]
        self._timeout = timeout
        self._socket = unconnected()
        self._process: subprocess.Popen | None = None
        self._read = float('inf')
        self._ticked = False

    def start(self) -> str:
        """Connect to a watchdog, and start one if there is none; return why not, or ''."""
        try:
            if self._connected():
                return ''
            # In a session of its own: what ends the bridge or its launch file must not end it.
            self._process = subprocess.Popen(self._command, start_new_session=True,
                                             stdin=subprocess.DEVNULL)
            end = time.monotonic() + READY
            while not self._connected():
                if (code := self._process.poll()) is not None or time.monotonic() > end:
                    return 'the watchdog does not start' + (
                        ': another program on this computer has taken its name and does not '
                        'answer' if code == NAME_TAKEN else '')
                time.sleep(0.05)
        except ForeignWatchdog as error:
            return str(error)
        return ''

    def _connected(self) -> bool:
        """Connect to a watchdog if there is one; return whether it is connected.

        Raises:
            ForeignWatchdog: it belongs to another user, and might not damp the robot.

        """
        with contextlib.suppress(OSError):
            self._socket.send(TickMonitor.HELLO)
            return True
        line, before = unconnected(), self._socket
        try:
            line.connect(self._address)
        # Its queue may be full: the caller tries again.
        except (ConnectionRefusedError, BlockingIOError):
            line.close()
            return False
        if not of_this_user(line):
            who = peer(line)
            line.close()
            raise ForeignWatchdog(f'what answers as the watchdog of this robot is {who}, another '
                                  'user than the bridge: end it')
        # One that an earlier bridge started has that bridge's timeout.
        with contextlib.suppress(OSError):
            line.send(TickMonitor.hello(self._timeout))
        self._socket = line
        before.close()
        return True

    def acted(self) -> bool:
        """Return whether the watchdog has damped the robot since the last call."""
        acted = False
        with contextlib.suppress(OSError):
            while message := self._socket.recv(64):
                acted |= message == TickMonitor.ACTED
        return acted

    def tick(self, kd: np.ndarray, now: float) -> str:
        """Send a tick; return what is wrong with the watchdog, or ''.

        Args:
            kd: gains for damping if no other tick follows, N m s / rad.
            now: s.

        """
        try:
            self._socket.send(TickMonitor.tick(kd))
        except BlockingIOError:
            self._read = min(self._read, now)
            return 'the watchdog hangs' if now - self._read > HANGS else ''
        except OSError:
            return 'the watchdog is gone'
        self._read, self._ticked = now, True
        return ''

    def end(self) -> None:
        """End the watchdog, the robot being at rest, and wait until it has ended.

        A watchdog that damps for an earlier bridge continues if this one never drove the robot.
        """
        if self._process is None and not self._ticked:
            return
        end = time.monotonic() + HANGS
        while time.monotonic() < end:
            try:
                self._socket.send(TickMonitor.END)
                break
            except BlockingIOError:
                time.sleep(0.01)
            except OSError:
                break
        if self._process is not None:
            with contextlib.suppress(subprocess.TimeoutExpired):
                self._process.wait(1.0)
        self._socket.close()
