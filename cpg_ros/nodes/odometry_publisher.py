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

"""Publishes the leg odometry of a generator's feedback, and its transform."""

from cpg_ros.feedback.odometry import INSTANT, Odometry, RATE
from cpg_ros.nodes.message_block import MessageBlock, places
from cpg_ros.nodes.odometry_messages import (
    COVARIANCE,
    has_transforms,
    odometry,
    ORIENTATION,
    PERIOD,
    POSE,
    transform,
    TWIST,
)
import numpy as np
from rclpy.node import Node


class OdometryPublisher:
    """Publishes where the base is, 50 times a second."""

    def __init__(self, node: Node, source: Odometry, topic: str, frames: tuple[str, str],
                 transforms: bool) -> None:
        """Prepare.

        Args:
            node: that publishes.
            source: of what is published.
            topic: of the nav_msgs/Odometry.
            frames: the one in which the robot moves, and that of its base.
            transforms: whether to publish the transform between them, too.

        """
        sizes = POSE, ORIENTATION, TWIST, COVARIANCE, COVARIANCE
        parts = places(sizes)
        messages = [odometry(topic, frames, *parts)]
        if transforms and has_transforms():
            messages.append(transform(frames, *parts[:2]))
        elif transforms:
            node.get_logger().warning(
                f'no transform from {frames[0]} to {frames[1]}: tf2_msgs is not installed '
                "('make messages' or ros-jazzy-tf2-msgs)")
        self._source, self._elapsed = source, 0.0
        self._block = MessageBlock(node, sizes, messages)
        self._pose = np.zeros((6, 6))
        self._values = [np.zeros(size) for size in sizes]
        self._values[4][::7] = np.square([*INSTANT, RATE, RATE, RATE])

    def publish(self, dt: float, stamp: int) -> None:
        """Publish if it is time; dt since the last call in s, stamp in ns."""
        self._elapsed += dt
        # A hair less: ticks are not exact.
        if self._elapsed < 0.99 * PERIOD:
            return
        self._elapsed = 0.0
        position, orientation, twist, pose, _ = self._values
        source = self._source
        position[:] = source.pose[:3]
        source.orientation(orientation)
        twist[:] = source.twist
        pose[:] = source.pose_covariance(self._pose).ravel()
        self._block.publish(stamp, self._values)
