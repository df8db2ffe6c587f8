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

"""Robot files: reading YAML with every mistake named, and writing it.

The first part gives the cell that drives each joint, its weights and its limits; the optional
part ``gaits`` gives what differs in a gait, and how to steer it.
"""

from collections.abc import Callable, Mapping
from functools import partial
from pathlib import Path
from typing import Any

from cpg_ros.common.errors import CpgError
from cpg_ros.common.files import resource_folder, write_atomically
from cpg_ros.common.yaml_reader import quoted, YamlReader
from cpg_ros.motion.body_file import (
    biped_tree,
    efference_tree,
    feedback_tree,
    geometry_tree,
    read_biped,
    read_efference,
    read_feedback,
    read_geometry,
)
from cpg_ros.motion.robot import (
    HARMONICS,
    Joint,
    JointMotion,
    Motion,
    Robot,
    SteeringTable,
    WEIGHTS,
)
from cpg_ros.networks.leg_numbers import GIRDLES
from cpg_ros.networks.registry import find_network, NetworkError, NETWORKS, reference
import yaml

#: How many times its own frequency a gait that is steered may step, at most.
HASTE = 2.0
#: Limits of a joint.
LIMITS = ('lower', 'upper', 'velocity')
#: No angle (rad) or speed (rad/s) of a joint is larger.
LARGEST = 1e6


class RobotError(CpgError):
    """A robot file cannot be used; the message names the file, the key and the reason."""


