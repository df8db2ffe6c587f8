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

"""JointState messages decoded in bulk from their CDR bytes.

The messages of a publisher mostly share one layout: frame, names and lengths are the same bytes at
the same offsets, and only the stamp and the numbers differ. The positions of many messages then
are one strided array. The library decodes the first message of a layout, which gives the offsets;
every other message is compared with it in all bytes of the layout. Padding is not initialised and
never compared. The library decodes messages of rare layouts.
"""

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from typing import Any

from cpg_ros.common.errors import CpgError, ShortRepr
from cpg_ros.fitting.recordings.bag_library import deserialize, SerdeError
import numpy as np

JOINT_STATE = 'sensor_msgs/msg/JointState'
#: MAX_LAYOUTS: of a batch that are decoded in bulk; other messages are decoded singly.
MAX_LAYOUTS = 8
#: FIELDS: arrays of a message, in its order.
FIELDS = ('position', 'velocity', 'effort')
#: HEADER_SIZE: bytes before the body: representation, of which the library reads two bytes, and
#: options.
HEADER_SIZE = 4


class UndecodableError(CpgError):
    """Message `index` of a batch is no JointState."""

    def __init__(self, index: int, reason: str) -> None:
        super().__init__(reason)
        self.index = index


@dataclass(frozen=True, eq=False, repr=False)
class SerializedBlock(ShortRepr):
    """Messages with the same names.

    Attributes:
        rows: indices in the batch, shape (n,), ascending.
        stamps: of the headers, ns, shape (n,), int64.
        names: of the joints, as in the messages.
        positions: shape (n, positions); a message may have more or fewer than names.
        velocities, efforts: same shape, rad/s and N m; of width 0 if not requested.

    """

    rows: np.ndarray
    stamps: np.ndarray
    names: tuple[str, ...]
    positions: np.ndarray
    velocities: np.ndarray
    efforts: np.ndarray


def decode(messages: Sequence[bytes], efforts: bool = False) -> Iterator[SerializedBlock]:
    """Decode a batch of serialised JointState messages.

    Args:
        messages: as received.
        efforts: decode velocities and efforts, too.

    Raises:
        UndecodableError: a message is damaged or of another type.

    """
    fields = FIELDS if efforts else FIELDS[:1]
    pending = np.arange(len(messages))
    lengths = np.fromiter(map(len, messages), np.intp, len(messages))
    for _ in range(MAX_LAYOUTS):
        if not pending.size:
            return
        layout = _Layout(messages, int(pending[0]))
        same_length = lengths[pending] == layout.length
        rows = pending[same_length]
        data = b''.join(messages if len(rows) == len(messages) else
                        [messages[k] for k in rows])
        fits = layout.fits(data)
        stamps, numbers = layout.read(data, fields)
        if fits.all():
            pending = pending[~same_length]
        else:
            rows, stamps, numbers = rows[fits], stamps[fits], [array[fits] for array in numbers]
            pending = np.setdiff1d(pending, rows, assume_unique=True)
        yield SerializedBlock(rows, stamps, layout.names, *numbers)
    for k in pending.tolist():
        message = _decode_one(messages, k)
        stamp = message.header.stamp
        yield SerializedBlock(np.array([k]), np.array([stamp.sec * 10**9 + stamp.nanosec]),
                              tuple(message.name), *(
                        np.array(getattr(message, which) if which in fields else (), float)[None]
                        for which in FIELDS))


def in_order(blocks: Iterable[SerializedBlock]) -> Iterator[SerializedBlock]:
    """Join blocks of equal names and widths, and restore the order of the batch.

    Such blocks can differ in byte order, or in the frame's name.
    """
    groups: dict[tuple, list[SerializedBlock]] = {}
    for block in blocks:
        widths = (array.shape[1] for array in (block.positions, block.velocities, block.efforts))
        groups.setdefault((block.names, *widths), []).append(block)
    for group in groups.values():
        if len(group) == 1:
            yield group[0]
            continue
        order = np.argsort(np.concatenate([block.rows for block in group]))
        rows, stamps, *numbers = (np.concatenate([getattr(block, name) for block in group])[order]
                                  for name in ('rows', 'stamps', 'positions', 'velocities',
                                               'efforts'))
        yield SerializedBlock(rows, stamps, group[0].names, *numbers)


def _decode_one(messages: Sequence[bytes], index: int) -> Any:
    try:
        return deserialize(messages[index])
    except SerdeError as error:
        raise UndecodableError(index, str(error)) from error


class _Layout:
    """Places of a message's fields, and its bytes other than stamp, numbers and padding."""

    def __init__(self, messages: Sequence[bytes], index: int) -> None:
        message, first = _decode_one(messages, index), messages[index]
        self.length = len(first)
        self.names = tuple(message.name)
        self.order = '<' if first[1] else '>'
        fixed = np.zeros(self.length, bool)
        fixed[:2] = True
        end = HEADER_SIZE + 8

        def text(value: str) -> None:
            nonlocal end
            begin = end
            end += 4 + len(value.encode()) + 1
            fixed[begin:end] = True
            end += -end % 4

        def number() -> None:
            nonlocal end
            fixed[end:end + 4] = True
            end += 4

        text(message.header.frame_id)
        number()
        for name in self.names:
            text(name)
        #: Field -> where its numbers are, and how many.
        self.spans: dict[str, tuple[int, int]] = {}
        for which in FIELDS:
            number()
            count = len(getattr(message, which))
            if count:
                end += (HEADER_SIZE - end) % 8
            self.spans[which] = end, count
            end += 8 * count
        # Bytes are compared as words of four, which all of these but the first fill or pad.
        words = self.length // 4
        mask = np.where(fixed[:4 * words], 255, 0).astype(np.uint8).view(np.uint32)
        self.words = np.flatnonzero(mask)
        self.mask = mask[self.words]
        self.value = np.frombuffer(first, np.uint32, words)[self.words] & self.mask

    def _array(self, data: bytes, kind: str, offset: int, width: int) -> np.ndarray:
        """Return the values of every message at an offset; a view, unaligned."""
        dtype = np.dtype(kind)
        return np.ndarray((len(data) // self.length, width), dtype, data, offset,
                          (self.length, dtype.itemsize))

    def fits(self, data: bytes) -> np.ndarray:
        """Return which messages of this length have this layout."""
        words = self._array(data, '=u4', 0, self.length // 4)[:, self.words]
        return ((words & self.mask) == self.value).all(axis=1)

    def read(self, data: bytes, fields: Sequence[str]) -> tuple[np.ndarray, list[np.ndarray]]:
        """Return stamps and the numbers of all fields, copied; of width 0 if not requested."""
        seconds = self._array(data, self.order + 'i4', HEADER_SIZE, 1)[:, 0].astype(np.int64)
        nanoseconds = self._array(data, self.order + 'u4', HEADER_SIZE + 4, 1)[:, 0]
        return seconds * 10**9 + nanoseconds, [
            self._array(data, self.order + 'f8', place, count if which in fields else 0)
            .astype(np.float64) for which, (place, count) in self.spans.items()]
