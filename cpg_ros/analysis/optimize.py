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

"""Search with NSGA-II for weights that give a network a gait. The objectives to minimise are the
phase errors of the cells, the leading Floquet multiplier of the gait's orbit and, for a gait with
two waveforms, minus their difference in shape. The set selected from the Pareto front has the
smallest phase errors and then the smallest multiplier; it is verified by its exact orbit and under
noise.
"""

import argparse
from collections.abc import Sequence
import csv
from functools import partial
import io
from pathlib import Path
import re
import sys
from typing import Any

from cpg_ros.analysis import gait_diagram
from cpg_ros.analysis.nsga2 import Front, optimise
from cpg_ros.analysis.objectives import APERIODIC, objective_names, PHASE_RESOLUTION, SEARCHABLE
from cpg_ros.common.command_line import (
    assignment,
    named_interval,
    note,
    Parser,
    refuse_repeated,
    run,
    say,
    table,
)
from cpg_ros.common.files import write_atomically
from cpg_ros.common.report_page import rendered
from cpg_ros.common.workers import add_options, executor_for
from cpg_ros.networks.presets import write_presets
import matplotlib
from matplotlib.axes import Axes
import numpy as np

#: Of sets without and with an exact orbit, and of the Pareto front.
INEXACT_COLOUR, EXACT_COLOUR, BEST_COLOUR = '#cbd5e0', '#718096', '#2f855a'
MIN_MULTIPLIER = 1e-6


def write_front(path: Path, front: Front) -> None:
    """Write the front, best set first: variables, objectives and periods, units in the names."""
    names = [variable.name for variable in front.space.variables]
    two = front.scores[0].difference is not None
    errors = [name for name in objective_names(front.space.symmetry) if name.startswith('phase')]
    text = io.StringIO(newline='')
    rows = csv.writer(text)
    rows.writerow([*(f'{name} [1]' for name in names), *errors, 'leading multiplier [1]',
                   *(['difference of waveforms [1]'] if two else []),
                   'period [model time]', 'selected'])
    for score in front.scores:
        parameters = score.network.as_dict()
        values = [parameters[variable.members[0]] for variable in front.space.variables]
        rows.writerow([*values, *(f'{error:.4g}' for error in score.errors),
                       f'{score.stability:.6g}',
                       *([f'{score.difference:.6g}'] if two else []),
                       f'{score.period:.6f}',
                       int(score.network == front.best.preset.network)])
    write_atomically(path, text.getvalue())


def _scatter(axes: Axes, front: Front, x: str, y: str, values: dict[str, np.ndarray]) -> None:
    """Draw two objectives of all sets; the front and the selected set stand out."""
    on = np.array([score.network in {entry.network for entry in front.scores}
                   for score in front.tried])
    selected = np.array([score.network == front.best.preset.network for score in front.tried])
    exact = np.array([score.exact for score in front.tried])
    axes.scatter(values[x][~exact], values[y][~exact], s=12, color=INEXACT_COLOUR, marker='x',
                 linewidths=0.7, label='tried, multiplier estimated')
    rest = exact & ~on
    axes.scatter(values[x][rest], values[y][rest], s=12, color=EXACT_COLOUR, alpha=0.7,
                 linewidths=0, label='tried, orbit solved')
    axes.scatter(values[x][on], values[y][on], s=22, color=BEST_COLOUR, label='Pareto front',
                 zorder=3)
    axes.scatter(values[x][selected], values[y][selected], s=110, facecolors='none',
                 edgecolors='#1a202c', linewidths=1.3, label='selected', zorder=4)
    for name, scale, limits in ((x, axes.set_xscale, axes.set_xlim),
                                (y, axes.set_yscale, axes.set_ylim)):
        if 'phase' in name:
            scale('log')
            limits(0.5 * PHASE_RESOLUTION, 300.0)
        elif 'multiplier' in name:
            scale('log')
            # Show whole decades, so that there are ticks to label.
            limits(10.0**np.floor(np.log10(0.999 * values[name].min())), 3.0)
    axes.set_xlabel(x)
    axes.set_ylabel(y)


