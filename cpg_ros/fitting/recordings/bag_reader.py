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

"""Reader of rosbag2 bags: joint states, and foot loads on the clock of the joint states.

Bags are sqlite3 or mcap, compressed or not, and are read without ROS. Foot loads are arrays
without stamps, one number for each leg, labelled with the legs' names; their receive times place
them between the joint states.
"""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
import struct

from cpg_ros.common.command_line import printable, progress_bar
from cpg_ros.fitting.recordings.bag_storage import Bag, ENDINGS, files_of_bag, opened
from cpg_ros.fitting.recordings.joint_streams import BATCH_SIZE, merge_streams, Servo, Stream
from cpg_ros.fitting.recordings.recording import (
    FootLoads,
    JOINTS,
    Option,
    Recording,
    RecordingError,
    RecordingFormat,
)
import numpy as np

# Foot loads, whose messages have no stamps.

#: LOAD_TOPIC: last part of the name of a topic with foot loads, in any namespace.
LOAD_TOPIC, LOAD_TYPE = 'foot_contacts', 'std_msgs/msg/Float64MultiArray'
#: HEADER_SIZE: of CDR, bytes; bit 0 of its second byte is 1 for little-endian.
HEADER_SIZE = 4
#: CLOCK_TOLERANCE: s; if start and first stamp differ by more, times of reception are used.
CLOCK_TOLERANCE = 60.0


class LoadStream:
    """The messages of a topic of foot loads, and the clock of the joint states around them."""

    def __init__(self, topic: str) -> None:
        self.topic = topic
        self._receive_times: list[int] = []
        self._messages: list[bytes] = []
        #: Time of reception and stamp of each joint state, ns.
        self._clock: list[tuple[int, int]] = []

    def add(self, received: int, message: bytes) -> None:
        """Add a serialised message, received at a time in ns."""
        self._receive_times.append(received)
        self._messages.append(bytes(message))

    def pass_joint_state(self, received: int, message: bytes) -> None:
        """Take the clock from a serialised JointState."""
        if len(message) >= HEADER_SIZE + 8:
            seconds, rest = struct.unpack_from(f'{_order(message)}iI', message, HEADER_SIZE)
            self._clock.append((received, 1_000_000_000 * seconds + rest))

    def loads(self, start: float) -> FootLoads | None:
        """Return the loads, or None if nothing was delivered.

        Args:
            start: of the recording, s on its clock.

        Raises:
            RecordingError: a message is malformed, or has no label that names the legs.

        """
        if not self._messages or not self._clock:
            return None
        first = self._messages[0]
        try:
            legs, offset = _layout(first)
            same_size = {len(message) for message in self._messages} == {len(first)}
        except (struct.error, UnicodeDecodeError, ValueError):
            same_size = False
        if not same_size or offset + 8 * len(legs) > len(first):
            raise RecordingError(f'{self.topic}: foot loads need a label with the names of the '
                                 'legs, and a number for each')
        body = b''.join(message[offset:offset + 8 * len(legs)] for message in self._messages)
        rows = np.frombuffer(body, f'{_order(first)}f8').reshape(-1, len(legs)).astype(float)
        times = self._on_clock(start)
        rising = np.append(True, np.diff(np.maximum.accumulate(times)) > 0.0)
        return FootLoads(legs, times[rising], rows[rising])

    def _on_clock(self, start: float) -> np.ndarray:
        received, stamps = np.array(self._clock, dtype=np.int64).T
        if abs(start - 1e-9 * stamps[0]) > CLOCK_TOLERANCE:
            # Joint states without stamps are recorded by when they were received.
            stamps = received
        begin, times = received[0], np.array(self._receive_times, dtype=np.int64)
        # Interpolate differences: floats hold these to the nanosecond, unlike times since 1970.
        return np.asarray(1e-9 * np.interp(times - begin, received - begin, stamps - stamps[0])
                          + (1e-9 * float(stamps[0]) - start))


def _order(message: bytes) -> str:
    return '<' if message[1] & 1 else '>'


