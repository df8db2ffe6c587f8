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

"""A robot that walks in simulation: starts a generator and a body, and tours the gaits.

``ros2 run cpg_ros demo``: two nodes run as a user would start them, this one sets the
generator's parameter ``gait``, by itself or as typed. A film and a footfall diagram are left.
"""

from argparse import HelpFormatter, Namespace
import asyncio
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, ExitStack
from importlib.util import find_spec
from pathlib import Path
import queue
import signal
import socket
import subprocess
import sys
import threading
import time

from ament_index_python.packages import get_package_prefix
from cpg_ros.errors import CpgError, InputError
from cpg_ros.nodes.node_client import CallError, NodeClient, RequestRefused, ServiceClients
from cpg_ros.nodes.qos_profiles import latched
from cpg_ros.tools import demo_course
from cpg_ros.tools.command_line import Parser, run, say
from nav_msgs.msg import Odometry
import rclpy
from rclpy.node import Node
from rclpy.signals import SignalHandlerOptions
from rclpy.utilities import try_shutdown
from std_msgs.msg import String

TOUR = ('trot', 'walk', 'pace', 'bound', 'jump', 'pronk', 'trot')
SIX_LEGS = ('tripod', 'ripple', 'wave', 'tripod')
#: A node must answer within this time, s: the very first start compiles for 20 s.
PATIENCE = 120.0
#: Where the page is, if the port is free.
PORT = 8080
#: The generator and the body are in step at this rate, Hz.
RATE = 500


class DemoError(CpgError):
    """The demonstration cannot go on; one line for the user."""

    exit_code = 1


class Operator(Node):
    """Sets the gait of the generator and knows where the robot is, and its time in s.

    Attributes:
        taken_over: whether somebody else has set another gait.

    """

    def __init__(self, gait: str) -> None:
        super().__init__('cpg_demo')
        self.place: tuple[float, float] | None = None
        self.time = 0.0
        self._generator = NodeClient(ServiceClients(self), 'cpg_generator')
        self._asked, self.taken_over, self._heard = gait, False, False
        self.create_subscription(Odometry, 'odom', self._odom, 1)
        # As it is published: a gait that was chosen before the two had found each other counts.
        self.create_subscription(String, 'cpg_generator/gait', self._gait, latched(10))

    def _odom(self, message: Odometry) -> None:
        self.place = message.pose.pose.position.x, message.pose.pose.position.y
        self.time = message.header.stamp.sec + 1e-9 * message.header.stamp.nanosec

    def _gait(self, message: String) -> None:
        # Who chooses a gait on the page, or by a parameter, has ended the tour.
        self._heard = True
        self.taken_over |= message.data != self._asked

    def alone(self) -> None:
        """Go on if these are the only robot and the only generator.

        Raises:
            DemoError: there is another one; it may have been there before ours.

        """
        for topic, who in (('lh/joint_states', 'generator'), ('odom', 'robot')):
            if self.count_publishers(topic) > 1:
                raise DemoError(f'there is another {who} in this ROS domain: stop it, or set '
                                'another ROS_DOMAIN_ID')

    def switch(self, gait: str) -> str:
        """Set the gait; return why that was refused, or ''.

        Raises:
            DemoError: the generator does not answer.

        """
        self._asked = gait
        try:
            asyncio.run(self._generator.set_parameters({'gait': gait}, 10.0))
        except RequestRefused as error:
            return str(error)
        except CallError as error:
            raise DemoError('the generator does not answer') from error
        return ''

    @property
    def ready(self) -> bool:
        """Whether the body moves, as it does once it is commanded, and the generator is heard."""
        return self.place is not None and self._heard


@contextmanager
def running(*arguments: str) -> Iterator[subprocess.Popen]:
    """Run one of this package's nodes, out of reach of Ctrl-C, and end it whatever happens."""
    executable, *ros = arguments
    process = subprocess.Popen(
        [f'{get_package_prefix("cpg_ros")}/lib/cpg_ros/{executable}', '--ros-args', *ros],
        # In a session of its own: a terminal's Ctrl-C would reach it beside our own signal.
        start_new_session=True, stdin=subprocess.DEVNULL)
    try:
        yield process
    finally:
        process.terminate()
        process.wait()


