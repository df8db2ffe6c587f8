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
from typing import Any
import zlib

from cpg_ros.common.errors import InputError
from cpg_ros.motion.robot import Robot
from cpg_ros.ros.bridges.robot_state import (
    BridgeSettings,
    check_joints,
    JointCommand,
    RobotState,
    settings_for,
)
import numpy as np


@dataclass(frozen=True)
class Model:
    """One kind of robot.

    Attributes:
        joints: in the order of its motors, legs first.
        torque: limits of all joints, or of one leg's, N m.
        most_kp: largest proportional gain, N m / rad.
        most_kd: largest damping gain, N m s / rad.
        lying: pose of one leg to sit down to, rad.
        package: of its messages, a key of LAYOUTS.
        gains: kp and kd of all joints; None for those of the robot file.

    """

    joints: tuple[str, ...]
    torque: tuple[float, ...]
    most_kp: float
    most_kd: float
    lying: tuple[float, ...]
    package: str = 'unitree_go'
    gains: tuple[float, float] | None = (60.0, 2.0)

    @property
    def humanoid(self) -> bool:
        """Whether it has two legs, no sensors in its feet, and joints beside those of its legs."""
        return self.package == 'unitree_hg'


PARTS = ('hip', 'thigh', 'calf')


def _dog(torque: tuple[float, ...], most_kp: float, most_kd: float) -> Model:
    # Lying on its belly is the first pose of Unitree's own examples.
    joints = tuple(f'{leg}_{part}_joint' for leg in ('FR', 'FL', 'RR', 'RL') for part in PARTS)
    return Model(joints, torque, most_kp, most_kd, (0.0, 1.36, -2.65))


def _humanoid(leg: dict[str, float], waist: dict[str, float], arm: tuple[float, ...],
              most_kp: float, most_kd: float, lying: tuple[float, ...]) -> Model:
    """Return a humanoid; ``leg`` and ``waist`` are part -> torque limit, ``arm`` such limits."""
    arms = dict(zip(('shoulder_pitch', 'shoulder_roll', 'shoulder_yaw', 'elbow', 'wrist_roll',
                     'wrist_pitch', 'wrist_yaw'), arm, strict=True))
    limits = {**_both(leg), **waist, **_both(arms)}
    return Model(tuple(f'{part}_joint' for part in limits), tuple(limits.values()), most_kp,
                 most_kd, lying, 'unitree_hg', None)


def _both(parts: dict[str, float]) -> dict[str, float]:
    return {f'{side}_{part}': value for side in ('left', 'right') for part, value in parts.items()}


#: Motor order as in Unitree's examples, torques as in its own models (unitree_ros,
#: unitree_mujoco); humanoids sit down to a crouch with the centre of mass above the soles.
MODELS = {
    'go2': _dog((23.7, 23.7, 45.43), 150.0, 8.0),
    'go1': _dog((23.7, 23.7, 35.55), 150.0, 8.0),
    'b2': _dog((200.0, 200.0, 320.0), 1000.0, 20.0),
    'g1': _humanoid(
        {'hip_pitch': 88.0, 'hip_roll': 88.0, 'hip_yaw': 88.0, 'knee': 139.0, 'ankle_pitch': 50.0,
         'ankle_roll': 50.0}, {'waist_yaw': 88.0, 'waist_roll': 50.0, 'waist_pitch': 50.0},
        (25.0, 25.0, 25.0, 25.0, 25.0, 5.0, 5.0), 300.0, 10.0,
        (-1.85, 0.0, 0.0, 2.02, -0.87, 0.0)),
    'h1_2': _humanoid(
        {'hip_yaw': 200.0, 'hip_pitch': 200.0, 'hip_roll': 200.0, 'knee': 300.0,
         'ankle_pitch': 60.0, 'ankle_roll': 40.0}, {'torso': 200.0},
        (40.0, 40.0, 18.0, 18.0, 19.0, 19.0, 19.0), 500.0, 20.0,
        (0.0, -1.25, 0.0, 2.0, -0.89, 0.0))}


