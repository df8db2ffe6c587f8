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

"""Markers on a body over time, and the recording of the joint angles between them.

A marker that was not seen, or hardly, makes the angles that need it missing; nothing is filled
in. Angles are between a body's own segments: they do not depend on where the camera or the
laboratory's axes stand.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from cpg_ros.files.plain_text import printable
from cpg_ros.recordings.joint_patterns import matching
from cpg_ros.recordings.recording import few, merged, Recording, RecordingError
from cpg_ros.recordings.segments import load_segments, Segments, shipped
from cpg_ros.recordings.stray_samples import counted
from cpg_ros.short_repr import ShortRepr
import numpy as np

#: A segment that, as seen along the axis, has less than this share of its length has no direction.
SHORTEST = 1e-3
#: A coordinate beyond this is no place of a marker, whatever the unit.
FARTHEST = 1e9


@dataclass(frozen=True, eq=False, repr=False)
class Markers(ShortRepr):
    """Places of markers.

    Attributes:
        names: of the markers.
        stamps: ns, int64, shape (n,).
        points: shape (n, markers, 2 or 3), in any unit, nan where not seen; of a picture x to the
            right and y up.
        source: the file.
        likelihoods: that a marker is where it is said to be, 0 to 1, shape (n, markers), nan if
            that is not known; None where all are certain.
        notes: what was repaired or left out, one line each.

    Raises:
        RecordingError: a name that is there twice.

    """

    names: tuple[str, ...]
    stamps: np.ndarray
    points: np.ndarray
    source: Path
    likelihoods: np.ndarray | None = None
    notes: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        again = [name for k, name in enumerate(self.names) if name in self.names[:k]]
        if again:
            raise RecordingError(f'{self.source}: two markers are called {again[0]!r}')

    def _summary(self) -> str:
        return (f'{self.source}: {len(self.names)} markers in {self.points.shape[-1]} '
                f'dimensions, {counted(len(self.stamps), "sample")}')


def turned(first: np.ndarray, second: np.ndarray, axis: np.ndarray | None = None) -> np.ndarray:
    """Return the angle by which a direction is turned from another.

    Args:
        first: direction, of any length, shape (n, 2 or 3).
        second: of the same shape.
        axis: in three dimensions, the direction about which it turns, shape (n, 3); None for the
            angle between the two.

    Returns:
        rad, shape (n,): from -pi to pi, positive counter-clockwise or, about the axis, by the
        right hand; without an axis in three dimensions from 0 to pi. nan where a direction is
        missing, or has none as seen along the axis.

    """
    with np.errstate(all='ignore'):
        first, second = (one / np.linalg.norm(one, axis=1, keepdims=True)
                         for one in (first, second))
        if first.shape[1] == 2:
            cross = first[:, 0] * second[:, 1] - first[:, 1] * second[:, 0]
        elif axis is None:
            cross = np.linalg.norm(np.cross(first, second), axis=1)
        else:
            axis = axis / np.linalg.norm(axis, axis=1, keepdims=True)
            first, second = (one - np.sum(one * axis, axis=1, keepdims=True) * axis
                             for one in (first, second))
            cross = np.sum(axis * np.cross(first, second), axis=1)
        angle = np.arctan2(cross, np.sum(first * second, axis=1))
        short = [~(np.linalg.norm(one, axis=1) >= SHORTEST) for one in (first, second)]
    return np.where(short[0] | short[1], np.nan, angle)


def joint_recording(markers: Markers, segments: str | Path | Segments | None,
                    joints: Sequence[str] = ()) -> Recording:
    """Return the joint angles between markers.

    Joints whose markers are not in the file, or never seen together, are left out with a note,
    unless they are asked for.

    Args:
        markers: over time.
        segments: which markers span what; the path of a file, or the name of a shipped one.
        joints: names or patterns, in this order; all joints, if empty.

    Raises:
        RecordingError: see `merged` and `load_segments`; no segments, or no joint has an angle.

    """
    source = markers.source
    if segments is None:
        raise RecordingError(f'{source}: it has markers, no joint angles: give a file of segments '
                             f'(segments), or a shipped one: {few(shipped())}')
    if not isinstance(segments, Segments):
        segments = load_segments(segments)
    notes = list(markers.notes)
    wanted = matching(joints, list(segments.joints), f'{source}, segments')
    solid = markers.points.shape[2] == 3
    needs = {name: segments.markers(name, solid) for name in wanted}
    found = [name for name in wanted if set(needs[name]) <= set(markers.names)]
    lost = [name for name in wanted if name not in found]
    missing = sorted({marker for name in lost for marker in needs[name]} - set(markers.names))
    if lost and (joints or not found):
        raise RecordingError(f'{source}: no marker {few(missing)}, which {few(lost)} '
                             f'need{"s" * (len(lost) == 1)}; there are {few(markers.names, 40)}')
    if lost:
        notes.append(f'without the markers {few(missing)}, left out: {few(lost)}')
    used = list(dict.fromkeys(marker for name in found for marker in needs[name]))
    points = _seen(markers, segments.likely, used, notes)
    angles = {name: _angle(name, segments, markers, points) for name in found}
    silent = [name for name, angle in angles.items() if not np.isfinite(angle).any()]
    if silent and (joints or len(silent) == len(angles)):
        raise RecordingError(f'{source}: no angle of {few(silent)}: its markers are never seen '
                             'together')
    if silent:
        notes.append(f'never seen, left out: {few(silent)}')
    table = {name: angle for name, angle in angles.items() if name not in silent}
    recording = merged([(markers.stamps, list(table), np.column_stack(list(table.values())))],
                       printable(str(source)))
    return replace(recording, notes=(*map(printable, notes), *recording.notes))


def _seen(markers: Markers, likely: float, used: Sequence[str], notes: list[str]) -> np.ndarray:
    """Return the points, nan where they are not seen or hardly."""
    points = markers.points.astype(float)
    points[~(np.abs(points) <= FARTHEST).all(axis=2)] = np.nan
    if markers.likelihoods is None:
        return points
    unlikely = ~(markers.likelihoods >= likely)
    columns = [markers.names.index(name) for name in used]
    there = np.isfinite(points[:, columns]).all(axis=2)
    if count := int((unlikely[:, columns] & there).sum()):
        notes.append(f'{count / max(1, int(there.sum())):.0%} of the places of {len(columns)} '
                     f'markers have a likelihood below {likely:g}: not used')
    points[unlikely] = np.nan
    return points


def _angle(name: str, segments: Segments, markers: Markers, points: np.ndarray) -> np.ndarray:
    """Return a joint's angle in rad, shape (n,)."""
    joint = segments.joints[name]

    def direction(segment: str) -> np.ndarray:
        ends = segments.segments[segment]
        begin, end = (points[:, [markers.names.index(one) for one in names]].mean(axis=1)
                      for names in (ends.begin, ends.end))
        return end - begin

    flat = points.shape[2] == 2
    axis = direction(joint.axis) if joint.axis and not flat else None
    angle = turned(direction(joint.first), direction(joint.second), axis)
    angle = angle - joint.neutral
    if flat or axis is not None:
        angle = (angle + np.pi) % (2.0 * np.pi) - np.pi
    return angle
