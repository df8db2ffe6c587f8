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

"""Walking by the topic cmd_vel: speed, turning, and standing without a command."""

from collections.abc import Callable
import math
import threading
from typing import Any

from cpg_ros.motion.pattern import Pattern
from cpg_ros.motion.plan import GaitPlan
from cpg_ros.nodes.health_publisher import STEADY
from cpg_ros.nodes.other_publishers import node_of
from cpg_ros.nodes.qos_profiles import OVERRIDABLE
from geometry_msgs.msg import Twist, TwistStamped
from rclpy.node import Node
from rclpy.qos import QoSProfile

#: How often the age of the last command is checked, s.
LOOK = 0.02
#: Time between two warnings of a kind, s.
QUIET = 5.0
#: Frames that are the robot's base by name, beside the parameter ``feedback.base_frame``; '' is
#: that of a publisher without frames.
BASES = '', 'base', 'base_link', 'base_footprint'
#: Largest speed to the side, m/s, which needs feedback.
ASIDE = 0.2


class CmdVel:
    """Steers a pattern by the newest command; other threads may change the gait meanwhile."""

    def __init__(self, node: Node, pattern: Pattern, program: GaitPlan, enabled: bool,
                 timeout: Callable[[], float], ramp: Callable[[], float],
                 closed: Callable[[], bool]) -> None:
        """Follow the commands on ``cmd_vel``.

        Args:
            node: that subscribes; its parameter ``stamped_cmd_vel`` says which type.
            pattern: to be steered.
            program: gait that it walks.
            enabled: whether the robot may walk.
            timeout: returns how long a command counts, s.
            ramp: returns the duration of the ramp between stand and gait, s.
            closed: returns whether feedback is active.

        """
        self._program, self._enabled = program, enabled
        self._deciding = threading.Lock()
        self._node, self._pattern, self._timeout, self._ramp = node, pattern, timeout, ramp
        self._closed = closed
        # Speeds forward and to the left, m/s, and yaw rate, rad/s.
        self._target, self._when, self._stale = (0.0, 0.0, 0.0), -math.inf, True
        self._up = False
        self._log = node.get_logger()
        self._stamped = node.get_parameter('stamped_cmd_vel').value
        # What is published under another type: it does not arrive.
        self._misfit = ''
        node.create_subscription(
            TwistStamped if self._stamped else Twist, 'cmd_vel',
            self._take_stamped if self._stamped else self._take, QoSProfile(depth=10),
            qos_overriding_options=OVERRIDABLE)
        # A system clock that is set must not stop the robot, nor keep it going.
        node.create_timer(LOOK, self._look, clock=STEADY)

    @property
    def walking(self) -> bool:
        """Whether a fresh command demands motion."""
        return self._enabled and not self._stale and self._target != (0.0, 0.0, 0.0)

    @property
    def motion(self) -> tuple[float, float, float]:
        """The current speeds forward and to the left, m/s, and yaw rate, rad/s."""
        if not self.walking:
            return 0.0, 0.0, 0.0
        speed, aside, turn = self._target
        slowest, fastest = self._program.speeds
        return min(max(speed, slowest), fastest), aside, turn

    @property
    def state(self) -> str:
        """The command as text, for diagnostics."""
        if self._stale:
            return 'none'
        speed, aside, turn = self._target
        return f'{speed:.3g} m/s, {turn:.3g} rad/s' + (f', {aside:.3g} m/s to the left'
                                                       if aside else '')

    def _now(self) -> float:
        clock: Any = self._node.get_clock()
        return (clock if clock.ros_time_is_active else STEADY).now().nanoseconds * 1e-9

    def look_for_misfits(self) -> str:
        """Return who publishes commands of the other type, which do not arrive; log news."""
        own, other = ('geometry_msgs/msg/TwistStamped', 'geometry_msgs/msg/Twist')[
            ::1 if self._stamped else -1]
        names = sorted({node_of(one) for one in self._node.get_publishers_info_by_topic(
            self._node.resolve_topic_name('cmd_vel')) if one.topic_type == other})
        text = '' if not names else (
            f'cmd_vel is published as {other} by {", ".join(names)}, but this generator takes '
            f'{own}: set stamped_cmd_vel to {str(not self._stamped).lower()}')
        if text and text != self._misfit:
            self._log.warning(text)
        self._misfit = text
        return text

    def _take_stamped(self, message: TwistStamped) -> None:
        """Take a command in the base's frame and of this time; a stamp of 0 is none."""
        stamp, frame = message.header.stamp, message.header.frame_id
        base = self._node.get_parameter('feedback.base_frame').value
        if frame not in (*BASES, base):
            self._log.warning(f"cmd_vel ignored: it is in the frame '{frame}', not in the base's "
                              f"'{base}' (feedback.base_frame)", once=True)
            return
        age = self._node.get_clock().now().nanoseconds * 1e-9 - stamp.sec - 1e-9 * stamp.nanosec
        if (stamp.sec or stamp.nanosec) and abs(age) > self._timeout():
            side = 'old' if age > 0.0 else 'ahead'
            self._log.warning(f'cmd_vel ignored: its stamp is {abs(age):.3g} s {side}; the clocks '
                              'of sender and generator must agree', throttle_duration_sec=QUIET)
            return
        self._take(message.twist)

    def _take(self, message: Twist) -> None:
        speed, turn, aside = message.linear.x, message.angular.z, message.linear.y
        if not all(math.isfinite(value) for value in (speed, turn, aside)):
            self._log.warning(f'cmd_vel ignored: {speed} m/s forward, {aside} m/s to the left, '
                              f'{turn} rad/s are not all finite',
                              throttle_duration_sec=QUIET)
            return
        if aside and not self._closed():
            self._log.warning(f'cmd_vel asks for {aside:g} m/s to the left: without feedback this '
                              'robot walks forward, backward and in curves only',
                              throttle_duration_sec=QUIET)
            aside = 0.0
        elif abs(aside) > ASIDE:
            self._log.warning(f'cmd_vel asks for {aside:g} m/s to the left: the range is '
                              f'{-ASIDE:g} to {ASIDE:g} m/s', throttle_duration_sec=QUIET)
            aside = math.copysign(ASIDE, aside)
        with self._deciding:
            self._target, self._when, self._stale = (speed, aside, turn), self._now(), False
            self._act()

    def _look(self) -> None:
        age = self._now() - self._when
        stale = not 0.0 <= age <= self._timeout()
        if stale == self._stale:
            return
        if stale and self.walking:
            self._log.warning(f'no cmd_vel for {age:.2g} s: stopping')
        with self._deciding:
            self._stale = stale
            self._act()

    def follow(self, program: GaitPlan) -> None:
        """Steer a new gait."""
        with self._deciding:
            self._program = program
            self._act()

    def enable(self, enabled: bool) -> None:
        """Set whether the robot may walk at all."""
        with self._deciding:
            self._enabled = enabled
            self._act()

    def _act(self) -> None:
        walking = self.walking
        if walking:
            speed, _, turn = self._target
            slowest, fastest = self._program.speeds
            if not slowest <= speed <= fastest:
                self._log.warning(f"cmd_vel asks for {speed:g} m/s: the {self._program.name}'s "
                                  f'range is {slowest:g} to {fastest:g} m/s',
                                  throttle_duration_sec=QUIET)
            self._pattern.steer(*self._program.steer(speed, turn))
        if walking != self._up:
            self._up = walking
            self._pattern.enable(walking, self._ramp())

    def end(self) -> None:
        """Leave the pattern alone: it is being ramped down for the last time."""
        with self._deciding:
            self._enabled = self._up = False
