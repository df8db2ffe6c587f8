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

"""Markers from files of pose estimation: DeepLabCut, SLEAP, Anipose.

DeepLabCut (and Lightning Pose): tables with three or four rows of headers, scorer, individuals,
bodyparts, coords (Nath et al. 2019), and the same by pandas in HDF5. SLEAP's analysis: tables with
one row of headers, `nose.x`, `nose.y`, `nose.score`, and arrays in HDF5 (Pereira et al. 2022).
Anipose: `nose_x`, `nose_y`, `nose_z`, `nose_score`, and the frame in `fnum`.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field
from io import BytesIO
from itertools import islice
import json
from pathlib import Path
import pickle
import re
from typing import Any

from cpg_ros.common.errors import needed
from cpg_ros.fitting.recordings.markers import joint_recording, Markers, SEGMENTS
from cpg_ros.fitting.recordings.reader_process import read_in_process, UnreadableFile
from cpg_ros.fitting.recordings.recording import (
    abbreviate,
    JOINTS,
    Option,
    Recording,
    RecordingError,
    RecordingFormat,
)
from cpg_ros.fitting.recordings.tables import (
    cells_of,
    FPS,
    number_rows,
    opened,
    remaining_lines,
    stamps_of_frames,
    UnpackedSize,
)
import numpy as np

INDIVIDUAL = Option('individual', 'of a table of several animals, the one to read', 'NAME')
#: COLUMN: header of a table with one row of headers: marker, coordinate.
COLUMN = re.compile(r'(.+)[._](x|y|z|score|likelihood)')
#: Columns of frame numbers and of animals in these tables.
FRAME_COLUMNS, TRACK_COLUMN = ('frame_idx', 'fnum'), 'track'
#: HEADER_ROWS: first cells of DeepLabCut's rows of headers.
HEADER_ROWS = ('scorer', 'individuals', 'bodyparts', 'coords')


@dataclass
class _Poses:
    """Numbers by animal ('' for the only one), marker and coordinate.

    Attributes:
        path: of the file.
        columns: animal, marker and coordinate of each column; None for other columns.
        rows: shape (n, columns).
        frames: their numbers, shape (n,).
        notes: one line each.

    """

    path: Path
    columns: Sequence[tuple[str, str, str] | None]
    rows: np.ndarray
    frames: np.ndarray
    notes: list[str] = field(default_factory=list)

    def markers(self, fps: str | float | None, individual: str | None) -> Markers:
        """Return the markers of one animal."""
        animals = list(dict.fromkeys(one[0] for one in self.columns if one))
        animal = _select_individual(individual, animals, self.path)
        index: dict[str, dict[str, int]] = {}
        for k, one in enumerate(self.columns):
            if one and one[0] == animal:
                columns = index.setdefault(one[1], {})
                if one[2] in columns:
                    raise RecordingError(f'{self.path}: two columns {one[2]!r} of marker '
                                         f'{one[1]!r}')
                columns[one[2]] = k
        flat = not any('z' in columns for columns in index.values())
        axes = 'xy' if flat else 'xyz'
        names = tuple(name for name, columns in index.items() if set(axes) <= set(columns))
        if not names:
            raise RecordingError(f'{self.path}: no marker has columns {abbreviate(list(axes))}')
        if not len(self.rows):
            raise RecordingError(f'{self.path}: no rows')
        points = np.stack([self.rows[:, [index[name][axis] for name in names]] for axis in axes],
                          axis=2)
        if flat:
            points[:, :, 1] *= -1.0  # A picture's y points down.
        scores = [index[name].get('likelihood', index[name].get('score')) for name in names]
        likelihoods = None if all(one is None for one in scores) else np.column_stack(
            [np.ones(len(points)) if one is None else self.rows[:, one] for one in scores])
        return Markers(names, stamps_of_frames(self.frames, fps, self.path), points, self.path,
                       likelihoods, tuple(self.notes))


def read_pose(path: str | Path, segments: str | Path | None = None,
              fps: str | float | None = None, individual: str | None = None,
              joints: Sequence[str] = (), progress: bool = True) -> Recording:
    """Read the joint angles between the markers of a file of poses.

    Args:
        path: the CSV file, compressed by gzip or not, or the HDF5 file.
        segments: markers of each segment; see `load_segments`.
        fps: frames per second of the video, which no such file states.
        individual: animal to read, if there are several.
        joints: names in the order to return; all if empty.
        progress: not used.

    Raises:
        RecordingError: see `pose_markers` and `joint_recording`.

    """
    return joint_recording(pose_markers(path, fps, individual), segments, joints)


def pose_markers(path: str | Path, fps: str | float | None, individual: str | None = None
                 ) -> Markers:
    """Read the markers of a file of poses; arguments as of `read_pose`.

    Raises:
        RecordingError: no such file, no or an impossible rate, or an animal that is not there.
        MissingLibraryError: it is an HDF5 file, and h5py is not installed.

    """
    path = Path(path)
    if path.suffix == '.slp':
        raise RecordingError(f'{path}: a project of SLEAP: export its analysis as HDF5 or CSV')
    poses = _poses_of_hdf5(path) if path.suffix == '.h5' else _poses_of_table(path, individual)
    # Only the requested track was read, and it has no name.
    unnamed = {key[0] for key in poses.columns if key} == {''}
    return poses.markers(fps, None if unnamed else individual)


def _poses_of_hdf5(path: Path) -> _Poses:
    needed('h5py')
    try:
        arrays = read_in_process(hdf5_arrays, path)
    except (UnreadableFile, OSError) as error:
        reason = ' '.join(str(error).split()) or type(error).__name__
        raise RecordingError(f'{path}: not a readable HDF5 file of poses: {reason[:200]}'
                             ) from error
    columns = [tuple(column) for column in json.loads(str(arrays['columns']))]
    return _Poses(path, columns, arrays['rows'], arrays['frames'])


def hdf5_arrays(path: str) -> dict[str, Any]:
    """Return animal, marker and coordinate of the columns as JSON, rows and frames of a file.

    Raises:
        RecordingError: it has no poses, and whatever the library raises.

    """
    import h5py
    size = UnpackedSize(Path(path).stat().st_size)
    with h5py.File(path) as file:
        table = next((one['table'] for one in file.values()
                      if isinstance(one, h5py.Group) and 'table' in one), None)
        if table is None and {'tracks', 'node_names'} <= set(file):
            columns, rows = _sleap(file, size)
            return {'columns': json.dumps(columns), 'rows': rows, 'frames': np.arange(len(rows))}
        if table is None or 'values_block_0' not in table.dtype.names:
            raise RecordingError('neither poses of DeepLabCut nor an analysis of SLEAP: it has '
                                 f'{abbreviate(list(file))}')
        size.add(table.size * table.dtype.itemsize)
        names = _Names(BytesIO(bytes(table.attrs['values_block_0_kind']))).load()
        # Scorer, individual where there are several animals, body part, coordinate.
        columns = [(one[1] if len(one) == 4 else '', *one[-2:]) for one in names]
        return {'columns': json.dumps(columns), 'rows': table['values_block_0'].astype(float),
                'frames': table['index']}


class _Names(pickle.Unpickler):
    """Unpickler of the names of columns, as pandas writes them, which runs no code."""

    def find_class(self, module: str, name: str) -> Any:
        raise RecordingError(f'{module}.{name} among the names of columns')


def _sleap(file: Any, size: UnpackedSize) -> tuple[list[tuple[str, str, str]], np.ndarray]:
    """Return SLEAP's arrays, of shapes (animals, coordinates, markers, frames), as columns."""
    arrays = [file['tracks'], *[file[name] for name in ('point_scores',) if name in file]]
    size.add(sum(one.size * 8 for one in arrays))
    tracks = np.concatenate([one[:] if one.ndim == 4 else one[:][:, None] for one in arrays],
                            axis=1)
    nodes = [name.decode() for name in file['node_names']]
    animals = [name.decode() for name in file.get('track_names', ())]
    axes = [*'xyz'[:arrays[0].shape[1]], 'score'][:tracks.shape[1]]
    columns = [(animal, node, axis) for animal in animals or [''] for axis in axes
               for node in nodes]
    rows = tracks.reshape(-1, tracks.shape[-1]).T
    if rows.shape[1] != len(columns):
        raise RecordingError(f'{rows.shape[1]} columns, where {len(columns)} have names')
    return columns, rows


