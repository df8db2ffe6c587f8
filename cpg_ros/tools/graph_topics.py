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

"""The topics of a graph: their list, messages and rates."""

from array import array
from collections.abc import Callable, Iterator
import time
from typing import Any

from cpg_ros.errors import CpgError
from cpg_ros.nodes.message_types import message_class
from cpg_ros.nodes.node_client import SILENCE
from cpg_ros.nodes.polled_group import PolledSubscription
from cpg_ros.nodes.qos_profiles import best_effort
import numpy as np
from rclpy.node import Node
import yaml

#: How long the graph is looked at before its topics are listed, s: discovery takes a moment.
LOOK = 1.0
#: How long messages are counted, s, how often they are taken, s, and how many may wait until then.
COUNT, EVERY, DEPTH = 3.0, 0.02, 1000


class SilentTopic(CpgError):
    """A topic has no publisher, or no message arrived."""

    exit_code = 1


def topics(node: Node) -> dict[str, str]:
    """Return the topics that have publishers or subscribers, and their types, sorted."""
    time.sleep(LOOK)
    return {name: ' '.join(kinds) for name, kinds in sorted(node.get_topic_names_and_types())}


class Topic:
    """A topic, subscribed to."""

    def __init__(self, node: Node, name: str, wait: float,
                 late: Callable[[str], None] = lambda name: None) -> None:
        """Find a topic's type and subscribe.

        Args:
            node: subscribes.
            name: relative names are of the namespace /.
            wait: for a publisher and for the first message, s.
            late: called once with the topic's name if neither has come within ``SILENCE``.

        Raises:
            SilentTopic: it has no publisher.

        """
        began = time.monotonic()
        self._end, self._silence = began + wait, began + SILENCE
        self._late = late
        self._name = topic = node.resolve_topic_name(name)
        while not (kinds := dict(node.get_topic_names_and_types()).get(topic)):
            if time.monotonic() > self._end:
                raise SilentTopic(f'nobody publishes on {topic}')
            self._pause()
        self._subscription = PolledSubscription(node, message_class(kinds[0]), name,
                                                best_effort(DEPTH), overridable=False)

    def messages(self) -> Iterator[Any]:
        """Yield messages as they arrive.

        Raises:
            SilentTopic: none arrives.

        """
        silent = True
        while True:
            for message, _ in self._subscription.take():
                silent = False
                yield message
            if silent and time.monotonic() > self._end:
                raise SilentTopic(f'nothing came on {self._name}')
            if silent:
                self._pause()
            else:
                time.sleep(EVERY)

    def _pause(self) -> None:
        if time.monotonic() > self._silence:
            self._late(self._name)
            self._silence = np.inf
        time.sleep(EVERY)

    def rate(self) -> float:
        """Count messages for a while; return their rate, Hz."""
        count, end = 0, time.monotonic() + COUNT
        while time.monotonic() < end:
            time.sleep(EVERY)
            count += sum(1 for _ in self._subscription.take())
        return count / COUNT


def shown(message: Any) -> str:
    """Return a message as YAML, as ``ros2 topic echo`` prints it, with a line break at its end."""
    dumper = getattr(yaml, 'CSafeDumper', yaml.SafeDumper)
    return str(yaml.dump(_plain(message), Dumper=dumper, sort_keys=False, allow_unicode=True,
                         default_flow_style=False, width=2**31 - 1))


def _plain(value: Any) -> Any:
    """Return a message or a field of one as YAML has it."""
    if hasattr(value, 'get_fields_and_field_types'):
        return {field: _plain(getattr(value, field))
                for field in value.get_fields_and_field_types()}
    if isinstance(value, (np.ndarray, array)):
        return value.tolist()
    if isinstance(value, bytes):  # one octet; those of a list are integers, too
        return value[0]
    return [_plain(one) for one in value] if isinstance(value, (list, tuple)) else value
