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

Angles that need a missing or unreliable marker are missing; nothing is interpolated. Angles are
between a body's own segments: they do not depend on the camera's or the laboratory's axes.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import pairwise
import math
from pathlib import Path
from typing import Annotated, Any

from cpg_ros.common.errors import ShortRepr
from cpg_ros.common.files import resource_folder
from cpg_ros.common.yaml_reader import within, YamlReader
from cpg_ros.fitting.recordings.downsampling import pluralize
from cpg_ros.fitting.recordings.recording import (
    abbreviate,
    FootLoads,
    matching,
    Option,
    Recording,
    recording_of,
    RecordingError,
)
import numpy as np

# Files of segments: the markers that span each part of a body, and the parts that a joint
# connects.

#: SEGMENTS: option of every reader of markers.
SEGMENTS = Option('segments', 'for markers: a file that says which of them span which segment '
                  'and which joints are between, or the name of a shipped one', 'FILE')
#: MIN_LIKELIHOOD: default for a marker that counts as seen, that of DeepLabCut.
MIN_LIKELIHOOD = 0.6


@dataclass(frozen=True)
class Segment:
    """A line through a body between two ends; each end is the mean of its markers."""

    begin: tuple[str, ...]
    end: tuple[str, ...]

    @property
    def markers(self) -> tuple[str, ...]:
        """Markers of both ends."""
        return self.begin + self.end


@dataclass(frozen=True)
class JointAngle:
    """Angle of a segment relative to another.

    Attributes:
        between: names of the reference segment, such as the thigh, and of the rotated one, such as
            the shank.
        axis: name of the segment about which it rotates, right-handed, in three dimensions; '' for
            the unsigned angle between the two.
        neutral: angle that counts as 0, rad.

    """

    between: tuple[str, ...]
    axis: str = ''
    neutral: Annotated[float, lambda angle: '' if abs(angle) <= math.pi else (
        f'{angle:g} rad is more than half a turn')] = 0.0


@dataclass(frozen=True)
class Segments:
    """Segments and the joints between them.

    Attributes:
        segments: name -> segment.
        joints: name -> angle.
        least_likelihood: below it, a marker counts as missing.
        alternatives: marker -> other names for it, or for substitutes.
        body: markers whose mean is the position of the body.
        feet: leg -> markers of its foot, from the heel to the toe.

    """

    segments: Mapping[str, Segment]
    joints: Mapping[str, JointAngle]
    least_likelihood: Annotated[float, within(0.0, 1.0)] = MIN_LIKELIHOOD
    alternatives: dict[str, tuple[str, ...]] = field(default_factory=dict)
    body: tuple[str, ...] = ()
    feet: dict[str, tuple[str, ...]] = field(default_factory=dict)

    def named_as(self, available: Sequence[str]) -> 'Segments':
        """Return the same segments with alternatives applied for markers that exist."""
        names = {name: next((marker for marker in others if marker in available), name)
                 for name, others in self.alternatives.items() if name not in available}

        def ends(markers: tuple[str, ...]) -> tuple[str, ...]:
            return tuple(dict.fromkeys(names.get(marker, marker) for marker in markers))

        return replace(self, segments={name: Segment(ends(marker.begin), ends(marker.end))
                                       for name, marker in self.segments.items()},
                       body=ends(self.body),
                       feet={leg: ends(names) for leg, names in self.feet.items()})

    def markers(self, joint: str, solid: bool) -> tuple[str, ...]:
        """Return the markers of a joint's angle, each once.

        Args:
            joint: its name.
            solid: in three dimensions, where the axis' markers count, too.

        """
        segment = self.joints[joint]
        return tuple(dict.fromkeys(
            marker for name in (*segment.between, *[segment.axis] * bool(segment.axis and solid))
            for marker in self.segments[name].markers))


