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

"""Joint states topic by topic, from serialised messages to one recording."""

from collections import Counter, deque
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import compress

from cpg_ros.common.errors import InputError
from cpg_ros.fitting.recordings.bag_storage import line
from cpg_ros.fitting.recordings.cdr import (
    decode,
    in_order,
    JOINT_STATE,
    SerializedBlock,
    UndecodableError,
)
from cpg_ros.fitting.recordings.downsampling import Downsampler, MAX_RAW_SAMPLES
from cpg_ros.fitting.recordings.low_state import decode_low_states, MOTOR_NAMES
from cpg_ros.fitting.recordings.recording import (
    abbreviate,
    Chunk,
    joint_list,
    merge_chunks,
    Recording,
    RecordingError,
    require,
)
import numpy as np

# The commands of joints, from their positions, velocities and efforts.

#: N m/rad and N m s/rad; other gains are mistakes and overflow.
MIN_GAIN, MAX_GAIN = 1e-3, 1e5


@dataclass(frozen=True)
class Servo:
    """The controller of a robot's joints: effort = kp (command - position) - kd velocity.

    Attributes:
        kp: N m / rad, from MIN_GAIN to MAX_GAIN.
        kd: N m s / rad, from 0 to MAX_GAIN.

    Raises:
        InputError: a gain is out of its range.

    """

    kp: float
    kd: float = 0.0

    def __post_init__(self) -> None:
        if not MIN_GAIN <= self.kp <= MAX_GAIN:
            raise InputError(f'kp {self.kp:g} is not from {MIN_GAIN:g} to {MAX_GAIN:g} N m/rad')
        if not 0.0 <= self.kd <= MAX_GAIN:
            raise InputError(f'kd {self.kd:g} is not from 0 to {MAX_GAIN:g} N m s/rad')

    @property
    def needs(self) -> str:
        """Fields that joint states must have besides positions."""
        return 'velocity and effort' if self.kd else 'effort'

    def command(self, position: np.ndarray, velocity: np.ndarray, effort: np.ndarray
                ) -> np.ndarray:
        """Return the commanded angles of joints, rad.

        Args:
            position: rad.
            velocity: rad/s, of the same shape; ignored if kd is 0.
            effort: N m, of the same shape.

        """
        if self.kd:
            effort = effort + self.kd * velocity
        return position + effort / self.kp


#: BATCH_SIZE: messages of a topic that are decoded together; BATCH_BYTES: most bytes of these.
BATCH_SIZE, BATCH_BYTES = 4096, 16_000_000
#: EPOCH_THRESHOLD: ns; above, a clock counts from 1970, so that a stamp of 0 means none.
EPOCH_THRESHOLD = 10**17


