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

"""The robot's body in a robot file, for feedback: leg geometry and efference tables.

Part ``geometry`` has the lengths and axes of legs that feedback can displace, ``efference`` of a
gait what the base does by itself in it.
"""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass, field
from typing import Any, NamedTuple

from cpg_ros.files.yaml_reader import shown, YamlReader
from cpg_ros.robots.sprawled_stand import outward, sprawls
from cpg_ros.short_repr import ShortRepr
import numpy as np

#: Bins of the stride in an efference table, and most speeds that it has.
BINS, SPEEDS = 64, 10
#: The legs that feedback can displace.
LEGS = ('a hip about x, if any, then two joints about y; or, of a leg that reaches to the side, a '
        'hip about z, then two about one level axis')
#: Its signals: velocities in m/s, rates in rad/s, angles in rad, of the base in its own frame.
SIGNALS = ('forward', 'left', 'roll_rate', 'pitch_rate', 'roll', 'pitch')


@dataclass(frozen=True)
class LegGeometry:
    """A leg with all joints at 0, in the frame of the base: x forward, y left, z up, m.

    Attributes:
        joints: names of hip, thigh and calf, or of the last two.
        turns: 1 or -1 by the sense of each about x, y and y, or y and y; of a leg with a yaw,
            about z for the hip and, for the others, about the level axis that is 90 degrees to
            the left of it.
        hip: the hip joint, from the base; of a leg without one that of the thigh.
        thigh: the thigh joint, from the hip.
        calf: the calf joint, from the thigh joint.
        foot: the middle of the foot, from the calf joint.
        yaw: of a leg whose hip turns about z, the way in which it reaches from there: 0 forward,
            positive to the left, rad.

    """

    joints: tuple[str, ...]
    turns: tuple[float, ...]
    hip: tuple[float, ...]
    thigh: tuple[float, ...]
    calf: tuple[float, ...]
    foot: tuple[float, ...]
    yaw: float | None = None


@dataclass(frozen=True, repr=False)
class BodyGeometry(ShortRepr):
    """Geometry of a body, as feedback needs it.

    Attributes:
        mass: of the robot, kg.
        foot_radius: m.
        legs: those that feedback can displace, by name.

    """

    mass: float
    foot_radius: float
    legs: dict[str, LegGeometry] = field(default_factory=dict)


@dataclass(frozen=True, repr=False)
class EfferenceTable(ShortRepr):
    """Motion of the base in an undisturbed gait, by speed and by the phase of the first leg.

    Attributes:
        speeds: m/s, rising, at most SPEEDS.
        rows: by SIGNALS; of each a row for each speed, of BINS values, the means over parts of
            the stride.

    """

    speeds: tuple[float, ...]
    rows: dict[str, tuple[tuple[float, ...], ...]]


class LegChain(NamedTuple):
    """A leg as a model of the robot has it, with all joints at 0, in the frame of the base.

    Attributes:
        joints: names down the leg.
        axes: of the joints, unit vectors, shape (joints, 3).
        anchors: points on them, m, the same.
        foot: the middle of the foot, m, shape (3,).
        radius: of the foot, m.

    """

    joints: Sequence[str]
    axes: np.ndarray
    anchors: np.ndarray
    foot: np.ndarray
    radius: float


def body_geometry(mass: float, chains: Mapping[str, LegChain]) -> BodyGeometry:
    """Return the geometry of a body.

    Legs are left out that are not LEGS.

    Args:
        mass: of the robot, kg.
        chains: its legs, by name.

    """
    legs = {leg: found for leg, chain in chains.items() if (found := _leg_geometry(*chain[:4]))}
    radius = float(np.mean([chains[leg].radius for leg in legs] or 0.0))
    return BodyGeometry(round(mass, 6), round(radius, 6), legs)


def _leg_geometry(joints: Sequence[str], axes: np.ndarray, anchors: np.ndarray, foot: np.ndarray
                  ) -> LegGeometry | None:
    if len(joints) not in (2, 3):
        return None
    wanted, yaw = np.eye(3)[[0, 1, 1][-len(joints):]], None
    if sprawls(axes):
        out = outward(axes[1], foot - anchors[0])
        yaw = round(float(np.arctan2(out[1], out[0])), 6)
        wanted = np.array([[0.0, 0.0, 1.0], *[[-np.sin(yaw), np.cos(yaw), 0.0]] * 2])
    turns = np.sign((axes * wanted).sum(axis=1))
    if np.abs(axes - turns[:, None] * wanted).max() > 0.01:
        return None
    hip, thigh, calf = anchors[[0, 0, 1] if len(joints) == 2 else [0, 1, 2]]

    def rounded(place: np.ndarray) -> tuple[float, ...]:
        return tuple((np.round(place, 6) + 0.0).tolist())

    return LegGeometry(tuple(joints), tuple(turns.tolist()), rounded(hip), rounded(thigh - hip),
                       rounded(calf - thigh), rounded(foot - calf), yaw)


