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

"""A running node, asked and changed by its services."""

import time
from typing import Any

from cpg_ros.errors import CpgError
from rcl_interfaces.srv import DescribeParameters, GetParameters, ListParameters, SetParameters
import rclpy
from rclpy.node import Node
from rclpy.parameter import Parameter, parameter_value_to_python
from std_srvs.srv import SetBool, Trigger


class Unanswered(CpgError):
    """What was asked for was refused, or nobody answered."""

    exit_code = 1


class RunningNode:
    """Another node of the graph."""

    def __init__(self, node: Node, name: str, wait: float) -> None:
        """Ask a node through one of ours.

        Args:
            node: ours.
            name: of the other one, such as /cpg_generator.
            wait: how long all that is asked may take together, s.

        """
        self._node, self._name, self._wait = node, name, wait
        self._end = time.monotonic() + wait

    def _left(self) -> float:
        return max(self._end - time.monotonic(), 0.0)

    def _call(self, kind: Any, service: str, request: Any) -> Any:
        name = f'{self._name}/{service}'
        client = self._node.create_client(kind, name)
        if not client.wait_for_service(self._left()):
            raise Unanswered(f'{self._name} does not answer (no service {name})')
        future = client.call_async(request)
        rclpy.spin_until_future_complete(self._node, future, timeout_sec=self._left())
        if not future.done():
            raise Unanswered(f'{name} did not answer within {self._wait:g} s')
        return future.result()

    def set(self, name: str, value: Any) -> None:  # noqa: A003
        """Set a parameter.

        Raises:
            Unanswered: nobody answers, or the node refuses; the message is the node's reason.

        """
        message = Parameter(name, value=value).to_parameter_msg()
        (result,) = self._call(SetParameters, 'set_parameters',
                               SetParameters.Request(parameters=[message])).results
        if not result.successful:
            raise Unanswered(result.reason)

    def get(self, name: str) -> Any:
        """Return a parameter's value.

        Raises:
            Unanswered: nobody answers, or the node has no such parameter.

        """
        (value,) = self._call(GetParameters, 'get_parameters',
                              GetParameters.Request(names=[name])).values or [None]
        if value is None or not value.type:
            raise Unanswered(f"{self._name} has no parameter '{name}'")
        return parameter_value_to_python(value)

    def parameters(self) -> list[Any]:
        """Return the descriptors of all parameters, by name.

        Raises:
            Unanswered: nobody answers.

        """
        names = sorted(self._call(ListParameters, 'list_parameters',
                                  ListParameters.Request()).result.names)
        return list(self._call(DescribeParameters, 'describe_parameters',
                               DescribeParameters.Request(names=names)).descriptors)

    def enable(self, up: bool) -> str:
        """Ramp into the gait, or down to the stand; return the answer.

        Raises:
            Unanswered: nobody answers, or the node refuses.

        """
        return self._agreed(self._call(SetBool, 'enable', SetBool.Request(data=up)))

    def reset(self) -> str:
        """Put the node back to its start; return the answer.

        Raises:
            Unanswered: nobody answers, or the node refuses.

        """
        return self._agreed(self._call(Trigger, 'reset', Trigger.Request()))

    @staticmethod
    def _agreed(answer: Any) -> str:
        if not answer.success:
            raise Unanswered(answer.message)
        return str(answer.message)
