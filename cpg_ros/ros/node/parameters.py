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

"""Parameter services that handle requests in a thread and survive malformed ones."""

from collections.abc import Callable, Iterable, Mapping, Sequence
import ctypes
from dataclasses import dataclass, replace
from functools import partial
from queue import SimpleQueue
import re
import threading
import traceback
from types import SimpleNamespace
from typing import Any
import weakref

from rcl_interfaces import srv
from rcl_interfaces.msg import (
    FloatingPointRange,
    IntegerRange,
    ParameterDescriptor,
    SetParametersResult,
)
from rcl_interfaces.msg import Parameter as ParameterMessage
from rclpy.callback_groups import ReentrantCallbackGroup
from rclpy.impl.implementation_singleton import rclpy_implementation
from rclpy.node import Node
from rclpy.parameter import Parameter
from rclpy.parameter_service import ParameterService
from rclpy.qos import qos_profile_parameters
from rclpy.service import Service
from rclpy.type_support import check_for_type_support

# Descriptions of a node's parameters, and conversions of their values.

#: Name of a value of each type, for messages.
TYPE_NAMES = {bool: 'a bool', int: 'an integer', float: 'a double', str: 'a string'}


#: PRESETS_LABEL: separates, in the constraints of a gait, gaits from presets with names of
#: their own; UNTUNED_LABEL: precedes those that are not tuned for the robot.
PRESETS_LABEL, UNTUNED_LABEL = '; presets: ', '; not tuned for this robot: '


def one_of(names: Iterable[str], further: str = '') -> str:
    """Return the constraints of a parameter with given words as values, and ``further`` text."""
    return 'one of: ' + ', '.join(names) + further


def choices(constraints: str) -> list[str]:
    """Return the words in a descriptor's constraints, if one_of wrote them."""
    match = re.search(r'one of: (.*)', constraints.partition(UNTUNED_LABEL)[0])
    names = re.split(f', |{PRESETS_LABEL}', match[1]) if match else []
    return [name for name in names if re.fullmatch(r'[\w.-]+', name)]


def presets_among(constraints: str) -> list[str]:
    """Return those choices that are presets with other names than gaits."""
    return choices(f'one of: {constraints.partition(PRESETS_LABEL)[2]}')


def untuned_among(constraints: str) -> list[str]:
    """Return those choices of a gait that are not tuned for the robot."""
    return choices(f'one of: {constraints.partition(UNTUNED_LABEL)[2]}')


@dataclass(frozen=True)
class Spec:
    """One parameter: default, description, range, and whether it is read-only."""

    default: Any
    text: str
    low: float | None = None
    high: float | None = None
    read_only: bool = False
    constraints: str = ''

    def descriptor(self) -> ParameterDescriptor:
        """Return the ROS descriptor."""
        descriptor = ParameterDescriptor(description=self.text, read_only=self.read_only,
                                   additional_constraints=self.constraints)
        if self.low is not None and self.high is not None:
            if isinstance(self.default, int):
                descriptor.integer_range = [IntegerRange(
                    from_value=int(self.low), to_value=int(self.high), step=1)]
            else:
                descriptor.floating_point_range = [FloatingPointRange(
                    from_value=self.low, to_value=self.high)]
        return descriptor


def fixed(specs: Mapping[str, Spec]) -> dict[str, Spec]:
    """Return the same parameters as read-only ones."""
    return {name: replace(spec, read_only=True) for name, spec in specs.items()}


def as_doubles(parameters: list[Parameter], doubles: set[str]) -> list[Parameter]:
    """Convert integers that are given for floating-point parameters to doubles.

    ``ros2 param set /cpg_generator frequency 2`` sends an integer.
    """
    return [Parameter(p.name, Parameter.Type.DOUBLE, float(p.value))
            if p.name in doubles and p.type_ == Parameter.Type.INTEGER else p
            for p in parameters]


def as_list(parameter: Parameter, default: list) -> Parameter:
    """Convert one value, or integers, to the list type of a parameter."""
    value = parameter.value
    values = value if parameter.type_.name.endswith('_ARRAY') else [value]
    kind = type(default[0]) if default else str
    if kind is float and all(type(element) in (int, float) for element in values):
        return Parameter(parameter.name, Parameter.Type.DOUBLE_ARRAY, [float(x) for x in values])
    return Parameter(parameter.name, value=[value]) if type(value) is kind else parameter


def kind_of(default: Any) -> str:
    """Return the name of a parameter's type, from its default, for messages."""
    if isinstance(default, list):
        return f'a list of {TYPE_NAMES[type(default[0]) if default else str].split()[1]}s'
    return TYPE_NAMES[type(default)]