def free_port() -> int:
    """Return the usual port, or another one where that is taken."""
    for port in (PORT, 0):
        try:
            with socket.create_server(('127.0.0.1', port)) as one:
                return int(one.getsockname()[1])
        except OSError:
            continue
    return PORT


class Interruption:
    """What ends the demonstration from outside: a signal, or the end of a node.

    A signal is only noted, and acted upon where that is safe: raised in the midst of starting a
    node, an exception would leave that one behind.

    Attributes:
        nodes: to watch.

    """

    def __init__(self) -> None:
        self.nodes: list[subprocess.Popen] = []
        self._noted = False
        for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
            signal.signal(number, self._note)

    def _note(self, *_: object) -> None:
        # Whoever presses Ctrl-C again wants the film to be cut short.
        for node in self.nodes if self._noted else ():
            node.terminate()
        self._noted = True

    def look(self) -> None:
        """Go on if there is nothing.

        Raises:
            KeyboardInterrupt: there was a signal.
            DemoError: a node ended.

        """
        if self._noted:
            raise KeyboardInterrupt
        for node in self.nodes:
            if node.poll() is not None:
                raise DemoError(f'a node ended with exit code {node.returncode}')


def typed() -> queue.Queue:
    """Return a queue of the lines that are typed, and None where they end."""
    lines: queue.Queue = queue.Queue()

    def read() -> None:
        # There is none where it was closed; what is no text may come through a pipe.
        if sys.stdin is not None:
            sys.stdin.reconfigure(errors='replace')  # type: ignore[union-attr]
            for line in sys.stdin:
                lines.put(line.strip())
        lines.put(None)

    threading.Thread(target=read, daemon=True).start()
    return lines


def guide(operator: Operator, gaits: Sequence[str], every: float | None,
          interruption: Interruption) -> None:
    """Take the robot through the gaits, until a line is typed or a gait chosen elsewhere.

    Without a time for each it stays with the first one until something is typed.

    Where what is typed ends, as in ``echo walk | demo``, the last gait has its time, too.

    Raises:
        DemoError: a node ended, does not answer, or is not the only one.

    """
    # In the robot's own time, which goes slowly on a slow machine.
    lines, tour, began = typed(), list(gaits[1:]), operator.time
    due = None if every is None else began + every

    def report(text: str) -> None:
        x, y = operator.place or (0.0, 0.0)
        say(f'{operator.time - began:5.1f} s  {text:<10} at x {x:6.2f} m, y {y:6.2f} m')

    report(gaits[0])
    while tour or due is None or operator.time < due:
        rclpy.spin_once(operator, timeout_sec=0.05)
        interruption.look()
        operator.alone()
        wanted = None
        if operator.taken_over:
            tour, due = [], None
        if not lines.empty():
            wanted = lines.get()
            if wanted == 'q':
                return
            if wanted is not None:
                tour, due = [], None
            elif due is None and every is not None:
                due = operator.time + every
        elif tour and due is not None and operator.time >= due:
            wanted, due = tour.pop(0), due + (every or 0.0)
        if wanted:
            report(operator.switch(wanted) or wanted)


def wait_for(operator: Operator, interruption: Interruption) -> None:
    """Wait until the robot stands in its simulation and the generator serves.

    Raises:
        DemoError: a node ended, or took too long.

    """
    end = time.monotonic() + PATIENCE
    while not operator.ready:
        rclpy.spin_once(operator, timeout_sec=0.1)
        interruption.look()
        if time.monotonic() > end:
            raise DemoError(f'the nodes were not ready after {PATIENCE:g} s')


