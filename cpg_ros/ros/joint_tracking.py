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

"""Monitor of whether the measured joints follow the generator's commands."""

from collections.abc import Callable
from typing import Any, NamedTuple

from cpg_ros.motion.robot import Robot
from cpg_ros.ros.bridges.supervisor import TrackingMonitor
from cpg_ros.ros.generator_io import MeasuredPose
from cpg_ros.ros.node.health import STEADY
import numpy as np
from rclpy.node import Node

#: PERIOD: interval at which commanded and measured angles are compared, s; MAX_AGE: largest age of
#: the measured angles, s.
PERIOD, MAX_AGE = 0.1, 0.2
#: RECOVERY_TIME: time without a fault, s, after which the joints count as following again.
RECOVERY_TIME = 3.0


class TrackingLimits(NamedTuple):
    """Robot settings for a TrackingMonitor: names, rad and s."""

    names: tuple[str, ...]
    tracking_error: float
    tracking_time: float


class JointTracking:
    """Comparison of commanded and measured angles in the executor, outside the ticks.

    Attributes:
        text: joint that does not follow, and its distance; '' while all follow.

    """

    def __init__(self, node: Node, robot: Robot, measured: MeasuredPose,
                 commanded: Callable[[], np.ndarray | None], news: Callable[[str], None]) -> None:
        """Compare by the node's tracking_error and tracking_time.

        ``commanded`` returns the last commanded angles, rad, leg by leg, or None; ``news``
        receives each new text.
        """
        limits: Any = TrackingLimits(
            tuple(joint.name for joint in robot.joints),
            *(node.get_parameter(name).value for name in ('tracking_error', 'tracking_time')))
        self._monitor = TrackingMonitor(limits)
        self._measured, self._commanded, self._news = measured, commanded, news
        self._well, self.text = 0.0, ''
        self._clock, self._then = node.get_clock(), 0
        self._timer = node.create_timer(PERIOD, self._compare, clock=STEADY)

    def _compare(self) -> None:
        # Slow simulated time counts as it passes: a moment of a stride is no mean.
        now = self._clock.now().nanoseconds
        dt, self._then = min(max(1e-9 * (now - self._then), 0.0), PERIOD), now
        commanded = self._commanded()
        if commanded is None:
            self._monitor.reset()
            reason = ''
        else:
            angles = self._measured.receive(MAX_AGE)
            # A joint that is not measured says nothing.
            reason = self._monitor.update(
                commanded, np.where(np.isnan(angles), commanded, angles), dt)
        self._well = 0.0 if reason else self._well + dt
        if reason and not self.text:
            self.text = reason
            self._news(reason)
        elif self.text and self._well >= RECOVERY_TIME:
            self.text = ''
            self._news('')
