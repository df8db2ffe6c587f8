"""Joint states out of rosbag2 bags: sqlite3 and mcap, compressed or not, without ROS.

The library `rosbags` reads the storage; positions come from the messages' bytes in bulk (see
`cdr`), so that of a long bag only the angles are ever in memory.
"""

from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from rosbags.rosbag2 import Reader

from cpg_ros.dynamics.progress import progress_bar
from cpg_ros.fitting.cdr import JOINT_STATE, UndecodableError, decode
from cpg_ros.fitting.recording import Chunk, Recording, RecordingError, few, merged, require
from cpg_ros.fitting.unfinished import UnfinishedPath, whole_part

#: Messages of a topic that are decoded together; a few MB.
BATCH = 4096
#: Stamps later than this (ns) are of a clock that shows the date, where 0 means not stamped.
DATED = 10**17
STORAGES = ('.mcap', '.db3')


def read_bag(path: str | Path, topics: Sequence[str] = (), joints: Sequence[str] = (),
             progress: bool = True) -> Recording:
    """Read the joint states of a bag.

    A joint on several topics is taken from one: from the topic with the most joints, and among
    these the one called joint_states, the one with the most messages, the first. Samples are at
    their header stamps; where all of a topic's are 0, all samples are at their receive times.

    A recorder that died leaves mcap files without an end and no metadata.yaml. What is whole of
    such files is read; a note says so. A cut sqlite3 file is refused.

    Args:
        path: the bag's folder, or one of its storage files (.mcap, .db3).
        topics: which to read; all topics of type sensor_msgs/msg/JointState, if empty.
        joints: which joints to take, in this order; all of them, if empty.
        progress: show a progress bar.

    Raises:
        RecordingError: see `merged`; a bag that cannot be read, a topic that is not there or of
            another type.

    """
    path = Path(path)
    with _opened(path) as bag:
        streams = {topic: _Stream(topic, joints) for topic in bag.choose(topics)}
        with progress_bar(f'reading {path.name}', bag.count(streams), enabled=progress) as bar:
            done = 0
            for topic, received, message in bag.messages(streams):
                stream = streams[topic]
                stream.add(received, message)
                if len(stream.messages) == BATCH:
                    stream.decode(path)
                    done += BATCH
                    bar(done)
        for stream in streams.values():
            stream.decode(path)
        notes = [*bag.notes, *bag.losses(streams)]
    there = list(dict.fromkeys(name for stream in streams.values() for name in stream.joints))
    source = f'{path}, {", ".join(streams)}'
    if not there:
        raise RecordingError(f'{source}: no message with positions')
    require(joints, there, source)
    notes += _once_each(list(streams.values()), joints or there)
    read = [stream for stream in streams.values() if stream.taken]
    source = f'{path}, {", ".join(stream.topic for stream in read)}'
    headers = all(stream.stamped for stream in read)
    if not headers:
        unset = [stream.topic for stream in read if not stream.stamped]
        notes.append(f'no header stamps on {few(unset)}: the times are those of receipt')
    for stream in read:
        notes += stream.notes(headers)
    chunks = (chunk for stream in read for chunk in stream.chunks(headers))
    recording = merged(chunks, source, joints)
    return replace(recording, notes=(*notes, *recording.notes))


class _Stream:
    """What a topic delivered."""

    def __init__(self, topic: str, joints: Sequence[str]) -> None:
        self.topic = topic
        self.wanted = set(joints)
        self.taken: set[str] = set()
        self.messages: list[bytes] = []
        self.received: list[int] = []
        #: Header stamps and receive times in ns, names, positions.
        self.parts: list[tuple[np.ndarray, np.ndarray, tuple[str, ...], np.ndarray]] = []
        self.joints: dict[str, None] = {}
        self.count = self.mute = self.odd = self.unstamped = 0
        self.dated = False

    @property
    def stamped(self) -> bool:
        """Whether any message has a header stamp."""
        return self.unstamped < self.count - self.mute - self.odd

    def add(self, received: int, message: bytes) -> None:
        """Keep a message for decoding."""
        self.received.append(received)
        self.messages.append(message)

    def decode(self, path: Path) -> None:
        """Decode the messages at hand."""
        received = np.array(self.received, np.int64)
        try:
            for block in decode(self.messages):
                self._keep(block.stamps, received[block.rows], block.names, block.positions)
        except UndecodableError as error:
            raise RecordingError(
                f'{path}, {self.topic}: message {self.count + error.index + 1} is no '
                f'{JOINT_STATE}: {_line(error)}') from error
        self.count += len(self.messages)
        self.messages, self.received = [], []

    def _keep(self, stamps: np.ndarray, received: np.ndarray, names: tuple[str, ...],
              positions: np.ndarray) -> None:
        if not positions.shape[1]:
            self.mute += len(stamps)
        elif positions.shape[1] != len(names):
            self.odd += len(stamps)
        else:
            self.joints.update(dict.fromkeys(names))
            self.unstamped += int((stamps == 0).sum())
            self.dated = self.dated or bool((stamps > DATED).any())
            if self.wanted and not self.wanted.issuperset(names):
                columns = [k for k, name in enumerate(names) if name in self.wanted]
                names, positions = tuple(names[k] for k in columns), positions[:, columns]
            self.parts.append((stamps, received, names, positions))

    def notes(self, headers: bool) -> list[str]:
        """Say what is left out."""
        counts = ((self.mute, 'without positions'),
                  (self.odd, 'with more or fewer positions than names'),
                  (self.unstamped if headers and self.dated else 0, 'without a stamp'))
        return [f'{self.topic}: {count} of {self.count} messages {what}, left out'
                for count, what in counts if count]

    def chunks(self, headers: bool) -> Iterator[Chunk]:
        """Yield the samples, and forget them."""
        self.parts.reverse()
        while self.parts:
            stamps, received, names, positions = self.parts.pop()
            if headers and self.dated and not stamps.all():
                there = stamps != 0
                stamps, positions = stamps[there], positions[there]
            if not self.taken.issuperset(names):
                columns = [k for k, name in enumerate(names) if name in self.taken]
                names, positions = tuple(names[k] for k in columns), positions[:, columns]
            yield stamps if headers else received, names, positions


