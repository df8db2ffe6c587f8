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

"""Topics of a robot's sensors: the newest plausible messages, as arrays."""

from collections.abc import Iterator, Sequence
from contextlib import contextmanager, ExitStack
import ctypes
import math
from typing import Any

from cpg_ros.feedback.closed_loop import (
    CONTACTS,
    EFFORTS,
    FOOT_CONTACTS,
    FORCE_SIZE,
    Senses,
    WRENCHES,
)
from cpg_ros.feedback.estimate import SensorData
from cpg_ros.feedback.input_checks import IMU, InputMonitor, UNREADABLE
from cpg_ros.feedback.kinematics import Geometry, LegArrays
from cpg_ros.motion.robot import Robot
from cpg_ros.motion.rotations import fill_quaternion
from cpg_ros.ros.node import native
from cpg_ros.ros.node.polled import PolledSubscription
from geometry_msgs.msg import WrenchStamped
import numpy as np
from rclpy.node import Node
from rclpy.serialization import deserialize_message
from sensor_msgs.msg import Imu, JointState
from std_msgs.msg import Float64MultiArray

__all__ = ['CONTACTS', 'JointLayout', 'SensorInput', 'legs_of']

# Finds the numbers in messages that were taken as bytes.

#: HEADER_SIZE, bytes: of the encapsulation; fields are aligned relative to its end. DOUBLE, bytes.
HEADER_SIZE, DOUBLE = 4, 8
#: Number of values of a Wrench.
WRENCH_SIZE = 6
#: Limits of joints that are held. MAX_ANGLE: of the angle, rad; MAX_SPEED: of the speed, rad/s.
MAX_ANGLE, MAX_SPEED = 2.0 * math.pi, 20.0


class JointLayout:
    """Layout of a publisher's joint states, shared by all messages with the same names.

    Attributes:
        wrong: why the messages cannot be used, or ''.
        position, velocity, effort: first byte of the joints' doubles, in the message's order; None
            if missing.
        indices: index of each wanted joint in the message, shape (joints,).
        same: range of bytes that identifies the layout: names and counts.

    """

    def __init__(self, data: bytes, joints: Sequence[str]) -> None:
        message = deserialize_message(data, JointState)
        names = list(message.name)
        missing = [name for name in joints if names.count(name) != 1]
        self.wrong = f'no joint {missing[0]}, or more than one' if missing else ''
        self.indices = np.array([] if missing else [names.index(name) for name in joints], int)
        self.same = [(1, 2)]
        end = HEADER_SIZE + 8

        def keep(size: int) -> None:
            nonlocal end
            self.same.append((end, end + size))
            end += size

        def text(value: str) -> None:
            keep(4 + len(value.encode()) + 1)
            align(4)

        def align(size: int) -> None:
            nonlocal end
            end += (HEADER_SIZE - end) % size

        text(message.header.frame_id)
        keep(4)
        for name in names:
            text(name)
        parts: list[int | None] = []
        for numbers in (message.position, message.velocity, message.effort):
            align(4)
            keep(4)
            if len(numbers):
                align(8)
            whole = len(numbers) == len(names) and len(names) > 0
            parts.append(end if whole else None)
            end += 8 * len(numbers)
        self.position, self.velocity, self.effort = parts
        if not self.wrong:
            for part, what in ((self.position, 'positions'), (self.velocity, 'velocities')):
                if part is None:
                    self.wrong = f'no {what}'
                    break


def legs_of(data: bytes, legs: Sequence[str]) -> np.ndarray:
    """Return each leg's index among the numbers of a Float64MultiArray, shape (legs,).

    The first dimension's label may name the legs, separated by commas; the default is the given
    order.

    Raises:
        ValueError: it does not have one number for each leg.

    """
    message = deserialize_message(data, Float64MultiArray)
    if len(message.data) != len(legs):
        raise ValueError(f'{len(message.data)} numbers for {len(legs)} legs')
    labels = message.layout.dim[0].label.split(',') if message.layout.dim else []
    if sorted(labels) == sorted(legs):
        return np.array([labels.index(leg) for leg in legs])
    return np.arange(len(legs))


