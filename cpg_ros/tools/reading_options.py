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

"""The options that choose recordings and how to read them, for all formats."""

from argparse import Namespace
from pathlib import Path
from typing import Any

from cpg_ros.errors import InputError
from cpg_ros.recordings.formats import FORMATS, reading_options
from cpg_ros.recordings.servo import Servo
from cpg_ros.tools.command_line import Parser


def add_reading_options(parser: Parser) -> None:
    """Add an option for each format, one for folders, and the options of the readers."""
    source = parser.add_mutually_exclusive_group(required=True)
    first, *others = FORMATS.values()
    source.add_argument(f'--{first.name}', type=Path, metavar=first.metavar, help=first.help)
    source.add_argument('--bags', type=Path, nargs='+', metavar='FOLDER', help='all bags and '
                        'tables in these folders; --out is then a folder for the results')
    for one in others:
        source.add_argument(f'--{one.name}', type=Path, metavar=one.metavar, help=one.help)
    for option in reading_options():
        parser.add_argument(f'--{option.name}', metavar=option.metavar, help=option.help,
                            choices=option.choices or None, nargs='+' if option.several else None,
                            default=[] if option.several else None)
    parser.add_argument('--kp', type=float, metavar='KP', help='fit the commands of the joints in '
                        'the bag instead of their measured positions: position + (effort + kd '
                        'velocity) / kp, with the proportional gain of their controllers, N m/rad')
    parser.add_argument('--kd', type=float, metavar='KD', help='damping gain of the joint '
                        'controllers, N m s/rad (default: 0)')


def chosen_format(chosen: Namespace) -> str:
    """Return the name of the format whose option was given, or ''."""
    return next((name for name in FORMATS if getattr(chosen, name) is not None), '')


def check_reading_options(chosen: Namespace) -> None:
    """Refuse options that the chosen format's reader does not take.

    Raises:
        InputError: one was given.

    """
    if name := chosen_format(chosen):
        for option in reading_options():
            if getattr(chosen, option.name) and (why := FORMATS[name].refusal(option.name)):
                raise InputError(f'argument --{option.name}: {why}')
        if chosen.kp is not None and (why := FORMATS[name].refusal('servo')):
            raise InputError(f'argument --kp: {why}')
    if chosen.kp is None and chosen.kd is not None:
        raise InputError('argument --kd: without --kp')


def reading_arguments(chosen: Namespace) -> dict[str, Any]:
    """Return the options as arguments of read_recording.

    Raises:
        InputError: a gain is out of its range.

    """
    values = {option.name: getattr(chosen, option.name) for option in reading_options()}
    return {**{name: tuple(value) if isinstance(value, list) else value
               for name, value in values.items()},
            'servo': None if chosen.kp is None else Servo(chosen.kp, chosen.kd or 0.0)}
