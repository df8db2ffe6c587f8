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

"""Joint angles out of OpenSim's motion and storage files (.mot, .sto).

Coordinates of a motion are read as joints. What is no angle is left out: translations, which no
header tells apart but their names do, and of states the speeds and the muscles'.
"""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
import re

from cpg_ros.recordings.csv_reader import read_csv
from cpg_ros.recordings.joint_patterns import matching
from cpg_ros.recordings.recording import few, Recording, RecordingError, require
from cpg_ros.recordings.recording_format import JOINTS, RecordingFormat, UNIT
from cpg_ros.recordings.stray_samples import counted
from cpg_ros.recordings.table_text import opened, preamble

#: The path of a state: '/jointset/hip_r/hip_flexion_r/value'.
STATE = re.compile(r'^(?:.*/)?([^/]+)/(value|speed|activation|fiber_length)$')
#: Names of translations and of forces, which have the columns of angles elsewhere.
NO_ANGLE = re.compile(r'_t[xyz]$|^ground_(force|torque|moment)|_(force|moment|torque)$'
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
    declared, columns, rows = _header(path)
    angles = {column: _joint(column) for column in columns
              if not NO_ANGLE.search(_joint(column)) and (
                  not (state := STATE.match(column)) or state[2] == 'value')}
    if not angles:
        raise RecordingError(f'{path}: no column of joint angles; there are {few(columns, 20)}')
    require(list(angles.values()), list(angles.values()), str(path))
    names = matching(joints, list(angles.values()), str(path))
    found = read_csv(path, unit, progress=progress, joints=[
        next(column for column, joint in angles.items() if joint == name) for name in names])
    notes = []
    if declared is None and unit is None:
        notes.append("the header has no 'inDegrees': the angles are taken to be in rad")
    left = [column for column in columns if column not in angles]
    if left:
        notes.append(f'{counted(len(left), "column")} left out, no angles: {few(left)}')
    if rows is not None and (there := len(found.times)) < rows:
        notes.append(f'{there} rows, where the header states {rows}')
    return replace(found, joints=tuple(names), notes=(*notes, *found.notes))


def _joint(column: str) -> str:
    state = STATE.match(column)
    return state[1] if state else column


def _header(path: Path) -> tuple[str | None, list[str], int | None]:
    """Return the declared unit, the columns but the time, and the number of rows if stated."""
    with opened(path) as file:
        first = file.readline()
        found = preamble(first, file) if first else None
    if found is None:
        raise RecordingError(f"{path}: no file of OpenSim: it has no line 'endheader'")
    line, _, unit, stated = found
    columns = [name.strip() for name in re.split(r'[\t,;]' if '\t' in line else r'\s+', line)]
    columns = [name for name in columns if name]
    if not columns or columns[0].lower() != 'time':
        raise RecordingError(f"{path}: the first column has to be 'time', not "
                             f'{few(columns[:1]) or "missing"}')
    return unit, columns[1:], stated


MOT = RecordingFormat(
    name='mot', contents="OpenSim's .mot or .sto",
    help='a motion (.mot) or states (.sto) of OpenSim, optionally compressed with gzip',
    metavar='FILE', read=read_mot, endings=('.mot', '.sto', '.mot.gz', '.sto.gz'),
    options=(JOINTS, UNIT), lacks={'time': 'OpenSim has seconds'})
