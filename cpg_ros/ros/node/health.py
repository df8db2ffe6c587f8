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

"""A node's health on /diagnostics, and other publishers on topics that move the robot."""

from collections.abc import Callable, Mapping, Sequence
import time

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from rclpy.clock import Clock
from rclpy.clock_type import ClockType
from rclpy.node import Node
from rclpy.topic_endpoint_info import TopicEndpointInfo

# A node's health, once a second on /diagnostics, and the clock of such timers.

#: Clock of timers that must not stop with simulated time, nor jump with the system clock.
STEADY = Clock(clock_type=ClockType.STEADY_TIME)
#: START_STATUS: name of the status that reports the progress of a node's start.
START_STATUS = 'start'
#: Level, message and values of a status.
Health = tuple[bytes, str, Mapping[str, object]]


class HealthPublisher:
    """Publishes the status of a part of a node once a second."""

    def __init__(self, node: Node, part: str, hardware: str, status: Callable[[], Health]) -> None:
        """Start publishing.

        Args:
            node: that publishes.
            part: of the node, in the name of the status.
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


#: SEARCH_PERIOD: period in which other publishers are searched for, s.
SEARCH_PERIOD = 0.25
#: NAME_TIMEOUT: longest time from the discovery of a publisher to that of its node's name, s.
NAME_TIMEOUT = 1.0
#: UNKNOWN_NODE: text for a node whose name the graph does not know.
UNKNOWN_NODE = 'a node of unknown name'
#: Names that the graph gives to a node until it learns the name, and to any program without ROS.
PLACEHOLDERS = {'_NODE_NAME_UNKNOWN_': UNKNOWN_NODE,
                '_CREATED_BY_BARE_DDS_APP_': 'a program without ROS'}


def node_of(endpoint: TopicEndpointInfo) -> str:
    """Return the full name of an endpoint's node, or a text if it is unknown."""
    return PLACEHOLDERS.get(endpoint.node_name,
                            f'{endpoint.node_namespace.rstrip("/")}/{endpoint.node_name}')


def others_on(node: Node, topic: str, own: int = 1, tolerated: int = 0, companion: str = ''
              ) -> str:
    """Return the names of other nodes that publish on a topic, or ''.

    Args:
        node: the node itself.
        topic: resolved.
        own: number of the node's own publishers.
        tolerated: number of allowed others.
        companion: full name of a node that may publish, such as a watchdog, or ''.

    """
    if node.count_publishers(topic) <= own + tolerated:
        return ''
    names = [node_of(publisher) for publisher in node.get_publishers_info_by_topic(topic)]
    expected = [node.get_fully_qualified_name()] * own
    if companion:
        # On a busy machine, its name is known later than its publisher.
        expected.append(companion if companion in names else UNKNOWN_NODE)
    for name in expected:
        if name in names:
            names.remove(name)
    return ', '.join(sorted(names)) if len(names) > tolerated else ''


class OtherPublishers:
    """Warning as soon as another node publishes on one of a node's own topics.

    Attributes:
        text: who publishes where, or ''.

    """

    def __init__(self, node: Node, topics: Sequence[str], remedy: str = '') -> None:
        """Monitor topics, by resolved names, on each of which the node has one publisher.

        ``remedy`` ends the warning.
        """
        self._node, self._topics, self._remedy = node, topics, remedy
        self.text = self._warned = ''
        self._since = 0.0
        self._timer = node.create_timer(SEARCH_PERIOD, self.check, clock=STEADY)

    def seek(self, seconds: float) -> str:
        """Search until one is found, or for a time in s; return the text."""
        end = time.monotonic() + seconds
        while not self.check() and time.monotonic() < end:
            time.sleep(SEARCH_PERIOD / 5)
        while UNKNOWN_NODE in self.text and time.monotonic() < self._since + NAME_TIMEOUT:
            time.sleep(SEARCH_PERIOD / 5)
            self.check()
        return self.text

    def check(self) -> str:
        """Search now; return the text. The warning waits up to NAME_TIMEOUT for a name."""
        text = '; '.join(f'{topic} is published by {names}, too'
                         for topic in self._topics if (names := others_on(self._node, topic)))
        text += self._remedy * bool(text)
        if text != self.text:
            self.text, self._since = text, time.monotonic()
        if text != self._warned and (UNKNOWN_NODE not in text
                                     or time.monotonic() >= self._since + NAME_TIMEOUT):
            self._warned = text
            if text:
                self._node.get_logger().warning(text)
        return text
