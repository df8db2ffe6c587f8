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

"""The message ``unitree_go/msg/LowState``, read from its bytes (little-endian CDR)."""

from cpg_ros.safety.robot_state import RobotState
from cpg_ros.unitree.low_cmd import SERVO_MODE
from cpg_ros.unitree.models import JOINTS
import numpy as np

#: Of the message with CDR's header of 4 bytes.
SIZE = 1180
_HEADER = 4
_LITTLE_ENDIAN = 1
#: Bits of the wireless remote's bytes 2 and 3, as unitree_sdk2py.utils.joystick reads them.
BUTTONS = {name: 1 << k for k, name in enumerate((
    'R1', 'L1', 'start', 'select', 'R2', 'L2', 'F1', 'F2',
    'A', 'B', 'X', 'Y', 'up', 'right', 'down', 'left'))}
#: Packets that a motor may lose while the bridge drives it.
MOST_LOST = 100
#: From the angle of a motor on: CDR packs the mode of the first one more closely.
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
    'itemsize': SIZE - _HEADER})


class LowState(RobotState):
    """The measured state; arrays are views of one buffer, joints in the order of Unitree's motors.

    Attributes:
        torque: estimated, N m, shape (joints,).
        lost: packets that each motor has lost so far.
        quaternion: orientation, w x y z.
        gyroscope: rad/s.
        accelerometer: m/s^2.
        feet: what the feet feel, in the units of the robot, in the order FR FL RR RL.

    """

    def __init__(self) -> None:
        """Start with everything at zero."""
        self._buffer = bytearray(SIZE)
        self._all = np.ndarray((), _FIELDS, self._buffer, _HEADER)
        motors = self._all['motors'][:len(JOINTS)]
        self.q, self.dq, self.torque, self.temperature, self.lost = (
            motors[name] for name in ('q', 'dq', 'torque', 'temperature', 'lost'))
        self._modes = motors['next_mode'][:-1]
        self.quaternion, self.gyroscope, self.accelerometer, self.feet = (
            self._all[name] for name in ('quaternion', 'gyroscope', 'accelerometer', 'feet'))
        self.reset_motor_faults()

    def read(self, message: bytes) -> bool:
        """Take a message over; return whether it is one of these."""
        if len(message) < SIZE or message[1] != _LITTLE_ENDIAN:
            return False
        self._buffer[:] = message[:SIZE]
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
            return f'the motor of {JOINTS[worst]} does not hear the robot any more'
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
        """Of the battery, from 0 to 1."""
        return self._number('soc') / 100.0

    @property
    def current(self) -> float:
        """Into the battery, A."""
        return self._number('current') / 1000.0

    @property
    def voltage(self) -> float:
        """Of the battery, V."""
        return self._number('voltage')

    @property
    def cells(self) -> list[float]:
        """Voltages of the battery's cells that are there, V."""
        return [value / 1000.0 for value in self._all['cells'].tolist() if value]

    @property
    def imu_temperature(self) -> int:
        """Of the IMU, deg C."""
        return int(self._number('imu_temperature'))

    @property
    def tilt_cosine(self) -> float:
        """Cosine of the angle between the body's and the world's vertical; nan without an IMU."""
        w, x, y, z = self.quaternion.tolist()
        norm = w * w + x * x + y * y + z * z
        return 1.0 - 2.0 * (x * x + y * y) / norm if 0.9 < norm < 1.1 else float('nan')
