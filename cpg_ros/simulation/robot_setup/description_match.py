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

"""Comparison of a robot file with the robot's description: names, kinds, limits, shape, gaits.

Legs are compared by forward kinematics: their side, the position of their feet in the stand, and
the direction in which low feet move.
"""

from collections.abc import Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from difflib import get_close_matches
from itertools import combinations
from math import acos, inf, nan
from typing import Any

from cpg_ros.common.command_line import table
from cpg_ros.motion.body_file import BodyGeometry, LegGeometry
from cpg_ros.motion.description import (
    JointDescription,
    LegChain,
    MIN_SPEED,
    RobotDescription,
    SERVO_SPEEDS,
)
from cpg_ros.motion.plan import beyond_limits, GaitPlan, plan_gait, PlanError
from cpg_ros.motion.robot import Joint, Motion, Robot
from cpg_ros.motion.robot_file import LIMITS
from cpg_ros.networks.leg_numbers import GIRDLES
from cpg_ros.networks.registry import NETWORKS
import numpy as np
from scipy.spatial import ConvexHull, QhullError

#: Difference of limits, rad or rad/s, that is ignored, as files have rounded limits.
LIMIT_TOLERANCE = 1e-4
#: Differences of lengths that are ignored. LENGTH_RTOL: by the length; LENGTH_ATOL: m.
LENGTH_RTOL, LENGTH_ATOL = 0.05, 0.003
#: MAX_MASS_RATIO: ratio of masses up to which they agree.
MAX_MASS_RATIO = 1.25
#: MAX_LEG_LENGTH: length of the longest leg of a robot, m; DENSITY_RANGE: least and largest mass
#: over the cube of the longest leg, kg/m^3 (of robots 50 to 600).
MAX_LEG_LENGTH, DENSITY_RANGE = 5.0, (5.0, 6000.0)
#: BACKWARD_FRACTION: fraction of a stride by which a foot must go the wrong way; MIN_MOTION: least
#: way of a foot, over the leg's length.
BACKWARD_FRACTION, MIN_MOTION = 0.25, 0.002
#: MAX_SOLE_TILT: largest tilt of a sole in the stand, rad.
MAX_SOLE_TILT = 0.1
#: A flat foot. MIN_FACE_COSINE: between normals on one face; MIN_FLATNESS: area of its face over
#: that of its shadow; MIN_TOE_FLATNESS: the same of a foot with a heel and toes, from below.
MIN_FACE_COSINE, MIN_FLATNESS, MIN_TOE_FLATNESS = 0.98, 0.5, 0.2
#: FORWARD_GAITS: gaits in which a robot walks forward, with alternating legs.
FORWARD_GAITS = ('walk', 'trot', 'pace', 'tripod', 'run')
#: DEFAULT_FREQUENCY: default stride frequency, Hz.
DEFAULT_FREQUENCY = 1.0


@dataclass(frozen=True)
class JointCheck:
    """A joint of the robot file beside its namesake in the description, and its faults."""

    joint: Joint
    described: JointDescription | None
    faults: tuple[str, ...]

    def as_dict(self, source: str) -> dict[str, Any]:
        """Return it as plain types, limits in rad and rad/s; ``source`` keys those described."""
        keys = ('lower', 'upper', 'velocity')
        return {'name': self.joint.name, 'leg': self.joint.leg, 'matches': not self.faults,
                'kind': self.described.kind if self.described else None,
                'robot': {key: getattr(self.joint, key) for key in (*keys, 'offset')},
                source: ({key: getattr(self.described, key) for key in keys}
                         if self.described else None),
                'faults': list(self.faults)}


@dataclass(frozen=True)
class GaitCheck:
    """A gait on the robot.

    Attributes:
        network, name: of the gait.
        frequency: strides per second (Hz), nan for a gait that does not exist.
        room: least distance of any joint from a limit, rad; negative beyond it.
        fraction: largest speed of any joint as a fraction of its limit.
        room_at, fraction_at: joints of these two.
        faults: of the gait.

    """

    network: str
    name: str
    frequency: float
    room: float
    room_at: str
    fraction: float
    fraction_at: str
    faults: tuple[str, ...]

    def as_dict(self) -> dict[str, Any]:
        """Return it as plain types."""
        return {'network': self.network, 'gait': self.name, 'fits': not self.faults,
                'frequency': self.frequency, 'room': self.room, 'room_at': self.room_at,
                'speed_share': self.fraction, 'speed_share_at': self.fraction_at,
                'faults': list(self.faults)}