def parser() -> Parser:
    """Arguments of the executable."""
    made = Parser(prog='demo', formatter_class=HelpFormatter, description='Simulate a walking '
                  'Unitree Go2, or a hexapod. Type the name of a gait and Enter to switch to it, '
                  'q to quit.')
    made.add_argument('--gaits', nargs='+', metavar='GAIT', help='tour of gaits (default: '
                      f'{" ".join(TOUR)}; for the hexapod {" ".join(SIX_LEGS)})')
    made.add_argument('--hexapod', action='store_true', help='use a robot with six legs')
    made.add_argument('--course', action='store_true', help='instead of the tour, walk over rough '
                      'ground, a ramp and blocks with feedback, and get pushed on the way')
    made.add_argument('--drive', action='store_true', help='instead of the tour, stand until '
                      'steered from the page or by messages on cmd_vel')
    made.add_argument('--every', type=float, default=6.0, metavar='S',
                      help='seconds of simulated time per gait (default: 6)')
    made.add_argument('--out', type=Path, default=Path('out'), metavar='DIR',
                      help='folder for go2.gif or hexapod.gif and footfalls.png (default: out)')
    made.add_argument('--no-panel', action='store_true', help='do not serve the browser page')
    made.add_argument('--no-film', action='store_true', help='write the footfall diagram only')
    return made


def demonstrate(chosen: Namespace) -> int:
    """Run the demonstration; return 0, or 1 if the nodes failed.

    Raises:
        DemoError: a node ended, does not answer, or is not the only one.
        InputError: options that do not go together.
        OSError: there can be no folder for the files.

    """
    if not chosen.every > 0.0:
        raise InputError(f'argument --every: {chosen.every:g} must be positive')
    if chosen.hexapod and chosen.course:
        raise InputError('argument --course: not with --hexapod, which has no feedback')
    robot, model = ('hexapod', 'hexapod') if chosen.hexapod else ('unitree_go2', 'go2')
    chosen.gaits = chosen.gaits or list(SIX_LEGS if chosen.hexapod else TOUR)
    film, footfalls = chosen.out / f'{model}.gif', chosen.out / 'footfalls.png'
    chosen.out.mkdir(parents=True, exist_ok=True)
    body = ['robot_sim', '-p', 'lockstep:=true', '-p', f'rate:={RATE}.0',
            '-p', f'footfalls:={footfalls}', '-p', f'robot:={robot}', '-p', f'model:={model}']
    if not chosen.no_film:
        body += ['-p', f'film:={film}']
    generator = ['generator', '-p', f'robot:={robot}', '-p', f'gait:={chosen.gaits[0]}',
                 '-p', f'rate:={RATE}.0', '-p', 'combined_topic:=""', '-p', 'use_sim_time:=true']
    if chosen.course:
        body, generator = [*body, *demo_course.GROUND], [*generator, *demo_course.GENERATOR]
    if chosen.drive:
        generator += ['-p', 'cmd_vel:=true']
    port = free_port()
    page = not chosen.no_panel and find_spec('websockets')
    interruption = Interruption()
    nodes = interruption.nodes
    try:
        rclpy.init(args=[], signal_handler_options=SignalHandlerOptions.NO)
        operator = Operator(chosen.gaits[0])
        with ExitStack() as stack:
            for node in (body, generator):
                nodes.append(stack.enter_context(running(*node)))
            if page:
                # The robot walks on without it.
                stack.enter_context(running('panel', '-p', f'port:={port}', '-p',
                                            f'recordings:={chosen.out}'))
            wait_for(operator, interruption)
            if page:
                say(f'watch and drive it in a browser: http://127.0.0.1:{port}/')
            if chosen.course:
                demo_course.Runner(operator).run(interruption.look)
            else:
                say(f"the robot {'waits to be steered' if chosen.drive else 'walks'}; type a gait "
                    'and Enter to switch, q to end')
                guide(operator, chosen.gaits, None if chosen.drive else chosen.every, interruption)
    except KeyboardInterrupt:
        pass
    finally:
        try_shutdown()
    # One that was still starting, and was ended by our signal, did not fail.
    ended = 0, -signal.SIGTERM, 128 + signal.SIGTERM
    return 1 if any(node.returncode not in ended for node in nodes) else 0


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the demonstration; return the exit code."""
    return run(parser(), demonstrate, arguments)


if __name__ == '__main__':
    sys.exit(main())