class _Reader(YamlReader):
    """Reads networks and joints, too."""

    def networks(self, value: Any) -> tuple[str, ...]:
        names, found = value if isinstance(value, list) else [value], []
        for k, name in enumerate(self.items(names, 'network')):
            where = f'network[{k}]' if isinstance(value, list) else 'network'
            try:
                found.append(find_network(self.text(name, where), self.path.parent).name)
            except NetworkError as error:
                raise self.fail(where, str(error)) from error
        return tuple(found)

    def place(self, tree: Mapping[str, Any], where: str, key: str, words: tuple[str, ...],
              stated: str | None) -> dict[str, str]:
        """Return leg -> word if the file has it; it must agree with the network."""
        if key not in tree:
            return {}
        word = self.text(tree[key], f'{where}.{key}')
        if word not in words:
            raise self.fail(f'{where}.{key}', f"'{word}' is not one of {', '.join(words)}")
        if stated not in (None, word):
            raise self.fail(f'{where}.{key}', f"'{word}' does not agree with the network, which "
                                              f'has {stated}')
        return {where.removeprefix('legs.'): word}

    def joint(self, tree: Any, where: str, leg: str, cells: tuple[int, ...]) -> Joint:
        numbers = {'offset', 'lower', 'upper', 'velocity'}
        tree = self.keys(tree, where, numbers | {'name', 'cell'},
                         {'amplitude', 'weights', 'invented'})
        name = self.text(tree['name'], f'{where}.name')
        where = f'{where} ({name})'
        values = {key: self.number(tree[key], f'{where}.{key}') for key in sorted(numbers)}
        if type(tree['cell']) is not int or tree['cell'] not in cells:
            raise self.fail(f'{where}.cell', f"leg '{leg}' has the cells "
                            f'{" and ".join(map(str, cells))}, not {quoted(tree["cell"])}')
        weights = self.readout(tree, where)
        if not values['lower'] < values['upper']:
            raise self.fail(f'{where}.lower', f'{values["lower"]:g} is not below upper '
                            f'{values["upper"]:g}')
        self.check_limits(values['offset'], f'{where}.offset', values['lower'], values['upper'])
        if values['velocity'] <= 0.0:
            raise self.fail(f'{where}.velocity', f'{values["velocity"]:g} must be positive')
        invented: tuple[str, ...] = ()
        if 'invented' in tree:
            invented = self.guessed(tree['invented'], f'{where}.invented')
        return Joint(name=name, leg=leg, cell=tree['cell'], weights=weights, **values,
                     invented=invented)

    def check_limits(self, offset: float, where: str, lower: float, upper: float) -> None:
        if not lower <= offset <= upper:
            raise self.fail(where, f'{offset:g} is outside the limits {lower:g} to {upper:g}')

    def within(self, value: Any, where: str, low: float, high: float, span: str) -> float:
        """Return a number from low to high, which the message calls ``span``."""
        number = self.number(value, where)
        if not low <= number <= high:
            raise self.fail(where, f'{number:g} is not from {span}')
        return number

    def guessed(self, value: Any, where: str) -> tuple[str, ...]:
        """Return which limits are guesses."""
        found = tuple(self.text(key, where) for key in self.items(value, where))
        for key in found:
            if key not in LIMITS:
                raise self.fail(where, f"'{key}' is not one of {', '.join(LIMITS)}")
        return found

    def readout(self, tree: Mapping[str, Any], where: str) -> tuple[float, ...]:
        """Return the weights that 'amplitude' or 'weights' gives."""
        if ('amplitude' in tree) == ('weights' in tree):
            raise self.fail(where, "needs exactly one of 'amplitude' and 'weights'")
        if 'amplitude' in tree:
            return (self.number(tree['amplitude'], f'{where}.amplitude'),)
        return self.weights(tree['weights'], f'{where}.weights')

    def weights(self, value: Any, where: str) -> tuple[float, ...]:
        if len(self.items(value, where)) not in WEIGHTS:
            raise self.fail(where, f'takes 1, 2, 4 or 6 numbers (x, y, x^2, x y, x^3, x^2 y), '
                            f'not {len(value)}')
        return self.numbers(value, where)

    def motion(self, tree: Any, where: str, joints: Mapping[str, Joint]) -> Motion:
        """Return the motion of these joints in a gait."""
        tree = self.keys(tree, where, set(),
                         {'frequency', 'duty', 'stance', 'joints', 'steering', 'efference'})

        def given(key: str, read: Callable[..., Any], *arguments: Any) -> Any:
            return read(tree[key], f'{where}.{key}', *arguments) if key in tree else None

        frequency = given('frequency', self.within, 0.01, 10.0, '0.01 to 10 Hz')
        moved = {}
        listed = self.keys(tree.get('joints', {}), f'{where}.joints', set(), set(joints))
        for name in listed:
            place, joint = f'{where}.joints.{name}', joints[name]
            entry = self.keys(listed[name], place, set(),
                              {'offset', 'amplitude', 'weights', 'in_place'})
            offset = self.number(entry.get('offset', joint.offset), f'{place}.offset')
            self.check_limits(offset, f'{place}.offset', joint.lower, joint.upper)
            weights = joint.weights
            if 'amplitude' in entry or 'weights' in entry:
                weights = self.readout(entry, place)
            in_place: tuple[float, ...] = ()
            if 'in_place' in entry:
                in_place = self.weights(entry['in_place'], f'{place}.in_place')
            moved[name] = JointMotion(offset, weights, in_place)
        return Motion(frequency, moved, given('steering', self.steering, frequency),
                      given('efference', partial(read_efference, self)),
                      given('duty', self.within, 0.3, 0.9, '0.3 to 0.9'),
                      given('stance', self.stance))

    def stance(self, value: Any, where: str) -> tuple[float, ...]:
        found = self.numbers(value, where)
        if len(found) != 2 or not (-1.0 <= found[0] <= 1.0 and 0.05 <= found[1] <= 0.95):
            raise self.fail(where, 'takes a phase from -1 to 1 and a share of the stride from '
                            '0.05 to 0.95')
        return found

    def steering(self, tree: Any, where: str, fastest: float | None) -> SteeringTable:
        if fastest is None:
            raise self.fail(where, "needs the gait's 'frequency', too")
        columns = ('speed', 'stride', 'frequency', 'turn')
        tree = self.keys(tree, where, set(columns))
        rows = {key: self.numbers(tree[key], f'{where}.{key}') for key in columns}
        for key in columns:
            if len(rows[key]) != len(rows['speed']):
                raise self.fail(f'{where}.{key}', f'has {len(rows[key])} numbers, and speed has '
                                f'{len(rows["speed"])}')
        allowed = {'stride': (-1.0, 1.0, '-1 to 1'), 'turn': (1e-3, 1e3, '0.001 to 1000 rad/s'),
                   'frequency': (0.01, HASTE * fastest,
                                 f"0.01 to twice the gait's {fastest:g} Hz")}
        for key, (low, high, text) in allowed.items():
            for k, value in enumerate(rows[key]):
                self.within(value, f'{where}.{key}[{k}]', low, high, text)
        self.check_rising(rows['speed'], f'{where}.speed')
        return SteeringTable(**rows)


