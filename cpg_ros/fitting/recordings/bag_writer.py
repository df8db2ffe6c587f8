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

"""Writer of bags, message by message; a bag gets its name when it is complete."""

from collections.abc import Callable
from pathlib import Path
import shutil

from cpg_ros.common.errors import CpgError
from rosbags.interfaces import Connection
from rosbags.rosbag2 import (
    CompressionFormat,
    CompressionMode,
    StoragePlugin,
    Writer,
    WriterError,
)
from rosbags.typesys import get_types_from_msg, get_typestore, Stores


class BagError(CpgError):
    """A bag cannot be written; one line."""

    exit_code = 1


class BagWriter:
    """Writer of an MCAP bag under a temporary name, renamed at the end.

    Attributes:
        path: of the bag, a folder.
        size: bytes of messages written so far.

    """

    def __init__(self, path: Path, packed: bool = False) -> None:
        """Open the bag.

        Args:
            path: of the bag, a folder.
            packed: compress MCAP's chunks by zstd, which takes time.

        Raises:
            BagError: the name is taken, or the folder cannot be written to.

        """
        if path.exists():
            raise BagError(f'{path}: already exists')
        self.path, self.size = path, 0
        # Its files are named after the bag's folder, which therefore has its name from the start.
        self._beside = path.with_name(f'.{path.name}.unfinished')
        self._store = get_typestore(Stores.ROS2_JAZZY)
        try:
            shutil.rmtree(self._beside, ignore_errors=True)
            self._writer = Writer(self._beside / path.name, version=9,
                                  storage_plugin=StoragePlugin.MCAP)
            if packed:
                self._writer.set_compression(CompressionMode.STORAGE, CompressionFormat.ZSTD)
            self._writer.open()
        except (OSError, WriterError) as error:
            raise BagError(f'{path}: {getattr(error, "strerror", None) or error}') from error

    def connect(self, topic: str, kind: str, fields: Callable[[str], str]) -> Connection:
        """Return the destination for messages of a topic.

        Args:
            topic: its name.
            kind: its type, such as sensor_msgs/msg/JointState.
            fields: returns the text of a type's .msg file, for types that the library does not
                know.

        """
        if kind not in self._store.types:
            self._store.register(get_types_from_msg(fields(kind), kind))
        return self._writer.add_connection(topic, kind, typestore=self._store)

    def write(self, connection: Connection, when: int, message: bytes) -> None:
        """Write a serialised message with its receive time, ns.

        Raises:
            BagError: a write failed, for example on a full disk.

        """
        try:
            self._writer.write(connection, when, message)
        except OSError as error:
            raise BagError(f'{self.path}: {error.strerror}') from error
        self.size += len(message)

    def close(self) -> None:
        """Complete and rename the bag; drop one without messages.

        Raises:
            BagError: a write failed, for example on a full disk.

        """
        try:
            self._writer.close()
            if self.size:
                (self._beside / self.path.name).rename(self.path)
            shutil.rmtree(self._beside)
        except OSError as error:
            raise BagError(f'{self.path}: {error.strerror}') from error
