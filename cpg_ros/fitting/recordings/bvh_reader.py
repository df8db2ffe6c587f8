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

"""Joint angles from BVH files: each rotation channel of a joint, with the channel in its name.

The format is Biovision's: a tree of joints with their channels, then a row of numbers for each
frame, angles in degrees (Meredith & Maddock 2001).
"""

from collections.abc import Iterator, Sequence
from itertools import islice, takewhile
import math
from pathlib import Path
import re

from cpg_ros.fitting.recordings.downsampling import MAX_POSITION, pluralize
from cpg_ros.fitting.recordings.recording import (
    abbreviate,
    matching,
    Recording,
    recording_of,
    RecordingError,
    RecordingFormat,
    require,
    unwrap,
)
from cpg_ros.fitting.recordings.tables import number_in, number_rows, opened, remaining_lines
import numpy as np

CHANNELS = {f'{axis}{kind}' for axis in 'XYZ' for kind in ('rotation', 'position', 'scale')}
STATEMENT = re.compile(r'\b(ROOT|JOINT|CHANNELS)\b[ \t]*([^\n\r]*)')
#: MAX_CHANNELS: of all joints; a body with hands has 300.
MAX_TREE_LINES, MAX_CHANNELS = 200_000, 10_000


def read_bvh(path: str | Path, joints: Sequence[str] = (), progress: bool = True) -> Recording:
    """Read joint angles from a BVH file.

    Every rotation channel is a joint, named `LeftLeg_x` for the channel Xrotation of LeftLeg;
    angles are the file's Euler angles, without jumps by whole turns. Channels that do not move are
    dropped.

    Args:
        path: the file.
        joints: names in the order to return, or patterns such as 'Left*_x'; all that move if
            empty.
        progress: not used; files of minutes are read in a second.

    Raises:
        RecordingError: see `merged`; the file is not a tree with rows.

    """
    path = Path(path)
    with opened(path) as file:
        head = list(takewhile(lambda line: line.strip() != 'MOTION', islice(file, MAX_TREE_LINES)))
        if ''.join(head[:1]).split()[:1] != ['HIERARCHY']:
            raise RecordingError(f"{path}: not a BVH file: it does not begin with 'HIERARCHY'")
        count, interval, line = _motion(file, path, len(head) + 1)
        channels = _tree(''.join(head), path)
        rows, notes = number_rows(remaining_lines(file, path), [
            f'{joint} {channel}' for joint, channel in channels], None, path, line)
    if not len(rows):
        raise RecordingError(f'{path}: no frames')
    if len(rows) != count:
        notes.append(f'{pluralize(len(rows), "frame")}, where the file states {count}')
    turning = [k for k, (_, channel) in enumerate(channels) if channel.endswith('rotation')]
    names = [f'{channels[k][0]}_{channels[k][1][0].lower()}' for k in turning]
    require(names, names, str(path))
    with np.errstate(invalid='ignore'):
        angles = np.radians(rows[:, turning])
        angles[~(np.abs(angles) <= MAX_POSITION)] = np.nan
        moving = [name for name, column in zip(names, angles.T, strict=True)
                  if not (column == column[0]).all()]
    joint_names = matching(joints, names, str(path)) if joints else moving
    if not joint_names:
        raise RecordingError(f'{path}: no joint moves in {pluralize(len(rows), "frame")}')
    if not joints and len(moving) < len(names):
        notes.append(f'{pluralize(len(names) - len(moving), "channel")} left out: no motion')
    stamps = np.rint(np.arange(len(rows)) * interval * 1e9).astype(np.int64)
    return recording_of(path, stamps, names, unwrap(angles), notes, joint_names)


def _tree(text: str, path: Path) -> list[tuple[str, str]]:
    """Return joint and channel of each column."""
    channels: list[tuple[str, str]] = []
    joint = ''
    for kind, value in STATEMENT.findall(text):
        if kind != 'CHANNELS':
            joint = value.partition('{')[0].strip().rpartition(':')[2]
            if not joint:
                raise RecordingError(f'{path}: a {kind} without a name')
            continue
        count, *names = value.split() or ['']
        if count != str(len(names)) or not set(names) <= CHANNELS or not joint:
            raise RecordingError(f'{path}: the channels of {joint or "nothing"!r}, '
                                 f'{abbreviate([count, *names])}, are no number and as many '
                                 'names such as Xrotation')
        channels += [(joint, channel) for channel in names]
    if text.count('{') != text.count('}'):
        raise RecordingError(f'{path}: not as many braces close as open in its tree of joints')
    if len(channels) > MAX_CHANNELS or not any(channel.endswith('rotation')
                                               for _, channel in channels):
        raise RecordingError(f'{path}: {pluralize(len(channels), "channel")}, where joints that '
                             f'turn have up to {MAX_CHANNELS}')
    return channels


def _motion(file: Iterator[str], path: Path, number: int) -> tuple[int, float, int]:
    """Return the number of frames, their interval (s), and the number of the next line."""
    values: dict[str, float] = {}
    for line in islice(file, 10):
        number += 1
        name, mark, value = line.partition(':')
        if mark and (header_value := number_in(value)) is not None:
            values[' '.join(name.lower().split())] = header_value
        elif mark:
            raise RecordingError(f'{path}, line {number}: {value.strip()[:40]!r} is not a number')
        if 'frame time' in values:
            break
    else:
        raise RecordingError(
            f"{path}: not a BVH file: no line 'MOTION' follows the tree of joints")
    count, interval = values.get('frames', math.nan), values['frame time']
    if not (0.0 <= count < 1e9 and 1e-6 <= interval <= 10.0):
        raise RecordingError(f"{path}: after 'MOTION', 'Frames:' and 'Frame Time:' (1e-6 to 10 s) "
                             f'have to follow, not {count:g} and {interval:g}')
    return int(count), interval, number + 1


BVH = RecordingFormat(
    name='bvh', contents='a BVH file', help='joint rotations, as motion capture writes them',
    metavar='FILE', read=read_bvh, endings=('.bvh',),
    lacks={'unit': 'BVH files have degrees', 'time': 'BVH files have seconds'})
