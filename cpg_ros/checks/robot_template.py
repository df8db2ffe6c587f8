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

"""A first robot file from a description: legs by joints' names, what a joint does by its axis.

x forward, y left, z up (REP 103). In each leg the joints that turn about y are, down the leg,
the one that swings it, the knee and the ankle; others hold still. The stand has the knees bent
and the end of the leg below its hip, if upper and lower leg are equally long. A leg may also reach
to the side, as those of insects (robots.sprawled_stand): the coxa swings it, the femur lifts it.
"""

from collections.abc import Callable
from dataclasses import replace
from math import copysign, inf, pi

from cpg_ros.checks.description_match import unlimited
from cpg_ros.gaits.leg_names import Legs, legs_of
from cpg_ros.motion.plan import plan
from cpg_ros.networks.registry import NETWORKS, numbered
from cpg_ros.robots.description import DescriptionError, JointDescription, RobotDescription
from cpg_ros.robots.robot import HARMONICS, Joint, Robot
from cpg_ros.robots.robot_file import LARGEST, LIMITS
from cpg_ros.robots.sprawled_stand import first_stand, sprawls
import numpy as np

#: How far the knees are bent at the stand, rad, on two legs and on more.
UPRIGHT, CROUCHED = 0.5, 1.4
#: How far legs swing and knees bend at first, rad.
SWING, LIFT = 0.15, 0.15
#: Angles and speeds where the description has no limits, rad and rad/s.
UNBOUNDED, SPEED = pi, 20.0
#: Share of a joint's range that the stand keeps from either end, and of the room that gaits take.
MARGIN, USED = 0.1, 0.8


def robot_from(known: RobotDescription, name: str,
               feet: Callable[[Robot], dict[str, np.ndarray]]) -> tuple[Robot, str]:
    """Make a first robot from a description; return it and how its joints were interpreted.

    Args:
        known: the description.
        name: of the robot.
        feet: returns where the feet are with all joints at 0, from the last joint of each leg, m,
            shape (3,); called where legs reach to the side, with a robot whose joints are at 0.

    Raises:
        LegsError: the joints' names do not tell two, four or six legs.
        DescriptionError: the links make no tree, a leg has no joint that could swing it, or a
            joint has no room to move.

    """
    legs = legs_of([joint.name for joint in known.joints.values() if not joint.flaw], True)
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
    return _fitting(replace(robot, legs=joints)), '\n'.join(notes.values())


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
        bend = _bend(described[knee], ways[knee], len(legs))
        stand[knee] = _inside(described[knee], ways[knee] * bend)
        # Half of the bend the other way: the end of the leg is below the hip.
        stand[swings] = _inside(described[swings], -0.5 * ways[swings] * ways[knee] * stand[knee])
        weights[knee] = (0.0, copysign(LIFT, ways[knee] * bend))
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


def _bend(knee: JointDescription, way: float, legs: int) -> float:
    """Return how far about y a knee is bent at the stand: the way that its limits leave room."""
    middle = 0.5 * way * sum(_range(knee))
    # Where both ways do, the end of the leg goes backward on two legs and forward on more.
    usual = UPRIGHT if legs == 2 else -CROUCHED
    return copysign(usual, middle) if abs(middle) > 0.1 else usual


def _fitting(robot: Robot) -> Robot:
    """Make each joint's weights small enough for all gaits at 1 Hz."""
    share = np.full(len(robot.joints), 1.0)
    low, high, fast = (robot.column(key) for key in ('lower', 'upper', 'velocity'))
    offset = robot.column('offset')
    for network in robot.networks:
        for gait in NETWORKS[network].gaits():
            preset = NETWORKS[network].presets()[gait]
            program = plan(unlimited(robot), gait, preset, preset.network, 1.0)
            room = np.stack([offset - low, high - offset, fast])
            needed = np.stack([-program.span[0], program.span[1], program.speed])
            share = np.minimum(share, (USED * room / np.maximum(needed, 1e-9)).min(axis=0))
    shares = dict(zip((joint.name for joint in robot.joints), share, strict=True))
    return replace(robot, legs={leg: tuple(replace(joint, weights=tuple(
        round(float(weight * shares[joint.name]), 4) for weight in joint.weights))
        for joint in joints) for leg, joints in robot.legs.items()})
