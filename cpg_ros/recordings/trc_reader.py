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

"""Markers out of TRC files (track row column), as OpenSim and Motion Analysis write them."""

from collections.abc import Sequence
from pathlib import Path

from cpg_ros.recordings.markers import joint_recording, Markers
from cpg_ros.recordings.number_rows import number_rows
from cpg_ros.recordings.recording import few, LATEST, Recording, RecordingError
from cpg_ros.recordings.recording_format import JOINTS, RecordingFormat
from cpg_ros.recordings.segments import SEGMENTS
from cpg_ros.recordings.stray_samples import counted
from cpg_ros.recordings.table_text import opened, remaining_lines
import numpy as np


def read_trc(path: str | Path, segments: str | Path | None = None, joints: Sequence[str] = (),
             progress: bool = True) -> Recording:
    """Read the joint angles between the markers of a TRC file.

    Args:
        path: the file.
        segments: which markers span which segment; see `load_segments`.
        joints: of these, in this order; all of them, if empty.
        progress: not used.

    Raises:
        RecordingError: see `trc_markers` and `joint_recording`.

    """
    return joint_recording(trc_markers(path), segments, joints)


def trc_markers(path: str | Path) -> Markers:
    """Read the markers of a TRC file.

    A marker whose cells are empty, or all three 0, was not seen. Lengths stay in the file's unit.

    Raises:
        RecordingError: a file that has no such header, or rows of another width.

    """
    path = Path(path)
    with opened(path) as file:
        head = [file.readline() for _ in range(5)]
        rest = remaining_lines(file, path)
    if not head[0].startswith('PathFileType'):
        raise RecordingError(f"{path}: no TRC file: it does not begin with 'PathFileType'")
    keys, values = (line.split() for line in head[1:3])
    facts = dict(zip(keys, values, strict=False))
    cells = [cell.strip() for cell in head[3].rstrip('\r\n').split('\t')]
    if len(cells) < 3 or cells[0].lower() != 'frame#' or not cells[1].lower().startswith('time'):
        raise RecordingError(f"{path}, line 4: the columns have to be 'Frame#', 'Time' and the "
                             f'markers, with tabs between, not {few(cells)}')
    names = tuple(cell.rpartition(':')[2] for cell in cells[2:] if cell)
    stated = facts.get('NumMarkers')
    if stated != str(len(names)):
        raise RecordingError(f'{path}, line 4: {counted(len(names), "marker")}, where '
                             f'NumMarkers is {stated or "missing"}')
    rows, notes = number_rows(rest, '\t', 2 + 3 * len(names), path, 6)
    if not len(rows):
        raise RecordingError(f'{path}: no rows')
    if facts.get('NumFrames') != str(len(rows)):
        notes.append(f'{counted(len(rows), "row")}, where NumFrames is '
                     f'{facts.get("NumFrames", "missing")}')
    seconds = rows[:, 1]
    wrong = ~(np.abs(seconds) < LATEST)
    if wrong.any():
        raise RecordingError(f"{path}: {counted(int(wrong.sum()), 'row')} without a time in s, "
                             f'such as frame {rows[np.argmax(wrong), 0]:g}')
    points = rows[:, 2:].reshape(len(rows), -1, 3)
    unseen = (points == 0.0).all(axis=2)
    points[unseen] = np.nan
    return Markers(names, np.rint(seconds * 1e9).astype(np.int64), points, path,
                   notes=tuple(notes))


TRC = RecordingFormat(
    name='trc', contents="markers in OpenSim's .trc", help='markers in three dimensions',
    metavar='FILE', read=read_trc, endings=('.trc', '.trc.gz'), options=(JOINTS, SEGMENTS),
    lacks={'unit': 'markers have no angles', 'time': 'TRC files have seconds'})
