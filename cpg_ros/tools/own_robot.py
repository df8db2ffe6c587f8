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

"""The demonstration of a robot of one's own: its robot file is made, and its gaits are tuned.

Each step is an executable of its own, whose files stay in a folder and are used again.
"""

from argparse import ArgumentParser, Namespace
from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import dataclass
from datetime import datetime
import os
from pathlib import Path
import signal
import subprocess
import time

from cpg_ros.errors import CpgError, InputError
from cpg_ros.networks.registry import NETWORKS
from cpg_ros.nodes.start_progress import StartProgress
from cpg_ros.robots.robot import Motion
from cpg_ros.robots.robot_file import load_robot
from cpg_ros.robots.urdf import load_urdf
from cpg_ros.simulation.robot_model import find_model
from cpg_ros.tools.arguments import number
from cpg_ros.tools.command_line import say
from cpg_ros.tools.executables import command
from rclpy.node import Node

#: Gaits that a robot is driven in, of those that its network has.
DRIVEN = ('trot', 'walk', 'tripod', 'wave')
#: How long a robot file takes, and of a gait's tuning what is done besides designs, and a design
#: on one core and on all of them, s, on a machine of 2023.
MADE, BESIDES, PLANNED, SIMULATED = 5.0, 30.0, 0.3, 0.6
#: Designs that are tried for each gait.
EVALUATIONS = 120
#: Options of gains, which the simulation takes as well.
SERVO_GAINS = 'kp', 'kd'
#: How long a step that is stopped may take to end, s.
PATIENCE = 10.0


class StepFailed(CpgError):
    """A step of the way to a driven robot failed, and has said why."""

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
        gaits: that are tuned, the one to begin with first.
        steered: whether it follows commands of speed in that one.
        network: that drives it, '' for the generator's own choice.
        unjudged: whether it is one's own, and its file does not say whether feedback helps.

    """

    file: str
    model: str
    name: str
    gaits: tuple[str, ...]
    steered: bool
    network: str = ''
    unjudged: bool = False


def add_options(parser: ArgumentParser) -> None:
    """Add what chooses a robot of one's own."""
    parser.add_argument('--velocity', type=number, metavar='RAD/S', help="with --urdf or --mjcf: "
                        "velocity limit of all joints instead of the file's")
    parser.add_argument('--evaluations', type=int, metavar='N', help='with --urdf or --mjcf: '
                        f'designs to try for each gait (default: {EVALUATIONS})')
    parser.add_argument('--kp', type=number, metavar='NM', help='with --urdf or --mjcf: '
                        'proportional gain of the joints, N m/rad, to tune and to drive it with '
                        "(default: a Go2's, scaled to the robot's mass; servos are stiffer)")
    parser.add_argument('--kd', type=number, metavar='NMS', help='damping gain of the joints, '
                        'N m s/rad, likewise')


def name_of(chosen: Namespace) -> str:
    """Return what the files of a robot of one's own are called, '' if none is chosen.

    Raises:
        CpgError: there is no such file, it is no URDF, or options do not go together.

    """
    if chosen.urdf is None and chosen.mjcf is None:
        for option in ('velocity', 'evaluations', *SERVO_GAINS):
            if getattr(chosen, option) is not None:
                raise InputError(f'argument --{option}: only with --urdf or --mjcf')
        return ''
    if chosen.evaluations is not None and chosen.evaluations < 1:
        raise InputError(f'argument --evaluations: {chosen.evaluations} is not positive')
    if chosen.urdf is None:
        return find_model(chosen.mjcf).stem
    load_urdf(chosen.urdf)
    return str(chosen.urdf.stem)


class Steps:
    """Announces steps, and waits for each while the page shows it."""

    def __init__(self, node: Node, look: Callable[[], None]) -> None:
        """Prepare.

        Args:
            node: by which the page knows what is waited for.
            look: raises what ends the demonstration.

        """
        self._node, self._look, self._count = node, look, 0

    def take(self, what: str, seconds: float, words: Sequence[str]) -> int:
        """Run an executable; return its exit code.

        Args:
            what: it does.
            seconds: that this takes, about.
            words: the executable and its arguments.

        """
        self._count += 1
        say(f'step {self._count}: {what}, about {seconds:.0f} s (Ctrl-C stops it)')
        progress = StartProgress(self._node, what, seconds)
        process = subprocess.Popen([*command(words[0]), *words[1:]], stdin=subprocess.DEVNULL,
                                   start_new_session=True)
        try:
            while process.poll() is None:
                self._look()
                time.sleep(0.1)
        finally:
            progress.end()
            _end(process)
        say(f'step {self._count}: took {progress.passed:.0f} s')
        return process.returncode


