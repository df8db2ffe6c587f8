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

"""Parts of a robot file for feedback: biped, gains, leg geometry, efference tables.

``geometry`` has the lengths and axes of the legs; ``efference`` of a gait has the base's own
motion.
"""

from collections.abc import Collection, Iterable, Mapping
from dataclasses import dataclass, field, replace
from itertools import combinations
import math
from typing import Annotated, Any

from cpg_ros.common.errors import ShortRepr
from cpg_ros.common.yaml_reader import plain, positive, quoted, required, YamlReader
from cpg_ros.motion.description import LegChain, outward, sprawls
from cpg_ros.motion.rotations import rotation
from cpg_ros.networks.library.biped import CELLS
import numpy as np

# A biped in a robot file, part ``biped``: links and their masses, soles, servos, gains.

BASE = 'base'
#: Types of fields, annotated with the length of a list or a check of a number.
Vector = Annotated[tuple[float, ...], 3]
Positive = Annotated[float, positive]
NotNegative = Annotated[float, lambda value: '' if value >= 0.0 else (
    f'{value:g} must be at least 0')]
#: GAIT_SPEEDS: gait in which feedback balances a biped -> range of forward speed of the G1, m/s.
GAIT_SPEEDS = {'walk': (-0.3, 0.6), 'run': (0.0, 1.0), 'two_legged_hop': (-0.05, 0.05),
          'two_legged_jump': (-0.05, 0.05)}


@dataclass(frozen=True)
class BipedLink:
    """A joint, the link that it moves, and its servo.

    Attributes:
        parent: joint of the previous link, or BASE.
        axis: unit vector of the joint.
        anchor: a point on the axis, m.
        mass: of the link, kg.
        center: of mass, m.
        kp: proportional gain, N m / rad.
        kd: damping, N m s / rad.
        effort: largest torque, N m.
        armature: reflected inertia of the rotor, kg m^2.
        angle: at which the joint is held, rad; None for a joint of a leg.
        cell: of the network that swings a held joint, from 1; 0 for none.
        swing: amplitude at the peak of the cell's recovery variable, rad.

    """

    parent: str
    axis: Vector
    anchor: Vector
    mass: NotNegative
    center: Vector
    kp: Positive
    kd: NotNegative
    effort: Positive
    armature: NotNegative = 0.0
    angle: float | None = None
    cell: int = 0
    swing: float = 0.0


@dataclass(frozen=True, repr=False)
class BipedBody(ShortRepr):
    """Links of a biped with soles, parents before children.

    Attributes:
        mass: of the base, kg.
        center: of the base's mass, m.
        links: by joint.
        soles: middle of the sole, m, by leg.
        sole_size: length and width of a sole, m.
        gains: of the feedback that differ from the defaults, by name.
        gait_gains: gait -> gains in this gait alone.
        scale: height of the centre of mass, and mass, relative to the G1; default gains are scaled
            by them according to their units (Froude).

    """

    mass: float
    center: tuple[float, ...]
    links: dict[str, BipedLink]
    soles: dict[str, tuple[float, ...]]
    sole_size: tuple[float, ...]
    gains: dict[str, float] = field(default_factory=dict)
    scale: tuple[float, float] = (1.0, 1.0)
    gait_gains: dict[str, dict[str, float]] = field(default_factory=dict)

    def speeds(self, gait: str) -> tuple[float, float]:
        """Return the slowest and fastest forward speed of a gait with feedback, m/s."""
        slowest, fastest = GAIT_SPEEDS[gait]
        factor = math.sqrt(self.scale[0])
        return factor * slowest, factor * fastest

    @property
    def total(self) -> float:
        """Total mass, kg."""
        return self.mass + sum(link.mass for link in self.links.values())

    @property
    def held(self) -> dict[str, float]:
        """Held joint -> angle, rad."""
        return {name: link.angle for name, link in self.links.items() if link.angle is not None}


