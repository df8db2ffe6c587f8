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

"""Parameter services that judge requests in a thread of their own and survive malformed ones."""

from collections.abc import Callable, Sequence
from functools import partial
import threading
import traceback
from typing import Any
import weakref

from cpg_ros.nodes.bounded_request import bounded
from cpg_ros.nodes.polled_group import PolledGroup
from rcl_interfaces import srv
from rcl_interfaces.msg import Parameter as ParameterMessage
from rcl_interfaces.msg import SetParametersResult
from rclpy.callback_groups import ReentrantCallbackGroup
from rclpy.impl.implementation_singleton import rclpy_implementation
from rclpy.node import Node
from rclpy.parameter import Parameter
from rclpy.parameter_service import ParameterService
from rclpy.qos import qos_profile_parameters
from rclpy.service import Service

#: Names or values in a request at most; no node has nearly as many parameters.
MOST = 1000
#: How often it is seen whether the node is to end, ns.
LOOK = 100_000_000


#: What is taken instead of a request.
_BOUNDED = {kind: bounded(kind, MOST)
            for kind in (srv.SetParameters, srv.SetParametersAtomically)}


def _too_many(count: int) -> str:
    return f'{count} parameters in one request: at most {MOST} are allowed'


def _refused(reason: str) -> SetParametersResult:
    return SetParametersResult(successful=False, reason=reason)


class _Batch:
    """Changes that are judged as a whole, and what is told of the outcome."""

    def __init__(self, parameters: list[Parameter],
                 answer: Callable[[SetParametersResult], None]) -> None:
        self.parameters, self.answer = parameters, answer
        self.names = frozenset(parameter.name for parameter in parameters)