# Requests of a service whose first field is a sequence, bounded in length.

#: PyObject * convert(void * message), as the type support of every message has it.
_CONVERT = ctypes.PYFUNCTYPE(ctypes.py_object, ctypes.c_void_p)
_pointer, _capsule = ctypes.pythonapi.PyCapsule_GetPointer, ctypes.pythonapi.PyCapsule_New
_pointer.restype, _pointer.argtypes = ctypes.c_void_p, [ctypes.py_object, ctypes.c_char_p]
_capsule.restype = ctypes.py_object
_capsule.argtypes = [ctypes.c_void_p, ctypes.c_char_p, ctypes.c_void_p]
#: Owners of the functions that capsules point to: a capsule must not outlive them.
_capsule_owners: list[Any] = []


def bounded(service: type, most: int) -> type:
    """Return a type to take instead of a service's Request.

    A taken message is a Request or, if its first field has more than ``most`` elements, their
    number.

    Args:
        service: type of a service whose requests begin with a sequence.
        most: largest number of elements.

    """
    check_for_type_support(service)
    kind: Any = type(service.Request)  # type: ignore[attr-defined]
    usual = _CONVERT(_pointer(kind._CONVERT_TO_PY, None))

    def convert(message: int) -> object:
        # In C a sequence is a pointer to its elements, then how many there are.
        length = ctypes.c_size_t.from_address(message + ctypes.sizeof(ctypes.c_void_p)).value
        return length if length > most else usual(message)

    own = _CONVERT(convert)
    _capsule_owners.append(own)
    names = '_CREATE_ROS_MESSAGE', '_DESTROY_ROS_MESSAGE', '_CONVERT_FROM_PY', '_TYPE_SUPPORT'
    support = type('Support', (type,), {
        **{name: getattr(kind, name) for name in names},
        '_CONVERT_TO_PY': _capsule(ctypes.cast(own, ctypes.c_void_p), None, None)})
    bound: type = support('Request', (), {})
    return bound


#: Limit of the names or values in a request; no node has nearly as many parameters.
MAX_PARAMETERS = 1000


def _rejected(reason: str) -> SetParametersResult:
    return SetParametersResult(successful=False, reason=reason)


class _Change:
    """Parameters that are set atomically, and the receiver of the result."""

    def __init__(self, parameters: list[Parameter],
                 answer: Callable[[SetParametersResult], None]) -> None:
        self.parameters, self.answer = parameters, answer
        self.names = frozenset(parameter.name for parameter in parameters)
        #: Earlier ones that this one replaces if it is accepted.
        self.replaced: list[_Change] = []


