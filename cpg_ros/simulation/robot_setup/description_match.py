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

"""Comparison of a robot file with the robot's description: names, kinds, limits, shape, gaits."""

from collections.abc import Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from difflib import get_close_matches
from itertools import combinations
from math import inf, nan
from typing import Any

from cpg_ros.common.command_line import table
from cpg_ros.fitting.gaits.leg_names import legs_of, LegsError, role_of
from cpg_ros.motion.body_file import body_geometry, BodyGeometry, LegChain, LEGS
from cpg_ros.motion.description import JointDescription, RobotDescription, SERVOS, SLOW
from cpg_ros.motion.plan import plan_gait, PlanError
from cpg_ros.motion.robot import Joint, Motion, Robot
from cpg_ros.networks.registry import NETWORKS
from cpg_ros.simulation.robot_setup.geometry_match import (
    differing,
    FORWARD_GAITS,
    implausible,
    walks_backward,
)
import numpy as np

# The part ``geometry`` of a first robot file, from the robot's description.

def geometry_from(robot: Robot, known: RobotDescription) -> BodyGeometry:
    """Return a robot's geometry, with those of its legs that feedback can displace."""
    chains = {}
    for leg, joints in robot.legs.items():
        names = sorted((joint.name for joint in joints), key=lambda one: len(known.chain(one)))
        foot, radius = known.foot_below(names[-1])
        places = np.array([known.frame(name)[0] for name in names])
        if np.linalg.norm(foot - places[-1]) <= 1e-3:
            continue
        axes = np.array([known.direction(name) for name in names])
        chains[leg] = LegChain(names, axes, places, foot, radius)
    return body_geometry(sum(link.mass for link in known.links.values()), chains)


def usable(robot: Robot, found: BodyGeometry, what: str) -> tuple[BodyGeometry | None, str]:
    """Return the geometry, None where it is of no use, and which legs feedback can displace.

    Args:
        robot: with all its legs.
        found: its geometry.
        what: format of the file that this is from.

    """
    if not found.legs or found.mass <= 0.0:
        return None, (f'feedback: the {what} gives no mass' if found.legs else
                      f'feedback: no leg is {LEGS}')
    others = [leg for leg in robot.legs if leg not in found.legs]
    return found, 'feedback can move all feet' if not others else (
        f'feedback moves no foot of {", ".join(others)}: a leg must be {LEGS}')


#: ROUNDING: difference of limits, rad or rad/s, that is ignored, as files have rounded limits.
ROUNDING = 1e-4
#: USUAL_FREQUENCY: default stride frequency, Hz.
USUAL_FREQUENCY = 1.0


