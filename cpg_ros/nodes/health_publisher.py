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

"""A node's health, once a second on /diagnostics, and the clock of such timers."""

from collections.abc import Callable, Mapping

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from rclpy.clock import Clock
from rclpy.clock_type import ClockType
from rclpy.node import Node

#: For timers that must not stop with simulated time, nor follow a system clock that is set.
STEADY = Clock(clock_type=ClockType.STEADY_TIME)
#: The part of a node whose status says what its start waits for.
START = 'start'
#: Level, message and values of a status.
Health = tuple[bytes, str, Mapping[str, object]]


class HealthPublisher:
    """Publishes the status of a part of a node once a second."""

    def __init__(self, node: Node, part: str, hardware: str, status: Callable[[], Health]) -> None:
        """Start publishing.

        Args:
            node: that publishes.
            part: of the node, for the name of the status.
            hardware: name of the robot.
            status: called for each message.

        """
        self._node, self._status = node, status
        self._name, self._hardware = f'{node.get_fully_qualified_name()}: {part}', hardware
        self._publisher = node.create_publisher(DiagnosticArray, '/diagnostics', 10)
        self._timer = node.create_timer(1.0, self._publish, clock=STEADY)

    def _publish(self) -> None:
        level, text, values = self._status()
        message = DiagnosticArray(status=[DiagnosticStatus(
            level=level, name=self._name, message=text, hardware_id=self._hardware,
            values=[KeyValue(key=key, value=str(value)) for key, value in values.items()])])
        message.header.stamp = self._node.get_clock().now().to_msg()
        self._publisher.publish(message)
