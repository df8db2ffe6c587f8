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

"""Executable ``export``: gaits of a robot as C, for microcontrollers and anything without Python.

``export --robot my_robot.yaml --network delayed --gait trot walk --out gait/`` writes network,
readout and gait switching as C99, and a test against the generator.
"""

import argparse
from collections.abc import Sequence
from dataclasses import replace
import math
from pathlib import Path
import sys

from cpg_ros.common.command_line import note, number, Parser, refuse_repeated, run, say, table
from cpg_ros.common.errors import CpgError, InputError
from cpg_ros.common.files import write_atomically
from cpg_ros.motion.export.c_project import CProject, readme, SUBSTEP
from cpg_ros.motion.export.gait_data import CFormat, GaitData
from cpg_ros.motion.export.golden import golden_of
from cpg_ros.motion.plan import GaitPlan, plan, PlanError
from cpg_ros.motion.robot_file import load_robot
from cpg_ros.networks.registry import find_network

DESCRIPTION = """\
Write gaits of a robot as C99 without dependencies: the network's equations, or the orbits of its
gaits as tables; the joints' readout, cross-fades between gaits, the ramp and all limits as in the
generator. With it come a test with golden vectors of the Python generator, and a README."""
EPILOG = """\
example: cpg export --robot quadruped --network delayed --gait trot walk --out gait/
         cc -std=c99 gait/*.c -lm -o test_cpg && ./test_cpg

exit codes: 0 written, 1 a gait cannot run on the robot, 2 invalid arguments."""
#: TOLERANCES: type of numbers -> error of a table, as a fraction of half the range of its values.
TOLERANCES = {'float32': 1e-4, 'float64': 1e-9}
MAX_STEPS = 2000


def _parser() -> Parser:
    parser = Parser(prog='export', description=DESCRIPTION, epilog=EPILOG)
    parser.add_argument('--robot', required=True, metavar='FILE',
                        help='robot file, or the name of a shipped one')
    parser.add_argument('--network', metavar='NAME', help="network, or the path of a Python file "
                        "that defines one (default: the robot's first)")
    parser.add_argument('--gait', dest='gaits', nargs='+', metavar='GAIT', help='gaits or '
                        "presets of the network, the first one at the start (default: the "
                        "network's usual gait)")
    parser.add_argument('--target', choices=('c99', 'arduino'), default='c99',
                        help='plain files, or an Arduino library with an example sketch (default: '
                        '%(default)s)')
    parser.add_argument('--form', choices=('network', 'table'), default='network',
                        help="the network's equations, or the gaits' orbits alone, as tables, for "
                        'the smallest boards (default: %(default)s)')
    parser.add_argument('--real', choices=('float32', 'float64'), default='float32',
                        help='type of all numbers (default: %(default)s)')
    parser.add_argument('--steering', action='store_true', help='strides and pace can be changed: '
                        'for --form network')
    parser.add_argument('--step', type=number, metavar='T', help="model time per step (default: "
                        "the network's own); a longer one saves time and, with a delay, memory")
    parser.add_argument('--substep', type=number, metavar='S',
                        help='longest part of a tick while gaits fade or the ramp moves, s '
                        f'(default: {SUBSTEP:g}, as in the generator); at most one tick on slow '
                        'boards')
    parser.add_argument('--rate', type=number, metavar='HZ', default=1000.0,
                        help='ticks per second of the golden vectors and the sketch, Hz (default: '
                        '%(default)g)')
    parser.add_argument('--frequency', type=number, metavar='HZ', help='strides per second of all '
                        'gaits, Hz (default: as the robot file has it, or else 1)')
    parser.add_argument('--tolerance', type=number, metavar='FRACTION', help='largest error of '
                        "a table, as a fraction of half its signal's range (default: 1e-4 with "
                        'float32, 1e-9 with float64)')
    parser.add_argument('--out', type=Path, required=True, metavar='DIR',
                        help='folder to write to; made if it is not there')
    return parser


def _refuse_options(args: argparse.Namespace) -> None:
    for option, value, low, high in (
            ('step', args.step, 0.0, math.inf), ('substep', args.substep, 0.0, 1.0),
            ('rate', args.rate, 0.0, 1e4), ('frequency', args.frequency, 0.0, 10.0),
            ('tolerance', args.tolerance, 0.0, 0.1)):
        if value is not None and not low < value <= high:
            raise InputError(f'argument --{option}: {value:g} is not above {low:g} and up to '
                             f'{high:g}')
    if args.steering and args.form != 'network':
        raise InputError('argument --steering: needs --form network')
    refuse_repeated('argument --gait', args.gaits or [])
    if args.out.exists() and not args.out.is_dir():
        raise InputError(f'argument --out: {args.out} is not a directory')


def _plans(args: argparse.Namespace) -> list[GaitPlan]:
    robot = load_robot(args.robot)
    network = find_network(args.network or robot.networks[0])
    if network.name not in robot.networks:
        raise InputError(f"argument --network: '{network.name}' does not drive {robot.name}, "
                         f'which names {", ".join(robot.networks)}')
    presets, plans = network.presets(), []
    for name in args.gaits or [network.usual_gait]:
        if name not in presets:
            raise InputError(f"argument --gait: '{name}' is not one of {', '.join(presets)}")
        preset = presets[name]
        own = robot.motion(name, preset.gait).frequency
        frequency = args.frequency or (1.0 if own is None else own)
        try:
            made = plan(robot, name, preset, preset.network, frequency)
        except PlanError as error:
            raise PlanError(f'{name}: {error}') from error
        plans.append(replace(made, step=args.step))
    _refuse_step(args.step, plans)
    return plans


def _refuse_step(step: float | None, plans: Sequence[GaitPlan]) -> None:
    """Refuse a step with which a network cannot run."""
    if step is None:
        return
    shortest = min(plan.orbit.network.delay or plan.orbit.period / 8.0 for plan in plans)
    longest = max(plan.orbit.network.delay for plan in plans)
    if not longest / MAX_STEPS <= step <= shortest:
        raise InputError(f'argument --step: {step:g} is not from {longest / MAX_STEPS:g} to '
                         f'{shortest:g}')


def _title(plans: Sequence[GaitPlan]) -> str:
    first = plans[0]
    return (f'Gaits of {first.robot.name} by the network {first.orbit.network.name}: '
            f'{", ".join(plan.name for plan in plans)}')


def _export(args: argparse.Namespace) -> int:
    _refuse_options(args)
    plans = _plans(args)
    data = GaitData(plans, CFormat(args.form, args.real, args.tolerance or TOLERANCES[args.real],
                                   args.steering))
    project = CProject(data, _title(plans), args.substep or SUBSTEP)
    try:
        golden = golden_of(data, 1.0 / args.rate, project.substep)
    except CpgError as error:
        raise InputError(f'the golden vectors cannot be made: {error}') from error
    arduino = args.target == 'arduino'
    files = project.files(golden, arduino)
    files['README.md'] = readme(project, golden, args.command, arduino)
    _write(args.out, files)
    note('export', f'state {project.ram} bytes, constants {data.bytes} bytes; {golden.switches} '
         'switches in the test')
    return 0


def _write(folder: Path, files: dict[str, str]) -> None:
    for name, text in files.items():
        path = folder / name
        path.parent.mkdir(parents=True, exist_ok=True)
        write_atomically(path, text)
    say('\n'.join(table([('file', 'bytes'), *((str(folder / name), str(len(text)))
                                              for name, text in files.items())], '<>')))


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the export; return the exit code."""
    return run(_parser(), _export, arguments, 'stopped')


if __name__ == '__main__':
    sys.exit(main())
