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

"""Services and parameters of other nodes, called from asyncio.

Responses are polled: nobody has to spin the calling node.
"""

import asyncio
from collections.abc import Callable, Iterable, Mapping, Sequence
import contextlib
from dataclasses import dataclass
import time
from typing import Any

from cpg_ros.common.errors import CpgError
from cpg_ros.ros.node.polled import PolledGroup
from rcl_interfaces.msg import ParameterDescriptor
from rcl_interfaces.srv import (
    DescribeParameters,
    GetParameters,
    ListParameters,
    SetParametersAtomically,
)
from rclpy.client import Client
from rclpy.exceptions import InvalidHandle
from rclpy.node import Node
from rclpy.parameter import Parameter, parameter_value_to_python

# The nodes and topics that a page can show or use, recognised by topics and services.

#: Topics and services of each kind of node: name below the node's own -> type.
GENERATOR_INTERFACES = {'phase': 'std_msgs/msg/Float64MultiArray', 'gait': 'std_msgs/msg/String',
             'enable': 'std_srvs/srv/SetBool'}
SIMULATION_INTERFACES = {'push': 'geometry_msgs/msg/Wrench', 'reset': 'std_srvs/srv/Trigger'}
INVERSION_INTERFACES = {'fit': 'std_srvs/srv/Trigger'}
BRIDGE_INTERFACES = {'state': 'std_msgs/msg/String', 'stop': 'std_srvs/srv/Trigger',
          'damp': 'std_srvs/srv/Trigger'}
#: Levels of /diagnostics, as pages name them.
LEVELS = {0: 'ok', 1: 'warn', 2: 'error', 3: 'stale'}


def level(status: Any) -> str:
    """Return the level of a diagnostic status as pages name it; rclpy has it as bytes."""
    number = status.level if isinstance(status.level, int) else ord(status.level)
    return LEVELS.get(number, 'stale')


@dataclass(frozen=True)
class Graph:
    """Full names of the nodes of each kind, sorted, and the type of each topic."""

    generators: tuple[str, ...] = ()
    simulations: tuple[str, ...] = ()
    inversions: tuple[str, ...] = ()
    bridges: tuple[str, ...] = ()
    topics: frozenset[tuple[str, str]] = frozenset()

    def beside(self, generator: str, kind: tuple[str, ...]) -> str:
        """Return the first of a kind in a generator's namespace, or ''."""
        space = namespace(generator)
        return next((name for name in kind if namespace(name) == space), '')


def namespace(node: str) -> str:
    """Return a node's namespace as a prefix of names: '' or '/robot'."""
    return node.rpartition('/')[0]


def discover(node: Node) -> Graph:
    """Return the graph as a node sees it."""
    topics = {(name, kind) for name, kinds in node.get_topic_names_and_types() for kind in kinds}
    services = {(name, kind) for name, kinds in node.get_service_names_and_types()
                for kind in kinds}
    names = topics | services

    def with_names(kinds: dict[str, str]) -> tuple[str, ...]:
        first = next(iter(kinds))
        owners: Iterable[str] = (name.removesuffix(f'/{first}') for name, kind in names
                                 if name.endswith(f'/{first}') and kind == kinds[first])
        return tuple(sorted(owner for owner in owners if owner and all(
            present(f'{owner}/{end}', kind) for end, kind in kinds.items())))

    def present(name: str, kind: str) -> bool:
        # The panel's own clients keep the name of a service on the graph.
        return (name, kind) in names and ('/srv/' not in kind or node.count_services(name) > 0)

    return Graph(with_names(GENERATOR_INTERFACES), with_names(SIMULATION_INTERFACES),
                 with_names(INVERSION_INTERFACES), with_names(BRIDGE_INTERFACES),
                 frozenset(topics))


#: TIMEOUT: longest time to find a service, and again for it to answer, s.
TIMEOUT = 5.0
#: NOTICE_DELAY: time without a service after which a line announces the wait, s.
NOTICE_DELAY = 1.0
#: POLL_PERIOD: period in which services and responses are checked, s.
POLL_PERIOD = 0.01


class CallError(CpgError):
    """A node refused or did not answer; one line for the user."""

    exit_code = 1


class NoService(CallError):
    """A service is not on the graph.

    Attributes:
        service: its name.

    """

    def __init__(self, service: str) -> None:
        super().__init__(f'there is no service {service}')
        self.service = service


class RequestRefused(CallError):
    """A node refused; the message is its reason."""


