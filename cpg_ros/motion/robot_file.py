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

"""Robot files: read YAML and name every mistake, and write it.

The first part gives the cell that drives each joint, its weights and its limits; the optional part
``gaits`` gives what differs in a gait, and how to steer it.
"""

from collections.abc import Mapping
from functools import partial
from pathlib import Path
from typing import Any

from cpg_ros.common.errors import CpgError
from cpg_ros.common.files import resource_folder
from cpg_ros.common.yaml_reader import plain, quoted, required, within, write_yaml, YamlReader
from cpg_ros.motion.body_file import (
    biped_tree,
    efference_tree,
    read_biped,
    read_efference,
    read_feedback,
    read_geometry,
)
from cpg_ros.motion.robot import (
    Joint,
    JointMotion,
    Motion,
    NUM_HARMONICS,
    Robot,
    SteeringTable,
    WEIGHT_COUNTS,
)
from cpg_ros.networks.leg_numbers import GIRDLES
from cpg_ros.networks.registry import find_network, NetworkError, NETWORKS, reference

#: MAX_FREQUENCY_RATIO: largest frequency of a steered gait, as a multiple of the gait's own.
MAX_FREQUENCY_RATIO = 2.0
#: Limits of a joint.
LIMITS = ('lower', 'upper', 'velocity')
#: MAX_NUMBER: largest number that a robot file may state, such as an angle, rad, or speed, rad/s.
MAX_NUMBER = 1e6


class RobotError(CpgError):
    """A robot file cannot be used; the message names the file, the key and the reason."""


class _Reader(YamlReader):
    """Reader that knows networks and joints."""

    def networks(self, value: Any) -> tuple[str, ...]:
        names, networks = value if isinstance(value, list) else [value], []
        for k, name in enumerate(self.items(names, 'network')):
            where = f'network[{k}]' if isinstance(value, list) else 'network'
            try:
                networks.append(find_network(self.text(name, where), self.path.parent).name)
            except NetworkError as error:
                raise self.fail(where, str(error)) from error
        return tuple(networks)

    def side(self, tree: Mapping[str, Any], where: str, key: str, words: tuple[str, ...],
             stated: str | None) -> dict[str, str]:
        """Return leg -> word if the file has it; it must agree with the network."""
        if key not in tree:
            return {}
        word = self.name_of(tree[key], f'{where}.{key}', words)
        if stated not in (None, word):
            raise self.fail(f'{where}.{key}', f"'{word}' does not agree with the network, which "
                                              f'has {stated}')
        return {where.removeprefix('legs.'): word}

    def joint(self, tree: Any, where: str, leg: str, cells: tuple[int, ...]) -> Joint:
        tree = self.keys(tree, where, required(Joint) - {'leg', 'weights'},
                         {'amplitude', 'weights', 'invented'})
        where = f'{where} ({self.text(tree["name"], f"{where}.name")})'
        joint = Joint(leg=leg, **self.values(
            Joint, {'weights': None, **tree}, where, cell=lambda value, _: value,
            weights=lambda *_: self.readout(tree, where),
            invented=lambda value, where_in_file: tuple(
                self.name_of(key, where_in_file, LIMITS)
                for key in self.items(value, where_in_file))))
        if type(joint.cell) is not int or joint.cell not in cells:
            raise self.fail(f'{where}.cell', f"leg '{leg}' has the cells "
                            f'{" and ".join(map(str, cells))}, not {quoted(joint.cell)}')
        if not joint.lower < joint.upper:
            raise self.fail(f'{where}.lower', f'{joint.lower:g} is not below upper '
                            f'{joint.upper:g}')
        self.check_limits(joint.offset, f'{where}.offset', joint.lower, joint.upper)
        return joint

    def check_limits(self, offset: float, where: str, lower: float, upper: float) -> None:
        if not lower <= offset <= upper:
            raise self.fail(where, f'{offset:g} is outside the limits {lower:g} to {upper:g}')

    def readout(self, tree: Mapping[str, Any], where: str) -> tuple[float, ...]:
        """Return the weights that 'amplitude' or 'weights' gives."""
        if ('amplitude' in tree) == ('weights' in tree):
            raise self.fail(where, "needs exactly one of 'amplitude' and 'weights'")
        if 'amplitude' in tree:
            return (self.number(tree['amplitude'], f'{where}.amplitude'),)
        return self.weights(tree['weights'], f'{where}.weights')

    def weights(self, value: Any, where: str) -> tuple[float, ...]:
        if len(self.items(value, where)) not in WEIGHT_COUNTS:
            raise self.fail(where, f'takes 1, 2, 4 or 6 numbers (x, y, x^2, x y, x^3, x^2 y), '
                            f'not {len(value)}')
        return self.numbers(value, where)

    def motion(self, tree: Any, where: str, joints: Mapping[str, Joint]) -> Motion:
        """Return the motion of these joints in a gait."""
        def moved(value: Any, where: str) -> dict[str, JointMotion]:
            return {name: self.joint_motion(entry, f'{where}.{name}', joints[name])
                    for name, entry in self.keys(value, where, set(), set(joints)).items()}

        def steering(value: Any, where: str) -> SteeringTable:
            return self.steering(value, where, tree.get('frequency'))

        return self.record(Motion, tree, where, joints=moved, steering=steering,
                           efference=partial(read_efference, self), stance=self.stance)

    def joint_motion(self, tree: Any, where: str, joint: Joint) -> JointMotion:
        tree = self.keys(tree, where, set(), {'offset', 'amplitude', 'weights', 'in_place'})
        offset = self.number(tree.get('offset', joint.offset), f'{where}.offset')
        self.check_limits(offset, f'{where}.offset', joint.lower, joint.upper)
        weights = joint.weights
        if 'amplitude' in tree or 'weights' in tree:
            weights = self.readout(tree, where)
        return JointMotion(offset, weights, self.weights(tree['in_place'], f'{where}.in_place')
                           if 'in_place' in tree else ())

    def stance(self, value: Any, where: str) -> tuple[float, ...]:
        stance = self.numbers(value, where)
        if len(stance) != 2 or not (-1.0 <= stance[0] <= 1.0 and 0.05 <= stance[1] <= 0.95):
            raise self.fail(where, 'takes a phase from -1 to 1 and a fraction of the stride from '
                            '0.05 to 0.95')
        return stance

    def steering(self, tree: Any, where: str, fastest: float | None) -> SteeringTable:
        if fastest is None:
            raise self.fail(where, "needs the gait's 'frequency', too")
        table = self.record(SteeringTable, tree, where)
        for key, column in plain(table).items():
            if len(column) != len(table.speed):
                raise self.fail(f'{where}.{key}', f'has {len(column)} numbers, and speed has '
                                f'{len(table.speed)}')
        self.numbers(list(table.frequency), f'{where}.frequency', check=within(
            0.01, MAX_FREQUENCY_RATIO * fastest, f"0.01 to twice the gait's {fastest:g} Hz"))
        self.check_rising(table.speed, f'{where}.speed')
        return table


