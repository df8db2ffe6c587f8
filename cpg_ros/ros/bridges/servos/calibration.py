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

"""Calibration files of servos: the servo of each joint, and the scale of its units."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from cpg_ros.common.errors import CpgError, ShortRepr
from cpg_ros.common.yaml_reader import quoted, within, YamlReader
import numpy as np


class CalibrationError(CpgError):
    """A calibration file cannot be used; the message names the file, the key and the reason."""


@dataclass(frozen=True)
class Kind:
    """Limits of a kind of board.

    Attributes:
        last: largest channel or identity.
        most: largest position in its units.
        options: its keys in the file, with defaults and limits.

    """

    last: int
    most: int
    options: Mapping[str, tuple[float, float, float]]


_SERIAL_SETTINGS = {'baud': (1_000_000, 9600, 4_000_000)}
#: BOARDS: name of a board -> its kind. A pulse is limited by its period, too.
BOARDS = {'pca9685': Kind(15, 20_000, {'address': (0x40, 0x03, 0x77),
                                       'frequency': (50.0, 40.0, 400.0)}),
          'dynamixel': Kind(252, 4095, _SERIAL_SETTINGS),
          'feetech_sts': Kind(253, 4095, _SERIAL_SETTINGS),
          'feetech_scs': Kind(253, 1023, _SERIAL_SETTINGS)}
_SERVO_KEYS = {'channel', 'centre', 'direction', 'per_rad', 'lower', 'upper', 'rest'}


@dataclass(frozen=True, eq=False, repr=False)
class Calibration(ShortRepr):
    """A board, and a servo for each joint; arrays have shape (servos,).

    Attributes:
        board: one of BOARDS.
        device: path of the bus.
        options: of the board.
        joints: names, in the order of the file.
        channels: of the PCA9685, or identities of serial servos.
        centre: units at the angle 0.
        per_rad: units per radian, negative for a servo with the opposite sign.
        lower: smallest units.
        upper: largest units.
        rest: angles of the lying robot, rad.

    """

    board: str
    device: str
    options: Mapping[str, float]
    joints: tuple[str, ...]
    channels: tuple[int, ...]
    centre: np.ndarray
    per_rad: np.ndarray
    lower: np.ndarray
    upper: np.ndarray
    rest: np.ndarray

    def units(self, angles: np.ndarray) -> np.ndarray:
        """Return the units of angles, rad: whole numbers within the servos' limits."""
        targets = np.clip(self.centre + self.per_rad * angles, self.lower, self.upper)
        return np.round(targets).astype(int)

    def angles(self, units: np.ndarray) -> np.ndarray:
        """Return the angles of units, rad."""
        return (units - self.centre) / self.per_rad


class _Reader(YamlReader):
    def servo(self, tree: Any, name: str, kind: Kind, most: float) -> list[float]:
        where = f'servos.{name}'
        tree = self.keys(tree, where, _SERVO_KEYS)
        value = {key: self.number(tree[key], f'{where}.{key}') for key in sorted(_SERVO_KEYS)}
        channel = tree['channel']
        if type(channel) is not int or not 0 <= channel <= kind.last:
            raise self.fail(f'{where}.channel',
                            f'{quoted(channel)} is not one of 0 to {kind.last}')
        if value['direction'] not in (1.0, -1.0):
            raise self.fail(f'{where}.direction', f'{value["direction"]:g} is neither 1 nor -1')
        if value['per_rad'] <= 0.0:
            raise self.fail(f'{where}.per_rad', f'{value["per_rad"]:g} must be positive; '
                            'direction has the sign')
        if not 0.0 <= value['lower'] < value['upper'] <= most:
            raise self.fail(f'{where}.lower', f'{value["lower"]:g} to upper '
                            f'{value["upper"]:g} is not a range within 0 to {most:g}')
        scale = value['direction'] * value['per_rad']
        for key, units in (('centre', value['centre']),
                           ('rest', value['centre'] + scale * value['rest'])):
            if not value['lower'] <= units <= value['upper']:
                raise self.fail(f'{where}.{key}', f'is at {units:g}, outside '
                                f'{value["lower"]:g} to {value["upper"]:g}')
        return [channel, value['centre'], scale, value['lower'], value['upper'], value['rest']]


def load_calibration(path: str | Path) -> Calibration:
    """Read a calibration file.

    Raises:
        CalibrationError: there is no such file, or it cannot be used.

    """
    reader = _Reader(Path(path).expanduser(), 'calibration file', CalibrationError, 1e7)
    tree = reader.tree()
    board = tree.get('board') if isinstance(tree, Mapping) else None
    kind = BOARDS.get(board) if isinstance(board, str) else None
    if kind is None:
        raise reader.fail('board', f'{quoted(board)} is not one of {", ".join(BOARDS)}')
    tree = reader.keys(tree, 'file', {'board', 'device', 'servos'}, set(kind.options))
    options = {key: reader.number(tree.get(key, default), key, within(low, high))
               for key, (default, low, high) in kind.options.items()}
    most = min(kind.most, 1e6 / options.get('frequency', 1.0))
    servos = tree['servos']
    if not isinstance(servos, Mapping) or not servos:
        raise reader.fail('servos', f'must map joints to servos, not {quoted(servos)}')
    rows = [reader.servo(servo, name, kind, most) for name, servo in servos.items()]
    channels = tuple(int(row[0]) for row in rows)
    for k, channel in enumerate(channels):
        if channel in channels[:k]:
            raise reader.fail('servos', f'channel {channel} moves two joints')
    columns = np.array(rows, dtype=float)[:, 1:].T
    return Calibration(str(board), reader.text(tree['device'], 'device'), options, tuple(servos),
                       channels, *columns)
