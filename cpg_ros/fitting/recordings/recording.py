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

"""Recordings: joint angles and foot loads over time, their repair, single strides, and formats.

Bags, tables and live topics deliver chunks of samples; `merged` makes one recording of them.
"""

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from fnmatch import fnmatchcase
import math
from pathlib import Path
import re

from cpg_ros.common.command_line import printable
from cpg_ros.common.errors import CpgError, ShortRepr
from cpg_ros.fitting.recordings.downsampling import (
    Downsampler,
    drop_outlier_positions,
    drop_outlier_stamps,
    Part,
    pluralize,
)
import numpy as np

# Loads on the feet, beside the joint states of a recording.

@dataclass(frozen=True, eq=False, repr=False)
class FootLoads(ShortRepr):
    """Loads on the feet over time.

    Attributes:
        legs: their names, or columns that name them, such as FR_force.
        times: s from the recording's start, ascending, shape (n,).
        loads: in the robot's unit, such as N, or 1 for contact; shape (n, legs).
        by_motion: whether contacts are estimated from the motion of the feet.

    """

    legs: tuple[str, ...]
    times: np.ndarray
    loads: np.ndarray
    by_motion: bool = False

    def _summary(self) -> str:
        return f'{len(self.times)} loads on {", ".join(self.legs)}'


#: ANGLE_UNITS: name in a file -> rad.
ANGLE_UNITS = {'rad': 1.0, 'radian': 1.0, 'radians': 1.0,
               'deg': math.pi / 180.0, 'degree': math.pi / 180.0, 'degrees': math.pi / 180.0,
               '°': math.pi / 180.0}
#: Stamps, shape (n,), int64, ns; the joints' names; positions, shape (n, names), rad.
Chunk = tuple[np.ndarray, Sequence[str], np.ndarray]

#: DROPOUT_RATIO: interval, over the usual one, above which samples are missing; JITTER_RATIO:
#: relative difference from it above which it is jitter.
DROPOUT_RATIO, JITTER_RATIO = 1.5, 0.1
#: MAX_TIME: of a stamp, s: the range of ROS, which keeps differences within int64.
MAX_TIME = 2**32


class RecordingError(CpgError):
    """A recording cannot be used; the message is one line with the file, topic and place."""


@dataclass(frozen=True, eq=False, repr=False)
class Recording(ShortRepr):
    """Joint angles over time.

    Attributes:
        joints: their names.
        times: s, shape (n,), strictly ascending from 0.
        positions: rad, shape (n, joints); nan where a joint has no sample.
        source: name in messages, such as 'walk_bag, /joint_states'.
        start: stamp at times = 0, s.
        notes: what was repaired or dropped, one line each.
        loads: on the feet, if recorded.
        cycle: duration of a stride, s, if the recording is copies of one; nan if its times are
            fractions of one stride of unknown duration; 0 for all other recordings.
        body: position of the body, m, the last axis upward, shape (n, 3), if recorded.
        commanded: whether the positions are commanded, not measured.

    Raises:
        RecordingError: fewer than two samples, times that do not ascend from 0, or shapes that do
            not fit.

    """

    joints: tuple[str, ...]
    times: np.ndarray
    positions: np.ndarray
    source: str
    start: float = 0.0
    notes: tuple[str, ...] = ()
    loads: FootLoads | None = None
    cycle: float = 0.0
    body: np.ndarray | None = None
    commanded: bool = False

    def _summary(self) -> str:
        return (f'{self.source}: {len(self.joints)} joints, {len(self.times)} samples '
                f'in {self.times[-1]:.6g} s')

    def __post_init__(self) -> None:
        if self.positions.shape != (len(self.times), len(self.joints)):
            raise RecordingError(
                f'{self.source}: positions of shape {self.positions.shape} for '
                f'{len(self.times)} times and {len(self.joints)} joints')
        if len(self.times) < 2:
            raise RecordingError(f'{self.source}: {pluralize(len(self.times), "sample")}; '
                                 'a movement needs at least two')
        if self.times[0] != 0.0 or not (np.diff(self.times) > 0.0).all():
            raise RecordingError(f'{self.source}: times do not rise strictly from 0')

    def select(self, names: Sequence[str]) -> 'Recording':
        """Return the recording of these joints, in this order.

        Raises:
            RecordingError: a joint is missing; the message names those that exist.

        """
        require(names, self.joints, self.source)
        columns = [self.joints.index(name) for name in names]
        return replace(self, joints=tuple(names), positions=self.positions[:, columns])

    def between(self, begin: float, end: float) -> 'Recording':
        """Return the recording between two times, s; its times begin at 0 again.

        Raises:
            RecordingError: there are fewer than two samples.

        """
        within = (self.times >= begin) & (self.times <= end)
        times = self.times[within]
        first = float(times[0]) if times.size else 0.0
        loads = self.loads
        if loads is not None:
            inside = (loads.times >= begin) & (loads.times <= end)
            loads = replace(loads, times=loads.times[inside] - first, loads=loads.loads[inside])
        return replace(self, times=times - first, positions=self.positions[within],
                       start=self.start + first, loads=loads,
                       body=None if self.body is None else self.body[within])


