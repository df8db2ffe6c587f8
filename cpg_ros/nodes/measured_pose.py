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
    """The newest joint states of a topic, read on demand."""

    def __init__(self, node: Node, robot: Robot, topic: str) -> None:
        self._names = [joint.name for joint in robot.joints]
        # Several publishers may share the topic.
        self._subscription = PolledSubscription(node, JointState, topic, best_effort(50))

    def take(self) -> np.ndarray | None:
        """Return the angle of each joint, rad, leg by leg; None where nothing is published.

        Raises:
            ValueError: what is published does not have all joints.

        """
        found: dict[str, float] = {}
        for message, arrived in self._subscription.take():
            if time.time_ns() - arrived < FRESH * 1e9:
                found.update(zip(message.name, message.position, strict=False))
        missing = [name for name in self._names if not math.isfinite(found.get(name, math.nan))]
        if found and missing:
            raise ValueError(f'{self._subscription.topic} has no angle of {missing[0]}')
        return np.array([found[name] for name in self._names]) if found else None