class Stream:
    """The messages of a topic, decoded in batches.

    Args:
        topic: its name.
        joints: wanted ones; all if empty.
        servo: of the joints, to return commanded instead of measured angles.
        source: prefix of the topic's name in messages.
        kind: type of the messages, JointState or Unitree's LowState.

    """

    def __init__(self, topic: str, joints: Sequence[str], servo: Servo | None = None,
                 source: str = '', kind: str = JOINT_STATE) -> None:
        self.topic, self.servo, self.source, self.kind = topic, servo, source, kind
        #: The requested joints, in the order of positions without names.
        self.order = tuple(joints)
        #: Prefix of the requested names; text on messages without names; text on the first message
        #: without a position for each name.
        self.prefix, self.unnamed, self.example = '', False, ''
        self.selection = set(joints)
        self.output_joints: set[str] = set()
        #: Messages that are not decoded yet, and their times of receipt, ns.
        self.messages: list[bytes] = []
        self.receive_times: list[int] = []
        self._bytes = 0
        #: Header stamps and receive times in ns, names, positions.
        self.parts: list[tuple[np.ndarray, np.ndarray, tuple[str, ...], np.ndarray]] = []
        self._size = 0
        #: For a long topic: joints -> samples on a grid; then the seconds by which the other clock
        #: has gained since the first message.
        self._grids: dict[tuple[str, ...], Downsampler] = {}
        self._by_headers, self._offset = True, 0
        self.joints: dict[str, None] = {}
        self.count = self.empty = self.uneven = self.partial = self.unstamped = 0
        #: Joints with a position, but not what the servo needs besides; and those whose effort
        #: was ever a number but 0.
        self.incomplete_joints: dict[str, None] = {}
        self.effort_joints: set[str] = set()
        self.since_epoch = False

    @property
    def mostly_stamped(self) -> bool:
        """Whether most undecoded messages have a header stamp."""
        count = sum(int(np.count_nonzero(stamps)) for stamps, *_ in self.parts)
        return count > 0.5 * self._size

    @property
    def stamped(self) -> bool:
        """Whether any message has a header stamp."""
        return self.unstamped < self.count - self.empty - self.uneven - self.partial

    def add(self, received: int, message: bytes) -> None:
        """Add a serialised message, received at a time in ns; errors as of decode."""
        self.receive_times.append(received)
        self.messages.append(message)
        self._bytes += len(message)
        if len(self.messages) == BATCH_SIZE or self._bytes > BATCH_BYTES:
            self.decode()

    def decode(self) -> None:
        """Decode the pending messages.

        Raises:
            RecordingError: a message is no JointState.

        """
        received = np.array(self.receive_times, np.int64)
        try:
            efforts = self.servo is not None
            blocks = (decode_low_states(self.messages, self.order, efforts, self.kind)
                      if self.kind in MOTOR_NAMES else in_order(decode(self.messages, efforts)))
            for block in blocks:
                self._add_block(block, received[block.rows])
        except UndecodableError as error:
            raise RecordingError(
                f'{self.source}{self.topic}: message {self.count + error.index + 1} is not '
                f'a {self.kind}: {line(error)}') from error
        self.count += len(self.messages)
        self.messages, self.receive_times, self._bytes = [], [], 0

    def _add_block(self, block: SerializedBlock, received: np.ndarray) -> None:
        stamps, positions = block.stamps, block.positions
        names = self._joint_names(block.names, positions.shape[1])
        if not positions.shape[1]:
            self.empty += len(stamps)
        elif positions.shape[1] != len(names):
            self.uneven += len(stamps)
            self.example = self.example or (
                f', such as message {self.count + int(block.rows[0]) + 1}: '
                f'{positions.shape[1]} positions for {len(names)} names')
        elif self.servo and not (positions.shape == block.efforts.shape and (
                not self.servo.kd or positions.shape == block.velocities.shape)):
            self.partial += len(stamps)
            self.incomplete_joints.update(dict.fromkeys(names))
        else:
            if self.servo:
                pulling = (np.isfinite(block.efforts) & (block.efforts != 0.0)).any(axis=0)
                self.effort_joints.update(compress(names, pulling))
                positions = self.servo.command(positions, block.velocities, block.efforts)
            self.joints.update(dict.fromkeys(names))
            self.unstamped += int((stamps == 0).sum())
            self.since_epoch = self.since_epoch or bool((stamps > EPOCH_THRESHOLD).any())
            if self.selection:
                names, positions = _of_joints(self.selection, names, positions)
            self.parts.append((stamps, received, names, positions))
            self._size += len(stamps)
            if self._size >= MAX_RAW_SAMPLES:
                self._downsample()

    def _joint_names(self, names: tuple[str, ...], count: int) -> tuple[str, ...]:
        """Return the names of positions in the requested form."""
        if count and not names:
            self.unnamed = True
            return self.order if len(self.order) == count else tuple(
                f'position[{k}]' for k in range(count))
        if not self.selection or not self.selection.isdisjoint(names):
            return names
        prefixes = Counter(name[:-len(joint)] for name in names for joint in self.selection
                        if name.endswith(joint))
        (prefix, largest), *others = [*prefixes.most_common(2), ('', 0)]
        # Equally many joints under another prefix belong to another robot.
        if largest < 2 or others[0][1] == largest:
            return names
        self.prefix = prefix
        return tuple(name.removeprefix(prefix) for name in names)

    def _downsample(self) -> None:
        """Downsample the pending samples, with both clocks."""
        if not self._grids:
            self._by_headers = self.mostly_stamped
        for stamps, received, names, positions in self.parts:
            if self._by_headers and self.since_epoch and not stamps.all():
                valid = stamps != 0
                stamps, received, positions = stamps[valid], received[valid], positions[valid]
            if not len(stamps):
                continue
            clock, other = (stamps, received) if self._by_headers else (received, stamps)
            self._offset = self._offset or int(other[0] - clock[0])
            self._grids.setdefault(names, Downsampler()).add(
                clock, np.column_stack([positions, 1e-9 * (other - clock - self._offset)]))
        self.parts, self._size = [], MAX_RAW_SAMPLES

    def notes(self, headers: bool) -> list[str]:
        """Return a line for each kind of data that is dropped."""
        counts = ((self.empty, 'without positions'),
                  (self.uneven, f'with more or fewer positions than names{self.example}'),
                  (self.partial, self.servo and f'without {self.servo.needs} of each joint'),
                  (self.unstamped if headers and self.since_epoch else 0, 'without a stamp'))
        name_notes = [f'{self.topic}: the names without {self.prefix!r} before them'] * bool(
            self.prefix) + [
                f'{self.topic}: no names; ' + (
                    'the positions are taken in the order of the joints asked for or of the robot '
                    'file' if self.order else 'a robot file or --joints gives their order')
                ] * self.unnamed
        return [*name_notes, *(f'{self.topic}: {count} of {self.count} messages {text}, left out'
                  for count, text in counts if count),
                *(f'{self.topic}: {samples.note}' for samples in self._grids.values()
                  if samples.note)]

    def chunks(self, headers: bool) -> Iterator[Chunk]:
        """Yield the samples, and forget them."""
        for names, samples in self._grids.items():
            clock, values = samples.flush()
            other = clock + self._offset + np.rint(1e9 * values[:, -1]).astype(np.int64)
            pair = (clock, other) if self._by_headers else (other, clock)
            self.parts.append((*pair, names, values[:, :-1]))
        self._grids = {}
        self.parts.reverse()
        while self.parts:
            stamps, received, names, positions = self.parts.pop()
            if headers and self.since_epoch and not stamps.all():
                valid = stamps != 0
                stamps, positions = stamps[valid], positions[valid]
            names, positions = _of_joints(self.output_joints, names, positions)
            yield stamps if headers else received, names, positions


