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

"""Gait schedules: settings of a generator over time, from a recording that changes its gait."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
import itertools
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from cpg_ros.common.errors import CpgError, InputError, ShortRepr
from cpg_ros.common.files import write_atomically
from cpg_ros.common.yaml_reader import quoted, YamlReader
from cpg_ros.fitting.gaits.quality_checks import PHASE_CHANGE_THRESHOLD, RELIABLE_CYCLES
from cpg_ros.fitting.gaits.stride import NoSteadyGait, Stride
from cpg_ros.fitting.inversion.parameter_files import (
    check_plan,
    fitted_motion,
    fitted_robot,
    parameter_tree,
    robot_file_of,
    running_parameters,
)
from cpg_ros.fitting.inversion.recording_fit import (
    fit_recording,
    leg_joints,
    network_for,
    network_name,
    RecordingFit,
    stride_of,
)
from cpg_ros.fitting.recordings.recording import Recording, RecordingError
from cpg_ros.motion.robot import Robot
from cpg_ros.motion.robot_file import write_robot
from cpg_ros.networks.registry import reference
import numpy as np
import yaml

# Changes of the legs' phases within a stretch of one frequency, as of a walk that becomes a trot.

#: MIN_STRIDES: on either side of a change.
MIN_STRIDES = int(RELIABLE_CYCLES)


def phase_change(recording: Recording, legs: Mapping[str, Sequence[str]], stride: Stride
                 ) -> float | None:
    """Return when the phases of the legs change within a stretch, s, to about one stride.

    Args:
        recording: of the joints.
        legs: leg -> its joints.
        stride: found in the recording, whose stretch is looked at.

    Returns:
        The recording's time, None if no leg changes its phase by more than a tenth of a cycle.

    """
    points = _points(recording, legs, stride)
    count = len(points)
    if count < 2 * MIN_STRIDES:
        return None
    sums = np.cumsum(points, axis=0)
    ends = np.arange(MIN_STRIDES, count - MIN_STRIDES + 1)[:, None]
    before = sums[ends[:, 0] - 1] / ends
    after = (sums[-1] - sums[ends[:, 0] - 1]) / (count - ends)
    ratio = ends * (count - ends) / count * np.abs(after - before)**2
    best = int(np.argmax(ratio.sum(axis=1)))
    shift = np.angle(after[best] * before[best].conj()) / (2.0 * np.pi)
    if np.abs(shift).max() <= PHASE_CHANGE_THRESHOLD:
        return None
    first = np.ceil(stride.warp.phases[0])
    return float(np.interp(first + ends[best, 0], stride.warp.phases, stride.warp.knots))


def _points(recording: Recording, legs: Mapping[str, Sequence[str]], stride: Stride
            ) -> np.ndarray:
    """Return exp(2 pi i phase) of the legs against the first, shape (whole strides, legs - 1)."""
    warp, joints = stride.warp, list(recording.joints)
    inside = (recording.times >= warp.knots[0]) & (recording.times <= warp.knots[-1])
    phases = warp(recording.times[inside])
    first, last = int(np.ceil(phases[0])), int(np.floor(phases[-1]))
    number = np.floor(phases).astype(int) - first
    complete = (number >= 0) & (number < last - first)
    phasor = np.exp(-2j * np.pi * phases[complete])
    sums = []
    for leg in stride.phases:
        name = max((joint for joint in legs[leg] if joint in stride.joints),
                   key=lambda joint: float(np.ptp(stride.mean[stride.joints.index(joint)])))
        x = recording.positions[inside, joints.index(name)][complete]
        x = np.where(np.isfinite(x), x - np.nanmean(x), 0.0) * phasor
        sums.append(np.bincount(number[complete], x.real, last - first)
                    + 1j * np.bincount(number[complete], x.imag, last - first))
    ahead = np.array(sums[1:]) * np.conj(sums[0])
    return (ahead / np.maximum(np.abs(ahead), 1e-300)).T


# A recording that changes its gait, cut into its steady stretches, each of them fitted.

#: MIN_DURATION: of a remainder that is searched, s: three strides of the largest frequency.
MIN_DURATION = 0.24


@dataclass(frozen=True, eq=False, repr=False)
class StretchFit(ShortRepr):
    """A steady stretch of a recording.

    Attributes:
        begin, end: s from the recording's start.
        stride: of the stretch, on a clock of its own.
        fit: the network's gait fitted to it; None if that failed.
        why: why there is no fit.

    """

    begin: float
    end: float
    stride: Stride
    fit: RecordingFit | None
    why: str = ''

    def _summary(self) -> str:
        return (f'{self.begin:.2f} to {self.end:.2f} s: {self.stride.verdict}, '
                f'{self.stride.frequency:.4g} Hz')

    @property
    def gait(self) -> str | None:
        """Name of the gait, None if it is not a gait of the network or undecided."""
        return None if len(self.stride.candidates) > 1 else self.stride.gait


    @property
    def confidence(self) -> float:
        """Probability that gait and frequency are those named, as of RecordingFit."""
        return self.stride.confidence if self.fit is None else self.fit.confidence


def cut(recording: Recording, robot: Robot | None = None, network: str = ''
        ) -> list[tuple[float, float, Stride]]:
    """Return begin and end, s, and stride of the steady stretches of a recording, in its order.

    Args:
        recording: joints over time.
        robot: which joints belong to which legs; by default their names decide.
        network: whose gaits they may be; by default as of fit_recording.

    Raises:
        NoSteadyGait: there is none.
        CpgError: as of fit_recording.

    """
    legs, _ = leg_joints(recording, robot)
    kind = network_for(network, legs, robot)
    strides: list[tuple[float, float, Stride]] = []
    remains = [(0.0, float(recording.times[-1]))]
    reason: NoSteadyGait | None = None
    longest: Stride | None = None
    while remains:
        begin, end = remains.pop()
        try:
            part = recording.between(begin, end)
            _, stride = stride_of(part, legs, kind, robot)
        except NoSteadyGait as error:
            reason = reason or error
            continue
        except RecordingError:
            # Fewer than two samples are no stretch.
            continue
        origin = part.start - recording.start
        change = phase_change(part, legs, stride)
        if change is not None:
            # The change, and one stride on either side, belong to neither gait.
            remains += _longer((begin, origin + change - 1.0 / stride.frequency),
                               (origin + change + 1.0 / stride.frequency, end))
            continue
        first, last = origin + stride.begin, origin + stride.end
        longest = longest or stride
        if stride.cycles >= RELIABLE_CYCLES:
            strides.append((first, last, stride))
        remains += _longer((begin, first), (last, end))
    if not strides:
        raise reason or NoSteadyGait(f'{recording.source}: no steady gait of {RELIABLE_CYCLES:g} '
                                     'strides' + (
                                      f', only of {longest.cycles}, of '
                                      f'{1.0 / longest.frequency:.3g} s each: record '
                                      f'{RELIABLE_CYCLES / longest.frequency:.2g} s or more'
                                      if longest else ''))
    return sorted(strides, key=lambda piece: piece[0])


def _longer(*parts: tuple[float, float]) -> list[tuple[float, float]]:
    return [(begin, end) for begin, end in parts if end - begin >= MIN_DURATION]


def fit_stretches(recording: Recording, robot: Robot | None = None, network: str = '', *,
                  order: int = 3, done: Callable[[float], None] = lambda fraction: None
                  ) -> list[StretchFit]:
    """Fit a network's gaits to all steady stretches of a recording.

    Args:
        recording: joints over time.
        robot: as of fit_recording.
        network: one for all stretches; by default as of fit_recording.
        order: of the readouts, 1 to 3.
        done: called with the fraction of the fits that is done, 0 to 1.

    Raises:
        CpgError: as of cut.

    """
    name, fits = network_name(network, leg_joints(recording, robot)[0], robot), []
    stretches = cut(recording, robot, network)
    for k, (begin, end, stride) in enumerate(stretches):
        part = replace(recording.between(begin, end),
                       source=f'{recording.source}, {begin:.2f} to {end:.2f} s')

        def so_far(fraction: float, before: int = k) -> None:
            done((before + fraction) / len(stretches))
        try:
            fit = fit_recording(part, robot, name, order=order, done=so_far)
            fits.append(StretchFit(begin, end, fit.stride, fit))
        except CpgError as error:
            fits.append(StretchFit(begin, end, stride, None, str(error)))
    return fits


def stretch_rows(fits: Sequence[StretchFit]) -> list[tuple[str, ...]]:
    """Return stretches as a table, with its head."""
    rows: list[tuple[str, ...]] = [('begin [s]', 'end [s]', 'gait', 'frequency [Hz]', 'strides',
                                    'confidence', 'RMS error')]
    return rows + [(f'{stretch.begin:.2f}', f'{stretch.end:.2f}', stretch.stride.verdict,
                    f'{stretch.stride.frequency:.4f}', str(stretch.stride.cycles),
                    f'{stretch.confidence:.3f}', 'not fitted' if stretch.fit is None else
                    f'{100.0 * stretch.fit.fit.mean_rms_share:.1f} %') for stretch in fits]


#: FREQUENCY_TOLERANCE: relative, of two stretches that share an entry.
FREQUENCY_TOLERANCE = 0.02
#: MAX_TIME: of an entry, s.
MAX_TIME = 1e6


class ScheduleError(CpgError):
    """A schedule cannot be used; one line with the file, the key and the reason."""


@dataclass(frozen=True)
class Entry:
    """Parameters of the generator, by name, and when to set them, s from the start."""

    at: float
    parameters: dict[str, Any]


@dataclass(frozen=True)
class GaitSchedule:
    """Changes of gait over time.

    Attributes:
        network: that the generator has to run, as its parameter names it.
        robot: path of the robot file with the gaits' readouts, or a shipped robot's name.
        entries: at rising times.

    """

    network: str
    robot: str
    entries: tuple[Entry, ...]


def schedule_of(stretches: Sequence[StretchFit], robot: str) -> GaitSchedule:
    """Return the changes of gait of a recording; each comes in the middle of its transition.

    Args:
        stretches: as of fit_stretches; those without a fit are passed over.
        robot: path of the robot file.

    Raises:
        InputError: no stretch has a fit.

    """
    fitted = [(stretch, stretch.fit) for stretch in stretches if stretch.fit is not None]
    if not fitted:
        raise InputError('no stretch could be fitted: ' + '; '.join(
            dict.fromkeys(stretch.why for stretch in stretches)))
    entries = [Entry(0.0, running_parameters(fitted[0][1]))]
    for (before, old), (after, new) in itertools.pairwise(fitted):
        same = (old.fit.gait == new.fit.gait
                and abs(new.stride.frequency / old.stride.frequency - 1.0) <= FREQUENCY_TOLERANCE)
        if not same:
            entries.append(Entry(round(0.5 * (before.end + after.begin), 3),
                                 running_parameters(new)))
    return GaitSchedule(reference(fitted[0][1].fit.network.name), robot, tuple(entries))


def robot_of(stretches: Sequence[StretchFit], robot: Robot | None) -> Robot:
    """Return a robot that moves in each gait as in the longest stretch of it.

    Args:
        stretches: as of fit_stretches.
        robot: as of fitted_robot.

    Raises:
        InputError: as of fitted_robot.

    """
    longest: dict[str, RecordingFit] = {}
    for stretch in sorted(stretches, key=lambda stretch: stretch.begin - stretch.end):
        if stretch.fit is not None:
            longest.setdefault(stretch.fit.fit.gait, stretch.fit)
    robots = [fitted_robot(fit, robot) for fit in longest.values()]
    # Without a robot file each stretch gives limits of its own.
    bounds = {joint.name: joint for joint in robots[0].joints}
    for joint in itertools.chain.from_iterable(other.joints for other in robots[1:]):
        bound = bounds[joint.name]
        bounds[joint.name] = replace(bound, lower=min(bound.lower, joint.lower),
                                     upper=max(bound.upper, joint.upper),
                                     velocity=max(bound.velocity, joint.velocity))
    motions = robots[0].motions | {
        gait: fitted_motion(fit, None) if robot is None else stretch.motions[gait]
        for (gait, fit), stretch in zip(longest.items(), robots, strict=True)}
    legs = {leg: tuple(bounds[joint.name] for joint in joints)
            for leg, joints in robots[0].legs.items()}
    return replace(robots[0], legs=legs, motions=motions)


def write_schedule(path: Path, stretches: Sequence[StretchFit], robot: Robot | None) -> list[Path]:
    """Write the schedule of a recording, and beside it the robot file that it names.

    Files that the generator would reject are not kept.

    Raises:
        InputError: as of schedule_of and robot_of, or the robot cannot move in one of the gaits.
        OSError: a file cannot be written.

    """
    beside = robot_file_of(path)
    schedule, moved = schedule_of(stretches, str(beside.resolve())), robot_of(stretches, robot)
    fits = [item.fit for item in stretches if item.fit is not None]
    summary = f'gaits of {fits[0].recording.source.rpartition(", ")[0]}'
    tree = {'network': schedule.network, 'robot': schedule.robot, 'schedule': [
        {'at': item.at, 'parameters': item.parameters} for item in schedule.entries]}
    with TemporaryDirectory(prefix='.', dir=path.absolute().parent) as folder:
        joints = Path(folder, beside.name)
        write_robot(joints, moved, summary)
        for fit in fits:
            check_plan(parameter_tree(fit, joints), joints,
                       f'{fit.recording.source}: robot {moved.name}')
        write_atomically(path, f'# {summary}; play it with: cpg play-schedule {path.name}\n'
                         + yaml.safe_dump(tree, sort_keys=False))
        joints.replace(beside)
    return [path, beside]


def read_schedule(path: Path) -> GaitSchedule:
    """Read and check a schedule.

    Raises:
        ScheduleError: it cannot be read, or a value in it cannot be used.

    """
    reader = YamlReader(path, 'schedule', ScheduleError, MAX_TIME)

    def parameters(values: Any, where: str) -> dict[str, Any]:
        if not isinstance(values, dict) or not values:
            raise reader.fail(where, 'must be a mapping with at least one parameter, not '
                              f'{quoted(values)}')
        for name, value in values.items():
            if not isinstance(value, str | int | float):
                raise reader.fail(f'{where}.{name}', 'must be a number or a text, not '
                                  f'{quoted(value)}')
        return dict(values)

    tree = reader.keys(reader.tree(), 'file', {'network', 'robot', 'schedule'})
    entries: list[Entry] = []
    for k, item in enumerate(reader.items(tree['schedule'], 'schedule')):
        entry = reader.record(Entry, item, f'schedule[{k}]', parameters=parameters)
        earliest = entries[-1].at if entries else 0.0
        if entry.at < earliest or (entries and entry.at == earliest):
            raise reader.fail(f'schedule[{k}].at', f'{entry.at:g} s is not after {earliest:g} s')
        entries.append(entry)
    return GaitSchedule(reader.text(tree['network'], 'network'),
                        reader.text(tree['robot'], 'robot'), tuple(entries))
