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

"""Walking as the topic cmd_vel asks: fast or slow, turning, and standing where nobody asks."""

from collections.abc import Callable
import math
import threading
from typing import Any

from cpg_ros.motion.pattern import Pattern
from cpg_ros.motion.plan import GaitPlan
from geometry_msgs.msg import Twist
from rclpy.clock import Clock
from rclpy.clock_type import ClockType
from rclpy.node import Node
from rclpy.qos import QoSProfile
from rclpy.qos_overriding_options import QoSOverridingOptions

#: How often it is seen whether the last command is too old, s.
LOOK = 0.02
#: Time between two warnings of a kind, s.
QUIET = 5.0
#: Fastest way to the side, m/s, which takes feedback.
ASIDE = 0.2


class CmdVel:
    """Steers a pattern by the newest command; other threads may change the gait meanwhile."""

    def __init__(self, node: Node, pattern: Pattern, program: GaitPlan, enabled: bool,
                 timeout: Callable[[], float], ramp: Callable[[], float],
                 closed: Callable[[], bool]) -> None:
        self._program, self._enabled = program, enabled
        self._deciding = threading.Lock()
        self._node, self._pattern, self._timeout, self._ramp = node, pattern, timeout, ramp
        self._closed = closed
        # Speeds forward and to the left, m/s, and yaw rate, rad/s.
        self._target, self._when, self._stale = (0.0, 0.0, 0.0), -math.inf, True
        self._up = False
        self._log = node.get_logger()
        node.create_subscription(
            Twist, 'cmd_vel', self._take, QoSProfile(depth=10),
            qos_overriding_options=QoSOverridingOptions.with_default_policies())
        # On the steady clock: a system clock that is set must not stop the robot, nor keep it
        # going.
        self._steady = Clock(clock_type=ClockType.STEADY_TIME)
        node.create_timer(LOOK, self._look, clock=self._steady)

    @property
    def walking(self) -> bool:
        """Tell whether a fresh command asks for motion."""
        return self._enabled and not self._stale and self._target != (0.0, 0.0, 0.0)

    @property
    def motion(self) -> tuple[float, float, float]:
        """Speeds forward and to the left, m/s, and yaw rate, rad/s, that are walked now."""
        if not self.walking:
            return 0.0, 0.0, 0.0
        speed, aside, turn = self._target
        slowest, fastest = self._program.speeds
        return min(max(speed, slowest), fastest), aside, turn

    @property
    def state(self) -> str:
        """What is asked for, for diagnostics."""
        if self._stale:
            return 'none'
        speed, aside, turn = self._target
        return f'{speed:.3g} m/s, {turn:.3g} rad/s' + (f', {aside:.3g} m/s to the left'
                                                       if aside else '')

    def _now(self) -> float:
        clock: Any = self._node.get_clock()
        return (clock if clock.ros_time_is_active else self._steady).now().nanoseconds * 1e-9

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
        """Steer this gait from now on."""
        with self._deciding:
            self._program = program
            self._act()

    def enable(self, enabled: bool) -> None:
        """Say whether the robot may walk at all."""
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
        """Leave the pattern alone from now on, as it is ramped down for the last time."""
        with self._deciding:
            self._enabled = self._up = False
