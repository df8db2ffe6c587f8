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
from collections.abc import Callable, Iterable
from contextlib import closing
import os
from pathlib import Path
import shutil
import socket
import threading
import time
import traceback
from typing import Any

from cpg_ros.common.errors import CpgError
from cpg_ros.common.files import is_loopback
from cpg_ros.fitting.recordings.bag_writer import BagError
from cpg_ros.motion.description import load_urdf
from cpg_ros.ros.bag_recorder import BagRecorder, POLL_PERIOD
from cpg_ros.ros.node.client import (
    discover,
    Graph,
    namespace,
    NodeClient,
    ServiceClients,
    TIMEOUT,
)
from cpg_ros.ros.node.console import aside
from cpg_ros.ros.node.health import HealthPublisher, START_STATUS
from cpg_ros.ros.node.node_base import run, StartedNode, StartError
from cpg_ros.ros.node.parameters import fixed, Spec
from cpg_ros.ros.panel import pages as requests
from cpg_ros.ros.panel.pages import MAX_PAGES, Page, Pages, Request, RequestError, SLOW_BACKLOG
from cpg_ros.ros.panel.robot_view import BridgeViews, HEALTH, RobotView, STOP_CALLS, Subscriptions
from cpg_ros.ros.panel.teleop import LeaseError
from cpg_ros.ros.panel.web_server import token_for, WebServer
from diagnostic_msgs.msg import DiagnosticStatus
import rclpy
from rclpy.node import Node
from std_srvs.srv import SetBool, Trigger

#: STATUS_TIMEOUT: time after its last status for which a node counts as starting, s.
STATUS_TIMEOUT = 4.0

# Records the topics of a robot into bags, one after another, in a thread of its own.

class Recorder:
    """Records one bag after another into a folder.

    Attributes:
        bag: name of the newest one, '' before the first.
        running: whether it is being recorded.

    """

    def __init__(self, node: Node, folder: Path, largest: int, ended: Callable[[str], object]
                 ) -> None:
        """Record into a folder; a bag ends at ``largest``, bytes.

        ``ended`` gets, in the recording thread, the reason why a recording ended by itself.
        ``node`` need not be spun.
        """
        self._node, self._folder, self._largest, self._ended = node, folder, largest, ended
        self._stop, self._packing = threading.Event(), threading.Lock()
        self._thread: threading.Thread | None = None
        self.bag = ''

    @property
    def running(self) -> bool:
        """Whether a bag is being recorded."""
        return self._thread is not None and self._thread.is_alive()

    def start(self, topics: Iterable[tuple[str, str]]) -> str:
        """Record topics, (name, type), to a new bag; return its name.

        Raises:
            BagError: another bag is being recorded, there is nothing to record, or the folder
                cannot be written to.

        """
        if self.running:
            raise BagError(f'{self.bag} is being recorded already')
        # Another panel may record to the same folder in the same second.
        bag = time.strftime(f'panel_%Y%m%d_%H%M%S_{os.getpid()}')
        try:
            self._folder.mkdir(parents=True, exist_ok=True)
            recorder = BagRecorder(self._node, self._folder / bag)
        except (BagError, OSError) as error:
            raise BagError(self._shown(error)) from error
        for name, kind in sorted(topics):
            recorder.subscribe(name, kind)
        if not recorder.counts:
            recorder.close()
            raise BagError('there are no topics to record')
        self._stop.clear()
        self.bag = bag
        self._thread = threading.Thread(target=self._record, args=(recorder,), name='recorder',
                                        daemon=True)
        self._thread.start()
        return bag

    def _record(self, recorder: BagRecorder) -> None:
        why = ''
        try:
            with closing(recorder):
                while not self._stop.wait(POLL_PERIOD):
                    recorder.poll()
                    if recorder.size > self._largest:
                        why = f'{self.bag} is full ({recorder.size / 1e6:.0f} MB)'
                        break
        except BagError as error:
            why = why or self._shown(error)
        if why:
            self._ended(why)

    def stop(self) -> None:
        """End the recording, if there is one."""
        self._stop.set()
        if self._thread is not None:
            self._thread.join(timeout=5.0)

    def packed(self, bag: str) -> bytes:
        """Return a recording that has ended as a zip archive.

        Raises:
            BagError: there is no such recording, it has not ended, or the disk is full or broken.

        """
        path = self._folder / bag
        # Only what this recorder makes: no name leads out of the folder.
        if not bag.startswith('panel_') or not bag[6:].replace('_', '').isdigit():
            raise BagError('this is not a recording')
        if self.running and bag == self.bag:
            raise BagError(f'{bag} is still being recorded')
        if not path.is_dir():
            raise BagError(f'there is no recording {bag}')
        archive = self._folder / f'{bag}.zip'
        try:
            # Several pages may download it at once.
            with self._packing:
                if not archive.is_file():
                    part = shutil.make_archive(str(archive.with_suffix('.part')), 'zip',
                                               self._folder, bag)
                    Path(part).replace(archive)
            return archive.read_bytes()
        except OSError as error:
            raise BagError(self._shown(error)) from error

    def _shown(self, error: Exception) -> str:
        """Log an error, and return it for pages, without the folder."""
        self._node.get_logger().warning(str(error))
        text = (f'{Path(error.filename or self._folder).name}: {error.strerror}'
                if isinstance(error, OSError) else str(error))
        return text.replace(f'{self._folder}/', '')


