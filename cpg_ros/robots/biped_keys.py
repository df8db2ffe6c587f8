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

"""A biped in a robot file, part ``biped``: links and their masses, soles, servos, gains.

A link is what one joint moves. Places are those with all joints at 0, in the frame of the base (x
forward, y left, z up), so that no link needs a frame of its own.
"""

from collections.abc import Collection, Mapping, Set
from dataclasses import asdict, dataclass, field
import math
from typing import Any

from cpg_ros.files.yaml_reader import YamlReader
from cpg_ros.networks.biped import CELLS
from cpg_ros.short_repr import ShortRepr
import numpy as np

BASE = 'base'
NUMBERS = ('mass', 'kp', 'kd', 'effort', 'armature')
#: Gaits in which feedback keeps a biped up, and the speeds forward that were tried on the G1, m/s.
SPEEDS = {'walk': (-0.3, 0.6), 'run': (0.0, 1.0), 'two_legged_hop': (-0.05, 0.05),
          'two_legged_jump': (-0.05, 0.05)}


@dataclass(frozen=True)
class BipedLink:
    """A joint, the link that it moves, and the servo that drives it.

    Attributes:
        parent: joint that moves the link before, or BASE.
        axis: of the joint, a unit vector.
        anchor: a point on the axis, m.
        mass: of the link, kg.
        center: of that mass, m.
        kp: proportional gain of the servo, N m / rad.
        kd: its damping, N m s / rad.
        effort: the most it can, N m.
        armature: inertia of its rotor at the joint, kg m^2.
        angle: where a joint that is no leg's is held, rad; None of the legs' joints.
        cell: of the network that swings such a joint, from 1; 0 for none.
        swing: by how much it does at the peak of the cell's recovery variable, rad.

    """

    parent: str
    axis: tuple[float, ...]
    anchor: tuple[float, ...]
    mass: float
    center: tuple[float, ...]
    kp: float
    kd: float
    effort: float
    armature: float = 0.0
    angle: float | None = None
    cell: int = 0
    swing: float = 0.0


