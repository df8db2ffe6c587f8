"""Joint states as they come in, kept as bytes until they are asked for."""

from collections import deque
from collections.abc import Iterator

import numpy as np

from cpg_ros.fitting.cdr import UndecodableError, decode
from cpg_ros.fitting.recording import Chunk, Recording, RecordingError, merged

#: Messages decoded at once.
BATCH = 4096


class Live:
    """The last messages of some topics.

    Args:
        topics: their names.
        window: how long messages are kept, s; 0 for ever.

    """

    def __init__(self, topics: tuple[str, ...], window: float) -> None:
        self.window = window
        self._kept: dict[str, deque[tuple[int, bytes]]] = {topic: deque() for topic in topics}

    def add(self, topic: str, received: int, message: bytes) -> None:
        """Keep a serialised JointState that came in at a time in ns; forget those too old."""
        kept = self._kept[topic]
        kept.append((received, message))
        if self.window > 0.0:
            oldest = received - int(self.window * 1e9)
            while kept[0][0] < oldest:
                kept.popleft()

    def __len__(self) -> int:
        return sum(map(len, self._kept.values()))

    def copy(self) -> 'Live':
        """Return the same messages, to be decoded while more come in."""
        other = Live(tuple(self._kept), self.window)
        for topic, kept in self._kept.items():
            other._kept[topic].extend(kept)
        return other

    def recording(self) -> Recording:
        """Decode what is kept.

        Raises:
            RecordingError: nothing, or nothing that can be used, came in.

        """
        source = ', '.join(self._kept)
        if not len(self):
            raise RecordingError(f'{source}: no joint states came in')
        chunks = [chunk for topic, kept in self._kept.items()
                  for chunk in _chunks(topic, list(kept))]
        if not chunks:
            raise RecordingError(f'{source}: no message with names and positions came in')
        return merged(chunks, source)


def _chunks(topic: str, kept: list[tuple[int, bytes]]) -> Iterator[Chunk]:
    """Decode a topic's messages; their times are those of their headers, or of receipt."""
    for first in range(0, len(kept), BATCH):
        part = kept[first:first + BATCH]
        received = np.array([time for time, _ in part], dtype=np.int64)
        try:
            for block in decode([message for _, message in part]):
                if block.positions.shape[1] == len(block.names) > 0:
                    stamps = block.stamps if block.stamps.any() else received[block.rows]
                    yield stamps, block.names, block.positions
        except UndecodableError as error:
            raise RecordingError(f'{topic}: message {first + error.index + 1} cannot be decoded: '
                                 f'{error}') from error
