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

"""A page without a browser: what the panel sends, and what a page may send it."""

from contextlib import ExitStack, suppress
import json
import re
import threading

from graph import EXECUTABLE, Process, until
from websockets.exceptions import ConnectionClosed
from websockets.sync.client import connect

PANEL = EXECUTABLE.with_name('panel')


def start_panel(domain, *ros_args, port='0'):
    """Start the panel on a free port; return the process and the address of its page."""
    process = Process('-p', f'port:={port}', *ros_args, domain=domain, executable=PANEL)
    process.wait_for('in a browser: http')
    return process, re.search(r'http://\S+', process.log)[0]


class Client:
    """An open page.

    Attributes:
        last: type of message -> the newest one.
        frames: how many have come.
        said: lines that were shown.

    """

    def __init__(self, address, **options):
        base, _, query = address.partition('?')
        self._open = ExitStack()
        self._socket = self._open.enter_context(connect(
            base.replace('http', 'ws', 1) + 'socket' + (f'?{query}' if query else ''),
            max_size=None, compression=None, **options))
        self.last, self.frames, self.said, self.frame = {}, 0, [], {}
        self.closed = ''
        threading.Thread(target=self._read, daemon=True).start()

    def _read(self):
        # However a connection ends, its code says it.
        with suppress(ConnectionClosed):
            for text in self._socket:
                self._take(json.loads(text))
        self.closed = str(self._socket.close_code)

    def _take(self, message):
        self.last[message['type']] = message
        if message['type'] == 'frame':
            self.frame.update(message)
            self.frames += 1
        elif message['type'] == 'said':
            self.said.append(message['text'])
        elif message['type'] == 'values':
            for one in self.last['controls']['controls']:
                one['value'] = message['values'].get(one['name'], one['value'])

    def send(self, **request):
        """Ask for something."""
        self._socket.send(json.dumps(request))

    def send_raw(self, data):
        """Send whatever."""
        self._socket.send(data)

    def value(self, name):
        """Return a parameter's value as the page has it, None before it has."""
        return next((one['value'] for one in self.last.get('controls', {}).get('controls', ())
                     if one['name'] == name), None)

    def ready(self):
        """Wait until everything has come."""
        until(lambda: {'controls', 'shape', 'names', 'gait'} <= set(self.last) and self.frames,
              'a whole page')
        return self

    def end(self):
        """Close the page."""
        self._open.close()
