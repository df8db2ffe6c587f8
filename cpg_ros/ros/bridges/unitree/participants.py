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

"""Which cyclonedds announces itself on a network: 11 crashes the 0.10 of Unitree's firmware.

Participants of DDS announce themselves by multicast (RTPS, section 8.5.3); those of cyclonedds
say their host and version. Who announced itself before one listened, and is silent since, is not
seen: cyclonedds does so every 30 s.
"""

import re
import socket
import struct

#: Vendor of RTPS packets that is Eclipse cyclonedds.
_VENDOR = b'\x01\x10'
#: Host, version and system: a string that a zero ends.
_VERSION = re.compile(rb'([\x20-\x7e]+)/(\d+)\.(\d+)\.\d+/\w+/\w+\0')
_GROUP = '239.255.0.1'
#: First version that the firmware does not bear.
HARMFUL = 11


def harmful(packet: bytes) -> str:
    """Return which participant an announcement is from that would crash the robot's, or ''."""
    if packet[:4] != b'RTPS' or packet[6:8] != _VENDOR:
        return ''
    for host, major, minor in _VERSION.findall(packet):
        if int(major) >= HARMFUL:
            return f'cyclonedds {int(major)}.{int(minor)} on {host.decode()}'
    return ''


class Announcements:
    """Receives the announcements of a domain; none where the socket cannot be opened."""

    def __init__(self, domain: int) -> None:
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._socket.setblocking(False)
        self._socket.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        try:
            self._socket.bind(('', 7400 + 250 * domain))
            for _, interface in socket.if_nameindex():
                self._join(interface)
        except OSError:
            self._socket.close()

    def _join(self, interface: str) -> None:
        index = socket.if_nametoindex(interface)
        group = struct.pack('4s4si', socket.inet_aton(_GROUP), bytes(4), index)
        try:
            self._socket.setsockopt(socket.IPPROTO_IP, socket.IP_ADD_MEMBERSHIP, group)
        except OSError:
            # An interface without multicast has no announcements.
            return

    def check(self) -> str:
        """Return which harmful participant has announced itself since the last call, or ''."""
        found = ''
        while self._socket.fileno() >= 0:
            try:
                found = harmful(self._socket.recv(65536)) or found
            except BlockingIOError:
                break
        return found

    def close(self) -> None:
        """Close the socket."""
        self._socket.close()
