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

"""Unitree's Go2 and G1 for tests: LowState out, LowCmd in.

Joints and body of the Go2 are in MuJoCo; the G1 hangs in a rack, and its joints are inertias.

Written apart from cpg_ros.ros: bytes by struct, the check sum by a table.
"""

import json
import math
import struct
import threading
import time

from cpg_ros.motion.robot_file import load_robot
from cpg_ros.simulation.body import Body
import numpy as np
import rclpy
from rclpy.qos import QoSProfile, ReliabilityPolicy

DT = 0.002
#: CDR of LowCmd and of LowState, without the header of four bytes.
COMMAND = struct.Struct('<4B4IH Bx5f3I' + 'B3x5f3I' * 19 + '4B40B12B2BBxII')
STATE = struct.Struct('<4B4IHxx 13fb Bxx7fb3xI2I' + 'B3x7fb3xI2I' * 19
                      + '4BiH4b15H4h4hI40BBxxxf2bxx2f4H2I')
#: The C struct of LowCmd, as Unitree's own packs it.
C_STRUCT = struct.Struct('<4B4IH2x' + 'B3x5f3I' * 20 + '4B40B12B2BBx2I')
#: The same of the humanoids.
HG_COMMAND = struct.Struct('<2B Bx5fI' + 'B3x5fI' * 34 + '4II')
HG_STATE = struct.Struct('<2I2BxxI 13fh Bx4f2hf7I' + 'B3x4f2hf7I' * 34 + '40B4II')
HG_C_STRUCT = struct.Struct('<2B2x' + 'B3x5fI' * 35 + '4II')
#: mode_machine of a G1 with 29 joints.
MACHINE = 5
LYING = (0.0, 1.36, -2.65)
#: Commands that are kept: half an hour.
MOST = 1_000_000


def _table():
    for byte in range(256):
        value = byte << 24
        for _ in range(8):
            value = (value << 1 ^ 0x04c11db7 if value & 0x80000000 else value << 1) & 0xffffffff
        yield value


TABLE = tuple(_table())


def mpeg2(data: bytes) -> int:
    """CRC-32/MPEG-2 of bytes."""
    value, table = 0xffffffff, TABLE
    for byte in data:
        value = (value << 8) & 0xffffffff ^ table[value >> 24 ^ byte]
    return value


def check_sum(data: bytes) -> int:
    """Return the same of a C struct's little-endian words, from the highest byte of each on."""
    return mpeg2(struct.pack(f'>{len(data) // 4}I', *struct.unpack(f'<{len(data) // 4}I', data)))


class Hanging:
    """Joints of a robot in a rack: inertias with motors, its body upright and at rest."""

    def __init__(self, stand, limit):
        self.stand, self._limit = stand, limit
        self.position, self.velocity, self.torque = np.zeros((3, len(stand)))
        self.quaternion, self.twist, self.base = np.array([1.0, 0, 0, 0]), np.zeros(6), np.ones(3)
        self.kp, self.kd, self._target = np.zeros((3, len(stand)))
        self.added = 0.0

    def command(self, angles):
        self._target = angles

    def step(self):
        # kg m^2, backward in time, so that no gain is too high.
        inertia = 0.01 + 0.001 * self._limit
        force = self.kp * (self._target - self.position) + self.added
        before = self.velocity
        self.velocity = (before + DT / inertia * force) / (
            1.0 + DT / inertia * (self.kd + DT * self.kp))
        self.torque = inertia * (self.velocity - before) / DT
        self.position = self.position + DT * self.velocity