def read_geometry(reader: YamlReader, tree: Any,
                  legs: Mapping[str, Iterable[str]]) -> BodyGeometry:
    """Take the part ``geometry``; legs are those of the file with the names of their joints."""
    tree = reader.keys(tree, 'geometry', {'mass', 'foot_radius', 'legs'})
    mass, radius = (reader.number(tree[key], f'geometry.{key}') for key in ('mass', 'foot_radius'))
    if mass <= 0.0:
        raise reader.fail('geometry.mass', f'{mass:g} must be positive')
    if radius < 0.0:
        raise reader.fail('geometry.foot_radius', f'{radius:g} must not be negative')
    listed = reader.keys(tree['legs'], 'geometry.legs', set(), set(legs))
    return BodyGeometry(mass, radius, {leg: _leg(reader, listed[leg], f'geometry.legs.{leg}',
                                                 set(legs[leg])) for leg in listed})


def _leg(reader: YamlReader, tree: Any, where: str, known: set[str]) -> LegGeometry:
    places = ('hip', 'thigh', 'calf', 'foot')
    tree = reader.keys(tree, where, {'joints', 'turns', *places}, {'yaw'})
    joints = tuple(reader.text(name, f'{where}.joints[{k}]') for k, name
                   in enumerate(reader.items(tree['joints'], f'{where}.joints')))
    if len(joints) not in (2, 3) or len(set(joints)) < len(joints):
        raise reader.fail(f'{where}.joints', 'must name hip, thigh and calf, or of '
                          'thigh and calf')
    for k, name in enumerate(joints):
        if name not in known:
            raise reader.fail(f'{where}.joints[{k}]', f"'{name}' is not a joint of this leg")
    turns = reader.numbers(tree['turns'], f'{where}.turns', len(joints))
    for k, turn in enumerate(turns):
        if turn not in (1.0, -1.0):
            raise reader.fail(f'{where}.turns[{k}]', f'{turn:g} must be 1 or -1')
    hip, thigh, calf, foot = (reader.numbers(tree[key], f'{where}.{key}', 3) for key in places)
    yaw = reader.number(tree['yaw'], f'{where}.yaw') if 'yaw' in tree else None
    if yaw is not None and len(joints) == 2:
        raise reader.fail(f'{where}.yaw', 'is of a leg of three joints, the first about z')
    # Level and upward, of what is in the plane of the leg.
    level = np.array([1.0, 0.0]) if yaw is None else np.array([np.cos(yaw), np.sin(yaw)])
    for key, link in (('calf', calf), ('foot', foot)):
        if np.hypot(level @ link[:2], link[2]) < 1e-9:
            raise reader.fail(f'{where}.{key}', 'has no length in the plane of the leg')
    return LegGeometry(joints, turns, hip, thigh, calf, foot, yaw)


def read_efference(reader: YamlReader, tree: Any, where: str) -> EfferenceTable:
    """Take the part ``efference`` of a gait, rows of numbers with spaces between them."""
    tree = reader.keys(tree, where, {'speeds', *SIGNALS})
    speeds = reader.numbers(tree['speeds'], f'{where}.speeds')
    if len(speeds) > SPEEDS:
        raise reader.fail(f'{where}.speeds', f'has {len(speeds)} speeds; at most {SPEEDS} fit')
    reader.check_rising(speeds, f'{where}.speeds')
    rows = {}
    for key in SIGNALS:
        listed = reader.items(tree[key], f'{where}.{key}')
        if len(listed) != len(speeds):
            raise reader.fail(f'{where}.{key}', f'has {len(listed)} rows, and speeds has '
                              f'{len(speeds)} numbers')
        rows[key] = tuple(_row(reader, row, f'{where}.{key}[{k}]') for k, row
                          in enumerate(listed))
    return EfferenceTable(speeds, rows)


def _row(reader: YamlReader, value: Any, where: str) -> tuple[float, ...]:
    if not isinstance(value, str):
        raise reader.fail(where, f'must be {BINS} numbers with spaces between them, not '
                          f'{shown(value)}')
    words = value.split()
    if len(words) != BINS:
        raise reader.fail(where, f'has {len(words)} numbers, not {BINS}')
    try:
        return tuple(reader.number(float(word), where) for word in words)
    except ValueError as error:
        raise reader.fail(where, f'contains something that is not a number: {error}') from error


def geometry_tree(geometry: BodyGeometry) -> dict[str, Any]:
    """Return what ``read_geometry`` reads back."""
    return {'mass': geometry.mass, 'foot_radius': geometry.foot_radius,
            'legs': {leg: {key: list(value) if isinstance(value, tuple) else value
                           for key, value in asdict(one).items() if value is not None}
                     for leg, one in geometry.legs.items()}}


def efference_tree(table: EfferenceTable) -> dict[str, Any]:
    """Return what ``read_efference`` reads back, to four digits."""
    return {'speeds': list(table.speeds)} | {
        key: [' '.join(f'{value:.4g}' for value in row) for row in table.rows[key]]
        for key in SIGNALS}