def _once_each(streams: list[_Stream], wanted: Sequence[str]) -> list[str]:
    """Choose one topic for every joint that is on several, and say which."""
    order = sorted(streams, key=lambda one: (
        -len(one.joints), one.topic.rsplit('/')[-1] != 'joint_states', -one.count))
    owner = {name: stream for stream in reversed(order) for name in stream.joints}
    notes = []
    for stream in streams:
        stream.taken = {name for name in wanted if owner[name] is stream}
        for other in streams:
            common = [name for name in wanted
                      if name in stream.joints and owner[name] is other is not stream]
            if common:
                notes.append(f'{stream.topic}: joint {few(common)} taken from {other.topic}')
    return notes


class _Bag:
    """The readers of a bag: one, or one for each storage file where metadata.yaml is missing."""

    def __init__(self, path: Path, readers: list[Reader], cut: bool, notes: list[str]) -> None:
        self.path, self.readers, self.notes = path, readers, notes
        self.connections = [one for reader in readers for one in reader.connections]
        # The library refuses unordered messages in files without an index; those of a single
        # topic mostly are in order.
        self.apart = cut

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
        """Count the messages of each topic, as the bag says."""
        counts: Counter[str] = Counter()
        for one in self.connections:
            counts[one.topic] += one.msgcount
        return counts

    def count(self, streams: dict[str, _Stream]) -> int:
        """Count the messages of the topics, as the bag says."""
        return max(1, sum(self.expected()[topic] for topic in streams))

    def losses(self, streams: dict[str, _Stream]) -> Iterator[str]:
        """Say where fewer messages were there than the bag says."""
        expected = self.expected()
        for topic, stream in streams.items():
            if stream.count != expected[topic]:
                yield (f'{topic}: {stream.count} messages, where the bag\'s metadata counts '
                       f'{expected[topic]}')

    def messages(self, streams: dict[str, _Stream]) -> Iterator[tuple[str, int, bytes]]:
        """Yield topic, receive time (ns) and bytes of each message."""
        for reader in self.readers:
            chosen = [one for one in reader.connections if one.topic in streams]
            for some in [[one] for one in chosen] if self.apart else [chosen] * bool(chosen):
                messages = reader.messages(some)
                while True:
                    try:
                        connection, received, message = next(messages)
                    except StopIteration:
                        break
                    # As in _opened.
                    except Exception as error:
                        read = {topic: one.count + len(one.messages)
                                for topic, one in streams.items()}
                        where = ', '.join(f'{count} messages of {topic}'
                                          for topic, count in read.items())
                        raise RecordingError(f'{reader.path}: {_line(error)}, '
                                             f'after {where}') from error
                    yield connection.topic, received, message


@contextmanager
def _opened(path: Path) -> Iterator[_Bag]:
    """Open a bag."""
    if not path.exists():
        raise RecordingError(f'{path}: no such bag')
    notes = []
    files = [path]
    if path.is_dir():
        files = [file for file in path.iterdir() if file.suffix in STORAGES and file.is_file()]
        files.sort(key=lambda file: (len(file.name), file.name))
    elif path.suffix not in STORAGES:
        raise RecordingError(f'{path}: neither a folder nor a file with the ending '
                             f'{" or ".join(STORAGES)}')
    for file in files:
        end = _asked(file, whole_part, file) if file.suffix == '.mcap' else None
        if end is not None:
            notes.append(f'{file}: its recorder did not finish it; what is whole before byte '
                         f'{end} is used')
    cut = bool(notes)
    paths = [path]
    if path.is_dir() and not (path / 'metadata.yaml').exists():
        if not files:
            raise RecordingError(f'{path}: no bag: it has neither metadata.yaml nor a storage '
                                 f'file ({", ".join(STORAGES)})')
        notes.append(f'{path}: metadata.yaml is missing; its storage files are read as they are')
        paths = files
    with ExitStack() as stack:
        readers = []
        for one in paths:
            reader = _asked(one, Reader, UnfinishedPath(one) if cut else one)
            _asked(one, reader.open)
            stack.callback(reader.close)
            readers.append(reader)
        yield _Bag(path, readers, cut, notes)


def _asked(path: Path, ask: Callable[..., Any], *arguments: Any) -> Any:
    """Call into the library, which names no complete list of what a damaged bag makes it raise."""
    try:
        return ask(*arguments)
    except Exception as error:
        raise RecordingError(f'{path}: {_line(error)}') from error


def _line(error: Exception) -> str:
    """Return an error in one line, without a full stop."""
    return ' '.join((str(error) or type(error).__name__).split()).rstrip('.')