def each(values: list[float], name: str, most: float, model: Model, own: np.ndarray
         ) -> np.ndarray:
    """Return a number for each of the joints, shape (joints,), from 0 to ``most``.

    ``values`` has one for all, one for each joint, or, for robots with four legs, three for hip,
    thigh and calf; where all are 0, the result is ``own``.

    Raises:
        InputError: there are more or fewer of them, or one is out of range.

    """
    if len(values) not in (1, len(model.torque), len(model.joints)):
        legs = '' if model.humanoid else f' three for {", ".join(PARTS)},'
        raise InputError(f'{name} has {len(values)} numbers: give one for all joints,{legs} or '
                         f'{len(model.joints)}, for {", ".join(model.joints)}')
    for value in values:
        if not 0.0 <= value <= most:
            raise InputError(f'{name}: {value:g} is not from 0 to {most:g}')
    return np.resize(np.array(values, dtype=float), len(model.joints)) if any(values) else own


def settings_of(robot: Robot, model: Model, kp: list[float], kd: list[float],
                torque_factor: float = 1.0, **others: Any) -> BridgeSettings:
    """Return the settings of a robot file and a model.

    ``kp`` and ``kd`` are as ``each`` takes them, by default those of the model, or, for a
    humanoid, of the robot file. ``torque_factor`` is the fraction of the torque limits that
    commands may use, ``others`` are further attributes of ``BridgeSettings``.

    Raises:
        InputError: the robot is not one of Unitree's, or a gain is out of range.

    """
    joints, legs = model.joints, len(robot.order)
    check_joints(robot, joints, "Unitree's robots")
    links = {} if robot.biped is None else robot.biped.links
    own = np.array([model.gains or (links[name].kp, links[name].kd) for name in joints]).T
    gains = {'kp': each(kp, 'kp', model.most_kp, model, own[0]),
             'kd': each(kd, 'kd', model.most_kd, model, own[1])}
    if model.humanoid:
        # Light links, such as hands, bear no more damping than their own.
        others |= {'rack': True, 'damping': gains['kd']}
    return settings_for(
        robot, joints, **gains, torque=torque_factor * np.resize(model.torque, len(joints)),
        lying=np.array([*np.resize(model.lying, legs),
                        *(robot.held[name] for name in joints[legs:])]),
        most_kp=model.most_kp, **others)


# The check sum of Unitree's low-level commands: CRC-32/MPEG-2 of the words of a C struct.

#: Every byte with its bits the other way round.
_REVERSED_BITS = bytes(int(f'{byte:08b}'[::-1], 2) for byte in range(256))


def crc32(data: bytes) -> int:
    """Return the check sum of little-endian 32-bit words.

    Args:
        data: their bytes, a whole number of words.

    """
    swapped = bytearray(len(data))
    for k in range(4):
        swapped[k::4] = data[3 - k::4]
    reflected = zlib.crc32(swapped.translate(_REVERSED_BITS)) ^ 0xffffffff
    return int.from_bytes(reflected.to_bytes(4, 'little').translate(_REVERSED_BITS), 'big')


# The message ``LowCmd`` as bytes: made once, filled in place, encoded, sent.

#: CDR's header: little-endian.
CDR_HEADER = b'\x00\x01\x00\x00'


@dataclass(frozen=True)
class Layout:
    """Where a package's LowCmd, without header, has its fields, bytes.

    Attributes:
        start: its first bytes.
        first: offset of the first motor's mode; its floats follow 2 later.
        stride: distance from motor to motor.
        size: with ``crc``, the last word.
        motors: number of motors in it.
        enabled: whether it enables motors that the robot lacks, too, as in Unitree's examples.

    """

    start: bytes
    first: int
    stride: int
    size: int
    motors: int
    enabled: bool


