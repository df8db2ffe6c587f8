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

"""Executable ``inversion``: a recording in, a gait out; or the node that does it on call.

``inversion --bag walk_bag --robot go1.yaml --out fitted.yaml --report report.html`` finds the
steady gait of a recording, fits a network's gait and the joints' readouts to it, and writes what
the generator loads. Without a recording the executable is the node ``cpg_inversion``.
"""

from argparse import Namespace
from collections.abc import Sequence
from functools import partial
from pathlib import Path
import sys
from textwrap import fill

from cpg_ros.errors import InputError
from cpg_ros.files.atomic_write import write_atomically
from cpg_ros.files.plain_text import as_json, table
from cpg_ros.files.progress_bar import progress_bar
from cpg_ros.files.yaml_reader import shown
from cpg_ros.fleet.options import add_options, KEPT, working
from cpg_ros.gaits.leg_names import BIPED, QUADRUPED
from cpg_ros.inversion.gait_schedule import write_schedule
from cpg_ros.inversion.leg_duty import GAIT_DUTY
from cpg_ros.inversion.model_choice import (
    as_rows,
    compare_networks,
    indistinguishable,
    NetworkComparison,
)
from cpg_ros.inversion.paper_fit import paper_fits, PaperFit, refuse_others
from cpg_ros.inversion.parameter_files import write_fitted
from cpg_ros.inversion.recording_fit import fit_recording, network_of, preset_of, RecordingFit
from cpg_ros.inversion.stretch_fits import fit_stretches, stretch_rows
from cpg_ros.inversion.stride_report import as_csv
from cpg_ros.networks.registry import SHIPPED
from cpg_ros.recordings.formats import FORMATS, read_recording
from cpg_ros.recordings.recording import Recording
from cpg_ros.robots.robot import Robot
from cpg_ros.robots.robot_file import load_robot
from cpg_ros.tools.arguments import assignment, refuse_repeated
from cpg_ros.tools.command_line import note, Parser, run, say
from cpg_ros.tools.reading_options import (
    add_reading_options,
    check_reading_options,
    chosen_format,
    reading_arguments,
)

DESCRIPTION = """\
Find the steady gait in a recording, and the network parameters that move a robot like it. Reads
joint states from {}. Writes a parameter file and a robot file that the generator loads as they
are."""
EPILOG = """\
examples:
  inversion --bag walk_bag --robot go1.yaml --out fitted.yaml --report report.html
  inversion --csv walk.csv --unit deg --free c tau --json
  ros2 run cpg_ros generator --ros-args --params-file fitted.yaml
  inversion --bag walk_and_trot --robot go1.yaml --schedule gaits.yaml
  inversion --bags recordings/ --out results/ --jobs 2

Without a recording, inversion runs as the node cpg_inversion, which listens to joint states and
fits them when ~/fit is called.

exit codes: 0 fitted, 1 no steady gait or none that fits, 2 invalid arguments or damaged input."""


def _parser() -> Parser:
    *contents, last = (one.contents for one in FORMATS.values())
    parser = Parser(
        prog='inversion', description=fill(DESCRIPTION.format(
            f'{", ".join(contents)}, or {last}'), 98), epilog=EPILOG)
    add_reading_options(parser)
    parser.add_argument('--robot', metavar='FILE', help='robot file, or the name of a shipped '
                        'one, which assigns joints to legs and cells and gives their limits '
                        '(default: legs identified by the names of the joints)')
    parser.add_argument('--network', metavar='NAME', help=f'{", ".join(SHIPPED)}, or the path of '
                        'a Python file that defines one, or auto, which compares all networks '
                        "with the recording's legs on strides held back from the fit (default: "
                        f"the robot's first; four legs: {network_of(QUADRUPED)}, two legs: "
                        f'{network_of(BIPED)})')
    parser.add_argument('--gait', metavar='NAME', help='gait to fit (default: the recognised one)')
    parser.add_argument('--preset', metavar='NAME', help='shipped preset that supplies the '
                        "parameters that are not free (default: the gait's)")
    parser.add_argument('--free', nargs='+', default=[], metavar='PARAMETER',
                        help=f'parameters to fit, and {GAIT_DUTY}, the share of the stride that '
                        'legs stand (default: ' + ', '.join(
                            f'{name} {" ".join(kind.free) or "none"}'
                            for name, kind in SHIPPED.items()) + f'; and {GAIT_DUTY} if the '
                        'robot file has one for the gait or the recording shows one)')
    parser.add_argument('--order', type=int, choices=(1, 2, 3), default=3, metavar='N',
                        help='order of the readout, 1 to 3 (default: %(default)s)')
    parser.add_argument('--start', nargs='+', action='append', default=[], type=assignment,
                        metavar='PARAMETER=VALUE', help='starting values; repeat the option for '
                        'several starting points (default: the best of many over the ranges)')
    parser.add_argument('--paper', action='store_true', help='also fit as Liu & Zhang (2024) do, '
                        'with eight joints as the eight cells, 20 instants and no readout, and '
                        'print the table of starts, iterations and errors')
    parser.add_argument('--out', type=Path, metavar='FILE', help='parameter file to write, such '
                        'as fitted.yaml; the robot file is written beside it; with --bags, a '
                        'folder')
    parser.add_argument('--schedule', type=Path, metavar='FILE', help='cut a recording that '
                        'changes its gait into its steady stretches, fit each, and write what '
                        'cpg play-schedule repeats, such as gaits.yaml; the robot file is written '
                        'beside it')
    parser.add_argument('--report', type=Path, metavar='FILE', help='report to write: .html, or '
                        '.csv for a table of all strides')
    parser.add_argument('--json', action='store_true', help='print JSON instead of text')
    parser.add_argument('--watch', action='store_true', help='with --bags: keep processing new '
                        'recordings until Ctrl-C')
    add_options(parser)
    return parser


