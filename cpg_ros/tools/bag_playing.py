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

"""Publishing the messages of a bag, as ``ros2 bag play`` does."""

from collections import Counter
from collections.abc import Sequence
from pathlib import Path
import time

from cpg_ros.files.progress_bar import progress_bar
from cpg_ros.nodes.message_types import message_class
from cpg_ros.recordings.bag_storage import opened
from cpg_ros.recordings.recording import RecordingError
import rclpy
from rclpy.node import Node
from rclpy.publisher import Publisher
from rclpy.qos import DurabilityPolicy, QoSProfile
from rosbags.interfaces import Connection, QosDurability

#: How long a player waits for listeners, s.
PATIENCE = 1.0


def play(node: Node, path: Path, wanted: Sequence[str] = (), rate: float = 1.0) -> Counter[str]:
    """Publish a bag's messages at the pace at which they were received.

    Args:
        node: publishes.
        path: of the bag.
        wanted: topics; all, if empty.
        rate: recorded seconds per second.

    Returns:
        Topic -> messages published.

    Raises:
        RecordingError: the bag cannot be read, or a topic is not in it.

    """
    counts: Counter[str] = Counter()
    with opened(path) as bag:
        there = {one.topic: one for one in bag.connections}
        chosen = [node.resolve_topic_name(one) for one in wanted] or list(there)
        for topic in chosen:
            if topic not in there:
                raise RecordingError(f'{path}: no topic {topic!r}; there are {", ".join(there)}')
        publishers = {topic: _publisher(node, there[topic]) for topic in chosen}
        _wait_for_listeners(node, list(publishers.values()))
        expected = bag.expected()
        with progress_bar(f'playing {path.name}', max(1, sum(expected[one] for one in chosen))
                          ) as bar:
            start, began = None, time.monotonic()
            for done, (topic, received, message) in enumerate(bag.messages(chosen)):
                start = received if start is None else start
                while (left := began + (received - start) * 1e-9 / rate - time.monotonic()) > 0.0:
                    rclpy.spin_once(node, timeout_sec=min(left, 0.05))
                publishers[topic].publish(message)
                counts[topic] += 1
                bar(done + 1)
    return counts


def _wait_for_listeners(node: Node, publishers: Sequence[Publisher]) -> None:
    """Wait briefly for subscribers, so that they receive the first messages."""
    end = time.monotonic() + PATIENCE
    while time.monotonic() < end and not all(one.get_subscription_count() for one in publishers):
        rclpy.spin_once(node, timeout_sec=0.02)


def _publisher(node: Node, connection: Connection) -> Publisher:
    offered = getattr(connection.ext, 'offered_qos_profiles', ())
    kept = any(one.durability == QosDurability.TRANSIENT_LOCAL for one in offered)
    return node.create_publisher(message_class(connection.msgtype), connection.topic, QoSProfile(
        depth=1 if kept else 100, durability=DurabilityPolicy.TRANSIENT_LOCAL if kept
        else DurabilityPolicy.VOLATILE))