class _Reader(YamlReader):
    """Reader that knows the ends of segments."""

    def ends(self, value: Any, where: str) -> Segment:
        listed = self.items(value, where)
        if len(listed) != 2:
            raise self.fail(where, f'has two ends, not {len(listed)}')
        ends = [self.texts(end, f'{where}[{k}]') if isinstance(end, list) else
                (self.text(end, f'{where}[{k}]'),) for k, end in enumerate(listed)]
        if ends[0] == ends[1]:
            raise self.fail(where, 'begins and ends at the same marker')
        return Segment(*ends)

    def joint(self, value: Any, where: str) -> JointAngle:
        joint = self.record(JointAngle, value, where)
        if len(joint.between) != 2 or len(set(joint.between)) != 2:
            raise self.fail(f'{where}.between', 'must be two segments')
        return joint


def shipped() -> list[str]:
    """Return the names of the shipped files."""
    return sorted(file.stem for file in (resource_folder('config') / 'segments').glob('*.yaml'))


def load_segments(name: str | Path) -> Segments:
    """Read a file of segments.

    ::

        least_likelihood: 0.6       # optional
        segments:
          thigh: [hip, knee]        # from, to
          shank: [knee, [ankle_inner, ankle_outer]]
          leftward: [pelvis_right, pelvis_left]
        joints:
          knee: {between: [thigh, shank], axis: leftward, neutral: 0.0}
        alternatives:               # optional: other names for a marker, the first that is there
          hip: [greater_trochanter]
        body: [pelvis_left, pelvis_right]   # optional: what carries the legs, and the feet, from
        feet: {left: [heel, toe]}           # the heel on, which tell where up is and when legs
                                            # stand

    In three dimensions, a joint with an axis is the angle that its two segments have as seen along
    the axis, positive by the right hand; one without is the angle between them, which is never
    negative. In a picture, angles are positive counter-clockwise, and an axis is ignored. The
    angle that counts as 0 is `neutral` (rad); others lie within half a turn of it.

    Args:
        name: path of the file, or the name of a shipped one.

    Raises:
        RecordingError: the file is not there or wrong; the message names the place.

    """
    path = Path(name)
    if not path.exists() and str(name) in shipped():
        path = resource_folder('config') / 'segments' / f'{name}.yaml'
    reader = _Reader(path, 'segments', RecordingError, 1e6)
    if not path.exists():
        raise RecordingError(f'{path}: there is no such file of segments; shipped are '
                             f'{abbreviate(shipped())}')
    listed = reader.record(Segments, reader.tree(), 'file',
                          segments=lambda value, where: reader.mapping(value, where, reader.ends),
                          joints=lambda value, where: reader.mapping(value, where, reader.joint))
    for key, entries in (('segments', listed.segments), ('joints', listed.joints)):
        if not entries:
            raise reader.fail(key, 'must be a mapping with at least one entry')
    for key, joint in listed.joints.items():
        for name in (*joint.between, *[joint.axis] * bool(joint.axis)):
            if name not in listed.segments:
                raise reader.fail(f'joints.{key}', f'there is no segment {name!r}, only '
                                  f'{abbreviate(list(listed.segments), 20)}')
    return listed


#: MIN_LENGTH_RATIO: of a segment across the axis to its length, for it to have a direction.
MIN_LENGTH_RATIO = 1e-3
#: LENGTH_UNITS: name in a file -> m.
LENGTH_UNITS = {'mm': 1e-3, 'cm': 1e-2, 'm': 1.0}
#: MAX_COORDINATE: of a marker, in any unit.
MAX_COORDINATE = 1e9


@dataclass(frozen=True, eq=False, repr=False)
class Markers(ShortRepr):
    """Positions of markers.

    Attributes:
        names: of the markers.
        stamps: ns, int64, shape (n,).
        points: shape (n, markers, 2 or 3), in any unit, nan where missing; in a picture x to the
            right and y up.
        source: the file.
        likelihoods: of the positions, 0 to 1, shape (n, markers), nan if unknown; None if all are
            certain.
        notes: what was repaired or dropped, one line each.
        unit: of the points, m; nan if unknown.

    """

    names: tuple[str, ...]
    stamps: np.ndarray
    points: np.ndarray
    source: Path
    likelihoods: np.ndarray | None = None
    notes: tuple[str, ...] = ()
    unit: float = math.nan

    def _summary(self) -> str:
        return (f'{self.source}: {len(self.names)} markers in {self.points.shape[-1]} '
                f'dimensions, {pluralize(len(self.stamps), "sample")}')


