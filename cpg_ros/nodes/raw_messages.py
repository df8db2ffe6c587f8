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

"""Finds the numbers in messages that were taken as bytes.

The bytes are CDR: four of encapsulation, then the fields, each aligned to its size.
"""

from collections.abc import Sequence
import struct

import numpy as np
from rclpy.serialization import deserialize_message
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64MultiArray

#: Bytes of the encapsulation, from behind which everything is aligned.
HEADER = 4


def stamp_of(data: bytes) -> float | None:
    """Return the stamp of a message that begins with a header, s; None for none."""
    seconds, nanoseconds = struct.unpack_from('<iI' if data[1] & 1 else '>iI', data, HEADER)
    return seconds + 1e-9 * nanoseconds if seconds or nanoseconds else None


def numbers_at(data: bytes, begin: int, count: int) -> np.ndarray:
    """Return the doubles from a byte on, read-only, shape (count,).

    Raises:
        ValueError: the message is shorter.

    """
    if data[1] & 1:
        return np.frombuffer(data, float, count, begin)
    swapped = np.frombuffer(data, '>f8', count, begin).astype(float)
    swapped.flags.writeable = False
    return swapped


def last_numbers(data: bytes, count: int) -> np.ndarray:
    """Return the doubles at the end of a message; as numbers_at."""
    return numbers_at(data, len(data) - 8 * count, count)


class JointLayout:
    """The layout of a publisher's joint states, the same for all messages with the same names.

    Attributes:
        wrong: why the messages cannot be used, or ''.
        position, velocity, effort: the byte at which the joints' doubles begin, in the message's
            own order; None where there are none.
        count: of the joints in a message.
        places: index of each wanted joint in the message, shape (joints,).

    """

    def __init__(self, data: bytes, wanted: Sequence[str]) -> None:
        message = deserialize_message(data, JointState)
        names = list(message.name)
        missing = [name for name in wanted if names.count(name) != 1]
        self.wrong = f'no joint {missing[0]}, or more than one' if missing else ''
        self.places = np.array([] if missing else [names.index(name) for name in wanted], int)
        self._length, self.count = len(data), len(names)
        # What shows that another message has the same layout: names and counts.
        self._same: list[tuple[slice, bytes]] = [(slice(1, 2), data[1:2])]
        end = HEADER + 8

        def keep(size: int) -> None:
            nonlocal end
            self._same.append((slice(end, end + size), data[end:end + size]))
            end += size

        def text(value: str) -> None:
            keep(4 + len(value.encode()) + 1)
            align(4)

        def align(size: int) -> None:
            nonlocal end
            end += (HEADER - end) % size

        text(message.header.frame_id)
        keep(4)
        for name in names:
            text(name)
        parts: list[int | None] = []
        for numbers in (message.position, message.velocity, message.effort):
            align(4)
            keep(4)
            if len(numbers):
                align(8)
            whole = len(numbers) == len(names) and len(names) > 0
            parts.append(end if whole else None)
            end += 8 * len(numbers)
        self.position, self.velocity, self.effort = parts
        if not self.wrong:
            for part, what in ((self.position, 'positions'), (self.velocity, 'velocities')):
                if part is None:
                    self.wrong = f'no {what}'
                    break
        # The names and what is between them, at once: the bytes that align them are mostly alike.
        first, last = self._same[1][0].start, self._same[-1][0].stop
        middle = slice(first, self.position if self.position is not None else last)
        self._quick = [(part, data[part]) for part in (
            slice(1, 2), middle, *(part for part, _ in self._same if part.start >= middle.stop))]

    def fits(self, data: bytes) -> bool:
        """Tell whether another message has the same layout."""
        if len(data) != self._length:
            return False
        for part, known in self._quick:
            if data[part] != known:
                return all(data[part] == known for part, known in self._same)
        return True


def legs_of(data: bytes, legs: Sequence[str]) -> np.ndarray:
    """Return the index of each leg among the numbers of a Float64MultiArray, shape (legs,).

    Its first dimension's label may name them, with commas in between; otherwise they come in
    the given order.

    Raises:
        ValueError: it has not one number a leg.

    """
    message = deserialize_message(data, Float64MultiArray)
    if len(message.data) != len(legs):
        raise ValueError(f'{len(message.data)} numbers for {len(legs)} legs')
    labels = message.layout.dim[0].label.split(',') if message.layout.dim else []
    if sorted(labels) == sorted(legs):
        return np.array([labels.index(leg) for leg in legs])
    return np.arange(len(legs))
