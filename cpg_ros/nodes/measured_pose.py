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

"""The joint angles that the robot's own driver publishes."""

import math
import time

from cpg_ros.nodes.polled_group import PolledSubscription
from cpg_ros.nodes.qos_profiles import best_effort
from cpg_ros.robots.robot import Robot
import numpy as np
from rclpy.node import Node
from sensor_msgs.msg import JointState

#: Older joint states say nothing about where the joints are now, s.
FRESH = 1.0


class MeasuredPose:
    """The newest angles of the joints on a topic of joint states, read on demand.

    Attributes:
        topic: its resolved name.

    """

    def __init__(self, node: Node, robot: Robot, topic: str) -> None:
        self._index = {joint.name: k for k, joint in enumerate(robot.joints)}
        self._angles = np.full(len(self._index), math.nan)
        self._arrived = np.zeros(len(self._index), dtype=np.int64)
        # Several publishers may share the topic.
        self._subscription = PolledSubscription(node, JointState, topic, best_effort(8))
        self.topic = self._subscription.topic

    def take(self, fresh: float = FRESH) -> np.ndarray:
        """Return the angle of each joint, rad, leg by leg; NaN where none is ``fresh``, in s."""
        for message, arrived in self._subscription.take():
            for name, angle in zip(message.name, message.position, strict=False):
                if (k := self._index.get(name)) is not None and math.isfinite(angle):
                    self._angles[k], self._arrived[k] = angle, arrived
        return np.where(self._arrived > time.time_ns() - fresh * 1e9, self._angles, math.nan)

    def lacks(self, angles: np.ndarray) -> str:
        """Return why angles that were taken are not the robot's pose, or ''."""
        missing = [name for name, k in self._index.items() if math.isnan(angles[k])]
        if len(missing) == len(self._index):
            return f'no joint states on {self.topic}'
        return f'{self.topic} has no angle of {missing[0]}' if missing else ''