def refuse_stand_in(path: Path, head: bytes) -> None:
    """Refuse pointers to a recording, and recordings of another system.

    Args:
        path: of the file.
        head: its first 64 bytes.

    Raises:
        RecordingError: it is a pointer of Git LFS, or a bag of ROS 1.

    """
    if head.startswith(b'version https://git-lfs'):
        raise RecordingError(f'{path}: a pointer of Git LFS, not the file itself: fetch it with '
                             '"git lfs pull"')
    if head.startswith(b'#ROSBAG V'):
        raise RecordingError(f'{path}: a bag of ROS 1: convert it with "rosbags-convert --src '
                             f'{path.name} --dst {path.stem}"')


def require(names: Sequence[str], available: Sequence[str], source: str) -> None:
    """Check that joints exist, and that none is named twice.

    Raises:
        RecordingError: one is missing or named twice.

    """
    unknown = [name for name in names if name not in available]
    if unknown:
        raise RecordingError(f'{source}: no {joint_list(unknown)}; there are '
                             f'{abbreviate(available, 40)}')
    duplicates = [name for k, name in enumerate(names) if name in names[:k]]
    if duplicates:
        raise RecordingError(f'{source}: {joint_list(duplicates[:1])} is named twice')


def abbreviate(names: Sequence[str], limit: int = 6) -> str:
    """Return names in quotes, only the first ones if they are many."""
    text = ', '.join(repr(name) for name in names[:limit])
    return text + (f' and {len(names) - limit} more' if len(names) > limit else '')


def joint_list(joints: Sequence[str]) -> str:
    """Return 'joint' and its name, or 'joints' and their names."""
    return f'joint{"" if len(joints) == 1 else "s"} {abbreviate(joints)}'


def matching(patterns: Sequence[str], names: Sequence[str], source: str) -> list[str]:
    """Return the requested names, each once, in the requested order.

    Args:
        patterns: names, or patterns such as 'left*'; all names if empty.
        names: existing ones.
        source: name of the file in messages.

    Raises:
        RecordingError: a pattern matches nothing.

    """
    matches: list[str] = []
    for pattern in patterns:
        fitting = [name for name in names if pattern == name or fnmatchcase(name, pattern)]
        if not fitting:
            raise RecordingError(f'{source}: no joint {pattern!r}; there are '
                                 f'{abbreviate(names, 40)}')
        matches += fitting
    return list(dict.fromkeys(matches if patterns else names))


def unwrap(angles: np.ndarray) -> np.ndarray:
    """Return angles, rad, shape (n, joints), without jumps by whole turns; nan where missing."""
    angles = angles.copy()
    for column in angles.T:
        finite = np.isfinite(column)
        column[finite] = np.unwrap(column[finite])
    return angles


def recording_of(path: Path, stamps: np.ndarray, names: Sequence[str], angles: np.ndarray,
                 notes: Sequence[str] = (), joints: Sequence[str] = ()) -> Recording:
    """Make a recording of all angles of a file.

    Args:
        path: of the file.
        stamps: ns, int64, shape (n,).
        names: of the joints.
        angles: rad, shape (n, names).
        notes: initial notes.
        joints: names or patterns, in the order to return; all if empty.

    Raises:
        RecordingError: see `merged` and `matching`.

    """
    require(names, names, str(path))
    recording = merge_chunks([(stamps, names, angles)], printable(str(path)),
                   matching(joints, names, str(path)))
    return replace(recording, notes=(*map(printable, notes), *recording.notes))


