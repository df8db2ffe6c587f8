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

"""Joint commands taken from topics, as a robot's controllers would take them."""

from collections.abc import Sequence
from functools import partial
from typing import Any

from cpg_ros.errors import CpgError
from cpg_ros.nodes.joint_publishers import COMMAND_TOPICS
from cpg_ros.nodes.polled_group import PolledSubscription
from cpg_ros.robots.robot import Robot
from cpg_ros.robots.robot_file import LARGEST
import numpy as np
from rclpy.node import Node
from rclpy.qos import QoSProfile
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64MultiArray
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

KINDS = ('joint_states', *COMMAND_TOPICS)
#: Least time between two warnings about commands, s.
QUIET = 10.0


class _Bad(CpgError):
    """A message that cannot be used."""


class Commands:
    """The angles of the last valid messages.

    ``take`` reads the messages that have arrived, in the thread that uses them. A message is used
    as a whole or, if anything in it is invalid, not at all.

    Attributes:
        angles: rad, in ``robot.order``; before the first command, those passed to __init__.
        topics: the names of the topics, resolved.
        refused: why the last ``take`` rejected a message; '' if it did not.

    """

    def __init__(self, node: Node, robot: Robot, kind: str, period: float, angles: np.ndarray
                 ) -> None:
        """Subscribe to the topics of one kind of command.

        Args:
            node: that subscribes.
            robot: whose joints are commanded.
            kind: one of KINDS.
            period: between two calls of ``take``, s.
            angles: before the first command, rad.

        """
        self._node, self._robot, self._period = node, robot, period
        self.angles = np.array(angles, dtype=float)
        self._index = {name: k for k, name in enumerate(robot.order)}
        # One for each topic: the subscription, what reads a message, and names -> places.
        self._sources: list[tuple[PolledSubscription, Any]] = []
        self._known: dict[str, tuple[list[str], np.ndarray]] = {}
        self._fresh: list[bool] = []
        self._since = 0
        self.refused = ''
        if kind == 'joint_states':
            for leg, joints in robot.legs.items():
                topic = f'{leg}/joint_states'
                self._listen(JointState, topic, self._states, tuple(one.name for one in joints))
        elif kind == 'joint_trajectory':
            self._listen(JointTrajectory, COMMAND_TOPICS[kind], self._trajectory)
        else:
            self._listen(Float64MultiArray, COMMAND_TOPICS[kind], self._array)
        self.topics = [subscription.topic for subscription, _ in self._sources]

    def _listen(self, kind: type, topic: str, read: Any, *known: Any) -> None:
        subscription = PolledSubscription(self._node, kind, topic, QoSProfile(depth=10))
        self._sources.append((subscription, partial(read, topic, *known)))
        self._fresh.append(False)

    @property
    def connected(self) -> bool:
        """Whether every topic has a publisher."""
        return all(self._node.count_publishers(topic) for topic in self.topics)

    def expect(self, since: int) -> None:
        """Expect commands that are not stamped before an instant, ns."""
        self._since = since
        self._fresh = [False] * len(self._fresh)

    def take(self) -> bool:
        """Read what has arrived; return whether every topic has brought an expected command."""
        self.refused = ''
        for k, (subscription, read) in enumerate(self._sources):
            # All of them: an invalid one is reported even if a valid one has followed.
            for message, _ in subscription.take():
                try:
                    self._fresh[k] |= read(message)
                except _Bad as error:
                    self.refused = str(error)
                    self._node.get_logger().warning(f'ignored: {error}',
                                                    throttle_duration_sec=QUIET)
        return all(self._fresh)

    def _states(self, topic: str, wanted: tuple[str, ...], message: JointState) -> bool:
        self._apply(topic, wanted, message.name, message.position)
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

    def _apply(self, topic: str, wanted: tuple[str, ...], names: list[str],
               positions: Sequence[float]) -> None:
        known = self._known.get(topic)
        if known is None or known[0] != names:
            known = list(names), self._places(topic, wanted, names)
            self._known[topic] = known
        if len(positions) != len(names):
            raise _Bad(f'{topic}: {len(positions)} positions for {len(names)} joints')
        self._write(topic, names, known[1], positions)

    def _places(self, topic: str, wanted: tuple[str, ...], names: list[str]) -> np.ndarray:
        for name in names:
            if name not in wanted:
                raise _Bad(f"{topic}: joint '{name}' is not one of {', '.join(wanted)}")
        for name in wanted:
            if names.count(name) != 1:
                raise _Bad(f"{topic}: joint '{name}' is "
                           f"{'there twice' if name in names else 'missing'}")
        return np.array([self._index[name] for name in names])

    def _write(self, topic: str, names: Sequence[str], places: Any, values: Sequence[float]
               ) -> None:
        for name, value in zip(names, values, strict=True):
            if not abs(value) <= LARGEST:
                raise _Bad(f"{topic}: joint '{name}' at {value}")
        self.angles[places] = values
