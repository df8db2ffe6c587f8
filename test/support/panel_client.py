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

import asyncio
from contextlib import contextmanager, ExitStack, suppress
import json
import re
import threading
import time

from geometry_msgs.msg import Twist
from graph import EXECUTABLE, Process, until, Watcher
from websockets.exceptions import ConnectionClosed
from websockets.sync.client import connect

PANEL = EXECUTABLE.with_name('panel')


def start_panel(domain, *ros_args, port='0'):
    """Start the panel on a free port; return the process and the address of its page."""
    process = Process('-p', f'port:={port}', *ros_args, domain=domain, executable=PANEL)
    process.wait_for('in a browser: http')
    return process, re.search(r'http://\S+', process.log)[0]


@contextmanager
def steered_robot(*panel_args):
    """Yield a steered generator, a panel, its address, a watcher, and (when, speed, turn)s."""
    generator = Process('-p', 'robot:=unitree_go2', '-p', 'cmd_vel:=true', '-p', 'rate:=200.0',
                        '-p', 'transition:=0.3', '-p', 'ramp:=0.2')
    with ExitStack() as ending:
        ending.callback(generator.end)
        panel, address = start_panel(generator.domain, *panel_args)
        ending.callback(panel.end)
        generator.wait_for('publishing')
        watcher = Watcher(generator.domain)
        ending.callback(watcher.end)
        twists = []
        watcher.node.create_subscription(Twist, '/cmd_vel', lambda m: twists.append(
            (time.monotonic(), m.linear.x, m.angular.z)), 100)
        until(lambda: watcher.gaits and watcher.names, 'what the generator publishes')
        yield generator, panel, address, watcher, twists


def press(page, key='ArrowUp'):
    """Hold a key of a page in a browser; again where the page stood still, which lets go of it."""
    if not page.evaluate('panel.steering.held'):
        page.keyboard.up(key)
        page.keyboard.down(key)


class Client:
    """An open page, which sends the newest stamp with each request.

    Attributes:
        stamp: the newest, None before one has come.
        last: type of message -> the newest one.
        frames: how many have come.
        said: lines that were shown.

    """

    def __init__(self, address, **options):
        base, _, query = address.partition('?')
        self._open = ExitStack()
        self._socket = self._open.enter_context(connect(
            base.replace('http', 'ws', 1) + 'socket' + (f'?{query}' if query else ''),
            max_size=None, compression=None, close_timeout=1.0, **options))
        self.last, self.frames, self.said, self.frame = {}, 0, [], {}
        self.closed, self.stamp = '', None
        threading.Thread(target=self._read, daemon=True).start()

    def _read(self):
        # However a connection ends, its code says it.
        with suppress(ConnectionClosed):
            for text in self._socket:
                self._take(json.loads(text))
        self.closed = str(self._socket.close_code)

    def _take(self, message):
        self.stamp = message.pop('stamp', self.stamp)
        self.last[message['type']] = message
        if message['type'] == 'frame':
            self.frame.update(message)
            self.frames += 1
        elif message['type'] == 'notice':
            self.said.append(message['text'])
        elif message['type'] == 'values':
            for one in self.last['controls']['controls']:
                one['value'] = message['values'].get(one['name'], one['value'])

    def send(self, **request):
        """Ask for something."""
        stamp = {} if self.stamp is None else {'stamp': self.stamp}
        self._socket.send(json.dumps({**stamp, **request}))

    def steer(self, seconds, speed=1.0, turn=0.0):
        """Steer for some time, as a page does while a key is down."""
        for _ in range(round(seconds / 0.05)):
            self.send(do='steer', speed=speed, turn=turn)
            time.sleep(0.05)

    def lease(self, **wanted):
        """Wait until the lease is so."""
        until(lambda: wanted.items() <= self.last.get('lease', {}).items(), f'{wanted}')

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


class Delay:
    """A link that carries all that is sent some time later, either way."""

    def __init__(self, address, seconds):
        self._port, self._seconds = int(re.search(r':(\d+)/', address)[1]), seconds
        self._loop, ready = asyncio.new_event_loop(), threading.Event()
        self.address = ''
        self._thread = threading.Thread(target=self._run, args=(address, ready), daemon=True)
        self._thread.start()
        ready.wait()

    def _run(self, address, ready):
        async def serve():
            server = await asyncio.start_server(self._link, '127.0.0.1', 0)
            port = server.sockets[0].getsockname()[1]
            self.address = address.replace(f':{self._port}/', f':{port}/')
            ready.set()

        self._loop.run_until_complete(serve())
        self._loop.run_forever()
        links = asyncio.all_tasks(self._loop)
        for link in links:
            link.cancel()
        self._loop.run_until_complete(asyncio.gather(*links, return_exceptions=True))

    async def _link(self, reader, writer):
        other_reader, other_writer = await asyncio.open_connection('127.0.0.1', self._port)
        await asyncio.gather(self._carry(reader, other_writer), self._carry(other_reader, writer))

    async def _carry(self, reader, writer):
        with suppress(ConnectionError):
            while data := await reader.read(65536):
                self._loop.call_later(self._seconds, writer.write, data)
        self._loop.call_later(self._seconds, writer.close)

    def end(self):
        """Cut it."""
        self._loop.call_soon_threadsafe(self._loop.stop)
        self._thread.join()
