"""Robot files: legs, joints, which cell drives each joint and how, and the joints' limits.

A joint's angle is ``offset + amplitude * sum_k w_k psi_k(x, y)``: x is its cell over the gait's
peak, y the derivative of that by phase (in radians), psi = x, y, x^2, x y, x^3, x^2 y
(DESIGN 3). On every gait x runs from -1 to 1, so weights are in radians.
"""

import math
from collections.abc import Mapping, Set
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import yaml

from cpg_ros.networks import delayed

#: Network -> leg -> cells (numbered from 1), the first of which gives the leg's phase.
LEGS: dict[str, Mapping[str, tuple[int, ...]]] = {'delayed': delayed.LEGS}

#: No angle (rad) or speed (rad/s) of a joint is larger.
LARGEST = 1e6

#: How many weights each readout order takes; the bare scale is an order of its own.
WEIGHTS = (1, 2, 4, 6)


class RobotError(ValueError):
    """A robot file cannot be used; the message names the file, the key and the reason."""


@dataclass(frozen=True)
class Joint:
    """One joint: name, leg, cell from 1; offset, weights, lower, upper in rad; velocity rad/s."""

    name: str
    leg: str
    cell: int
    offset: float
    weights: tuple[float, ...]
    lower: float
    upper: float
    velocity: float


@dataclass(frozen=True)
class Robot:
    """Legs and joints of a robot, joints grouped by leg in the order of the file.

    Attributes:
        name: the file's stem.
        network: the network whose cells drive it.
        legs: leg -> its joints.
        order: all joints' names in the order in which controllers take them.

    """

    name: str
    network: str
    legs: dict[str, tuple[Joint, ...]]
    order: tuple[str, ...]

    @property
    def joints(self) -> tuple[Joint, ...]:
        """All joints, leg by leg."""
        return tuple(joint for leg in self.legs.values() for joint in leg)

    @property
    def cells(self) -> np.ndarray:
        """Index from 0 of the cell behind each joint, shape (joints,)."""
        return np.array([joint.cell - 1 for joint in self.joints])

    @property
    def weights(self) -> np.ndarray:
        """Readout weights in rad, shape (joints, 6), zero above a joint's own order."""
        table = np.zeros((len(self.joints), WEIGHTS[-1]))
        for row, joint in zip(table, self.joints, strict=True):
            row[:len(joint.weights)] = joint.weights
        return table

    def column(self, key: str) -> np.ndarray:
        """One number of every joint (offset, lower, upper or velocity), shape (joints,)."""
        return np.array([getattr(joint, key) for joint in self.joints], dtype=float)

    @property
    def leg_cells(self) -> np.ndarray:
        """Index from 0 of the cell that gives each leg's phase, shape (legs,)."""
        return np.array([LEGS[self.network][leg][0] - 1 for leg in self.legs])


class _UniqueKeys(yaml.SafeLoader):
    """YAML without silently overwritten keys."""

    def construct_mapping(self, node: yaml.MappingNode, deep: bool = False) -> dict:
        seen = set()
        for key_node, _ in node.value:
            key = self.construct_object(key_node, deep=True)
            if not isinstance(key, str):
                raise yaml.constructor.ConstructorError(
                    None, None, f'the key {_shown(key)} is not a name', key_node.start_mark)
            if key in seen:
                raise yaml.constructor.ConstructorError(
                    None, None, f"the key '{key}' is there twice", key_node.start_mark)
            seen.add(key)
        return super().construct_mapping(node, deep)


