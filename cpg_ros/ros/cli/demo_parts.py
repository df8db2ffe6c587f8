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

"""Parts of the demonstration: its node, its processes, and the steps from a URDF to a robot.

Each step is an executable of its own, whose files stay in a folder and are reused.
"""

from argparse import ArgumentParser, Namespace
import asyncio
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from datetime import datetime
import os
from pathlib import Path
import signal
import subprocess
import time

from cpg_ros.common.command_line import number, say
from cpg_ros.common.errors import CpgError, InputError
from cpg_ros.motion.description import load_urdf
from cpg_ros.motion.robot import Motion
from cpg_ros.motion.robot_file import load_robot
from cpg_ros.networks.registry import NETWORKS
from cpg_ros.ros.cli.executables import command
from cpg_ros.ros.kernels import StartProgress
from cpg_ros.ros.node.client import CallError, NodeClient, RequestRefused, ServiceClients
from cpg_ros.ros.node.polled import latched
from cpg_ros.simulation.robot_model import find_model
from cpg_ros.simulation.robot_setup.leg_chains import DIRECTIONS
from geometry_msgs.msg import Pose, Quaternion
from nav_msgs.msg import Odometry
from rclpy.node import Node
from std_msgs.msg import String

# The demonstration's node: it sets the gait of the generator, and follows the robot.

class DemoError(CpgError):
    """The demonstration cannot continue; the message is one line for the user."""

    exit_code = 1


class Operator(Node):
    """Node that sets the generator's gait, and follows the robot.

    Attributes:
        pose: of the robot's base; None until it is known.
        time: of the robot's simulation, s.
        taken_over: whether another client has set another gait.

    """

    def __init__(self, gait: str) -> None:
        super().__init__('cpg_demo')
        self.pose: Pose | None = None
        self.time = 0.0
        self._generator = NodeClient(ServiceClients(self), 'cpg_generator')
        self._wanted, self.taken_over, self._heard = gait, False, False
        self.create_subscription(Odometry, 'odom', self._odom, 1)
        # Latched, as it is published: a gait chosen before discovery counts, too.
        self.create_subscription(String, 'cpg_generator/gait', self._gait, latched(10))

    def _odom(self, message: Odometry) -> None:
        self.pose = message.pose.pose
        self.time = message.header.stamp.sec + 1e-9 * message.header.stamp.nanosec

    def _gait(self, message: String) -> None:
        # A gait that is chosen on the page, or by a parameter, ends the tour.
        self._heard = True
        self.taken_over |= message.data != self._wanted

    def check_alone(self) -> None:
        """Check that these are the only robot and the only generator.

        Raises:
            DemoError: there is another one, perhaps left over.

        """
        for topic, who in (('cpg_generator/phase', 'generator'), ('odom', 'robot')):
            if self.count_publishers(topic) > 1:
                raise DemoError(f'there is another {who} in this ROS domain: stop it, or set '
                                'another ROS_DOMAIN_ID')

    def switch(self, gait: str) -> str:
        """Set the gait; return why the generator refused it, or ''.

        Raises:
            DemoError: the generator does not answer.

        """
        self._wanted = gait
        try:
            asyncio.run(self._generator.set_parameters({'gait': gait}, 10.0))
        except RequestRefused as error:
            return str(error)
        except CallError as error:
            raise DemoError('the generator does not answer') from error
        return ''

    @property
    def ready(self) -> bool:
        """Whether the body moves and messages of the generator arrive."""
        return self.pose is not None and self._heard

    @property
    def place(self) -> tuple[float, float]:
        """Position of the robot, x and y in m; the origin until it is known."""
        return (0.0, 0.0) if self.pose is None else (self.pose.position.x, self.pose.position.y)

    @property
    def upright(self) -> float:
        """Cosine of the base's lean."""
        rotation = Quaternion() if self.pose is None else self.pose.orientation
        return float(1.0 - 2.0 * (rotation.x**2 + rotation.y**2))


# Processes of the demonstration, and what ends it.

@contextmanager
def running(*arguments: str) -> Iterator[subprocess.Popen]:
    """Run one of the package's nodes out of reach of Ctrl-C; end it in any case."""
    executable, *ros = arguments
    process = subprocess.Popen(
        [*command(executable), '--ros-args', *ros],
        # In a session of its own: a terminal's Ctrl-C would reach it beside our own signal.
        start_new_session=True, stdin=subprocess.DEVNULL)
    try:
        yield process
    finally:
        process.terminate()
        process.wait()


class Interruption:
    """Monitor of the demonstration's end: a signal, or the end of one of its nodes.

    A signal is only recorded, and handled where that is safe: an exception while a node starts
    would leave that node behind.

    Attributes:
        nodes: processes to watch.

    """

    def __init__(self) -> None:
        self.nodes: list[subprocess.Popen] = []
        self._noted = False
        for signal_number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
            signal.signal(signal_number, self._note)

    def _note(self, *_: object) -> None:
        # A second Ctrl-C cuts the film short.
        for node in self.nodes if self._noted else ():
            node.terminate()
        self._noted = True

    def check(self) -> None:
        """Return if nothing has ended it.

        Raises:
            KeyboardInterrupt: a signal arrived.
            DemoError: a node ended.

        """
        if self._noted:
            raise KeyboardInterrupt
        for node in self.nodes:
            if node.poll() is not None:
                raise DemoError(f'a node ended with exit code {node.returncode}')