def _of_joints(joints: set[str], names: tuple[str, ...], positions: np.ndarray
               ) -> tuple[tuple[str, ...], np.ndarray]:
    """Keep the names and positions of the wanted joints; copy only if there are others."""
    if joints.issuperset(names):
        return names, positions
    columns = [k for k, name in enumerate(names) if name in joints]
    return tuple(names[k] for k in columns), positions[:, columns]


def _select_topics(streams: list[Stream], joints: Sequence[str]) -> list[str]:
    """Select one topic for every joint that is on several; return a note for each."""
    order = sorted(streams, key=lambda candidate: (
        -len(candidate.joints), candidate.topic.rsplit('/')[-1] != 'joint_states',
        -candidate.count))
    owner = {name: stream for stream in reversed(order) for name in stream.joints}
    notes = []
    for stream in streams:
        stream.output_joints = {name for name in joints if owner[name] is stream}
        for other in streams:
            common = [name for name in joints
                      if name in stream.joints and owner[name] is other is not stream]
            if common:
                notes.append(f'{stream.topic}: {joint_list(common)} taken from {other.topic}')
    return notes


def _refuse_two_robots(streams: Sequence[Stream], joint_names: Sequence[str], source: str) -> None:
    """Reject topics of two namespaces that have the same joints."""
    topic_of: dict[tuple[str, frozenset[str]], str] = {}
    for stream in streams:
        namespace, _, name = stream.topic.rpartition('/')
        joints = frozenset(stream.joints).intersection(joint_names)
        if not joints or not namespace:
            continue
        other = topic_of.setdefault((name, joints), stream.topic)
        if other != stream.topic:
            raise RecordingError(f'{source}: {other} and {stream.topic} have the same joints: '
                                 'choose a topic or a namespace (--topics)')


def _refuse_lacking(where: str, what: str, joints: list[str]) -> None:
    """Reject joints whose servo cannot be inverted."""
    if joints:
        raise RecordingError(f'{where}: no {what} of {joint_list(joints)}, and kp needs it; '
                             'name the '
                             'joints to take to do without')