class _Input:
    """One topic: subscription, monitor, and destination of its numbers.

    Attributes:
        messages: the subscription.
        monitor: see InputMonitor.
        struct: by which ``tick.c`` reads them.

    """

    def __init__(self, messages: PolledSubscription, monitor: InputMonitor, struct: native.Input,
                 unreadable: np.ndarray) -> None:
        """Subscribe; unreadable is Senses' of the input, shape (1,)."""
        self.messages, self.monitor, self.struct = messages, monitor, struct
        self._unreadable = unreadable
        self.expect((), 0)

    def expect(self, indices: Sequence[int] | np.ndarray, length: int, known: bytes = b'',
               same: Sequence[tuple[int, int]] = (), wrong: str = '') -> None:
        """Expect messages of a layout from now on.

        Args:
            indices: first byte of each number; negative from the end.
            length: of the messages, bytes; negative for the shortest ones.
            known: one of them.
            same: range of its bytes that all messages must have.
            wrong: why they cannot be used, or ''.

        """
        self._kept = np.array(indices, dtype=np.int64), np.array(same, dtype=np.int64), known
        struct, (offsets, ranges, _) = self.struct, self._kept
        struct.place, struct.count = offsets.ctypes.data, 0 if wrong else offsets.size
        struct.same, struct.ranges = ranges.ctypes.data, len(same)
        struct.sample = ctypes.cast(ctypes.c_char_p(known), ctypes.c_void_p).value
        struct.length, self.monitor.other = length, wrong
        self._unreadable[0] = UNREADABLE if wrong else 0