def read_biped(reader: YamlReader, tree: Any, legs: Mapping[str, Collection[str]]) -> BipedBody:
    """Read the part ``biped``; ``legs`` are those of the file with their joint names."""
    tree = reader.keys(tree, 'biped', {'base', 'links', 'soles', 'sole_size'},
                       {'gains', 'scale'})
    base = reader.keys(tree['base'], 'biped.base', {'mass', 'center'})
    driven = {name for names in legs.values() for name in names}
    links: dict[str, BipedLink] = {}
    for name, link in reader.mapping(tree['links'], 'biped.links', lambda value, where: value,
                                     driven).items():
        links[name] = _link(reader, link, f'biped.links.{name}', links, name in driven)
    soles = reader.keys(tree['soles'], 'biped.soles', set(legs))

    def gain(value: Any, where: str) -> Any:
        if where.removeprefix('biped.gains.') in GAIT_SPEEDS:
            return reader.mapping(value, where, reader.number)
        return reader.number(value, where)

    gains = reader.mapping(tree.get('gains', {}), 'biped.gains', gain)
    length, mass = reader.numbers(tree.get('scale', [1.0, 1.0]), 'biped.scale', 2, positive)
    return BipedBody(
        reader.number(base['mass'], 'biped.base.mass', positive),
        reader.numbers(base['center'], 'biped.base.center', 3), links,
        {leg: reader.numbers(soles[leg], f'biped.soles.{leg}', 3) for leg in legs},
        reader.numbers(tree['sole_size'], 'biped.sole_size', 2, positive),
        {name: value for name, value in gains.items() if name not in GAIT_SPEEDS}, (length, mass),
        {name: value for name, value in gains.items() if name in GAIT_SPEEDS})


def _link(reader: YamlReader, tree: Any, where: str, before: Collection[str], driven: bool
          ) -> BipedLink:
    held = set() if driven else {'angle'}
    tree = reader.keys(tree, where, required(BipedLink) | held,
                       {'armature'} | (held and {'cell', 'swing'}))
    link = BipedLink(**reader.values(BipedLink, tree, where, cell=lambda value, _: value))
    if link.parent != BASE and link.parent not in before:
        raise reader.fail(f'{where}.parent',
                          f"'{link.parent}' is neither {BASE} nor a link before")
    length = float(np.linalg.norm(link.axis))
    if abs(length - 1.0) > 1e-3:
        raise reader.fail(f'{where}.axis', f'has the length {length:g}, not 1')
    if not (isinstance(link.cell, int) and 0 <= link.cell <= CELLS):
        raise reader.fail(f'{where}.cell', f'{link.cell!r} is not the number of a cell, 1 to '
                          f'{CELLS}')
    if link.swing and not link.cell:
        raise reader.fail(where, 'a swing needs a cell')
    return replace(link, axis=tuple(value / length for value in link.axis))


def biped_tree(biped: BipedBody) -> dict[str, Any]:
    """Return a biped as the tree that read_biped takes."""
    links = {name: {key: value for key, value in plain(link).items()
                    if link.cell or key not in ('cell', 'swing')}
             for name, link in biped.links.items()}
    gains = biped.gains | biped.gait_gains
    return plain({'base': {'mass': biped.mass, 'center': biped.center}, 'links': links,
                  'soles': biped.soles, 'sole_size': biped.sole_size}
                 | ({'scale': biped.scale} if biped.scale != (1.0, 1.0) else {})
                 | ({'gains': gains} if gains else {}))


# The feedback of a robot in its file, part ``feedback``: its own laws and gains, if it helps.

@dataclass(frozen=True, repr=False)
class OwnFeedback(ShortRepr):
    """Laws and gains of a robot's feedback that differ from the defaults.

    Attributes:
        enabled: default of the parameter ``feedback.enabled``.
        made: how the values were found, '' if unknown.
        laws: law -> whether it is on.
        gains: by name, dimensionless: lengths over the leg length l, times over sqrt(l/g).
        imu_mount: roll, pitch and yaw of the IMU's frame in the base's, rad; empty for none.

    """

    enabled: bool = True
    made: str = ''
    laws: dict[str, bool] = field(default_factory=dict)
    gains: dict[str, float] = field(default_factory=dict)
    imu_mount: tuple[float, ...] = ()


def read_feedback(reader: YamlReader, tree: Any) -> OwnFeedback:
    """Read the part ``feedback``; laws and gains are checked where they are used."""
    def mount(value: Any, where: str) -> tuple[float, ...]:
        if not isinstance(value, list) or len(value) not in (0, 3):
            raise reader.fail(where, 'must be a list of roll, pitch and yaw in rad')
        return tuple(reader.number(angle, where) for angle in value)

    return reader.record(OwnFeedback, tree, 'feedback', imu_mount=mount)


