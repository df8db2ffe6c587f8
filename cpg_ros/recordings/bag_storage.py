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

"""The storage of rosbag2 bags: which topics are there, and their messages as bytes.

Whatever the library raises on a damaged bag ends here, as one line that names the file.
"""

from collections import Counter
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, ExitStack
import math
from pathlib import Path
import re

from cpg_ros.files import regular_file
from cpg_ros.recordings.bag_library import Reader, ReaderError
from cpg_ros.recordings.cdr import JOINT_STATE
from cpg_ros.recordings.recording import few, RecordingError
from cpg_ros.recordings.unfinished_mcap import UnfinishedPath, whole_part
from cpg_ros.recordings.unpacked_size import UnpackedSize

#: Endings of a bag's storage files, and the name of the file that describes them.
STORAGES, METADATA = ('.mcap', '.db3'), 'metadata.yaml'
#: Largest such file, bytes: a thousand topics have one of 2 MB.
LARGEST_METADATA = 16_000_000


class Bag:
    """The readers of a bag: one, or one for each storage file where metadata.yaml is missing."""

    def __init__(self, path: Path, readers: list[Reader], cut: bool, notes: list[str],
                 size: int) -> None:
        """Take readers; size is that of all storage files, bytes."""
        self.size = size
        self.path, self.readers, self.notes = path, readers, notes
        self.connections = [one for reader in readers for one in reader.connections]
        # The library refuses unordered messages in files without an index; those of a single
        # topic mostly are in order.
        self.apart = cut
        for one in self.connections:
            for value, kind in ((one.topic, str), (one.msgtype, str), (one.msgcount, int)):
                if type(value) is not kind:
                    raise RecordingError(f'{path}: a topic is described by {str(value)[:40]!r}, '
                                         f'where {"a number" if kind is int else "text"} is '
                                         'needed')

    def choose(self, topics: Sequence[str]) -> list[str]:
        """Return the topics to read."""
        types: dict[str, set[str]] = {}
        for one in self.connections:
            types.setdefault(one.topic, set()).add(one.msgtype)
        if not types:
            raise RecordingError(f'{self.path}: an empty bag, without topics')
        fitting = [topic for topic in types if types[topic] == {JOINT_STATE}]
        if not topics and not fitting:
            there = ', '.join(f'{topic} ({", ".join(sorted(types[topic]))})'
                              for topic in list(types)[:6])
            raise RecordingError(f'{self.path}: no topic of type {JOINT_STATE}; it has {there}')
        chosen = [topic if topic in types else '/' + topic.lstrip('/') for topic in topics]
        for topic in chosen:
            if topic not in types:
                raise RecordingError(f'{self.path}: no topic {topic!r}; '
                                     f'there are {few(list(types), 20)}')
            if topic not in fitting:
                raise RecordingError(f'{self.path}, {topic}: {" and ".join(sorted(types[topic]))}'
                                     f', where {JOINT_STATE} is needed')
        return list(dict.fromkeys(chosen)) or fitting

    def expected(self) -> Counter[str]:
        """Return the number of messages of each topic in the bag's metadata."""
        counts: Counter[str] = Counter()
        for one in self.connections:
            counts[one.topic] += one.msgcount
        return counts

    def messages(self, topics: Sequence[str]) -> Iterator[tuple[str, int, bytes]]:
        """Yield topic, receive time (ns) and bytes of each message."""
        read: Counter[str] = Counter()
        unpacked = UnpackedSize(self.size)
        for reader in self.readers:
            chosen = [one for one in reader.connections if one.topic in topics]
            for some in [[one] for one in chosen] if self.apart else [chosen] * bool(chosen):
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
        RecordingError: it is not there or damaged.

    """
    try:
        files = _files(path)
        size = 0
        for file in (path, *path.iterdir()) if path.is_dir() else (path,):
            if not file.is_dir():
                _check(file)
                size += file.stat().st_size
        notes = [f'{file}: its recorder did not finish it; what is whole before byte {end} is used'
                 for file in files if (end := whole_part(file)) is not None]
        whole = path.is_file() or (path / METADATA).exists()
    except OSError as error:
        raise RecordingError(f'{error.filename or path}: {error.strerror}') from error
    cut = bool(notes)
    if not whole:
        notes.append(f'{path}: metadata.yaml is missing; its storage files are read as they are')
    with ExitStack() as stack:
        readers = []
        for one in [path] if whole else files:
            try:
                reader = Reader(UnfinishedPath(one) if cut else one)
                reader.open()
            # The library names no complete list of what a damaged bag makes it raise.
            except Exception as error:
                raise RecordingError(f'{_culprit(one, files, error)}: {line(error)}') from error
            stack.callback(reader.close)
            readers.append(reader)
        yield Bag(path, readers, cut, notes, size)


def _check(file: Path) -> None:
    """Reject pipes and devices, which would block the library."""
    largest = LARGEST_METADATA if file.name == METADATA else math.inf
    with regular_file.opened(file, RecordingError, largest=largest):
        pass


def _files(path: Path) -> list[Path]:
    """Return the storage files of a bag that the library can read by themselves, in order."""
    if not path.exists():
        raise RecordingError(f'{path}: no such bag')
    if not path.is_dir():
        if path.suffix not in STORAGES:
            raise RecordingError(f'{path}: neither a folder nor a file with the ending '
                                 f'{" or ".join(STORAGES)}')
        return [path]
    files = [file for file in path.iterdir() if file.suffix in STORAGES and file.is_file()]
    if not files and not (path / METADATA).exists():
        raise RecordingError(f'{path}: not a bag: it has neither metadata.yaml nor a storage file '
                             f'({", ".join(STORAGES)})')
    return sorted(files, key=lambda file: (len(file.name), file.name))


def files_of_bag(folder: Path) -> list[Path]:
    """Return the files of a folder that is one bag, sorted, and none of any other folder.

    One with metadata.yaml is a bag, and so is one whose storage files are parts of one recording:
    name_0.mcap, name_1.mcap ...

    Raises:
        OSError: the folder cannot be listed.

    """
    files = sorted(one for one in folder.iterdir() if one.is_file() and (
        one.suffix in STORAGES or one.name == METADATA))
    storages = [one for one in files if one.suffix in STORAGES]
    parts = [re.fullmatch(r'(.*)_\d+', one.stem) for one in storages]
    split = len(parts) > 1 and all(parts) and len({
        (part[1], one.suffix) for part, one in zip(parts, storages, strict=True) if part}) == 1
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
        return (f'{path / METADATA} cannot be used'
                + (f' to read {few([file.name for file in files])}' if files else ''))
    return ' or '.join(str(file) for file in path.iterdir() if file.name != METADATA)


def line(error: Exception) -> str:
    """Return an error in one line, without a full stop."""
    return ' '.join((str(error) or type(error).__name__).split()).rstrip('.')
