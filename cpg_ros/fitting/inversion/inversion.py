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

"""Executable ``inversion``: fits gaits to recordings, or runs the node that does it on call.

``inversion --bag walk_bag --robot go1.yaml --out fitted.yaml --report report.html`` finds the
steady gait of a recording, fits a network's gait and the joints' readouts to it, and writes what
the generator loads. Without a recording the executable is the node ``cpg_inversion``.
"""

from argparse import Namespace
from collections.abc import Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
import sys
from textwrap import fill

from cpg_ros.common.command_line import (
    as_json,
    assignment,
    note,
    Parser,
    progress_bar,
    refuse_repeated,
    run,
    say,
    table,
)
from cpg_ros.common.errors import InputError
from cpg_ros.common.files import write_atomically
from cpg_ros.common.workers import add_options, INTERRUPT_MESSAGE, working
from cpg_ros.common.yaml_reader import quoted
from cpg_ros.fitting.gaits.leg_names import BIPED, QUADRUPED
from cpg_ros.fitting.inversion.gait_schedule import fit_stretches, stretch_rows, write_schedule
from cpg_ros.fitting.inversion.leg_duty import GAIT_DUTY
from cpg_ros.fitting.inversion.model_choice import (
    as_rows,
    compare_networks,
    indistinguishable,
    NetworkComparison,
)
from cpg_ros.fitting.inversion.paper_fit import paper_fits, PaperFit, refuse_others
from cpg_ros.fitting.inversion.parameter_files import write_fitted
from cpg_ros.fitting.inversion.recording_fit import (
    fit_recording,
    network_of,
    preset_of,
    RecordingFit,
)
from cpg_ros.fitting.inversion.stride_report import as_csv
from cpg_ros.fitting.recordings.formats import (
    add_reading_options,
    check_reading_options,
    chosen_format,
    FORMATS,
    read_recording,
    reading_arguments,
)
from cpg_ros.fitting.recordings.recording import Recording
from cpg_ros.motion.robot import Robot
from cpg_ros.motion.robot_file import load_robot
from cpg_ros.networks.registry import SHIPPED

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
    *contents, last = (form.contents for form in FORMATS.values())
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
                        help=f'parameters to fit, and {GAIT_DUTY}, the fraction of the stride in '
                        'stance (default: ' + ', '.join(
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


def _recording(args: Namespace, robot: Robot | None) -> Recording:
    given = chosen_format(args)
    order = robot.order if robot else ()
    recording = read_recording(getattr(args, given), given, robot_joints=order,
                               **reading_arguments(args))
    # Tables often call FR_hip what the robot file calls FR_hip_joint.
    longer = {name.removesuffix('_joint'): name for name in order}
    if set(order) & set(recording.joints) or not set(longer) & set(recording.joints):
        return recording
    return replace(
        recording, joints=tuple(longer.get(name, name) for name in recording.joints),
        notes=(*recording.notes, "the robot file's names of the joints end in '_joint'"))


def _refuse_options(args: Namespace) -> None:
    """Check the options before any work."""
    if args.bags is not None:
        _refuse_for_many(args)
    elif given := [option for option in ('watch', 'dask', 'tls', 'jobs')
                    if getattr(args, option)]:
        raise InputError(f'argument --{given[0]}: one recording is one job; see --bags')
    check_reading_options(args)
    if args.bags is None:
        _refuse_files(args)
    for start in args.start:
        refuse_repeated('argument --start', [name for name, _ in start])
    refuse_repeated('argument --free', args.free)


def _refuse_for_many(args: Namespace) -> None:
    if args.out is None:
        raise InputError('argument --bags: --out FOLDER is needed for the results')
    if args.out.exists() and not args.out.is_dir():
        raise InputError(f'argument --out: {args.out} is not a folder')
    for option in ('report', 'json', 'paper', 'schedule'):
        if getattr(args, option):
            raise InputError(f'argument --{option}: not with --bags')


def _refuse_files(args: Namespace) -> None:
    for option in ('out', 'report', 'schedule'):
        path = getattr(args, option)
        if path is not None and not path.absolute().parent.is_dir():
            raise InputError(f'argument --{option}: there is no folder {path.parent}')
    for option in ('out', 'schedule'):
        path = getattr(args, option)
        if path is not None and path.suffix not in ('.yaml', '.yml'):
            raise InputError(f'argument --{option}: {quoted(str(path))} does not end in .yaml')
    if args.schedule is not None:
        for option in ('out', 'report', 'gait', 'preset', 'free', 'start', 'paper'):
            if getattr(args, option):
                raise InputError(f'argument --{option}: not with --schedule, which fits every '
                                 'stretch by itself')
    if args.report is not None and args.report.suffix not in ('.html', '.csv'):
        raise InputError(f'argument --report: {quoted(str(args.report))} does not end in .html '
                         'or .csv')


def _invert_many(args: Namespace, robot: Robot | None, starts: list[dict[str, float]]) -> int:
    """Invert the recordings in folders; return 0 if any could be fitted."""
    # The tables need a library that a single recording does not.
    from cpg_ros.fitting.inversion.many_recordings import FitSettings, Folders
    report = partial(note, 'inversion')
    work = Folders(args.bags, args.out, FitSettings(
        robot, args.network or '', args.gait or '', args.preset or '', tuple(args.free),
        args.order, tuple(starts), reading_arguments(args)))
    try:
        with working(args, 'recordings', report) as fleet:
            summary = work.watch(fleet, report) if args.watch else work.run(fleet)
    except KeyboardInterrupt:
        raise KeyboardInterrupt(INTERRUPT_MESSAGE) from None
    resumed = f'; {summary.kept} were done before' if summary.kept else ''
    say(f'{summary.done} recordings, {summary.done - summary.failed} fitted, '
        f'{summary.failed} not (the table says why){resumed}\n'
        f'written: {", ".join(map(str, summary.written))}')
    return 0 if summary.failed < summary.done else 1


def _invert(args: Namespace) -> int:
    _refuse_options(args)
    robot = None if args.robot is None else load_robot(args.robot)
    starts = [dict(start) for start in args.start]
    if args.paper:
        refuse_others(robot, args.network or '')
    if args.bags is not None:
        return _invert_many(args, robot, starts)
    recording = _recording(args, robot)
    if args.schedule is not None:
        return _scheduled(args, recording, robot)
    network, compared = _explained(args, recording, robot)
    with progress_bar('fitting', 100) as bar:
        result = fit_recording(recording, robot, network, args.gait or '',
                              free=args.free, order=args.order,
                              preset=args.preset or '', starts=starts,
                              done=lambda fraction: bar(round(100.0 * fraction)))
    fits = _paper(args, result, starts)
    written = _written(args, result, robot)
    if args.json:
        say(as_json({**result.as_dict(), **({'networks': [{
            key: value for key, value in vars(comparison).items() if value != float('inf')}
            for comparison in compared]} if compared else {}), **({'paper': [{
                'start': comparison.start, 'end': comparison.end,
                'iterations': comparison.fit.trial.iterations,
                'error': comparison.fit.cost,
                'synchronisation_errors': comparison.errors} for comparison in fits]}
            if args.paper else {})}))
    else:
        from cpg_ros.fitting.inversion.fit_report import as_table, as_text
        judged = [*table(as_rows(compared), '<<>>>><'), '',
                  *([comparison, ''] if (comparison := indistinguishable(compared, args.order))
                    else [])
                  ] if compared else []
        text = '\n'.join([*judged, as_text(result), *as_table(fits)])
        say(f'{text}\nwritten: {", ".join(map(str, written))}' if written else text)
    return 0


def _scheduled(args: Namespace, recording: Recording, robot: Robot | None) -> int:
    """Fit every stretch, and write the changes between them."""
    with progress_bar('fitting', 100) as bar:
        stretches = fit_stretches(recording, robot, args.network or '', order=args.order,
                              done=lambda fraction: bar(round(100.0 * fraction)))
    written = write_schedule(args.schedule, stretches, robot)
    if args.json:
        say(as_json([{'begin': stretch.begin, 'end': stretch.end, 'gait': stretch.gait,
                      'frequency': stretch.stride.frequency, 'confidence': stretch.confidence,
                      'rms_share': stretch.fit.fit.mean_rms_share if stretch.fit else None,
                      'why': stretch.why or None} for stretch in stretches]))
        return 0
    say('\n'.join([*table(stretch_rows(stretches), '>><>>>>'), *(
        f'warning: {stretch.begin:.2f} to {stretch.end:.2f} s: {line}' for stretch in stretches
        for line in ((stretch.why,) if stretch.fit is None else stretch.fit.warnings)),
        f'written: {", ".join(map(str, written))}']))
    return 0


def _explained(args: Namespace, recording: Recording, robot: Robot | None
               ) -> tuple[str, list[NetworkComparison]]:
    """Return the network to fit and, for auto, how well each explains the recording."""
    if args.network != 'auto':
        return args.network or '', []
    with progress_bar('comparing networks', 100) as bar:
        comparisons = compare_networks(recording, robot, args.order,
                                 done=lambda fraction: bar(round(100.0 * fraction)))
    if comparisons[0].why:
        raise InputError(f'{recording.source}: no network has such a gait: ' + '; '.join(
            f'{comparison.network}: {comparison.why}' for comparison in comparisons))
    return comparisons[0].network, comparisons


def _paper(args: Namespace, result: RecordingFit, starts: list[dict[str, float]]
           ) -> list[PaperFit]:
    """Fit as the paper does, if --paper is given."""
    if not args.paper:
        return []
    network = preset_of(result.fit.network.name, args.preset or result.fit.gait).network
    return paper_fits(result.stride, result.fit.cells, network, result.fit.gait,
                      [name for name in result.fit.parameters if name != GAIT_DUTY],
                      starts or [{}])


def _written(args: Namespace, result: RecordingFit, robot: Robot | None) -> list[Path]:
    written = [] if args.out is None else write_fitted(args.out, result, robot)
    if args.report is not None:
        if args.report.suffix == '.csv':
            text = as_csv(result)
        else:
            # matplotlib takes half a second, and only pages need it.
            from cpg_ros.fitting.inversion.fit_report import as_html
            text = as_html(result)
        write_atomically(args.report, text)
        written.append(args.report)
    return written


def main(arguments: Sequence[str] | None = None) -> int:
    """Invert a recording; return the exit code."""
    return run(_parser(), _invert, arguments)


if __name__ == '__main__':
    sys.exit(main())
