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

"""Executable ``analyze``: what a parameter set does, before it runs on a robot.

``analyze --network delayed --set a=-4.5 b=1 c=6.5 d=-2 tau=0.4`` tells whether the set oscillates,
in which gaits, from which delay on, how large and how fast, and how stable each gait is: on the
centre manifold, in the full network, and with the symmetry lock.
"""

from argparse import Namespace
from collections.abc import Sequence
from pathlib import Path
import sys

from cpg_ros.dynamics.gait_assessment import verdicts
from cpg_ros.errors import InputError
from cpg_ros.files.atomic_write import write_atomically
from cpg_ros.files.plain_text import as_json
from cpg_ros.files.progress_bar import progress_bar
from cpg_ros.networks.parameter_line import ParameterLine
from cpg_ros.networks.registry import SHIPPED
from cpg_ros.tools.analysis_report import Analysis
from cpg_ros.tools.arguments import interval, number
from cpg_ros.tools.command_line import Parser, run, say
from cpg_ros.tools.network_options import add_network_options, chosen_network
import numpy as np

DESCRIPTION = """\
Analyse a parameter set before you run it on a robot: the rest state and its Hopf points, the gaits
as exact periodic orbits, and whether each gait attracts in the full network and with the symmetry
lock. Works without a ROS graph."""
EPILOG = """\
examples:
  analyze --network delayed --set a=-4.5 b=1 c=6.5 d=-2 tau=0.4 --plot branches.png
  analyze --network quadruped --preset pace --along gamma=delta --range -0.6:0.2
  analyze --network biped --set w_a=0.2 current=0.25 --json

exit codes: 0 analysed (even if no gait was found), 2 invalid arguments."""
#: Delays beyond which no Hopf points are looked for, model time.
LONGEST = 100.0


def _parser() -> Parser:
    parser = Parser(prog='analyze', description=DESCRIPTION, epilog=EPILOG)
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
    parser.add_argument('--json', action='store_true', help='print JSON instead of tables')
    parser.add_argument('--plot', type=Path, metavar='FILE', help='draw the branches, the roots, '
                        'trajectories and footfalls (.png, .pdf or .svg)')
    return parser


def _analysed(chosen: Namespace) -> Analysis:
    if chosen.plot is not None and not chosen.plot.absolute().parent.is_dir():
        raise InputError(f'--plot: there is no folder {chosen.plot.parent}')
    network = chosen_network(chosen)
    longest = 2.0 * network.delay if chosen.longest_delay is None else chosen.longest_delay
    if not 0.0 <= longest <= LONGEST:
        raise InputError(f'--longest-delay: {longest:g} is not from 0 to {LONGEST:g}')
    span = network.span or (0.0, max(longest, 1.01 * network.delay))
    try:
        along = ParameterLine.parse(chosen.along or network.line, type(network))
    except InputError as error:
        raise InputError(f'--along: {error}') from error
    if chosen.range is not None:
        span = chosen.range
    elif network.span is None and str(along) != network.line:
        raise InputError(f'--along: {along} needs a --range')
    if not np.isfinite(span).all() or span[0] >= span[1]:
        raise InputError(f'--range: {span[0]:g}:{span[1]:g} is not from low to high')
    with progress_bar('gaits', len(network.gaits())) as bar:
        found = verdicts(network, bar)
    return Analysis(network, found, along, span, longest)


def _analyze(chosen: Namespace) -> int:
    found = _analysed(chosen)
    if chosen.plot is not None:
        # matplotlib takes half a second, and only pictures need it.
        from cpg_ros.tools.analysis_plot import picture
        write_atomically(chosen.plot, picture(found, chosen.plot.suffix))
    say(as_json(found.as_dict()) if chosen.json else found.text())
    return 0


def main(arguments: Sequence[str] | None = None) -> int:
    """Analyse a parameter set; return the exit code."""
    return run(_parser(), _analyze, arguments)


if __name__ == '__main__':
    sys.exit(main())
