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

"""What a node that starts waits for, on /diagnostics, where pages find it."""

import threading
import time

from cpg_ros.nodes.health_publisher import START
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from rclpy.node import Node

#: How often it says so, s.
EVERY = 1.0


class StartProgress:
    """A thread that publishes how long something has taken, until its end."""

    def __init__(self, node: Node, what: str, seconds: float) -> None:
        """Begin to publish.

        Args:
            node: that starts.
            what: it waits for.
            seconds: that this takes, about.

        """
        self._node, self._what, self._seconds, self._began = node, what, seconds, time.monotonic()
        self._publisher = node.create_publisher(DiagnosticArray, '/diagnostics', 10)
        self._ended = threading.Event()
        self._thread = threading.Thread(target=self._publish, name='progress', daemon=True)
        self._thread.start()

    def _publish(self) -> None:
        name = self._node.get_fully_qualified_name()
        while not self._ended.wait(EVERY):
            message = DiagnosticArray(status=[DiagnosticStatus(
                level=DiagnosticStatus.OK, name=f'{name}: {START}', message=f'{self._what}, '
                f'{self.passed:.0f} of about {self._seconds:.0f} s')])
            message.header.stamp = self._node.get_clock().now().to_msg()
            self._publisher.publish(message)

    @property
    def passed(self) -> float:
        """How long it has taken, s."""
        return time.monotonic() - self._began

    def end(self) -> None:
        """Publish no more."""
        self._ended.set()
        self._thread.join()
        self._node.destroy_publisher(self._publisher)
