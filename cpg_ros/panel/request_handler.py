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

"""Carries out the requests of pages."""

import asyncio
from collections.abc import Callable
from typing import Any

from cpg_ros.nodes.node_client import NodeClient, PATIENCE, ServiceClients
from cpg_ros.panel.graph import namespace
from cpg_ros.panel.lease import LeaseError
from cpg_ros.panel.pages import MOST, Page, Pages
from cpg_ros.panel.recorder import Recorder
from cpg_ros.panel.requests import Request, RequestError
from cpg_ros.panel.robot_view import RobotView
from std_srvs.srv import SetBool, Trigger

#: A fit may take this long, s.
FIT = 120.0
#: Requests that move the robot, apart from steering, may be this old on arrival, s.
LATE = 2.0
#: Requests that move the robot, apart from steering, and so take the lease.
MOVING = ('set', 'enable', 'push', 'reset', 'take_over')
#: Recorded whatever the generator's namespace.
EVERYWHERE = ('/diagnostics', '/tf', '/tf_static', '/clock')


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
            raise RequestError(f'{MOST} pages are open already: this one can only stop the '
                               'robot')
        if action in MOVING:
            self._acquire(page, view, request, now)
        if action == 'set':
            view.controls.set(values['name'], values['value'])
        elif action == 'steer':
            self._steer(page, view, request, now)
        elif action == 'release':
            teleop.release(page)
        elif action == 'enable':
            await self.command(page, view.name, SetBool, 'enable', data=True)
        elif action == 'push':
            await asyncio.to_thread(view.push, values['force'], values['direction'])
        elif action == 'record':
            await self._record(view, values['on'])
        elif action in ('reset', 'fit'):
            nodes, what = {'reset': (view.graph.simulations, 'simulated robot'),
                           'fit': (view.graph.inversions, 'inversion node')}[action]
            node = view.graph.beside(view.name, nodes)
            if not node:
                raise RequestError(f'there is no {what} for {view.name}')
            await self.command(page, node, Trigger, action, FIT)

    def _acquire(self, page: Page, view: RobotView, request: Request, now: float) -> None:
        """Give a page the lease, if its request is fresh and no other page has it."""
        if (age := now - _stamp(request)) > LATE:
            raise RequestError(f'{request.action} came up to {age:.1f} s late, and was '
                               f'ignored: the limit is {LATE:g} s')
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
                      patience: float = PATIENCE, **fields: Any) -> None:
        """Call a service of a node, and show the page the answer.

        Raises:
            CallError: the node refuses, or does not answer.

        """
        other = NodeClient(self._services, node)
        self._pages.notify([page], await other.command(kind, service, patience, **fields), 'told')

    async def _record(self, view: RobotView, on: bool) -> None:
        if on:
            space = namespace(view.name)
            bag = self._recorder.start(
                (topic, kind) for topic, kind in view.graph.topics
                if topic in EVERYWHERE or topic.startswith(f'{space}/'))
            self._pages.notify(self._pages.open, f'recording to {bag}', 'told')
        else:
            await asyncio.to_thread(self._recorder.stop)
        self._recorded()


def _stamp(request: Request) -> float:
    """Return the stamp of a request that must have one, s."""
    if request.stamp is None:
        raise RequestError(f'{request.action}: the newest stamp from the panel is missing')
    return request.stamp
