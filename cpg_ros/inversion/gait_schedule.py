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

"""What a generator is to be set to, and when, so that it changes gaits as a recording does."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
import itertools
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from cpg_ros.errors import CpgError, InputError
from cpg_ros.files.atomic_write import write_atomically
from cpg_ros.files.yaml_reader import shown, YamlReader
from cpg_ros.inversion.parameter_files import (
    check_plan,
    fitted_robot,
    parameter_tree,
    robot_file_of,
    running_parameters,
)
from cpg_ros.inversion.recording_fit import RecordingFit
from cpg_ros.inversion.stretch_fits import StretchFit
from cpg_ros.networks.registry import reference
from cpg_ros.robots.robot import JointMotion, Motion, Robot
from cpg_ros.robots.robot_file import write_robot
import yaml

#: Frequencies this near to one another, as a share, are one entry's.
SAME = 0.02
#: Latest time of an entry, s.
LATEST = 1e6


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
    fitted = [(one, one.fit) for one in stretches if one.fit is not None]
    if not fitted:
        raise InputError('no stretch could be fitted: ' + '; '.join(
            dict.fromkeys(one.why for one in stretches)))
    entries = [Entry(0.0, running_parameters(fitted[0][1]))]
    for (before, old), (after, new) in itertools.pairwise(fitted):
        same = (old.fit.gait == new.fit.gait
                and abs(new.stride.frequency / old.stride.frequency - 1.0) <= SAME)
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
    for one in sorted(stretches, key=lambda one: one.begin - one.end):
        if one.fit is not None:
            longest.setdefault(one.fit.fit.gait, one.fit)
    made = [fitted_robot(fit, robot) for fit in longest.values()]
    # Without a robot file each stretch gives limits of its own.
    bounds = {joint.name: joint for joint in made[0].joints}
    for joint in itertools.chain.from_iterable(other.joints for other in made[1:]):
        known = bounds[joint.name]
        bounds[joint.name] = replace(known, lower=min(known.lower, joint.lower),
                                     upper=max(known.upper, joint.upper),
                                     velocity=max(known.velocity, joint.velocity))
    motions = {gait: Motion(float(fit.stride.frequency), {
        name: JointMotion(offset, tuple(weights)) for name, (offset, weights)
        in fit.fit.readouts.items()}, duty=fit.fit.duty, stance=fit.fit.stance)
        for gait, fit in longest.items()}
    legs = {leg: tuple(bounds[joint.name] for joint in joints)
            for leg, joints in made[0].legs.items()}
    return replace(made[0], legs=legs, motions=motions)


def write_schedule(path: Path, stretches: Sequence[StretchFit], robot: Robot | None) -> list[Path]:
    """Write the schedule of a recording, and beside it the robot file that it names.

    Files that the generator would reject are not kept.

    Raises:
        InputError: as of schedule_of and robot_of, or the robot cannot move in one of the gaits.
        OSError: a file cannot be written.

    """
    beside = robot_file_of(path)
    schedule, moved = schedule_of(stretches, str(beside.resolve())), robot_of(stretches, robot)
    fits = [one.fit for one in stretches if one.fit is not None]
    summary = f'gaits of {fits[0].recording.source.rpartition(", ")[0]}'
    tree = {'network': schedule.network, 'robot': schedule.robot, 'schedule': [
        {'at': one.at, 'parameters': one.parameters} for one in schedule.entries]}
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
    reader = YamlReader(path, 'schedule', ScheduleError, LATEST)
    tree = reader.keys(reader.tree(), 'file', {'network', 'robot', 'schedule'})
    entries: list[Entry] = []
    for k, item in enumerate(reader.items(tree['schedule'], 'schedule')):
        where = f'schedule[{k}]'
        item = reader.keys(item, where, {'at', 'parameters'})
        at, earliest = reader.number(item['at'], f'{where}.at'), entries[-1].at if entries else 0.0
        if at < earliest or (entries and at == earliest):
            raise reader.fail(f'{where}.at', f'{at:g} s is not after {earliest:g} s')
        values = item['parameters']
        if not isinstance(values, dict) or not values:
            raise reader.fail(f'{where}.parameters', 'must be a mapping with at least one '
                              f'parameter, not {shown(values)}')
        for name, value in values.items():
            if not isinstance(value, str | int | float):
                raise reader.fail(f'{where}.parameters.{name}', 'must be a number or a text, not '
                                  f'{shown(value)}')
        entries.append(Entry(at, dict(values)))
    return GaitSchedule(reader.text(tree['network'], 'network'),
                        reader.text(tree['robot'], 'robot'), tuple(entries))