def read_robot(path: str | Path) -> Robot:
    """Read and check a robot file.

    Raises:
        RobotError: the file cannot be read, or a value cannot be used.

    """
    path = Path(path)
    reader = _Reader(path, 'robot file', RobotError, MAX_NUMBER)
    tree = reader.keys(reader.tree(), 'file', {'network', 'legs'},
                       {'joint_order', 'assignment', 'harmonics', 'geometry', 'biped',
                        'feedback', 'gaits'})
    networks = reader.networks(tree['network'])
    first = NETWORKS[networks[0]]
    assignment = reader.text(tree.get('assignment', next(iter(first.legs))), 'assignment')
    for name in networks:
        if assignment not in NETWORKS[name].legs:
            raise reader.fail('assignment', f"'{assignment}' is not one of the network {name}: "
                              f'{", ".join(NETWORKS[name].legs)}')
        if not _alike(NETWORKS[name].legs[assignment], first.legs[assignment]):
            raise reader.fail('network', f"'{name}' has other legs or cells than '{networks[0]}'")
    harmonics = tree.get('harmonics', NUM_HARMONICS)
    if type(harmonics) is not int or not 1 <= harmonics <= 32:
        raise reader.fail('harmonics', f'must be a whole number from 1 to 32, not '
                          f'{quoted(harmonics)}')
    cells = {leg: tuple(cell for cell in own if all(
        cell in NETWORKS[name].legs[assignment][leg] for name in networks))
        for leg, own in first.legs[assignment].items()}
    reader.keys(tree['legs'], 'legs', set(cells))

    legs: dict[str, tuple[Joint, ...]] = {}
    sides: dict[str, str] = {}
    girdles: dict[str, str] = {}
    seen: dict[str, str] = {}
    for leg in tree['legs']:
        where = f'legs.{leg}'
        entry = reader.keys(tree['legs'][leg], where, {'joints'}, {'side', 'girdle'})
        sides |= reader.side(entry, where, 'side', ('left', 'right'), first.sides.get(leg))
        girdles |= reader.side(entry, where, 'girdle', GIRDLES, first.girdles.get(leg))
        joints = []
        for k, item in enumerate(reader.items(entry['joints'], f'{where}.joints')):
            where_in_file = f'{where}.joints[{k}]'
            joints.append(joint := reader.joint(item, where_in_file, leg, cells[leg]))
            if joint.name in seen:
                raise reader.fail(f'{where_in_file}.name', f"'{joint.name}' is also the name of "
                                  f'{seen[joint.name]}')
            seen[joint.name] = where_in_file
        legs[leg] = tuple(joints)

    order = reader.texts(tree.get('joint_order', list(seen)), 'joint_order')
    for k, name in enumerate(order):
        if name not in seen:
            raise reader.fail(f'joint_order[{k}]', f"joint '{name}' is missing from the legs")
        if name in order[:k]:
            raise reader.fail(f'joint_order[{k}]', f"'{name}' appears twice")
    for name, where_in_file in seen.items():
        if name not in order:
            raise reader.fail('joint_order', f"joint '{name}' of {where_in_file} is missing")
    names = {leg: [joint.name for joint in joints] for leg, joints in legs.items()}
    geometry = (read_geometry(reader, tree['geometry'], names) if 'geometry' in tree else None)
    biped = read_biped(reader, tree['biped'], names) if 'biped' in tree else None
    feedback = read_feedback(reader, tree['feedback']) if 'feedback' in tree else None
    motions = {}
    if 'gaits' in tree:
        gaits_of_networks = {name for network in networks for name in NETWORKS[network].presets()}
        joints_by_name = {joint.name: joint for leg in legs.values() for joint in leg}
        motions = {name: reader.motion(entry, f'gaits.{name}', joints_by_name) for name, entry
                   in reader.keys(tree['gaits'], 'gaits', set(), gaits_of_networks).items()}
    robot = Robot(path.stem, networks, assignment, harmonics, legs, order, motions, sides,
                  girdles, geometry, biped, feedback)
    if any(motion.steering for motion in motions.values()):
        for leg in legs:
            if leg not in robot.sides:
                raise reader.fail(f'legs.{leg}.side', 'is missing: steering needs it')
    return robot