def marker_names(labels: Sequence[str], points: np.ndarray) -> tuple[tuple[str, ...], list[str]]:
    """Return distinct names of markers, and notes.

    The subject before a colon is dropped unless names are then ambiguous. Among equal labels, the
    one with most points keeps the name, and the others are numbered: 'LKNE#2'.

    Args:
        labels: as in the file.
        points: shape (n, markers, 2 or 3), nan where missing.

    """
    short = [label.rpartition(':')[2].strip() for label in labels]
    subjects: dict[str, set[str]] = {}
    for label, name in zip(labels, short, strict=True):
        subjects.setdefault(name, set()).add(label)
    names = [name if len(subjects[name]) == 1 else label
             for label, name in zip(labels, short, strict=True)]
    counts = np.isfinite(points).all(axis=2).sum(axis=0)
    notes = []
    for name in dict.fromkeys(name for name in names if names.count(name) > 1):
        indices = sorted((k for k, other in enumerate(names) if other == name),
                        key=lambda k: -counts[k])
        for number, k in enumerate(indices[1:], 2):
            names[k] = f'{name}#{number}'
        notes.append(f'{len(indices)} markers are called {name!r}: the one seen in '
                     f'{pluralize(int(counts[indices[0]]), "sample")} is taken, the other in '
                     f'{counts[indices[1]]}')
    return tuple(names), notes


def turned(first: np.ndarray, second: np.ndarray, axis: np.ndarray | None = None) -> np.ndarray:
    """Return the angle of a direction relative to another.

    Args:
        first: direction, of any length, shape (n, 2 or 3).
        second: of the same shape.
        axis: in three dimensions, the axis of rotation, shape (n, 3); None for the angle between
            the two.

    Returns:
        rad, shape (n,): from -pi to pi, positive counter-clockwise or right-handed about the axis;
            without an axis in three dimensions from 0 to pi. nan where a direction is missing, or
            parallel to the axis.

    """
    with np.errstate(all='ignore'):
        first, second = (vector / np.linalg.norm(vector, axis=1, keepdims=True)
                         for vector in (first, second))
        if first.shape[1] == 2:
            cross = first[:, 0] * second[:, 1] - first[:, 1] * second[:, 0]
        elif axis is None:
            cross = np.linalg.norm(np.cross(first, second), axis=1)
        else:
            axis = axis / np.linalg.norm(axis, axis=1, keepdims=True)
            first, second = (vector - np.sum(vector * axis, axis=1, keepdims=True) * axis
                             for vector in (first, second))
            cross = np.sum(axis * np.cross(first, second), axis=1)
        angle = np.arctan2(cross, np.sum(first * second, axis=1))
        short = [~(np.linalg.norm(vector, axis=1) >= MIN_LENGTH_RATIO)
                 for vector in (first, second)]
    return np.where(short[0] | short[1], np.nan, angle)