def read_robot(path: str | Path) -> Robot:
    """Read and check a robot file.

    Raises:
        RobotError: the file cannot be read or a value in it cannot be used; one line with the
            file, the key and the reason.

    """
    path = Path(path)
    reader = _Reader(path, 'robot file', RobotError, LARGEST)
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
    harmonics = tree.get('harmonics', HARMONICS)
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
        sides |= reader.place(entry, where, 'side', ('left', 'right'), first.sides.get(leg))
        girdles |= reader.place(entry, where, 'girdle', GIRDLES, first.girdles.get(leg))
        listed = reader.items(entry['joints'], f'{where}.joints')
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
                raise reader.fail(f'joint_order[{k}]', f"'{name}' appears twice")
        for name, place in seen.items():
            if name not in order:
                raise reader.fail('joint_order', f"joint '{name}' of {place} is missing")
    names = {leg: [joint.name for joint in joints] for leg, joints in legs.items()}
    geometry = (read_geometry(reader, tree['geometry'], names) if 'geometry' in tree else None)
    biped = read_biped(reader, tree['biped'], names) if 'biped' in tree else None
    feedback = read_feedback(reader, tree['feedback']) if 'feedback' in tree else None
    motions = {}
    if 'gaits' in tree:
        known = {name for network in networks for name in NETWORKS[network].presets()}
        joints_by_name = {joint.name: joint for leg in legs.values() for joint in leg}
        motions = {name: reader.motion(entry, f'gaits.{name}', joints_by_name) for name, entry
                   in reader.keys(tree['gaits'], 'gaits', set(), known).items()}
    robot = Robot(path.stem, networks, assignment, harmonics, legs, tuple(order), motions, sides,
                  girdles, geometry, biped, feedback)
    if any(motion.steering for motion in motions.values()):
        for leg in legs:
            if leg not in robot.sides:
                raise reader.fail(f'legs.{leg}.side', 'is missing: steering needs it')
    return robot


def _alike(cells: Mapping[str, tuple[int, ...]], others: Mapping[str, tuple[int, ...]]) -> bool:
    """Whether two networks have the same legs, led by the same cells; others may differ."""
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
            {'name': joint.name, 'cell': joint.cell, 'offset': joint.offset,
             'weights': list(joint.weights), 'lower': joint.lower, 'upper': joint.upper,
             'velocity': joint.velocity}
            | ({'invented': list(joint.invented)} if joint.invented else {})
            for joint in joints]}
        for key, places in (('side', robot.sides), ('girdle', robot.girdles)):
            if leg in places and not any(leg in getattr(NETWORKS[name], f'{key}s')
                                         for name in robot.networks):
                tree['legs'][leg][key] = places[leg]
    if robot.geometry is not None:
        tree['geometry'] = geometry_tree(robot.geometry)
    if robot.biped is not None:
        tree['biped'] = biped_tree(robot.biped)
    if robot.feedback is not None:
        tree['feedback'] = feedback_tree(robot.feedback)
    if robot.motions:
        tree['gaits'] = {name: _motion_tree(motion) for name, motion in robot.motions.items()}
    lines = ''.join(f'# {line}\n' for line in comment.splitlines())
    write_atomically(path, lines + yaml.safe_dump(tree, sort_keys=False, default_flow_style=None,
                                                  width=96))


def _motion_tree(motion: Motion) -> dict[str, Any]:
    tree: dict[str, Any] = {key: value for key in ('frequency', 'duty')
                            if (value := getattr(motion, key)) is not None}
    if motion.stance is not None:
        tree['stance'] = list(motion.stance)
    if motion.joints:
        tree['joints'] = {
            name: {'offset': joint.offset, 'weights': list(joint.weights)}
            | ({'in_place': list(joint.in_place)} if joint.in_place else {})
            for name, joint in motion.joints.items()}
    if motion.steering is not None:
        tree['steering'] = {key: list(values) for key, values in vars(motion.steering).items()}
    if motion.efference is not None:
        tree['efference'] = efference_tree(motion.efference)
    return tree