#: TOUR_GAITS: gaits in which a robot of one's own is driven, if its network has them.
TOUR_GAITS = ('trot', 'walk', 'tripod', 'wave')
#: Durations on a machine of 2023, s. MAKE_TIME: of making a robot file; TUNE_OVERHEAD: fixed part
#: of a gait's tuning; PLAN_TIME: part of each design that runs on one core; SIMULATION_TIME: part
#: that is divided by the number of cores.
MAKE_TIME, TUNE_OVERHEAD, PLAN_TIME, SIMULATION_TIME = 5.0, 30.0, 0.3, 0.6
#: EVALUATIONS: number of designs that are tried for each gait.
EVALUATIONS = 120
#: SERVO_GAINS: options of gains, which the simulation takes as well.
SERVO_GAINS = 'kp', 'kd'
#: STOP_TIMEOUT: longest time for a stopped step to end, s.
STOP_TIMEOUT = 10.0


class StepFailed(CpgError):
    """A setup step failed; its error is already printed."""

    def __init__(self, code: int) -> None:
        super().__init__('a step failed')
        self.code = code


@dataclass(frozen=True)
class DemoRobot:
    """A robot that is ready for the demonstration.

    Attributes:
        file: robot file with tuned gaits.
        model: for the simulation.
        name: for files.
        gaits: tuned ones, the initial one first.
        steered: whether the initial gait follows velocity commands.
        network: of the robot, '' for the generator's own choice.
        unjudged: whether it is a user's robot whose file does not state whether feedback helps.

    """

    file: str
    model: str
    name: str
    gaits: tuple[str, ...]
    steered: bool
    network: str = ''
    unjudged: bool = False


def add_options(parser: ArgumentParser) -> None:
    """Add the options that select a user's own robot."""
    parser.add_argument('--forward', choices=DIRECTIONS, help='with --urdf: direction in which '
                        'the robot faces, where check_robot asks for it; other than x, a URDF '
                        'that is turned to x is written beside the file, and used')
    parser.add_argument('--legs', nargs='+', metavar='LEG=TEXT', help='with --urdf or --mjcf: the '
                        'legs, each with a part of the names of its joints, such as lf=leg1_')
    parser.add_argument('--velocity', type=number, metavar='RAD/S', help="with --urdf or --mjcf: "
                        "velocity limit of all joints instead of the file's")
    parser.add_argument('--evaluations', type=int, metavar='N', help='with --urdf or --mjcf: '
                        f'designs to try for each gait (default: {EVALUATIONS}, half of those of '
                        'tune, in half the time)')
    parser.add_argument('--kp', type=number, metavar='NM', help='with --urdf or --mjcf: '
                        'proportional gain of the joints, N m/rad, to tune and to drive it with '
                        "(default: a Go2's, scaled to the robot's mass, higher for slow servos)")
    parser.add_argument('--kd', type=number, metavar='NMS', help='damping gain of the joints, '
                        'N m s/rad, likewise')


def name_of(args: Namespace) -> str:
    """Return the name of a user's own robot, from its file, or ''.

    Raises:
        CpgError: there is no such file, it is no URDF, or options do not go together.

    """
    if args.urdf is None and args.mjcf is None:
        for option in ('forward', 'legs', 'velocity', 'evaluations', *SERVO_GAINS):
            if getattr(args, option) is not None:
                raise InputError(f'argument --{option}: only with --urdf or --mjcf')
        return ''
    if args.evaluations is not None and args.evaluations < 1:
        raise InputError(f'argument --evaluations: {args.evaluations} is not positive')
    if args.urdf is None:
        return find_model(args.mjcf).stem
    if args.forward not in (None, 'x'):
        from cpg_ros.simulation.robot_setup.check_robot import facing_x, turned
        path = facing_x(args.urdf)
        args.urdf, args.forward = path if path.exists() else turned(args.urdf, args.forward), 'x'
        say(f'the robot of {args.urdf} faces x')
    load_urdf(args.urdf)
    return str(args.urdf.stem)


class Steps:
    """Runner of steps, which the page shows."""

    def __init__(self, node: Node, check: Callable[[], None]) -> None:
        """Announce steps by ``node``; ``check`` raises what ends the demonstration."""
        self._node, self._check, self._count = node, check, 0

    def run(self, what: str, seconds: float, words: Sequence[str]) -> int:
        """Run an executable, ``words``, for about ``seconds``; return its exit code."""
        self._count += 1
        say(f'step {self._count}: {what}, about {seconds:.0f} s (Ctrl-C stops it)')
        progress = StartProgress(self._node, what, seconds)
        process = subprocess.Popen([*command(words[0]), *words[1:]], stdin=subprocess.DEVNULL,
                                   start_new_session=True)
        try:
            while process.poll() is None:
                self._check()
                time.sleep(0.1)
        finally:
            progress.end()
            _end(process)
        say(f'step {self._count}: took {progress.passed:.0f} s')
        return process.returncode


