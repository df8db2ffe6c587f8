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

"""The topics of a graph: what there is, the next message, how often one comes."""

from collections.abc import Iterator
import time
from typing import Any

from cpg_ros.nodes.message_types import message_class
from cpg_ros.tools.running_node import Unanswered
import rclpy
from rclpy.node import Node
from rclpy.qos import qos_profile_sensor_data

#: How long the graph is looked at before its topics are listed, s: discovery takes a moment.
LOOK = 1.0
#: How long messages are counted, s.
COUNT = 3.0


def topics(node: Node) -> dict[str, str]:
    """Return the topics that are published or listened to, and their types, sorted."""
    end = time.monotonic() + LOOK
    while time.monotonic() < end:
        rclpy.spin_once(node, timeout_sec=0.05)
    return {name: ' '.join(kinds) for name, kinds in sorted(node.get_topic_names_and_types())}


class Topic:
    """A topic, listened to."""

    def __init__(self, node: Node, name: str, wait: float) -> None:
        """Find a topic's type and listen.

        Args:
            node: ours.
            name: relative names are of the namespace /.
            wait: for a publisher and for the first message, s.

        Raises:
            Unanswered: nobody publishes on it.

        """
        self._node, self._name = node, name
        self._end = time.monotonic() + wait
        self._heard: list[Any] = []
        node.create_subscription(message_class(self._kind()), name, self._heard.append,
                                 qos_profile_sensor_data)

    def _kind(self) -> str:
        topic = self._node.resolve_topic_name(self._name)
        while time.monotonic() < self._end:
            rclpy.spin_once(self._node, timeout_sec=0.05)
            if found := dict(self._node.get_topic_names_and_types()).get(topic):
                return found[0]
        raise Unanswered(f'nobody publishes on {topic}')

    def messages(self) -> Iterator[Any]:
        """Yield messages as they come.

        Raises:
            Unanswered: none comes.

        """
        while not self._heard:
            if time.monotonic() > self._end:
                raise Unanswered(f'nothing came on {self._name}')
            rclpy.spin_once(self._node, timeout_sec=0.05)
        while True:
            while self._heard:
                yield self._heard.pop(0)
            rclpy.spin_once(self._node, timeout_sec=0.05)

    def rate(self) -> float:
        """Count messages for a while; return how many came a second (Hz)."""
        end = time.monotonic() + COUNT
        while time.monotonic() < end:
            rclpy.spin_once(self._node, timeout_sec=0.05)
        return len(self._heard) / COUNT


def shown(message: Any) -> str:
    """Return a message with a line for each of its fields."""
    return '\n'.join(f'{field}: {getattr(message, field)}'
                     for field in message.get_fields_and_field_types())