@dataclass(frozen=True)
class JointCheck:
    """A joint of the robot file beside its namesake in the description, and its faults."""

    joint: Joint
    described: JointDescription | None
    faults: tuple[str, ...]

    def as_dict(self, source: str) -> dict[str, Any]:
        """Return it as plain types; limits in rad and rad/s, those described under a key."""
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
        network, name: which.
        frequency: strides per second (Hz), nan where there is no such gait.
        room: least distance in rad of any joint from a limit; negative beyond it.
        fraction: largest speed of any joint as a share of its limit.
        room_at, share_at: the joints of these two.
        faults: what does not fit.

    """

    network: str
    name: str
    frequency: float
    room: float
    room_at: str
    fraction: float
    share_at: str
    faults: tuple[str, ...]

    def as_dict(self) -> dict[str, Any]:
        """Return it as plain types."""
        return {'network': self.network, 'gait': self.name, 'fits': not self.faults,
                'frequency': self.frequency, 'room': self.room, 'room_at': self.room_at,
                'speed_share': self.fraction, 'speed_share_at': self.share_at,
                'faults': list(self.faults)}


@dataclass(frozen=True)
class RobotCheck:
    """Result of a comparison; the files match if nothing has a fault."""

    robot: str
    source: str
    format: str
    joints: tuple[JointCheck, ...]
    gaits: tuple[GaitCheck, ...]
    lopsided: tuple[str, ...]
    shape: tuple[str, ...]
    notes: tuple[str, ...]

    @property
    def faults(self) -> list[str]:
        """What does not match, one line each."""
        return [f'{joint.joint.name}: {fault}' for joint in self.joints for fault in joint.faults
                ] + [*self.lopsided, *self.shape] + [f'{gait.network} {gait.name}: {fault}'
                                        for gait in self.gaits for fault in gait.faults]

    def as_dict(self) -> dict[str, Any]:
        """Return it as plain types."""
        source = self.format.lower()
        return {'robot': self.robot, source: self.source, 'matches': not self.faults,
                'joints': [joint.as_dict(source) for joint in self.joints],
                'gaits': [gait.as_dict() for gait in self.gaits],
                'lopsided': list(self.lopsided), 'shape': list(self.shape),
                'notes': list(self.notes)}

    def text(self) -> str:
        """Return it as tables, then what does not match, then notes."""
        rows: list[tuple[str, ...]] = [
            ('joint', 'leg', 'kind', 'limits [rad]', self.format, 'speed [rad/s]',
             self.format, '')]
        for one in self.joints:
            joint, there = one.joint, one.described
            rows.append((joint.name, joint.leg, there.kind if there else '-', _span(joint),
                         _span(there) if there else '-', f'{joint.velocity:.4g}',
                         _limit(there.velocity) if there else '-',
                         'does not match' if one.faults else 'ok'))
        lines = table(rows, '<<<<<>><')
        rows = [('gait', 'network', 'stride [Hz]', 'nearest limit', 'fastest joint', '')]
        for gait in self.gaits:
            known = gait.frequency == gait.frequency
            rows.append((gait.name, gait.network, f'{gait.frequency:.3g}' if known else '-',
                         f'{_room(gait.room)} ({gait.room_at})' if known else '-',
                         f'{100 * gait.fraction:.0f} % of its limit ({gait.share_at})'
                         if known else '-', 'does not fit' if gait.faults else 'fits'))
        lines += ['', *table(rows, '<<><<<'), '']
        faults = self.faults
        lines += [f'- {fault}' for fault in faults] + [f'note: {note}' for note in self.notes]
        lines.append(f'{self.robot} matches {self.source}' if not faults else
                     f'{self.robot} does not match {self.source}: {len(faults)} '
                     f'thing{"s" if len(faults) > 1 else ""}, see above')
        return '\n'.join(lines)


def checked(robot: Robot, known: RobotDescription, names: tuple[str, str],
            gaits: Sequence[str] = (), frequency: float | None = None, amplitude: float = 1.0,
            geometry: BodyGeometry | None = None, notes: Sequence[str] = ()) -> RobotCheck:
    """Compare a robot file with the robot's description.

    Args:
        robot: what the file says.
        known: what a URDF or an MJCF file says of it.
        names: of the two files, for messages.
        gaits: gaits or presets; by default all gaits of the robot's networks.
        frequency: strides per second (Hz), 0 for the model's own time; None takes what the
            robot file says of the gait, or else 1 Hz.
        amplitude: factor on the readout weights.
        geometry: that the description gives, if the file's is to be compared with it.
        notes: of the caller's.

    """
    near = _nearest(robot, known)
    joints = tuple(JointCheck(joint, known.joints.get(joint.name), tuple(
        _faults(joint, known, near.get(joint.name, '')))) for joint in robot.joints)
    pairs = [(network, name) for network in robot.networks for name in
              (gaits or NETWORKS[network].gaits()) if name in NETWORKS[network].presets()]
    return RobotCheck(*names, known.format, joints, tuple(
        _gait(robot, known, network, name, frequency, amplitude) for network, name in pairs),
        tuple(_lopsided(robot)), tuple(_shape(robot, known, pairs, geometry)),
        (*notes, *_notes(robot, known)))


def _shape(robot: Robot, known: RobotDescription, gaits: Sequence[tuple[str, str]],
           geometry: BodyGeometry | None) -> Iterator[str]:
    """Say what is wrong with lengths, masses and senses of rotation."""
    yield from implausible(robot, known)
    if robot.geometry is not None and geometry is not None:
        yield from differing(robot.geometry, geometry, known.format)
    for network, name in gaits:
        if NETWORKS[network].presets()[name].gait in FORWARD_GAITS:
            with suppress(PlanError):    # which the gait's own check reports
                yield from walks_backward(robot, known, plan_gait(
                    unlimited(robot), name, USUAL_FREQUENCY, network=network))
                return


def _lopsided(robot: Robot) -> Iterator[str]:
    """Say which legs have joints that those of the other side do not have."""
    for left, right in combinations(robot.legs, 2):
        sides = [robot.sides.get(leg) for leg in (left, right)]
        if (len(robot.legs[left]) == len(robot.legs[right]) or None in sides
                or sides[0] == sides[1] or robot.girdles.get(left) != robot.girdles.get(right)):
            continue
        fewer, more = sorted((left, right), key=lambda leg: len(robot.legs[leg]))
        known = {role_of(joint.name) for joint in robot.legs[fewer]}
        alone = [joint.name for joint in robot.legs[more] if role_of(joint.name) not in known]
        yield (f'{fewer}: has {len(robot.legs[fewer])} joints and {more} '
               f'{len(robot.legs[more])}, none there like {", ".join(alone) or "the rest"}')


def _faults(joint: Joint, known: RobotDescription, near: str) -> Iterator[str]:
    what, there = known.format, known.joints.get(joint.name)
    if there is None:
        yield f'the {what} has no such joint' + (f", did you mean '{near}'?" if near else '')
        return
    if there.flaw:
        yield f'cannot be driven, in the {what} it {there.flaw}'
        return
    if joint.lower < there.lower - ROUNDING:
        yield (f'lower limit {joint.lower:g} rad is {there.lower - joint.lower:.4g} rad below the '
               f"{what}'s {there.lower:g}")
    if joint.upper > there.upper + ROUNDING:
        yield (f'upper limit {joint.upper:g} rad is {joint.upper - there.upper:.4g} rad above the '
               f"{what}'s {there.upper:g}")
    if not there.lower - ROUNDING <= joint.offset <= there.upper + ROUNDING:
        yield (f"offset {joint.offset:g} rad is outside the {what}'s limits {there.lower:g} to "
               f'{there.upper:g}: the robot could not stand')
    if joint.velocity > there.velocity + ROUNDING:
        yield (f'velocity limit {joint.velocity:g} rad/s is {joint.velocity - there.velocity:.4g} '
               f"rad/s above the {what}'s {there.velocity:g}")


def _gait(robot: Robot, known: RobotDescription, network: str, name: str,
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
        limits: list[tuple[str, Joint | JointDescription]] = [("the robot file's", joint)]
        there = known.joints.get(joint.name)
        if there and not there.flaw:
            limits.append((f"the {known.format}'s", there))
        lower, below = max((one.lower, whose) for whose, one in limits)
        upper, above = min((one.upper, whose) for whose, one in limits)
        fastest, slower = min((one.velocity, whose) for whose, one in limits)
        low, high = joint.offset + low, joint.offset + high
        rooms.append((min(low - lower, upper - high), joint.name))
        fractions.append((speed / fastest, joint.name))
        if low < lower - ROUNDING:
            faults.append(f'{joint.name} goes to {low:.3f} rad, below {below} limit {lower:g}')
        if high > upper + ROUNDING:
            faults.append(f'{joint.name} goes to {high:.3f} rad, above {above} limit {upper:g}')
        if speed > fastest + ROUNDING:
            faults.append(f'{joint.name} moves at {speed:.2f} rad/s, above {slower} limit '
                          f'{fastest:g}')
    return GaitCheck(network, name, gait_plan.frequency, *min(rooms), *max(fractions),
                     tuple(faults))


def unlimited(robot: Robot) -> Robot:
    """Return a robot whose joints have no limits, so that no plan for it fails on one."""
    return replace(robot, legs={leg: tuple(replace(
        joint, lower=-inf, upper=inf, velocity=inf) for joint in joints)
        for leg, joints in robot.legs.items()})


def _fastest(motion: Motion) -> float:
    steered = motion.steering.frequency if motion.steering else ()
    return max(motion.frequency or 0.0, *steered, 0.0) or USUAL_FREQUENCY


def _nearest(robot: Robot, described: RobotDescription) -> dict[str, str]:
    """Return for joints that the description does not have the likeliest of those it has."""
    there = {joint.name for joint in robot.joints}
    able = [name for name, joint in described.joints.items() if not joint.flaw]
    free = [name for name in able if name not in there]
    try:
        legs: Mapping[str, Sequence[str]] = legs_of(able, True).joints
    except LegsError:
        legs = {}
    near = {}
    for joint in robot.joints:
        # The same joint of another leg is spelt like it, too: the robot file knows the leg.
        same = {role_of(name): name for name in legs.get(joint.leg, ()) if name in free}
        wanted, known = ((role_of(joint.name), same) if same else
                         (joint.name.lower(), {name.lower(): name for name in free}))
        likely = get_close_matches(wanted, list(known),
                                   1) or (list(same) if len(same) == 1 else [])
        if likely:
            near[joint.name] = known[likely[0]]
    return near


def _notes(robot: Robot, known: RobotDescription) -> Iterator[str]:
    driven, what = [joint.name for joint in robot.joints], known.format
    idle = [joint.name for joint in known.joints.values()
            if (not joint.flaw or joint.kind == 'prismatic') and joint.name not in driven]
    if idle:
        yield f'moving joints of the {what} that no leg drives: ' + ', '.join(idle)
    if any(joint.invented for joint in robot.joints):
        yield f'limits that the {what} does not have are invented: ' + ', '.join(
            f'{joint.name} ({", ".join(joint.invented)})' for joint in robot.joints
            if joint.invented)
    slow = sorted({joint.velocity for joint in robot.joints if joint.velocity < SLOW})
    if slow:
        yield (f'velocity limits of {" and ".join(f"{one:g}" for one in slow)} rad/s are slow for '
               f'a walking robot ({SERVOS}), and gaits keep to them: if your motors are faster, '
               f'correct the {what}, or make the file with --velocity and what they reach')
    unbounded = [name for name in driven
                 if name in known.joints and known.joints[name].velocity == inf]
    if unbounded:
        yield f'the {what} has no velocity limit of ' + (
            'any joint' if len(unbounded) == len(driven) else ', '.join(unbounded))


def _span(limits: Joint | JointDescription) -> str:
    if limits.lower == -inf and limits.upper == inf:
        return 'none'
    return f'{limits.lower:.4g} to {limits.upper:.4g}'


def _limit(value: float) -> str:
    return 'none' if value == inf else f'{value:.4g}'


def _room(room: float) -> str:
    return f'{room:.2f} rad away' if room >= 0.0 else f'{-room:.2g} rad beyond'
