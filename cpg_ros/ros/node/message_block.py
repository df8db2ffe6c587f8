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

"""Messages that are serialised once; every tick writes the numbers into the bytes."""

from array import array
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
import ctypes
from dataclasses import dataclass, field
from importlib import import_module
from itertools import pairwise
from pathlib import Path
from typing import Any

from ament_index_python.packages import get_package_share_directory, PackageNotFoundError
from cpg_ros.common.errors import CpgError
from cpg_ros.ros.node import native
from cpg_ros.ros.node.polled import OVERRIDABLE
import numpy as np
from rclpy.node import Node
from rclpy.qos import QoSProfile
from rclpy.serialization import deserialize_message, serialize_message

# Message types by name: the class, and the text of the fields.

class UnknownType(CpgError):
    """A message type is not installed here; one line."""

    exit_code = 1


def message_class(kind: str) -> Any:
    """Return the class of a type such as sensor_msgs/msg/JointState.

    Raises:
        UnknownType: its package is not installed.

    """
    package, _, name = kind.partition('/msg/')
    try:
        return getattr(import_module(f'{package}.msg'), name)
    except (ImportError, AttributeError):
        raise UnknownType(f'the type {kind} is not installed here') from None


def message_fields(kind: str) -> str:
    """Return the text of a type's .msg file.

    Raises:
        UnknownType: its package does not have it.

    """
    package, _, name = kind.partition('/msg/')
    try:
        return (Path(get_package_share_directory(package)) / 'msg' / f'{name}.msg').read_text()
    except (PackageNotFoundError, OSError):
        raise UnknownType(f'the fields of {kind} are not known here') from None


#: WORD_SIZE: alignment of an integer in CDR, and size of the encapsulation of a message, bytes.
WORD_SIZE = 4
#: Indices of words. STAMP, DURATION: seconds and nanoseconds; NUMBERS: first word of the numbers.
STAMP, DURATION, NUMBERS = (0, 1), (2, 3), 4


