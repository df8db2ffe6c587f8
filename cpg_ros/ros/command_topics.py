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

"""Joint commands from topics, as a robot's controllers receive them."""

from collections.abc import Sequence
from functools import partial
import math
from typing import Any

from cpg_ros.common.errors import CpgError
from cpg_ros.feedback.laws.stiffen import LAW
from cpg_ros.motion.robot import Robot
from cpg_ros.motion.robot_file import MAX_NUMBER
from cpg_ros.ros.generator_io import COMMAND_TOPICS, joint_state
from cpg_ros.ros.node.message_block import indices, MessageBlock, Template
from cpg_ros.ros.node.parameters import Spec
from cpg_ros.ros.node.polled import PolledSubscription
import numpy as np
from rclpy.node import Node
from rclpy.qos import QoSProfile
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64, Float64MultiArray
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

# The topic ``kp_scale``: the factor of the servos' proportional gain that the feedback requests.

KP_SCALE_TOPIC = 'kp_scale'
#: REPEAT_PERIOD: of a factor other than 1, s; SCALE_TIMEOUT: without a message, after which
#: receivers use 1 again, s.
REPEAT_PERIOD, SCALE_TIMEOUT = 0.02, 0.1
MAX_KP_SCALE = LAW.gains['stiffen_kp'].high


def kp_scale_block(node: Node, scale: np.ndarray) -> MessageBlock:
    """Return the message of a factor, shape (1,), as it changes and again while it is not 1."""
    message = Float64()
    return MessageBlock(node, [1], [(KP_SCALE_TOPIC, Template(
        message, numbers=[(message, 'data', np.arange(1))]))]).feed(
            scale, period=REPEAT_PERIOD, quiet=True)


class KpScaleSubscription:
    """Receives the factor from the topic."""

    def __init__(self, node: Node) -> None:
        self._subscription = PolledSubscription(node, Float64, KP_SCALE_TOPIC)
        self._scale, self._received = 1.0, 0.0

    def receive(self, now: float) -> float:
        """Return the factor, from 1 to MAX_KP_SCALE; 1 if the last message is out of range or old.

        Args:
            now: s, from any origin.

        """
        if (message := self._subscription.newest()) is not None:
            valid = 1.0 <= message.data <= MAX_KP_SCALE
            self._scale, self._received = message.data if valid else 1.0, now
        if self._scale != 1.0 and not 0.0 <= now - self._received < SCALE_TIMEOUT:
            self._scale = 1.0
        return self._scale


# The topic ``held/joint_states``: target angles of the joints that belong to no leg.

HELD_TOPIC = 'held/joint_states'


def held_block(node: Node, robot: Robot, angles: np.ndarray) -> MessageBlock:
    """Return the message of where held joints are driven, rad, in the order of ``robot.held``."""
    sizes = [len(robot.held)]
    return MessageBlock(node, sizes, [
        (HELD_TOPIC, joint_state(tuple(robot.held), *indices(sizes)))]).feed(angles)


class HeldSubscription:
    """Receives target angles of held joints."""

    def __init__(self, node: Node, robot: Robot) -> None:
        self._subscription = PolledSubscription(node, JointState, HELD_TOPIC)
        self._names = list(robot.held)

    def receive(self) -> np.ndarray | None:
        """Return the newest angles, rad, shape (joints,); None without a new, valid message."""
        message = self._subscription.newest()
        if (message is None or list(message.name) != self._names
                or len(message.position) != len(self._names)
                or not all(map(math.isfinite, message.position))):
            return None
        return np.array(message.position)


#: Least time between two warnings about messages, s.
WARNING_PERIOD = 10.0


class _Bad(CpgError):
    """A message that cannot be used."""


# The topic ``feedforward/joint_states``: torques of another node, beside the joints' targets.

FEEDFORWARD_TOPIC = 'feedforward/joint_states'
FEEDFORWARD = Spec(0.0, f"largest torque that messages on {FEEDFORWARD_TOPIC} may add, as a "
                   "fraction of the motors' limits; 0 ignores them", 0.0, 1.0)
