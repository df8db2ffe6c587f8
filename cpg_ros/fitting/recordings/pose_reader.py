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

"""Markers out of the tables that pose estimation writes: DeepLabCut, SLEAP, Anipose.

DeepLabCut (and Lightning Pose): three or four rows of headers, scorer, individuals, bodyparts,
coords (Nath et al. 2019). SLEAP's analysis: one row of headers, `nose.x`, `nose.y`, `nose.score`.
Anipose: `nose_x`, `nose_y`, `nose_z`, `nose_score`, and the frame in `fnum`.
"""

from collections.abc import Iterator, Sequence
import csv
from dataclasses import dataclass, field
from itertools import islice
from pathlib import Path
import re

from cpg_ros.fitting.recordings.markers import joint_recording, Markers, SEGMENTS
from cpg_ros.fitting.recordings.recording import (
    abbreviate,
    JOINTS,
    Option,
    Recording,
    RecordingError,
    RecordingFormat,
)
from cpg_ros.fitting.recordings.tables import (
    FPS,
    number_rows,
    opened,
    remaining_lines,
    stamps_of_frames,
)
import numpy as np

INDIVIDUAL = Option('individual', 'of a table of several animals, the one to read', 'NAME')
#: A column of one row of headers: marker, coordinate.
COLUMN = re.compile(r'(.+)[._](x|y|z|score|likelihood)')
#: Columns of frames and of animals there.
FRAMES, TRACK = ('frame_idx', 'fnum'), 'track'
#: First cells of DeepLabCut's rows of headers.
ROWS = ('scorer', 'individuals', 'bodyparts', 'coords')


@dataclass
class _Layout:
    """Where a table has what: animal -> marker -> coordinate -> column."""

    places: dict[str, dict[str, dict[str, int]]] = field(default_factory=dict)
    width: int = 0
    frame: int = 0
    track: int | None = None
    line: int = 1

    def put(self, animal: str, marker: str, coordinate: str, column: int, path: Path) -> None:
        own = self.places.setdefault(animal, {}).setdefault(marker, {})
        if coordinate in own:
            raise RecordingError(f'{path}: two columns {coordinate!r} of marker {marker!r}')
        own[coordinate] = column


def read_pose(path: str | Path, segments: str | Path | None = None,
              fps: str | float | None = None, individual: str | None = None,
              joints: Sequence[str] = (), progress: bool = True) -> Recording:
    """Read the joint angles between the markers of a table of poses.

    Args:
        path: the CSV file, packed by gzip or not.
        segments: which markers span which segment; see `load_segments`.
        fps: frames a second of the video, which no such table has.
        individual: of several animals, the one to read.
        joints: of these, in this order; all of them, if empty.
        progress: not used.

    Raises:
        RecordingError: see `pose_markers` and `joint_recording`.

    """
    return joint_recording(pose_markers(path, fps, individual), segments, joints)


def pose_markers(path: str | Path, fps: str | float | None, individual: str | None = None
                 ) -> Markers:
    """Read the markers of a table of poses; arguments as of `read_pose`.

    Raises:
        RecordingError: no such table, no or an impossible rate, or an animal that is not there.

    """
    path = Path(path)
    if path.suffix in ('.h5', '.slp'):
        raise RecordingError(f'{path}: {path.suffix} files are not read: export the poses as CSV')
    with opened(path) as file:
        layout = _layout(file, path)
        lines = remaining_lines(file, path)
    if layout.track is not None:
        lines = _of_track(lines, layout, path, individual)
    else:
        _require(individual, [one for one in layout.places if one], path)
    places = layout.places.get(individual or '') or next(iter(layout.places.values()))
    flat = not any('z' in own for own in places.values())
    axes = 'xy' if flat else 'xyz'
    names = tuple(name for name, own in places.items() if set(axes) <= set(own))
    if not names:
        raise RecordingError(f'{path}: no marker has columns {abbreviate(list(axes))}')
    rows, notes = number_rows(lines, ',', layout.width, path, layout.line)
    if not len(rows):
        raise RecordingError(f'{path}: no rows')
    stamps = stamps_of_frames(rows[:, layout.frame], fps, path)
    points = np.stack([rows[:, [places[name][axis] for name in names]] for axis in axes], axis=2)
    if flat:
        points[:, :, 1] *= -1.0  # A picture's y points down.
    scores = [next((places[name][one] for one in ('likelihood', 'score') if one in places[name]),
                   None) for name in names]
    likelihoods = None if all(one is None for one in scores) else np.column_stack(
        [np.ones(len(rows)) if one is None else rows[:, one] for one in scores])
    return Markers(names, stamps, points, path, likelihoods, tuple(notes))


