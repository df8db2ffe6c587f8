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

"""Base class of nodes: parameters, start, transport, life cycle, service threads and end."""

from collections.abc import Callable, Iterator, Mapping
import contextlib
from functools import partialmethod
import gc
import os
from pathlib import Path
import select
from shutil import get_terminal_size
import signal
import sys
import textwrap
import threading
import traceback
from typing import Any

from cpg_ros.common.command_line import say
from cpg_ros.common.errors import CpgError
from cpg_ros.ros.node.console import never_wait, STREAM_ARGUMENTS
from cpg_ros.ros.node.health import STEADY
from cpg_ros.ros.node.parameters import as_doubles, as_list, kind_of, Spec, StrictParameterService
from lifecycle_msgs.srv import ChangeState
from rcl_interfaces.msg import ParameterDescriptor, ParameterType
import rclpy
from rclpy.exceptions import (
    InvalidHandle,
    InvalidParameterTypeException,
    InvalidParameterValueException,
    NameValidationException,
    ParameterException,
)
from rclpy.executors import ExternalShutdownException, SingleThreadedExecutor
from rclpy.impl.implementation_singleton import rclpy_implementation
from rclpy.lifecycle import LifecycleNodeMixin, LifecycleState, TransitionCallbackReturn
from rclpy.logging import get_logger
from rclpy.node import Node
from rclpy.parameter import Parameter
from rclpy.signals import SignalHandlerOptions
from rclpy.utilities import get_rmw_implementation_identifier, remove_ros_args

# The signals that end a node, and the end of the process while a thread is still at work.

#: How long to wait for the end of a thread, s.
JOIN_TIMEOUT = 0.2


def termination_signals() -> list[signal.Signals]:
    """Return the signals that end a node; SIGHUP does not if it was ignored at the start."""
    return [number for number in (signal.SIGINT, signal.SIGTERM, signal.SIGQUIT, signal.SIGHUP)
            if number != signal.SIGHUP or signal.getsignal(number) != signal.SIG_IGN]


def exit_code(code: int, *threads: threading.Thread | None) -> int:
    """Return the exit code once all threads have ended; if one does not, end the process with it.

    The C++ runtime aborts a process whose thread returns to an ended interpreter.
    """
    for thread in filter(None, threads):
        thread.join(JOIN_TIMEOUT)
        if thread.is_alive():
            os._exit(code)
    return code


# The transport of a process that moves a robot: UDP alone, as shared memory can hold it up.

#: TRANSPORT: variable that selects the transport of Fast DDS, and its value here; the user's own
#: value takes precedence.
TRANSPORT = 'FASTDDS_BUILTIN_TRANSPORTS', 'UDPv4'
#: Variable of ROS 2's discovery range, and its predecessor, which takes precedence.
DISCOVERY_RANGE, LOCALHOST_ONLY = 'ROS_AUTOMATIC_DISCOVERY_RANGE', 'ROS_LOCALHOST_ONLY'
#: PROFILES: both names of the variable of Fast DDS's profile file.
PROFILES = 'FASTDDS_DEFAULT_PROFILES_FILE', 'FASTRTPS_DEFAULT_PROFILES_FILE'
#: Profile of a participant with the discovery range LOCALHOST, without shared memory.
LOCALHOST_PROFILE = Path(__file__).with_name('localhost.xml')


def leave_shared_memory() -> None:
    """Restrict this process to UDP, also on this computer; call it before rclpy.init.

    When a participant joins on the same computer, Fast DDS checks its shared-memory port, and may
    sleep for 333 ms (a third of healthy_check_timeout_ms) with the lock that every publisher
    needs. With the discovery range LOCALHOST the middleware adds shared memory itself; a profile
    that restricts the process to the loopback interface replaces the range. A transport, profiles
    and static peers of the user stay.
    """
    environment = os.environ
    name, udp = TRANSPORT
    configured = (environment.setdefault(name, udp) != udp
                  or any(environment.get(name) for name in ('ROS_STATIC_PEERS', *PROFILES)))
    local = (environment.get(LOCALHOST_ONLY) == '1' or (
        LOCALHOST_ONLY not in environment and environment.get(DISCOVERY_RANGE) == 'LOCALHOST'))
    if local and not configured and 'fastrtps' in get_rmw_implementation_identifier():
        environment.pop(LOCALHOST_ONLY, None)
        environment |= {DISCOVERY_RANGE: 'SYSTEM_DEFAULT', PROFILES[1]: str(LOCALHOST_PROFILE)}


# ROS's life cycle beside a node that is no LifecycleNode: a step for each transition.

