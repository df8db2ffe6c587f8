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

"""Markers and joint angles out of C3D files, by the library ezc3d (Michaud & Begon 2021, Journal
of Open Source Software 6(58), 2911), which runs in a process of its own (see reader_process).
"""

from collections.abc import Mapping, Sequence
from dataclasses import replace
import json
import math
from pathlib import Path
from typing import Any

from cpg_ros.common import files
from cpg_ros.common.errors import needed
from cpg_ros.fitting.recordings.markers import (
    contacts,
    Footfall,
    joint_recording,
    load_segments,
    marker_names,
    Markers,
    SEGMENTS,
    travelling,
    UNITS,
)
from cpg_ros.fitting.recordings.reader_process import read_apart, UnreadableFile
from cpg_ros.fitting.recordings.recording import (
    abbreviate,
    ANGLES,
    JOINTS,
    matching,
    Recording,
    RecordingError,
    RecordingFormat,
    unwrapped,
)
from cpg_ros.fitting.recordings.tables import stamps_of_frames
from cpg_ros.fitting.recordings.thinned import pluralize
import numpy as np

#: LARGEST: largest file, bytes; BLOCK: size of its first block, bytes.
LARGEST, BLOCK = 1_000_000_000, 512


def read_c3d(path: str | Path, segments: str | Path | None = None, joints: Sequence[str] = (),
             progress: bool = True) -> Recording:
    """Read the joint angles of a C3D file, or those between its markers.

    A biomechanical model, such as Plug-in Gait, writes angles as points that the parameter
    POINT:ANGLES lists. Without segments, these are read: the first component of each, which is
    flexion in Plug-in Gait, without jumps by whole turns.

    Args:
        path: the file.
        segments: markers of each segment; see `load_segments`.
        joints: names in the order to return, or patterns such as '*Knee*'; all if empty.
        progress: not used.

    Raises:
        RecordingError: see `c3d_markers` and `joint_recording`; the unit of the angles is unknown,
            or a joint has no angle.

    """
    markers, angles, unit, events = _contents(Path(path))
    recording = (_modelled(markers, angles, unit, joints) if segments is None and angles else
                 joint_recording(markers, segments, joints))
    if (loads := contacts(footfalls(events), recording.start, recording.times)) is None:
        return recording
    return replace(recording, loads=loads, notes=(*recording.notes, 'which foot is on the ground '
                                                  "is taken from the file's events"))


def _point(parameters: Any, first: int) -> dict[str, Any]:
    """Return the values of the parameters of points and events that are used."""
    keys = ('RATE', 'LABELS', 'ANGLES', 'ANGLE_UNITS', 'UNITS')
    result: dict[str, Any] = {
        key: [value if isinstance(value, str) else float(value) for value in entry['value']]
        for key, entry in parameters['POINT'].items() if key.startswith(keys)}
    if 'EVENT' in parameters:
        known = {key: parameters['EVENT'][key]['value'] for key in ('LABELS', 'CONTEXTS', 'TIMES')
                 if key in parameters['EVENT']}
        minutes, seconds = np.asarray(known.pop('TIMES', np.zeros((2, 0)))).reshape(2, -1)
        result['EVENT'] = {**known, 'TIMES': (60.0 * minutes + seconds
                                             - first / result['RATE'][0]).tolist()}
    return result


def c3d_arrays(path: str) -> dict[str, Any]:
    """Return the parameters of points as JSON, points and residuals, from the library."""
    import ezc3d
    file: Any = ezc3d.c3d(path)
    first = int(file['header']['points']['first_frame'])
    return {'point': json.dumps(_point(file['parameters'], first)),
            'points': np.asarray(file['data']['points'], float),
            'residuals': np.asarray(file['data']['meta_points']['residuals'], float)[0]}


#: STRIKE, OFF: events of a foot that lands, and of one that leaves the ground.
STRIKE, OFF = ('foot strike', 'heel strike', 'hs'), ('foot off', 'toe off', 'to')


def footfalls(events: Mapping[str, Any]) -> list[Footfall]:
    """Return touchdowns and lift-offs from a file's events.

    Args:
        events: LABELS, CONTEXTS (Left, Right) and TIMES (s) of the parameters EVENT; a label may
            begin with the letter of the side, LHS.

    """
    falls = []
    labels = events.get('LABELS', ())
    sides = [*events.get('CONTEXTS', ()), *[''] * len(labels)]
    for label, side, time in zip(labels, sides, events.get('TIMES', ()), strict=False):
        leg, name = side.lower(), ' '.join(label.lower().split())
        if leg not in ('left', 'right'):
            leg, name = {'l': 'left', 'r': 'right'}.get(name[:1], ''), name[1:]
        if leg and name in STRIKE + OFF:
            falls.append((leg, time, name in STRIKE))
    return falls


