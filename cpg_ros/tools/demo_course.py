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

"""The demonstration's course: rough ground, a ramp and blocks, with pushes on the way."""

from collections.abc import Callable

from cpg_ros.tools.command_line import say
from geometry_msgs.msg import Twist, Wrench
from nav_msgs.msg import Odometry
import rclpy
from rclpy.node import Node

#: What robot_sim and the generator are told, beside what every demonstration tells them.
GROUND = ('-p', 'terrain:=course', '-p', 'terrain_size:=0.05')
GENERATOR = ('-p', 'cmd_vel:=true', '-p', 'feedback.enabled:=true')
#: Where what begins, m.
STAGES = ((0.6, 'rough ground'), (3.0, 'a ramp up'), (4.2, 'and down'), (5.5, 'blocks'))
#: Where the robot is pushed to the left, or to the right with a minus, N s.
PUSHES = ((1.5, 15.0), (2.4, -15.0), (6.2, 12.0))
#: Seconds that a push acts, the end of the course in m, the speed in m/s, most time in s.
PUSH, END, SPEED, LONGEST = 0.1, 7.5, 0.4, 60.0
#: A base whose vertical leans further than this has fallen: cosine.
FALLEN = 0.5


class Runner:
    """Takes the robot over the course."""

    def __init__(self, node: Node) -> None:
        self._node = node
        self._steer = node.create_publisher(Twist, 'cmd_vel', 10)
        self._push = node.create_publisher(Wrench, 'robot_sim/push', 10)
        node.create_subscription(Odometry, 'odom', self._odom, 1)
        self._wanted = Twist()
        self._wanted.linear.x = SPEED
        self._x = self._y = self._time = 0.0
        self._began: float | None = None
        self._up = 1.0

    def _odom(self, message: Odometry) -> None:
        pose = message.pose.pose
        self._x, self._y = pose.position.x, pose.position.y
        self._up = 1.0 - 2.0 * (pose.orientation.x**2 + pose.orientation.y**2)
        self._time = message.header.stamp.sec + 1e-9 * message.header.stamp.nanosec

    def _report(self, text: str) -> None:
        since = self._time - (self._began or 0.0)
        say(f'{since:5.1f} s  {text:<24} at x {self._x:5.2f} m, y {self._y:+5.2f} m')

    def run(self, look: Callable[[], None]) -> bool:
        """Walk the course; return whether the robot came to its end.

        Args:
            look: called again and again; what it raises ends the run.

        """
        stages, pushes = list(STAGES), list(PUSHES)
        while self._time == 0.0:
            rclpy.spin_once(self._node, timeout_sec=0.05)
            look()
        self._began = self._time
        self._report('flat ground')
        while self._time < self._began + LONGEST:
            rclpy.spin_once(self._node, timeout_sec=0.05)
            look()
            self._steer.publish(self._wanted)
            if self._up < FALLEN:
                self._report('the robot has fallen')
                return False
            if stages and self._x > stages[0][0]:
                self._report(stages.pop(0)[1])
            if pushes and self._x > pushes[0][0]:
                impulse = pushes.pop(0)[1]
                wrench = Wrench()
                wrench.force.y = impulse / PUSH
                self._push.publish(wrench)
                self._report(f'a push of {impulse:+.0f} N s')
            if self._x > END:
                self._report('the end of the course')
                return True
        self._report('time is up')
        return False
