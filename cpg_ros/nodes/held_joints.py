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

"""The topic ``held/joint_states``: where the joints that are no leg's are to be driven."""

import math

from cpg_ros.nodes.joint_publishers import joint_state
from cpg_ros.nodes.message_block import MessageBlock, places
from cpg_ros.nodes.polled_group import PolledSubscription
from cpg_ros.robots.robot import Robot
import numpy as np
from rclpy.node import Node
from sensor_msgs.msg import JointState

TOPIC = 'held/joint_states'


class HeldPublisher:
    """Publishes where held joints are to be driven."""

    def __init__(self, node: Node, robot: Robot) -> None:
        sizes = [len(robot.held)]
        self._block = MessageBlock(node, sizes, [
            (TOPIC, joint_state(tuple(robot.held), *places(sizes)))])

    def publish(self, stamp: int, angles: np.ndarray) -> None:
        """Publish angles in rad, in the order of ``robot.held``; stamp in ns."""
        self._block.publish(stamp, (angles,))


class HeldSubscription:
    """Takes where held joints are to be driven from the topic."""

    def __init__(self, node: Node, robot: Robot) -> None:
        self._subscription = PolledSubscription(node, JointState, TOPIC)
        self._names = list(robot.held)

    def take(self) -> np.ndarray | None:
        """Return the newest angles, rad, shape (joints,); None without a new message that fits."""
        message = self._subscription.newest()
        if (message is None or list(message.name) != self._names
                or len(message.position) != len(self._names)
                or not all(map(math.isfinite, message.position))):
            return None
        return np.array(message.position)