class StandIn(threading.Thread):
    """The robot, in real time; its attributes may be set from another thread.

    Attributes:
        wrong: how many had a wrong check sum, or, of a G1, another mode_machine.
        mute: publishes no state.
        frozen: publishes the last state again and again.
        cut: as if the network's cable were out.
        lean: rad by which the IMU says that the body leans.
        heat: of one motor, deg C.
        buttons: of the remote, byte 2 and 3.
        error: bits that the state of one motor of a G1 gets.
        lift: somebody puts it back on its feet.
        mode: of its own motion service; '' for none.
        asked: numbers of what its services were asked for.

    """

    def __init__(self, domain: int, services: bool = False, lying: bool = True,
                 model: str = 'go2') -> None:
        super().__init__(daemon=True)
        from unitree_api.msg import Request, Response
        self.humanoid, self.robot = model == 'g1', load_robot(f'unitree_{model}')
        if self.humanoid:
            from unitree_hg.msg import LowCmd, LowState
            leg, arm = [88.0, 88.0, 88.0, 139.0, 50.0, 50.0], [25.0] * 5 + [5.0] * 2
            self.limit = np.array([*leg, *leg, 88.0, 50.0, 50.0, *arm, *arm])
            self.body = Hanging(np.zeros(29), self.limit)
        else:
            from unitree_go.msg import LowCmd, LowState
            self.body = Body('go2', self.robot, kp=60.0, kd=2.0, timestep=DT)
            self.limit = np.tile([23.7, 23.7, 45.43], 4)
        n = len(self.limit)
        self.context = rclpy.Context()
        rclpy.init(context=self.context, domain_id=domain)
        self.node = rclpy.create_node(model, context=self.context, enable_rosout=False,
                                      start_parameter_services=False)
        self._states = self.node.create_publisher(LowState, '/lowstate', QoSProfile(depth=1))
        self._commands = self.node.create_subscription(
            LowCmd, '/lowcmd', lambda _: None, QoSProfile(
                depth=100, reliability=ReliabilityPolicy.BEST_EFFORT), raw=True)
        self._kind, self._services = LowCmd, {}
        if services:
            for name in ('motion_switcher', 'sport'):
                self._services[name] = (
                    self.node.create_subscription(Request, f'/api/{name}/request',
                                                  lambda _: None, 10),
                    self.node.create_publisher(Response, f'/api/{name}/response', 10))
        # Rows of an array: a list of them that grows makes Python's collection of garbage take
        # longer than states may stay away.
        self._rows, self._count = np.zeros((MOST, 6)), 0
        self.wrong = 0
        self.mute = self.frozen = self.cut = False
        self.lean, self.heat, self.buttons, self.error = 0.0, 30, 0, 0
        self.lift = False
        self.mode, self.asked = 'normal' if services else '', []
        self.ticks = 0
        self.position = self.velocity = np.zeros(n)
        self._ending = threading.Event()
        self._before = np.zeros((4, n))
        self._sent = b''
        self.q, self.kp, self.kd = self.body.stand.copy(), np.zeros(n), np.zeros(n)
        if lying and not self.humanoid:
            self._drive(np.tile(LYING, 4), np.full(12, 60.0), np.full(12, 2.0))
            for _ in range(1000):
                self.body.step()
        self._drive(self.q, self.kp, self.kd)

    @property
    def leaning(self):
        """Whether it lies on its side or back."""
        _, x, y, _ = self.body.quaternion.tolist()
        return 1.0 - 2.0 * (x * x + y * y) < 0.7

    def _drive(self, q, kp, kd, tau=0.0):
        """Drive the joints, torque = kp (q - angle) - kd speed + tau, within what they bear."""
        if self.humanoid:
            self.body.kp, self.body.kd, self.body.added = kp, kd, tau
        else:
            model = self.body.model
            model.actuator_gainprm[:, 0] = kp
            model.actuator_biasprm[:, 0] = tau
            model.actuator_biasprm[:, 1], model.actuator_biasprm[:, 2] = -kp, -kd
        self.body.command(q)

    def run(self):
        due = time.monotonic()
        while not self._ending.is_set():
            due += DT
            if (wait := due - time.monotonic()) > 0:
                time.sleep(wait)
            elif wait < -0.05:
                due = time.monotonic()
            self._take()
            if self.lift:
                self.body.reset()
                self.lift = False
            self.body.step()
            # Copies: the body's own arrays are for this thread.
            self.position, self.velocity = self.body.position.copy(), self.body.velocity.copy()
            self.ticks += 1
            if not (self.mute or self.cut):
                if not self.frozen or not self._sent:
                    self._sent = self._state()
                self._states.publish(self._sent)
            self._serve()

    def _take(self):
        handle = self._commands.handle
        with handle:
            while (found := handle.take_message(self._kind, True)) is not None:
                if not self.cut:
                    self._obey(found[0])

    def _obey(self, message):
        cdr, packed, first, width = (HG_COMMAND, HG_C_STRUCT, 2, 7) if self.humanoid else (
            COMMAND, C_STRUCT, 9, 9)
        fields = cdr.unpack(message[4:4 + cdr.size])
        now, n = time.monotonic(), len(self.limit)
        if check_sum(packed.pack(*fields)[:-4]) != fields[-1] or (
                self.humanoid and fields[:2] != (0, MACHINE)):
            self.wrong += 1
            return
        motors = np.array(fields[first:first + n * width]).reshape(n, width)
        assert (motors[:, 0] == 1).all()
        q, dq, tau, kp, kd = motors[:, 1:6].T
        angle, speed = self.body.position, self.body.velocity
        assert not dq.any()
        torque = kp * (q - angle) - kd * speed + tau
        old_q, old_tau, old_kp, old_kd = self._before
        step = np.abs(torque - (old_kp * (old_q - angle) - old_kd * speed + old_tau))
        self._rows[self._count] = (now, kp.max(), (np.abs(torque) / self.limit).max(),
                                   step.max(), kd.max(), q[0])
        self._count += 1
        self._before = np.array([q, tau, kp, kd])
        self.q, self.tau, self.kp, self.kd = q, tau, kp, kd
        self._drive(q, kp, kd, tau)

    def _state(self):
        body = self.body
        w, x, y, z = body.quaternion.tolist()
        if self.lean:
            w, x, y, z = math.cos(self.lean / 2), math.sin(self.lean / 2), 0.0, 0.0
        up = (2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y))
        imu = [w, x, y, z, *body.twist[3:].tolist(), *(9.81 * one for one in up), 0.0, 0.0, 0.0,
               40]
        if self.humanoid:
            return self._hg_state(imu)
        words = [0xfe, 0xef, 0xff, 0, 1, 2, 3, 4, 5, *imu]
        rows = np.zeros((20, 8))
        rows[:12, 0], rows[:12, 1] = body.position, body.velocity
        rows[:12, 3] = body.torque
        for k, row in enumerate(rows.tolist()):
            words += [int(k < 12), *row[:7], self.heat if k == 4 else 30, 0, 0, 0]
        forces = dict(zip(self.robot.legs, body.feet.tolist(), strict=True))
        feet = [int(forces[leg]) for leg in ('rf', 'lf', 'rh', 'lh')]
        words += [1, 2, 3, 87, -1500, 17, 25, 25, 26, 26, *([3700] * 8), *([0] * 7), *feet,
                  *feet, self.ticks & 0xffffffff, 0, 0, self.buttons & 0xff, self.buttons >> 8,
                  *([0] * 36), 0, 0.0, 30, 31, 29.6, 1.5, 0, 0, 0, 0, 0, 0]
        return b'\0\1\0\0' + STATE.pack(*words)

    def _hg_state(self, imu):
        body, words = self.body, [1, 2, 0, MACHINE, self.ticks & 0xffffffff, *imu]
        rows = zip(body.position.tolist(), body.velocity.tolist(), body.torque.tolist(),
                   strict=True)
        for k, (angle, speed, torque) in enumerate(rows):
            # An error that has been there from the start.
            words += [1, angle, speed, 0.0, torque, 25, self.heat if k == 4 else 30, 48.0, 0, 0,
                      0x40000000 | self.error * (k == 4), 0, 0, 0, 0]
        words += [0] * (15 * 6) + [0, 0, self.buttons & 0xff, self.buttons >> 8, *([0] * 41)]
        return b'\0\1\0\0' + HG_STATE.pack(*words)

    def _serve(self):
        from unitree_api.msg import Request, Response
        for name, (requests, responses) in self._services.items():
            handle = requests.handle
            with handle:
                while (found := handle.take_message(Request, False)) is not None:
                    request = found[0]
                    number = request.header.identity.api_id
                    self.asked.append((name, number))
                    answer = Response()
                    answer.header.identity = request.header.identity
                    if number == 1001:
                        answer.data = json.dumps({'form': '0', 'name': self.mode})
                    elif number == 1003:
                        self.mode = ''
                    responses.publish(answer)

    # -- what tests look at ---------------------------------------------------------------

    @property
    def commands(self):
        """A row for each with a right check sum: six columns.

        Time s, largest kp, largest torque by what the joint bears, largest change of torque
        against the command before on the same state in N m, largest kd, the first angle in rad.
        """
        return self._rows[:self._count]

    def since(self, time_from):
        """Return the commands since a time, as rows of ``commands``."""
        rows = self.commands
        return rows[np.searchsorted(rows[:, 0], time_from):]

    @property
    def damped(self):
        """Whether the joints are only braked."""
        return not self.kp.any() and bool(self.kd.any())

    def end(self):
        self._ending.set()
        self.join()
        self.node.destroy_node()
        rclpy.shutdown(context=self.context)
