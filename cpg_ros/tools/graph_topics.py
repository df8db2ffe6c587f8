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

from cpg_ros.errors import CpgError
from cpg_ros.nodes.message_types import message_class
from cpg_ros.nodes.polled_group import PolledSubscription
from cpg_ros.nodes.qos_profiles import best_effort
from rclpy.node import Node

#: How long the graph is looked at before its topics are listed, s: discovery takes a moment.
LOOK = 1.0
#: How long messages are counted, s, how often they are taken, s, and how many may wait until then.
COUNT, EVERY, DEPTH = 3.0, 0.02, 1000


class SilentTopic(CpgError):
    """Nobody publishes on a topic, or nothing came."""

    exit_code = 1


def topics(node: Node) -> dict[str, str]:
    """Return the topics that are published or listened to, and their types, sorted."""
    time.sleep(LOOK)
    return {name: ' '.join(kinds) for name, kinds in sorted(node.get_topic_names_and_types())}


class Topic:
    """A topic, subscribed to."""

    def __init__(self, node: Node, name: str, wait: float) -> None:
        """Find a topic's type and subscribe.

        Args:
            node: ours.
            name: relative names are of the namespace /.
            wait: for a publisher and for the first message, s.

        Raises:
            SilentTopic: nobody publishes on it.

        """
        self._name, self._end = name, time.monotonic() + wait
        topic = node.resolve_topic_name(name)
        while not (kinds := dict(node.get_topic_names_and_types()).get(topic)):
            if time.monotonic() > self._end:
                raise SilentTopic(f'nobody publishes on {topic}')
            time.sleep(EVERY)
        self._subscription = PolledSubscription(node, message_class(kinds[0]), name,
                                                best_effort(DEPTH), overridable=False)

    def messages(self) -> Iterator[Any]:
        """Yield messages as they come.

        Raises:
            SilentTopic: none comes.

        """
        silent = True
        while True:
            for message, _ in self._subscription.take():
                silent = False
                yield message
            if silent and time.monotonic() > self._end:
                raise SilentTopic(f'nothing came on {self._name}')
            time.sleep(EVERY)

    def rate(self) -> float:
        """Count messages for a while; return how many came a second (Hz)."""
        count, end = 0, time.monotonic() + COUNT
        while time.monotonic() < end:
            time.sleep(EVERY)
            count += sum(1 for _ in self._subscription.take())
        return count / COUNT


def shown(message: Any) -> str:
    """Return a message with a line for each of its fields."""
    return '\n'.join(f'{field}: {getattr(message, field)}'
                     for field in message.get_fields_and_field_types())