@dataclass(frozen=True, repr=False)
class BipedBody(ShortRepr):
    """Links of a biped with soles, parents before children.

    Attributes:
        mass: of the base, kg.
        center: of that mass, m.
        links: by the names of their joints.
        soles: middle of each leg's sole, m, by leg.
        sole_size: length and width of a sole, m.
        gains: of the feedback where they are not the usual ones, by name.
        gait_gains: the same in one gait alone, by gait and name.
        scale: height of the centre of mass and mass of the robot over those of the G1, for which
            the usual gains were found: they are scaled by them, as their units say (Froude).

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
        """Return the slowest and the fastest speed forward of a gait with feedback, m/s."""
        slowest, fastest = SPEEDS[gait]
        factor = math.sqrt(self.scale[0])
        return factor * slowest, factor * fastest

    @property
    def total(self) -> float:
        """Mass of all of it, kg."""
        return self.mass + sum(link.mass for link in self.links.values())

    @property
    def held(self) -> dict[str, float]:
        """Joints that are held, and where, rad."""
        return {name: link.angle for name, link in self.links.items() if link.angle is not None}


def read_biped(reader: YamlReader, tree: Any, legs: Mapping[str, Collection[str]]) -> BipedBody:
    """Take the part ``biped``; legs are those of the file with the names of their joints."""
    tree = reader.keys(tree, 'biped', {'base', 'links', 'soles', 'sole_size'},
                       {'gains', 'scale'})
    base = reader.keys(tree['base'], 'biped.base', {'mass', 'center'})
    driven = {name for names in legs.values() for name in names}
    links: dict[str, BipedLink] = {}
    listed = _any_keys(reader, tree['links'], 'biped.links', driven)
    for name in listed:
        links[name] = _link(reader, listed[name], f'biped.links.{name}', links, name in driven)
    soles = reader.keys(tree['soles'], 'biped.soles', set(legs))
    size = reader.numbers(tree['sole_size'], 'biped.sole_size', 2)
    for k, value in enumerate(size):
        _positive(reader, value, f'biped.sole_size[{k}]')
    gains = _any_keys(reader, tree.get('gains', {}), 'biped.gains')
    length, mass = (_positive(reader, value, f'biped.scale[{k}]') for k, value in enumerate(
        reader.numbers(tree.get('scale', [1.0, 1.0]), 'biped.scale', 2)))
    return BipedBody(
        _positive(reader, base['mass'], 'biped.base.mass'),
        reader.numbers(base['center'], 'biped.base.center', 3), links,
        {leg: reader.numbers(soles[leg], f'biped.soles.{leg}', 3) for leg in legs}, size,
        {name: reader.number(value, f'biped.gains.{name}') for name, value in gains.items()
         if name not in SPEEDS},
        (length, mass), {gait: _gait_gains(reader, gains[gait], f'biped.gains.{gait}')
                         for gait in gains if gait in SPEEDS})


def _gait_gains(reader: YamlReader, tree: Any, where: str) -> dict[str, float]:
    return {name: reader.number(value, f'{where}.{name}')
            for name, value in _any_keys(reader, tree, where).items()}


def _any_keys(reader: YamlReader, tree: Any, where: str, required: Set[str] = frozenset()
              ) -> Mapping[str, Any]:
    return reader.keys(tree, where, required, set(tree) if isinstance(tree, Mapping) else set())


def _positive(reader: YamlReader, value: Any, where: str) -> float:
    number = reader.number(value, where)
    if number <= 0.0:
        raise reader.fail(where, f'{number:g} must be positive')
    return number


def _link(reader: YamlReader, tree: Any, where: str, before: Collection[str], driven: bool
          ) -> BipedLink:
    places = ('axis', 'anchor', 'center')
    tree = reader.keys(tree, where, {'parent', *places, *NUMBERS[:4]}
                       | (set() if driven else {'angle'}),
                       {'armature'} | (set() if driven else {'cell', 'swing'}))
    parent = reader.text(tree['parent'], f'{where}.parent')
    if parent != BASE and parent not in before:
        raise reader.fail(f'{where}.parent', f"'{parent}' is neither {BASE} nor a link before")
    axis, anchor, center = (reader.numbers(tree[key], f'{where}.{key}', 3) for key in places)
    length = float(np.linalg.norm(axis))
    if abs(length - 1.0) > 1e-3:
        raise reader.fail(f'{where}.axis', f'has the length {length:g}, not 1')
    mass, kp, kd, effort, armature = (reader.number(tree.get(key, 0.0), f'{where}.{key}')
                                      for key in NUMBERS)
    for key, value in zip(NUMBERS, (mass, kp, kd, effort, armature), strict=True):
        if value < 0.0 or (value == 0.0 and key in ('kp', 'effort')):
            raise reader.fail(f'{where}.{key}', f'{value:g} must be '
                              + ('positive' if key in ('kp', 'effort') else 'at least 0'))
    angle = None if driven else reader.number(tree['angle'], f'{where}.angle')
    cell, swing = tree.get('cell', 0), reader.number(tree.get('swing', 0.0), f'{where}.swing')
    if not (isinstance(cell, int) and 0 <= cell <= CELLS):
        raise reader.fail(f'{where}.cell', f'{cell!r} is not the number of a cell, 1 to {CELLS}')
    if swing and not cell:
        raise reader.fail(where, 'a swing needs a cell')
    return BipedLink(parent, tuple(value / length for value in axis), anchor, mass, center, kp, kd,
                     effort, armature, angle, cell, swing)


def biped_tree(biped: BipedBody) -> dict[str, Any]:
    """Return a biped as the tree that read_biped takes."""
    links = {name: {key: list(value) if isinstance(value, tuple) else value
                    for key, value in asdict(link).items()
                    if value is not None and not (key in ('cell', 'swing') and not link.cell)}
             for name, link in biped.links.items()}
    tree = {'base': {'mass': biped.mass, 'center': list(biped.center)}, 'links': links,
            'soles': {leg: list(place) for leg, place in biped.soles.items()},
            'sole_size': list(biped.sole_size)}
    gains = biped.gains | biped.gait_gains
    return (tree | ({'scale': list(biped.scale)} if biped.scale != (1.0, 1.0) else {})
            | ({'gains': gains} if gains else {}))