class SensorInput:
    """Measurements of a robot's sensors.

    Attributes:
        sensor_data: of one run, filled in place with the last plausible measurements; joints
            leg by leg, then those that the robot file holds.
        senses: what messages are read into.
        legs: of the robot, without rows where efforts cannot be the contacts.
        structs: how ``tick.c`` takes and reads the messages of each input, see ``held``.
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
            robot: with the sensors.
            geometry: of its legs; for a robot whose efforts cannot give contacts, its weight, N.
            imu: topic of its sensor_msgs/Imu.
            joints: topic of its measured sensor_msgs/JointState.
            contacts: one of CONTACTS.
            feet: topic of the Float64MultiArray, or suffix to each leg's name for its
                WrenchStamped.
            mount: roll, pitch and yaw of the IMU in the base's frame, rad.
            latest: largest age of stamped measurements when they are used, s; of a robot with a
                geometry also for moments.

        """
        self.legs = geometry.arrays if isinstance(geometry, Geometry) else LegArrays(
            np.zeros((0, 1)), np.zeros((0, 3), dtype=np.int64), 0.0, float(geometry))
        self._legs = tuple(robot.legs)
        own, held = [joint.name for joint in robot.joints], robot.held
        # Joints that are held are measured, too, where the robot publishes them.
        self._names, self._own = [*own, *held], len(own)
        limits = np.stack([np.append(robot.column(key), [limit] * len(held)) for key, limit in (
            ('lower', -MAX_ANGLE), ('upper', MAX_ANGLE), ('velocity', MAX_SPEED))])
        self.sensor_data = SensorData.zeros(1, len(self._legs), len(self._names))
        self.sensor_data.joint_positions[0] = [*robot.column('offset'), *held.values()]
        self.sensor_data.acceleration[0, 2] = 9.81
        turned = np.zeros(4)
        fill_quaternion(mount[0], mount[1], mount[2], turned)
        self.senses = senses = Senses.empty(len(self._legs), limits, np.roll(turned, -1),
                                            self.legs.weight, contacts)
        self._contacts, self.feet = contacts, joints if contacts == EFFORTS else feet
        topics: list[tuple[type, str, np.ndarray]] = [
            (Imu, imu, senses.imu), (JointState, joints, senses.joints)]
        if contacts == FOOT_CONTACTS:
            topics.append((Float64MultiArray, feet, senses.feet))
        elif contacts == WRENCHES:
            topics += [(WrenchStamped, f'{leg}/{feet}', row)
                       for leg, row in zip(self._legs, senses.feet, strict=True)]
        self.structs = (native.Input * len(topics))()
        self.inputs = [
            _Input(PolledSubscription(node, kind, topic, raw=True),
                   InputMonitor(topic, latest, senses.monitors[k],
                                peaks=isinstance(geometry, Geometry)),
                   self.structs[k], senses.unreadable[k:k + 1])
            for k, (kind, topic, _) in enumerate(topics)]
        for k, (struct, (kind, _, values)) in enumerate(zip(self.structs, topics, strict=True)):
            struct.message, struct.values = native.empty_message(), values.ctypes.data
            struct.stamp, struct.news = (part[k:].ctypes.data
                                         for part in (senses.stamps, senses.news))
            struct.stamped = hasattr(kind, 'header')
        self.inputs[0].expect(DOUBLE * (np.arange(IMU) - IMU), -(HEADER_SIZE + DOUBLE * IMU))
        for source in self.inputs[2:]:
            if contacts == WRENCHES:
                source.expect(DOUBLE * (np.arange(FORCE_SIZE) - WRENCH_SIZE),
                              -(HEADER_SIZE + DOUBLE * WRENCH_SIZE))
        self.monitors: Sequence[InputMonitor] = [source.monitor for source in self.inputs]
        self.joints = self.monitors[1]
        self._library = native.library()

    @contextmanager
    def held(self) -> Iterator[None]:
        """Let C take the messages in the meantime."""
        with ExitStack() as kept:
            for item in self.inputs:
                kept.enter_context(item.messages.handle)
                item.struct.subscription = item.messages.handle.pointer
                item.struct.depth = item.messages.depth
            yield

    def restart(self) -> None:
        """Forget the times of messages, as after a jump of simulated time."""
        self.senses.memory[:] = 0.0
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
        """Return the inputs' faults as last judged, and whether a faulty one has never arrived."""
        faults, waiting = [], False
        for monitor in self.monitors:
            if fault := monitor.reason:
                faults.append(f'{monitor.name}: {fault} for {now - monitor.since:.1f} s')
                waiting = waiting or monitor.believed == -math.inf
        return faults, waiting

    def read(self) -> None:
        """Read the numbers of the messages that have arrived."""
        for k, item in enumerate(self.inputs):
            struct = item.struct
            data = item.messages.newest()
            if data is None and struct.unread:
                # C has taken it, and does not know its layout.
                data = ctypes.string_at(struct.message.buffer, struct.message.length)
            if data is None:
                continue
            address = ctypes.byref(struct)
            if not self._library.read_input(address, data, len(data)):
                self._learn(k, item, data)
                self._library.read_input(address, data, len(data))

    def _learn(self, number: int, item: _Input, data: bytes) -> None:
        """Find the positions of the numbers in messages of a new layout."""
        indices: Any = ()
        same: Sequence[tuple[int, int]] = ()
        wrong = f'messages of {len(data)} bytes'
        if number == 1:
            indices, same, wrong = self._joint_offsets(data)
        elif number == 2 and self._contacts == FOOT_CONTACTS:
            try:
                order, wrong = legs_of(data, self._legs), ''
                indices = DOUBLE * (order - order.size)
            except ValueError as error:
                wrong = str(error)
        item.expect(indices, len(data), data, same, wrong)

    def _joint_offsets(self, data: bytes) -> tuple[np.ndarray, list[tuple[int, int]], str]:
        layout = JointLayout(data, self._names)
        if layout.wrong and len(self._names) > self._own:
            layout = JointLayout(data, self._names[:self._own])
        wrong, joints = layout.wrong, layout.indices
        if not wrong and self._contacts == EFFORTS and layout.effort is None:
            wrong = 'no efforts'
        begin = layout.position, layout.velocity, layout.effort or layout.position
        if wrong:
            return joints, layout.same, wrong
        self.senses.counts[0], self.senses.counts[2] = joints.size, layout.effort is not None
        # What is not measured is not used: any number will do.
        joints = np.append(joints, np.zeros(len(self._names) - joints.size, dtype=int))
        return (np.concatenate([first + DOUBLE * joints for first in begin if first is not None]),
                layout.same, '')