# Carries out the requests of pages.

#: Of a fit, s.
FIT_TIMEOUT = 120.0
#: MAX_REQUEST_AGE: largest age on arrival, s, of requests in MOTION_REQUESTS.
MAX_REQUEST_AGE = 2.0
#: Requests, other than steering, that move the robot and therefore take the lease.
MOTION_REQUESTS = ('set', 'enable', 'seat', 'push', 'reset', 'take_over')
#: GLOBAL_TOPICS: topics that are recorded for a generator in any namespace.
GLOBAL_TOPICS = ('/diagnostics', '/tf', '/tf_static', '/clock')


class RequestHandler:
    """Carries out requests on the robot of a page, or on the recording."""

    def __init__(self, pages: Pages, services: ServiceClients, recorder: Recorder,
                 recorded: Callable[[], None]) -> None:
        """Prepare; ``recorded`` is called when a recording has begun or ended."""
        self._pages, self._services, self._recorder = pages, services, recorder
        self._recorded = recorded

    async def carry_out(self, page: Page, view: RobotView, request: Request) -> None:
        """Carry out a request of a page on the generator that it shows.

        Raises:
            CpgError: it is rejected; the message is the reason.

        """
        values, action = request.values, request.action
        now, teleop = asyncio.get_running_loop().time(), view.teleop
        if request.stamp is not None:
            if request.stamp > now:
                raise RequestError(f'{action}: stamp is not one that the panel has sent')
            page.round_trip = now - request.stamp
        teleop.lease.renew(page, now)
        if action == 'stop' or (action == 'enable' and not values['on']):
            teleop.stop()
            await self.command(page, view.name, SetBool, 'enable', data=False)
            return
        if page.stop_only and action != 'alive':
            raise RequestError(f'{MAX_PAGES} pages are open already: this one can only stop the '
                               'robot')
        if action in MOTION_REQUESTS:
            self._acquire(page, view, request, now)
        if action == 'set':
            view.controls.set(values['name'], values['value'])
        elif action == 'steer':
            self._steer(page, view, request, now)
        elif action == 'release':
            teleop.release(page)
        elif action == 'enable':
            await self.command(page, view.name, SetBool, 'enable', data=True)
        elif action == 'seat':
            await self.command(page, view.name, Trigger, 'sit' if values['on'] else 'stand')
        elif action == 'push':
            await asyncio.to_thread(view.push, values['force'], values['direction'])
        elif action == 'record':
            await self._record(view, values['on'])
        elif action == 'reset':
            await self.command(page, view.simulation(), Trigger, action, FIT_TIMEOUT)
        elif action == 'fit':
            node = view.graph.beside(view.name, view.graph.inversions)
            if not node:
                raise RequestError(f'there is no inversion node for {view.name}')
            await self.command(page, node, Trigger, action, FIT_TIMEOUT)

    def _acquire(self, page: Page, view: RobotView, request: Request, now: float) -> None:
        """Give a page the lease, if its request is fresh and no other page has it."""
        if (age := now - _stamp(request)) > MAX_REQUEST_AGE:
            raise RequestError(f'{request.action} came up to {age:.1f} s late, and was '
                               f'ignored: the limit is {MAX_REQUEST_AGE:g} s')
        if request.action != 'take_over':
            view.teleop.acquire(page, now)
        elif lost := view.teleop.take_over(page, now):
            self._pages.notify([lost],
                               f'{page} has taken over; this page no longer moves the robot')

    def _steer(self, page: Page, view: RobotView, request: Request, now: float) -> None:
        """Steer; report a rejection once, unless the page knows that it lost the lease."""
        if view.controls.value('cmd_vel') is not True:
            raise RequestError(f'{view.name} ignores cmd_vel; start it with cmd_vel:=true to '
                               f'steer')
        try:
            view.teleop.steer(page, _stamp(request), now, request.values['speed'],
                              request.values['turn'])
            page.refused = ''
        except LeaseError as error:
            if not page.lost_to and str(error) != page.refused:
                page.refused = str(error)
                raise

    async def command(self, page: Page, node: str, kind: Any, service: str,
                      timeout: float = TIMEOUT, **fields: Any) -> None:
        """Call a service of a node, and show the page the answer.

        Raises:
            CallError: the node refuses, or does not answer.

        """
        other = NodeClient(self._services, node)
        self._pages.notify([page], await other.command(kind, service, timeout, **fields), 'info')

    async def _record(self, view: RobotView, on: bool) -> None:
        if on:
            space = namespace(view.name)
            bag = self._recorder.start(
                (topic, kind) for topic, kind in view.graph.topics
                if topic in GLOBAL_TOPICS or topic.startswith(f'{space}/'))
            self._pages.notify(self._pages.open, f'recording to {bag}', 'info')
        else:
            await asyncio.to_thread(self._recorder.stop)
        self._recorded()


