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

"""Unitree's robots: motor order, limits and gains, and their messages as bytes.

The messages, LowCmd with its check sum and LowState, are little-endian CDR.
"""

from collections.abc import Sequence
from dataclasses import dataclass
import zlib

from cpg_ros.common.errors import InputError
from cpg_ros.motion.robot import Robot
from cpg_ros.ros.bridges.robot_state import (
    BridgeSettings,
    JointCommand,
    motor_indices,
    RobotState,
    settings_for,
)
import numpy as np

PARTS = ('hip', 'thigh', 'calf')
#: Joints in the order of Unitree's motors.
JOINTS = tuple(f'{leg}_{part}_joint' for leg in ('FR', 'FL', 'RR', 'RL') for part in PARTS)


@dataclass(frozen=True)
class Model:
    """One kind of robot; columns are hip, thigh and calf.

    Attributes:
        torque: limits of the joints, N m.
        most_kp: largest proportional gain, N m / rad.
        most_kd: largest damping gain, N m s / rad.
        lying: pose on its belly, rad (the first pose of Unitree's own examples).

    """

    torque: tuple[float, float, float]
    most_kp: float
    most_kd: float
    lying: tuple[float, float, float] = (0.0, 1.36, -2.65)


#: Torques as in Unitree's own models of the robots (unitree_ros, unitree_mujoco).
MODELS = {'go2': Model((23.7, 23.7, 45.43), 150.0, 8.0),
          'go1': Model((23.7, 23.7, 35.55), 150.0, 8.0),
          'b2': Model((200.0, 200.0, 320.0), 1000.0, 20.0)}


def each(values: list[float], name: str, most: float) -> np.ndarray:
    """Return a number for each of the joints, shape (12,), from 0 to ``most``.

    ``values`` has one for all, three for hip, thigh and calf, or one for each of JOINTS.

    Raises:
        InputError: there are not 1, 3 or 12 of them, or one is out of range.

    """
    if len(values) not in (1, len(PARTS), len(JOINTS)):
        raise InputError(f'{name} has {len(values)} numbers: give one for all joints, three for '
                         f'{", ".join(PARTS)}, or {len(JOINTS)}, for {", ".join(JOINTS)}')
    for value in values:
        if not 0.0 <= value <= most:
            raise InputError(f'{name}: {value:g} is not from 0 to {most:g}')
    return np.resize(np.array(values, dtype=float), len(JOINTS))


def settings_of(robot: Robot, model: Model, kp: list[float], kd: list[float],
                torque_factor: float = 1.0, **others: float) -> BridgeSettings:
    """Return the settings of a robot file and a model.

    ``kp`` and ``kd`` are as ``each`` takes them, ``torque_factor`` is the fraction of the torque
    limits that commands may use, ``others`` are further attributes of ``BridgeSettings``.

    Raises:
        InputError: the robot is not one of Unitree's, or a gain is out of range.

    """
    n = len(JOINTS)
    return settings_for(
        robot, motor_indices(robot, JOINTS, "Unitree's robots"), kp=each(kp, 'kp', model.most_kp),
        kd=each(kd, 'kd', model.most_kd),
        torque=torque_factor * np.resize(model.torque, n), lying=np.resize(model.lying, n),
        most_kp=model.most_kp, **others)


# The check sum of Unitree's low-level commands: CRC-32/MPEG-2 of the words of a C struct.

#: Every byte with its bits the other way round.
_MIRRORED = bytes(int(f'{byte:08b}'[::-1], 2) for byte in range(256))


def crc32(data: bytes) -> int:
    """Return the check sum of little-endian 32-bit words.

    Args:
        data: their bytes, a whole number of words.

    """
    swapped = bytearray(len(data))
    for k in range(4):
        swapped[k::4] = data[3 - k::4]
    reflected = zlib.crc32(swapped.translate(_MIRRORED)) ^ 0xffffffff
    return int.from_bytes(reflected.to_bytes(4, 'little').translate(_MIRRORED), 'big')


# The message ``unitree_go/msg/LowCmd`` as bytes: made once, filled in place, encoded, sent.

#: CDR's header: little-endian.
HEADER = b'\x00\x01\x00\x00'
#: COMMAND_SIZE: size of LowCmd without the header, bytes.
COMMAND_SIZE = 808
MOTORS = 20
#: POSITION_STOP, VELOCITY_STOP: values that leave angle and speed uncontrolled (unitree_sdk2's
#: PosStopF and VelStopF).
POSITION_STOP, VELOCITY_STOP = 2.146e9, 16000.0
#: Mode of a motor under control.
SERVO_MODE = 1
#: _FLOATS: offset of the first motor's floats; _STRIDE: distance from motor to motor, bytes.
_FLOATS, _STRIDE = 24, 36
#: _CRC: offset of ``crc``, the last word, bytes.
_CRC = 804