def merge_chunks(chunks: Iterable[Chunk], source: str, joints: Sequence[str] = ()) -> Recording:
    """Join samples, each of all joints or of some, into one recording.

    Samples of different joints with the same stamp become one; a joint without a sample at a stamp
    is nan there. Among samples of a joint with the same stamp, the first is kept. Values that are
    not finite count as missing. A long recording is downsampled (see `downsampling`).

    Args:
        chunks: in the order of arrival, for each set of names; see `Chunk`.
        source: name of the recording in messages.
        joints: names in the order to return; all if empty.

    Raises:
        RecordingError: there is no sample, a joint is missing or has no finite position, or no
            time passes.

    """
    groups = _groups(chunks, source)
    names = list(dict.fromkeys(name for group in groups for name in group))
    if not names:
        raise RecordingError(f'{source}: no samples')
    require(joints, names, source)
    columns = tuple(joints) or tuple(names)
    parts, notes = _parts(groups, columns)
    parts, stamp_notes = drop_outlier_stamps(parts)
    notes += stamp_notes
    origin = min(int(stamps.min()) for stamps, _, _ in parts)
    num_samples = sum(len(stamps) for stamps, _, _ in parts)
    # What is no longer needed goes at once: a long recording is large.
    parts, num_late, duplicates = _sort_parts(parts, origin)
    outliers = drop_outlier_positions(parts, len(columns))
    times, positions, invalid, copies = _one_table(parts, len(columns))
    del parts
    if num_late:
        notes.append(f'{pluralize(num_late, "sample")} out of order, sorted by stamp')
    if count := duplicates + copies:
        notes.append(f'{pluralize(count, "duplicate")} of a stamp, the first is kept')
    invalid -= outliers
    notes += [f'joint {columns[k]!r}: {pluralize(int(invalid[k]), "position")} not a finite '
              'number' for k in np.flatnonzero(invalid)]
    notes += [f'joint {columns[k]!r}: {pluralize(int(outliers[k]), "position")} far beyond the '
              'others, left out' for k in np.flatnonzero(outliers)]
    valid = ~np.isnan(positions)
    empty = [name for name, has_values in zip(columns, valid.any(axis=0), strict=True)
             if not has_values]
    if empty:
        raise RecordingError(f'{source}: no finite position of {joint_list(empty)} in '
                             f'{pluralize(num_samples, "sample")}; name the joints to take to do '
                             'without')
    rows = valid.any(axis=1)
    if not rows.all():
        times, positions, valid = times[rows], positions[rows], valid[rows]
    if len(times) < 2:
        raise RecordingError(f'{source}: {pluralize(num_samples, "sample")}, all at stamp '
                             f'{origin / 1e9:.9f} s: no time passes')
    notes += _missing(columns, valid)
    notes += _intervals(columns, times, valid)
    return Recording(columns, times - times[0], positions, source,
                     origin / 1e9 + float(times[0]), tuple(notes))


def _groups(chunks: Iterable[Chunk], source: str
            ) -> dict[tuple[str, ...], Downsampler]:
    """Sort chunks by the joints they hold."""
    groups: dict[tuple[str, ...], Downsampler] = {}
    for stamps, names, positions in chunks:
        stamps, positions = np.asarray(stamps), np.asarray(positions, float)
        if stamps.ndim != 1 or positions.shape != (len(stamps), len(names)):
            raise RecordingError(f'{source}: {len(names)} names and positions of shape '
                                 f'{positions.shape} for stamps of shape {stamps.shape}')
        if not stamps.size or not len(names):
            continue
        if not np.issubdtype(stamps.dtype, np.integer):
            raise RecordingError(f'{source}: stamps must be whole nanoseconds, not {stamps.dtype}')
        beyond = np.abs(stamps.astype(float)) > MAX_TIME * 1e9
        if beyond.any():
            raise RecordingError(f'{source}: stamp of {float(stamps[beyond][0]) / 1e9:.6g} s')
        if len(set(names)) < len(names):
            require(names, names, source)
        groups.setdefault(tuple(names), Downsampler()).add(stamps.astype(np.int64), positions)
    return groups