def recognises(path: Path) -> bool:
    """Tell whether a file begins as a table of poses."""
    try:
        with opened(path) as file:
            cells = _cells(file.readline())
    except RecordingError:
        return False
    return cells[:1] == ['scorer'] or any(cell in FRAMES for cell in cells)


def _cells(line: str) -> list[str]:
    try:
        return [cell.strip() for cell in next(csv.reader([line], strict=True), [])]
    except csv.Error:
        return []


def _layout(file: Iterator[str], path: Path) -> _Layout:
    """Read the rows of headers."""
    first = _cells(next(file, ''))
    found = _Layout(width=len(first))
    if first[:1] == ['scorer']:
        heads = {}
        for line in islice(file, 3):
            cells = _cells(line)
            found.line += 1
            if not cells or cells[0] not in ROWS or len(cells) != len(first):
                raise RecordingError(f'{path}, line {found.line}: a row of headers has to begin '
                                     f'with one of {abbreviate(ROWS)} and have {len(first)} cells')
            heads[cells[0]] = cells
            if cells[0] == 'coords':
                break
        if not {'bodyparts', 'coords'} <= set(heads):
            raise RecordingError(f"{path}: the rows of headers 'bodyparts' and 'coords' are not "
                                 'both there')
        for k in range(1, len(first)):
            animal = heads['individuals'][k] if 'individuals' in heads else ''
            found.put(animal, heads['bodyparts'][k], heads['coords'][k], k, path)
    else:
        frames = [k for k, cell in enumerate(first) if cell in FRAMES]
        if len(frames) != 1:
            raise RecordingError(
                f"{path}: no table of poses: its first line neither begins with 'scorer' nor has "
                f'a column {" or ".join(map(repr, FRAMES))}; files of other kinds have to be '
                'exported as CSV')
        found.frame = frames[0]
        found.track = first.index(TRACK) if TRACK in first else None
        for k, cell in enumerate(first):
            if (match := COLUMN.fullmatch(cell)) and match[1] != 'instance':
                found.put('', match[1], match[2], k, path)
    found.line += 1
    if not found.places:
        raise RecordingError(f'{path}: no columns of markers')
    return found


def _of_track(lines: list[str], layout: _Layout, path: Path, individual: str | None
              ) -> list[str]:
    """Return the lines of one animal, blank where they are another's, without its name."""
    at = layout.track or 0
    split = [_cells(line) for line in lines]
    tracks = list(dict.fromkeys(cells[at] for cells in split if len(cells) > at))
    _require(individual, tracks, path)
    animal = individual if individual is not None else (tracks or [''])[0]
    frames: set[str] = set()
    kept = []
    for number, cells in enumerate(split, layout.line):
        if len(cells) > max(at, layout.frame) and cells[at] != animal:
            kept.append('\n')
            continue
        frame = cells[layout.frame] if len(cells) > layout.frame else ''
        if frame and frame in frames:
            raise RecordingError(f'{path}, line {number}: frame {frame[:20]} is there twice: '
                                 'animals without tracks cannot be told apart')
        frames.add(frame)
        kept.append(','.join('' if k == at else cell for k, cell in enumerate(cells)) + '\n')
    return kept


def _require(individual: str | None, there: Sequence[str], path: Path) -> None:
    """Check that it is told which animal to read where there are several, and that it is there."""
    if (individual is None and len(there) < 2) or individual in there:
        return
    lacking = '' if individual is None else f'no individual {individual!r}; '
    raise RecordingError(f'{path}: {lacking}there are '
                         f'{abbreviate(there) or "none with names"}: name one '
                         '(individual)')


POSE = RecordingFormat(
    name='pose', contents='markers in a CSV file of DeepLabCut, SLEAP or Anipose',
    help='a CSV file of DeepLabCut, SLEAP (analysis) or Anipose', metavar='FILE', read=read_pose,
    endings=('.csv', '.csv.gz'), options=(JOINTS, SEGMENTS, FPS, INDIVIDUAL),
    recognises=recognises,
    lacks={'unit': 'markers have no angles', 'time': 'frames have no times: see --fps'})