class LowCmd(JointCommand):
    """A command for all motors, in the order of Unitree's motors; arrays are views of the bytes.

    The first motors are those of a robot's joints, FR, FL, RR, RL with hip, thigh and calf each;
    the others are left uncontrolled.
    """

    def __init__(self, joints: int = 12) -> None:
        """Make a command that drives nothing.

        Args:
            joints: number of motors of the robot.

        """
        self._bytes = bytearray(HEADER + bytes(COMMAND_SIZE))
        message = memoryview(self._bytes)[len(HEADER):]
        self._message = message
        # As in Unitree's examples: start of frame, low level.
        message[0:3] = b'\xfe\xef\xff'
        for motor in range(MOTORS):
            message[self._mode(motor)] = SERVO_MODE
        table = np.ndarray((MOTORS, 5), '<f4', message, _FLOATS, (_STRIDE, 4))
        table[:] = POSITION_STOP, VELOCITY_STOP, 0.0, 0.0, 0.0
        self.q, self.dq, self.tau, self.kp, self.kd = table[:joints].T
        self.dq[:] = 0.0

    @staticmethod
    def _mode(motor: int) -> int:
        return 22 if motor == 0 else _FLOATS - 4 + _STRIDE * motor

    def encode(self) -> bytes:
        """Set the checksum, and return the message as it is sent."""
        m = self._message
        struct = b''.join((m[:22], b'\0\0', m[22:24], b'\0\0', m[24:_CRC]))
        m[_CRC:] = crc32(struct).to_bytes(4, 'little')
        return bytes(self._bytes)


# Forces on the feet, from sensors whose unit and zero differ from foot to foot.

class FootForces:
    """Readings of foot sensors as forces."""

    def __init__(self, feet: int, scale: float, offset: Sequence[float],
                 threshold: Sequence[float]) -> None:
        """Convert the readings of some feet.

        Args:
            feet: number of feet.
            scale: force per unit of the sensors, N.
            offset: readings in the air, in the sensors' units; one number or one for each foot.
            threshold: forces below which a foot is in the air, N; likewise.

        Raises:
            InputError: a sequence has another length, or a value that is not a finite number.

        """
        self._scale = scale
        self._offset, self._threshold = (
            _per_foot(name, values, feet) for name, values in (
                ('foot_offset', offset), ('foot_threshold', threshold)))

    def newtons(self, raw: np.ndarray) -> np.ndarray:
        """Return the forces of raw readings, N, shape (feet,); 0 in the air, never negative."""
        force = self._scale * (raw - self._offset)
        return np.where(force >= self._threshold, np.maximum(force, 0.0), 0.0)


def _per_foot(name: str, values: Sequence[float], feet: int) -> np.ndarray:
    if len(values) not in (1, feet):
        raise InputError(f'parameter {name} has {len(values)} numbers, not 1 or {feet}')
    if not np.isfinite(values).all():
        raise InputError(f'parameter {name}: {list(values)} is not finite')
    return np.broadcast_to(np.array(values, dtype=float), feet)


#: STATE_SIZE: size of LowState with CDR's header of 4 bytes, bytes.
STATE_SIZE = 1180
_HEADER = 4
_LITTLE_ENDIAN = 1
#: Bits of the wireless remote's bytes 2 and 3, as unitree_sdk2py.utils.joystick reads them.
BUTTONS = {name: 1 << k for k, name in enumerate((
    'R1', 'L1', 'start', 'select', 'R2', 'L2', 'F1', 'F2',
    'A', 'B', 'X', 'Y', 'up', 'right', 'down', 'left'))}
#: MOST_LOST: packets that a motor may lose while the bridge drives it.
MOST_LOST = 100
#: A motor's fields from its angle on, up to the next motor's mode: CDR packs the first mode
#: closer.
_MOTOR = np.dtype({
    'names': ['q', 'dq', 'ddq', 'torque', 'temperature', 'lost', 'next_mode'],
    'formats': ['<f4', '<f4', '<f4', '<f4', 'i1', '<u4', 'u1'],
    'offsets': [0, 4, 8, 12, 28, 32, 44], 'itemsize': 48})