def _parts(groups: dict[tuple[str, ...], Downsampler], names: tuple[str, ...]
           ) -> tuple[list[Part], list[str]]:
    """Take the wanted joints' samples out of groups; return them, and notes on downsampling."""
    parts, notes = [], []
    for group in list(groups):
        columns = [k for k, name in enumerate(group) if name in names]
        if columns:
            samples = groups.pop(group)
            stamps, positions = samples.flush()
            notes += [samples.note] if samples.note else []
            parts.append((stamps, [names.index(group[k]) for k in columns],
                          positions[:, columns] if len(columns) < len(group) else positions))
    return parts, notes


def _sort_parts(parts: list[Part], origin: int) -> tuple[list[Part], int, int]:
    """Sort samples by time, s from an origin in ns; keep the first of equal times.

    Returns:
        The samples, and how many were late and how many were duplicates.

    """
    parts_in_order, num_late, duplicates = [], 0, 0
    for stamps, columns, positions in parts:
        # Duplicates are found in float64, where two stamps can be one a week into a recording.
        times = (stamps - origin) / 1e9
        steps = np.diff(times)
        if (steps < 0.0).any():
            num_late += int((times < np.maximum.accumulate(times)).sum())
            order = np.argsort(times, kind='stable')
            times, positions = times[order], positions[order]
            steps = np.diff(times)
        if (steps == 0.0).any():
            first = np.append(True, steps > 0.0)
            duplicates += int((~first).sum())
            times, positions = times[first], positions[first]
        parts_in_order.append((times, columns, positions))
    return parts_in_order, num_late, duplicates


def _one_table(parts: list[Part], width: int
               ) -> tuple[np.ndarray, np.ndarray, np.ndarray, int]:
    """Return times, positions, number of odd values by joint, and number of repeated samples."""
    invalid, copies = np.zeros(width, int), 0
    for _, columns, positions in parts:
        mask = ~np.isfinite(positions)
        if mask.any():
            invalid[columns] += mask.sum(axis=0)
            positions[mask] = np.nan
    times, columns, positions = parts[0]
    if len(parts) == 1 and columns == list(range(width)):
        return times, positions, invalid, copies
    times = np.unique(np.concatenate([times for times, _, _ in parts]))
    table = np.full((len(times), width), np.nan)
    for part_times, columns, positions in parts:
        cells = np.searchsorted(times, part_times)[:, None], np.array(columns)
        before = table[cells]
        first = np.isnan(before)
        copies += int((~first & ~np.isnan(positions)).any(axis=1).sum())
        table[cells] = np.where(first, positions, before)
    return times, table, invalid, copies


def _missing(joints: tuple[str, ...], valid: np.ndarray) -> list[str]:
    """Name the joints that have fewer samples than others."""
    counts = valid.sum(axis=0)
    largest = counts.max()
    return [f'{joint_list([joints[k] for k in np.flatnonzero(counts == count)])}: '
            f'{pluralize(int(count), "sample")} where others have {largest}'
            for count in np.unique(counts[counts < largest])]


def _intervals(joints: tuple[str, ...], times: np.ndarray, valid: np.ndarray) -> list[str]:
    """Report dropouts and jitter of the intervals, for joints sampled together."""
    groups: dict[bytes, list[int]] = {}
    if valid.all():
        groups[b''] = list(range(len(joints)))
    else:
        for k in range(len(joints)):
            groups.setdefault(valid[:, k].tobytes(), []).append(k)
    notes = []
    for columns in groups.values():
        joint_times = times if valid.all() else times[valid[:, columns[0]]]
        if len(joint_times) < 3:
            continue
        steps = np.diff(joint_times)
        usual = float(np.median(steps))
        long = steps > DROPOUT_RATIO * usual
        prefix = '' if len(groups) == 1 else f'{joint_list([joints[k] for k in columns])}: '
        if long.any():
            num_lost = int((np.rint(steps[long] / usual) - 1).sum())
            longest = int(np.argmax(steps))
            notes.append(f'{prefix}{pluralize(int(long.sum()), "dropout")}, about '
                         f'{pluralize(num_lost, "sample")} of {len(joint_times) + num_lost}, the '
                         f'longest {steps[longest]:.4g} s at {joint_times[longest]:.4g} s')
        off = int((np.abs(steps - usual)[~long] > JITTER_RATIO * usual).sum())
        if off:
            notes.append(f'{prefix}{off} of {len(steps)} intervals jitter by more than '
                         f'{JITTER_RATIO:.0%} of the usual {usual:.4g} s')
    return notes