def _stamp(request: Request) -> float:
    """Return the stamp of a request that must have one, s."""
    if request.stamp is None:
        raise RequestError(f'{request.action}: the newest stamp from the panel is missing')
    return request.stamp


NAME = 'cpg_panel'
#: FRAME_RATE: of pages, Hz; SEARCH_PERIOD: in which the graph is searched, s.
FRAME_RATE, SEARCH_PERIOD = 30.0, 0.5

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
        self._token = token_for(self._value('host'), self._value('token'), aside().isatty())
        if urdf := self._value('urdf'):
            try:
                load_urdf(Path(urdf).expanduser())
            except CpgError as error:
                raise StartError(f'urdf: {error}') from error
        self._socket, self._port = self._bound()
        # Its messages are taken, without callbacks: it is never spun.
        self._watch: Node = rclpy.create_node(
            f'{self.get_name()}_watch', namespace=self.get_namespace(), enable_rosout=False,
            start_parameter_services=False, use_global_arguments=False)
        self._pages = Pages()
        self._loop: asyncio.AbstractEventLoop
        self._calls = ServiceClients(self)
        self._views: dict[str, RobotView] = {}
        self._bridges = BridgeViews(self._watch, self._calls)
        self._graph, self._starting, self._start = Graph(), '', ('', 0.0)
        self._health = Subscriptions(self._watch)
        self._recorder = Recorder(
            self._watch, Path(self._value('recordings')).expanduser(),
            round(1e6 * self._value('recording_limit')),
            lambda why: self._loop.call_soon_threadsafe(self._recorded, why))
        self._handler = RequestHandler(self._pages, self._calls, self._recorder, self._recorded)
        self._server = WebServer(self._token, self._pages, self._recorder.packed,
                                 self._come, self._on_request, self._gone)
        self.thread = threading.Thread(target=self._run, name='pages', daemon=True)
        self._own_health = HealthPublisher(self, 'pages', '', lambda: (
            DiagnosticStatus.OK, 'serving', {'open pages': len(self._pages.everyone),
                                             'recording': self._recorder.running}))
        self._warn_of_unknown()

    def _bound(self) -> tuple[socket.socket, int]:
        """Return a socket at the address, and its port."""
        host, port = self._value('host'), self._value('port')
        try:
            family, *_, address = socket.getaddrinfo(host, port, type=socket.SOCK_STREAM)[0]
            bound = socket.create_server(address, family=family)
        except OSError as error:
            raise StartError(f'{host} port {port}: {error.strerror} (another port: '
                             '-p port:=N, 0 for a free one)') from error
        return bound, bound.getsockname()[1]

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
        self._loop = asyncio.get_running_loop()
        server = await self._server.start(self._socket)
        host, port = self._value('host'), self._port
        address = socket.gethostname() if host in ('0.0.0.0', '::') else host
        address = f'[{address}]' if ':' in address else address
        self.get_logger().info(f'watch and drive it in a browser: http://{address}:{port}/'
                               + ' with ?token=WORD' * bool(self._token))
        if self._token and aside().isatty():
            # The log is kept in files.
            print(f'http://{address}:{port}/?token={self._token}', file=aside())
        if not is_loopback(host):
            self.get_logger().warning('anyone on this network who has the token can '
                                      'open the page, and nothing is encrypted')
        loop = asyncio.get_running_loop()
        due, updated = loop.time(), -SEARCH_PERIOD
        while not self.stop.is_set():
            if due - updated >= SEARCH_PERIOD:
                updated = due
                self._update()
            statuses = [status for message in self._health.receive('/diagnostics')
                        for status in message.status]
            self._note_starts(statuses)
            for view in self._views.values():
                view.teleop.beat(loop.time())
                if pages := self._pages.of(view.name):
                    view.news(statuses)
                    self._pages.frame(pages, view.frame(), loop.time())
            if message := self._bridges.news(statuses):
                self._pages.send(self._pages.everyone, message)
            self._lease_news()
            due = max(due + 1.0 / FRAME_RATE, loop.time() - 1.0 / FRAME_RATE)
            await asyncio.sleep(max(due - loop.time(), 0.0))
        for view in self._views.values():
            view.teleop.stop()
            view.teleop.beat(loop.time())
        self._recorder.stop()
        server.close()
        await server.wait_closed()

    def _update(self) -> None:
        graph, (text, when) = discover(self), self._start
        recent = time.monotonic() < when + STATUS_TIMEOUT
        starting = text if not graph.generators and recent else ''
        self._health.subscribe_to(HEALTH if self._pages.everyone or not graph.generators else {})
        if (graph, starting) != (self._graph, self._starting):
            self._graph, self._starting = graph, starting
            self._pages.send(self._pages.everyone, self._state())
        self._bridges.update(graph.bridges, bool(self._pages.everyone))
        for name in set(self._views) - set(graph.generators):
            self._views.pop(name).close()
        for name in graph.generators:
            if name not in self._views:
                self._views[name] = self._view(name)
            self._views[name].listen(graph, bool(self._pages.of(name)))
            self._views[name].ready()
            self._views[name].teleop.update()
        for page in self._pages.everyone:
            # A page never changes to another robot by itself.
            if not page.node and (first := self._first()):
                self._choose(page, first)

    def _note_starts(self, statuses: Iterable[DiagnosticStatus]) -> None:
        """Record the progress of a node that is still starting."""
        for status in statuses:
            node, _, part = status.name.partition(': ')
            if part == START_STATUS:
                self._start = f'{node} is starting: {status.message}', time.monotonic()

    def _lease_news(self) -> None:
        """Send each page the state of its robot's lease, if that has changed."""
        for page in self._pages.everyone:
            if (view := self._views.get(page.node)) and page.lease(
                    message := {**view.teleop.state(page),
                                'pages': len(self._pages.everyone)}):
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
        """Return the generator for a new page: the one in the panel's namespace, or ''.

        A panel without a namespace shows any.
        """
        own = self.get_namespace().rstrip('/')
        name = self._graph.beside(f'{own}/', self._graph.generators)
        return name or ('' if own else next(iter(self._graph.generators), ''))

    def _gone(self, page: Page) -> None:
        for view in self._views.values():
            view.teleop.release(page)

    def _choose(self, page: Page, name: str) -> None:
        view = self._views.get(name)
        if view is None:
            raise RequestError(f"there is no generator '{name}'")
        self._gone(page)
        page.node = name
        self._pages.send([page], {'type': 'selected', 'node': name})
        if page.stop_only:
            return
        for message in view.messages():
            self._pages.send([page], message)
        view.listen(self._graph, listening=True)

    async def _on_request(self, page: Page, text: str | bytes) -> None:
        try:
            request = requests.read(text)
            if request.action == 'choose':
                if page.waiting() > SLOW_BACKLOG:
                    raise RequestError('the page has not yet processed what it was sent')
                self._choose(page, request.values['node'])
            elif request.action in STOP_CALLS:
                # Which needs neither the lease nor a generator.
                bridge = request.values['bridge']
                if bridge not in self._graph.bridges:
                    raise RequestError(f"there is no bridge '{bridge}'")
                await self._handler.command(page, bridge, Trigger, STOP_CALLS[request.action])
            elif page.node not in self._views:
                raise RequestError(f'{page.node} is gone' if page.node else
                                   'there is no generator on the graph')
            else:
                await self._handler.carry_out(page, self._views[page.node], request)
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