@dataclass
class Template:
    """A message with numbers that change.

    Attributes:
        message: with everything else filled in.
        stamps, durations: parts with ``sec`` and ``nanosec``.
        numbers: part, name of its field (a double or a sequence of doubles), and indices of its
            numbers in the block.

    """

    message: object
    stamps: Sequence[Any] = ()
    durations: Sequence[Any] = ()
    numbers: list[tuple[object, str, np.ndarray]] = field(default_factory=list)

    def serialised(self) -> tuple[bytes, np.ndarray, np.ndarray]:
        """Return the bytes, the indices of the words that change, and their words in the block.

        Each changing number gets a unique value, which is then found in the bytes, so that the
        middleware's layout need not be known.

        Raises:
            ValueError: a value is not found, or not at the begin of a word.

        """
        marks: list[tuple[bytes, np.ndarray]] = []
        for part, source in ([(part, STAMP) for part in self.stamps]
                             + [(part, DURATION) for part in self.durations]):
            part.sec, part.nanosec = 0x2D5A0000 + len(marks), 0x1B3C5E71
            times = np.array([part.sec, part.nanosec], dtype=np.uint32)
            marks.append((times.tobytes(), np.array(source)))
        count = 0
        for part, name, sources in self.numbers:
            values = 1.2345678912345e200 * (1.0 + 1e-3 * np.arange(count, count + len(sources)))
            count += len(sources)
            listed = array('d', values)
            setattr(part, name, listed[0] if isinstance(getattr(part, name), float) else listed)
            marks.append((values.tobytes(), (NUMBERS + 2 * np.asarray(sources)[:, None]
                                             + np.arange(2)).ravel()))
        raw = _exact(self.message)
        words = []
        for mark, sources in marks:
            at = raw.find(mark)
            if raw.count(mark) != 1 or at % WORD_SIZE:
                raise ValueError(f'{type(self.message).__name__}: cannot be filled in place, as '
                                 'this middleware serialises it')
            words.append(at // WORD_SIZE + np.arange(len(sources)))
        return raw, np.concatenate(words), np.concatenate([sources for _, sources in marks])


def indices(sizes: Sequence[int]) -> list[np.ndarray]:
    """Return the indices of each part of a block, given the sizes of the parts."""
    return [np.arange(*edge) for edge in pairwise(np.cumsum([0, *sizes]))]


def each(message: object, fields: str, arrays: np.ndarray
         ) -> list[tuple[object, str, np.ndarray]]:
    """Return the numbers of a message's scalar fields, each named by one letter."""
    return [(message, field, arrays[k:k + 1]) for k, field in enumerate(fields)]


def _exact(message: Any) -> bytes:
    """Serialise a message without the padding that rclpy's serialiser may append.

    Typed messages are published without it, and strict readers of bags reject it.
    """
    raw: bytes = serialize_message(message)
    while True:
        try:
            if deserialize_message(raw[:-1], type(message)) != message:
                return raw
        except Exception:  # too short: what the middleware raises has no common kind
            return raw
        raw = raw[:-1]


class MessageBlock:
    """Publisher of messages in one block of memory, filled by one assignment.

    Attributes:
        topics: of the messages, resolved.

    """

    def __init__(self, node: Node, sizes: Sequence[int],
                 templates: Sequence[tuple[str, Template]]) -> None:
        """Create a publisher for each message.

        Args:
            node: that publishes.
            sizes: of the parts of the array that fills the messages.
            templates: topic and message, in the order of publishing.

        """
        self._words = np.zeros(NUMBERS + 2 * sum(sizes), dtype=np.uint32)
        values = self._words[NUMBERS:].view(float)
        self._parts = [values[slice(*edge)] for edge in pairwise(np.cumsum([0, *sizes]))]
        self.topics: list[str] = []
        self._handles: list[Any] = []
        raws, changing, sources = zip(*(template.serialised() for _, template in templates),
                                    strict=True)
        starts = np.cumsum([0, *(-(-len(raw) // WORD_SIZE) for raw in raws)])
        memory = bytearray(WORD_SIZE * int(starts[-1]))
        self._block = np.frombuffer(memory, dtype=np.uint32)
        self._targets = np.concatenate([start + here for start, here
                                       in zip(starts[:-1], changing, strict=True)])
        self._sources = np.concatenate(sources)
        for (topic, template), raw, start in zip(templates, raws, WORD_SIZE * starts[:-1],
                                                 strict=True):
            memory[start:start + len(raw)] = raw
            publisher = node.create_publisher(
                type(template.message), topic, QoSProfile(depth=100),
                qos_overriding_options=OVERRIDABLE)
            self._handles.append(publisher.handle)
            self.topics.append(publisher.topic_name)
        self._native = self._native_block([len(raw) for raw in raws])
        self._sizes = np.array(sizes, dtype=np.int64)
        self._output = native.Output(first=1.0)

    def _native_block(self, lengths: Sequence[int]) -> native.SerializedMessages:
        """Return what ``tick.c`` fills and publishes: messages of so many bytes."""
        start = at = self._block.ctypes.data
        # Kept as long as the struct that points there.
        self._messages = (native.Serialized * len(lengths))()
        self._pointers = np.array([handle.pointer for handle in self._handles], dtype=np.uint64)
        for message, length in zip(self._messages, lengths, strict=True):
            message.buffer, message.length, message.capacity = at, length, length
            at += -(-length // WORD_SIZE) * WORD_SIZE
        self._library = native.library()
        return native.SerializedMessages(
            native.address('rcl_publish_serialized_message'), self._pointers.ctypes.data,
            ctypes.addressof(self._messages), start, self._words.ctypes.data,
            self._targets.ctypes.data, self._sources.ctypes.data, len(self._handles),
            len(self._targets))

    def publish(self, stamp: int, values: Sequence[np.ndarray], duration: int = 0) -> None:
        """Publish all messages.

        Args:
            stamp: ns.
            values: of each part.
            duration: ns.

        Raises:
            MiddlewareError: the middleware refuses one.

        """
        for part, given in zip(self._parts, values, strict=True):
            part[:] = given
        with self.held():
            sent = self._library.publish(ctypes.byref(self._native), stamp, duration)
        if sent < len(self._handles):
            raise native.middleware_error()

    @contextmanager
    def held(self) -> Iterator[None]:
        """Keep the publishers alive, in case another thread destroys the node."""
        for handle in self._handles:
            handle.__enter__()
        try:
            yield
        finally:
            for handle in self._handles:
                handle.__exit__(None, None, None)

    def feed(self, *arrays: int | np.ndarray, period: float = 0.0, quiet: bool = False,
             while_not_0: np.ndarray | None = None) -> 'MessageBlock':
        """Say from where ``tick.c`` fills the messages, and when; return the block.

        Args:
            arrays: arrays that have the numbers of each part, or addresses of pointers to these.
            period: between two publications, s; 0 for every tick.
            quiet: publish as the first number changes, and else only while it is not 1.
            while_not_0: publish only while this number, shape (1,), is not 0.

        """
        self._period, self._gate = period, while_not_0
        self._kept = arrays
        self._fixed = np.array([array.ctypes.data if isinstance(array, np.ndarray) else 0
                                for array in arrays], dtype=np.uint64)
        self._from = np.array([self._fixed[k:].ctypes.data if isinstance(array, np.ndarray) else
                               array for k, array in enumerate(arrays)], dtype=np.uint64)
        self._output = native.Output(
            ctypes.addressof(self._native), self._from.ctypes.data, self._sizes.ctypes.data,
            len(arrays), 1, self._output.since, quiet,
            None if while_not_0 is None else while_not_0.ctypes.data, self._output.first)
        return self

    def output(self, rate: float) -> int:
        """Return the address of the struct of ``tick.c``, for a rate of ticks in Hz."""
        self._output.every = max(1, round(rate * self._period))
        return ctypes.addressof(self._output)
