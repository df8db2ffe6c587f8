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

"""Joint angles from OpenSim's motion and storage files (.mot, .sto), and markers from TRC files.

Coordinates of a motion are read as joints. Coordinates that are no angles are dropped:
translations, which only their names distinguish, and in files of states speeds and muscles.
"""

from collections.abc import Sequence
from dataclasses import replace
import math
from pathlib import Path
import re

from cpg_ros.fitting.recordings.csv_reader import read_csv
from cpg_ros.fitting.recordings.downsampling import pluralize
from cpg_ros.fitting.recordings.markers import (
    joint_recording,
    LENGTH_UNITS,
    marker_names,
    Markers,
    SEGMENTS,
)
from cpg_ros.fitting.recordings.recording import (
    abbreviate,
    ANGLE_UNITS,
    JOINTS,
    matching,
    MAX_TIME,
    Recording,
    RecordingError,
    RecordingFormat,
    require,
    UNIT,
)
from cpg_ros.fitting.recordings.tables import number_rows, opened, preamble, remaining_lines
import numpy as np

# Markers out of TRC files (track row column), as OpenSim and Motion Analysis write them.

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

    A marker whose cells are empty, or all 0, is missing. Lengths stay in the file's unit.

    Raises:
        RecordingError: the file has no such header, or rows of another width.

    """
    path = Path(path)
    with opened(path) as file:
        head = [file.readline() for _ in range(5)]
        rest = remaining_lines(file, path)
    if not head[0].startswith('PathFileType'):
        raise RecordingError(f"{path}: not a TRC file: it does not begin with 'PathFileType'")
    keys, values = (line.split() for line in head[1:3])
    facts = dict(zip(keys, values, strict=False))
    cells = [cell.strip() for cell in head[3].rstrip('\r\n').split('\t')]
    if len(cells) < 3 or cells[0].lower() != 'frame#' or not cells[1].lower().startswith('time'):
        raise RecordingError(f"{path}, line 4: the columns have to be 'Frame#', 'Time' and the "
                             f'markers, with tabs between, not {abbreviate(cells)}')
    labels = [cell for cell in cells[2:] if cell]
    count = facts.get('NumMarkers')
    rows, notes = number_rows(rest, ['Frame#', 'Time', *(
        f'{label} {axis}' for label in labels for axis in 'XYZ')], '\t', path, 6)
    if count != str(len(labels)):
        notes.append(f'{pluralize(len(labels), "marker")}, where NumMarkers is '
                     f'{count or "missing"}')
    if not len(rows):
        raise RecordingError(f'{path}: no rows')
    if facts.get('NumFrames') != str(len(rows)):
        notes.append(f'{pluralize(len(rows), "row")}, where NumFrames is '
                     f'{facts.get("NumFrames", "missing")}')
    seconds = rows[:, 1]
    wrong = ~(np.abs(seconds) < MAX_TIME)
    if wrong.any():
        raise RecordingError(f"{path}: {pluralize(int(wrong.sum()), 'row')} without a time in s, "
                             f'such as frame {rows[np.argmax(wrong), 0]:g}')
    points = rows[:, 2:].reshape(len(rows), -1, 3)
    unseen = (points == 0.0).all(axis=2)
    points[unseen] = np.nan
    names, doubles = marker_names(labels, points)
    return Markers(names, np.rint(seconds * 1e9).astype(np.int64), points, path,
                   notes=(*notes, *doubles),
                   unit=LENGTH_UNITS.get(facts.get('Units', ''), math.nan))


TRC = RecordingFormat(
    name='trc', contents="markers in OpenSim's .trc", help='markers in three dimensions',
    metavar='FILE', read=read_trc, endings=('.trc', '.trc.gz'), options=(JOINTS, SEGMENTS),
    lacks={'unit': 'markers have no angles', 'time': 'TRC files have seconds'})


#: STATE: path of a state: '/jointset/hip_r/hip_flexion_r/value'.
STATE = re.compile(r'^(?:.*/)?([^/]+)/(value|speed|activation|fiber_length)$')
#: PELVIS: name of a translation of the pelvis, m; its group is the axis.
PELVIS = re.compile(r'^(?:.*/)?pelvis_t([xyz])(?:/value)?$')
#: NON_ANGLE: names of translations and forces, whose columns look like those of angles.
NON_ANGLE = re.compile(r'_t[xyz]$|^ground_(force|torque|moment)|_(force|moment|torque)$'
                       r'|_[fmp][xyz]$|force_v?[xyz]|force_p[xyz]', re.I)


def read_mot(path: str | Path, unit: str | None = None, joints: Sequence[str] = (),
             progress: bool = True) -> Recording:
    """Read joint angles from a motion or storage file of OpenSim, packed by gzip or not.

    The header's ``inDegrees`` gives the unit; files of states have none, and are in rad. A state's
    joint has the name of its coordinate.

    Args:
        path: the file.
        unit: 'rad' or 'deg', where the header does not say.
        joints: the joints to take, in this order, or patterns such as 'knee*'; all of them, if
            empty.
        progress: show a progress bar.

    Raises:
        RecordingError: see `read_csv`; no header of OpenSim, or no column of angles.

    """
    path = Path(path)
    header, columns, rows = _header(path)
    # Speeds of states are called like their coordinate, with '_u' behind.
    speeds = {f'{column}_u' for column in columns}
    angles = {column: _joint(column) for column in columns
              if column not in speeds and not NON_ANGLE.search(_joint(column)) and (
                  not (state := STATE.match(column)) or state[2] == 'value')}
    if not angles:
        raise RecordingError(f'{path}: no column of joint angles; there are '
                             f'{abbreviate(columns, 20)}')
    require(list(angles.values()), list(angles.values()), str(path))
    names = matching(joints, list(angles.values()), str(path))
    # As it is no angle, the unit of angles does not hold for the pelvis. Models in a plane have
    # no z.
    body = {match[1]: column for column in columns if (match := PELVIS.match(column))}
    recording = read_csv(path, unit, progress=progress, joints=[*(
        next(column for column, joint in angles.items() if joint == name) for name in names),
        *body.values()])
    scale = ANGLE_UNITS[header or unit or 'rad']
    place = dict(zip(body, recording.positions[:, len(names):].T / scale, strict=True))
    recording = replace(recording, joints=tuple(names),
                        positions=recording.positions[:, :len(names)],
                    body=np.column_stack([place.get(axis, 0.0 * place['y']) for axis in 'xzy'])
                    if 'y' in place and np.isfinite([*place.values()]).all() else None)
    notes: list[str] = []
    if header is None and unit is None:
        notes.append("the header has no 'inDegrees': the angles are taken to be in rad")
    ignored = [column for column in columns if column not in angles]
    if ignored:
        notes.append(f'{pluralize(len(ignored), "column")} left out, no angles: '
                     f'{abbreviate(ignored)}')
    if rows is not None and (num_rows := len(recording.times)) < rows:
        notes.append(f'{num_rows} rows, where the header states {rows}')
    return replace(recording, notes=(*notes, *recording.notes))


def _joint(column: str) -> str:
    state = STATE.match(column)
    return state[1] if state else column


def _header(path: Path) -> tuple[str | None, list[str], int | None]:
    """Return the declared unit, the columns but the time, and the number of rows if stated."""
    with opened(path) as file:
        first = file.readline()
        header = preamble(first, file) if first else None
    if header is None:
        raise RecordingError(f"{path}: not a file of OpenSim: it has no line 'endheader'")
    line, _, unit, counts = header
    columns = [name.strip() for name in re.split(r'[\t,;]' if '\t' in line else r'\s+', line)]
    columns = [name for name in columns if name]
    if not columns or columns[0].lower() != 'time':
        raise RecordingError(f"{path}: the first column has to be 'time', not "
                             f'{abbreviate(columns[:1]) or "missing"}')
    return unit, columns[1:], counts


MOT = RecordingFormat(
    name='mot', contents="OpenSim's .mot or .sto",
    help='a motion (.mot) or states (.sto) of OpenSim, optionally compressed with gzip',
    metavar='FILE', read=read_mot, endings=('.mot', '.sto', '.mot.gz', '.sto.gz'),
    options=(JOINTS, UNIT), lacks={'time': 'OpenSim has seconds'})