#: Of Go2, Go1 and B2: start of frame, low level. Of humanoids: pitch and roll of ankles in series
#: (mode_pr 0), and the robot's mode_machine, which commands repeat.
LAYOUTS = {'unitree_go': Layout(b'\xfe\xef\xff', 22, 36, 808, 20, True),
           'unitree_hg': Layout(b'\0\0', 2, 28, 1000, 35, False)}
#: POSITION_STOP, VELOCITY_STOP: values that leave angle and speed uncontrolled (unitree_sdk2's
#: PosStopF and VelStopF).
POSITION_STOP, VELOCITY_STOP = 2.146e9, 16000.0
#: Mode of a motor under control.
SERVO_MODE = 1


class LowCmd(JointCommand):
    """A command for all motors, in the order of Unitree's motors; arrays are views of the bytes.

    The first motors are those of a robot's joints; the others are left uncontrolled.
    """

    def __init__(self, model: Model = MODELS['go2']) -> None:
        """Make a command that drives nothing."""
        self._layout = layout = LAYOUTS[model.package]
        self._bytes = bytearray(CDR_HEADER + bytes(layout.size))
        message = memoryview(self._bytes)[len(CDR_HEADER):]
        self._message = message
        message[:len(layout.start)] = layout.start
        joints = len(model.joints)
        enabled = layout.motors if layout.enabled else joints
        for motor in range(enabled):
            message[layout.first - 2 * (motor > 0) + layout.stride * motor] = SERVO_MODE
        table = np.ndarray((enabled, 5), '<f4', message, layout.first + 2, (layout.stride, 4))
        table[:] = POSITION_STOP, VELOCITY_STOP, 0.0, 0.0, 0.0
        self.q, self.dq, self.tau, self.kp, self.kd = table[:joints].T
        self.dq[:] = 0.0
        if model.humanoid:
            self.echo = np.ndarray(1, np.uint8, message, 1)

    def encode(self) -> bytes:
        """Set the checksum, and return the message as it is sent."""
        m, first = self._message, self._layout.first
        struct = b''.join((m[:first], b'\0\0', m[first:first + 2], b'\0\0', m[first + 2:-4]))
        m[-4:] = crc32(struct).to_bytes(4, 'little')
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


# The message ``LowState`` as bytes.

_LITTLE_ENDIAN = 1
#: Bits of the wireless remote's bytes 2 and 3, as unitree_sdk2py.utils.joystick reads them.
BUTTONS = {name: 1 << k for k, name in enumerate((
    'R1', 'L1', 'start', 'select', 'R2', 'L2', 'F1', 'F2',
    'A', 'B', 'X', 'Y', 'up', 'right', 'down', 'left'))}
#: MAX_LOST_PACKETS: packets that a motor may lose while the bridge drives it.
MAX_LOST_PACKETS = 100


def _record(size: int, **fields: tuple[Any, int]) -> np.dtype:
    """Return a structure of a size in bytes; ``fields`` are name -> type and offset."""
    kinds, offsets = zip(*fields.values(), strict=True)
    return np.dtype({'names': list(fields), 'formats': kinds, 'offsets': offsets,
                     'itemsize': size})


def _motor(size: int, **fields: tuple[Any, int]) -> np.dtype:
    """Return a motor's fields from its angle on, up to the next motor's mode.

    CDR packs the first mode closer.
    """
    return _record(size, q=('<f4', 0), dq=('<f4', 4), torque=('<f4', 12),
                   next_mode=('u1', size - 4), **fields)


#: Package -> structure of its LowState with CDR's header of 4 bytes.
STATE_LAYOUTS = {
    'unitree_go': _record(
        1180, quaternion=('4<f4', 28), gyroscope=('3<f4', 44), accelerometer=('3<f4', 56),
        imu_temperature=('i1', 80), first_mode=('u1', 81),
        motors=((_motor(48, temperature=('i1', 28), lost=('<u4', 32)), 19), 84),
        soc=('u1', 1043), current=('<i4', 1044), cells=('15<u2', 1054), feet=('4<i2', 1084),
        tick=('<u4', 1100), remote=('<u2', 1106), voltage=('<f4', 1156)),
    # Of two temperatures the higher one counts; ``error`` is the field motorstate.
    'unitree_hg': _record(
        2092, machine=('u1', 13), tick=('<u4', 16), quaternion=('4<f4', 20),
        gyroscope=('3<f4', 36), accelerometer=('3<f4', 48), imu_temperature=('<i2', 72),
        first_mode=('u1', 74), motors=((_motor(56, temperature=('2<i2', 16), error=('<u4', 32)),
                                        35), 76), remote=('<u2', 2034))}