def joint_recording(markers: Markers, segments: str | Path | Segments | None,
                    joints: Sequence[str] = ()) -> Recording:
    """Return the joint angles between markers.

    Joints whose markers are missing, or never present together, are dropped with a note, unless
    they are requested.

    Args:
        markers: over time.
        segments: markers of the segments; the path of a file, or a shipped name.
        joints: names or patterns, in the order to return; all if empty.

    Raises:
        RecordingError: see `merged` and `load_segments`; there are no segments, or no joint has an
            angle.

    """
    source = markers.source
    if segments is None:
        raise RecordingError(f'{source}: it has markers, no joint angles: give a file of segments '
                             f'(segments), or a shipped one: {abbreviate(shipped())}')
    if not isinstance(segments, Segments):
        segments = load_segments(segments)
    segments = segments.named_as(markers.names)
    notes = list(markers.notes)
    names = matching(joints, list(segments.joints), f'{source}, segments')
    solid = markers.points.shape[2] == 3
    needs = {name: segments.markers(name, solid) for name in names}
    complete = [name for name in names if set(needs[name]) <= set(markers.names)]
    dropped = [name for name in names if name not in complete]
    missing = sorted({marker for name in dropped for marker in needs[name]} - set(markers.names))
    if dropped and (joints or not complete):
        raise RecordingError(f'{source}: no marker {abbreviate(missing)}, which '
                             f'{abbreviate(dropped)} need{"s" * (len(dropped) == 1)}; there are '
                             f'{abbreviate(markers.names, 40)}')
    if dropped:
        notes.append(f'without the markers {abbreviate(missing)}, left out: {abbreviate(dropped)}')
    marker_names = list(dict.fromkeys(marker for name in complete for marker in needs[name]))
    points = _points(markers, segments.least_likelihood, marker_names, notes)
    angles = {name: _angle(name, segments, markers, points) for name in complete}
    unseen = [name for name, angle in angles.items() if not np.isfinite(angle).any()]
    empty = [name for name in marker_names
             if not np.isfinite(points[:, markers.names.index(name)]).all(axis=1).any()]
    lacking = f'; without any place: {abbreviate(empty)}' if empty else ''
    if unseen and (joints or len(unseen) == len(angles)):
        raise RecordingError(f'{source}: no angle of {abbreviate(unseen)}: its markers are '
                             f'never seen together{lacking}')
    if unseen:
        notes.append(f'never seen, left out: {abbreviate(unseen)}{lacking}')
    angles = {name: angle for name, angle in angles.items() if name not in unseen}
    return travelling(source, list(angles), np.column_stack(list(angles.values())), notes,
                      segments, markers, points)


def travelling(source: Path, joints: Sequence[str], angles: np.ndarray, notes: Sequence[str],
               segments: Segments, markers: Markers, points: np.ndarray) -> Recording:
    """Return the recording of angles with the position of the body and the feet's contacts.

    Args:
        source: the file.
        joints: their names.
        angles: rad, shape (n, joints).
        notes: initial notes.
        segments: body and feet, with their markers' names in the file.
        markers: of the file.
        points: of the markers, nan where missing, shape (n, markers, 2 or 3).

    """
    recording = recording_of(source, markers.stamps, joints, angles, notes)
    available = set(markers.names)
    body = [markers.names.index(name) for name in segments.body if name in available]
    feet = {leg: [markers.names.index(name) for name in names]
            for leg, names in segments.feet.items() if set(names) <= available}
    if points.shape[2] < 3 or not body or not feet:
        return recording
    place, times = points[:, body].mean(axis=1), 1e-9 * markers.stamps
    below = place[:, None] - points[:, [marker for columns in feet.values() for marker in columns]]
    if not np.isfinite(below).all(axis=2).any():
        return recording
    # The last axis from the feet upward.
    below = np.nanmean(below, axis=(0, 1))
    up = int(np.argmax(np.abs(below)))
    points, place = (np.sign(below[up]) * np.roll(array, 2 - up, axis=-1)
                     for array in (points, place))
    if not math.isnan(markers.unit):
        finite = np.isfinite(place).all(axis=1)
        recording = replace(recording, body=markers.unit * np.column_stack([
            np.interp(recording.times, times[finite] - recording.start, column)
            for column in place[finite].T]))
    loads = contacts(footfalls(times, place, {leg: points[:, at] for leg, at in feet.items()}),
                     recording.start, recording.times)
    return recording if loads is None else replace(recording,
                                                   loads=replace(loads, by_motion=True))


#: MIN_STEP_RATIO: range of a foot's way forward and back that counts, over the usual one.
MIN_STEP_RATIO = 0.5
#: Leg, time, s, and whether its foot lands or leaves the ground then.
Footfall = tuple[str, float, bool]