def c3d_markers(path: str | Path) -> Markers:
    """Read the points of a C3D file; points with a negative residual are missing.

    Names are those of `marker_names`.

    Raises:
        RecordingError: the file is damaged, or has no points.
        MissingLibraryError: ezc3d is not installed.

    """
    return _contents(Path(path))[0]


def _contents(path: Path) -> tuple[Markers, list[str], str, Mapping[str, Any]]:
    """Return points, names of angles, the angles' unit, '' if none, and events."""
    stated = _stated(path)
    needed('ezc3d')
    try:
        arrays = read_apart(c3d_arrays, path)
        point, points, residuals = (json.loads(str(arrays['point'])), arrays['points'],
                                    arrays['residuals'])
        rate = float(point['RATE'][0])
    except (UnreadableFile, LookupError, TypeError, ValueError, OSError) as error:
        why = ' '.join(str(error).split()).rstrip('.') or type(error).__name__
        raise RecordingError(f'{path}: no C3D file that can be read: {why[:200]}') from error
    labels, angles = (_names(point, key) for key in ('LABELS', 'ANGLES'))
    units = [str(unit) for unit in point.get('ANGLE_UNITS', [])]
    count, frames = points.shape[1:]
    if not count or not frames:
        raise RecordingError(f'{path}: {pluralize(count, "point")} in '
                             f'{pluralize(frames, "frame")}')
    labels = labels[:count]
    if len(labels) != count:
        raise RecordingError(f'{path}: {len(labels)} labels for {pluralize(count, "point")}')
    coordinates = np.where(residuals < 0.0, np.nan, points[:3]).transpose(2, 1, 0)
    notes = ([f'{pluralize(frames, "frame")}, where the header states {stated}: it may be cut']
             if frames < stated else [])
    names, doubles = marker_names(labels, coordinates)
    markers = Markers(names, stamps_of_frames(np.arange(frames), rate, path), coordinates, path,
                    notes=(*notes, *doubles),
                    unit=UNITS.get(''.join(map(str, point.get('UNITS', ['']))), math.nan))
    subjects = {name.rpartition(':')[2] for name in angles}
    return markers, [name for name, label in zip(names, labels, strict=True)
                   if label in angles or label.rpartition(':')[2] in subjects
                   ], ''.join(units[:1]).strip(), point.get('EVENT', {})


def _names(point: Mapping[str, Any], key: str) -> list[str]:
    """Return a list of points; from 256 points on it continues in LABELS2, and so on."""
    keys = sorted((parameter for parameter in point if parameter.startswith(key)),
                  key=lambda parameter: (len(parameter), parameter))
    return [str(name).strip() for parameter in keys for name in point[parameter]]


def _modelled(points: Markers, angles: Sequence[str], unit: str, joints: Sequence[str]
              ) -> Recording:
    """Return the angles that a model wrote."""
    source = points.source
    scale = ANGLES.get(unit.lower() or 'deg')
    if scale is None:
        raise RecordingError(f'{source}: POINT:ANGLE_UNITS is {unit[:20]!r}, not deg or rad')
    names = matching(joints, angles, str(source))
    coordinates = points.points[:, [points.names.index(name) for name in names]]
    # Some programs write zeros where a model had no value.
    first = np.where((coordinates == 0.0).all(axis=2), np.nan, scale * coordinates[..., 0])
    silent = [name for k, name in enumerate(names) if not np.isfinite(first[:, k]).any()]
    if silent and (joints or len(silent) == len(names)):
        raise RecordingError(f'{source}: no value of {abbreviate(silent)}')
    indices = [k for k, name in enumerate(names) if name not in silent]
    notes = [*points.notes, 'of each angle the first component is taken, flexion in Plug-in Gait']
    if not unit:
        notes.append('no POINT:ANGLE_UNITS: angles are taken to be in degrees')
    if silent:
        notes.append(f'without a value, left out: {abbreviate(silent)}')
    return travelling(source, [names[k] for k in indices], unwrapped(first[:, indices]), notes,
                      load_segments('human_plug_in_gait').named_as(points.names), points,
                      points.points)


def _stated(path: Path) -> int:
    """Return the number of frames that a file's first block states, mod 65536.

    Raises:
        RecordingError: it is no C3D file.

    """
    with files.opened(path, RecordingError, largest=LARGEST) as file:
        data = file.read(BLOCK)
    if len(data) < BLOCK or data[1] != 0x50 or not data[0]:
        raise RecordingError(f'{path}: no C3D file: it does not begin as one')
    first, last = np.frombuffer(data, '<u2')[3:5].astype(int)
    return (last - first + 1) % 65536


C3D = RecordingFormat(
    name='c3d', contents='a C3D file', help='joint angles of a model, or markers',
    metavar='FILE', read=read_c3d, endings=('.c3d',), options=(JOINTS, SEGMENTS),
    lacks={'unit': 'C3D files have their unit', 'time': 'C3D files have their rate'})