class ServiceClients:
    """Calls services through one node."""

    def __init__(self, node: Node, total: float | None = None, search: float = TIMEOUT,
                 late: Callable[[], None] | None = None) -> None:
        """Call through a node.

        Args:
            node: that has the clients.
            total: limit of all calls together, s.
            search: time limit for finding a service, s, without ``total``.
            late: called once if a service has not been found within ``NOTICE_DELAY``.

        """
        self._node, self._total, self._search, self._late = node, total, search, late
        self._end = None if total is None else time.monotonic() + total
        self._clients: dict[str, Client] = {}

    async def call(self, kind: Any, name: str, request: Any, timeout: float = TIMEOUT) -> Any:
        """Call a service and return its response; ``timeout`` is the time limit for it, s.

        Raises:
            NoService: the service is not there in time.
            CallError: it does not answer in time.

        """
        client = self.client(kind, name)
        try:
            await self._found(client, name)
            end = self._end or time.monotonic() + timeout
            answer = client.call_async(request)
            while not answer.done():
                if time.monotonic() > end:
                    client.remove_pending_request(answer)
                    raise CallError(f'{name} did not answer within {self._total or timeout:g} s')
                await asyncio.sleep(POLL_PERIOD)
                _receive_response(client)
        except InvalidHandle:  # it was forgotten meanwhile
            raise NoService(name) from None
        return answer.result()

    def client(self, kind: Any, name: str) -> Client:
        """Return the client of a service; created early, it is discovered before a call."""
        if name not in self._clients:
            self._clients[name] = self._node.create_client(kind, name,
                                                           callback_group=PolledGroup())
        return self._clients[name]

    async def _found(self, client: Client, name: str) -> None:
        began = time.monotonic()
        end = self._end or began + self._search
        while not client.service_is_ready():
            now = time.monotonic()
            if now > end:
                raise NoService(name)
            if self._late is not None and now > began + NOTICE_DELAY:
                self._late()
                self._late = None
            await asyncio.sleep(POLL_PERIOD)

    def forget(self, node: str) -> None:
        """Destroy the clients of a node's services."""
        for name in [name for name in self._clients if name.startswith(f'{node}/')]:
            self._node.destroy_client(self._clients.pop(name))


def _receive_response(client: Any) -> None:
    """Take a response, if one has arrived, for the call that waits for it."""
    with client.handle:
        header, response = client.handle.take_response(client.srv_type.Response)
    if header is not None:
        with contextlib.suppress(KeyError):  # it came too late
            client.get_pending_request(header.request_id.sequence_number).set_result(response)


class NodeClient:
    """Parameters and services of another node; its methods raise CallError."""

    def __init__(self, services: ServiceClients, name: str) -> None:
        self._services, self.name = services, name

    async def call(self, kind: Any, service: str, timeout: float = TIMEOUT, **fields: Any
                   ) -> Any:
        """Call a service below the node's name with a request's fields; return the response."""
        return await self._services.call(kind, f'{self.name}/{service}', kind.Request(**fields),
                                         timeout)

    async def command(self, kind: Any, service: str, timeout: float = TIMEOUT, **fields: Any
                      ) -> str:
        """Call a service of a type such as SetBool or Trigger; return the message.

        Raises:
            RequestRefused: success is false.

        """
        answer = await self.call(kind, service, timeout, **fields)
        if not answer.success:
            raise RequestRefused(answer.message or f'{self.name}/{service} refused')
        return str(answer.message)

    async def set_parameters(self, values: Mapping[str, Any], timeout: float = TIMEOUT) -> None:
        """Set parameters, all or none.

        Raises:
            RequestRefused: the node refuses.

        """
        answer = await self.call(SetParametersAtomically, 'set_parameters_atomically', timeout,
                                 parameters=[Parameter(name, value=value).to_parameter_msg()
                                             for name, value in values.items()])
        if not answer.result.successful:
            raise RequestRefused(answer.result.reason)

    async def parameters(self) -> list[str]:
        """Return the names of all parameters, sorted."""
        return sorted((await self.call(ListParameters, 'list_parameters')).result.names)

    async def descriptors(self, names: Sequence[str]) -> list[ParameterDescriptor]:
        """Return the descriptors of parameters."""
        return list((await self.call(DescribeParameters, 'describe_parameters', names=names)
                     ).descriptors)

    async def values(self, names: Sequence[str]) -> list[Any]:
        """Return the values of parameters, None for one that the node does not have."""
        values = (await self.call(GetParameters, 'get_parameters', names=names)).values
        return [parameter_value_to_python(value) for value in values] or [None] * len(names)