def footfalls(times: np.ndarray, body: np.ndarray, feet: Mapping[str, np.ndarray]
              ) -> list[Footfall]:
    """Estimate when feet land and leave the ground, from their motion against the body.

    A heel lands when it is foremost, a toe leaves the ground when it is hindmost (Zeni, Richards
    & Higginson 2008, Gait & Posture 27, 710-714). Forward is where the toes are before the heels.

    Args:
        times: s, shape (n,).
        body: where it is, shape (n, 3), the last axis upward.
        feet: leg -> places of the markers of its foot, from the heel to the toe, (n, markers, 3).

    Returns:
        Nothing where a foot does not land and leave in turn.

    """
    from scipy.signal import find_peaks

    forward = np.mean([foot[:, -1] - foot[:, 0] for foot in feet.values()], axis=0)[:, :2]
    forward /= np.linalg.norm(forward, axis=1, keepdims=True)
    events: list[Footfall] = []
    for leg, foot in feet.items():
        falls = []
        for marker, down in ((0, True), (-1, False)):
            along = np.sum((foot[:, marker] - body)[:, :2] * forward, axis=1)
            along *= 1.0 if down else -1.0
            finite = np.isfinite(along)
            if not finite.any():
                return []
            min_step = MIN_STEP_RATIO * np.ptp(np.percentile(along[finite], (5.0, 95.0)))
            falls += [(time, down) for time in
                      times[finite][find_peaks(along[finite], prominence=min_step)[0]].tolist()]
        states = [down for _, down in sorted(falls)]
        if any(one == after for one, after in pairwise(states)):
            return []
        events += [(leg, time, down) for time, down in falls]
    return events


def contacts(events: Sequence[Footfall], start: float, times: np.ndarray) -> FootLoads | None:
    """Return which foot is on the ground, between the first and the last event of each leg.

    Args:
        events: of two legs or more.
        start: of the recording, s.
        times: of the recording, s, shape (n,).

    Returns:
        1 on the ground and 0 in the air; None unless every foot has both.

    """
    by_leg: dict[str, list[tuple[float, bool]]] = {}
    for leg, time, down in sorted(events):
        by_leg.setdefault(leg, []).append((time - start, down))
    if len(by_leg) < 2 or any(len({down for _, down in steps}) < 2 for steps in by_leg.values()):
        return None
    begin, end = (most([one([time for time, _ in steps]) for steps in by_leg.values()])
                  for most, one in ((max, min), (min, max)))
    # Whole strides where there are any, so that fractions of the time are those of a stride.
    touchdowns = [[time for time, down in steps if down and begin <= time <= end]
                  for steps in by_leg.values()]
    begin, end = max(((steps[0], steps[-1]) for steps in touchdowns if len(steps) > 1),
                     key=lambda one: one[1] - one[0], default=(begin, end))
    times = times[(times >= begin) & (times <= end)]
    rows = []
    for steps in by_leg.values():
        when, state = np.array(steps, float).T
        rows.append(state[np.searchsorted(when, times, side='right') - 1])
    if not len(times) or min(map(np.ptp, rows)) == 0.0:
        return None
    return FootLoads(tuple(by_leg), times, np.column_stack(rows))


def _points(markers: Markers, likely: float, names: Sequence[str], notes: list[str]) -> np.ndarray:
    """Return the points, nan where they are missing or unlikely."""
    points = markers.points.astype(float)
    points[~(np.abs(points) <= MAX_COORDINATE).all(axis=2)] = np.nan
    if markers.likelihoods is None:
        return points
    unlikely = ~(markers.likelihoods >= likely)
    columns = [markers.names.index(name) for name in names]
    finite = np.isfinite(points[:, columns]).all(axis=2)
    if count := int((unlikely[:, columns] & finite).sum()):
        notes.append(f'{count / max(1, int(finite.sum())):.0%} of the places of {len(columns)} '
                     f'markers have a likelihood below {likely:g}: not used')
    points[unlikely] = np.nan
    return points


def _angle(name: str, segments: Segments, markers: Markers, points: np.ndarray) -> np.ndarray:
    """Return a joint's angle in rad, shape (n,)."""
    joint = segments.joints[name]

    def direction(segment: str) -> np.ndarray:
        ends = segments.segments[segment]
        begin, end = (points[:, [markers.names.index(marker) for marker in names]].mean(axis=1)
                      for names in (ends.begin, ends.end))
        return end - begin

    flat = points.shape[2] == 2
    axis = direction(joint.axis) if joint.axis and not flat else None
    first, second = map(direction, joint.between)
    angle = turned(first, second, axis) - joint.neutral
    if flat or axis is not None:
        angle = (angle + np.pi) % (2.0 * np.pi) - np.pi
    return angle
