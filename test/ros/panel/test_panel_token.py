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

"""The token of the panel, from other machines: asked for, made, and in no log."""

import os
import pty
import re
import secrets
import subprocess
import threading
from urllib.error import HTTPError
from urllib.parse import urlsplit
from urllib.request import urlopen

import pytest

pytest.importorskip('websockets')

from graph import free_domain, until, Watcher  # noqa: E402, I100
from panel_client import Client, PANEL, start_panel  # noqa: E402
from rcl_interfaces.msg import Log  # noqa: E402
from rclpy.qos import DurabilityPolicy, QoSProfile  # noqa: E402
from websockets.exceptions import InvalidStatus  # noqa: E402


def status(address):
    """Return the status with which a request is refused."""
    with pytest.raises(HTTPError) as refused:
        urlopen(address, timeout=10)
    return refused.value.code


def test_it_asks_for_its_token():
    token = secrets.token_urlsafe(16)
    panel, address = start_panel(free_domain(), '-p', f'token:={token}', '-p', 'host:=0.0.0.0')
    try:
        here = f'http://127.0.0.1:{urlsplit(address).port}/'
        for query in ('', '?token=', f'?token={token[:-1]}', f'?token={token.swapcase()}'):
            with pytest.raises(InvalidStatus, match='403'):
                Client(here + query)
        assert status(here + 'bags/panel_1.zip') == 403
        # Whatever others guess from the same address, the holder of the token is let in.
        guesses = [threading.Thread(target=status, args=(f'{here}socket?token={token[k:]}',))
                   for k in range(1, 20)]
        for guess in guesses:
            guess.start()
        for _ in range(20):
            Client(f'{here}?token={token}').end()
        for guess in guesses:
            guess.join()
        assert token not in panel.log
    finally:
        panel.end()


def test_a_token_that_it_makes_is_shown_in_the_terminal_only(tmp_path):
    domain, rosout = free_domain(), []
    watcher = Watcher(domain)
    watcher.node.create_subscription(
        Log, '/rosout', lambda m: rosout.append(m.msg),
        QoSProfile(depth=100, durability=DurabilityPolicy.TRANSIENT_LOCAL))
    own, other = pty.openpty()
    panel = subprocess.Popen(
        [PANEL, '--ros-args', '-p', 'host:=0.0.0.0', '-p', 'port:=0', '-p', 'token:=auto'],
        env={**os.environ, 'ROS_DOMAIN_ID': str(domain), 'ROS_LOG_DIR': str(tmp_path)},
        stdin=subprocess.DEVNULL, stdout=other, stderr=other)
    os.close(other)
    text = b''
    try:
        while not (found := re.search(rb'(http://\S+)\?token=([\w-]{22,})', text)):
            text += os.read(own, 4096)
        port, token = urlsplit(found[1]).port, found[2].decode()
        until(lambda: any('in a browser' in line for line in rosout), 'the log on the graph')
        Client(f'http://127.0.0.1:{port}/?token={token}').end()
    finally:
        panel.terminate()
        panel.wait(30)
        os.close(own)
        watcher.end()
    assert not any(token in line for line in rosout)
    logs = [file.read_text() for file in tmp_path.rglob('*') if file.is_file()]
    assert any('in a browser' in log for log in logs) and not any(token in log for log in logs)
