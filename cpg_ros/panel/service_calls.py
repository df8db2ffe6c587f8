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

"""Services of other nodes, called from asyncio."""

import asyncio
from typing import Any

from cpg_ros.errors import CpgError
from rclpy.node import Node

#: How long a node may take to answer, s.
PATIENCE = 5.0


class CallError(CpgError):
    """A node did not answer; one line for whoever asked."""


class Services:
    """Calls services through a node that is spun in another thread."""

    def __init__(self, node: Node) -> None:
        self._node = node
        self._clients: dict[str, Any] = {}

    async def call(self, kind: Any, name: str, request: Any, patience: float = PATIENCE) -> Any:
        """Call a service and return its response, which may take so long, s.

        Raises:
            CallError: nobody answers in time.

        """
        if name not in self._clients:
            self._clients[name] = self._node.create_client(kind, name)
        client, loop = self._clients[name], asyncio.get_running_loop()
        end = loop.time() + PATIENCE
        while not client.service_is_ready():
            if loop.time() > end:
                raise CallError(f'there is no service {name}')
            await asyncio.sleep(0.02)
        answered = asyncio.Event()
        future = client.call_async(request)
        future.add_done_callback(lambda _: loop.call_soon_threadsafe(answered.set))
        try:
            await asyncio.wait_for(answered.wait(), patience)
        except asyncio.TimeoutError:
            client.remove_pending_request(future)
            raise CallError(f'{name} did not answer within {patience:g} s') from None
        return future.result()

    def forget(self, node: str) -> None:
        """Let go of a node's services."""
        for name in [name for name in self._clients if name.startswith(f'{node}/')]:
            self._node.destroy_client(self._clients.pop(name))
