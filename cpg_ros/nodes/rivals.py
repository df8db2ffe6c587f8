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

#: How often they are looked for, s.
LOOK = 0.25
#: What somebody publishes may be known this long before who it is, s.
NAMING = 1.0
#: What stands for the node of a publisher that is not known to belong to one.
UNKNOWN = '_NODE_NAME_UNKNOWN_'


class Rivals:
    """Warns as soon as another node publishes on one of a node's own topics.

    Attributes:
        text: who publishes where; '' for nobody.

    """

    def __init__(self, node: Node, topics: Sequence[str]) -> None:
        """Look after the topics, resolved names on each of which the node publishes once."""
        self._node, self._topics = node, topics
        self.text = ''
        self._nameless = 0.0
        self._timer = node.create_timer(LOOK, self.look,
                                        clock=Clock(clock_type=ClockType.STEADY_TIME))

    def seek(self, seconds: float) -> str:
        """Look for them until one is found, or for some time in s; return the text."""
        end = time.monotonic() + seconds
        while not self.look() and (self._nameless or time.monotonic() < end):
            time.sleep(LOOK / 5)
        return self.text

    def look(self) -> str:
        """Look for them now; return the text."""
        found, nameless = self._found()
        now = time.monotonic()
        if nameless and now - (self._nameless or now) < NAMING:
            self._nameless = self._nameless or now
            return self.text
        self._nameless = 0.0
        text = '; '.join(f'{topic} is published by {names}, too'
                         for topic, names in found.items())
        if text and text != self.text:
            self._node.get_logger().warning(text)
        self.text = text
        return text

    def _found(self) -> tuple[dict[str, str], bool]:
        """Return the names by topic, and whether one is not known."""
        own, found, nameless = self._node.get_fully_qualified_name(), {}, False
        for topic in self._topics:
            if self._node.count_publishers(topic) > 1:
                known = [one for one in self._node.get_publishers_info_by_topic(topic)
                         if one.node_name != UNKNOWN]
                names = [f'{one.node_namespace.rstrip("/")}/{one.node_name}' for one in known]
                if own in names:
                    names.remove(own)
                nameless |= not names
                found[topic] = ', '.join(sorted(names)) or 'one that is no ROS node'
        return found, nameless