class Lifecycle(LifecycleNodeMixin, Node):
    """States and services of https://design.ros2.org/articles/node_lifecycle.html.

    A parameter decides whether a node is managed, which rclpy would have to know earlier.
    """

    def __init__(self, node: Node, steps: Mapping[str, Callable[[], str]]) -> None:
        """Serve ``~/change_state`` and the others.

        Args:
            node: that has the services.
            steps: configure, activate, deactivate, cleanup and shutdown -> function that carries
                it out, and returns why it cannot, or ''. The state then stays.

        """
        # The mixin takes itself for the node, of which this has the fields.
        vars(self).update(vars(node))
        self._logger, self._steps = node.get_logger(), steps
        LifecycleNodeMixin.__init__(self)
        service: Any = self._service_change_state
        self._change, service.callback = service.callback, self._answered_change

    @property
    def active(self) -> bool:
        """Whether the state is active."""
        return self._state_machine.current_state[1] == 'active'

    def _answered_change(self, request: ChangeState.Request, response: ChangeState.Response
                         ) -> ChangeState.Response:
        """Change the state; refuse a transition that the state does not have.

        rclpy of Jazzy would raise an exception, and the client would wait for ever.
        """
        self._stepped = response.success = False
        with contextlib.suppress(rclpy_implementation.RCLError):
            response = self._change(request, response)
        if not (self._stepped or response.success):
            transition, state = request.transition, self._state_machine.current_state[1]
            name = transition.label or f'transition {transition.id}'
            self._logger.warning(f"{name}: refused: the state '{state}' does not have it")
        return response

    def _step(self, name: str, state: LifecycleState) -> TransitionCallbackReturn:
        """Carry out a transition's step."""
        self._stepped = True
        if reason := self._steps[name]():
            self._logger.warning(f'{name}: refused: {reason}')
            return TransitionCallbackReturn.FAILURE
        self._logger.info(f'{name}: done')
        return TransitionCallbackReturn.SUCCESS

    on_configure = partialmethod(_step, 'configure')
    on_activate = partialmethod(_step, 'activate')
    on_deactivate = partialmethod(_step, 'deactivate')
    on_cleanup = partialmethod(_step, 'cleanup')
    on_shutdown = partialmethod(_step, 'shutdown')


#: SPIN_PERIOD: period in which a node takes its turn in the executor of another program, s.
SPIN_PERIOD = 0.02
#: MAX_DOMAIN_ID: largest domain id; the ports of larger ones exceed UDP's range.
MAX_DOMAIN_ID = 232


class StartError(CpgError):
    """The node cannot start; the message is one line for the user."""