@dataclass(frozen=True)
class RobotCheck:
    """Result of a comparison; the files match if nothing has a fault."""

    robot: str
    source: str
    format: str
    joints: tuple[JointCheck, ...]
    gaits: tuple[GaitCheck, ...]
    shape: tuple[str, ...]
    notes: tuple[str, ...]

    @property
    def faults(self) -> list[str]:
        """Differences, one line each."""
        return [f'{joint.joint.name}: {fault}' for joint in self.joints for fault in joint.faults
                ] + [*self.shape, *(f'{gait.network} {gait.name}: {fault}'
                                  for gait in self.gaits for fault in gait.faults)]

    def as_dict(self) -> dict[str, Any]:
        """Return it as plain types."""
        source = self.format.lower()
        return {'robot': self.robot, source: self.source, 'matches': not self.faults,
                'joints': [joint.as_dict(source) for joint in self.joints],
                'gaits': [gait.as_dict() for gait in self.gaits],
                'shape': list(self.shape), 'notes': list(self.notes)}

    def text(self) -> str:
        """Return tables, then the differences, then notes."""
        rows: list[tuple[str, ...]] = [
            ('joint', 'leg', 'kind', 'limits [rad]', self.format, 'speed [rad/s]',
             self.format, '')]
        for row in self.joints:
            joint, match = row.joint, row.described
            rows.append((joint.name, joint.leg, match.kind if match else '-', _span(joint),
                         _span(match) if match else '-', f'{joint.velocity:.4g}',
                         _limit(match.velocity) if match else '-',
                         'does not match' if row.faults else 'ok'))
        lines = table(rows, '<<<<<>><')
        rows = [('gait', 'network', 'stride [Hz]', 'nearest limit', 'fastest joint', '')]
        for gait in self.gaits:
            measured = gait.frequency == gait.frequency
            rows.append((gait.name, gait.network, f'{gait.frequency:.3g}' if measured else '-',
                         f'{_room(gait.room)} ({gait.room_at})' if measured else '-',
                         f'{100 * gait.fraction:.0f} % of its limit ({gait.fraction_at})'
                         if measured else '-', 'does not fit' if gait.faults else 'fits'))
        lines += ['', *table(rows, '<<><<<'), '']
        faults = self.faults
        lines += [f'- {fault}' for fault in faults] + [f'note: {note}' for note in self.notes]
        lines.append(f'{self.robot} matches {self.source}' if not faults else
                     f'{self.robot} does not match {self.source}: {len(faults)} '
                     f'thing{"s" if len(faults) > 1 else ""}, see above')
        return '\n'.join(lines)


def checked(robot: Robot, description: RobotDescription, names: tuple[str, str],
            gaits: Sequence[str] = (), frequency: float | None = None, amplitude: float = 1.0,
            geometry: BodyGeometry | None = None) -> RobotCheck:
    """Compare a robot file with the robot's description.

    Args:
        robot: from the file.
        description: of the robot, from a URDF or an MJCF file.
        names: of the two files, for messages.
        gaits: gaits or presets; by default all gaits of the robot's networks.
        frequency: strides per second (Hz), 0 for the model's own time; None takes the robot file's
            for the gait, or else 1 Hz.
        amplitude: factor on the readout weights.
        geometry: by the description, to compare with the file's; None for none.

    """
    near = _nearest(robot, description)
    joints = tuple(JointCheck(joint, description.joints.get(joint.name), tuple(
        _faults(joint, description, near.get(joint.name, '')))) for joint in robot.joints)
    pairs = [(network, name) for network in robot.networks for name in
              (gaits or NETWORKS[network].gaits()) if name in NETWORKS[network].presets()]
    shape = [*_lopsided(robot), *_implausible(robot, description)]
    if robot.geometry is not None and geometry is not None:
        shape += _differing(robot.geometry, geometry, description.format)
    shape += walking_faults(robot, description, pairs)
    return RobotCheck(*names, description.format, joints, tuple(
        _gait(robot, description, network, name, frequency, amplitude) for network, name in pairs),
        tuple(shape), tuple(_notes(robot, description)))


def walking_faults(robot: Robot, model: RobotDescription,
                   gaits: Sequence[tuple[str, str]] = ()) -> list[str]:
    """Return why a robot does not stand or walk forward, by forward kinematics.

    Args:
        robot: from a robot file.
        model: the description.
        gaits: networks and their presets, of which the first one that goes forward is checked;
            empty for all gaits of the robot's first network.

    """
    own = robot.networks[0]
    faults = list(_misplaced(robot, model))
    for network, name in gaits or [(own, gait) for gait in NETWORKS[own].gaits()]:
        if NETWORKS[network].presets()[name].gait in FORWARD_GAITS:
            with suppress(PlanError):    # which the gait's own check reports
                return faults + list(_missteps(robot, model, plan_gait(
                    unlimited(robot), name, DEFAULT_FREQUENCY, network=network)))
    return faults