#: INDEXED_NAME: name of a position by its index: 'position[3]', 'dof_pos_3', 'q_3'.
INDEXED_NAME = re.compile(r'^(?:.*[./])?(?:positions?\[\d+\]|(?:(?:dof|joint)_?pos(?:itions?)?|q)'
                          r'_?(?:\d+|\[\d+\]))$', re.I)


def name_positions(recording: Recording, robot_joints: Sequence[str]) -> Recording:
    """Name unnamed positions by the order of a robot file.

    Raises:
        RecordingError: their number is not that of the robot's joints.

    """
    if len(recording.joints) != len(robot_joints):
        raise RecordingError(f'{recording.source}: {pluralize(len(recording.joints), "position")} '
                             f'without names, where the robot file has {len(robot_joints)} joints')
    return replace(recording, joints=tuple(robot_joints), notes=(
        *recording.notes, 'the positions have no names: they are taken in the order of the '
        'robot file'))


# Recordings of exactly one stride, as gait laboratories cut them.

#: NUM_COPIES: of a single stride that are analysed.
NUM_COPIES = 6
#: Largest gaps between end and begin of a declared and of a recognised stride, over the joint's
#: range.
MAX_DECLARED_GAP, MAX_RECOGNISED_GAP = 0.3, 0.1
#: Recognised strides. STRIDE_DURATIONS: shortest and longest, s; MIN_SEAM_SPEED: over the mean
#: one, as a motion from rest to rest closes, too; MIN_ODD_POWER: fraction of odd harmonics in the
#: power, as two strides have none.
STRIDE_DURATIONS, MIN_SEAM_SPEED, MIN_ODD_POWER = (0.1, 3.0), 0.3, 0.2


def repeat_stride(recording: Recording, duration: float = 0.0) -> Recording:
    """Return consecutive copies of a recording of exactly one stride.

    Args:
        recording: of one stride; its last sample may be the first one of the next stride.
        duration: of the stride, s; 0 to take it from the recording's times.

    Raises:
        RecordingError: the duration is unknown or impossible, or a joint does not return to its
            first angle.

    """
    length, step = float(recording.times[-1]), float(np.median(np.diff(recording.times)))
    if not duration and math.isnan(recording.cycle):
        raise RecordingError(f'{recording.source}: its times are fractions of a stride: give the '
                             'duration of the stride in s (--cycle)')
    if not 0.0 <= duration < math.inf:
        raise RecordingError(f'{recording.source}: a stride cannot last {duration:g} s')
    gaps, closed = _seam(recording)
    largest = int(np.argmax(gaps))
    if gaps[largest] > MAX_DECLARED_GAP:
        raise RecordingError(f'{recording.source}: not one stride: '
                             f'{joint_list(recording.joints[largest:largest + 1])} ends '
                             f'{gaps[largest]:.0%} of its range from where it begins')
    count = len(recording.times) - closed
    span = length if closed else length + step
    scale = duration / span if duration else 1.0
    starts = span * np.arange(NUM_COPIES)[:, None]
    loads = recording.loads
    if loads is not None:
        inside = loads.times < span
        loads = replace(loads, times=scale * (starts + loads.times[inside]).ravel(),
                        loads=np.tile(loads.loads[inside], (NUM_COPIES, 1)))
    return replace(
        recording, times=scale * (starts + recording.times[:count]).ravel(), loads=loads,
        positions=np.tile(recording.positions[:count], (NUM_COPIES, 1)), cycle=scale * span,
        body=None if recording.body is None else np.tile(recording.body[:count], (NUM_COPIES, 1)),
        notes=(*recording.notes, f'one stride, of {scale * span:.4g} s, which is repeated: it '
               'does not tell how strides differ'))


