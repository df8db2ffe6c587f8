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

"""The transport of a process that moves a robot: UDP alone, as shared memory can hold it up."""

import os
from pathlib import Path

from rclpy.utilities import get_rmw_implementation_identifier

#: With which transport a participant of Fast DDS speaks; the user's own choice goes first.
TRANSPORT = 'FASTDDS_BUILTIN_TRANSPORTS', 'UDPv4'
#: Discovery range of ROS 2, and its predecessor, which goes first.
RANGE, LOCAL_ONLY = 'ROS_AUTOMATIC_DISCOVERY_RANGE', 'ROS_LOCALHOST_ONLY'
#: Files with profiles of Fast DDS, by both names of the variable.
PROFILES = 'FASTDDS_DEFAULT_PROFILES_FILE', 'FASTRTPS_DEFAULT_PROFILES_FILE'
#: What a participant with the range LOCALHOST is, but without shared memory.
LOCALHOST = Path(__file__).with_name('localhost.xml')


def leave_shared_memory() -> None:
    """Make this process use UDP alone, also on this computer; call it before rclpy.init.

    A participant that joins the graph on the same computer has a port of shared memory, and the
    first to send there checks whether it is alive. If its listener is not waiting at that instant,
    Fast DDS sleeps for a third of healthy_check_timeout_ms, 333 ms, and keeps the lock that every
    publisher of the process needs: a robot would be without commands for that time.

    With the discovery range LOCALHOST the middleware of ROS adds shared memory itself. A profile
    of Fast DDS then restricts the process to the loopback interface in its place. A transport,
    profiles or static peers that the user has chosen stay.
    """
    environment = os.environ
    name, udp = TRANSPORT
    chosen = (environment.setdefault(name, udp) != udp
              or any(environment.get(one) for one in ('ROS_STATIC_PEERS', *PROFILES)))
    local = (environment.get(LOCAL_ONLY) == '1' or (
        LOCAL_ONLY not in environment and environment.get(RANGE) == 'LOCALHOST'))
    if local and not chosen and 'fastrtps' in get_rmw_implementation_identifier():
        environment.pop(LOCAL_ONLY, None)
        environment.update({RANGE: 'SYSTEM_DEFAULT', PROFILES[1]: str(LOCALHOST)})
