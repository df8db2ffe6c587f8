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

"""What another user's process does on the computer of a bridge.

usage, as root: unitree_stranger.py feed|take NAME

It becomes the user nobody, and speaks both kinds of sockets that keep messages apart.
"""

import contextlib
import os
import socket
import struct
import sys
import time

SEQPACKET, DATAGRAM = socket.SOCK_SEQPACKET, socket.SOCK_DGRAM
NOBODY = 65534
#: As a bridge that lives says it, with a damping of zero.
TICK = struct.pack('<12f', *[0.0] * 12)


def feed(name):
    """Send ticks to whoever has a name, at a kilohertz, for ever."""
    packets, datagrams = (socket.socket(socket.AF_UNIX, kind) for kind in (SEQPACKET, DATAGRAM))
    datagrams.setblocking(False)
    while True:
        with contextlib.suppress(OSError):
            datagrams.sendto(TICK, name)
        try:
            packets.send(TICK)
        except OSError:
            packets.close()
            packets = socket.socket(socket.AF_UNIX, SEQPACKET)
            packets.setblocking(False)
            with contextlib.suppress(OSError):
                packets.connect(name)
                packets.send(TICK)
        time.sleep(0.001)


def take(name):
    """Have a name, and take all that is sent there, for ever."""
    lines = [socket.socket(socket.AF_UNIX, kind) for kind in (SEQPACKET, DATAGRAM)]
    for line in lines:
        line.bind(name)
    lines[0].listen(8)
    print('taken', flush=True)
    while True:
        lines[1].recv(1024)


if __name__ == '__main__':
    os.setgroups([])
    os.setgid(NOBODY)
    os.setuid(NOBODY)
    if sys.argv[1] == 'feed':
        print('feeding', flush=True)
        feed('\0' + sys.argv[2])
    else:
        take('\0' + sys.argv[2])
