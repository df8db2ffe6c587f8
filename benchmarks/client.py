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

"""A client of a node's parameter services that measures how long the answers take."""

import time

from rcl_interfaces.msg import Parameter, ParameterType, ParameterValue, SetParametersResult
from rcl_interfaces.srv import (
    GetParameters,
    ListParameters,
    SetParameters,
    SetParametersAtomically,
)
import rclpy
from rclpy.executors import SingleThreadedExecutor
from rclpy.parameter import parameter_value_to_python

SERVICES = {'get_parameters': GetParameters, 'list_parameters': ListParameters,
            'set_parameters': SetParameters, 'set_parameters_atomically': SetParametersAtomically}


class NoAnswer(RuntimeError):
    """The node has not answered a request."""


class ParameterClient:
    """Calls the parameter services of one node; rclpy must be initialised.

    Attributes:
        answer_ms: service -> how long each of its answers took, ms.

    """

    def __init__(self, node_name: str = 'cpg_generator', timeout: float = 10.0) -> None:
        self.node = rclpy.create_node('parameter_client')
        self.answer_ms: dict[str, list[float]] = {name: [] for name in SERVICES}
        self._timeout = timeout
        self._executor = SingleThreadedExecutor()
        self._executor.add_node(self.node)
        self._clients = {name: self.node.create_client(kind, f'{node_name}/{name}')
                         for name, kind in SERVICES.items()}
        for name, client in self._clients.items():
            if not client.wait_for_service(timeout):
                raise NoAnswer(f'there is no service {name}')

    def call(self, service: str, request: object) -> object:
        """Call a service and wait for its answer.

        Raises:
            NoAnswer: it took too long.

        """
        began = time.perf_counter()
        future = self._clients[service].call_async(request)
        # Not spin_until_future_complete: in rclpy 7.1 each call of it slows down all later ones.
        while not future.done():
            self._executor.spin_once(timeout_sec=0.1)
            if time.perf_counter() > began + self._timeout:
                raise NoAnswer(f'{service} has not answered within {self._timeout} s')
        self.answer_ms[service].append(1e3 * (time.perf_counter() - began))
        return future.result()

    def names(self) -> list[str]:
        """List all parameters."""
        return list(self.call('list_parameters', ListParameters.Request()).result.names)

    def get(self, names: list[str]) -> dict[str, object]:
        """Read parameters; all of them must exist."""
        values = self.call('get_parameters', GetParameters.Request(names=names)).values
        if len(values) != len(names):
            raise NoAnswer(f'{len(values)} values for {len(names)} parameters')
        return dict(zip(names, map(parameter_value_to_python, values), strict=True))

    def set(  # noqa: A003
            self, parameters: list[Parameter], atomically: bool) -> list[SetParametersResult]:
        """Send a batch; return one result for each parameter, or one for all."""
        if atomically:
            request = SetParametersAtomically.Request(parameters=parameters)
            return [self.call('set_parameters_atomically', request).result]
        return self.call('set_parameters', SetParameters.Request(parameters=parameters)).results


def text(name: str, value: str) -> Parameter:
    """Return a string parameter."""
    return Parameter(name=name, value=ParameterValue(type=ParameterType.PARAMETER_STRING,
                                                     string_value=value))