def merge_streams(streams: Sequence[Stream], joints: Sequence[str], source: str,
             notes: Sequence[str] = (), some: bool = False) -> Recording:
    """Merge the streams of several topics into one recording.

    A joint on several topics is taken from the topic with the most joints; among equal ones, from
    the one named joint_states, then the one with the most messages, then the first. Samples have
    their header stamps; if all stamps of a topic are 0, all samples have their receive times.

    Args:
        streams: decoded topics; their samples are consumed.
        joints: names in the order to return; all if empty.
        source: prefix of the topics' names in messages.
        notes: initial notes.
        some: skip joints that are missing, unless all are.

    Raises:
        RecordingError: see `merged`; no message has positions, or, with a servo, a joint has no
            efforts, or only 0.

    """
    available = list(dict.fromkeys(name for stream in streams for name in stream.joints))
    topics = f'{source}{", ".join(stream.topic for stream in streams)}'
    for stream in streams:
        idle = [name for name in stream.incomplete_joints if name not in available
                and (not joints or name in joints)]
        if stream.servo:
            _refuse_lacking(f'{source}{stream.topic}', stream.servo.needs, idle)
    if not available:
        raise RecordingError('; '.join((f'{topics}: no message with positions', *notes)))
    present = [name for name in joints if name in available]
    joints = present if some and present else joints
    require(joints, available, topics)
    _refuse_two_robots(streams, joints or available, topics)
    notes = [*notes, *_select_topics(list(streams), joints or available)]
    providers = [stream for stream in streams if stream.output_joints]
    topics = f'{source}{", ".join(stream.topic for stream in providers)}'
    headers = all(stream.stamped for stream in providers)
    if not headers:
        unset = [stream.topic for stream in providers if not stream.stamped]
        notes.append(f'no header stamps on {abbreviate(unset)}: the times are those of receipt')
    elif len({stream.since_epoch for stream in providers}) > 1:
        headers = False
        undated = [stream.topic for stream in providers if not stream.since_epoch]
        notes.append(f'{abbreviate(undated)}: the stamps come from a different clock than on the '
                     "other topics, such as a simulation's: the times are those of receipt")
    for stream in providers:
        if stream.servo:
            _refuse_lacking(f'{source}{stream.topic}', 'effort but 0',
                            sorted(stream.output_joints - stream.effort_joints))
            notes.append(f'{stream.topic}: commands of the joints, computed with kp '
                         f'{stream.servo.kp:g} and kd {stream.servo.kd:g}')
        notes += stream.notes(headers)
    chunks = (chunk for stream in providers for chunk in stream.chunks(headers))
    recording = merge_chunks(chunks, topics, joints)
    return replace(recording, notes=(*notes, *recording.notes),
                   commanded=any(stream.servo for stream in providers))


# Joint states as they arrive, kept as bytes until a recording is requested.

class LiveRecording:
    """The last messages of some topics.

    Args:
        topics: their names.
        window: how long messages are kept, s; 0 for ever.

    """

    def __init__(self, topics: Sequence[str], window: float) -> None:
        self.window = window
        self._messages: dict[str, deque[tuple[int, bytes]]] = {topic: deque() for topic in topics}

    def add(self, topic: str, received: int, message: bytes) -> None:
        """Add a serialised JointState received at a time in ns; drop old ones."""
        samples = self._messages[topic]
        samples.append((received, message))
        if self.window > 0.0:
            oldest = received - int(self.window * 1e9)
            while samples[0][0] < oldest:
                samples.popleft()

    def copy(self) -> 'LiveRecording':
        """Return a copy, to be decoded while more messages arrive."""
        other = LiveRecording(tuple(self._messages), self.window)
        for topic, samples in self._messages.items():
            other._messages[topic].extend(samples)
        return other

    def recording(self, joints: Sequence[str] = (), some: bool = False,
                  servo: Servo | None = None) -> Recording:
        """Decode the kept messages.

        Args:
            joints: wanted ones; all if empty.
            some: skip joints that are missing, unless all are.
            servo: of the joints, to return their commanded angles.

        Raises:
            RecordingError: there is no message, or none can be used.

        """
        if not any(self._messages.values()):
            raise RecordingError(f'{", ".join(self._messages)}: no joint states came in')
        streams = []
        for topic, samples in self._messages.items():
            stream = Stream(topic, joints, servo)
            for received, message in samples:
                stream.add(received, message)
            stream.decode()
            streams.append(stream)
        return merge_streams(streams, joints, '', some=some)
