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
from contextlib import suppress
from dataclasses import replace
import json
import math
from pathlib import Path
from typing import Any

from cpg_ros.common import files
from cpg_ros.common.errors import needed
from cpg_ros.fitting.recordings.downsampling import pluralize
from cpg_ros.fitting.recordings.markers import (
    contacts,
    Footfall,
    joint_recording,
    LENGTH_UNITS,
    load_segments,
    marker_names,
    Markers,
    SEGMENTS,
    travelling,
)
from cpg_ros.fitting.recordings.reader_process import read_in_process, UnreadableFile
from cpg_ros.fitting.recordings.recording import (
    abbreviate,
    ANGLE_UNITS,
    JOINTS,
    matching,
    Recording,
    RecordingError,
    RecordingFormat,
    unwrap,
)
from cpg_ros.fitting.recordings.tables import stamps_of_frames
import numpy as np

#: MAX_SIZE: of a file, bytes; BLOCK_SIZE: of its first block, bytes.
MAX_SIZE, BLOCK_SIZE = 1_000_000_000, 512
#: PLUG_IN_GAIT: segments whose feet are looked for without others.
PLUG_IN_GAIT = 'human_plug_in_gait'


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
    markers, angles, unit, events, plates = _contents(Path(path))
    recording = (_model_angles(markers, angles, unit, joints) if segments is None and angles else
                 joint_recording(markers, segments, joints))
    body = load_segments(PLUG_IN_GAIT if segments is None else segments).named_as(markers.names)
    feet = {leg: markers.points[:, [markers.names.index(name) for name in names]].mean(axis=1)
            for leg, names in body.feet.items() if set(names) <= set(markers.names)}
    for candidate, source in ((footfalls(events), "the file's events"),
                              (plate_footfalls(1e-9 * markers.stamps, *plates, feet),
                               'the force plates')):
        if (loads := contacts(candidate, recording.start, recording.times)) is not None:
            return replace(recording, loads=loads, notes=(
                *recording.notes, f'which foot is on the ground is taken from {source}'))
    return recording


def _point(parameters: Any, first: int) -> dict[str, Any]:
    """Return the values of the parameters of points and events that are used."""
    keys = ('RATE', 'LABELS', 'ANGLES', 'ANGLE_UNITS', 'UNITS')
    result: dict[str, Any] = {
        key: [value if isinstance(value, str) else float(value) for value in entry['value']]
        for key, entry in parameters['POINT'].items() if key.startswith(keys)}
    if 'EVENT' in parameters:
        values = {key: parameters['EVENT'][key]['value'] for key in ('LABELS', 'CONTEXTS', 'TIMES')
                  if key in parameters['EVENT']}
        minutes, seconds = np.asarray(values.pop('TIMES', np.zeros((2, 0)))).reshape(2, -1)
        result['EVENT'] = {**values, 'TIMES': (60.0 * minutes + seconds
                                             - first / result['RATE'][0]).tolist()}
    return result


def c3d_arrays(path: str) -> dict[str, Any]:
    """Return the parameters of points as JSON, points and residuals, from the library."""
    import ezc3d
    file: Any = ezc3d.c3d(path)
    first, points = int(file['header']['points']['first_frame']), file['data']['points']
    loads, corners = _plates(file['parameters'].get('FORCE_PLATFORM', {}),
                             file['data']['analogs'][0], points.shape[2])
    return {'point': json.dumps(_point(file['parameters'], first)), 'loads': loads,
            'corners': corners, 'points': np.asarray(points, float),
            'residuals': np.asarray(file['data']['meta_points']['residuals'], float)[0]}


def _plates(parameters: Any, analogs: np.ndarray, frames: int) -> tuple[np.ndarray, np.ndarray]:
    """Return the vertical forces on plates, N, shape (plates, frames), and corners (plates, 4, 3).

    Plates of types 1 and 2 have the vertical force in their third channel, those of type 3 in the
    last four, and those of type 4 as the third row of a matrix gives it of six.
    """
    loads, corners = [], []
    with suppress(LookupError, TypeError, ValueError):
        for k, kind in enumerate(parameters['TYPE']['value']):
            columns = np.asarray(parameters['CHANNEL']['value'], int).T[k] - 1
            weights: Any = 1.0
            vertical = columns[4:8] if kind == 3 else columns[2:3]
            if kind == 4:
                vertical, weights = columns[:6], np.asarray(
                    parameters['CAL_MATRIX']['value'])[2, :6, k, None]
            force = np.sum(weights * analogs[vertical], axis=0)
            loads.append(force.reshape(frames, -1).mean(axis=1))
            corners.append(np.asarray(parameters['CORNERS']['value'], float)[:, :, k].T)
    count = len(corners)
    return (np.reshape(loads[:count], (count, frames)), np.reshape(corners, (count, 4, 3)))