class StartedNode(Node):
    """A node with parameters declared by specs, and a thread.

    ``run`` starts and ends it. In the executor of another program it starts when that spins, and
    ends with ``destroy_node``; its callbacks must not run at the same time as each other.

    Attributes:
        stop: set to end the node.
        signals: numbers of the signals that ended it.
        failure: exception that ended the thread, or None.
        thread: thread that may still run when the node ends, or None.
        parameter_service: parameter services, with a thread of their own.
        SETS_OTHERS: parameters whose values set others.

    """

    SETS_OTHERS: frozenset[str] = frozenset()

    def __init__(self, name: str, **options: Any) -> None:
        super().__init__(name, start_parameter_services=False, enable_logger_service=True,
                         **options)
        self.parameter_service = StrictParameterService(self)
        self._doubles: set[str] = set()
        self._lists: dict[str, list] = {}
        # Its clock cannot change under a thread at work.
        self.set_descriptor('use_sim_time', ParameterDescriptor(
            description='follow /clock; set at start', type=ParameterType.PARAMETER_BOOL,
            read_only=True))
        self.add_pre_set_parameters_callback(self._complete)
        self.failure: BaseException | None = None
        self.thread: threading.Thread | None = None
        self.stop = threading.Event()
        self.signals: list[int] = []
        self._begun = self._over = False
        self._turns = self.create_timer(SPIN_PERIOD, self._take_turn, clock=STEADY)

    def _declare(self, specs: Mapping[str, Spec]) -> None:
        """Declare parameters by name.

        Raises:
            StartError: an override has the wrong type, or is out of range.

        """
        overrides = self._parameter_overrides
        for name, spec in specs.items():
            override = overrides.get(name)
            if isinstance(spec.default, float):
                self._doubles.add(name)
                if override is not None:
                    overrides[name], = as_doubles([override], {name})
            elif isinstance(spec.default, list):
                self._lists[name] = spec.default
                if override is not None:
                    overrides[name] = as_list(override, spec.default)
            try:
                self.declare_parameter(name, spec.default, spec.descriptor())
            except InvalidParameterTypeException as error:
                raise StartError(f'parameter {name} must be {kind_of(spec.default)}, not '
                                 f'{overrides[name].value!r}') from error
            except InvalidParameterValueException as error:
                raise StartError(f'parameter {name}: {overrides[name].value} is not from '
                                 f'{spec.low:g} to {spec.high:g}') from error

    def _complete(self, parameters: list[Parameter]) -> list[Parameter]:
        """Return a batch of changes with converted types and the changes that it implies."""
        return [as_list(parameter, self._lists[parameter.name])
                if parameter.name in self._lists else parameter
                for parameter in as_doubles(parameters, self._doubles)]

    def resolve_topic_name(self, topic: str, **options: Any) -> str:
        """Resolve a topic's name; errors as of create_publisher."""
        with _topic(topic):
            return super().resolve_topic_name(topic, **options)

    def create_publisher(self, kind: Any, topic: str, *rest: Any,  # type: ignore[override]
                         **options: Any) -> Any:
        """Create a publisher.

        Raises:
            StartError: the topic's name or a QoS override of it cannot be used.

        """
        with _topic(topic):
            return super().create_publisher(kind, topic, *rest, **options)

    def create_subscription(self, kind: Any, topic: str, *rest: Any,  # type: ignore[override]
                            **options: Any) -> Any:
        """Create a subscription; errors as of create_publisher."""
        with _topic(topic):
            return super().create_subscription(kind, topic, *rest, **options)

    def _value(self, name: str) -> Any:
        return self.get_parameter(name).value

    def _one_of(self, name: str, allowed: tuple[str, ...]) -> None:
        if self._value(name) not in allowed:
            raise StartError(f"{name} '{self._value(name)}' is not one of {', '.join(allowed)}")

    def _warn_of_unknown(self) -> None:
        for name in self._parameter_overrides:
            if not self.has_parameter(name):
                self.get_logger().warning(f"there is no parameter '{name}': ignored")

    def start(self) -> None:
        """Start all threads."""
        self._begun = True
        self.begin()
        self.parameter_service.thread.start()

    def end(self) -> None:
        """End all threads, as ``finish`` does; do nothing if they have been ended."""
        self.stop.set()
        # From Kilted on, rclpy.shutdown destroys the timer.
        with contextlib.suppress(InvalidHandle):
            self._turns.cancel()
        if self._begun and not self._over:
            self._over = True
            self.parameter_service.end()
            self.finish()

    def _take_turn(self) -> None:
        """Start, poll and end the node in the executor of another program."""
        if self.stop.is_set():
            self.end()
        elif self._begun:
            self.poll()
        else:
            self.start()

    def hand_over(self) -> None:
        """Leave starting, polling and ending to the caller."""
        self._turns.cancel()

    def destroy_node(self) -> None:
        """End all threads, and destroy the node."""
        self.end()
        super().destroy_node()

    def _fail(self, error: BaseException) -> None:
        """End the node because of an exception in its thread."""
        self.failure = error
        if not self.context.ok():
            print(f'{self.get_name()}: rclpy was shut down before the node was destroyed: nothing '
                  'more is published', file=sys.stderr)
            return
        self.get_logger().fatal('the publishing thread failed:\n'
                                + ''.join(traceback.format_exception(error)))
        self.stop.set()

    def begin(self) -> None:
        """Start the thread."""

    def poll(self) -> float:
        """Do periodic work in the main thread; return the time until the next call, s."""
        return 0.1

    def finish(self) -> None:
        """End the thread."""


@contextlib.contextmanager
def _topic(name: str) -> Iterator[None]:
    """Add the topic to an error of its name or QoS overrides."""
    try:
        yield
    except (NameValidationException, ParameterException, RuntimeError) as error:
        raise StartError(f"topic '{name}': {_first(error)}") from error


def _spin(executor: SingleThreadedExecutor, node: StartedNode) -> None:
    """Serve parameters, services and timers until the executor is shut down."""
    while not node.stop.is_set():
        try:
            executor.spin_once()
        except ExternalShutdownException:
            return
        except Exception:
            # One bad request must not end a node that moves a robot.
            node.get_logger().error('a request failed:\n' + traceback.format_exc())


def _help_or_error(executable: str, text: str, specs: Mapping[str, Spec],
                   args: list[str] | None) -> int | None:
    """Answer ``--help`` and reject unknown arguments; return the exit code, None to start."""
    try:
        arguments = remove_ros_args(sys.argv[1:] if args is None else args)
    except RuntimeError as error:
        print(f'{executable}: ROS arguments: {_first(error)}', file=sys.stderr)
        return 2
    wrong = [argument for argument in arguments if argument not in ('-h', '--help')]
    if wrong:
        print(f'{executable}: not understood: {" ".join(wrong)} (parameters: --ros-args -p '
              'NAME:=VALUE; see --help)', file=sys.stderr)
        return 2
    if not arguments:
        return None
    say('\n'.join((f'usage: {executable} [--help] [--ros-args -p NAME:=VALUE ... -r FROM:=TO ... '
                   f'--params-file FILE]\n\n{text}\n\nparameters (* at the start only):',
                   *(_help_on(name, spec) for name, spec in specs.items()))))
    return 0


