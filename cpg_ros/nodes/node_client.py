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

Responses are polled: nothing need spin the node that calls, and an executor that does leaves them.
"""

import asyncio
from collections.abc import Mapping, Sequence
import contextlib
import time
from typing import Any

from cpg_ros.errors import CpgError
from cpg_ros.nodes.polled_group import PolledGroup
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

#: How long a service may take to be found, and a node to answer, s.
PATIENCE = 5.0
#: How often it is seen whether a service is there or has answered, s.
POLL = 0.01


class CallError(CpgError):
    """A node refused, or did not answer; one line for the user."""

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

    def __init__(self, node: Node, total: float | None = None) -> None:
        """Call through a node; all calls together may take a total time, s, if there is one."""
        self._node, self._total = node, total
        self._end = None if total is None else time.monotonic() + total
        self._clients: dict[str, Client] = {}

    async def call(self, kind: Any, name: str, request: Any, patience: float = PATIENCE) -> Any:
        """Call a service and return its response, which may take so long, s.

        Raises:
            NoService: it is not there in time.
            CallError: it does not answer in time.

        """
        if name not in self._clients:
            self._clients[name] = self._node.create_client(kind, name,
                                                           callback_group=PolledGroup())
        client = self._clients[name]
        try:
            end = self._end or time.monotonic() + min(patience, PATIENCE)
            while not client.service_is_ready():
                if time.monotonic() > end:
                    raise NoService(name)
                await asyncio.sleep(POLL)
            end = self._end or time.monotonic() + patience
            answer = client.call_async(request)
            while not answer.done():
                if time.monotonic() > end:
                    client.remove_pending_request(answer)
                    raise CallError(f'{name} did not answer within {self._total or patience:g} s')
                await asyncio.sleep(POLL)
                _take_response(client)
        except InvalidHandle:  # it was forgotten meanwhile
            raise NoService(name) from None
        return answer.result()

    def forget(self, node: str) -> None:
        """Let go of a node's services."""
        for name in [name for name in self._clients if name.startswith(f'{node}/')]:
            self._node.destroy_client(self._clients.pop(name))


def _take_response(client: Any) -> None:
    """Take a response, if one has come, for the call that waits for it."""
    with client.handle:
        header, response = client.handle.take_response(client.srv_type.Response)
    if header is not None:
        with contextlib.suppress(KeyError):  # it came too late
            client.get_pending_request(header.request_id.sequence_number).set_result(response)


class NodeClient:
    """Parameters and services of another node; its methods raise CallError."""

    def __init__(self, services: ServiceClients, name: str) -> None:
        self._services, self.name = services, name

    async def call(self, kind: Any, service: str, patience: float = PATIENCE, **fields: Any
                   ) -> Any:
        """Call a service below the node's name with a request's fields; return the response."""
        return await self._services.call(kind, f'{self.name}/{service}', kind.Request(**fields),
                                         patience)

    async def command(self, kind: Any, service: str, patience: float = PATIENCE, **fields: Any
                      ) -> str:
        """Call a service of a type such as SetBool or Trigger; return the message.

        Raises:
            RequestRefused: it was not successful.

        """
        answer = await self.call(kind, service, patience, **fields)
        if not answer.success:
            raise RequestRefused(answer.message or f'{self.name}/{service} refused')
        return str(answer.message)

    async def set_parameters(self, values: Mapping[str, Any], patience: float = PATIENCE) -> None:
        """Set parameters, all or none.

        Raises:
            RequestRefused: the node refuses.

        """
        answer = await self.call(SetParametersAtomically, 'set_parameters_atomically', patience,
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
        found = (await self.call(GetParameters, 'get_parameters', names=names)).values
        return [parameter_value_to_python(one) for one in found] or [None] * len(names)
