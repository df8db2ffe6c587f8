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

"""Interface to the library `rosbags`, with limits on the size of unpacked data."""

import os
from pathlib import Path
import shutil
from types import SimpleNamespace
from typing import Any, BinaryIO

from cpg_ros.fitting.recordings.tables import UnpackedSize
from rosbags.rosbag2 import Reader, reader, ReaderError, storage_mcap
from rosbags.serde import SerdeError
from rosbags.typesys import get_typestore, Stores

__all__ = ['TYPESTORE', 'Reader', 'ReaderError', 'SerdeError', 'deserialize', 'unpack_file']

#: TYPESTORE: message types; the layout of a JointState is the same in all ROS 2 distributions.
TYPESTORE = get_typestore(Stores.ROS2_JAZZY)
#: ZSTD: the module with which the library unpacks, which sets no limit.
ZSTD: Any = vars(reader)['zstd']


def deserialize(message: bytes) -> Any:
    """Return a JointState out of its bytes.

    Raises:
        SerdeError: the bytes are not such a message.

    """
    return TYPESTORE.deserialize_cdr(message, 'sensor_msgs/msg/JointState')


class _UnpackedFile(ZSTD.ZstdFile):  # type: ignore[misc]
    """A storage file that was packed as a whole, while it is unpacked to the disk."""

    def __init__(self, file: BinaryIO, mode: str) -> None:
        super().__init__(file, mode)
        self._unpacked = UnpackedSize(os.fstat(file.fileno()).st_size)

    def read(self, size: int = -1) -> bytes:
        """Read some bytes."""
        data = super().read(size)
        self._unpacked.add(len(data))
        return data


def _unpack(data: bytes) -> bytes:
    """Unpack a message, or a chunk of messages, of one frame or more."""
    unpacked, parts = UnpackedSize(len(data)), []
    while data:
        frame = ZSTD.ZstdDecompressor()
        parts.append(frame.decompress(data, max_length=unpacked.most + 1))
        unpacked.add(len(parts[-1]))
        if not frame.eof:
            raise ZSTD.ZstdError('what was packed by zstd is cut')
        data = frame.unused_data
    return b''.join(parts)


def unpack_file(path: Path, into: Path) -> None:
    """Unpack a storage file that was packed as a whole."""
    with path.open('rb') as packed, _UnpackedFile(packed, 'rb') as data, into.open('wb') as out:
        shutil.copyfileobj(data, out)


for module in (reader, storage_mcap):
    vars(module).update(zstd=SimpleNamespace(
        **{**vars(ZSTD), 'open': _UnpackedFile, 'decompress': _unpack}))