_FIELDS = np.dtype({
    'names': ['quaternion', 'gyroscope', 'accelerometer', 'imu_temperature', 'first_mode',
              'motors', 'soc', 'current', 'cycle', 'cells', 'feet', 'tick', 'remote', 'ntc',
              'voltage'],
    'formats': ['4<f4', '3<f4', '3<f4', 'i1', 'u1', (_MOTOR, 19), 'u1', '<i4', '<u2', '15<u2',
                '4<i2', '<u4', '<u2', '2i1', '<f4'],
    'offsets': [24, 40, 52, 76, 77, 80, 1039, 1040, 1044, 1050, 1080, 1096, 1102, 1148, 1152],
    'itemsize': STATE_SIZE - _HEADER})


class LowState(RobotState):
    """The measured state; arrays are views of one buffer, joints in the order of Unitree's motors.

    Attributes:
        torque: estimated, N m, shape (joints,).
        lost: number of lost packets of each motor.
        quaternion: orientation, w x y z.
        gyroscope: rad/s.
        accelerometer: m/s^2.
        feet: readings of the foot sensors, in the units of the robot, in the order FR FL RR RL.

    """

    def __init__(self) -> None:
        """Start with everything at zero."""
        self._buffer = bytearray(STATE_SIZE)
        self._all = np.ndarray((), _FIELDS, self._buffer, _HEADER)
        motors = self._all['motors'][:len(JOINTS)]
        self.q, self.dq, self.torque, self.temperature, self.lost = (
            motors[name] for name in ('q', 'dq', 'torque', 'temperature', 'lost'))
        self._modes = motors['next_mode'][:-1]
        self.quaternion, self.gyroscope, self.accelerometer, self.feet = (
            self._all[name] for name in ('quaternion', 'gyroscope', 'accelerometer', 'feet'))
        self.reset_motor_faults()

    def read(self, message: bytes) -> bool:
        """Copy a message; return whether it is a LowState."""
        if len(message) < STATE_SIZE or message[1] != _LITTLE_ENDIAN:
            return False
        self._buffer[:] = message[:STATE_SIZE]
        return True

    def _number(self, name: str) -> float:
        return self._all[name].item()

    @property
    def modes(self) -> tuple[int, ...]:
        """Control modes of the joints' motors."""
        return int(self._number('first_mode')), *self._modes.tolist()

    def reset_motor_faults(self) -> None:
        """Compare the motors with their modes and lost packets as they are now."""
        self._modes_before, self._lost_before = self.modes, self.lost.copy()

    def motor_fault(self) -> str:
        """Return which motor has left its mode or lost contact with the robot, or ''."""
        modes, before = self.modes, self._modes_before
        self._modes_before = modes
        if modes != before:
            for name, now, then in zip(JOINTS, modes, before, strict=True):
                if then == SERVO_MODE != now:
                    return f'the motor of {name} has stopped by itself: mode {now}'
        # Unsigned: a counter that began anew is a motor that did.
        lost = self.lost - self._lost_before
        if lost.max() > MOST_LOST:
            worst = int(lost.argmax())
            return f'the motor of {JOINTS[worst]} receives no commands'
        return ''

    @property
    def tick(self) -> int:
        """The robot's own counter; simulators leave it at 0."""
        return int(self._number('tick'))

    @property
    def buttons(self) -> int:
        """Buttons of the wireless remote that are pressed, the sum of values of BUTTONS."""
        return int(self._number('remote'))

    @property
    def charge(self) -> float:
        """Charge of the battery, from 0 to 1."""
        return self._number('soc') / 100.0

    @property
    def current(self) -> float:
        """Into the battery, A."""
        return self._number('current') / 1000.0

    @property
    def voltage(self) -> float:
        """Voltage of the battery, V."""
        return self._number('voltage')

    @property
    def cells(self) -> list[float]:
        """Voltages of the battery's present cells, V."""
        return [value / 1000.0 for value in self._all['cells'].tolist() if value]

    @property
    def imu_temperature(self) -> int:
        """Temperature of the IMU, deg C."""
        return int(self._number('imu_temperature'))

    @property
    def tilt_cosine(self) -> float:
        """Cosine of the angle between the body's and the world's vertical; nan without an IMU."""
        w, x, y, z = self.quaternion.tolist()
        norm = w * w + x * x + y * y + z * z
        return 1.0 - 2.0 * (x * x + y * y) / norm if 0.9 < norm < 1.1 else float('nan')
