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

"""Bags through ROS's own ``rosbag2_py``, if the library `rosbags` is not installed.

It has the interface of `rosbags_library`.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from cpg_ros.common.errors import needed
from rclpy.serialization import deserialize_message
import rosbag2_py
from sensor_msgs.msg import JointState

STORAGE_IDS = {'.mcap': 'mcap', '.db3': 'sqlite3'}


class ReaderError(Exception):
    """The bag cannot be read."""


class SerdeError(Exception):
    """The bytes are no message."""


@dataclass(frozen=True)
class Connection:
    """A topic of a bag, its type and how many messages it has."""

    topic: str
    msgtype: str
    msgcount: int


def unpack_file(path: Path, into: Path) -> None:
    """Refuse a compressed storage file: ROS reads it only with its folder."""
    needed('rosbags')


def deserialize(message: bytes) -> Any:
    """Return a JointState out of its bytes.

    Raises:
        SerdeError: the bytes are not such a message.

    """
    try:
        return deserialize_message(message, JointState)
    except Exception as error:  # what the middleware raises has no common kind
        raise SerdeError(str(error)) from error


class Reader:
    """A bag: its folder, or one of its storage files.

    Attributes:
        path: of the bag.
        connections: its topics.

    """

    def __init__(self, path: Path) -> None:
        self.path = Path(path)
        self.connections: list[Connection] = []
        self._storage = rosbag2_py.StorageOptions(
            uri=str(path), storage_id=STORAGE_IDS.get(self.path.suffix, ''))
        self._kind = rosbag2_py.SequentialReader

    def __enter__(self) -> 'Reader':
        self.open()
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def open(self) -> None:  # noqa: A003
        """Read the list of topics.

        Raises:
            ReaderError: the bag is damaged.

        """
        try:
            if (self.path / 'metadata.yaml').exists():
                metadata = rosbag2_py.Info().read_metadata(str(self.path), '')
                if metadata.compression_mode.lower() not in ('', 'none'):
                    self._kind = rosbag2_py.SequentialCompressionReader
            topics = self._opened().get_metadata().topics_with_message_count
        except RuntimeError as error:
            raise ReaderError(str(error)) from error
        self.connections = [Connection(topic.topic_metadata.name, topic.topic_metadata.type,
                                       topic.message_count) for topic in topics]

    def close(self) -> None:
        """Every pass over the messages opens the bag anew: there is nothing to close."""

    def _opened(self) -> Any:
        reader = self._kind()
        reader.open(self._storage, rosbag2_py.ConverterOptions('cdr', 'cdr'))
        return reader

    def messages(self, connections: Sequence[Connection]
                 ) -> Iterator[tuple[Connection, int, bytes]]:
        """Yield connection, receive time (ns) and bytes of each message, in order of time."""
        by_topic = {connection.topic: connection for connection in connections}
        reader = self._opened()
        reader.set_filter(rosbag2_py.StorageFilter(topics=list(by_topic)))
        while reader.has_next():
            topic, message, received = reader.read_next()
            yield by_topic[topic], received, message
