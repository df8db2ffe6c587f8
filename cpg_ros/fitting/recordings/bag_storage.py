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

"""Storage of rosbag2 bags: unfinished mcap files, topics, and messages as bytes.

All exceptions of the library on a damaged bag become one line that names the file.
"""

from collections import Counter
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, ExitStack, nullcontext
import io
import math
from pathlib import Path, PosixPath
import re
from tempfile import TemporaryDirectory
from typing import Any, IO

from cpg_ros.common import files as regular_file
from cpg_ros.fitting.recordings.bag_library import Reader, ReaderError, unpack_file
from cpg_ros.fitting.recordings.cdr import JOINT_STATE
from cpg_ros.fitting.recordings.low_state import MOTOR_NAMES
from cpg_ros.fitting.recordings.recording import abbreviate, RecordingError, refuse_stand_in
from cpg_ros.fitting.recordings.tables import UnpackedSize

# The complete part of an mcap file whose recorder never finished it.

MAGIC = b'\x89MCAP0\r\n'
#: Footer record: opcode, length, and no summary, no summary offsets, no checksum; then the end.
FOOTER = b'\x02' + (20).to_bytes(8, 'little') + bytes(20) + MAGIC


def whole_part(path: Path) -> int | None:
    """Return how many bytes contain whole records, or None if nothing is cut off (or no mcap)."""
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


STORAGE_SUFFIXES, METADATA_FILE = ('.mcap', '.db3'), 'metadata.yaml'
#: ZSTD_SUFFIX: of packed storage files, after their own; ENDINGS: of all bags that are files.
ZSTD_SUFFIX = '.zstd'
ENDINGS = (*STORAGE_SUFFIXES, *(ending + ZSTD_SUFFIX for ending in STORAGE_SUFFIXES), '.bag')
#: MAX_METADATA_SIZE: bytes; a thousand topics take 2 MB.
MAX_METADATA_SIZE = 16_000_000


class Bag:
    """The readers of a bag: one, or one for each storage file where metadata.yaml is missing."""

    def __init__(self, path: Path, readers: list[Reader], cut: bool, notes: list[str],
                 size: int) -> None:
        """Store readers and the size of all storage files, bytes."""
        self.size = size
        self.path, self.readers, self.notes = path, readers, notes
        self.connections = [connection for reader in readers for connection in reader.connections]
        # The library refuses unordered messages in files without an index; those of a single
        # topic mostly are in order.
        self.damaged = cut
        for connection in self.connections:
            for value, kind in ((connection.topic, str), (connection.msgtype, str),
                                (connection.msgcount, int)):
                if type(value) is not kind:
                    raise RecordingError(f'{path}: a topic is described by {str(value)[:40]!r}, '
                                         f'where {"a number" if kind is int else "text"} is '
                                         'needed')

    def choose(self, topics: Sequence[str]) -> list[str]:
        """Return the topics to read."""
        types: dict[str, set[str]] = {}
        for connection in self.connections:
            types.setdefault(connection.topic, set()).add(connection.msgtype)
        if not types:
            raise RecordingError(f'{self.path}: an empty bag, without topics')
        fitting = [topic for topic in types if types[topic] == {JOINT_STATE}]
        motors = [topic for topic in types if types[topic] <= set(MOTOR_NAMES)]
        if not topics and not fitting and motors:
            # Robots publish their state twice, at the full rate and slower.
            counts = self.expected()
            return [max(motors, key=lambda topic: counts[topic])]
        if not topics and not fitting:
            available = ', '.join(f'{topic} ({", ".join(sorted(types[topic]))})'
                                  for topic in list(types)[:6])
            raise RecordingError(f'{self.path}: no topic of type {JOINT_STATE}; it has '
                                 f'{available}')
        full_names = []
        for topic in topics:
            name = topic if topic in types else '/' + topic.strip('/')
            full_names += [name] if name in types else [
                name_of for name_of in fitting if name_of.startswith(f'{name}/')] or [name]
        for topic in full_names:
            if topic not in types:
                raise RecordingError(f'{self.path}: no topic {topic!r}; '
                                     f'there are {abbreviate(list(types), 20)}')
            if topic not in (*fitting, *motors):
                raise RecordingError(f'{self.path}, {topic}: {" and ".join(sorted(types[topic]))}'
                                     f', where {JOINT_STATE} is needed')
        return list(dict.fromkeys(full_names)) or fitting

    def kind(self, topic: str) -> str:
        """Return the type of a topic."""
        return next(connection.msgtype for connection in self.connections
                    if connection.topic == topic)

    def expected(self) -> Counter[str]:
        """Return the number of messages of each topic in the bag's metadata."""
        counts: Counter[str] = Counter()
        for connection in self.connections:
            counts[connection.topic] += connection.msgcount
        return counts

    def messages(self, topics: Sequence[str]) -> Iterator[tuple[str, int, bytes]]:
        """Yield topic, receive time (ns) and bytes of each message."""
        read: Counter[str] = Counter()
        unpacked = UnpackedSize(self.size)
        for reader in self.readers:
            connections = [item for item in reader.connections if item.topic in topics]
            for some in [[item] for item in connections] if self.damaged else (
                    [connections] * bool(connections)):
                try:
                    for connection, received, message in reader.messages(some):
                        if not isinstance(received, int) or not isinstance(message, bytes):
                            raise ValueError('a message without time or content')
                        unpacked.add(len(message))
                        read[connection.topic] += 1
                        yield connection.topic, received, message
                # As to what the library raises, see opened.
                except Exception as error:
                    where = ', '.join(f'{read[topic]} messages of {topic}' for topic in topics)
                    raise RecordingError(f'{reader.path}: {line(error)}, after {where}'
                                         ) from error


