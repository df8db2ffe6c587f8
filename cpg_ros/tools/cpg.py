"""Executable ``cpg``: a running node's parameters and topics, where ROS's own command line is not.

``cpg set gait walk`` is ``ros2 param set /cpg_generator gait walk``, by the same services; ros2
comes with ROS and is not on PyPI.
"""

import sys
import time
from argparse import ArgumentTypeError, Namespace, RawDescriptionHelpFormatter
from collections.abc import Sequence
from importlib import import_module
from typing import Any

import rclpy
import yaml
from rcl_interfaces.srv import DescribeParameters, GetParameters, ListParameters, SetParameters
from rclpy.exceptions import NameValidationException
from rclpy.node import Node
from rclpy.parameter import Parameter, parameter_value_to_python
from rclpy.qos import qos_profile_sensor_data
from rclpy.utilities import try_shutdown
from std_srvs.srv import SetBool

from cpg_ros.errors import CpgError
from cpg_ros.tools.arguments import Parser, number, say

DESCRIPTION = '''\
Ask and change a running node: a small stand-in for ros2 param, topic and service.'''
EPILOG = '''\
examples:
  cpg set gait walk
  cpg set frequency 2
  cpg get gait
  cpg echo joint_states
  cpg disable

exit codes: 0 done, 1 refused, or nothing answered in time, 2 wrong arguments.'''


class Failed(CpgError):
    """What was asked for was refused, or nobody answered."""


def parser() -> Parser:
    """Return the arguments of the executable."""
    made = Parser(prog='cpg', description=DESCRIPTION, epilog=EPILOG,
                  formatter_class=RawDescriptionHelpFormatter)
    made.add_argument('--node', default='/cpg_generator', metavar='NAME',
                      help='which node (default: %(default)s)')
    made.add_argument('--wait', type=number, default=60.0, metavar='S',
                      help='how long to wait for an answer, s (default: %(default)g)')
    actions = made.add_subparsers(dest='action', required=True, metavar='ACTION')
    for name, text, words in (('set', 'set a parameter', ('parameter', 'value')),
                              ('get', 'print a parameter', ('parameter',)),
                              ('list', 'print all parameters, and what they are', ()),
                              ('echo', 'print the next message of a topic', ('topic',)),
                              ('hz', 'count the messages of a topic for 3 s', ('topic',)),
                              ('enable', 'ramp into the gait', ()),
                              ('disable', 'ramp down to the stand', ())):
        action = actions.add_parser(name, help=text, description=text.capitalize() + '.')
        for word in words:
            action.add_argument(word, metavar=word.upper(),
                                type=parameter_value if word == 'value' else str)
    return made


def parameter_value(text: str) -> Any:
    """Read a parameter's value as YAML.

    Raises:
        argparse.ArgumentTypeError: it is of no kind that a parameter can be.

    """
    try:
        value = yaml.safe_load(text)
        Parameter('one', value=value)
    except (yaml.YAMLError, TypeError):
        raise ArgumentTypeError(f"'{text}' is no value of a parameter") from None
    return value


class Asker:
    """Asks a node by its services, and listens to topics."""

    def __init__(self, chosen: Namespace, node: Node) -> None:
        self._chosen, self._node = chosen, node
        self._end = time.monotonic() + chosen.wait

    def _call(self, kind: Any, service: str, request: Any) -> Any:
        name = f'{self._chosen.node}/{service}'
        client = self._node.create_client(kind, name)
        if not client.wait_for_service(max(self._end - time.monotonic(), 0.0)):
            raise Failed(f'{self._chosen.node} does not answer (no service {name})')
        future = client.call_async(request)
        rclpy.spin_until_future_complete(self._node, future,
                                         timeout_sec=max(self._end - time.monotonic(), 0.0))
        if not future.done():
            raise Failed(f'{name} did not answer within {self._chosen.wait:g} s')
        return future.result()

    def do_set(self) -> str:
        """Set a parameter."""
        message = Parameter(self._chosen.parameter, value=self._chosen.value).to_parameter_msg()
        (result,) = self._call(SetParameters, 'set_parameters',
                               SetParameters.Request(parameters=[message])).results
        if not result.successful:
            raise Failed(result.reason)
        return ''

    def do_get(self) -> str:
        """Return a parameter's value."""
        name = self._chosen.parameter
        (value,) = self._call(GetParameters, 'get_parameters',
                              GetParameters.Request(names=[name])).values or [None]
        if value is None or not value.type:
            raise Failed(f"{self._chosen.node} has no parameter '{name}'")
        return str(parameter_value_to_python(value))

    def do_list(self) -> str:
        """Return a line for each parameter."""
        names = sorted(self._call(ListParameters, 'list_parameters',
                                  ListParameters.Request()).result.names)
        found = self._call(DescribeParameters, 'describe_parameters',
                           DescribeParameters.Request(names=names)).descriptors
        return '\n'.join(f'{one.name}  {one.description}' for one in found)

    def do_enable(self) -> str:
        """Ramp up; return the answer."""
        return self._enable(True)

    def do_disable(self) -> str:
        """Ramp down; return the answer."""
        return self._enable(False)

    def _enable(self, up: bool) -> str:
        answer = self._call(SetBool, 'enable', SetBool.Request(data=up))
        if not answer.success:
            raise Failed(answer.message)
        return str(answer.message)

    def _subscribe(self, heard: list[Any]) -> None:
        topic = self._node.resolve_topic_name(self._chosen.topic)
        kinds: list[str] = []
        while not kinds and time.monotonic() < self._end:
            rclpy.spin_once(self._node, timeout_sec=0.05)
            kinds = dict(self._node.get_topic_names_and_types()).get(topic, [])
        if not kinds:
            raise Failed(f'nobody publishes on {topic}')
        package, _, kind = kinds[0].partition('/msg/')
        self._node.create_subscription(getattr(import_module(f'{package}.msg'), kind), topic,
                                       heard.append, qos_profile_sensor_data)

    def do_echo(self) -> str:
        """Return the next message of a topic."""
        heard: list[Any] = []
        self._subscribe(heard)
        while not heard:
            if time.monotonic() > self._end:
                raise Failed(f'nothing came on {self._chosen.topic}')
            rclpy.spin_once(self._node, timeout_sec=0.05)
        message = heard[0]
        return '\n'.join(f'{field}: {getattr(message, field)}'
                         for field in message.get_fields_and_field_types())

    def do_hz(self) -> str:
        """Return how many messages a second come on a topic."""
        heard: list[Any] = []
        self._subscribe(heard)
        end = time.monotonic() + 3.0
        while time.monotonic() < end:
            rclpy.spin_once(self._node, timeout_sec=0.05)
        return f'{len(heard) / 3.0:.1f} Hz'


def main(arguments: Sequence[str] | None = None) -> int:
    """Do one thing; return the exit code."""
    chosen = parser().parse_args(arguments)
    try:
        rclpy.init(args=[])
        told = getattr(Asker(chosen, rclpy.create_node('cpg', enable_rosout=False)),
                       f'do_{chosen.action}')()
    except CpgError as error:
        print(f'cpg: {error}', file=sys.stderr)
        return 1
    except (NameValidationException, RuntimeError) as error:
        # The name of a node or topic, or the domain in the environment.
        print(f'cpg: {str(error).splitlines()[0]}', file=sys.stderr)
        return 2
    except KeyboardInterrupt:
        return 130
    finally:
        try_shutdown()
    if told:
        say(told)
    return 0


if __name__ == '__main__':
    sys.exit(main())
