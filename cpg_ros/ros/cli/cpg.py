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

"""Executable ``cpg``: the package's executables, and a running graph, from one command line.

``cpg param set gait walk`` does ``ros2 param set /cpg_generator gait walk`` by the same services;
ros2 comes with ROS and is not on PyPI.
"""

from argparse import ArgumentParser, ArgumentTypeError, Namespace, REMAINDER, SUPPRESS
import asyncio
from collections.abc import Callable, Coroutine, Iterator, Sequence
from contextlib import contextmanager
from importlib.util import find_spec
from pathlib import Path
import signal
import sys
from typing import Any, TYPE_CHECKING

from cpg_ros.common.command_line import note, number, Parser, run, say
from cpg_ros.common.errors import CpgError, InputError
from cpg_ros.common.yaml_reader import parsed
from cpg_ros.ros.cli.executables import EXECUTABLES, start
import yaml

# Shell completion of ``cpg``, with the parameters and topics of a running graph.

if TYPE_CHECKING:
    from cpg_ros.ros.node.client import NodeClient
    from rclpy.node import Node

#: COMPLETION_TIMEOUT: of a node's answer, s: DDS repeats a lost announcement only after 3 s.
COMPLETION_TIMEOUT = 4.0


class NoCompletion(CpgError):
    """The library is not installed."""

    exit_code = 1


def complete(parser: ArgumentParser) -> None:
    """Print completions and exit, if a shell requests them."""
    if find_spec('argcomplete') is not None:
        import argcomplete
        argcomplete.autocomplete(parser)


def shell_code() -> str:
    """Return the code that bash evaluates.

    Raises:
        NoCompletion: the library is not installed.

    """
    if find_spec('argcomplete') is None:
        raise NoCompletion('completion needs argcomplete: pip install argcomplete')
    from argcomplete.shell_integration import shellcode
    return str(shellcode(['cpg']))


def _completed(query: Callable[['Node'], list[Any]]) -> list[Any]:
    import rclpy
    from rclpy.utilities import try_shutdown
    rclpy.init(args=[])
    try:
        return query(rclpy.create_node('cpg_completion', enable_rosout=False))
    except CpgError:
        # No node responds, so there is nothing to offer.
        return []
    finally:
        try_shutdown()


def _of_node(args: Namespace, query: Callable[['NodeClient'], Coroutine[Any, Any, list[Any]]]
             ) -> list[Any]:
    from cpg_ros.ros.node.client import NodeClient, ServiceClients
    return _completed(lambda node: asyncio.run(
        query(NodeClient(ServiceClients(node, COMPLETION_TIMEOUT), args.node))))


def complete_parameters(parsed_args: Namespace, **_: Any) -> list[str]:
    """Return the names of the node's parameters."""
    return _of_node(parsed_args, lambda other: other.parameters())


def values(parsed_args: Namespace, **_: Any) -> list[str]:
    """Return the values of the parameter, or of the gait, that has a list of choices."""
    from cpg_ros.ros.node.parameters import choices
    name = getattr(parsed_args, 'parameter', 'gait')
    return [word for value in _of_node(parsed_args, lambda other: other.descriptors([name]))
            for word in choices(value.additional_constraints)]


def complete_topics(parsed_args: Namespace, **_: Any) -> list[str]:
    """Return the graph's topics."""
    from cpg_ros.ros.cli.graph import topics as graph_topics
    return _completed(lambda node: list(graph_topics(node)))


DESCRIPTION = """\
Run an executable of the package, or inspect, change, record and play back a running graph: a small
substitute for ros2 run, param, topic, service and bag."""
EPILOG = """\
examples:
  cpg run generator --ros-args -p gait:=walk
  cpg gait trot
  cpg param set frequency 2
  cpg topic hz joint_states
  cpg disable
  cpg sit
  cpg call /unitree_bridge/stop
  cpg record walk_bag
  cpg run inversion --bag walk_bag --out fitted.yaml

--node and --wait may stand anywhere but after run.
eval "$(cpg completion)" makes the shell complete all of it, parameters and topics included.

exit codes: 0 done, 1 refused, or nothing answered in time, 2 wrong arguments."""


#: DEFAULT_NODE: of actions; DISCOVERY_TIMEOUT: to find it, s; RESPONSE_TIMEOUT: of its answer, s,
#: as a setting of the generator may compile a network first.
DEFAULT_NODE, DISCOVERY_TIMEOUT, RESPONSE_TIMEOUT = '/cpg_generator', 5.0, 60.0


def _common(node: str, wait: float | str) -> Parser:
    options = Parser(add_help=False)
    options.add_argument('--node', default=node, metavar='NAME',
                      help=f'node to talk to (default: {DEFAULT_NODE})')
    options.add_argument('--wait', type=number, default=wait, metavar='S',
                      help='longest wait for a node, or for the publisher of a topic, s '
                      f'(default: {DISCOVERY_TIMEOUT:g})')
    return options


