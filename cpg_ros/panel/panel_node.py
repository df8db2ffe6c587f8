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

"""The node ``cpg_panel``: a page in the browser for every generator on the graph."""

import asyncio
import functools
from pathlib import Path
import socket
import sys
import threading
import traceback
from typing import Any

from cpg_ros.errors import CpgError
from cpg_ros.files.loopback import is_loopback
from cpg_ros.nodes.node_base import run, StartedNode, StartError
from cpg_ros.nodes.node_client import ServiceClients
from cpg_ros.nodes.parameter_spec import fixed, Spec
from cpg_ros.panel import requests
from cpg_ros.panel.access_control import AccessControl, token_for
from cpg_ros.panel.bridge_views import BridgeViews, STOPS
from cpg_ros.panel.graph import Graph, look
from cpg_ros.panel.pages import Page, Pages, SLOW
from cpg_ros.panel.recorder import Recorder
from cpg_ros.panel.request_handler import RequestHandler
from cpg_ros.panel.requests import RequestError
from cpg_ros.panel.robot_view import RobotView
from cpg_ros.panel.start_watch import StartWatch
from cpg_ros.panel.web_server import WebServer
from cpg_ros.robots.urdf import load_urdf
import rclpy
from rclpy.node import Node
from std_srvs.srv import Trigger

NAME = 'cpg_panel'
#: Frames per second, and interval of looking at the graph, s.
FRAMES, LOOK = 30.0, 0.5

SPECS = fixed({
    'host': Spec('127.0.0.1', 'address to listen on; an address that other machines can reach '
                 'needs a token'),
    'port': Spec(8080, 'port to listen on; 0 for any free one', 0, 65535),
    'token': Spec('', 'token required in the page address, as ?token=WORD, of at least 22 '
                  'characters; auto: make one, shown in the terminal; empty: none'),
    'urdf': Spec('', "URDF file with the robot's shape; if empty, robot_description, the "
                 "simulation's model if it is shipped, or a stick figure is used"),
    'max_speed': Spec(0.5, 'maximum speed of the steering pad [m/s]', 0.0, 5.0),
    'max_turn': Spec(0.6, 'maximum turning rate of the steering pad [rad/s]', 0.0, 5.0),
    'recordings': Spec('out/recordings', 'folder for recorded bags'),
    'recording_limit': Spec(200.0, 'size at which a recording stops [MB]', 1.0, 2000.0)})


