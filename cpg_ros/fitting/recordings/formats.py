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

"""Formats of recordings, and the entry point to all of them."""

from argparse import Namespace
from collections.abc import Sequence
from contextlib import suppress
from io import BytesIO
from pathlib import Path
from typing import Any

from cpg_ros.common.command_line import Parser
from cpg_ros.common.errors import InputError
from cpg_ros.fitting.recordings.bag_reader import BAG
from cpg_ros.fitting.recordings.bvh_reader import BVH
from cpg_ros.fitting.recordings.c3d_reader import C3D
from cpg_ros.fitting.recordings.csv_reader import CSV
from cpg_ros.fitting.recordings.joint_streams import Servo
from cpg_ros.fitting.recordings.npz_reader import NPZ
from cpg_ros.fitting.recordings.opensim_reader import MOT, TRC
from cpg_ros.fitting.recordings.pose_reader import POSE
from cpg_ros.fitting.recordings.recording import (
    abbreviate,
    INDEXED_NAME,
    name_positions,
    Option,
    Recording,
    RecordingError,
    RecordingFormat,
    refuse_stand_in,
    repeat_stride,
)

#: FORMATS: name -> format. To add one, write a file like those of the others and name it here.
FORMATS: dict[str, RecordingFormat] = {
    kind.name: kind for kind in (BAG, CSV, MOT, TRC, C3D, POSE, BVH, NPZ)}


def reading_options() -> list[Option]:
    """Return the options of all formats, each once."""
    return list(dict.fromkeys(option for form in FORMATS.values() for option in form.options))


def format_of(path: Path) -> RecordingFormat:
    """Return a recording's format, by the suffix of its name or by the contents of the folder.

    If several formats have the suffix, the first that recognises the file is taken.

    Raises:
        RecordingError: a file with an unknown suffix.
        OSError: the folder cannot be listed.

    """
    if path.is_dir():
        folders = [form for form in FORMATS.values() if form.files_in is not None]
        return next((form for form in folders if form.files_in and form.files_in(path)),
                    folders[0])
    fitting = [form for form in FORMATS.values() if path.name.endswith(form.endings)]
    if fitting:
        return next((form for form in fitting if form.recognises and form.recognises(path)),
                    next((form for form in fitting if not form.recognises), fitting[0]))
    endings = [ending for form in FORMATS.values() for ending in form.endings]
    raise RecordingError(f'{path}: not a recording: names of recordings end in '
                         f'{", ".join(endings)}')


def read_recording(path: str | Path, format_name: str = '', *, robot_joints: Sequence[str] = (),
                   progress: bool = True, cycle: float | None = None, **options: Any
                   ) -> Recording:
    """Read a recording of any format.

    Args:
        path: of the file, or of the folder of a bag.
        format_name: one of FORMATS; by default the path decides.
        robot_joints: joints of a robot; those that exist are read if ``joints`` is empty and the
            format may contain others.
        progress: show a progress bar.
        cycle: duration of the stride, s, of a recording of exactly one stride; 0 if the times
            state it, None for any other recording.
        options: of the format's reader, such as `read_bag` or `read_csv`; None and empty values
            count as not given.

    Raises:
        RecordingError: see `merged`; the recording cannot be read, or its format is unknown.
        InputError: no such format, or an option that it does not have.

    """
    path = Path(path)
    if format_name and format_name not in FORMATS:
        raise InputError(f'no format {format_name!r} of recordings; there are '
                         f'{abbreviate(list(FORMATS))}')
    # A file that cannot be opened is reported by its reader.
    with suppress(OSError), path.open('rb') if path.is_file() else BytesIO() as file:
        refuse_stand_in(path, file.read(64))
    args = FORMATS[format_name] if format_name else format_of(path)
    values = {name: value for name, value in options.items() if value is not None and value != ()
              and value != []}
    for name in values:
        if reason := args.validate(name):
            raise InputError(f'{path}: option {name}: {reason}')
    if robot_joints and 'joints' not in values and 'some' in args.features:
        values |= {'joints': robot_joints, 'some': True}
    recording = args.read(path, progress=progress, **values)
    if robot_joints and all(map(INDEXED_NAME.match, recording.joints)):
        recording = name_positions(recording, robot_joints)
    return recording if cycle is None else repeat_stride(recording, cycle)


# The options that choose recordings and how to read them, for all formats.

def add_reading_options(parser: Parser) -> None:
    """Add an option for each format, one for folders, and the options of the readers."""
    source = parser.add_mutually_exclusive_group(required=True)
    first, *others = FORMATS.values()
    source.add_argument(f'--{first.name}', type=Path, metavar=first.metavar, help=first.help)
    source.add_argument('--bags', type=Path, nargs='+', metavar='FOLDER', help='all bags and '
                        'tables in these folders; --out is then a folder for the results')
    for action in others:
        source.add_argument(f'--{action.name}', type=Path, metavar=action.metavar,
                            help=action.help)
    for option in reading_options():
        parser.add_argument(f'--{option.name}', metavar=option.metavar, help=option.help,
                            choices=option.choices or None, nargs='+' if option.several else None,
                            default=[] if option.several else None)
    parser.add_argument('--cycle', type=float, nargs='?', const=0.0, metavar='SECONDS',
                        help='the recording is exactly one stride, of this duration (default: '
                        'as its times say)')
    parser.add_argument('--kp', type=float, metavar='KP', help='fit the commands of the joints in '
                        'the bag instead of their measured positions: position + (effort + kd '
                        'velocity) / kp, with the proportional gain of their controllers, N m/rad')
    parser.add_argument('--kd', type=float, metavar='KD', help='damping gain of the joint '
                        'controllers, N m s/rad (default: 0)')


def chosen_format(args: Namespace) -> str:
    """Return the name of the format whose option was given, or ''."""
    return next((name for name in FORMATS if getattr(args, name) is not None), '')


def check_reading_options(args: Namespace) -> None:
    """Refuse options that the given format's reader does not take.

    Raises:
        InputError: one was given.

    """
    if name := chosen_format(args):
        for option in reading_options():
            if getattr(args, option.name) and (reason := FORMATS[name].validate(option.name)):
                raise InputError(f'argument --{option.name}: {reason}')
        if args.kp is not None and (reason := FORMATS[name].validate('servo')):
            raise InputError(f'argument --kp: {reason}')
    if args.kp is None and args.kd is not None:
        raise InputError('argument --kd: without --kp')


def reading_arguments(args: Namespace) -> dict[str, Any]:
    """Return the options as arguments of read_recording.

    Raises:
        InputError: a gain is out of its range.

    """
    values = {option.name: getattr(args, option.name) for option in reading_options()}
    return {**{name: tuple(value) if isinstance(value, list) else value
               for name, value in values.items()},
            'cycle': args.cycle,
            'servo': None if args.kp is None else Servo(args.kp, args.kd or 0.0)}