def _end(process: subprocess.Popen) -> None:
    """Stop a step as Ctrl-C would, so that it ends its workers and leaves no half files."""
    for number_of in (signal.SIGINT, signal.SIGKILL):
        if process.poll() is None:
            with suppress(ProcessLookupError):
                os.killpg(process.pid, number_of)
            with suppress(subprocess.TimeoutExpired):
                process.wait(PATIENCE)


def prepare(chosen: Namespace, steps: Steps) -> DemoRobot:
    """Make a robot's file and tune it, or use again what the folder has.

    Args:
        chosen: options of the demonstration.
        steps: what runs them.

    Raises:
        StepFailed: a step failed.
        RobotError: a file that is there already cannot be used.

    """
    name = name_of(chosen)
    source = ['--urdf', str(chosen.urdf)] if chosen.urdf is not None else ['--mjcf', chosen.mjcf]
    file, tuned = (chosen.out / f'{name}{end}.yaml' for end in ('', '_tuned'))
    say(f'the files of the robot go into {chosen.out}')
    if file.exists():
        _again(file, find_model(source[1]), 'velocity', chosen)
    else:
        limit = [] if chosen.velocity is None else ['--velocity', f'{chosen.velocity:g}']
        code = steps.take(f'making {file} from {source[1]}', MADE,
                          ['check_robot', *source, '--make', str(file), *limit])
        if not file.exists():
            raise StepFailed(code)
    robot = load_robot(str(file))
    if tuned.exists():
        _again(tuned, file, 'evaluations', chosen)
    else:
        own = NETWORKS[robot.networks[0]].gaits()
        gaits = chosen.tour or [gait for gait in DRIVEN if gait in own]
        _tune(chosen, steps, (file, tuned), gaits)
    robot = load_robot(str(tuned))
    gaits, steered = _ranked(robot.motions)
    return DemoRobot(str(tuned.absolute()), source[1], name, gaits, steered,
                     unjudged=robot.feedback is None)


def _again(file: Path, source: Path, option: str, chosen: Namespace) -> None:
    """Say that a file is used again; refuse an option that would have changed it."""
    if getattr(chosen, option) is not None:
        raise InputError(f'argument --{option}: {file} is there already; delete it, or give '
                         'another folder with --out')
    made = file.stat().st_mtime
    later = f', though {source} has changed since' if source.stat().st_mtime > made else ''
    say(f'{file} of {datetime.fromtimestamp(made):%Y-%m-%d %H:%M} is used again{later}; delete it '
        'to make it anew')


def _tune(chosen: Namespace, steps: Steps, files: tuple[Path, Path], gaits: Sequence[str]) -> None:
    """Tune gaits one by one: each on all cores, and with a progress of its own."""
    file, tuned = files
    source, evaluations = str(chosen.urdf or chosen.mjcf), chosen.evaluations or EVALUATIONS
    gains = [word for name in SERVO_GAINS if (gain := getattr(chosen, name)) is not None
             for word in (f'--{name}', f'{gain:g}')]
    seconds = BESIDES + evaluations * (PLANNED + SIMULATED / (os.cpu_count() or 1))
    codes = []
    for gait in gaits:
        codes.append(steps.take(
            f'tuning the {gait} in simulation', seconds,
            ['tune', '--robot', str(tuned if tuned.exists() else file), '--model', source,
             '--gaits', gait, '--evaluations', str(evaluations), '--out', str(tuned), *gains]))
        if codes[-1] not in (0, 1):
            break
    if not tuned.exists():
        raise StepFailed(codes[-1])
    if 0 not in codes:
        say(f'no gait is good: delete {tuned}, and --evaluations {2 * evaluations} searches for '
            'longer, --kp and --kd give stiffer joints')


def _ranked(motions: dict[str, Motion]) -> tuple[tuple[str, ...], bool]:
    """Return gaits, those that go fastest when steered first, and whether the first can be."""
    fastest = {gait: motion.steering.speed[-1] if motion.steering is not None else 0.0
               for gait, motion in motions.items()}
    gaits = sorted(fastest, key=lambda gait: -fastest[gait])
    return tuple(gaits), bool(gaits) and fastest[gaits[0]] > 0.0