def _chains(robot: Robot, model: RobotDescription) -> dict[str, LegChain]:
    """Return the legs with joints and foot in the description."""
    chains = {}
    for leg, joints in robot.legs.items():
        if all(joint.name in model.joints and not model.joints[joint.name].undrivable
               for joint in joints):
            chain = model.leg(joint.name for joint in joints)
            if chain.lengths[-1] > 0.0:
                chains[leg] = chain
    return chains


def _lopsided(robot: Robot) -> Iterator[str]:
    """Return which legs have fewer joints than those of the other side."""
    for left, right in combinations(robot.legs, 2):
        sides = [robot.sides.get(leg) for leg in (left, right)]
        fewer, more = sorted((left, right), key=lambda leg: len(robot.legs[leg]))
        if (len(robot.legs[left]) != len(robot.legs[right]) and None not in sides
                and sides[0] != sides[1] and robot.girdles.get(left) == robot.girdles.get(right)):
            yield (f'{fewer}: has {len(robot.legs[fewer])} joints and {more} '
                   f'{len(robot.legs[more])}')


def _misplaced(robot: Robot, model: RobotDescription) -> Iterator[str]:
    """Return which legs are on another side or end than in the file, and which do not stand."""
    chains, what = _chains(robot, model), model.format
    for one, other in combinations(chains, 2):
        x, y, _ = chains[one].anchors[0] - chains[other].anchors[0]
        sides, girdles = ([places.get(leg) for leg in (one, other)]
                          for places in (robot.sides, robot.girdles))
        if girdles[0] == girdles[1] and sides[0] != sides[1] and y * (
                1.0 if sides[0] == 'left' else -1.0) < 0.0:
            yield f'{one} is at the {sides[1]} of {other} in the {what}'
        order = [GIRDLES.index(girdle) if girdle in GIRDLES else 0 for girdle in girdles]
        if sides[0] == sides[1] and order[0] != order[1] and x * (order[1] - order[0]) < 0.0:
            yield f'{one} is {"behind" if x < 0.0 else "ahead of"} {other} in the {what}'
    stand = {joint.name: joint.offset for joint in robot.joints}
    for leg, chain in chains.items():
        _, points, frame = chain.posed([stand[name] for name in chain.joints])
        high = float(points[-1, 2] - points[:-1, 2].min())
        if high > 0.0:
            yield (f'{leg}: in the stand its foot is {high:.3g} m above its lowest joint: its '
                   f"joints' limits, axes or offsets do not let it stand")
        if len(robot.legs) == 2 and len(chain.joints) > 4:
            up = sole_up(model, chain.joints[-1])
            if (tilt := acos(min(1.0, float((frame @ up)[2])))) > MAX_SOLE_TILT:
                yield f'{leg}: in the stand its sole is {tilt:.2g} rad off level'


def sole_up(known: RobotDescription, last: str) -> np.ndarray:
    """Return the upward direction at the sole below a joint, with all joints at 0, shape (3,).

    It is that of the base, unless the foot is flat on another side only.
    """
    points, up = known.shapes(last), np.array([0.0, 0.0, 1.0])
    try:
        hull = ConvexHull(points)
    except (QhullError, ValueError):
        return up
    ankle = known.frame(last)[0]
    normals, areas = hull.equations[:, :3], np.array([
        0.5 * np.linalg.norm(np.cross(points[b] - points[a], points[c] - points[a]))
        for a, b, c in hull.simplices])

    def flat(down: np.ndarray) -> float:
        """Return the area of the face on a side, divided by that of the shadow on its plane."""
        return float(2.0 * areas[normals @ down > MIN_FACE_COSINE].sum()
                     / max(np.abs(normals @ down) @ areas, 1e-12))

    # Of the top and the bottom, the one that is further from the ankle.
    down = max(normals, key=lambda normal: (
        round(areas[normals @ normal > MIN_FACE_COSINE].sum() / areas.sum(), 2),
        np.max((points - ankle) @ normal)))
    return up if flat(-up) > MIN_TOE_FLATNESS or flat(down) < MIN_FLATNESS else -down


