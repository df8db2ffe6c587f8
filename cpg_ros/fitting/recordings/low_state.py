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

"""Unitree's ``LowState`` messages in bulk, of quadrupeds (unitree_go) and humanoids (unitree_hg).

They have no stamps and no names. A quadruped's motors are FR, FL, RR, RL with hip, thigh and calf
each, and its feet have the same order; a humanoid's are by default those of a G1.
"""

from collections.abc import Iterator, Sequence
from itertools import chain

from cpg_ros.fitting.recordings.cdr import SerializedBlock, UndecodableError
import numpy as np

#: LOW_STATE: message of the four-legged robots; HUMANOID_STATE: message of the humanoids.
LOW_STATE, HUMANOID_STATE = 'unitree_go/msg/LowState', 'unitree_hg/msg/LowState'
_ARM = ('shoulder_pitch', 'shoulder_roll', 'shoulder_yaw', 'elbow', 'wrist_roll', 'wrist_pitch',
        'wrist_yaw')
_LEG = ('hip_pitch', 'hip_roll', 'hip_yaw', 'knee', 'ankle_pitch', 'ankle_roll')
#: MOTOR_NAMES: kind of message -> default names, those of Unitree's URDF.
MOTOR_NAMES = {
    LOW_STATE: tuple(f'{leg}_{part}_joint' for leg in ('FR', 'FL', 'RR', 'RL')
                     for part in ('hip', 'thigh', 'calf')),
    HUMANOID_STATE: tuple(f'{part}_joint' for part in chain(
        (f'{side}_{part}' for side in ('left', 'right') for part in _LEG),
        (f'waist_{axis}' for axis in ('yaw', 'roll', 'pitch')),
        (f'{side}_{part}' for side in ('left', 'right') for part in _ARM)))}
#: _HEADER_SIZE: bytes of CDR's header; _LITTLE_ENDIAN: its second byte for little-endian numbers.
_HEADER_SIZE, _LITTLE_ENDIAN = 4, 1


def _fields(size: int, motor: int, motors: int, offsets: Sequence[int]) -> np.dtype:
    """Return the fields of a message of a size, with ``motor`` bytes for each motor."""
    one = np.dtype({'names': ['q', 'dq', 'torque'], 'formats': ['<f4'] * 3,
                    'offsets': [0, 4, 12], 'itemsize': motor})
    # Of the last motor only these numbers: what follows it ends the message.
    return np.dtype({'names': ['quaternion', 'gyroscope', 'accelerometer', 'motors', 'feet'],
                     'formats': ['4<f4', '3<f4', '3<f4', (one, motors), '4<i2'],
                     'offsets': [_HEADER_SIZE + offset for offset in offsets],
                     'itemsize': _HEADER_SIZE + size})


#: DTYPES: kind of message -> what is read of it; of dogs the offsets are as in the bridge, which
#: drives the robot by them. Humanoids have no foot sensors: what stands there is not used.
DTYPES = {LOW_STATE: _fields(1176, 48, 12, (24, 40, 52, 80, 1080)),
          HUMANOID_STATE: _fields(2088, 56, 35, (16, 32, 44, 72, 2068))}


def low_states(messages: Sequence[bytes], kind: str = LOW_STATE) -> np.ndarray:
    """Return the fields of messages of a kind: a structured array, shape (n,).

    ``quaternion`` (w x y z), ``gyroscope`` (rad/s), ``accelerometer`` (m/s^2), ``motors`` with
    ``q`` (rad), ``dq`` (rad/s) and ``torque`` (N m), ``feet`` (the robot's units).

    Raises:
        UndecodableError: a message has another length or byte order.

    """
    size = DTYPES[kind].itemsize
    for index, message in enumerate(messages):
        if len(message) < size or message[1] != _LITTLE_ENDIAN:
            raise UndecodableError(index, f'{len(message)} bytes, where {size} are needed')
    return np.frombuffer(b''.join(message[:size] for message in messages), DTYPES[kind])


def decode_low_states(messages: Sequence[bytes], joints: Sequence[str], efforts: bool,
                      kind: str = LOW_STATE) -> Iterator[SerializedBlock]:
    """Yield messages as joint states without stamps.

    Args:
        messages: as received.
        joints: names of a robot's joints in the order of its motors; Unitree's names if any of
            these is among them, if there are more joints than motors or, for a quadruped, fewer.
        efforts: return velocities and efforts, too.
        kind: type of the messages.

    """
    if not messages:
        return
    motors, names = low_states(messages, kind)['motors'], MOTOR_NAMES[kind]
    fits = len(joints) == 12 if kind == LOW_STATE else 0 < len(joints) <= motors.shape[1]
    names = tuple(joints) if fits and not set(joints) & set(names) else names
    motors, count, none = motors[:, :len(names)], len(messages), np.empty((len(messages), 0))
    yield SerializedBlock(
        np.arange(count), np.zeros(count, np.int64), names,
        motors['q'].astype(float), *((motors[name].astype(float) if efforts else none)
                                     for name in ('dq', 'torque')))
