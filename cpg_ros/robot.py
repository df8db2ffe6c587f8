"""Robot files: legs, joints, which cell drives each joint and how, and the joints' limits.

A joint's angle is ``offset + amplitude * sum_k w_k psi_k(x, y)``: x is its cell's waveform (of a
Morris-Lecar cell: the first harmonics of it), y the derivative of that by phase (in radians),
psi = x, y, x^2, x y, x^3, x^2 y (DESIGN 3). On every gait x runs from -1 to 1, so weights are in
radians.
"""

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import yaml

from cpg_ros.checked import Reader, shown
from cpg_ros.networks.registry import NETWORKS
from cpg_ros.share import share
from cpg_ros.whole import write_whole

#: No angle (rad) or speed (rad/s) of a joint is larger.
LARGEST = 1e6

#: Harmonics of a Morris-Lecar cell that joints follow, if the file does not say.
HARMONICS = 3

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
        networks: names of the networks whose cells can drive it; all have the same legs.
        assignment: which of their cells drive which leg.
        harmonics: of a Morris-Lecar cell's waveform that joints follow.
        legs: leg -> its joints.
        order: all joints' names in the order in which controllers take them.

    """

    name: str
    networks: tuple[str, ...]
    assignment: str
    harmonics: int
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
        cells = NETWORKS[self.networks[0]].legs[self.assignment]
        return np.array([cells[leg][0] - 1 for leg in self.legs])


class _Reader(Reader):
    """Reads networks and joints, too."""

    def networks(self, value: Any) -> tuple[str, ...]:
        names = value if isinstance(value, list) else [value]
        for k, name in enumerate(self.items(names, 'network')):
            where = f'network[{k}]' if isinstance(value, list) else 'network'
            if self.text(name, where) not in NETWORKS:
                raise self.fail(where, f"'{name}' is not one of {', '.join(NETWORKS)}")
        return tuple(names)

    def joint(self, tree: Any, where: str, leg: str, cells: tuple[int, ...]) -> Joint:
        numbers = {'offset', 'lower', 'upper', 'velocity'}
        tree = self.keys(tree, where, numbers | {'name', 'cell'}, {'amplitude', 'weights'})
        name = self.text(tree['name'], f'{where}.name')
        where = f'{where} ({name})'
        values = {key: self.number(tree[key], f'{where}.{key}') for key in sorted(numbers)}
        if type(tree['cell']) is not int or tree['cell'] not in cells:
            raise self.fail(f'{where}.cell', f"leg '{leg}' has the cells "
                            f'{" and ".join(map(str, cells))}, not {shown(tree["cell"])}')
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


def load_robot(path: str | Path) -> Robot:
    """Read and check a robot file.

    Raises:
        RobotError: the file cannot be read or a value in it cannot be used; one line with the
            file, the key and the reason.

    """
    path = Path(path)
    reader = _Reader(path, 'robot file', RobotError, LARGEST)
    tree = reader.keys(reader.tree(), 'file', {'network', 'legs'},
                       {'joint_order', 'assignment', 'harmonics'})
    networks = reader.networks(tree['network'])
    first = NETWORKS[networks[0]]
    assignment = reader.text(tree.get('assignment', next(iter(first.legs))), 'assignment')
    for name in networks:
        if assignment not in NETWORKS[name].legs:
            raise reader.fail('assignment', f"'{assignment}' is not one of the network {name}: "
                              f'{", ".join(NETWORKS[name].legs)}')
        if NETWORKS[name].legs[assignment] != first.legs[assignment]:
            raise reader.fail('network', f"'{name}' has other legs or cells than '{networks[0]}'")
    harmonics = tree.get('harmonics', HARMONICS)
    if type(harmonics) is not int or not 1 <= harmonics <= 32:
        raise reader.fail('harmonics', f'must be a whole number from 1 to 32, not '
                          f'{shown(harmonics)}')
    cells = first.legs[assignment]
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
    return Robot(path.stem, networks, assignment, harmonics, legs, tuple(order))


def find_robot(name: str) -> Robot:
    """Load a robot file, or a shipped one by its bare name.

    Raises:
        RobotError: there is no such file, or it cannot be used.

    """
    if name.endswith(('.yaml', '.yml')) or '/' in name:
        return load_robot(Path(name).expanduser())
    path = share() / 'config' / f'{name}.yaml'
    if not path.is_file():
        shipped = ', '.join(sorted(file.stem for file in path.parent.glob('*.yaml')))
        raise RobotError(f"robot '{name}' is neither a .yaml file nor one of: {shipped}")
    return load_robot(path)


def write_robot(path: str | Path, robot: Robot, comment: str = '') -> None:
    """Write a robot file that load_robot reads back; the name is that of the file."""
    tree: dict[str, Any] = {'network': list(robot.networks), 'assignment': robot.assignment,
                            'harmonics': robot.harmonics, 'joint_order': list(robot.order),
                            'legs': {}}
    for leg, joints in robot.legs.items():
        tree['legs'][leg] = {'joints': [
            {'name': joint.name, 'cell': joint.cell, 'offset': joint.offset,
             'weights': list(joint.weights), 'lower': joint.lower, 'upper': joint.upper,
             'velocity': joint.velocity} for joint in joints]}
    lines = ''.join(f'# {line}\n' for line in comment.splitlines())
    write_whole(path, lines + yaml.safe_dump(tree, sort_keys=False, default_flow_style=None,
                                             width=96))