def parser() -> Parser:
    """Return the arguments of the executable."""
    top = Parser(prog='cpg', description=DESCRIPTION, epilog=EPILOG,
                  parents=[_common(DEFAULT_NODE, DISCOVERY_TIMEOUT)])
    actions = top.add_subparsers(dest='action', required=True, metavar='ACTION')
    # Without defaults, which would replace what stands before the action.
    anywhere = _common(SUPPRESS, SUPPRESS)

    def add(group: Any, name: str, text: str, do: Any = _called) -> Any:
        action = group.add_parser(name, help=text, description=text.capitalize() + '.',
                                  parents=[] if name in ('run', 'completion') else [anywhere])
        action.set_defaults(do=do)
        return action

    action = add(actions, 'run', 'run an executable of the package')
    action.add_argument('executable', choices=[name for name in EXECUTABLES if name != 'cpg'],
                        metavar='EXECUTABLE')
    action.add_argument('arguments', nargs=REMAINDER, metavar='...',
                        help='arguments of the executable')
    gait = add(actions, 'gait', 'switch the gait')
    gait.add_argument('gait', metavar='NAME').completer = values
    for name, text in (('enable', 'ramp into the gait'), ('disable', 'ramp down to the stand'),
                       ('sit', 'ramp down to the stand, then sit down'),
                       ('stand', 'stand up from where the robot sits'),
                       ('reset', 'reset robot_sim to its start (--node /robot_sim)')):
        add(actions, name, text).set_defaults(service=name)
    add(actions, 'call', 'call a service of the type std_srvs/Trigger').add_argument(
        'service', metavar='SERVICE', help="such as /unitree_bridge/stop; one of the node's own "
        'has no slash in front')

    parameters = add(actions, 'param', "a node's parameters").add_subparsers(
        dest='what', required=True, metavar='{set,get,list}')
    for name, text in (('set', 'set a parameter'), ('get', 'print a parameter')):
        action = add(parameters, name, text)
        action.add_argument('parameter', metavar='PARAMETER').completer = complete_parameters
        if name == 'set':
            value = action.add_argument('value', metavar='VALUE', type=parameter_value)
            value.completer = values
    add(parameters, 'list', 'print all parameters and their descriptions')

    topics = add(actions, 'topic', "a graph's topics").add_subparsers(
        dest='what', required=True, metavar='{list,echo,hz}')
    add(topics, 'list', 'print all topics and their types', _listened)
    echo = add(topics, 'echo', 'print the messages of a topic until Ctrl-C', _listened)
    echo.add_argument('--once', action='store_true', help='print the next message only')
    for action in (echo, add(topics, 'hz', 'measure the message rate of a topic for 3 s',
                            _listened)):
        action.add_argument('topic', metavar='TOPIC').completer = complete_topics

    record = add(actions, 'record', 'record topics into a bag until Ctrl-C', _recorded)
    record.add_argument('bag', type=Path, metavar='BAG', help='folder to create')
    recorded = record.add_argument('topics', nargs='*', metavar='TOPIC',
                                   help='topics to record (default: all published topics)')
    recorded.completer = complete_topics
    play = add(actions, 'play', 'publish the messages of a bag', _played)
    play.add_argument('bag', type=Path, metavar='BAG', help='folder, or one of its files')
    play.add_argument('topics', nargs='*', metavar='TOPIC', help='topics to play (default: all)')
    play.add_argument('--rate', type=rate, default=1.0, metavar='R',
                      help='playback speed relative to the recording (default: %(default)g)')
    schedule = add(actions, 'play-schedule', 'set the parameters of the generator at the times '
                   'of a schedule, as inversion --schedule writes it')
    schedule.add_argument('schedule', type=Path, metavar='FILE', help='YAML file')
    schedule.add_argument('--rate', type=rate, default=1.0, metavar='R',
                          help='speed relative to the schedule (default: %(default)g)')
    add(actions, 'completion', 'print the bash completion script of cpg')
    return top


def parameter_value(text: str) -> Any:
    """Read a parameter's value as YAML.

    Raises:
        argparse.ArgumentTypeError: no parameter has values of this type.

    """
    from rclpy.parameter import Parameter
    try:
        value = parsed(text)
        Parameter('one', value=value)
    except (yaml.YAMLError, TypeError):
        raise ArgumentTypeError(f"'{text}' is not a parameter value") from None
    return value


def rate(text: str) -> float:
    """Read a positive number.

    Raises:
        argparse.ArgumentTypeError: the text is not a positive number.

    """
    if not 0.0 < number(text) < float('inf'):
        raise ArgumentTypeError(f"'{text}' is not positive")
    return number(text)


