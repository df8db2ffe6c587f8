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

"""Recorder of topics into a bag, as bytes; the caller polls it regularly."""

from collections import Counter
from pathlib import Path

from cpg_ros.fitting.recordings.bag_writer import BagWriter
from cpg_ros.ros.node.message_block import message_class, message_fields, UnknownType
from cpg_ros.ros.node.polled import PolledSubscription
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
from rosbags.interfaces import Connection

#: POLL_PERIOD: period in which the caller takes the messages, s; QUEUE_DEPTH: most messages of a
#: topic that wait for the disk.
POLL_PERIOD, QUEUE_DEPTH = 0.02, 5000


class BagRecorder:
    """Writer of messages into a bag.

    Attributes:
        counts: topic -> number of messages written.
        passed_over: topic -> why it is not recorded.

    """

    def __init__(self, node: Node, path: Path) -> None:
        """Open the bag, a new folder, which gets its final name when it is complete.

        Raises:
            BagError: the name is taken, or the folder cannot be written to.

        """
        self._node, self._writer = node, BagWriter(path)
        self._sources: list[tuple[PolledSubscription, Connection]] = []
        self.counts: Counter[str] = Counter()
        self.passed_over: dict[str, str] = {}

    @property
    def size(self) -> int:
        """Size of the bag, bytes."""
        return self._writer.size

    def subscribe(self, topic: str, kind: str) -> bool:
        """Record a topic from now on; return whether its type is known here."""
        try:
            message = message_class(kind)
            connection = self._writer.connect(topic, kind, message_fields)
        except UnknownType as error:
            self.passed_over[topic] = str(error)
            return False
        # Request what every publisher offers: best-effort publishers match no reliable
        # subscription.
        offered = [publisher.qos_profile
                   for publisher in self._node.get_publishers_info_by_topic(topic)]
        latched = offered and all(publisher.durability == DurabilityPolicy.TRANSIENT_LOCAL
                                  for publisher in offered)
        reliable = all(publisher.reliability == ReliabilityPolicy.RELIABLE
                       for publisher in offered)
        quality = QoSProfile(
            depth=QUEUE_DEPTH,
            durability=DurabilityPolicy.TRANSIENT_LOCAL if latched else DurabilityPolicy.VOLATILE,
            reliability=ReliabilityPolicy.RELIABLE if reliable else ReliabilityPolicy.BEST_EFFORT)
        self._sources.append((PolledSubscription(self._node, message, topic, quality, raw=True,
                                                 overridable=False), connection))
        self.counts[topic] = 0
        return True

    def poll(self) -> None:
        """Write the messages that have arrived, in the order of arrival.

        Raises:
            BagError: a write failed, for example on a full disk.

        """
        arrived = [(when, connection, data) for source, connection in self._sources
                   for data, when in source.receive()]
        for when, connection, data in sorted(arrived, key=lambda arrival: arrival[0]):
            self._writer.write(connection, when, data)
            self.counts[connection.topic] += 1

    def close(self) -> None:
        """Complete and rename the bag; drop one without messages.

        Raises:
            BagError: a write failed, for example on a full disk.

        """
        for source, _ in self._sources:
            source.close()
        self._writer.close()