def _help_on(name: str, spec: Spec) -> str:
    """Return the help on a parameter: text, allowed values and default, as wide as a terminal."""
    allowed = spec.constraints or (
        '' if spec.low is None else f'from {spec.low:g} to {spec.high:g}')
    text = f'{name}{"*" * spec.read_only}: {spec.text}{f"; {allowed}" * bool(allowed)} (default: '
    return textwrap.fill(f'{text}{spec.default!r})', min(get_terminal_size().columns, 100),
                         initial_indent='  ', subsequent_indent='      ',
                         break_on_hyphens=False)


def _first(error: Exception) -> str:
    """Return the reason of an rclpy error on one line, without its place in the sources."""
    reason = str(error).replace('. Error: error not set', '').partition(', at /')[0]
    return ' '.join(reason.replace('. Error: ', ': ').split())


def _domain() -> str:
    """Return what is wrong with the domain, or ''; a wrong one makes Fast DDS abort."""
    domain = os.environ.get('ROS_DOMAIN_ID', '')
    return (f'ROS_DOMAIN_ID {domain} is not from 0 to {MAX_DOMAIN_ID}'
            if domain.isdecimal() and int(domain) > MAX_DOMAIN_ID else '')


def _join_graph(name: str, arguments: list[str]) -> tuple[int, str]:
    """Start the process of the log, and rclpy; return an exit code, 0 for none, and the reason."""
    if reason := _domain():
        return 2, reason
    leave_shared_memory()
    try:
        never_wait(name, arguments)
    except OSError as error:
        return 1, f'no process that writes the log can be started: {error.strerror}'
    try:
        rclpy.init(args=[*arguments, *STREAM_ARGUMENTS],
                   signal_handler_options=SignalHandlerOptions.NO)
    except RuntimeError as error:
        return 2, f'ROS arguments: {_first(error)}'
    return 0, ''


def run(make: Callable[[], StartedNode], name: str, text: str, specs: Mapping[str, Spec],
        args: list[str] | None = None, executable: str = '') -> int:
    """Run a node until a signal ends it, or until it stops itself; return the exit code.

    Args:
        make: returns the node; a CpgError ends the start with one line.
        name: of the node.
        text: description for ``--help``, a sentence.
        specs: of its parameters, for ``--help``.
        args: of the command line, without the program's name; by default those of the process.
        executable: name of the program, '' for that of the node.

    """
    code = _help_or_error(executable or name, text, specs, args)
    if code is not None:
        return code

    signals: list[int] = []

    def leave(number: int, _: object) -> None:
        # What Python calls while it cleans up, such as a weak reference's callback, drops what is
        # raised in it.
        signals.append(number)
        raise SystemExit(0)

    ending = termination_signals()
    for number in ending:
        signal.signal(number, leave)
    # The publishing thread must not wait long for one that computes in Python.
    sys.setswitchinterval(2e-4)
    code, reason = _join_graph(name, sys.argv if args is None else args)
    if code:
        print(f'{name}: {reason}', file=sys.stderr)
        return code
    try:
        node = make()
    except (CpgError, NameValidationException, ParameterException) as error:
        get_logger(name).fatal(' '.join(str(error).split()))
        rclpy.shutdown()
        return 1
    # An Event may not be set here: a signal that comes while it is being waited for, or while
    # another one sets it, would wait for ever for the lock that its own thread holds.
    for number in ending:
        signal.signal(number, lambda number, _: signals.append(number))
    node.signals = signals
    executor = SingleThreadedExecutor()
    executor.add_node(node)
    serving = threading.Thread(target=_spin, args=(executor, node), name='executor', daemon=True)
    gc.collect()
    gc.freeze()
    node.hand_over()
    node.start()
    serving.start()
    # A signal wakes the main thread whichever thread receives it: a stop must not wait.
    woken, waking = os.pipe()
    os.set_blocking(waking, False)
    signal.set_wakeup_fd(waking, warn_on_full_buffer=False)
    while not signals and not node.stop.is_set():
        select.select([woken], [], [], node.poll())
    node.end()
    for number in ending:
        # It ends already: a second one, while the interpreter winds up, would kill it.
        signal.signal(number, signal.SIG_IGN)
    executor.shutdown(timeout_sec=0.1)
    rclpy.shutdown()
    return exit_code(0 if node.failure is None else 1, node.thread, node.parameter_service.thread,
                 serving)
