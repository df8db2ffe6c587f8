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

"""The message ``unitree_go/msg/LowState`` of Unitree's four-legged robots, many at a time.

It has no stamp and no names: motors are FR, FL, RR, RL with hip, thigh and calf each, and so are
feet.
"""

from collections.abc import Iterator, Sequence

from cpg_ros.fitting.recordings.cdr import SerializedBlock, UndecodableError
import numpy as np

LOW_STATE = 'unitree_go/msg/LowState'
#: MOTORS: default names of the motors, those of Unitree's URDF.
MOTORS = tuple(f'{leg}_{part}_joint' for leg in ('FR', 'FL', 'RR', 'RL')
               for part in ('hip', 'thigh', 'calf'))
#: SIZE: bytes of a message, including the header of CDR, _HEADER bytes.
SIZE, _HEADER, _LITTLE_ENDIAN = 1180, 4, 1
_MOTOR = np.dtype({'names': ['q', 'dq', 'torque'], 'formats': ['<f4'] * 3, 'offsets': [0, 4, 12],
                   'itemsize': 48})
#: Offsets as in the bridge, which drives the robot by them.
_FIELDS = np.dtype({
    'names': ['quaternion', 'gyroscope', 'accelerometer', 'motors', 'feet'],
    'formats': ['4<f4', '3<f4', '3<f4', (_MOTOR, len(MOTORS)), '4<i2'],
    'offsets': [_HEADER + offset for offset in (24, 40, 52, 80, 1080)], 'itemsize': SIZE})


def low_states(messages: Sequence[bytes]) -> np.ndarray:
    """Return the fields of messages: a structured array, shape (n,).

    ``quaternion`` (w x y z), ``gyroscope`` (rad/s), ``accelerometer`` (m/s^2), ``motors`` with
    ``q`` (rad), ``dq`` (rad/s) and ``torque`` (N m), ``feet`` (the robot's units).

    Raises:
        UndecodableError: a message has another length or byte order.

    """
    for index, message in enumerate(messages):
        if len(message) < SIZE or message[1] != _LITTLE_ENDIAN:
            raise UndecodableError(index, f'{len(message)} bytes, where {SIZE} are needed')
    return np.frombuffer(b''.join(message[:SIZE] for message in messages), _FIELDS)


def decode_low_states(messages: Sequence[bytes], joints: Sequence[str], efforts: bool
                      ) -> Iterator[SerializedBlock]:
    """Yield messages as joint states without stamps.

    Args:
        messages: as they were received.
        joints: of a robot in the order of its motors, which names them; Unitree's names if it
            has these, or another number of joints.
        efforts: whether to return velocities and efforts, too.

    """
    if not messages:
        return
    motors = low_states(messages)['motors']
    own = len(joints) == len(MOTORS) and not set(joints) & set(MOTORS)
    count, none = len(messages), np.empty((len(messages), 0))
    yield SerializedBlock(
        np.arange(count), np.zeros(count, np.int64), tuple(joints) if own else MOTORS,
        motors['q'].astype(float), *((motors[name].astype(float) if efforts else none)
                                     for name in ('dq', 'torque')))
