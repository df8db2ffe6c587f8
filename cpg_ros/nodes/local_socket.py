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

"""Connections between processes of one user on this computer, one name for each robot.

Sockets of the kind SOCK_SEQPACKET keep messages apart, and the kernel reports which user is at
the other end of one (SO_PEERCRED, see unix(7)). Anyone on the computer may take a name or connect
to it, but nobody can pretend to be another user.
"""

import os
import pwd
import socket
import struct

from cpg_ros.errors import CpgError

#: Connections that wait to be accepted.
WAITING = 8
#: Bytes in transit; few, so that a process that does not read is soon noticed.
BUFFER = 4096
#: The kernel's struct ucred: process, user, group.
_CREDENTIALS = struct.Struct('3i')


class NameTaken(CpgError):
    """Another program has the name; the message says which, where that can be known."""


def address(maker: str, kind: str, domain: int, topic: str) -> str:
    """Return the name of a socket on this computer, one for each robot that is commanded.

    Args:
        maker: as ``RobotInterface.maker``.
        kind: ``bridge`` or ``watchdog``.
        domain: of ROS.
        topic: of the commands, resolved.

    """
    return f'\0cpg_ros/{maker}/{kind}/{domain}{topic}'


def unconnected() -> socket.socket:
    """Return a non-blocking socket."""
    line = socket.socket(socket.AF_UNIX, socket.SOCK_SEQPACKET)
    line.setblocking(False)
    line.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, BUFFER)
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
    line.listen(WAITING)
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
    found = line.getsockopt(socket.SOL_SOCKET, socket.SO_PEERCRED, _CREDENTIALS.size)
    return _CREDENTIALS.unpack(found)[:2]


def _holder(name: str) -> str:
    with unconnected() as line:
        try:
            line.connect(name)
        except OSError:
            return 'a program that takes no connections'
        return peer(line)
