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

"""A simulated robot and its generator on the graph, in lockstep as fast as they can."""

import math
import time
from typing import Any

from common import ROOT
from geometry_msgs.msg import Twist, Wrench
from nav_msgs.msg import Odometry
import numpy as np
from processes import GENERATOR, Process
from rcl_interfaces.srv import SetParameters
import rclpy
from rclpy.parameter import Parameter
from std_srvs.srv import Trigger

SIM = [str(ROOT / 'install/cpg_ros/lib/cpg_ros/robot_sim')]
RATE = 500.0
#: Longer than any compilation, s.
PATIENCE = 120.0


class Stage:
    """A simulated robot, its generator, and who drives it.

    Attributes:
        rows: time, s, speed forward and to the left, m/s, tilt, rad, height, m.

    """

    def __init__(self, robot: str, network: str, low: float, model: str = '',
                 **simulated: Any) -> None:
        """Start both; ``low`` is a height of the base at which it lies, m."""
        self._low = low
        self.body = Process(SIM, robot=robot, model=model or robot, real_time_factor=0.0,
                            **simulated)
        self.generator = Process(GENERATOR, robot=robot, network=network, rate=RATE,
                                 combined_topic="''", use_sim_time='true', cmd_vel='true',
                                 cmd_vel_timeout=60.0)
        self.node = rclpy.create_node('driver')
        self._walk = self.node.create_publisher(Twist, 'cmd_vel', 10)
        self._push = self.node.create_publisher(Wrench, 'robot_sim/push', 10)
        self._reset = self.node.create_client(Trigger, 'robot_sim/reset')
        self._set = self.node.create_client(SetParameters, 'cpg_generator/set_parameters')
        self.rows: list[tuple[float, ...]] = []
        self.node.create_subscription(Odometry, 'odom', self._odom, 2000)
        end = time.monotonic() + PATIENCE
        while not (self.rows and self._walk.get_subscription_count()):
            rclpy.spin_once(self.node, timeout_sec=0.1)
            if time.monotonic() > end:
                raise RuntimeError(self.body.output + self.generator.output)

    def _odom(self, message: Odometry) -> None:
        stamp, pose, twist = message.header.stamp, message.pose.pose, message.twist.twist
        turn = pose.orientation
        up = 1.0 - 2.0 * (turn.x**2 + turn.y**2)
        self.rows.append((stamp.sec + 1e-9 * stamp.nanosec, twist.linear.x, twist.linear.y,
                          math.acos(min(max(up, -1.0), 1.0)), pose.position.z))

    @property
    def upright(self) -> bool:
        return self.rows[-1][3] < 1.0 and self.rows[-1][4] > self._low

    def drive(self, speed: float) -> None:
        """Walk at a speed, in place at 0; stand with NaN."""
        message = Twist()
        # Exactly 0 would be a stand.
        message.linear.x = 0.0 if math.isnan(speed) else speed or 1e-4
        self._walk.publish(message)

    def push(self, forward: float, left: float) -> None:
        message = Wrench()
        message.force.x, message.force.y = forward, left
        self._push.publish(message)

    def switch(self, gait: str) -> None:
        self._set.call_async(SetParameters.Request(
            parameters=[Parameter('gait', value=gait).to_parameter_msg()]))

    def stand_up(self) -> None:
        self._reset.call_async(Trigger.Request())

    def spend(self, seconds: float) -> np.ndarray:
        """Let simulated time pass; return the rows of it."""
        first = len(self.rows)
        until = self.rows[-1][0] + seconds
        while self.rows[-1][0] < until:
            rclpy.spin_once(self.node, timeout_sec=0.1)
        return np.array(self.rows[first:])

    def cpu(self) -> np.ndarray:
        return np.array([self.generator.cpu_s(), self.body.cpu_s()])

    def end(self) -> None:
        self.node.destroy_node()
        self.generator.end()
        self.body.end()