def recognises(path: Path) -> bool:
    """Tell whether a file begins as a table of poses."""
    try:
        with opened(path) as file:
            cells = _cells(file.readline(), path, 1)
    except RecordingError:
        return False
    return cells[:1] == ['scorer'] or any(cell in FRAME_COLUMNS for cell in cells)


def _cells(line: str, path: Path, number: int) -> list[str]:
    return [cell.strip() for cell in cells_of(line, ',', f'{path}, line {number}')]


def _poses_of_table(path: Path, individual: str | None) -> _Poses:
    columns: list[tuple[str, str, str] | None]
    with opened(path) as file:
        first = _cells(next(file, ''), path, 1)
        heads: dict[str, list[str]] = {}
        for number, line in enumerate(islice(file, 3) if first[:1] == ['scorer'] else (), 2):
            cells = _cells(line, path, number)
            if not cells or cells[0] not in HEADER_ROWS or len(cells) != len(first):
                raise RecordingError(f'{path}, line {number}: a row of headers has to begin with '
                                     f'one of {abbreviate(HEADER_ROWS)} and have {len(first)} '
                                     'cells')
            heads[cells[0]] = cells
            if cells[0] == 'coords':
                break
        lines = remaining_lines(file, path)
    if first[:1] == ['scorer']:
        if not {'bodyparts', 'coords'} <= set(heads):
            raise RecordingError(f"{path}: the rows of headers 'bodyparts' and 'coords' are not "
                                 'both there')
        animals = heads.get('individuals', [''] * len(first))
        columns = [None, *zip(animals[1:], heads['bodyparts'][1:], heads['coords'][1:],
                              strict=True)]
        frame = 0
    else:
        frames = [k for k, cell in enumerate(first) if cell in FRAME_COLUMNS]
        if len(frames) != 1:
            raise RecordingError(
                f"{path}: not a table of poses: its first line neither begins with 'scorer' nor "
                f'has a column {" or ".join(map(repr, FRAME_COLUMNS))}; files of other kinds have '
                'to be exported as CSV')
        frame = frames[0]
        columns = [('', match[1], match[2]) if (match := COLUMN.fullmatch(cell))
                   and match[1] != 'instance' else None for cell in first]
    if not any(columns):
        raise RecordingError(f'{path}: no columns of markers')
    rows, notes = number_rows(lines, [
        'frame' if k == frame else ' '.join(one[1:]) if one else ''
        for k, one in enumerate(columns)], ',', path, 2 + len(heads))
    if TRACK_COLUMN in first:
        at = first.index(TRACK_COLUMN)
        tracks = [_cells(line, path, k)[at] for k, line in enumerate(filter(str.strip, lines), 2)
                  ][:len(rows)]
        animal = _select_individual(individual, list(dict.fromkeys(tracks)), path)
        rows = rows[[track == animal for track in tracks]]
        numbers, count = np.unique(rows[:, frame], return_counts=True)
        if (count > 1).any():
            raise RecordingError(f'{path}: frame {numbers[np.argmax(count > 1)]:g} occurs twice: '
                                 'animals without tracks cannot be distinguished')
    return _Poses(path, columns, rows, rows[:, frame], notes)


def _select_individual(individual: str | None, names: Sequence[str], path: Path) -> str:
    """Return the animal to read; it must be named if there are several."""
    if (individual is None and len(names) < 2) or individual in names:
        return individual if individual is not None else (*names, '')[0]
    lacking = '' if individual is None else f'no individual {individual!r}; '
    choices = abbreviate([one for one in names if one])
    raise RecordingError(f'{path}: {lacking}there are {choices or "none with names"}: name one '
                         '(individual)')


POSE = RecordingFormat(
    name='pose', contents='markers in a CSV or HDF5 file of DeepLabCut, SLEAP or Anipose',
    help='a CSV or HDF5 file of DeepLabCut, SLEAP (analysis) or Anipose', metavar='FILE',
    read=read_pose, endings=('.csv', '.csv.gz', '.h5'),
    options=(JOINTS, SEGMENTS, FPS, INDIVIDUAL), recognises=recognises,
    lacks={'unit': 'markers have no angles', 'time': 'frames have no times: see --fps'})