#: NUM_BINS: bins of the stride in an efference table; MAX_SPEEDS: most speeds of a table.
NUM_BINS, MAX_SPEEDS = 64, 10
#: LEG_KINDS: text for messages on the legs that feedback can displace.
LEG_KINDS = ('a hip about x (optional) and two joints about y; or, if it extends sideways, a coxa '
        'about z and two joints about one level axis; further joints are held')
#: SIGNALS: signals of the table: velocities, m/s, rates, rad/s, and angles, rad, of the base in
#: its own frame.
SIGNALS = ('forward', 'left', 'roll_rate', 'pitch_rate', 'roll', 'pitch')


@dataclass(frozen=True)
class LegGeometry:
    """A leg at joint angles of 0, in the base's frame: x forward, y left, z up, m.

    Attributes:
        joints: names of hip, thigh and calf, or of thigh and calf.
        turns: 1 or -1, sense of rotation of each joint about x, y and y, or y and y; with ``yaw``,
            of the hip about z, of the others about the level axis 90 degrees to the left.
        hip: hip joint from the base; without a hip joint, the thigh joint.
        thigh: thigh joint from the hip joint.
        calf: calf joint from the thigh joint.
        foot: middle of the foot from the calf joint.
        yaw: direction in which a leg whose hip turns about z extends, 0 forward, positive to the
            left, rad; None for other legs.
        roll: rotation about x of the other joints' axes from y, rad, for a leg that is spread at
            0.

    """

    joints: tuple[str, ...]
    turns: tuple[float, ...]
    hip: Vector
    thigh: Vector
    calf: Vector
    foot: Vector
    yaw: float | None = None
    roll: float | None = None


@dataclass(frozen=True, repr=False)
class BodyGeometry(ShortRepr):
    """Geometry of a body for feedback.

    Attributes:
        mass: of the robot, kg.
        foot_radius: m.
        legs: leg -> geometry, for legs that feedback can displace.

    """

    mass: Positive
    foot_radius: Annotated[float, lambda value: '' if value >= 0.0 else (
        f'{value:g} must not be negative')]
    legs: dict[str, LegGeometry]


@dataclass(frozen=True, repr=False)
class EfferenceTable(ShortRepr):
    """Motion of the base in an undisturbed gait, by speed and by phase of the first leg.

    Attributes:
        speeds: m/s, ascending, at most MAX_SPEEDS.
        rows: signal of SIGNALS -> a row of NUM_BINS values for each speed, means over parts of the
            stride.

    """

    speeds: tuple[float, ...]
    rows: dict[str, tuple[tuple[float, ...], ...]]


def body_geometry(mass: float, chains: Mapping[str, LegChain],
                  stand: Mapping[str, float]) -> BodyGeometry:
    """Return the geometry of a body.

    Further joints of a leg are held. Legs that match no pattern of LEG_KINDS are left out.

    Args:
        mass: of the robot, kg.
        chains: leg -> chain.
        stand: joint -> angle, rad.

    """
    legs = {}
    for leg, chain in chains.items():
        for moved in (*combinations(chain.joints, 3), *combinations(chain.joints, 2)):
            geometry = _leg_geometry(chain.holding({name: stand[name] for name in chain.joints
                                                 if name not in moved}), stand)
            if geometry is not None:
                legs[leg] = geometry
                break
    radius = float(np.mean([chains[leg].radius for leg in legs] or 0.0))
    return BodyGeometry(round(mass, 6), round(radius, 6), legs)