class StrictParameterService(ParameterService):
    """rclpy's services, but what is set is taken, judged and answered by a thread of its own.

    The executor has nothing to do with it and stays free for what must not wait, such as a stop.
    Of several changes of the same parameters that wait, only the last one is judged. Values of no
    known type, unknown names and more than MOST of them are refused with a reason: rclpy 7.1 lets
    the exception of the first out of the executor, so that one request ends the node, and answers
    the second without the name.

    Attributes:
        thread: judges and applies what is asked for, once it is started.

    """

    def __init__(self, node: Node) -> None:
        # Not rclpy's own: its services are in the group of all that must not wait for them.
        self._node_weak_ref = weakref.ref(node)
        group = ReentrantCallbackGroup()
        for kind, answer in (
                (srv.DescribeParameters, self._describe_parameters_callback),
                (srv.GetParameters, self._get_parameters_callback),
                (srv.GetParameterTypes, self._get_parameter_types_callback),
                (srv.ListParameters, self._list_parameters_callback)):
            self._serve(kind, partial(self._counted, answer), group)
        own = PolledGroup()
        self._each = self._serve(srv.SetParameters, _untaken, own)
        self._together = self._serve(srv.SetParametersAtomically, _untaken, own)
        self._ending = False
        self.thread = threading.Thread(target=self._work, name='parameters', daemon=True)

    def _serve(self, kind: Any, answer: Callable, group: Any) -> Service:
        node = self._get_node()
        name = ''.join(f'_{c.lower()}' if c.isupper() else c for c in kind.__name__)
        return node.create_service(kind, f'{node.get_name()}/{name[1:]}', answer,
                                   qos_profile=qos_profile_parameters, callback_group=group)

    def _counted(self, answer: Callable, request: Any, response: Any) -> Any:
        """Answer requests for what there is, those of too many names with an empty response."""
        names = request.prefixes if hasattr(request, 'prefixes') else request.names
        if len(names) <= MOST:
            return answer(request, response)
        self._get_node().get_logger().warning(
            f'{type(request).__name__}: {_too_many(len(names))}', throttle_duration_sec=1.0)
        return response

    def end(self) -> None:
        """Judge nothing more but what is under way."""
        self._ending = True

    def _work(self) -> None:
        waiting: list[_Batch] = []
        try:
            while not self._ending:
                if not waiting:
                    self._wait()
                waiting = _thinned(waiting + self._taken())
                if waiting and not self._ending:
                    batch = waiting.pop(0)
                    batch.answer(self._judged(batch))
        except rclpy_implementation.RCLError:
            # The graph is gone when the node ends while this thread is at work.
            if not self._ending:
                raise

    def _wait(self) -> None:
        """Wait for a request, or a while."""
        handles = [one.handle for one in (self._each, self._together)]
        context = self._get_node().context.handle
        with handles[0], handles[1], context:
            waiting = rclpy_implementation.WaitSet(0, 0, 0, 0, len(handles), 0, context)
            waiting.clear_entities()
            for handle in handles:
                waiting.add_service(handle)
            waiting.wait(LOOK)

    def _taken(self) -> list[_Batch]:
        """Take all requests that have come; answer at once what cannot be read."""
        batches = []
        for service in (self._each, self._together):
            kind: Any = service.srv_type
            while True:
                with service.handle:
                    request, header = service.handle.service_take_request(_BOUNDED[kind])
                if header is None:
                    break
                response = kind.Response()
                if isinstance(request, int):
                    refused = _refused(_too_many(request))
                    if service is self._together:
                        response.result = refused
                    else:
                        response.results = [refused]
                    service.send_response(response, header)
                    continue
                if service is self._together:
                    def tell(results: list, response: Any = response) -> None:
                        response.result, = results
                    parts = [request.parameters]
                else:
                    def tell(results: list, response: Any = response) -> None:
                        response.results = results
                    parts = [[one] for one in request.parameters]
                batches += self._batches(parts, partial(_respond, service, header, response, tell))
        return batches

    def _batches(self, parts: Sequence[Sequence[ParameterMessage]],
                 respond: Callable[[list[SetParametersResult]], None]) -> list[_Batch]:
        """Read the parts of a request, which is answered when all of them are."""
        results: list[Any] = [None] * len(parts)
        left = set(range(len(parts)))

        def answer(k: int, result: SetParametersResult) -> None:
            results[k] = result
            left.discard(k)
            if not left:
                respond(results)

        if not parts:
            respond(results)
        batches = []
        for k, messages in enumerate(parts):
            try:
                batches.append(_Batch(self._read(messages), partial(answer, k)))
            except ValueError as error:
                answer(k, _refused(str(error)))
        return batches

    def _read(self, messages: Sequence[ParameterMessage]) -> list[Parameter]:
        """Read parameters that the node has and that may be set while it runs.

        Raises:
            ValueError: a value of no known type, an unknown name, or a read-only parameter.

        """
        parameters = []
        for message in messages:
            try:
                parameters.append(Parameter.from_parameter_msg(message))
            except (ValueError, TypeError, RuntimeError) as error:
                raise ValueError(f'{message.name}: {error}') from error
        for parameter in parameters:
            if not self._get_node().has_parameter(parameter.name):
                switch = f'{parameter.name}.enabled'
                raise ValueError(f"there is no parameter '{parameter.name}'" + (
                    f": it is '{switch}'" if self._get_node().has_parameter(switch) else ''))
            if self._get_node().describe_parameter(parameter.name).read_only:
                raise ValueError(f'{parameter.name} is read-only: set it when the node starts')
        return parameters

    def _judged(self, batch: _Batch) -> SetParametersResult:
        node = self._get_node()
        try:
            return node.set_parameters_atomically(batch.parameters)
        except Exception as error:
            # One bad request must not end a node that moves a robot.
            if not self._ending:
                node.get_logger().error('a request failed:\n' + traceback.format_exc())
            return _refused(f'{type(error).__name__}: {error}')


def _untaken(request: object, response: Any) -> Any:
    """Stand for a callback: the requests are taken by the thread."""
    return response


def _respond(service: Service, header: object, response: Any, tell: Callable[[list], None],
             results: list[SetParametersResult]) -> None:
    tell(results)
    service.send_response(response, header)


def _thinned(batches: list[_Batch]) -> list[_Batch]:
    """Refuse those of which a later one sets all parameters; return the others."""
    later: set[frozenset[str]] = set()
    left = []
    for batch in reversed(batches):
        if any(batch.names <= names for names in later):
            batch.answer(_refused('superseded: a later request that came while this one was '
                                  'waiting sets the same'))
        else:
            later.add(batch.names)
            left.append(batch)
    return left[::-1]
