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

"""What generators that are still starting wait for, from /diagnostics."""

import time

from cpg_ros.nodes.health_publisher import START
from cpg_ros.nodes.polled_group import PolledSubscription
from cpg_ros.nodes.qos_profiles import best_effort
from diagnostic_msgs.msg import DiagnosticArray
from rclpy.node import Node

#: How long after the last status a node counts as starting, s.
FRESH = 4.0


class StartWatch:
    """Follows starts, while it is on: it need not be, once there is a generator."""

    def __init__(self, watch: Node) -> None:
        """Follow nothing yet; ``watch`` subscribes, and is not spun."""
        self._watch = watch
        self._topic: PolledSubscription | None = None
        self._text, self._when = '', 0.0

    def look(self, on: bool) -> str:
        """Return what the node that starts waits for, '' if it is not known."""
        if not on:
            self.close()
            return ''
        if self._topic is None:
            self._topic = PolledSubscription(self._watch, DiagnosticArray, '/diagnostics',
                                             best_effort(20), overridable=False)
        for message, _ in self._topic.take():
            for status in message.status:
                node, _, part = status.name.partition(': ')
                if part == START:
                    self._text = f'{node} is starting: {status.message}'
                    self._when = time.monotonic()
        return self._text if time.monotonic() < self._when + FRESH else ''

    def close(self) -> None:
        """End the subscription."""
        if self._topic is not None:
            self._topic.close()
            self._topic = None
