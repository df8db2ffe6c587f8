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

"""The topics of a robot's sensors: the newest plausible messages, as arrays."""

from collections.abc import Callable, Sequence
from functools import partial
import math

from cpg_ros.feedback.estimate import fill_quaternion, SensorData
from cpg_ros.feedback.foot_force import loads_of
from cpg_ros.feedback.input_monitor import InputMonitor
from cpg_ros.feedback.kinematics import Geometry
from cpg_ros.feedback.plausibility import (
    IMU,
    IMU_MEMORY,
    judge_imu,
    judge_joints,
    judge_loads,
    VERDICTS,
)
from cpg_ros.integration.jit import bound
from cpg_ros.nodes.polled_group import PolledSubscription
from cpg_ros.nodes.raw_messages import JointLayout, last_numbers, legs_of, numbers_at, stamp_of
from cpg_ros.robots.robot import Robot
from geometry_msgs.msg import WrenchStamped
import numpy as np
from rclpy.node import Node
from sensor_msgs.msg import Imu, JointState
from std_msgs.msg import Float64MultiArray

#: Sources of the loads on the feet.
CONTACTS = ('foot_contacts', 'wrenches', 'efforts')
#: All feet may be unloaded for this time, s.
FLIGHT = 0.3
#: Limits of joints that are held, rad and rad/s.
TURNED, SWUNG = 2.0 * math.pi, 20.0
#: Numbers of a Wrench; the place of one foot among one.
WRENCH, FIRST = 6, np.zeros(1, dtype=int)
#: Takes a message and the time since the last one, s; returns what is wrong with it, its numbers,
#: and whether they may repeat.
Reader = Callable[[bytes, float], tuple[str, bytes, bool]]


class _Input:
    """One topic: its newest message, what reads it, and its monitor."""

    def __init__(self, node: Node, kind: type, topic: str, read: Reader, latest: float) -> None:
        self.read = read
        self.messages = PolledSubscription(node, kind, topic, raw=True)
        self.monitor = InputMonitor(topic, latest)
        self.stamped = hasattr(kind, 'header')


