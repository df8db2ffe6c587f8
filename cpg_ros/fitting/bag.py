"""Joint states out of rosbag2 bags: sqlite3 and mcap, compressed or not, without ROS.

The library `rosbags` reads the storage; positions come from the messages' bytes in bulk (see
`cdr`), so that of a long bag only the angles are ever in memory.
"""

from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from cpg_ros.dynamics.progress import progress_bar
from cpg_ros.fitting.cdr import JOINT_STATE, UndecodableError, decode
from cpg_ros.fitting.recording import Chunk, Recording, RecordingError, few, merged, named, require
from cpg_ros.fitting.storage import line, opened

#: Messages of a topic that are decoded together; a few MB.
BATCH = 4096
#: Stamps later than this (ns) are of a clock that shows the date, where 0 means not stamped.
DATED = 10**17


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
    with opened(path) as bag:
        streams = {topic: _Stream(topic, joints) for topic in bag.choose(topics)}
        expected = bag.expected()
        total = max(1, sum(expected[topic] for topic in streams))
        with progress_bar(f'reading {path.name}', total, enabled=progress) as bar:
            done = 0
            for topic, received, message in bag.messages(list(streams)):
                stream = streams[topic]
                stream.received.append(received)
                stream.messages.append(message)
                if len(stream.messages) == BATCH:
                    stream.decode(path)
                    done += BATCH
                    bar(done)
        for stream in streams.values():
            stream.decode(path)
        notes = [*bag.notes, *(
            f"{topic}: {stream.count} messages, where the bag's metadata counts {expected[topic]}"
            for topic, stream in streams.items() if stream.count != expected[topic]), *(
            f'{topic}: no messages' for topic, stream in streams.items() if not stream.count)]
    there = list(dict.fromkeys(name for stream in streams.values() for name in stream.joints))
    source = f'{path}, {", ".join(streams)}'
    if not there:
        raise RecordingError('; '.join((f'{source}: no message with positions', *notes)))
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
        #: What is not decoded yet, and the times of receipt in ns.
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

    def decode(self, path: Path) -> None:
        """Decode the messages at hand."""
        received = np.array(self.received, np.int64)
        try:
            for block in decode(self.messages):
                self._keep(block.stamps, received[block.rows], block.names, block.positions)
        except UndecodableError as error:
            raise RecordingError(
                f'{path}, {self.topic}: message {self.count + error.index + 1} is no '
                f'{JOINT_STATE}: {line(error)}') from error
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
                notes.append(f'{stream.topic}: {named(common)} taken from {other.topic}')
    return notes