def _end(process: subprocess.Popen) -> None:
    """Stop a step as Ctrl-C would, so that it ends its workers and leaves no partial files."""
    for number_of in (signal.SIGINT, signal.SIGKILL):
        if process.poll() is None:
            with suppress(ProcessLookupError):
                os.killpg(process.pid, number_of)
            with suppress(subprocess.TimeoutExpired):
                process.wait(STOP_TIMEOUT)


def prepare(args: Namespace, steps: Steps) -> DemoRobot:
    """Create a robot's file and tune it, or reuse the folder's files.

    Raises:
        StepFailed: a step failed.
        RobotError: an existing file cannot be used.

    """
    name = name_of(args)
    source = ['--urdf', str(args.urdf)] if args.urdf is not None else ['--mjcf', args.mjcf]
    file, tuned = (args.out / f'{name}{end}.yaml' for end in ('', '_tuned'))
    say(f'the files of the robot go into {args.out}')
    if file.exists():
        _again(file, find_model(source[1]), 'velocity', args)
    else:
        options = [] if args.velocity is None else ['--velocity', f'{args.velocity:g}']
        if args.forward:
            options += ['--forward', args.forward]
        if args.legs:
            options += ['--legs', *args.legs]
        code = steps.run(f'making {file} from {source[1]}', MAKE_TIME,
                          ['check_robot', *source, '--make', str(file), *options])
        if not file.exists():
            raise StepFailed(code)
    robot = load_robot(str(file))
    if tuned.exists():
        _again(tuned, file, 'evaluations', args)
    else:
        own = NETWORKS[robot.networks[0]].gaits()
        gaits = args.tour or [gait for gait in TOUR_GAITS if gait in own]
        _tune(args, steps, (file, tuned), gaits)
    robot = load_robot(str(tuned))
    gaits, steered = _ranked(robot.motions)
    say('gaits, best first: ' + ', '.join(
        f'{gait} ({robot.motions[gait].verdict or "not judged"})' for gait in gaits))
    if robot.motions[gaits[0]].verdict.startswith('poor'):
        say(f'no gait is good: the robot begins with the {gaits[0]}, which is poor')
    return DemoRobot(str(tuned.absolute()), source[1], name, gaits, steered,
                     unjudged=robot.feedback is None)


def _again(file: Path, source: Path, option: str, args: Namespace) -> None:
    """Report that a file is reused; refuse an option that would have changed it."""
    if getattr(args, option) is not None:
        raise InputError(f'argument --{option}: {file} exists already; delete it, or give '
                         'another folder with --out')
    mtime = file.stat().st_mtime
    later = f', though {source} has changed since' if source.stat().st_mtime > mtime else ''
    say(f'using {file} of {datetime.fromtimestamp(mtime):%Y-%m-%d %H:%M} again{later}; delete it '
        'to regenerate it')


def _tune(args: Namespace, steps: Steps, files: tuple[Path, Path], gaits: Sequence[str]) -> None:
    """Tune gaits one by one, each on all cores and with its own progress."""
    file, tuned = files
    source, evaluations = str(args.urdf or args.mjcf), args.evaluations or EVALUATIONS
    gains = [word for name in SERVO_GAINS if (gain := getattr(args, name)) is not None
             for word in (f'--{name}', f'{gain:g}')]
    seconds = TUNE_OVERHEAD + evaluations * (PLAN_TIME + SIMULATION_TIME / (os.cpu_count() or 1))
    codes = []
    for gait in gaits:
        codes.append(steps.run(
            f'tuning the {gait} in simulation', seconds,
            ['tune', '--robot', str(tuned if tuned.exists() else file), '--model', source,
             '--gait', gait, '--evaluations', str(evaluations), '--out', str(tuned), *gains]))
        if codes[-1] not in (0, 1):
            break
    if not tuned.exists():
        raise StepFailed(codes[-1])
    if 0 not in codes:
        say(f'no gait is good: delete {tuned}, and search longer with --evaluations '
            f'{2 * evaluations}, or give stiffer joints with --kp and --kd')


def _ranked(motions: dict[str, Motion]) -> tuple[tuple[str, ...], bool]:
    """Return gaits, good ones first, then by speed, and whether the first can be steered.

    Those that need stiffer servos than the robot stands on come last.
    """
    fastest = {gait: motion.steering.speed[-1] if motion.steering is not None else 0.0
               for gait, motion in motions.items()}
    stiff = [gait for gait, motion in motions.items() if motion.steering is not None
             and motion.steering.stiffness]
    gaits = sorted(fastest, key=lambda gait: (motions[gait].verdict.startswith('poor'),
                                              gait in stiff, -fastest[gait]))
    return tuple(gaits), bool(gaits) and fastest[gaits[0]] > 0.0
