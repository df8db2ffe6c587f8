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

"""What is published on a graph, recorded into a bag as ``ros2 bag record`` does it."""

from collections import Counter
from collections.abc import Sequence
from functools import partial
from pathlib import Path

from cpg_ros.nodes.message_types import message_class, message_fields, UnknownType
from cpg_ros.recordings.bag_writer import BagWriter
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
from rosbags.interfaces import Connection

#: Messages that may wait for the disk.
DEPTH = 5000
#: Topics that come with every node and that nobody asked for.
USUAL = ('/rosout', '/parameter_events')


class Recorder:
    """Writes what is published into a bag, raw.

    Attributes:
        counts: topic -> messages written.
        passed_over: topic -> why it is not recorded.

    """

    def __init__(self, node: Node, path: Path, wanted: Sequence[str]) -> None:
        """Open the bag; it has its name only when it is whole.

        Args:
            node: ours.
            path: of the bag, a folder that is not there yet.
            wanted: topics; all that there are and that appear, if empty.

        Raises:
            BagError: something is there already, or the folder cannot be written to.

        """
        self._node = node
        self._wanted = [node.resolve_topic_name(one) for one in wanted]
        self.counts: Counter[str] = Counter()
        self.passed_over: dict[str, str] = {}
        self._writer = BagWriter(path)

    def look(self) -> list[str]:
        """Listen to what is new on the graph; return the topics."""
        new = []
        for topic, kinds in self._node.get_topic_names_and_types():
            if topic in self.counts or topic in self.passed_over or (
                    topic not in self._wanted if self._wanted else topic in USUAL):
                continue
            offered = self._node.get_publishers_info_by_topic(topic)
            if not offered:
                continue
            try:
                self._listen(topic, kinds[0], [one.qos_profile for one in offered])
            except UnknownType as error:
                self.passed_over[topic] = str(error)
                continue
            new.append(topic)
        return new

    def _listen(self, topic: str, kind: str, offered: Sequence[QoSProfile]) -> None:
        message = message_class(kind)
        connection = self._writer.connect(topic, kind, message_fields)
        self.counts[topic] = 0
        # What every publisher offers: a reliable listener hears no best-effort one.
        kept = all(one.durability == DurabilityPolicy.TRANSIENT_LOCAL for one in offered)
        sure = all(one.reliability == ReliabilityPolicy.RELIABLE for one in offered)
        profile = QoSProfile(
            depth=DEPTH,
            durability=DurabilityPolicy.TRANSIENT_LOCAL if kept else DurabilityPolicy.VOLATILE,
            reliability=ReliabilityPolicy.RELIABLE if sure else ReliabilityPolicy.BEST_EFFORT)
        self._node.create_subscription(message, topic, partial(self._write, topic, connection),
                                       profile, raw=True)

    def _write(self, topic: str, connection: Connection, message: bytes) -> None:
        self._writer.write(connection, self._node.get_clock().now().nanoseconds, message)
        self.counts[topic] += 1

    def close(self) -> None:
        """Finish the bag, and give it its name.

        Raises:
            BagError: the disk is full, or the like.

        """
        self._writer.close()
