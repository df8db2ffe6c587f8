"""Parameter services that judge requests in a thread of their own and survive malformed ones."""

import threading
import traceback
import weakref
from collections import deque
from collections.abc import Callable, Sequence
from functools import partial
from typing import Any

from rcl_interfaces import srv
from rcl_interfaces.msg import Parameter as ParameterMessage
from rcl_interfaces.msg import SetParametersResult
from rclpy.callback_groups import ReentrantCallbackGroup
from rclpy.node import Node
from rclpy.parameter import Parameter
from rclpy.parameter_service import ParameterService
from rclpy.qos import qos_profile_parameters
from rclpy.task import Future


def _refused(reason: str) -> SetParametersResult:
    return SetParametersResult(successful=False, reason=reason)


class _Batch:
    """Changes that are judged as a whole, and what is told of the outcome."""

    def __init__(self, parameters: list[Parameter],
                 answer: Callable[[SetParametersResult], None]) -> None:
        self.parameters, self.answer = parameters, answer
        self.names = {parameter.name for parameter in parameters}


class StrictParameterService(ParameterService):
    """rclpy's services, but what is set waits for a thread of its own.

    The executor stays free for what must not wait, such as a stop. Of several changes of the same
    parameters that wait, only the last one is judged. Values of no known type and unknown names
    are refused with a reason: rclpy 7.1 lets the exception of the first out of the executor, so
    that one request ends the node, and answers the second without the name.

    Attributes:
        thread: judges and applies what is asked for.

    """

    def __init__(self, node: Node) -> None:
        # Not rclpy's own: its services are in the group of all that must not wait for them.
        self._node_weak_ref = weakref.ref(node)
        group = ReentrantCallbackGroup()
        for kind, answer in (
                (srv.DescribeParameters, self._describe_parameters_callback),
                (srv.GetParameters, self._get_parameters_callback),
                (srv.GetParameterTypes, self._get_parameter_types_callback),
                (srv.ListParameters, self._list_parameters_callback),
                (srv.SetParameters, self._set),
                (srv.SetParametersAtomically, self._set_atomically)):
            name = ''.join(f'_{c.lower()}' if c.isupper() else c for c in kind.__name__)
            node.create_service(kind, f'{node.get_name()}/{name[1:]}', answer,
                                qos_profile=qos_profile_parameters, callback_group=group)
        self._waiting: deque[_Batch] = deque()
        self._changed = threading.Condition()
        self._ending = False
        self.thread = threading.Thread(target=self._work, name='parameters', daemon=True)
        self.thread.start()

    def end(self) -> None:
        """Judge nothing more but what is under way."""
        with self._changed:
            self._ending = True
            self._changed.notify()

    async def _set(self, request: Any, response: Any) -> Any:
        response.results = await self._judged([[one] for one in request.parameters])
        return response

    async def _set_atomically(self, request: Any, response: Any) -> Any:
        response.result, = await self._judged([request.parameters])
        return response

    async def _judged(self, batches: Sequence[Sequence[ParameterMessage]]
                      ) -> list[SetParametersResult]:
        results: list[Any] = [None] * len(batches)
        done = Future(executor=self._get_node().executor)
        # The executor asks those that wait only when something wakes it: a callback does.
        done.add_done_callback(lambda _: None)

        left = set(range(len(batches)))

        def answer(k: int, result: SetParametersResult) -> None:
            results[k] = result
            left.discard(k)
            if not left:
                done.set_result(None)

        for k, messages in enumerate(batches):
            try:
                parameters = self._read(messages)
            except ValueError as error:
                answer(k, _refused(str(error)))
            else:
                self._append(_Batch(parameters, partial(answer, k)))
        if batches:
            await done
        return results

    def _read(self, messages: Sequence[ParameterMessage]) -> list[Parameter]:
        """Read parameters that the node has.

        Raises:
            ValueError: a value of no known type, or an unknown name.

        """
        parameters = []
        for message in messages:
            try:
                parameters.append(Parameter.from_parameter_msg(message))
            except (ValueError, TypeError, RuntimeError) as error:
                raise ValueError(f'{message.name}: {error}') from error
        for parameter in parameters:
            if not self._get_node().has_parameter(parameter.name):
                raise ValueError(f"there is no parameter '{parameter.name}'")
        return parameters

    def _append(self, batch: _Batch) -> None:
        with self._changed:
            old = [one for one in self._waiting if one.names <= batch.names]
            for one in old:
                self._waiting.remove(one)
            self._waiting.append(batch)
            self._changed.notify()
        for one in old:
            one.answer(_refused('superseded: a later request that came while this one was '
                                'waiting sets the same'))

    def _work(self) -> None:
        while True:
            with self._changed:
                self._changed.wait_for(lambda: self._waiting or self._ending)
                if self._ending:
                    return
                batch = self._waiting.popleft()
            node = self._get_node()
            try:
                batch.answer(node.set_parameters_atomically(batch.parameters))
            except Exception as error:
                # One bad request must not end a node that moves a robot.
                node.get_logger().error('a request failed:\n' + traceback.format_exc())
                batch.answer(_refused(f'{type(error).__name__}: {error}'))
