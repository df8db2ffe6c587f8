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

"""Analyse a parameter set before you run it on a robot: the equilibrium and its Hopf points, the
gaits as exact periodic orbits, and whether each gait attracts in the full network and with the
symmetry lock. Works without a ROS graph.
"""

from argparse import Namespace
from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path
import sys

from cpg_ros.analysis.analysis_report import Analysis, EquilibriumReport, PhaseReport
from cpg_ros.common.command_line import as_json, interval, number, Parser, progress_bar, run, say
from cpg_ros.common.errors import InputError
from cpg_ros.common.files import write_atomically
from cpg_ros.dynamics.arclength import NoOrbit
from cpg_ros.dynamics.solve_orbit import solve_preset
from cpg_ros.dynamics.stability import verdicts
from cpg_ros.networks.network import ParameterLine
from cpg_ros.networks.network_options import add_network_options, preset_from
from cpg_ros.networks.registry import SHIPPED
import numpy as np

EPILOG = """\
examples:
  analyze --network delayed --set a=-4.5 b=1 c=6.5 d=-2 tau=0.4 --plot branches.png
  analyze --network quadruped --preset pace --along gamma=delta --range -0.6:0.2
  analyze --network biped --set w_a=0.2 current=0.25 --json
  analyze --presets optimized/preset.yaml --all-orbits
  analyze --network quadruped --preset trot --prc trot_prc.png
  analyze --network biped --preset run --basin 200 --seed 1
  analyze --network delayed --preset liu2024_trot --equilibria --along c --range 1:8

exit codes: 0 analysed (even if no gait was found), 2 invalid arguments."""
#: Up to which Hopf points can be searched for, model time.
MAX_DELAY = 100.0
#: Random states of a basin.
MAX_STATES = 1_000_000


def _parser() -> Parser:
    parser = Parser(prog='analyze', description=__doc__, epilog=EPILOG)
    add_network_options(parser)
    parser.add_argument('--longest-delay', type=number, metavar='TAU', help='find Hopf points of '
                        'the delayed network up to this delay, model time (default: twice tau)')
    parser.add_argument('--along', metavar='PARAMETERS', help='parameters to vary for the Hopf '
                        'points of networks without delay, and for the branches of --plot: gamma, '
                        'or alpha=beta together, or alpha=-beta (default: ' + '; '.join(
                            f'{name}: {kind.line}' if kind.span else kind.line
                            for name, kind in SHIPPED.items()) + ')')
    parser.add_argument('--range', type=interval, metavar='LOW:HIGH', help='range of --along '
                        '(default: ' + ', '.join(
                            f'{name} {kind.span[0]:g}:{kind.span[1]:g}'
                            for name, kind in SHIPPED.items() if kind.span) + ')')
    parser.add_argument('--all-orbits', action='store_true', help='look for all coexisting orbits '
                        'of every gait, from more starts, on the branches of its Hopf points '
                        'and by deflation; takes 1 to 3 s a gait')
    parser.add_argument('--equilibria', action='store_true', help='also find the equilibria at '
                        'which cells differ, in which a network can freeze, and the folds, '
                        'pitchforks and Hopf points of all along --along')
    parser.add_argument('--json', action='store_true', help='print JSON instead of tables')
    parser.add_argument('--plot', type=Path, metavar='FILE', help='draw the branches, the roots, '
                        'trajectories and footfalls (.png, .pdf or .svg)')
    parser.add_argument('--prc', type=Path, nargs='?', const=Path(), metavar='FILE',
                        help='also print the phase response of each gait to inputs to one cell, '
                        'and, given a FILE, draw its curves (.png, .pdf or .svg)')
    parser.add_argument('--basin', type=int, metavar='N', help='also run the network from N '
                        'random states for each gait and report the fraction that returns to it')
    parser.add_argument('--seed', type=int, metavar='S', help='of the random states of --basin '
                        '(default: 0)')
    return parser


def _analysed(args: Namespace) -> Analysis:
    for option, file in (('--plot', args.plot), ('--prc', args.prc)):
        if file is not None and not file.absolute().parent.is_dir():
            raise InputError(f'{option}: there is no folder {file.parent}')
    if args.basin is not None and not 1 <= args.basin <= MAX_STATES:
        raise InputError(f'--basin: {args.basin} is not from 1 to {MAX_STATES}')
    if args.seed is not None and (args.basin is None or args.seed < 0):
        raise InputError('--seed: it must be 0 or more, and goes with --basin')
    preset, network = preset_from(args)
    longest = 2.0 * network.delay if args.longest_delay is None else args.longest_delay
    if not 0.0 <= longest <= MAX_DELAY:
        raise InputError(f'--longest-delay: {longest:g} is not from 0 to {MAX_DELAY:g}')
    span = network.span or (0.0, max(longest, 1.01 * network.delay))
    try:
        along = ParameterLine.parse(args.along or network.line, type(network))
    except InputError as error:
        raise InputError(f'--along: {error}') from error
    if args.range is not None:
        span = args.range
    elif network.span is None and str(along) != network.line:
        raise InputError(f'--along: {along} needs a --range')
    if not np.isfinite(span).all() or span[0] >= span[1]:
        raise InputError(f'--range: {span[0]:g}:{span[1]:g} is not from low to high')
    near = None
    if args.presets and preset.start is not None:
        # A start that leads nowhere is no worse than none.
        with suppress(NoOrbit):
            near = solve_preset(preset)
    with progress_bar('gaits', len(network.gaits())) as bar:
        gaits = verdicts(network, bar, near, args.all_orbits)
    return Analysis(network, gaits, along, span, longest)


def _analyze(args: Namespace) -> int:
    # --prc may stand without a file.
    curves = None if args.prc == Path() else args.prc
    for option, path in (('--plot', args.plot), ('--prc', curves)):
        if path is not None:
            # matplotlib takes half a second, and only pictures need it.
            from cpg_ros.analysis.analysis_plot import check_suffix
            check_suffix(option, path.suffix)
    analysis = _analysed(args)
    answer, text = analysis.as_dict() if args.json else {}, [] if args.json else [analysis.text()]
    if args.plot is not None:
        from cpg_ros.analysis.analysis_plot import picture
        from cpg_ros.analysis.branch_report import assess_branches
        assessed = assess_branches(analysis)
        write_atomically(args.plot, picture(analysis, assessed, args.plot.suffix))
        losses = [loss for branch in assessed for loss in branch.losses]
        answer['stability_losses'] = [loss.as_dict() for loss in losses]
        text += ['', *(loss.text(str(analysis.along)) for loss in losses)] if losses else []
    if args.equilibria:
        equilibria = EquilibriumReport.of(analysis)
        answer['equilibria'] = equilibria.as_dict()
        text += ['', equilibria.text()]
    if args.prc is not None:
        response = PhaseReport.of(analysis)
        if curves is not None:
            from cpg_ros.analysis import analysis_plot
            write_atomically(curves, analysis_plot.phase_picture(response, curves.suffix))
        answer['phase_response'] = response.as_dict()
        text += ['', response.text()]
    if args.basin is not None:
        # Import here, as it takes long to load.
        from cpg_ros.analysis import basin
        basins = basin.basins(analysis, args.basin, args.seed or 0)
        answer['basins'] = basin.as_dict(basins)
        text += ['', basin.text(basins)]
    say(as_json(answer) if args.json else '\n'.join(text))
    return 0


def main(arguments: Sequence[str] | None = None) -> int:
    """Analyse a parameter set; return the exit code."""
    return run(_parser(), _analyze, arguments)


if __name__ == '__main__':
    sys.exit(main())