#: Names of a foot's touchdown and lift-off.
STRIKE_EVENTS, OFF_EVENTS = ('foot strike', 'heel strike', 'hs'), ('foot off', 'toe off', 'to')


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
        if leg and name in STRIKE_EVENTS + OFF_EVENTS:
            falls.append((leg, time, name in STRIKE_EVENTS))
    return falls


#: CONTACT_FORCE: on the plate under a foot, N; PLATE_MARGIN: distance of a foot from its plate,
#: over the plate's edge; MIN_DURATION: of stance and swing, s; MAX_PERIOD_RATIO: of the times
#: between landings.
CONTACT_FORCE, PLATE_MARGIN, MIN_DURATION, MAX_PERIOD_RATIO, MIN_LANDINGS = 20.0, 0.1, 0.05, 1.6, 5


def plate_footfalls(times: np.ndarray, loads: np.ndarray, corners: np.ndarray,
                    feet: Mapping[str, np.ndarray]) -> list[Footfall]:
    """Return when feet land on force plates and leave them.

    The force on a plate is that of the foot above it, or of the lower one of two. Landings beside
    the plates are not seen: only those count that follow one another left and right and evenly in
    time, if both feet make a whole stride of them.

    Args:
        times: s, even, shape (n,).
        loads: vertical forces on the plates, N, shape (plates, n).
        corners: of the plates, in the unit of the places of feet, shape (plates, 4, 3).
        feet: leg -> place of its foot, nan where missing, shape (n, 3).

    """
    from scipy.ndimage import binary_closing, binary_opening

    if len(feet) != 2 or not len(loads):
        return []
    edges = corners[:, (1, 3)] - corners[:, :1]
    upward = np.cross(edges[:, 0], edges[:, 1])
    upward /= np.linalg.norm(upward, axis=1, keepdims=True)
    above = []
    for foot in feet.values():
        along = foot - corners[:, :1]
        inside = np.abs(np.einsum('pnx,pex->pen', along, edges)
                        / np.sum(edges**2, axis=2)[..., None] - 0.5) <= 0.5 + PLATE_MARGIN
        above.append(np.where(inside.all(axis=1),
                              np.abs(np.einsum('pnx,px->pn', along, upward)), np.inf))
    width, stances = np.ones(max(1, round(MIN_DURATION / float(np.median(np.diff(times)))))), []
    for leg, load, other in zip(feet, above, above[::-1], strict=True):
        down = ((np.abs(loads) > CONTACT_FORCE) & (load < other)).any(axis=0)
        down = binary_opening(binary_closing(down, width), width)
        changes = (np.flatnonzero(np.diff(down)) + 1)[int(down[0]):]
        stances += [(float(times[first]), leg, float(times[end]))
                    for first, end in zip(changes[::2], changes[1::2], strict=False)]
    run: list[tuple[float, str, float]] = []
    best = run
    for stance in sorted(stances):
        if run and run[-1][1] == stance[1]:
            run = []
        elif len(run) > 1 and not 1.0 / MAX_PERIOD_RATIO < (stance[0] - run[-1][0]) / (
                run[-1][0] - run[-2][0]) < MAX_PERIOD_RATIO:
            run = run[-1:]
        run = [*run, stance]
        best = max(best, run, key=len)
    return [event for begin, leg, end in best for event in ((leg, begin, True), (leg, end, False))
            ] if len(best) >= MIN_LANDINGS else []


def c3d_markers(path: str | Path) -> Markers:
    """Read the points of a C3D file; points with a negative residual are missing.

    Names are those of `marker_names`.

    Raises:
        RecordingError: the file is damaged, or has no points.
        MissingLibraryError: ezc3d is not installed.

    """
    return _contents(Path(path))[0]


