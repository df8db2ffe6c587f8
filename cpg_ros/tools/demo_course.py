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
from cpg_ros.tools.demo_operator import Operator
from geometry_msgs.msg import Twist, Wrench
import rclpy
from rclpy.publisher import Publisher

#: Arguments of robot_sim and of the generator, beside those of every demonstration.
GROUND = ('-p', 'terrain:=course', '-p', 'terrain_size:=0.05')
GENERATOR = ('-p', 'cmd_vel:=true', '-p', 'feedback.enabled:=true')
#: Where each stage begins, m.
STAGES = ((0.6, 'rough ground'), (3.0, 'a ramp up'), (4.2, 'and down'), (5.5, 'blocks'))
#: Where the robot is pushed to the left, or to the right with a minus, N s.
PUSHES = ((1.5, 15.0), (2.4, -15.0), (6.2, 12.0))
#: Duration of a push in s, end of the course in m, speed in m/s, longest run in s.
PUSH, END, SPEED, LONGEST = 0.1, 7.5, 0.4, 60.0
#: A robot has fallen if its base leans further than the angle of this cosine.
FALLEN = 0.5


def run(robot: Operator, look: Callable[[], None]) -> bool:
    """Walk the course, then leave the robot to others; return whether it reached the end.

    Args:
        robot: the node that follows it.
        look: called again and again; what it raises ends the run.

    """
    steer = robot.create_publisher(Twist, 'cmd_vel', 10)
    try:
        return _walk(robot, look, steer)
    finally:
        robot.destroy_publisher(steer)


def _walk(robot: Operator, look: Callable[[], None], steer: Publisher) -> bool:
    push = robot.create_publisher(Wrench, 'robot_sim/push', 10)
    forward = Twist()
    forward.linear.x = SPEED
    stages, pushes, began = list(STAGES), list(PUSHES), robot.time

    def report(text: str) -> None:
        x, y = robot.place
        say(f'{robot.time - began:5.1f} s  {text:<24} at x {x:5.2f} m, y {y:+5.2f} m')

    report('flat ground')
    while robot.time < began + LONGEST:
        rclpy.spin_once(robot, timeout_sec=0.05)
        look()
        steer.publish(forward)
        x, _ = robot.place
        if robot.upright < FALLEN:
            report('the robot has fallen')
            return False
        if stages and x > stages[0][0]:
            report(stages.pop(0)[1])
        if pushes and x > pushes[0][0]:
            impulse = pushes.pop(0)[1]
            wrench = Wrench()
            wrench.force.y = impulse / PUSH
            push.publish(wrench)
            report(f'a push of {impulse:+.0f} N s')
        if x > END:
            report('the end of the course')
            return True
    report('time is up')
    return False