class _Reader:
    """Reads checked values out of one file's tree, and says where a bad one stands."""

    def __init__(self, path: Path) -> None:
        self.path = path

    def fail(self, where: str, why: str) -> RobotError:
        return RobotError(' '.join(f'robot file {self.path}: {where}: {why}'.split()))

    def keys(self, tree: Any, where: str, required: Set[str], optional: Set[str] = frozenset()
             ) -> Mapping[str, Any]:
        if not isinstance(tree, Mapping):
            raise self.fail(where, f'must be a mapping, not {_shown(tree)}')
        for key in tree:
            if key not in required | optional:
                allowed = ', '.join(sorted(required | optional))
                raise self.fail(f'{where}.{key}', f'unknown key (allowed: {allowed})')
        for key in sorted(required - set(tree)):
            raise self.fail(f'{where}.{key}', 'is missing')
        return tree

    def number(self, value: Any, where: str) -> float:
        if isinstance(value, bool) or not isinstance(value, int | float):
            raise self.fail(where, f'must be a number, not {_shown(value)}')
        if value != value or value in (math.inf, -math.inf):
            raise self.fail(where, f'must be finite, not {value}')
        if abs(value) > LARGEST:
            raise self.fail(where, f'must be at most {LARGEST:g}, not {_shown(value)}')
        return float(value)

    def text(self, value: Any, where: str) -> str:
        if not isinstance(value, str) or not value.strip():
            raise self.fail(where, f'must be a name, not {_shown(value)}')
        return value

    def items(self, value: Any, where: str) -> list:
        if not isinstance(value, list) or not value:
            raise self.fail(where, f'must be a list with at least one entry, not {_shown(value)}')
        return value

    def joint(self, tree: Any, where: str, leg: str, cells: tuple[int, ...]) -> Joint:
        numbers = {'offset', 'lower', 'upper', 'velocity'}
        tree = self.keys(tree, where, numbers | {'name', 'cell'}, {'amplitude', 'weights'})
        name = self.text(tree['name'], f'{where}.name')
        where = f'{where} ({name})'
        values = {key: self.number(tree[key], f'{where}.{key}') for key in sorted(numbers)}
        if type(tree['cell']) is not int or tree['cell'] not in cells:
            raise self.fail(f'{where}.cell', f"leg '{leg}' has the cells "
                            f'{" and ".join(map(str, cells))}, not {_shown(tree["cell"])}')
        if ('amplitude' in tree) == ('weights' in tree):
            raise self.fail(where, "needs exactly one of 'amplitude' and 'weights'")
        if 'amplitude' in tree:
            weights = [self.number(tree['amplitude'], f'{where}.amplitude')]
        else:
            listed = self.items(tree['weights'], f'{where}.weights')
            if len(listed) not in WEIGHTS:
                raise self.fail(f'{where}.weights', f'takes 1, 2, 4 or 6 numbers (x, y, x^2, x y, '
                                f'x^3, x^2 y), not {len(listed)}')
            weights = [self.number(value, f'{where}.weights[{k}]')
                       for k, value in enumerate(listed)]
        if not values['lower'] < values['upper']:
            raise self.fail(f'{where}.lower', f'{values["lower"]:g} is not below upper '
                            f'{values["upper"]:g}')
        if not values['lower'] <= values['offset'] <= values['upper']:
            raise self.fail(f'{where}.offset', f'{values["offset"]:g} is outside the limits '
                            f'{values["lower"]:g} to {values["upper"]:g}')
        if values['velocity'] <= 0.0:
            raise self.fail(f'{where}.velocity', f'{values["velocity"]:g} must be positive')
        return Joint(name=name, leg=leg, cell=tree['cell'], weights=tuple(weights), **values)


def _shown(value: Any) -> str:
    return 'nothing' if value is None else repr(value)[:60]


def load_robot(path: str | Path) -> Robot:
    """Read and check a robot file.

    Raises:
        RobotError: the file cannot be read or a value in it cannot be used; one line with the
            file, the key and the reason.

    """
    path = Path(path)
    reader = _Reader(path)
    try:
        tree = yaml.load(path.read_text(encoding='utf-8'), Loader=_UniqueKeys)
    except OSError as error:
        raise RobotError(f'robot file {path}: {error.strerror}') from error
    except (yaml.YAMLError, UnicodeDecodeError) as error:
        mark = getattr(error, 'problem_mark', None)
        line = f'line {mark.line + 1}' if mark else 'file'
        raise reader.fail(line, str(getattr(error, 'problem', error))) from error

    tree = reader.keys(tree, 'file', {'network', 'legs'}, {'joint_order'})
    network = reader.text(tree['network'], 'network')
    if network not in LEGS:
        raise reader.fail('network', f"'{network}' is not one of {', '.join(LEGS)}")
    cells = LEGS[network]
    reader.keys(tree['legs'], 'legs', set(cells))

    legs: dict[str, tuple[Joint, ...]] = {}
    seen: dict[str, str] = {}
    for leg in tree['legs']:
        where = f'legs.{leg}'
        listed = reader.items(reader.keys(tree['legs'][leg], where, {'joints'})['joints'],
                              f'{where}.joints')
        joints = []
        for k, entry in enumerate(listed):
            place = f'{where}.joints[{k}]'
            joint = reader.joint(entry, place, leg, cells[leg])
            if joint.name in seen:
                raise reader.fail(f'{place}.name', f"'{joint.name}' is also the name of "
                                  f'{seen[joint.name]}')
            seen[joint.name] = place
            joints.append(joint)
        legs[leg] = tuple(joints)

    order = list(seen)
    if 'joint_order' in tree:
        order = [reader.text(name, f'joint_order[{k}]')
                 for k, name in enumerate(reader.items(tree['joint_order'], 'joint_order'))]
        for k, name in enumerate(order):
            if name not in seen:
                raise reader.fail(f'joint_order[{k}]', f"joint '{name}' is missing from the legs")
            if name in order[:k]:
                raise reader.fail(f'joint_order[{k}]', f"'{name}' is there twice")
        for name, place in seen.items():
            if name not in order:
                raise reader.fail('joint_order', f"joint '{name}' of {place} is missing")
    return Robot(path.stem, network, legs, tuple(order))