def _alike(cells: Mapping[str, tuple[int, ...]], others: Mapping[str, tuple[int, ...]]) -> bool:
    """Tell whether two networks have the same legs with the same first cells."""
    return set(cells) == set(others) and all(cells[leg][0] == others[leg][0] for leg in cells)


def load_robot(name: str | Path) -> Robot:
    """Load a robot file, or a shipped one by its bare name; angles in rad, speeds in rad/s.

    Raises:
        RobotError: there is no such file, or it cannot be used.

    """
    if isinstance(name, Path) or name.endswith(('.yaml', '.yml')) or '/' in name:
        return read_robot(Path(name).expanduser())
    path = resource_folder('config') / f'{name}.yaml'
    if not path.is_file():
        shipped = ', '.join(sorted(file.stem for file in path.parent.glob('*.yaml')))
        raise RobotError(f"robot '{name}' is neither a .yaml file nor one of: {shipped}")
    return read_robot(path)


def write_robot(path: str | Path, robot: Robot, comment: str = '') -> None:
    """Write a robot file that read_robot reads back; the name is that of the file."""
    tree: dict[str, Any] = {'network': [reference(name) for name in robot.networks],
                            'assignment': robot.assignment,
                            'harmonics': robot.harmonics, 'joint_order': list(robot.order),
                            'legs': {}}
    for leg, joints in robot.legs.items():
        tree['legs'][leg] = {'joints': [
            {key: value for key, value in plain(joint).items() if key != 'leg'}
            for joint in joints]}
        for key, places in (('side', robot.sides), ('girdle', robot.girdles)):
            if leg in places and not any(leg in getattr(NETWORKS[name], f'{key}s')
                                         for name in robot.networks):
                tree['legs'][leg][key] = places[leg]
    tree |= {'geometry': robot.geometry, 'biped': robot.biped and biped_tree(robot.biped),
             'feedback': robot.feedback,
             'gaits': {name: _motion_tree(motion) for name, motion in robot.motions.items()}}
    tree = {key: plain(value) for key, value in tree.items() if value}
    write_yaml(path, tree, comment)


def _motion_tree(motion: Motion) -> dict[str, Any]:
    tree = {**plain(motion), 'efference': motion.efference and efference_tree(motion.efference)}
    return {key: tree[key] for key in ('verdict', 'frequency', 'duty', 'stance', 'joints',
                                       'steering', 'efference') if tree.get(key)}
