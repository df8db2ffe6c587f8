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

"""The message ``unitree_go/msg/LowCmd`` as bytes: made once, filled in place, encoded, sent.

Little-endian CDR puts 4 bytes of header before the message; positions below count from the
message. The check sum is over the C struct of Unitree's firmware, 812 bytes with its own padding,
of which CDR differs only around the first motor: CDR aligns the mode of a motor as the byte it is,
C as the struct it is in. Padding is zero in both.
"""

from cpg_ros.safety.robot_state import JointCommand
from cpg_ros.unitree.crc import crc32
import numpy as np

#: CDR's header: little-endian.
HEADER = b'\x00\x01\x00\x00'
#: Of the message, without the header, in bytes.
SIZE = 808
MOTORS = 20
#: Angle and speed that mean: not controlled (unitree_sdk2's PosStopF and VelStopF).
POSITION_STOP, VELOCITY_STOP = 2.146e9, 16000.0
#: Mode of a motor under control.
SERVO_MODE = 1
#: Where the floats of the first motor begin, and from motor to motor.
_FLOATS, _STRIDE = 24, 36
#: After the last motor's ``reserve``; ``crc`` is the last word.
_CRC = 804


class LowCmd(JointCommand):
    """A command for all motors, in the order of Unitree's motors; arrays are views of the bytes.

    The first motors are those of a robot's joints, FR, FL, RR, RL with hip, thigh and calf each;
    the others are left uncontrolled.
    """

    def __init__(self, joints: int = 12) -> None:
        """Make a command under which nothing is driven.

        Args:
            joints: how many of the motors the robot has.

        """
        self._bytes = bytearray(HEADER + bytes(SIZE))
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