def _recording(chosen: Namespace, robot: Robot | None) -> Recording:
    given = chosen_format(chosen)
    return read_recording(
        getattr(chosen, given), given,
        robot_joints=[joint.name for joint in robot.joints] if robot else (),
        **reading_arguments(chosen))


def _refuse_options(chosen: Namespace) -> None:
    """Check the options before any work."""
    if chosen.bags is not None:
        _refuse_for_many(chosen)
    elif given := [option for option in ('watch', 'dask', 'tls', 'jobs')
                    if getattr(chosen, option)]:
        raise InputError(f'argument --{given[0]}: one recording is one job; see --bags')
    check_reading_options(chosen)
    if chosen.bags is None:
        _refuse_files(chosen)
    for start in chosen.start:
        refuse_repeated('argument --start', [name for name, _ in start])
    refuse_repeated('argument --free', chosen.free)


def _refuse_for_many(chosen: Namespace) -> None:
    if chosen.out is None:
        raise InputError('argument --bags: --out FOLDER is needed for the results')
    if chosen.out.exists() and not chosen.out.is_dir():
        raise InputError(f'argument --out: {chosen.out} is not a folder')
    for option in ('report', 'json', 'paper', 'schedule'):
        if getattr(chosen, option):
            raise InputError(f'argument --{option}: not with --bags')


def _refuse_files(chosen: Namespace) -> None:
    for option in ('out', 'report', 'schedule'):
        path = getattr(chosen, option)
        if path is not None and not path.absolute().parent.is_dir():
            raise InputError(f'argument --{option}: there is no folder {path.parent}')
    for option in ('out', 'schedule'):
        path = getattr(chosen, option)
        if path is not None and path.suffix not in ('.yaml', '.yml'):
            raise InputError(f'argument --{option}: {shown(str(path))} does not end in .yaml')
    if chosen.schedule is not None:
        for option in ('out', 'report', 'gait', 'preset', 'free', 'start', 'paper'):
            if getattr(chosen, option):
                raise InputError(f'argument --{option}: not with --schedule, which fits every '
                                 'stretch by itself')
    if chosen.report is not None and chosen.report.suffix not in ('.html', '.csv'):
        raise InputError(f'argument --report: {shown(str(chosen.report))} does not end in .html '
                         'or .csv')


def _invert_many(chosen: Namespace, robot: Robot | None, starts: list[dict[str, float]]) -> int:
    """Invert the recordings in folders; return 0 if any could be fitted."""
    # The tables need a library that a single recording does not.
    from cpg_ros.fleet.many_recordings import Folders
    from cpg_ros.fleet.recording_job import FitSettings
    report = partial(note, 'inversion')
    work = Folders(chosen.bags, chosen.out, FitSettings(
        robot, chosen.network or '', chosen.gait or '', chosen.preset or '', tuple(chosen.free),
        chosen.order, tuple(starts), reading_arguments(chosen)))
    try:
        with working(chosen, 'recordings', report) as fleet:
            summary = work.watch(fleet, report) if chosen.watch else work.run(fleet)
    except KeyboardInterrupt:
        raise KeyboardInterrupt(KEPT) from None
    kept = f'; {summary.kept} were done before' if summary.kept else ''
    say(f'{summary.done} recordings, {summary.done - summary.failed} fitted, '
        f'{summary.failed} not (the table says why){kept}\n'
        f'written: {", ".join(map(str, summary.written))}')
    return 0 if summary.failed < summary.done else 1


