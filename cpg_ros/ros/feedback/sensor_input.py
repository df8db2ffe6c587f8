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
import struct

from cpg_ros.dynamics.integration.compilation import specialised
from cpg_ros.feedback.estimate import loads_of, SensorData
from cpg_ros.feedback.input_checks import (
    IMU,
    IMU_MEMORY,
    InputMonitor,
    judge_imu,
    judge_joints,
    judge_loads,
    VERDICTS,
)
from cpg_ros.feedback.kinematics import Geometry
from cpg_ros.motion.robot import Robot
from cpg_ros.motion.rotations import fill_quaternion
from cpg_ros.ros.node.polled import PolledSubscription
from geometry_msgs.msg import WrenchStamped
import numpy as np
from rclpy.node import Node
from rclpy.serialization import deserialize_message
from sensor_msgs.msg import Imu, JointState
from std_msgs.msg import Float64MultiArray

# Finds the numbers in messages that were taken as bytes.

#: HEADER: bytes of the encapsulation; fields are aligned relative to its end.
HEADER = 4


def stamp_of(data: bytes) -> float | None:
    """Return the stamp of a message that begins with a header, s; None for none."""
    seconds, nanoseconds = struct.unpack_from('<iI' if data[1] & 1 else '>iI', data, HEADER)
    return seconds + 1e-9 * nanoseconds if seconds or nanoseconds else None


def numbers_at(data: bytes, begin: int, count: int) -> np.ndarray:
    """Return the doubles from a byte on, read-only, shape (count,).

    Raises:
        ValueError: the message is shorter.

    """
    if data[1] & 1:
        return np.frombuffer(data, float, count, begin)
    swapped = np.frombuffer(data, '>f8', count, begin).astype(float)
    swapped.flags.writeable = False
    return swapped


def last_numbers(data: bytes, count: int) -> np.ndarray:
    """Return the doubles at the end of a message; as numbers_at."""
    return numbers_at(data, len(data) - 8 * count, count)


class JointLayout:
    """The layout of a publisher's joint states, the same for all messages with the same names.

    Attributes:
        wrong: why the messages cannot be used, or ''.
        position, velocity, effort: the byte at which the joints' doubles begin, in the message's
            own order; None where there are none.
        count: of the joints in a message.
        places: index of each wanted joint in the message, shape (joints,).

    """

    def __init__(self, data: bytes, wanted: Sequence[str]) -> None:
        message = deserialize_message(data, JointState)
        names = list(message.name)
        missing = [name for name in wanted if names.count(name) != 1]
        self.wrong = f'no joint {missing[0]}, or more than one' if missing else ''
        self.places = np.array([] if missing else [names.index(name) for name in wanted], int)
        self._length, self.count = len(data), len(names)
        # What shows that another message has the same layout: names and counts.
        self._same: list[tuple[slice, bytes]] = [(slice(1, 2), data[1:2])]
        end = HEADER + 8

        def keep(size: int) -> None:
            nonlocal end
            self._same.append((slice(end, end + size), data[end:end + size]))
            end += size

        def text(value: str) -> None:
            keep(4 + len(value.encode()) + 1)
            align(4)

        def align(size: int) -> None:
            nonlocal end
            end += (HEADER - end) % size

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
        # The names and what is between them, at once: the bytes that align them are mostly alike.
        first, last = self._same[1][0].start, self._same[-1][0].stop
        middle = slice(first, self.position if self.position is not None else last)
        self._quick = [(part, data[part]) for part in (
            slice(1, 2), middle, *(part for part, _ in self._same if part.start >= middle.stop))]

    def fits(self, data: bytes) -> bool:
        """Tell whether another message has the same layout."""
        if len(data) != self._length:
            return False
        for part, known in self._quick:
            if data[part] != known:
                return all(data[part] == known for part, known in self._same)
        return True


def legs_of(data: bytes, legs: Sequence[str]) -> np.ndarray:
    """Return the index of each leg among the numbers of a Float64MultiArray, shape (legs,).

    Its first dimension's label may name them, with commas in between; otherwise they come in
    the given order.

    Raises:
        ValueError: it has not one number a leg.

    """
    message = deserialize_message(data, Float64MultiArray)
    if len(message.data) != len(legs):
        raise ValueError(f'{len(message.data)} numbers for {len(legs)} legs')
    labels = message.layout.dim[0].label.split(',') if message.layout.dim else []
    if sorted(labels) == sorted(legs):
        return np.array([labels.index(leg) for leg in legs])
    return np.arange(len(legs))


#: Sources of the loads on the feet.
CONTACTS = ('foot_contacts', 'wrenches', 'efforts')
#: FLIGHT: longest time for which all feet may be unloaded, s.
FLIGHT = 0.3
#: Limits of joints that are held. TURNED: of the angle, rad; SWUNG: of the speed, rad/s.
TURNED, SWUNG = 2.0 * math.pi, 20.0
#: WRENCH: number of values of a Wrench; FIRST: index 0, for checks of a single foot.
WRENCH, FIRST = 6, np.zeros(1, dtype=int)
#: Takes a message and the time since the last one, s; returns the fault or '', the bytes of its
#: values, and whether these may repeat.
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
        bits = np.frombuffer(bytes(8))
        self._judge_imu = specialised(judge_imu, bits, 0.1, True, self._mount, self._memory,
                                      self._lean,
                                self._turning, self._push)
        self._judge_joints = specialised(judge_joints, bits, bits, self._order, *self._limits,
                                   self._angles, self._rates)
        self._judge_loads = specialised(judge_loads, bits, self._order, 0.1, 0.1, self._heavy[0],
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

    def update(self, now: float, moving: bool) -> None:
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
