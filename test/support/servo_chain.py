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

"""Feetech STS servos of a biped on a pseudo terminal: a chain that reaches its goals at once."""

import os
import pty
import select
import threading

import numpy as np

#: In the order of the servos, which is not that of the robot file.
JOINTS = ('right_ankle_joint', 'right_knee_joint', 'left_ankle_joint', 'left_knee_joint')
#: Pose that the biped sits down to, rad.
LYING = (-0.8, 1.8, -0.8, 1.8)
#: Steps a radian of a servo with 4096 a turn.
STEPS = 4096 / (2.0 * np.pi)


def calibrated(folder, device):
    """Write the calibration file of these servos; return its path."""
    path = folder / 'servos.yaml'
    path.write_text(f'board: feetech_sts\ndevice: {device}\nservos:\n' + ''.join(
        f'  {name}: {{channel: {k + 1}, centre: 2048, direction: {1 - 2 * (k % 2)}, '
        f'per_rad: {STEPS}, lower: 100, upper: 4000, rest: {LYING[k]}}}\n'
        for k, name in enumerate(JOINTS)))
    return path


def servo_steps(angles):
    """Return the servos' steps at angles, rad, shape (4,)."""
    signs = np.array([1.0, -1.0, 1.0, -1.0])
    return np.round(2048 + signs * STEPS * np.array(angles)).astype(int)


class ServoChain:
    """Answers SYNC READ and follows SYNC WRITE, by the maker's manual; independent of the package.

    Attributes:
        path: of the port.
        goals, torque: by identity.
        written, torques: all goals, and switchings of the torque, as pairs of identity and value.
        jammed: servos that are stuck: where, by identity.
        answering: whether servos answer.
        error: the byte that reports errors.

    """

    def __init__(self, positions):
        self.goals, self.torque = dict(positions), dict.fromkeys(positions, False)
        self.written, self.torques, self.jammed = [], [], {}
        self.answering, self.error, self.packets = True, 0, 0
        self._master, self._slave = pty.openpty()
        self.path = os.ttyname(self._slave)
        self._going = True
        self._thread = threading.Thread(target=self._serve, daemon=True)
        self._thread.start()

    def _serve(self):
        received = b''
        while self._going:
            if not select.select([self._master], [], [], 0.05)[0]:
                continue
            received += os.read(self._master, 4096)
            while len(received) >= 4 and len(received) >= 4 + received[3]:
                one, received = received[:4 + received[3]], received[4 + received[3]:]
                assert one[:3] == b'\xff\xff\xfe' and sum(one[2:]) & 0xFF == 0xFF, one.hex()
                self.packets += 1
                self._take(one[4], one[5], one[6], one[7:-1])

    def _take(self, instruction, address, length, data):
        if instruction == 0x82 and self.answering:
            assert (address, length) == (56, 2)
            for servo in data:
                place = self.jammed.get(servo, self.goals[servo])
                body = bytes((servo, 4, self.error)) + place.to_bytes(2, 'little')
                os.write(self._master, b'\xff\xff' + body + bytes((~sum(body) & 0xFF,)))
        elif instruction == 0x83:
            for k in range(0, len(data), length + 1):
                servo, value = data[k], int.from_bytes(data[k + 1:k + 1 + length], 'little')
                {40: self.torque, 42: self.goals}[address][servo] = value
                {40: self.torques, 42: self.written}[address].append((servo, value))

    def end(self):
        self._going = False
        self._thread.join()
        os.close(self._master)
        os.close(self._slave)