def _invert(chosen: Namespace) -> int:
    _refuse_options(chosen)
    robot = None if chosen.robot is None else load_robot(chosen.robot)
    starts = [dict(start) for start in chosen.start]
    if chosen.paper:
        refuse_others(robot, chosen.network or '')
    if chosen.bags is not None:
        return _invert_many(chosen, robot, starts)
    recording = _recording(chosen, robot)
    if chosen.schedule is not None:
        return _scheduled(chosen, recording, robot)
    network, compared = _explained(chosen, recording, robot)
    with progress_bar('fitting', 100) as bar:
        found = fit_recording(recording, robot, network, chosen.gait or '',
                              free=chosen.free, order=chosen.order,
                              preset=chosen.preset or '', starts=starts,
                              done=lambda share: bar(round(100.0 * share)))
    fits = _paper(chosen, found, starts)
    written = _written(chosen, found, robot)
    if chosen.json:
        say(as_json({**found.as_dict(), **({'networks': [{
            key: value for key, value in vars(one).items() if value != float('inf')}
            for one in compared]} if compared else {}), **({'paper': [{
                'start': one.start, 'end': one.end, 'iterations': one.fit.trial.iterations,
                'error': one.fit.cost, 'synchronisation_errors': one.errors} for one in fits]}
            if chosen.paper else {})}))
    else:
        from cpg_ros.inversion.fit_report import as_table, as_text
        judged = [*table(as_rows(compared), '<<>>>><'), '',
                  *([one, ''] if (one := indistinguishable(compared, chosen.order)) else [])
                  ] if compared else []
        text = '\n'.join([*judged, as_text(found), *as_table(fits)])
        say(f'{text}\nwritten: {", ".join(map(str, written))}' if written else text)
    return 0


def _scheduled(chosen: Namespace, recording: Recording, robot: Robot | None) -> int:
    """Fit every stretch, and write the changes between them."""
    with progress_bar('fitting', 100) as bar:
        found = fit_stretches(recording, robot, chosen.network or '', order=chosen.order,
                              done=lambda share: bar(round(100.0 * share)))
    written = write_schedule(chosen.schedule, found, robot)
    if chosen.json:
        say(as_json([{'begin': one.begin, 'end': one.end, 'gait': one.gait,
                      'frequency': one.stride.frequency, 'confidence': one.confidence,
                      'rms_share': one.fit.fit.mean_rms_share if one.fit else None,
                      'why': one.why or None} for one in found]))
        return 0
    say('\n'.join([*table(stretch_rows(found), '>><>>>>'), *(
        f'warning: {one.begin:.2f} to {one.end:.2f} s: {line}' for one in found
        for line in ((one.why,) if one.fit is None else one.fit.warnings)),
        f'written: {", ".join(map(str, written))}']))
    return 0


def _explained(chosen: Namespace, recording: Recording, robot: Robot | None
               ) -> tuple[str, list[NetworkComparison]]:
    """Return the network to fit and, for auto, how well each explains the recording."""
    if chosen.network != 'auto':
        return chosen.network or '', []
    with progress_bar('comparing networks', 100) as bar:
        found = compare_networks(recording, robot, chosen.order,
                                 done=lambda share: bar(round(100.0 * share)))
    if found[0].why:
        raise InputError(f'{recording.source}: no network has such a gait: ' + '; '.join(
            f'{one.network}: {one.why}' for one in found))
    return found[0].network, found


def _paper(chosen: Namespace, found: RecordingFit, starts: list[dict[str, float]]
           ) -> list[PaperFit]:
    """Fit as the paper does, if --paper is given."""
    if not chosen.paper:
        return []
    network = preset_of(found.fit.network.name, chosen.preset or found.fit.gait).network
    return paper_fits(found.stride, found.fit.cells, network, found.fit.gait,
                      [name for name in found.fit.parameters if name != GAIT_DUTY],
                      starts or [{}])


def _written(chosen: Namespace, found: RecordingFit, robot: Robot | None) -> list[Path]:
    written = [] if chosen.out is None else write_fitted(chosen.out, found, robot)
    if chosen.report is not None:
        if chosen.report.suffix == '.csv':
            text = as_csv(found)
        else:
            # matplotlib takes half a second, and only pages need it.
            from cpg_ros.inversion.fit_report import as_html
            text = as_html(found)
        write_atomically(chosen.report, text)
        written.append(chosen.report)
    return written


def main(arguments: Sequence[str] | None = None) -> int:
    """Invert a recording, or run the node if the command line has none; return the exit code."""
    if arguments is None and sys.argv[1:2] in ([], ['--ros-args']):
        # Without ROS installed, recordings can be inverted all the same.
        from cpg_ros.nodes.inversion_node import run as run_node
        return run_node()
    return run(_parser(), _invert, arguments)


if __name__ == '__main__':
    sys.exit(main())
