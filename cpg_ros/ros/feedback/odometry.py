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

from importlib import import_module, util

from cpg_ros.feedback.estimate import Odometry, RATE_ERROR, VELOCITY_ERROR
from cpg_ros.ros.node.message_block import each, indices, MessageBlock, Template
from geometry_msgs.msg import TransformStamped
from nav_msgs.msg import Odometry as OdometryMessage
import numpy as np
from rclpy.node import Node

# Messages of odometry: nav_msgs/Odometry and, where tf2_msgs is installed, the transform.

#: Period in which odometry and transform are published, s.
PERIOD = 0.02


def has_transforms() -> bool:
    """Return whether transforms can be published: PyPI has no tf2_msgs."""
    return util.find_spec('tf2_msgs') is not None


def odometry(topic: str, frames: tuple[str, str], *slots: np.ndarray) -> tuple[str, Template]:
    """Return topic and message; slots are indices of its numbers in the block.

    Args:
        topic: of the message.
        frames: of the pose, and of the twist and the child.
        slots: of position, orientation, twist and, if they change, both covariances.

    """
    message = OdometryMessage(child_frame_id=frames[1])
    message.header.frame_id = frames[0]
    pose, moving = message.pose.pose, message.twist.twist
    numbers = [*each(pose.position, 'xyz', slots[0]), *each(pose.orientation, 'wxyz', slots[1]),
               *each(moving.linear, 'xyz', slots[2][:3]),
               *each(moving.angular, 'xyz', slots[2][3:])]
    numbers += [(part, 'covariance', where) for part, where in zip(
        (message.pose, message.twist), slots[3:], strict=False)]
    return topic, Template(message, [message.header.stamp], numbers=numbers)


def transform(frames: tuple[str, str], position: np.ndarray, orientation: np.ndarray
              ) -> tuple[str, Template]:
    """Return the topic /tf and the message with the same pose."""
    message = TransformStamped(child_frame_id=frames[1])
    message.header.frame_id = frames[0]
    return '/tf', Template(
        import_module('tf2_msgs.msg').TFMessage(transforms=[message]), [message.header.stamp],
        numbers=[*each(message.transform.translation, 'xyz', position),
                 *each(message.transform.rotation, 'wxyz', orientation)])


def odometry_block(node: Node, source: Odometry, topic: str, frames: tuple[str, str],
                   transforms: bool, fraction: np.ndarray) -> MessageBlock:
    """Return the messages on where the base is, of 50 times a second.

    Args:
        node: that publishes.
        source: of the published odometry.
        topic: of the nav_msgs/Odometry.
        frames: the one in which the robot moves, and that of its base.
        transforms: whether to publish the transform between them, too.
        fraction: of all corrections, (1,), without which nothing is published.

    """
    sizes = 3, 4, 6, 36, 36
    parts = indices(sizes)
    messages = [odometry(topic, frames, *parts)]
    if transforms and has_transforms():
        messages.append(transform(frames, *parts[:2]))
    elif transforms:
        node.get_logger().warning(
            f'no transform from {frames[0]} to {frames[1]}: tf2_msgs is not installed '
            "('make messages' or ros-jazzy-tf2-msgs)")
    return MessageBlock(node, sizes, messages).feed(
        source.pose, source.orientation, source.twist, source.pose_covariance,
        np.diag(np.square([*VELOCITY_ERROR, RATE_ERROR, RATE_ERROR, RATE_ERROR])),
        period=PERIOD, while_not_0=fraction)
