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

"""Markers out of C3D files, by the library ezc3d (Michaud & Begon 2021, Journal of Open Source
Software 6(58), 2911).
"""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from cpg_ros.errors import needed
from cpg_ros.files import regular_file
from cpg_ros.recordings.frame_stamps import stamps_of_frames
from cpg_ros.recordings.markers import joint_recording, Markers
from cpg_ros.recordings.recording import Recording, RecordingError
from cpg_ros.recordings.recording_format import JOINTS, RecordingFormat
from cpg_ros.recordings.segments import SEGMENTS
from cpg_ros.recordings.stray_samples import counted
import numpy as np

#: Largest file, and what its first block has, bytes.
LARGEST, BLOCK = 1_000_000_000, 512


def read_c3d(path: str | Path, segments: str | Path | None = None, joints: Sequence[str] = (),
             progress: bool = True) -> Recording:
    """Read the joint angles between the markers of a C3D file.

    Args:
        path: the file.
        segments: which markers span which segment; see `load_segments`.
        joints: of these, in this order; all of them, if empty.
        progress: not used.

    Raises:
        RecordingError: see `c3d_markers` and `joint_recording`.

    """
    return joint_recording(c3d_markers(path), segments, joints)


def c3d_markers(path: str | Path) -> Markers:
    """Read the markers of a C3D file; a point with a negative residual was not seen.

    Names lose what stands before a colon, the subject.

    Raises:
        RecordingError: the file is damaged, or has no points.
        MissingLibraryError: ezc3d is not installed.

    """
    path = Path(path)
    stated = _stated(path)
    needed('ezc3d')
    import ezc3d
    try:
        file: Any = ezc3d.c3d(str(path))
        point = file['parameters']['POINT']
        rate, points = float(point['RATE']['value'][0]), np.asarray(file['data']['points'])
        residuals = np.asarray(file['data']['meta_points']['residuals'])[0]
        labels = [label for name in sorted((one for one in point if one.startswith('LABELS')
                                            ), key=lambda name: (len(name), name))
                  for label in point[name]['value']]
    # The library does not list what damaged files make it raise.
    except Exception as error:
        why = ' '.join(str(error).split()).rstrip('.') or type(error).__name__
        raise RecordingError(f'{path}: no C3D file that can be read: {why[:200]}') from error
    count, frames = points.shape[1:]
    if not count or not frames:
        raise RecordingError(f'{path}: {counted(count, "point")} in {counted(frames, "frame")}')
    names = tuple(label.rpartition(':')[2].strip() for label in labels[:count])
    if len(names) != count:
        raise RecordingError(f'{path}: {len(names)} labels for {counted(count, "point")}')
    places = np.where(residuals < 0.0, np.nan, points[:3]).transpose(2, 1, 0)
    notes = ([f'{counted(frames, "frame")}, where the header states {stated}: it may be cut']
             if frames < stated else [])
    return Markers(names, stamps_of_frames(np.arange(frames), rate, path), places, path,
                   notes=tuple(notes))


def _stated(path: Path) -> int:
    """Return the number of frames that a file's first block states, mod 65536.

    Raises:
        RecordingError: it is no C3D file.

    """
    with regular_file.opened(path, RecordingError, largest=LARGEST) as file:
        data = file.read(BLOCK)
    if len(data) < BLOCK or data[1] != 0x50 or not data[0]:
        raise RecordingError(f'{path}: no C3D file: it does not begin as one')
    first, last = np.frombuffer(data, '<u2')[3:5].astype(int)
    return (last - first + 1) % 65536


C3D = RecordingFormat(
    name='c3d', contents='markers in a C3D file', help='markers in three dimensions',
    metavar='FILE', read=read_c3d, endings=('.c3d',), options=(JOINTS, SEGMENTS),
    lacks={'unit': 'markers have no angles', 'time': 'C3D files have their rate'})