def _layout(message: bytes) -> tuple[tuple[str, ...], int]:
    """Return the names of the legs and the offset of the first number, bytes.

    The names are the label of the only dimension of the array.

    Raises:
        struct.error, UnicodeDecodeError, ValueError: the message has another layout.

    """
    order = _order(message)
    dimensions, length = struct.unpack_from(f'{order}II', message, HEADER_SIZE)
    end = HEADER_SIZE + 8 + length
    if dimensions != 1 or not 1 < length <= len(message):
        raise ValueError('not one dimension with a label')
    legs = tuple(message[HEADER_SIZE + 8:end - 1].decode().split(','))
    # Size, stride and offset, four bytes each, then how many numbers there are.
    (count,) = struct.unpack_from(f'{order}I', message, end + -(end - HEADER_SIZE) % 4 + 12)
    offset = end + -(end - HEADER_SIZE) % 4 + 16
    if count != len(legs):
        raise ValueError('not a number for each name')
    return legs, offset + -(offset - HEADER_SIZE) % 8


# The recording: joint states, and the foot loads if there are any.

def read_bag(path: str | Path, topics: Sequence[str] = (), joints: Sequence[str] = (),
             progress: bool = True, some: bool = False, servo: Servo | None = None
             ) -> Recording:
    """Read the joint states of a bag.

    See `recorded` for joints on several topics, and for stamps. Loads on the feet are read if
    exactly one topic of the bag has them (see `LoadStream`).

    A recorder that crashed leaves mcap files without an end and no metadata.yaml. The complete
    part of such files is read, and a note reports it. A truncated sqlite3 file is an error.

    Args:
        path: folder of the bag, or one of its storage files (.mcap, .db3, or compressed:
            .mcap.zstd).
        topics: names or namespaces; if empty, all topics of type sensor_msgs/msg/JointState, or
            else the fastest of Unitree's LowState.
        joints: names, in the order to return; all if empty.
        progress: show a progress bar.
        some: skip joints that are missing, unless all are.
        servo: of the joints, to return their commanded angles.

    Raises:
        RecordingError: see `recorded`; the bag cannot be read, or a topic is missing or of another
            type.

    """
    path = Path(path)
    source = printable(f'{path}, ')
    with opened(path) as bag:
        streams = {topic: Stream(topic, joints, servo, source, bag.kind(topic))
                   for topic in bag.choose(topics)}
        loads = _load_stream(bag)
        expected = bag.expected()
        total = max(1, sum(expected[topic] for topic in streams))
        with progress_bar(f'reading {path.name}', total, enabled=progress) as bar:
            messages = bag.messages([*streams, *([loads.topic] if loads else [])])
            for count, (topic, received, message) in enumerate(messages, 1):
                if loads and topic == loads.topic:
                    loads.add(received, message)
                    continue
                streams[topic].add(received, message)
                if loads:
                    loads.pass_joint_state(received, message)
                if not count % BATCH_SIZE:
                    bar(count)
        for stream in streams.values():
            stream.decode()
        notes = [*map(printable, bag.notes), *(
            f"{topic}: {stream.count} messages, where the bag's metadata counts {expected[topic]}"
            for topic, stream in streams.items() if stream.count != expected[topic]), *(
            f'{topic}: no messages' for topic, stream in streams.items() if not stream.count)]
    recording = merge_streams(list(streams.values()), joints, source, notes, some)
    return recording if loads is None else _with_loads(recording, loads)


def _load_stream(bag: Bag) -> LoadStream | None:
    """Return a stream for the topic with foot loads, None unless exactly one has them."""
    topics = {connection.topic for connection in bag.connections
             if connection.topic.rsplit('/')[-1] == LOAD_TOPIC and connection.msgtype == LOAD_TYPE}
    return LoadStream(topics.pop()) if len(topics) == 1 else None


def _with_loads(recording: Recording, stream: LoadStream) -> Recording:
    try:
        return replace(recording, loads=stream.loads(recording.start))
    except RecordingError as error:
        # Only the joints are required: unreadable loads become a note.
        return replace(recording, notes=(*recording.notes, f'{error}: left out'))


BAG = RecordingFormat(
    name='bag', contents='a rosbag2 bag', help='a rosbag2 bag, sqlite3 or mcap', metavar='DIR',
    read=read_bag, endings=ENDINGS, files_in=files_of_bag, features=('servo', 'some'),
    options=(Option('topics', 'topics of the bag to read, or their namespaces (default: '
                    "all of type sensor_msgs/msg/JointState, or one of Unitree's LowState)",
                    'TOPIC', several=True), JOINTS),
    lacks={'unit': 'joint states are in rad', 'time': 'joint states have their stamps'})
