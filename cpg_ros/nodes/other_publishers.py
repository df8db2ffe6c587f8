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
import time

from rclpy.clock import Clock
from rclpy.clock_type import ClockType
from rclpy.node import Node
from rclpy.topic_endpoint_info import TopicEndpointInfo

#: How often they are looked for, s.
LOOK = 0.25
#: What somebody publishes may be known this long before who it is, s.
NAMING = 1.0
#: The graph's name of a node that is not known, and ours.
UNKNOWN, NAMELESS = '_NODE_NAME_UNKNOWN_', 'a node of unknown name'


def node_of(endpoint: TopicEndpointInfo) -> str:
    """Return the full name of an endpoint's node, NAMELESS if it is not known."""
    return (NAMELESS if endpoint.node_name == UNKNOWN
            else f'{endpoint.node_namespace.rstrip("/")}/{endpoint.node_name}')


class OtherPublishers:
    """Warns as soon as another node publishes on one of a node's own topics.

    Attributes:
        text: who publishes where; '' for nobody.

    """

    def __init__(self, node: Node, topics: Sequence[str]) -> None:
        """Look after the topics, resolved names on each of which the node publishes once."""
        self._node, self._topics = node, topics
        self.text = self._warned = ''
        self._since = 0.0
        self._timer = node.create_timer(LOOK, self.look,
                                        clock=Clock(clock_type=ClockType.STEADY_TIME))

    def seek(self, seconds: float) -> str:
        """Look for them until one is found, or for some time in s; return the text."""
        end = time.monotonic() + seconds
        while not self.look() and time.monotonic() < end:
            time.sleep(LOOK / 5)
        while NAMELESS in self.text and time.monotonic() < self._since + NAMING:
            time.sleep(LOOK / 5)
            self.look()
        return self.text

    def look(self) -> str:
        """Look for them now; return the text. The warning waits a little for a name."""
        text = '; '.join(f'{topic} is published by {names}, too'
                         for topic in self._topics if (names := self._others(topic)))
        if text != self.text:
            self.text, self._since = text, time.monotonic()
        if text != self._warned and (NAMELESS not in text
                                     or time.monotonic() >= self._since + NAMING):
            self._warned = text
            if text:
                self._node.get_logger().warning(text)
        return text

    def _others(self, topic: str) -> str:
        """Return the names of the others that publish on a topic, or ''."""
        if self._node.count_publishers(topic) < 2:
            return ''
        own = self._node.get_fully_qualified_name()
        names = [node_of(one) for one in self._node.get_publishers_info_by_topic(topic)]
        if own in names:
            names.remove(own)
        return ', '.join(sorted(names))
