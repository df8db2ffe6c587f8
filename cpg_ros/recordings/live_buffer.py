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

"""Joint states as they arrive, kept as bytes until a recording is requested."""

from collections import deque
from collections.abc import Sequence

from cpg_ros.recordings.joint_streams import recorded, Stream
from cpg_ros.recordings.recording import Recording, RecordingError
from cpg_ros.recordings.servo import Servo


class Live:
    """The last messages of some topics.

    Args:
        topics: their names.
        window: how long messages are kept, s; 0 for ever.

    """

    def __init__(self, topics: Sequence[str], window: float) -> None:
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

    def copy(self) -> 'Live':
        """Return the same messages, to be decoded while more come in."""
        other = Live(tuple(self._kept), self.window)
        for topic, kept in self._kept.items():
            other._kept[topic].extend(kept)
        return other

    def recording(self, joints: Sequence[str] = (), some: bool = False,
                  servo: Servo | None = None) -> Recording:
        """Decode what is kept.

        Args:
            joints: which to take; all of them, if empty.
            some: joints that are not there are passed over, unless none is.
            servo: of the joints, if the angles that they were driven to are wanted.

        Raises:
            RecordingError: nothing, or nothing that can be used, came in.

        """
        if not any(self._kept.values()):
            raise RecordingError(f'{", ".join(self._kept)}: no joint states came in')
        streams = []
        for topic, kept in self._kept.items():
            stream = Stream(topic, joints, servo)
            for received, message in kept:
                stream.add(received, message)
            stream.decode()
            streams.append(stream)
        return recorded(streams, joints, '', some=some)