#: FEEDFORWARD_TIMEOUT: time without a message after which torques fall to 0, s;
#: FEEDFORWARD_RISE_TIME: time in which a torque passes from 0 to its limit, s.
FEEDFORWARD_TIMEOUT, FEEDFORWARD_RISE_TIME = 0.05, 0.05


class FeedforwardSubscription:
    """Receives torques that the motors add to those of their targets.

    A message has ``effort`` of any of the joints; the others get none.

    Attributes:
        topic: resolved name.
        torque: what the motors add now, N m, shape (joints,).

    """

    def __init__(self, node: Node, joints: Sequence[str], limit: np.ndarray) -> None:
        """Subscribe; ``limit`` are the largest torques of ``joints``, N m, finite."""
        self._node, self._limit = node, limit
        self._subscription = PolledSubscription(node, JointState, FEEDFORWARD_TOPIC)
        self.topic = self._subscription.topic
        self._index = {name: k for k, name in enumerate(joints)}
        self.torque, self._goal = np.zeros((2, len(joints)))
        self._received, self._before = -math.inf, math.inf

    def receive(self, now: float, active: bool = True) -> np.ndarray:
        """Return ``torque``, which follows the newest message within the limits.

        It fades to 0 where that message is old or cannot be used, or where not ``active``.

        Args:
            now: s, from any origin.
            active: whether torques may act.

        """
        if (message := self._subscription.newest()) is not None:
            self._received = now
            try:
                self._goal = self._read(message)
            except _Bad as error:
                self._goal = np.zeros(len(self._limit))
                self._node.get_logger().warning(f'ignored: {error}',
                                                throttle_duration_sec=WARNING_PERIOD)
        valid = active and 0.0 <= now - self._received < FEEDFORWARD_TIMEOUT
        step = self._limit * min(max(now - self._before, 0.0) / FEEDFORWARD_RISE_TIME, 1.0)
        self._before = now
        self.torque = self.torque + np.clip(self._goal * valid - self.torque, -step, step)
        return self.torque

    def _read(self, message: JointState) -> np.ndarray:
        """Return the torques of a message, N m, shape (joints,); raise _Bad if it has others."""
        names, efforts = message.name, message.effort
        if len(efforts) != len(names):
            raise _Bad(f'{self.topic}: {len(efforts)} efforts for {len(names)} joints')
        goal = np.zeros(len(self._limit))
        for name, effort in zip(names, efforts, strict=True):
            if name not in self._index:
                raise _Bad(f"{self.topic}: joint '{name}' is not one of {', '.join(self._index)}")
            if names.count(name) != 1:
                raise _Bad(f"{self.topic}: joint '{name}' is there twice")
            if not math.isfinite(effort):
                raise _Bad(f"{self.topic}: joint '{name}' with {effort} N m")
            goal[self._index[name]] = effort
        return np.clip(goal, -self._limit, self._limit)


# The target angles, in messages of any of KINDS.

KINDS = ('joint_states', *COMMAND_TOPICS)