def _missteps(robot: Robot, model: RobotDescription, gait: GaitPlan) -> Iterator[str]:
    """Return which feet move forward while they are low, or hardly move, in a gait forward."""
    names = [joint.name for joint in robot.joints]
    readout, count = gait.readout, 64
    phases, points = np.arange(count) / count, readout.angles.shape[1]
    offsets = robot.column('offset') + gait.shift
    angles = {name: offsets[k] + np.interp(
        phases + gait.orbit.phases[robot.cells[k]], np.arange(points) / points,
        readout.angles[k], period=1.0) for k, name in enumerate(names)}
    for leg, chain in _chains(robot, model).items():
        path = np.array([chain.posed([angles[name][k] for name in chain.joints])[1][-1]
                         for k in range(count)])
        steps = np.roll(path[:, 0], -1) - path[:, 0]
        height = path[:, 2] + 0.5 * (np.roll(path[:, 2], -1) - path[:, 2])
        low = height < np.median(height)
        stride, lift = float(np.ptp(path[:, 0])), float(np.ptp(path[:, 2]))
        if lift > 0.02 * stride and steps[low].sum() > BACKWARD_FRACTION * stride > 0.0:
            yield (f'{leg}: its foot moves forward while it is low in the {gait.name}, so that '
                   f'the robot walks backward: are the axes of the {model.format} turned the '
                   'other way?')
        elif min(lift, stride) < MIN_MOTION * sum(chain.lengths):
            yield (f'{leg}: its foot moves by {1e3 * stride:.2g} mm forward and '
                   f'{1e3 * lift:.2g} mm upward only in the {gait.name}')


def _implausible(robot: Robot, model: RobotDescription) -> Iterator[str]:
    """Return a line for each implausible length or mass of a description."""
    legs, what = _chains(robot, model), model.format
    longest = max((float(sum(chain.lengths)) for chain in legs.values()), default=0.0)
    for leg, chain in legs.items():
        if sum(chain.lengths) > MAX_LEG_LENGTH:
            k = int(np.argmax(chain.lengths))
            yield (f'{leg}: the link below {chain.joints[k]} is {chain.lengths[k]:.4g} m long in '
                   f'the {what}: are its lengths in mm?')
    mass = sum(link.mass for link in model.links.values())
    if legs and mass > 0.0 and 0.0 < longest <= MAX_LEG_LENGTH:
        density = mass / longest**3
        if not DENSITY_RANGE[0] <= density <= DENSITY_RANGE[1]:
            yield (f'the {what} has a mass of {mass:.3g} kg with legs of {longest:.3g} m, which '
                   'no walking robot has')


def _differing(stated: BodyGeometry, match: BodyGeometry, what: str) -> Iterator[str]:
    """Return where a robot file's geometry differs, in lines; ``what`` is the other's format."""
    if match.mass > 0.0 and not 1.0 / MAX_MASS_RATIO <= stated.mass / match.mass <= MAX_MASS_RATIO:
        yield f"geometry.mass {stated.mass:.4g} kg is not the {what}'s {match.mass:.4g} kg"
    for leg, own in stated.legs.items():
        other = match.legs.get(leg)
        if other is not None:
            yield from (f'geometry.legs.{leg}.{fault}' for fault in _leg_faults(own, other, what))


def _leg_faults(own: LegGeometry, other: LegGeometry, what: str) -> Iterator[str]:
    if set(own.joints) == set(other.joints) and own.joints != other.joints:
        yield f"joints: {', '.join(own.joints)} come in the {what} as {', '.join(other.joints)}"
        return
    for name, sign, described in zip(own.joints, own.turns, other.turns, strict=False):
        if sign != described:
            yield (f'turns: {name} turns the other way in the {what}: {sign:g} where it has '
                   f'{described:g}')
    for key in ('hip', 'thigh', 'calf', 'foot'):
        mine, theirs = np.array(getattr(own, key)), np.array(getattr(other, key))
        room = LENGTH_ATOL + LENGTH_RTOL * float(np.linalg.norm(theirs))
        if (off := float(np.linalg.norm(mine - theirs))) > room:
            yield f"{key}: {mine.tolist()} m is {off:.4g} m from the {what}'s {theirs.tolist()}"


def _faults(joint: Joint, description: RobotDescription, near: str) -> Iterator[str]:
    what, match = description.format, description.joints.get(joint.name)
    if match is None:
        yield f'the {what} has no such joint' + (f", did you mean '{near}'?" if near else '')
        return
    if match.undrivable:
        yield f'cannot be driven, in the {what} it {match.undrivable}'
        return
    if joint.lower < match.lower - LIMIT_TOLERANCE:
        yield (f'lower limit {joint.lower:g} rad is {match.lower - joint.lower:.4g} rad below the '
               f"{what}'s {match.lower:g}")
    if joint.upper > match.upper + LIMIT_TOLERANCE:
        yield (f'upper limit {joint.upper:g} rad is {joint.upper - match.upper:.4g} rad above the '
               f"{what}'s {match.upper:g}")
    if not match.lower - LIMIT_TOLERANCE <= joint.offset <= match.upper + LIMIT_TOLERANCE:
        yield (f"offset {joint.offset:g} rad is outside the {what}'s limits {match.lower:g} to "
               f'{match.upper:g}: the robot could not stand')
    if joint.velocity > match.velocity + LIMIT_TOLERANCE:
        yield (f'velocity limit {joint.velocity:g} rad/s is {joint.velocity - match.velocity:.4g} '
               f"rad/s above the {what}'s {match.velocity:g}")