def _leg_geometry(chain: LegChain, stand: Mapping[str, float]) -> LegGeometry | None:
    axes, anchors, yaw, roll = chain.axes, chain.anchors, None, None
    standing, points, _ = chain.posed([stand[name] for name in chain.joints])
    if sprawls(standing):
        # Back from the stand to where its first joint is at 0.
        out = outward(standing[1], points[-1] - points[0])
        yaw = math.atan2(out[1], out[0]) - stand[chain.joints[0]] * float(np.sign(axes[0, 2]))
        yaw = round(math.remainder(yaw, 2.0 * math.pi), 6)
    elif len(axes) == 3 and abs(axes[1, 1]) < 1.0 - 1e-6:
        roll = round(math.atan2(axes[1, 2], axes[1, 1]), 6)
        roll -= math.copysign(round(math.pi, 6), roll) if axes[1, 1] < 0.0 else 0.0
    frame = leg_axes(yaw, roll)
    turns = np.sign((axes * frame.T[[0, 1, 1][-len(axes):]]).sum(axis=1))
    if (np.abs(axes - turns[:, None] * frame.T[[0, 1, 1][-len(axes):]]).max() > 0.01
            or min(chain.lengths[-2:]) < 1e-3):
        return None
    hip, thigh, calf = anchors[[0, 0, 1] if len(axes) == 2 else [0, 1, 2]]

    def rounded(point: np.ndarray) -> tuple[float, ...]:
        return tuple((np.round(point, 6) + 0.0).tolist())

    return LegGeometry(chain.joints, tuple(turns.tolist()), rounded(hip), rounded(thigh - hip),
                       rounded(calf - thigh), rounded(chain.foot - calf), yaw, roll)


def leg_axes(yaw: float | None, roll: float | None) -> np.ndarray:
    """Return the axes of a leg's frame as columns, shape (3, 3)."""
    if yaw is None:
        return rotation((roll or 0.0, 0.0, 0.0))
    c, s = math.cos(yaw), math.sin(yaw)
    return np.array([[0.0, -s, -c], [0.0, c, -s], [1.0, 0.0, 0.0]])


def read_geometry(reader: YamlReader, tree: Any,
                  legs: Mapping[str, Iterable[str]]) -> BodyGeometry:
    """Read the part ``geometry``; ``legs`` are those of the file with their joint names."""
    def read_legs(value: Any, where: str) -> dict[str, LegGeometry]:
        return {leg: _leg(reader, entry, f'{where}.{leg}', set(legs[leg]))
                for leg, entry in reader.keys(value, where, set(), set(legs)).items()}

    return reader.record(BodyGeometry, tree, 'geometry', legs=read_legs)


def _leg(reader: YamlReader, tree: Any, where: str, names: set[str]) -> LegGeometry:
    leg = reader.record(LegGeometry, tree, where)
    if len(leg.joints) not in (2, 3) or len(set(leg.joints)) < len(leg.joints):
        raise reader.fail(f'{where}.joints', 'must name hip, thigh and calf, or of '
                          'thigh and calf')
    for k, name in enumerate(leg.joints):
        if name not in names:
            raise reader.fail(f'{where}.joints[{k}]', f"'{name}' is not a joint of this leg")
    reader.numbers(list(leg.turns), f'{where}.turns', len(leg.joints),
                   lambda turn: '' if turn in (1.0, -1.0) else f'{turn:g} must be 1 or -1')
    if leg.yaw is not None and len(leg.joints) == 2:
        raise reader.fail(f'{where}.yaw', 'is of a leg of three joints, the first about z')
    for key, link in (('calf', leg.calf), ('foot', leg.foot)):
        if np.linalg.norm(link @ leg_axes(leg.yaw, leg.roll)[:, ::2]) < 1e-9:
            raise reader.fail(f'{where}.{key}', 'has no length in the plane of the leg')
    return leg


def read_efference(reader: YamlReader, tree: Any, where: str) -> EfferenceTable:
    """Read the part ``efference`` of a gait, rows of numbers with spaces between them."""
    tree = reader.keys(tree, where, {'speeds', *SIGNALS})
    speeds = reader.numbers(tree['speeds'], f'{where}.speeds')
    if len(speeds) > MAX_SPEEDS:
        raise reader.fail(f'{where}.speeds', f'has {len(speeds)} speeds; at most {MAX_SPEEDS} fit')
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
        raise reader.fail(where, f'must be {NUM_BINS} numbers with spaces between them, not '
                          f'{quoted(value)}')
    words = value.split()
    if len(words) != NUM_BINS:
        raise reader.fail(where, f'has {len(words)} numbers, not {NUM_BINS}')
    try:
        return tuple(reader.number(float(word), where) for word in words)
    except ValueError as error:
        raise reader.fail(where, f'contains something that is not a number: {error}') from error


def efference_tree(table: EfferenceTable) -> dict[str, Any]:
    """Return an efference table as the tree that ``read_efference`` takes, to four digits."""
    return {'speeds': list(table.speeds)} | {
        key: [' '.join(f'{value:.4g}' for value in row) for row in table.rows[key]]
        for key in SIGNALS}
