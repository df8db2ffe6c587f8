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

"""Executable ``optimize``: weights that give a network a gait, found by NSGA-II.

``optimize --network biped --gait skip --seed 0`` prints the set that was chosen and writes the
Pareto front (``front.csv``, ``front.png``) and a preset file that ``generator`` loads.
"""

import argparse
from collections.abc import Sequence
from functools import partial
from pathlib import Path
import re
import sys

from cpg_ros.fleet.options import add_options, executor_for
from cpg_ros.networks.preset_files import write_presets
from cpg_ros.search.nsga2 import Front, optimise
from cpg_ros.search.pareto_front import draw_front, write_front
from cpg_ros.search.search_space import SEARCHED
from cpg_ros.tools.arguments import assignment, named_interval, refuse_repeated
from cpg_ros.tools.command_line import note, Parser, run, say

DESCRIPTION = """\
Search with NSGA-II for weights that give a network a gait. The objectives to minimise are the
phase errors of the cells, the leading Floquet multiplier of the gait's orbit and, for a gait with
two waveforms, minus their difference in shape. The set chosen from the Pareto front has the
smallest phase errors and then the smallest multiplier; it is verified by its exact orbit and under
noise."""
EPILOG = """\
variables: biped, primary gaits: w_a w_b w_c current phi; secondary gaits: six directed weights
such as w_12 (from cell 1 to cell 2), each with its partner under the gait's symmetry, current and
phi; quadruped: alpha beta gamma delta, and xi and eta if --bounds are given for them; hopf and
matsuoka: k_side k_girdle k_diagonal, or for walks the weights that the symmetry makes equal.

files: front.csv, front.png and preset.yaml, for
  ros2 run cpg_ros generator --ros-args -p network:=... -p presets:=FILE -p gait:=NAME

exit codes: 0 found, 1 nothing found, 2 invalid arguments."""


def _name(text: str) -> str:
    if not re.fullmatch(r'[A-Za-z]\w*', text, re.ASCII):
        raise argparse.ArgumentTypeError(f"'{text}' is not a name of letters, digits and _")
    return text


def _parser() -> Parser:
    parser = Parser(prog='optimize', description=DESCRIPTION, epilog=EPILOG)
    parser.add_argument('--network', default='biped', metavar='NAME',
                        help=f'{", ".join(SEARCHED)}, or the path of a Python file with a '
                        'network (default: %(default)s)')
    parser.add_argument('--gait', required=True, metavar='NAME', help='; '.join(
        f'{name}: {" ".join(network.gaits())}' for name, network in SEARCHED.items()))
    parser.add_argument('--population', type=int, default=60, metavar='N',
                        help='parameter sets per generation (default: %(default)s)')
    parser.add_argument('--generations', type=int, default=12, metavar='N',
                        help='number of generations (default: %(default)s)')
    parser.add_argument('--seed', type=int, default=0, metavar='N',
                        help='seed of the search; the same seed gives the same result '
                        '(default: %(default)s)')
    parser.add_argument('--islands', type=int, default=1, metavar='N', help='number of '
                        'populations that evolve separately and exchange their best members, one '
                        'job each; the result depends on this number, but not on the number of '
                        'workers (default: %(default)s)')
    add_options(parser)
    parser.add_argument('--fix', nargs='+', action='extend', default=[], type=assignment,
                        metavar='VARIABLE=VALUE', help='keep variables at a value, such as '
                        'current=0.229 phi=0.254')
    parser.add_argument('--bounds', nargs='+', action='extend', default=[], type=named_interval,
                        metavar='VARIABLE=LOW:HIGH', help='search bounds other than the default, '
                        'such as w_a=-0.5:0.5')
    parser.add_argument('--out', type=Path, default=Path('out'), metavar='DIR',
                        help='folder for the files (default: %(default)s)')
    parser.add_argument('--name', type=_name, help="name of the preset (default: the gait's, "
                        'followed by _optimised)')
    return parser


def table(front: Front) -> str:
    """Say what was chosen, in lines of a name, a value and a unit."""
    chosen, space = front.chosen, front.space
    parameters = chosen.preset.network.as_dict()
    rows = []
    for variable in space.variables:
        members = variable.members if len(variable.members) == 2 else (variable.name,)
        rows.append((' = '.join(members), f'{parameters[variable.members[0]]:.4f}',
                     '' if variable.free else 'given'))
    rows.append(('phase errors', ', '.join(f'{error:.3f}' for error in chosen.errors), 'degrees'))
    rows.append(('period', f'{chosen.orbit.period:.4f}', 'model time'))
    rows.append(('leading multiplier', f'{chosen.leading:.4f}', 'a cycle'))
    if chosen.orbit.waves.max():
        rows.append(('waveforms differ by', f'{chosen.differences[0]:.3f}', 'of their RMS'))
    width, middle = (max(len(row[k]) for row in rows) for k in (0, 1))
    lines = [f'{space.gait} of the {space.network.name}: {len(front.tried)} sets tried, '
             f'{len(front.scores)} on the Pareto front; chosen:']
    return '\n'.join([*lines, *(f'  {name:<{width}}  {value:>{middle}}  {unit}'.rstrip()
                                for name, value, unit in rows)])


def _optimize(chosen: argparse.Namespace) -> int:
    for option in ('fix', 'bounds'):
        refuse_repeated(f'argument --{option}', [name for name, _ in getattr(chosen, option)])
    name = chosen.name or f'{chosen.gait}_optimised'
    # Now, and not when the work is done.
    chosen.out.mkdir(parents=True, exist_ok=True)
    with executor_for(max(1, chosen.islands), chosen, 'epochs of islands',
                      partial(note, 'optimize')) as executor:
        front = optimise(chosen.network, chosen.gait, population=chosen.population,
                         generations=chosen.generations, seed=chosen.seed,
                         bounds=dict(chosen.bounds), fixed=dict(chosen.fix),
                         progress=executor is None and sys.stderr.isatty(),
                         islands=chosen.islands, executor=executor)
    write_front(chosen.out / 'front.csv', front)
    draw_front(chosen.out / 'front.png', front)
    write_presets(chosen.out / 'preset.yaml', front.space.network, {name: front.chosen.preset},
                  f'Found by: {chosen.command}')
    say(f'{table(front)}\n'
        f'written: front.csv, front.png and preset.yaml (preset {name}) in {chosen.out}')
    return 0


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the search; return the exit code."""
    return run(_parser(), _optimize, arguments)


if __name__ == '__main__':
    sys.exit(main())
