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

"""Which transports a generator uses: read from its memory maps and its sockets."""

import os
from pathlib import Path
import subprocess
import sys

from graph import Process
import pytest

NAMES = ('FASTDDS_BUILTIN_TRANSPORTS', 'FASTDDS_DEFAULT_PROFILES_FILE',
         'FASTRTPS_DEFAULT_PROFILES_FILE', 'ROS_LOCALHOST_ONLY', 'ROS_STATIC_PEERS')
LOOPBACK = '127.0.0.1'
#: A node of anyone, which waits for a message.
LISTENER = """
import rclpy
from rclpy.wait_for_message import wait_for_message
from sensor_msgs.msg import JointState
rclpy.init()
found, message = wait_for_message(JointState, rclpy.create_node('anyone'), 'joint_states',
                                  time_to_wait=30.0)
print(found and len(message.name))
"""


def started(monkeypatch, environment):
    """Start a generator by what a user has chosen, and nothing else."""
    for name in NAMES:
        monkeypatch.delenv(name, raising=False)
    return Process(environment=environment).wait_for('publishing')


def addresses(pid):
    """IPv4 addresses to which the UDP sockets of a process are bound."""
    sockets = {str(link.readlink()).partition('[')[2].rstrip(']')
               for link in Path(f'/proc/{pid}/fd').iterdir() if link.is_symlink()}
    rows = [line.split() for line in Path('/proc/net/udp').read_text().splitlines()[1:]]
    return {'.'.join(str(byte) for byte in reversed(bytes.fromhex(row[1][:8])))
            for row in rows if row[9] in sockets}


@pytest.mark.parametrize(('environment', 'shared'), [
    ({'ROS_AUTOMATIC_DISCOVERY_RANGE': 'SUBNET'}, False),
    ({'ROS_AUTOMATIC_DISCOVERY_RANGE': 'SUBNET', 'FASTDDS_BUILTIN_TRANSPORTS': 'DEFAULT'}, True),
    ({'ROS_AUTOMATIC_DISCOVERY_RANGE': 'LOCALHOST'}, False),
    ({'ROS_LOCALHOST_ONLY': '1'}, False)], ids=('subnet', 'chosen', 'localhost', 'local_only'))
def test_nobody_who_joins_can_make_it_wait_for_shared_memory(monkeypatch, environment, shared):
    # A participant that joins while its listener is busy holds up all that send to it by shared
    # memory for 333 ms; the user's own choice goes first.
    process = started(monkeypatch, environment)
    try:
        heard = subprocess.run([sys.executable, '-c', LISTENER], capture_output=True, text=True,
                               env={**os.environ, 'ROS_DOMAIN_ID': str(process.domain),
                                    **environment})
        assert heard.stdout == '12\n', heard.stderr
        assert ('/fastrtps_' in Path(f'/proc/{process.pid}/maps').read_text()) == shared
        assert (addresses(process.pid) == {LOOPBACK}) == ('SUBNET' not in environment.values())
    finally:
        process.end()


def test_profiles_of_the_user_stay(monkeypatch, tmp_path):
    profiles = tmp_path / 'profiles.xml'
    profiles.write_text('<?xml version="1.0"?><dds/>')
    process = started(monkeypatch, {'ROS_AUTOMATIC_DISCOVERY_RANGE': 'LOCALHOST',
                                    'FASTRTPS_DEFAULT_PROFILES_FILE': str(profiles)})
    try:
        assert addresses(process.pid) != {LOOPBACK}
    finally:
        process.end()