def draw_front(path: Path, front: Front) -> None:
    """Draw objectives against each other, and the selected set's gait."""
    matplotlib.use('Agg')
    from matplotlib import pyplot
    names = objective_names(front.space.symmetry)
    values = dict(zip(names, np.array([score.objectives for score in front.tried]).T, strict=True))
    multiplier = 'leading multiplier a cycle [1]'
    stability = values.pop('leading multiplier [1]')
    exact = np.array([score.exact for score in front.tried])
    values[multiplier] = np.clip(stability, MIN_MULTIPLIER, APERIODIC)
    phases = [name for name in names if name.startswith('phase')]
    worst = 'largest phase error [deg]'
    values[worst] = np.max([values[name] for name in phases], axis=0)
    panels = [(phases[0], phases[1]), (worst, multiplier)]
    if front.best.orbit.waves.max():
        difference = 'difference in shape of the waveforms [1]'
        values[difference] = np.array([score.difference for score in front.tried])
        # Other sets lack the gait's two waveforms.
        values[difference][~exact] = np.nan
        panels.append((difference, multiplier))
    else:
        panels.insert(1, (phases[0], phases[2]))
    figure = pyplot.figure(figsize=(12.0, 7.6), layout='constrained')
    parts: Any = figure.subfigures(2, 1)
    upper, lower = parts
    for axes, (x, y) in zip(upper.subplots(1, len(panels)), panels, strict=True):
        _scatter(axes, front, x, y, values)
        axes.grid(linewidth=0.3)
        axes.spines[['top', 'right']].set_visible(False)
    upper.legend(*axes.get_legend_handles_labels(), fontsize=9, loc='outside lower center',
                 ncols=4, frameon=False)
    axes, orbit = lower.subplots(), front.best.orbit
    gait_diagram.draw(axes, orbit, 'Footfalls and cells of the exact orbit')
    axes.set_xlabel('time [strides]')
    figure.suptitle(f'{front.space.gait.replace("_", " ")} of the {front.space.network.name}: '
                    f'{len(front.tried)} sets tried, {len(front.scores)} on the Pareto front; '
                    f'selected: period {orbit.period:.3f} model time, leading multiplier '
                    f'{front.best.leading:.2g} a cycle', fontsize=11)
    write_atomically(path, rendered(figure, dpi=120))
    pyplot.close(figure)


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
    parser = Parser(prog='optimize', description=__doc__, epilog=EPILOG)
    parser.add_argument('--network', default='biped', metavar='NAME',
                        help=f'{", ".join(SEARCHABLE)}, or the path of a Python file with a '
                        'network (default: %(default)s)')
    parser.add_argument('--gait', required=True, metavar='NAME', help='; '.join(
        f'{name}: {" ".join(network.gaits())}' for name, network in SEARCHABLE.items()))
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
    parser.add_argument('--paper', action='store_true', help='search as Rashidi et al. 2016: '
                        'weights in bits, two-point crossover 0.08, mutation 0.03, the phase '
                        'errors as the only objectives, and the preset for all but the weights')
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


def selected_set(front: Front) -> str:
    """Return the selected set as lines of a name, a value and a unit."""
    best, space = front.best, front.space
    parameters = best.preset.network.as_dict()
    rows = []
    for variable in space.variables:
        members = variable.members if len(variable.members) == 2 else (variable.name,)
        rows.append((' = '.join(members), f'{parameters[variable.members[0]]:.4f}',
                     '' if variable.free else 'given'))
    rows.append(('phase errors', ', '.join(f'{error:.3f}' for error in best.errors), 'degrees'))
    rows.append(('period', f'{best.orbit.period:.4f}', 'model time'))
    rows.append(('leading multiplier', f'{best.leading:.4f}', 'a cycle'))
    if best.orbit.waves.max():
        rows.append(('waveforms differ by', f'{best.differences[0]:.3f}', 'of their RMS'))
    if front.by_phase:
        rows.append(('front by phases alone', f'{len(front.by_phase)} sets, '
                     + ', '.join(phase_ranges(front)), 'degrees'))
    head = (f'{space.gait} of the {space.network.name}: {len(front.tried)} sets tried, '
            f'{len(front.scores)} on the Pareto front; selected:')
    return '\n'.join([head, *(f'  {line}' for line in table(rows, '<><'))])


def phase_ranges(front: Front) -> list[str]:
    """Return the range of each phase error on the front of a search as in the paper, degrees."""
    errors = np.array([score.errors for score in front.by_phase])
    return [f'{low:.2f} to {high:.2f}' for low, high in
            zip(errors.min(axis=0), errors.max(axis=0), strict=True)]


def _optimize(args: argparse.Namespace) -> int:
    for option in ('fix', 'bounds'):
        refuse_repeated(f'argument --{option}', [name for name, _ in getattr(args, option)])
    name = args.name or f'{args.gait}_optimised'
    # An error should end the command before the search.
    args.out.mkdir(parents=True, exist_ok=True)
    with executor_for(max(1, args.islands), args, 'epochs of islands',
                      partial(note, 'optimize')) as executor:
        front = optimise(args.network, args.gait, population=args.population,
                         generations=args.generations, seed=args.seed,
                         bounds=dict(args.bounds), fixed=dict(args.fix),
                         progress=executor is None and sys.stderr.isatty(),
                         islands=args.islands, executor=executor, paper=args.paper)
    write_front(args.out / 'front.csv', front)
    draw_front(args.out / 'front.png', front)
    write_presets(args.out / 'preset.yaml', front.space.network, {name: front.best.preset},
                  f'Found by: {args.command}')
    say(f'{selected_set(front)}\n'
        f'written: front.csv, front.png and preset.yaml (preset {name}) in {args.out}')
    return 0


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the search; return the exit code."""
    return run(_parser(), _optimize, arguments)


if __name__ == '__main__':
    sys.exit(main())