class Commands:
    """Angles of the last valid messages.

    ``receive`` reads the messages that have arrived, in the calling thread. It accepts a message
    as a whole, or rejects it if anything in it is invalid.

    Attributes:
        angles: rad, in ``robot.order``; before the first command, those passed to __init__.
        topics: names of the topics, resolved.
        refused: why the last ``receive`` rejected a message, or ''.

    """

    def __init__(self, node: Node, robot: Robot, kind: str, period: float, angles: np.ndarray
                 ) -> None:
        """Subscribe to the topics of one kind of command, one of KINDS.

        ``period`` is the time between two calls of ``receive``, s; ``angles`` are those before the
        first command, rad.
        """
        self._node, self._robot, self._period = node, robot, period
        self.angles = np.array(angles, dtype=float)
        self._index = {name: k for k, name in enumerate(robot.order)}
        # One for each topic: the subscription, what reads a message, and names -> slots.
        self._sources: list[tuple[PolledSubscription, Any]] = []
        self._known: dict[str, tuple[list[str], np.ndarray]] = {}
        self._fresh: list[bool] = []
        self._since = 0
        self.refused = ''
        if kind == 'joint_states':
            for leg, joints in robot.legs.items():
                topic = f'{leg}/joint_states'
                self._listen(JointState, topic, self._states,
                             tuple(joint.name for joint in joints))
        elif kind == 'joint_trajectory':
            self._listen(JointTrajectory, COMMAND_TOPICS[kind], self._trajectory)
        else:
            self._listen(Float64MultiArray, COMMAND_TOPICS[kind], self._array)
        self.topics = [subscription.topic for subscription, _ in self._sources]

    def _listen(self, kind: type, topic: str, read: Any, *arguments: Any) -> None:
        subscription = PolledSubscription(self._node, kind, topic, QoSProfile(depth=10))
        self._sources.append((subscription, partial(read, topic, *arguments)))
        self._fresh.append(False)

    @property
    def connected(self) -> bool:
        """Whether every topic has a publisher."""
        return all(self._node.count_publishers(topic) for topic in self.topics)

    def expect(self, since: int) -> None:
        """Expect commands with a stamp not before an instant, ns."""
        self._since = since
        self._fresh = [False] * len(self._fresh)

    def receive(self) -> bool:
        """Read the arrived messages; return whether all topics have an expected command."""
        self.refused = ''
        for k, (subscription, read) in enumerate(self._sources):
            # All of them: an invalid one is reported even if a valid one has followed.
            for message, _ in subscription.receive():
                try:
                    self._fresh[k] |= read(message)
                except _Bad as error:
                    self.refused = str(error)
                    self._node.get_logger().warning(f'ignored: {error}',
                                                    throttle_duration_sec=WARNING_PERIOD)
        return all(self._fresh)

    def _states(self, topic: str, joints: tuple[str, ...], message: JointState) -> bool:
        self._apply(topic, joints, message.name, message.position)
        stamp = message.header.stamp
        nanoseconds = 1_000_000_000 * stamp.sec + stamp.nanosec
        return not nanoseconds or nanoseconds >= self._since

    def _trajectory(self, topic: str, message: JointTrajectory) -> bool:
        if not message.points:
            raise _Bad(f'{topic}: no points')

        def apart(point: JointTrajectoryPoint) -> float:
            time = point.time_from_start
            return abs(time.sec + 1e-9 * time.nanosec - self._period)

        # A controller would interpolate; here it is the point next to the coming instant.
        point = min(message.points, key=apart)
        self._apply(topic, self._robot.order, message.joint_names, point.positions)
        return True

    def _array(self, topic: str, message: Float64MultiArray) -> bool:
        if len(message.data) != len(self.angles):
            raise _Bad(f'{topic}: {len(message.data)} numbers for {len(self.angles)} joints')
        self._write(topic, self._robot.order, slice(None), message.data)
        return True

    def _apply(self, topic: str, joints: tuple[str, ...], names: list[str],
               positions: Sequence[float]) -> None:
        layout = self._known.get(topic)
        if layout is None or layout[0] != names:
            layout = list(names), self._indices(topic, joints, names)
            self._known[topic] = layout
        if len(positions) != len(names):
            raise _Bad(f'{topic}: {len(positions)} positions for {len(names)} joints')
        self._write(topic, names, layout[1], positions)

    def _indices(self, topic: str, joints: tuple[str, ...], names: list[str]) -> np.ndarray:
        for name in names:
            if name not in joints:
                raise _Bad(f"{topic}: joint '{name}' is not one of {', '.join(joints)}")
        for name in joints:
            if names.count(name) != 1:
                raise _Bad(f"{topic}: joint '{name}' is "
                           f"{'there twice' if name in names else 'missing'}")
        return np.array([self._index[name] for name in names])

    def _write(self, topic: str, names: Sequence[str], slots: Any, values: Sequence[float]
               ) -> None:
        for name, value in zip(names, values, strict=True):
            if not abs(value) <= MAX_NUMBER:
                raise _Bad(f"{topic}: joint '{name}' at {value}")
        self.angles[slots] = values
