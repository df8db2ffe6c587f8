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

"""Other nodes that publish on the topics that move the robot."""

from collections.abc import Sequence

from rclpy.clock import Clock
from rclpy.clock_type import ClockType
from rclpy.node import Node

#: How often they are looked for, s.
LOOK = 0.25


class Rivals:
    """Warns as soon as another node publishes on one of a node's own topics.

    Attributes:
        text: who publishes where; '' for nobody.

    """

    def __init__(self, node: Node, topics: Sequence[str]) -> None:
        """Look after the topics, resolved names on each of which the node publishes once."""
        self._node, self._topics = node, topics
        self.text = ''
        self._timer = node.create_timer(LOOK, self.look,
                                        clock=Clock(clock_type=ClockType.STEADY_TIME))

    def look(self) -> str:
        """Look for them now; return the text."""
        own, found = self._node.get_fully_qualified_name(), {}
        for topic in self._topics:
            if self._node.count_publishers(topic) > 1:
                names = [f'{one.node_namespace.rstrip("/")}/{one.node_name}'
                         for one in self._node.get_publishers_info_by_topic(topic)]
                if own in names:
                    names.remove(own)
                found[topic] = ', '.join(sorted(names))
        text = '; '.join(f'{topic} is published by {names}, too'
                         for topic, names in found.items())
        if text and text != self.text:
            self._node.get_logger().warning(text)
        self.text = text
        return text