class StrictParameterService(ParameterService):
    """Parameter services in a callback group of their own, with changes applied in a thread.

    The executor stays free for urgent requests, such as a stop. Of several waiting changes of the
    same parameters, only the last valid one is applied. Values of unknown type, unknown names and
    more than MAX_PARAMETERS are rejected with a reason; rclpy 7.1 raises in the executor.

    Attributes:
        thread: applies the changes, once started.

    """

    def __init__(self, node: Node) -> None:
        # Replaces rclpy's own services, which share a callback group that must not wait for them.
        self._node_weak_ref = weakref.ref(node)
        self._group = ReentrantCallbackGroup()
        for kind in (srv.DescribeParameters, srv.GetParameters, srv.GetParameterTypes,
                     srv.ListParameters, srv.SetParameters, srv.SetParametersAtomically):
            self._serve(kind)
        self._ending = False
        #: Service, request and header, or a change by the node itself; None at the end.
        self._requests: SimpleQueue[tuple[Any, Any, Any] | _Change | None] = SimpleQueue()
        self.thread = threading.Thread(target=self._work, name='parameters', daemon=True)

    def _serve(self, kind: Any) -> None:
        node = self._get_node()
        name = ''.join(f'_{c.lower()}' if c.isupper() else c for c in kind.__name__)
        changes = kind in (srv.SetParameters, srv.SetParametersAtomically)
        # A request is passed on in place of a response.
        answer = ((lambda request, _: request) if changes else
                  getattr(self, f'{name}_callback'))

        def limited(request: Any, response: Any) -> Any:
            return (self._too_many(kind, request, response) if isinstance(request, int) else
                    answer(request, response))

        service: Any = node.create_service(
            kind, f'{node.get_name()}/{name[1:]}', limited, qos_profile=qos_profile_parameters,
            callback_group=self._group)
        # Used by the executor to take requests and to send responses.
        service.srv_type = SimpleNamespace(Request=bounded(kind, MAX_PARAMETERS),
                                           Response=kind.Response)
        if changes:
            service.send_response = partial(self._defer, service)

    def _too_many(self, kind: type, count: int, response: Any) -> Any:
        reason = f'{count} parameters in one request: at most {MAX_PARAMETERS} are allowed'
        if kind is srv.SetParameters:
            response.results = [_rejected(reason)]
        elif kind is srv.SetParametersAtomically:
            response.result = _rejected(reason)
        else:
            self._get_node().get_logger().warning(f'{kind.__name__}: {reason}',
                                                  throttle_duration_sec=1.0)
        return response

    def _defer(self, service: Any, response: Any, header: Any) -> None:
        """Send a response, or leave the request to the thread."""
        if isinstance(response, service.srv_type.Response):
            Service.send_response(service, response, header)
        else:
            self._requests.put((service, response, header))

    def _next(self) -> list[_Change]:
        """Wait for a request; return its changes, each of which gets a response."""
        received = self._requests.get()
        if received is None or isinstance(received, _Change):
            return [] if received is None else [received]
        service, request, header = received
        response = service.srv_type.Response()
        together = hasattr(response, 'result')
        parts = ([request.parameters] if together else
                 [[message] for message in request.parameters])
        results: list[Any] = [None] * len(parts)
        unanswered = set(range(len(parts)))

        def answer(k: int, result: SetParametersResult) -> None:
            results[k] = result
            unanswered.discard(k)
            if not unanswered:
                respond()

        def respond() -> None:
            if together:
                response.result, = results
            else:
                response.results = results
            Service.send_response(service, response, header)

        if not parts:
            respond()
        changes = []
        for k, messages in enumerate(parts):
            try:
                changes.append(_Change(self._read(messages), partial(answer, k)))
            except ValueError as error:
                answer(k, _rejected(str(error)))
        return changes

    def change(self, parameter: Parameter,
               answer: Callable[[SetParametersResult], None]) -> None:
        """Set a parameter in the thread, as if a request had come; ``answer`` takes the result."""
        self._requests.put(_Change([parameter], answer))

    def _read(self, messages: Sequence[ParameterMessage]) -> list[Parameter]:
        """Read parameters that the node has and that can be set while it runs.

        Raises:
            ValueError: a value of unknown type, an unknown name, or a read-only parameter.

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

    def end(self) -> None:
        """Stop after the present change."""
        self._ending = True
        self._requests.put(None)

    def _work(self) -> None:
        try:
            self._apply_changes()
        except rclpy_implementation.RCLError:
            # The graph is gone when the node ends while this thread is at work.
            if not self._ending:
                raise

    def _apply_changes(self) -> None:
        waiting: list[_Change] = []
        while not self._ending:
            if not waiting:
                waiting = self._next()
            while not self._requests.empty():
                waiting = waiting + self._next()
            waiting = _thinned(waiting, self._get_node().SETS_OTHERS)
            if waiting and not self._ending:
                change = waiting.pop(0)
                result = self._validated(change.parameters)
                change.answer(result)
                if not result.successful:
                    waiting[:0] = change.replaced
                    continue
                for earlier in change.replaced:
                    earlier.answer(_rejected('superseded: a later request that came while this '
                                            'one was waiting sets the same'))

    def _validated(self, parameters: list[Parameter]) -> SetParametersResult:
        node = self._get_node()
        try:
            return node.set_parameters_atomically(parameters)
        except Exception as error:
            # One bad request must not end a node that moves a robot.
            if not self._ending:
                node.get_logger().error('a request failed:\n' + traceback.format_exc())
            return _rejected(f'{type(error).__name__}: {error}')


def _thinned(changes: list[_Change], barriers: frozenset[str]) -> list[_Change]:
    """Return the remaining changes in order, without those that are superseded.

    A later change that sets all parameters of an earlier one supersedes it, and lists it in
    ``replaced``. Parameters in ``barriers`` may set others: none is superseded across a change
    that sets a barrier, and such a change only by the next one.
    """
    remaining: list[_Change] = []
    for change in reversed(changes):
        reached = 1 if change.names & barriers else next(
            (k for k, later in enumerate(reversed(remaining), 1) if later.names & barriers),
            len(remaining))
        later = next((later for later in remaining[-reached:] if change.names <= later.names),
                     None)
        if later is None:
            remaining.append(change)
        else:
            later.replaced[:0] = [*change.replaced, change]
            change.replaced = []
    return remaining[::-1]