def _contents(path: Path) -> tuple[Markers, list[str], str, Mapping[str, Any],
                                   tuple[np.ndarray, np.ndarray]]:
    """Return points, names of angles, their unit, '' if none, events, and what plates measured."""
    num_frames = _num_frames(path)
    needed('ezc3d')
    try:
        arrays = read_in_process(c3d_arrays, path)
        point, points, residuals = (json.loads(str(arrays['point'])), arrays['points'],
                                    arrays['residuals'])
        rate = float(point['RATE'][0])
    except (UnreadableFile, LookupError, TypeError, ValueError, OSError) as error:
        reason = ' '.join(str(error).split()).rstrip('.') or type(error).__name__
        raise RecordingError(f'{path}: not a readable C3D file: {reason[:200]}') from error
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
    notes = ([f'{pluralize(frames, "frame")}, where the header states {num_frames}: it may be cut']
             if frames < num_frames else [])
    names, doubles = marker_names(labels, coordinates)
    markers = Markers(names, stamps_of_frames(np.arange(frames), rate, path), coordinates, path,
                    notes=(*notes, *doubles),
                    unit=LENGTH_UNITS.get(''.join(map(str, point.get('UNITS', ['']))), math.nan))
    subjects = {name.rpartition(':')[2] for name in angles}
    return markers, [name for name, label in zip(names, labels, strict=True)
                   if label in angles or label.rpartition(':')[2] in subjects
                   ], ''.join(units[:1]).strip(), point.get('EVENT', {}), (
                       arrays['loads'], arrays['corners'])


def _names(point: Mapping[str, Any], key: str) -> list[str]:
    """Return a list of points; from 256 points on it continues in LABELS2, and so on."""
    keys = sorted((parameter for parameter in point if parameter.startswith(key)),
                  key=lambda parameter: (len(parameter), parameter))
    return [str(name).strip() for parameter in keys for name in point[parameter]]


def _model_angles(points: Markers, angles: Sequence[str], unit: str, joints: Sequence[str]
              ) -> Recording:
    """Return the angles that a model wrote."""
    source = points.source
    scale = ANGLE_UNITS.get(unit.lower() or 'deg')
    if scale is None:
        raise RecordingError(f'{source}: POINT:ANGLE_UNITS is {unit[:20]!r}, not deg or rad')
    names = matching(joints, angles, str(source))
    coordinates = points.points[:, [points.names.index(name) for name in names]]
    # Some programs write zeros where a model had no value.
    first = np.where((coordinates == 0.0).all(axis=2), np.nan, scale * coordinates[..., 0])
    empty = [name for k, name in enumerate(names) if not np.isfinite(first[:, k]).any()]
    if empty and (joints or len(empty) == len(names)):
        raise RecordingError(f'{source}: no value of {abbreviate(empty)}')
    indices = [k for k, name in enumerate(names) if name not in empty]
    notes = [*points.notes, 'of each angle the first component is taken, flexion in Plug-in Gait']
    if not unit:
        notes.append('no POINT:ANGLE_UNITS: angles are taken to be in degrees')
    if empty:
        notes.append(f'without a value, left out: {abbreviate(empty)}')
    return travelling(source, [names[k] for k in indices], unwrap(first[:, indices]), notes,
                      load_segments(PLUG_IN_GAIT).named_as(points.names), points,
                      points.points)


def _num_frames(path: Path) -> int:
    """Return the number of frames that a file's first block states, mod 65536.

    Raises:
        RecordingError: it is not a C3D file.

    """
    with files.opened(path, RecordingError, largest=MAX_SIZE) as file:
        data = file.read(BLOCK_SIZE)
    if len(data) < BLOCK_SIZE or data[1] != 0x50 or not data[0]:
        raise RecordingError(f'{path}: not a C3D file: its first bytes are not those of one')
    first, last = np.frombuffer(data, '<u2')[3:5].astype(int)
    return (last - first + 1) % 65536


C3D = RecordingFormat(
    name='c3d', contents='a C3D file', help='joint angles of a model, or markers',
    metavar='FILE', read=read_c3d, endings=('.c3d',), options=(JOINTS, SEGMENTS),
    lacks={'unit': 'C3D files have their unit', 'time': 'C3D files have their rate'})
