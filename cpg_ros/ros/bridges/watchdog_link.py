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
import pwd
import socket
import struct
import subprocess
import sys
import time
from typing import ClassVar

from cpg_ros.common.errors import CpgError
from cpg_ros.ros.bridges.robot_state import JointCommand
import numpy as np

# Connections between processes of one user on this computer, one name for each robot.

#: BUFFER_SIZE: of the send buffer, bytes; small, so that a process that does not read is noticed.
BUFFER_SIZE = 4096
#: The kernel's struct ucred: process, user, group.
_CREDENTIALS = struct.Struct('3i')


class NameTaken(CpgError):
    """Another program has the name; the message names it, if known."""


def address(maker: str, kind: str, domain: int, topic: str) -> str:
    """Return the name of a socket of this computer, one for each robot that is commanded.

    ``kind`` is ``bridge`` or ``watchdog``, ``domain`` that of ROS, ``topic`` that of the commands,
    resolved.
    """
    return f'\0cpg_ros/{maker}/{kind}/{domain}{topic}'


def unconnected() -> socket.socket:
    """Return a non-blocking socket."""
    line = socket.socket(socket.AF_UNIX, socket.SOCK_SEQPACKET)
    line.setblocking(False)
    line.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, BUFFER_SIZE)
    return line


def listening(name: str) -> socket.socket:
    """Return a socket that listens under a name.

    Raises:
        NameTaken: it is in use.

    """
    line = unconnected()
    try:
        line.bind(name)
    except OSError as error:
        line.close()
        raise NameTaken(_holder(name)) from error
    line.listen(8)
    return line


def of_this_user(line: socket.socket) -> bool:
    """Return whether the process at the other end has the same user."""
    return _peer(line)[1] == os.geteuid()


def peer(line: socket.socket) -> str:
    """Return the process and user at the other end of a connection, for messages."""
    process, user = _peer(line)
    try:
        name = pwd.getpwuid(user).pw_name
    except KeyError:
        name = str(user)
    return f'process {process} of user {name}'


def _peer(line: socket.socket) -> tuple[int, int]:
    """Return process and user of the other end, as they were when it connected or listened."""
    credentials = line.getsockopt(socket.SOL_SOCKET, socket.SO_PEERCRED, _CREDENTIALS.size)
    return _CREDENTIALS.unpack(credentials)[:2]


def _holder(name: str) -> str:
    with unconnected() as line:
        try:
            line.connect(name)
        except OSError:
            return 'a program that accepts no connections'
        return peer(line)


# The names, topics and messages that a bridge and its watchdog share.

class RobotInterface:
    """Topics and messages of a robot; a bridge has a subclass, which is never instantiated.

    The watchdog is a process of its own, which imports the subclass's module by name: keep that
    module small.

    Attributes:
        maker: prefix of the names of the nodes ``..._bridge`` and ``..._watchdog``.
        command_topic: of the commands.
        state_topic: of the measured states.
        raw_states: whether ``RobotState.read`` takes the messages as bytes.

    """

    maker: ClassVar[str]
    command_topic: ClassVar[str]
    state_topic: ClassVar[str]
    raw_states: ClassVar[bool] = False

    @classmethod
    def bridge_name(cls) -> str:
        """Return the name of the bridge's node."""
        return f'{cls.maker}_bridge'

    @classmethod
    def watchdog_name(cls) -> str:
        """Return the name of the watchdog's node."""
        return f'{cls.maker}_watchdog'

    @classmethod
    def reference(cls) -> str:
        """Return the name by which ``pkgutil.resolve_name`` finds this class."""
        return f'{cls.__module__}:{cls.__name__}'

    @staticmethod
    def command_type() -> type:
        """Return the message type of commands."""
        raise NotImplementedError

    @staticmethod
    def state_type() -> type:
        """Return the message type of states."""
        raise NotImplementedError

    @staticmethod
    def make_command() -> JointCommand:
        """Return a command, to be filled and encoded."""
        raise NotImplementedError


# Monitoring of a process's ticks by its watchdog.

#: SILENT_PERIODS: number of periods after the last tick at which the bridge counts as silent: two
#: ticks are then overdue.
SILENT_PERIODS = 2.5


class TickMonitor:
    """Measures the time since the last tick, and decides when to damp the joints.

    Attributes:
        kd: gains for damping, N m s / rad, and ``echo`` of the command, as sent with the last
            tick.
        alarms: number of times that ticks were missing.
        ended: whether the process has announced its end, with the robot at rest.

    """

    def __init__(self, period: float, timeout: float) -> None:
        """Wait for the first tick of a process that ticks every ``period``, s.

        Damping begins ``timeout`` s, or at least 2.5 periods, after the last tick.
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
        """Process a message, now in s."""
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
            self._timeout, SILENT_PERIODS * self._period)
        return max(0.0, due - now)

    def due(self, now: float) -> bool:
        """Return whether to send a damping command now; the caller then sends it."""
        if self._last == np.inf or self.timeout(now):
            return False
        self.alarms += not self._missing
        self._missing, self._sent = True, now
        return True


#: READY_TIMEOUT: longest time for a watchdog to get ready, s, as it loads ROS.
READY_TIMEOUT = 20.0
#: HANG_TIMEOUT: time without reading after which a watchdog counts as hung, s.
HANG_TIMEOUT = 0.5
#: NAME_TAKEN: exit code of a watchdog whose name another program uses.
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

        It damps the robot ``timeout`` s after the last tick of a bridge that ticks every
        ``period``, s; ``topic`` is that of the commands, resolved.
        """
        self._address = address(interface.maker, 'watchdog', domain, topic)
        self._command = [sys.executable, '-P', '-m', 'cpg_ros.ros.bridges.watchdog',
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
            end = time.monotonic() + READY_TIMEOUT
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
            raise ForeignWatchdog(f'the watchdog of this robot is {who}, who is not the user '
                                  'of the bridge: end it')
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

    def tick(self, kd: np.ndarray, echo: np.ndarray, now: float) -> str:
        """Send a tick with the gains for damping, N m s / rad, if no other follows.

        ``echo`` is that of the command. Returns what is wrong with the watchdog, or ''; ``now`` is
        in s.
        """
        try:
            self._socket.send(TickMonitor.tick(np.append(kd, echo)))
        except BlockingIOError:
            self._read = min(self._read, now)
            return 'the watchdog hangs' if now - self._read > HANG_TIMEOUT else ''
        except OSError:
            return 'the watchdog is gone'
        self._read, self._ticked = now, True
        return ''

    def end(self) -> None:
        """End the watchdog of a robot at rest, and wait until it has ended.

        A watchdog that damps for an earlier bridge continues if this one never drove the robot.
        """
        if self._process is None and not self._ticked:
            return
        end = time.monotonic() + HANG_TIMEOUT
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