class LowState(RobotState):
    """The measured state; arrays are views of one buffer, joints in the order of Unitree's motors.

    Attributes:
        model: of the robot.
        torque: estimated, N m, shape (joints,).
        lost: number of lost packets of each motor, of robots with four legs.
        error: bits of each motor's error, of humanoids.
        quaternion: orientation, w x y z.
        gyroscope: rad/s.
        accelerometer: m/s^2.
        feet: readings of the foot sensors, in the units of the robot, in the order FR FL RR RL;
            humanoids have none.

    """

    def __init__(self, model: Model = MODELS['go2']) -> None:
        """Start with everything at zero."""
        self.model, fields = model, STATE_LAYOUTS[model.package]
        self._buffer = bytearray(fields.itemsize)
        self._all = np.ndarray((), fields, self._buffer)
        motors = self._all['motors'][:len(model.joints)]
        self.q, self.dq, self.torque, self._temperature = (
            motors[name] for name in ('q', 'dq', 'torque', 'temperature'))
        self.lost, self.error = (motors[name] if name in (motors.dtype.names or ()) else
                                 np.zeros(len(motors), np.uint32) for name in ('lost', 'error'))
        self._modes = motors['next_mode'][:-1]
        self.quaternion, self.gyroscope, self.accelerometer = (
            self._all[name] for name in ('quaternion', 'gyroscope', 'accelerometer'))
        self.feet = np.zeros(0) if model.humanoid else self._all['feet']
        if model.humanoid:
            self.echo = self._all['machine'].reshape(1)
        self.reset_motor_faults()

    @property
    def temperature(self) -> np.ndarray:  # type: ignore[override]
        """Temperatures of the motors, deg C, shape (joints,)."""
        heat = self._temperature
        return heat if heat.ndim == 1 else heat.max(axis=1)

    def read(self, message: bytes) -> bool:
        """Copy a message; return whether it is a LowState."""
        size = len(self._buffer)
        if len(message) < size or message[1] != _LITTLE_ENDIAN:
            return False
        self._buffer[:] = message[:size]
        return True

    def _number(self, name: str) -> float:
        return self._all[name].item()

    @property
    def modes(self) -> tuple[int, ...]:
        """Control modes of the joints' motors."""
        return int(self._number('first_mode')), *self._modes.tolist()

    def reset_motor_faults(self) -> None:
        """Compare the motors with their modes, lost packets and errors as they are now."""
        self._modes_before = self.modes
        self._lost_before, self._error_before = self.lost.copy(), self.error.copy()

    def motor_fault(self) -> str:
        """Return which motor has an error, left its mode or lost contact with the robot, or ''."""
        joints, modes, before = self.model.joints, self.modes, self._modes_before
        self._modes_before = modes
        if modes != before:
            for name, now, then in zip(joints, modes, before, strict=True):
                if then == SERVO_MODE != now:
                    return f'the motor of {name} has stopped by itself: mode {now}'
        # Unsigned: a counter that began anew is a motor that did.
        lost = self.lost - self._lost_before
        if lost.max() > MAX_LOST_PACKETS:
            return f'the motor of {joints[int(lost.argmax())]} receives no commands'
        # Bits that were set before anything was sent may tell of that.
        error = self.error & ~self._error_before
        if error.any():
            worst = int(error.argmax())
            return f'the motor of {joints[worst]} reports the error 0x{error[worst]:x}'
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