class Panel(StartedNode):
    """Serves pages from one thread; the executor's thread only receives responses."""

    def __init__(self) -> None:
        """Declare the parameters, check them, and prepare to start.

        Raises:
            CpgError: a parameter cannot be used, or the address is not available.

        """
        super().__init__(NAME)
        self._declare(SPECS)
        self._token = token_for(self._value('host'), self._value('token'), sys.stderr.isatty())
        if urdf := self._value('urdf'):
            try:
                load_urdf(Path(urdf).expanduser())
            except CpgError as error:
                raise StartError(f'urdf: {error}') from error
        self._free()
        # Its messages are taken, without callbacks: it is never spun.
        self._watch: Node = rclpy.create_node(
            f'{self.get_name()}_watch', namespace=self.get_namespace(), enable_rosout=False,
            start_parameter_services=False, use_global_arguments=False)
        self._pages = Pages()
        self._calls = ServiceClients(self)
        self._views: dict[str, RobotView] = {}
        self._bridges = BridgeViews(self._watch, self._calls)
        self._graph, self._starting, self._starts = Graph(), '', StartWatch(self._watch)
        self._recorder = Recorder(
            self._watch, Path(self._value('recordings')).expanduser(),
            round(1e6 * self._value('recording_limit')),
            lambda why: self._pages.later(self._recorded, why))
        self._orders = RequestHandler(self._pages, self._calls, self._recorder, self._recorded)
        self._server = WebServer(AccessControl(self._token), self._pages, self._recorder.packed,
                                 self._come, self._on_request, self._gone)
        self.thread = threading.Thread(target=self._run, name='pages', daemon=True)
        self._warn_of_unknown()

    def _free(self) -> None:
        """Check that the address is available."""
        host, port = self._value('host'), self._value('port')
        try:
            family, *_, address = socket.getaddrinfo(host, port, type=socket.SOCK_STREAM)[0]
            socket.create_server(address, family=family).close()
        except OSError as error:
            raise StartError(f'{host} port {port}: {error.strerror} (another port: '
                             '-p port:=N, 0 for a free one)') from error

    # -- the thread -------------------------------------------------------------------------

    def begin(self) -> None:
        """Start to serve."""
        assert self.thread is not None
        self.thread.start()

    def _run(self) -> None:
        try:
            asyncio.run(self._serve())
        except Exception as error:
            self._fail(error)

    async def _serve(self) -> None:
        self._pages.begin()
        server, port = await self._server.start(self._value('host'), self._value('port'))
        host = self._value('host')
        shown = socket.gethostname() if host in ('0.0.0.0', '::') else host
        shown = f'[{shown}]' if ':' in shown else shown
        self.get_logger().info(f'watch and drive it in a browser: http://{shown}:{port}/'
                               + ' with ?token=WORD' * bool(self._token))
        if self._token and sys.stderr.isatty():
            # Not by the log, which is kept in files; and a terminal may be stopped.
            asyncio.get_running_loop().run_in_executor(None, functools.partial(
                print, f'http://{shown}:{port}/?token={self._token}', file=sys.stderr))
        if not is_loopback(host):
            self.get_logger().warning('anyone on this network who has the token can '
                                      'open the page, and nothing is encrypted')
        loop = asyncio.get_running_loop()
        due, looked = loop.time(), -LOOK
        while not self.stop.is_set():
            if due - looked >= LOOK:
                looked = due
                self._look()
            for view in self._views.values():
                view.teleop.beat(loop.time())
                if pages := self._pages.of(view.name):
                    view.news()
                    self._pages.frame(pages, view.frame(), loop.time())
            if message := self._bridges.news():
                self._pages.send(self._pages.everyone, message)
            self._lease_news()
            due = max(due + 1.0 / FRAMES, loop.time() - 1.0 / FRAMES)
            await asyncio.sleep(max(due - loop.time(), 0.0))
        for view in self._views.values():
            view.teleop.stop()
            view.teleop.beat(loop.time())
        self._recorder.stop()
        server.close()
        await server.wait_closed()

    def _look(self) -> None:
        graph = look(self)
        starting = self._starts.look(not graph.generators)
        if (graph, starting) != (self._graph, self._starting):
            self._graph, self._starting = graph, starting
            self._pages.send(self._pages.everyone, self._state())
        self._bridges.look(graph.bridges, bool(self._pages.everyone))
        for name in set(self._views) - set(graph.generators):
            self._views.pop(name).close()
        for name in graph.generators:
            if name not in self._views:
                self._views[name] = self._view(name)
            self._views[name].listen(graph, bool(self._pages.of(name)))
            self._views[name].ready()
            self._views[name].teleop.look()
        for page in self._pages.everyone:
            # A page never turns to another robot by itself, whoever steers that.
            if not page.node and (first := self._first()):
                self._choose(page, first)

    def _lease_news(self) -> None:
        """Send each page the state of its robot's lease, if that has changed."""
        for page in self._pages.everyone:
            if (view := self._views.get(page.node)) and page.lease(
                    message := view.teleop.state(page)):
                self._pages.send([page], message)

    def _view(self, name: str) -> RobotView:
        return RobotView(
            self, self._watch, self._calls, name,
            (self._value('max_speed'), self._value('max_turn')),
            lambda text: self._pages.notify(self._pages.of(name), text),
            lambda message: self._pages.send(self._pages.of(name), message))

    def finish(self) -> None:
        """Stop the robots that pages steer, the recording and the server."""
        if self.thread is not None:
            self.thread.join(timeout=3.0)

    # -- the pages --------------------------------------------------------------------------

    def _state(self) -> dict[str, Any]:
        graph, recorder = self._graph, self._recorder
        return {'type': 'state', 'generators': graph.generators,
                'starting': self._starting, 'beside': {
            name: {'simulation': graph.beside(name, graph.simulations),
                   'inversion': graph.beside(name, graph.inversions)}
            for name in graph.generators},
            'recording': recorder.running, 'bag': recorder.bag,
            'fastest': [self._value('max_speed'), self._value('max_turn')]}

    def _come(self, page: Page) -> None:
        self._pages.send([page], self._state())
        self._pages.send([page], self._bridges.message)
        if first := self._first():
            self._choose(page, first)

    def _first(self) -> str:
        """Return what a new page shows: the generator in the panel's namespace, '' for none.

        A panel without a namespace shows any.
        """
        own = self.get_namespace().rstrip('/')
        found = self._graph.beside(f'{own}/', self._graph.generators)
        return found or ('' if own else next(iter(self._graph.generators), ''))

    def _gone(self, page: Page) -> None:
        for view in self._views.values():
            view.teleop.release(page)

    def _choose(self, page: Page, name: str) -> None:
        view = self._views.get(name)
        if view is None:
            raise RequestError(f"there is no generator '{name}'")
        self._gone(page)
        page.node = name
        self._pages.send([page], {'type': 'chosen', 'node': name})
        if page.stop_only:
            return
        for message in view.messages():
            self._pages.send([page], message)
        view.listen(self._graph, wanted=True)

    async def _on_request(self, page: Page, text: str | bytes) -> None:
        try:
            request = requests.read(text)
            if request.action == 'choose':
                if page.waiting() > SLOW:
                    raise RequestError('the page has not yet processed what it was sent')
                self._choose(page, request.values['node'])
            elif request.action in STOPS:
                # Which needs neither the lease nor a generator.
                bridge = request.values['bridge']
                if bridge not in self._graph.bridges:
                    raise RequestError(f"there is no bridge '{bridge}'")
                await self._orders.command(page, bridge, Trigger, STOPS[request.action])
            elif page.node not in self._views:
                raise RequestError(f'{page.node} is gone' if page.node else
                                   'there is no generator on the graph')
            else:
                await self._orders.carry_out(page, self._views[page.node], request)
        except CpgError as error:
            self._pages.notify([page], str(error))
        except Exception:
            # One request must not end a node that others use.
            self.get_logger().error('a request failed:\n' + traceback.format_exc())

    def _recorded(self, why: str = '') -> None:
        """Report that a recording has begun or ended; ``why`` if it ended by itself."""
        if why:
            self._pages.notify(self._pages.open, why)
        self._pages.send(self._pages.everyone, self._state())


def main(args: list[str] | None = None) -> int:
    """Run the node until a signal ends it; return the exit code."""
    return run(Panel, NAME, 'Shows, drives and records what is on the graph in a browser.', SPECS,
               args, 'panel')


if __name__ == '__main__':
    sys.exit(main())