@contextmanager
def opened(path: Path) -> Iterator[Bag]:
    """Open a bag.

    Raises:
        RecordingError: it is missing or damaged.

    """
    packed = path.name.endswith(ENDINGS[2:4]) and path.is_file()
    with TemporaryDirectory() if packed else nullcontext() as folder:
        inner = path
        if folder is not None:
            _check(path)
            inner = Path(folder) / path.stem
            try:
                unpack_file(path, inner)
            except RecordingError as error:
                raise RecordingError(f'{path}: {error}') from error
            except Exception as error:
                raise RecordingError(f'{path}: {line(error)}') from error
        with _opened(inner) as bag:
            bag.path = path
            yield bag


@contextmanager
def _opened(path: Path) -> Iterator[Bag]:
    try:
        files = _files(path)
        size = 0
        for file in (path, *path.iterdir()) if path.is_dir() else (path,):
            if not file.is_dir():
                _check(file)
                size += file.stat().st_size
        notes = [f'{file}: its recorder did not finish it; what is whole before byte {end} is used'
                 for file in files if (end := whole_part(file)) is not None]
        complete = path.is_file() or (path / METADATA_FILE).exists()
        rename_note = _renamed(path, files) if path.is_dir() and complete else ''
    except OSError as error:
        raise RecordingError(f'{error.filename or path}: {error.strerror}') from error
    damaged = bool(notes)
    if not complete:
        notes.append(f'{path}: metadata.yaml is missing; its storage files are read as they are')
    if rename_note:
        complete = False
        notes.append(f'{path / METADATA_FILE} names {rename_note}, which is missing; its storage '
                     'files are read as they are')
    with ExitStack() as stack:
        readers = []
        for storage in [path] if complete else files:
            try:
                reader = Reader(UnfinishedPath(storage) if damaged else storage)
                reader.open()
            # The library names no complete list of what a damaged bag makes it raise.
            except Exception as error:
                raise RecordingError(
                    f'{_culprit(storage, files, error)}: {line(error)}') from error
            stack.callback(reader.close)
            readers.append(reader)
        yield Bag(path, readers, damaged, notes, size)


def _renamed(path: Path, files: list[Path]) -> str:
    """Return the names in metadata.yaml of storage files that all have been renamed, or ''."""
    text = (path / METADATA_FILE).read_text(errors='replace')[:MAX_METADATA_SIZE]
    part = re.search(r'^  relative_file_paths:\n((?: +- .*\n)+)', text, re.M)
    names = [] if part is None else [line.strip(' -"\'') for line in part[1].splitlines()]
    names_on_disk = {file.name for file in files}
    same_files = len(names) == len(files) > 0 and not any(
        name.endswith(ZSTD_SUFFIX) or Path(name).name in names_on_disk for name in names)
    return abbreviate(names, 3) if same_files else ''


def _check(file: Path) -> None:
    """Reject pipes and devices, which would block the library."""
    largest = MAX_METADATA_SIZE if file.name == METADATA_FILE else math.inf
    with regular_file.opened(file, RecordingError, largest=largest) as data:
        refuse_stand_in(file, data.read(64))


def _files(path: Path) -> list[Path]:
    """Return the storage files of a bag that the library can read by themselves, in order."""
    if not path.exists():
        raise RecordingError(f'{path}: no such bag')
    if not path.is_dir():
        if path.suffix not in STORAGE_SUFFIXES:
            _check(path)
            raise RecordingError(f'{path}: neither a folder nor a file with the ending '
                                 f'{" or ".join(STORAGE_SUFFIXES)}')
        return [path]
    files = [file for file in path.iterdir() if file.suffix in STORAGE_SUFFIXES and file.is_file()]
    if not files and not (path / METADATA_FILE).exists():
        raise RecordingError(f'{path}: not a bag: it has neither metadata.yaml nor a storage file '
                             f'({", ".join(STORAGE_SUFFIXES)})')
    return sorted(files, key=lambda file: (len(file.name), file.name))


def files_of_bag(folder: Path) -> list[Path]:
    """Return the files of a folder that is one bag, sorted; none for other folders.

    A folder with metadata.yaml is a bag, and so is one whose storage files are parts of one
    recording: name_0.mcap, name_1.mcap ...

    Raises:
        OSError: the folder cannot be listed.

    """
    files = sorted(file for file in folder.iterdir() if file.is_file() and (
        file.suffix in STORAGE_SUFFIXES or file.name == METADATA_FILE))
    storages = [file for file in files if file.suffix in STORAGE_SUFFIXES]
    parts = [re.fullmatch(r'(.*)_\d+', file.stem) for file in storages]
    split = len(parts) > 1 and all(parts) and len({
        (part[1], file.suffix) for part, file in zip(parts, storages, strict=True) if part}) == 1
    return files if split or len(files) > len(storages) else []


def _culprit(path: Path, files: list[Path], error: Exception) -> str:
    """Name the damaged part of a bag that could not be opened."""
    if path.is_file():
        return str(path)
    for file in files:
        try:
            with Reader(UnfinishedPath(file)):
                pass
        except Exception:
            return str(file)
    if files or isinstance(error, ReaderError):
        return (f'{path / METADATA_FILE} cannot be used'
                + (f' to read {abbreviate([file.name for file in files])}' if files else ''))
    return ' or '.join(str(file) for file in path.iterdir() if file.name != METADATA_FILE)


def line(error: Exception) -> str:
    """Return an error in one line, without a full stop."""
    return ' '.join((str(error) or type(error).__name__).split()).rstrip('.')