def _called(args: Namespace, node: 'Node') -> str:
    from cpg_ros.ros.node.client import CallError, NodeClient, NoService, ServiceClients
    if args.action == 'call' and '/' in args.service:
        args.node, _, args.service = args.service.rpartition('/')
    running = 'is a generator running?' if args.node == DEFAULT_NODE else 'is it running?'
    services = ServiceClients(node, search=args.wait, late=lambda: note(
        'cpg', f'waiting for {args.node} ({running})'))
    other = NodeClient(services, args.node)
    try:
        return asyncio.run(_call(args, other))
    except NoService as error:
        raise CallError(f'{other.name} does not answer (no service {error.service})') from error


async def _call(args: Namespace, other: 'NodeClient') -> str:
    from cpg_ros.ros.node.client import CallError
    from std_srvs.srv import SetBool, Trigger
    if args.action in ('enable', 'disable'):
        return await other.command(SetBool, 'enable', RESPONSE_TIMEOUT,
                                   data=args.action == 'enable')
    if 'service' in args:
        return await other.command(Trigger, args.service, RESPONSE_TIMEOUT)
    if args.action == 'play-schedule':
        from cpg_ros.ros.cli.graph import play_schedule
        return await play_schedule(args.schedule, other, args.rate)
    if args.action == 'gait':
        args.what, args.parameter, args.value = 'set', 'gait', args.gait
    if args.what == 'set':
        await other.set_parameters({args.parameter: args.value}, RESPONSE_TIMEOUT)
        return f'{other.name}: {args.parameter} is {args.value}'
    if args.what == 'get':
        value, = await other.values([args.parameter])
        if value is None:
            raise CallError(f"{other.name} has no parameter '{args.parameter}'")
        return str(value)
    return '\n'.join(f'{descriptor.name}  {descriptor.description}'
                     for descriptor in await other.descriptors(await other.parameters()))


def _listened(args: Namespace, node: 'Node') -> str:
    from cpg_ros.ros.cli.graph import as_yaml, Topic, topics
    if args.what == 'list':
        return '\n'.join(f'{name}  {kind}' for name, kind in topics(node).items())
    topic = Topic(node, args.topic, args.wait, lambda name: note(
        'cpg', f'waiting for {name} (does anything publish it?)'))
    if args.what == 'hz':
        return f'{topic.rate():.1f} Hz'
    for message in topic.messages():
        say(f'{as_yaml(message)}---')
        if args.once:
            break
    return ''


def _recorded(args: Namespace, node: 'Node') -> str:
    from cpg_ros.ros.cli.graph import record
    recorder = record(node, args.bag, args.topics)
    for topic, why in recorder.passed_over.items():
        print(f'{topic} was not recorded: {why}', file=sys.stderr)
    count = sum(recorder.counts.values())
    return f'{args.bag}: {count} messages' if count else 'nothing was published: no bag'


def _played(args: Namespace, node: 'Node') -> str:
    from cpg_ros.ros.cli.graph import play
    counts = play(node, args.bag, args.topics, args.rate)
    return '\n'.join(f'{topic}: {count} messages' for topic, count in counts.items())


@contextmanager
def _graph() -> Iterator['Node']:
    """Join the graph with a node.

    Raises:
        InputError: rclpy refuses the name of a node or topic, or the domain in the environment.

    """
    import rclpy
    from rclpy.exceptions import NameValidationException
    from rclpy.signals import SignalHandlerOptions
    from rclpy.utilities import try_shutdown
    # A shell makes processes in the background ignore Ctrl-C.
    for ending in (signal.SIGINT, signal.SIGTERM):
        signal.signal(ending, signal.default_int_handler)
    try:
        # The context stays valid while a signal ends the action.
        rclpy.init(args=[], signal_handler_options=SignalHandlerOptions.NO)
        yield rclpy.create_node('cpg', enable_rosout=False)
    except (NameValidationException, RuntimeError) as error:
        # The rest of the message names source files of rclpy.
        raise InputError(str(error).splitlines()[0].partition(', at /')[0]) from error
    finally:
        try_shutdown()


def _do(args: Namespace) -> int:
    if args.action == 'run':
        sys.argv = [args.executable, *args.arguments]
        return start(args.executable)
    if args.action == 'completion':
        answer = shell_code()
    else:
        with _graph() as node:
            answer = args.do(args, node)
    if answer:
        say(answer)
    return 0


def main(arguments: Sequence[str] | None = None) -> int:
    """Perform one action; return the exit code."""
    top = parser()
    complete(top)
    argv = list(sys.argv[1:] if arguments is None else arguments)
    if not argv:
        top.print_help(sys.stderr)
        return CpgError.exit_code
    if argv[0] in EXECUTABLES and argv[0] != 'cpg':
        argv.insert(0, 'run')
    return run(top, _do, argv, stopped='')