def _gait(robot: Robot, description: RobotDescription, network: str, name: str,
          frequency: float | None, amplitude: float) -> GaitCheck:
    if frequency is None:
        frequency = _fastest(robot.motion(name, NETWORKS[network].presets()[name].gait))
    try:
        gait_plan = plan_gait(unlimited(robot), name, frequency, amplitude, network)
    except PlanError as error:
        return GaitCheck(network, name, nan, nan, '', nan, '', (str(error),))
    faults, rooms, fractions = [], [], []
    for joint, low, high, speed in zip(robot.joints, *gait_plan.span, gait_plan.speed,
                                       strict=True):
        match = description.joints.get(joint.name)
        if match and not match.undrivable:
            joint = replace(joint, lower=max(joint.lower, match.lower),
                            upper=min(joint.upper, match.upper),
                            velocity=min(joint.velocity, match.velocity))
        low, high = joint.offset + low, joint.offset + high
        rooms.append((min(low - joint.lower, joint.upper - high), joint.name))
        fractions.append((speed / joint.velocity, joint.name))
        faults += beyond_limits(joint, low, high, speed)
    return GaitCheck(network, name, gait_plan.frequency, *min(rooms), *max(fractions),
                     tuple(faults))


def unlimited(robot: Robot) -> Robot:
    """Return a robot whose joints have no limits, so that no plan for it fails at one."""
    return replace(robot, legs={leg: tuple(replace(
        joint, lower=-inf, upper=inf, velocity=inf) for joint in joints)
        for leg, joints in robot.legs.items()})


def _fastest(motion: Motion) -> float:
    steered = motion.steering.frequency if motion.steering else ()
    return max(motion.frequency or 0.0, *steered, 0.0) or DEFAULT_FREQUENCY


def _nearest(robot: Robot, described: RobotDescription) -> dict[str, str]:
    """Return the most similar names in the description for joints that it does not have."""
    names = {joint.name for joint in robot.joints}
    free = {name.lower(): name for name, joint in described.joints.items()
            if not joint.undrivable and name not in names}
    return {joint.name: free[near] for joint in robot.joints
            for near in get_close_matches(joint.name.lower(), list(free), 1)}


def _notes(robot: Robot, description: RobotDescription) -> Iterator[str]:
    driven, what = [joint.name for joint in robot.joints], description.format
    idle = [joint.name for joint in description.joints.values()
            if (not joint.undrivable or joint.kind == 'prismatic') and joint.name not in driven]
    if idle:
        yield f'moving joints of the {what} that no leg drives: ' + ', '.join(idle)
    yield from invented_limits(robot, what)
    slow = sorted({joint.velocity for joint in robot.joints if joint.velocity < MIN_SPEED})
    if slow:
        yield (f'velocity limits of {" and ".join(f"{speed:g}" for speed in slow)} rad/s are slow '
               f'for a walking robot ({SERVO_SPEEDS}), and gaits keep to them: if your motors are '
               f'faster, correct the {what}, or make the file with --velocity and what they reach')


def invented_limits(robot: Robot, what: str) -> list[str]:
    """Return a line on limits that are assumed because the description has none, or none."""
    by_key = {key: [joint.name for joint in robot.joints if key in joint.invented]
              for key in LIMITS}
    listed = [f'{key} of ' + ('all joints' if len(names) == len(robot.joints) else
                              ', '.join(names)) for key, names in by_key.items() if names]
    return [f'limits that the {what} does not have are assumed (key invented): '
            + '; '.join(listed)] * bool(listed)


def _span(limits: Joint | JointDescription) -> str:
    if limits.lower == -inf and limits.upper == inf:
        return 'none'
    return f'{limits.lower:.4g} to {limits.upper:.4g}'


def _limit(value: float) -> str:
    return 'none' if value == inf else f'{value:.4g}'


def _room(room: float) -> str:
    return f'{room:.2f} rad away' if room >= 0.0 else f'{-room:.2g} rad beyond'
