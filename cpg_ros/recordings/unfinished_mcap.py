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

"""The complete part of an mcap file whose recorder never finished it.

A recorder that dies leaves no index and no footer at the end of the file, and the library then
refuses all of it. Here the file is shown to the library as far as its records are whole, with a
footer that says there is no index; messages of a chunk that was cut are lost.
"""

import io
from pathlib import Path, PosixPath
from typing import Any, IO

MAGIC = b'\x89MCAP0\r\n'
#: Footer record: opcode, length, and no summary, no summary offsets, no checksum; then the end.
FOOTER = b'\x02' + (20).to_bytes(8, 'little') + bytes(20) + MAGIC


def whole_part(path: Path) -> int | None:
    """Return how many bytes hold whole records, or None where nothing is cut off (or no mcap)."""
    with open(path, 'rb') as file:
        size = file.seek(0, io.SEEK_END)
        file.seek(0)
        if file.read(8) != MAGIC:
            return None
        file.seek(max(8, size - 8))
        if file.read() == MAGIC:
            return None
        end = 8
        while end + 9 <= size:
            file.seek(end)
            head = file.read(9)
            following = end + 9 + int.from_bytes(head[1:], 'little')
            # Opcode 0 does not exist; a file system may leave zeros where data never came.
            if head[0] == 0 or following > size:
                break
            end = following
    return end


class UnfinishedPath(PosixPath):
    """A path below which unfinished mcap files read as if their recorder had stopped there."""

    def open(self, mode: str = 'r', *args: Any, **options: Any) -> Any:  # noqa: A003
        """Open the file; see the class."""
        end = whole_part(self) if mode == 'rb' and self.suffix == '.mcap' else None
        file = super().open(mode, *args, **options)
        return file if end is None else io.BufferedReader(_Ended(file, end))


class _Ended(io.RawIOBase):
    """The first bytes of a file, and the footer."""

    def __init__(self, file: IO[bytes], end: int) -> None:
        self._file, self._end, self._at = file, end, 0

    def readable(self) -> bool:
        return True

    def seekable(self) -> bool:
        return True

    def seek(self, offset: int, whence: int = io.SEEK_SET, /) -> int:
        base = {io.SEEK_SET: 0, io.SEEK_CUR: self._at, io.SEEK_END: self._end + len(FOOTER)}
        self._at = base[whence] + offset
        return self._at

    def readinto(self, buffer: Any, /) -> int:
        into = memoryview(buffer)
        if self._at < self._end:
            self._file.seek(self._at)
            data = self._file.read(min(len(into), self._end - self._at))
        else:
            data = FOOTER[self._at - self._end:][:len(into)]
        into[:len(data)] = data
        self._at += len(data)
        return len(data)

    def close(self) -> None:
        self._file.close()
        super().close()
