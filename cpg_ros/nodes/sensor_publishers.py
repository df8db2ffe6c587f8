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

"""The measurements that a simulated robot publishes every period."""

from collections import deque
from collections.abc import Sequence

from cpg_ros.nodes.joint_publishers import joint_state, labelled
from cpg_ros.nodes.message_block import each, MessageBlock, places, Template
from cpg_ros.nodes.odometry_messages import has_transforms, odometry, PERIOD, transform
from cpg_ros.simulation.body import Body
from cpg_ros.simulation.inertial_unit import InertialUnit
from cpg_ros.simulation.robot_model import legs
import numpy as np
from rclpy.node import Node
from sensor_msgs.msg import Imu


class Measurements:
    """``joint_states``, ``odom``, ``foot_contacts``, ``imu`` and, where tf2 is, ``/tf``."""

    def __init__(self, node: Node, body: Body, unit: InertialUnit, frame: str,
                 delay: float = 0.0, force_noise: float = 0.0) -> None:
        """Publish the motion of a body, and the measurements of an inertial unit on it.

        Args:
            node: that publishes.
            body: that is measured.
            unit: on it.
            frame: of its base.
            delay: of the measurements of joints and feet, s.
            force_noise: standard deviation of the noise of the feet's, as a share of the force.

        """
        self._body, self._unit, self._holds = body, unit, bool(body.robot.held)
        self._delay, self._force_noise = round(1e9 * delay), force_noise
        self._late: deque[tuple[int, list[np.ndarray]]] = deque()
        self._rng = np.random.default_rng(unit.seed + 1)
        names, feet = body.robot.order, legs(body.robot)
        n = len(names)
        held = tuple(body.robot.held)
        sizes = n, n, n, len(feet), 3, 4, 6, *(3 * [len(held)] if held else [])
        *joints, forces, base, quaternion, twist = places(sizes[:7])
        if held:
            names = *names, *held
            joints = [np.concatenate(pair) for pair in zip(joints, places(sizes)[7:],
                                                           strict=True)]
        frames = 'odom', frame
        self._block = MessageBlock(node, sizes, [
            ('joint_states', joint_state(names, *joints)),
            odometry('odom', frames, base, quaternion, twist),
            ('foot_contacts', labelled(tuple(feet), forces))])
        self._transform, self._period = None, round(1e9 * PERIOD)
        self._transformed = -self._period
        if has_transforms():
            self._transform = MessageBlock(node, sizes[4:6], [transform(frames,
                                                                        *places(sizes[4:6]))])
        imu = Imu()
        imu.header.frame_id = frame
        self._imu = MessageBlock(node, [10], [('imu', Template(imu, [imu.header.stamp], numbers=[
            *each(imu.orientation, 'xyzw', np.arange(4)),
            *each(imu.angular_velocity, 'xyz', np.arange(4, 7)),
            *each(imu.linear_acceleration, 'xyz', np.arange(7, 10))]))])

    def publish(self, stamp: int) -> None:
        """Publish the state of the body; stamp in ns."""
        # What feedback needs comes first.
        arrived = self._unit.measure(stamp)
        if arrived is not None:
            self._imu.publish(arrived[0], arrived[1:])
        body = self._body
        feet = body.feet
        if self._force_noise:
            feet = feet * (1.0 + self._force_noise * self._rng.standard_normal(len(feet)))
        found = (body.position, body.velocity, body.torque, feet, body.base, body.quaternion,
                 body.twist, *(body.held if self._holds else ()))
        if not self._delay:
            self._send(stamp, found)
            return
        self._late.append((stamp, [part.copy() for part in found]))
        while self._late and self._late[0][0] <= stamp - self._delay:
            self._send(*self._late.popleft())

    def _send(self, stamp: int, found: Sequence[np.ndarray]) -> None:
        self._block.publish(stamp, found)
        age = stamp - self._transformed
        if self._transform is not None and not 0 <= age < self._period:
            self._transform.publish(stamp, found[4:6])
            self._transformed = stamp