class SensorInput:
    """What a robot's sensors measure.

    Attributes:
        sensor_data: of one run, filled in place with the last plausible measurements; joints
            leg by leg, then those that the robot file holds.
        monitors: of the inputs.
        feet: name of the source of the contacts.
        joints: the monitor of the measured joints.

    """

    def __init__(self, node: Node, robot: Robot, geometry: Geometry | float, imu: str,
                 joints: str, contacts: str, feet: str,
                 mount: Sequence[float] = (0.0, 0.0, 0.0), latest: float = math.inf) -> None:
        """Subscribe.

        Args:
            node: that subscribes.
            robot: that has the sensors.
            geometry: of its legs; of a robot whose efforts cannot be the contacts, its weight, N.
            imu: topic of its sensor_msgs/Imu.
            joints: topic of its measured sensor_msgs/JointState.
            contacts: one of CONTACTS.
            feet: topic of the Float64MultiArray, or the name below each leg's of its
                WrenchStamped.
            mount: roll, pitch and yaw of the IMU in the base's frame, rad.
            latest: largest age of stamped measurements when they are used, s.

        """
        if isinstance(geometry, Geometry):
            self._geometry, self._weight = geometry, geometry.weight
        else:
            self._weight = geometry
        self._legs = tuple(robot.legs)
        own, held = [joint.name for joint in robot.joints], robot.held
        # Joints that are held are measured, too, where the robot publishes them.
        self._names, self._own = [*own, *held], len(own)
        self._limits = tuple(np.append(robot.column(key), [limit] * len(held)) for key, limit in (
            ('lower', -TURNED), ('upper', TURNED), ('velocity', SWUNG)))
        count = len(self._names)
        self.sensor_data = SensorData.zeros(1, len(self._legs), count)
        self.sensor_data.joint_positions[0] = [*robot.column('offset'), *held.values()]
        self.sensor_data.acceleration[0, 2] = 9.81
        self._efforts = np.zeros(count)
        # Of the one run: rows, so that a tick need not look for them.
        senses = self.sensor_data
        self._angles, self._rates = senses.joint_positions[0], senses.joint_velocities[0]
        self._felt, self._lean = senses.foot_forces[0], senses.rpy[0]
        self._turning, self._push = senses.angular_velocity[0], senses.acceleration[0]
        self._loads = np.zeros(len(self._legs))
        self._contacts, self.feet = contacts, joints if contacts == 'efforts' else feet
        self._inputs = [_Input(node, Imu, imu, self._read_imu, latest),
                        _Input(node, JointState, joints, self._read_joints, latest)]
        if contacts == 'foot_contacts':
            self._inputs.append(_Input(node, Float64MultiArray, feet, self._read_loads,
                                       latest))
        elif contacts == 'wrenches':
            self._inputs += [_Input(node, WrenchStamped, f'{leg}/{feet}',
                                    partial(self._read_wrench, k), latest)
                             for k, leg in enumerate(self._legs)]
        self._layout: JointLayout | None = None
        self._order, self._length = np.arange(len(self._legs)), 0
        self._memory, self._now, self._moving = np.zeros(IMU_MEMORY), 0.0, False
        turned = np.zeros(4)
        fill_quaternion(mount[0], mount[1], mount[2], turned)
        self._mount = np.roll(turned, -1)
        self._heavy = np.zeros((len(self._legs), 1))
        # Types of the numbers in messages; inspecting them at every call would dominate the cost.
        told = np.frombuffer(bytes(8))
        self._judge_imu = bound(judge_imu, told, 0.1, True, self._mount, self._memory, self._lean,
                                self._turning, self._push)
        self._judge_joints = bound(judge_joints, told, told, self._order, *self._limits,
                                   self._angles, self._rates)
        self._judge_loads = bound(judge_loads, told, self._order, 0.1, 0.1, self._heavy[0],
                                  self._felt)
        self.monitors: Sequence[InputMonitor] = [one.monitor for one in self._inputs]
        self.joints = self.monitors[1]

    def restart(self) -> None:
        """Forget when messages came, as where simulated time jumps back."""
        self._memory[:] = 0.0
        for monitor in self.monitors:
            monitor.restart()

    def ages(self, now: float) -> dict[str, float]:
        """Return name -> time since the last plausible message, s; inf for none."""
        return {monitor.name: now - monitor.believed for monitor in self.monitors}

    def latencies(self) -> dict[str, float]:
        """Return name -> age of its measurements when they are used, low-passed, s."""
        return {monitor.name: monitor.age for monitor in self.monitors
                if not math.isnan(monitor.age)}

    def faults(self, now: float) -> tuple[list[str], bool]:
        """Return what is wrong with inputs, and whether a faulty one has never arrived."""
        found, waiting = [], False
        for monitor in self.monitors:
            if fault := monitor.fault(now):
                found.append(f'{monitor.name}: {fault} for {now - monitor.since:.1f} s')
                waiting = waiting or monitor.believed == -math.inf
        return found, waiting

    def take(self, now: float, moving: bool) -> None:
        """Read the messages that have arrived.

        Args:
            now: s, on the clock of the messages' stamps.
            moving: whether the robot should move, so that no measurement may stay the same.

        """
        patience = 0.0 if moving else math.inf
        self._now, self._moving = now, moving
        for one in self._inputs:
            self._take(one, now, patience)

    def _take(self, one: _Input, now: float, patience: float) -> None:
        data = one.messages.newest()
        if data is None:
            return
        monitor = one.monitor
        try:
            wrong, content, at_rest = one.read(data, monitor.gap(now))
        except ValueError as error:
            wrong, content, at_rest = str(error), b'', False
        if at_rest and patience < FLIGHT:
            patience = FLIGHT
        monitor.note(now, stamp_of(data) if one.stamped else None, content, wrong, patience)

    def _read_imu(self, data: bytes, _: float) -> tuple[str, bytes, bool]:
        # Means go on while messages are refused.
        verdict = self._judge_imu(last_numbers(data, IMU), self.monitors[0].interval(self._now),
                                  self._moving, self._mount, self._memory, self._lean,
                                  self._turning, self._push)
        return VERDICTS[verdict], data[-8 * IMU:], False

    def _read_joints(self, data: bytes, gap: float) -> tuple[str, bytes, bool]:
        layout = self._layout
        if layout is None or not layout.fits(data):
            layout = JointLayout(data, self._names)
            if layout.wrong and len(self._names) > self._own:
                layout = JointLayout(data, self._names[:self._own])
            self._layout = layout
        if layout.wrong or layout.position is None or layout.velocity is None:
            return layout.wrong, b'', False
        if self._contacts == 'efforts' and layout.effort is None:
            return 'no efforts', b'', False
        verdict = self._judge_joints(numbers_at(data, layout.position, layout.count),
                                     numbers_at(data, layout.velocity, layout.count),
                                     layout.places, *self._limits, self._angles, self._rates)
        if self._contacts == 'efforts' and not verdict:
            assert layout.effort is not None
            np.take(numbers_at(data, layout.effort, layout.count), layout.places,
                    out=self._efforts)
            loads_of(self._geometry.rows, self._geometry.columns, self._angles, self._efforts,
                     *self._lean[:2], self._loads)
            verdict = self._judge_loads(self._loads, self._order, self._weight, gap,
                                        self._heavy[0], self._felt)
        return VERDICTS[verdict], data[layout.position:], False

    def _read_loads(self, data: bytes, gap: float) -> tuple[str, bytes, bool]:
        if self._length != len(data):
            self._order, self._length = legs_of(data, self._legs), len(data)
        loads = last_numbers(data, len(self._legs))
        verdict = self._judge_loads(loads, self._order, self._weight, gap, self._heavy[0],
                                    self._felt)
        # Of numbers, not of bytes: those of -0.0, as a simulation may send it, are not all 0.
        return VERDICTS[verdict], data[-8 * len(self._legs):], not any(loads.tolist())

    def _read_wrench(self, foot: int, data: bytes, gap: float) -> tuple[str, bytes, bool]:
        x, y, z = last_numbers(data, WRENCH)[:3].tolist()
        # Its frame turns with the leg, but the length of the force is the same in every frame.
        self._loads[foot] = load = math.sqrt(x * x + y * y + z * z)
        verdict = self._judge_loads(self._loads[foot:foot + 1], FIRST, self._weight, gap,
                                    self._heavy[foot], self._felt[foot:foot + 1])
        return VERDICTS[verdict], data[-8 * WRENCH:], not load