def recognise_stride(recording: Recording) -> Recording | None:
    """Return copies of a recording if it appears to be exactly one stride, or None."""
    x = recording.positions
    if recording.cycle or len(x) < 16 or not np.isfinite(x).all():
        return None
    gaps, closed = _seam(recording)
    normalised = x[:len(x) - closed] / np.maximum(np.ptp(x, axis=0), 1e-9)
    speeds = np.abs(normalised - np.roll(normalised, 1, axis=0)).mean(axis=1)
    power = np.sum(np.abs(np.fft.rfft(normalised - normalised.mean(axis=0), axis=0))**2, axis=1)
    if (gaps.max() > MAX_RECOGNISED_GAP
            or speeds[[0, 1, -1]].mean() < MIN_SEAM_SPEED * speeds.mean()
            or power[1::2].sum() < MIN_ODD_POWER * power.sum()
            or not STRIDE_DURATIONS[0] <= recording.times[-1] <= STRIDE_DURATIONS[1]):
        return None
    return repeat_stride(recording)


def _seam(recording: Recording) -> tuple[np.ndarray, bool]:
    """Return each joint's gap at the seam over its range, and whether the first sample returns."""
    x = recording.positions
    spans = np.nanmax(x, axis=0) - np.nanmin(x, axis=0)
    # A joint that hardly moves has no gap.
    spans = np.maximum(spans, 0.05 * spans.max())
    from_start, following = (np.nan_to_num(np.abs(end - x[0]) / spans)
                             for end in (x[-1], 2.0 * x[-1] - x[-2]))
    closed = bool(from_start.sum() <= following.sum())
    return (from_start if closed else following), closed


# The declaration of a format of recordings; each format is one file that ends in one of these.

@dataclass(frozen=True)
class Option:
    """An option of readers and of the command line.

    Attributes:
        name: of the reader's argument; on the command line after two dashes.
        help: in a phrase.
        metavar: its value in the help.
        choices: allowed values; any if empty.
        several: whether it takes one or more values, none by default.

    """

    name: str
    help: str  # noqa: A003
    metavar: str | None = None
    choices: tuple[str, ...] = ()
    several: bool = False


#: JOINTS: option of every reader.
JOINTS = Option('joints', "joints to use (default: the robot's, or all); for files other than "
                "bags also patterns such as 'JointPos*'", 'NAME', several=True)
UNIT = Option('unit', 'unit of the angles (default: as the file says, or rad)',
              choices=('rad', 'deg'))


@dataclass(frozen=True)
class RecordingFormat:
    """A format of recordings.

    Attributes:
        name: on the command line after two dashes.
        contents: kind of recording, with its article, for the head of the help.
        help: of the option for such a recording.
        metavar: the option's value in the help.
        read: reader: takes the path, then by name ``progress`` (show a bar) and the options below.
        endings: suffixes of the files' names.
        options: of the reader.
        features: further arguments of the reader: ``servo``, if it has velocities and efforts, and
            ``some``, to skip missing joints.
        lacks: option or feature -> why it is refused, in a phrase.
        recognises: tells whether a file with one of its suffixes is of this format, if others have
            that suffix, too.
        files_in: returns the sorted files of a folder that is one recording, or none for any other
            folder; None if recordings of this format are files.

    """

    name: str
    contents: str
    help: str  # noqa: A003
    metavar: str
    read: Callable[..., Recording]
    endings: tuple[str, ...]
    options: tuple[Option, ...] = (JOINTS,)
    features: tuple[str, ...] = ()
    lacks: Mapping[str, str] = field(default_factory=dict)
    recognises: Callable[[Path], bool] | None = None
    files_in: Callable[[Path], list[Path]] | None = None

    def validate(self, argument: str) -> str:
        """Return why its reader does not take an argument, or ''."""
        if argument in (*(option.name for option in self.options), *self.features):
            return ''
        return self.lacks.get(argument, f'{self.name} recordings have none')
