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

"""The inversion of one recording, as a job: the result in plain types, or the reason for none."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from tempfile import TemporaryDirectory
import time
import traceback
from typing import Any

from cpg_ros.errors import CpgError
from cpg_ros.fleet.recordings_found import digest
from cpg_ros.inversion.parameter_files import robot_file_of, write_fitted
from cpg_ros.inversion.recording_fit import fit_recording, RecordingFit
from cpg_ros.recordings.formats import format_of, read_recording
from cpg_ros.recordings.recording import Recording
from cpg_ros.robots.robot import Robot

#: Joints that are drawn, points of their mean cycles, and the size of the picture in pixels.
DRAWN, POINTS, WIDTH, HEIGHT = 4, 32, 120, 36


@dataclass(frozen=True)
class FitSettings:
    """How recordings are read and fitted: as the options of the executable ``inversion``."""

    robot: Robot | None = None
    network: str = ''
    gait: str = ''
    preset: str = ''
    free: tuple[str, ...] = ()
    order: int = 3
    starts: tuple[Mapping[str, float], ...] = ()
    #: As of read_recording; each is for those recordings whose format has it.
    reading: Mapping[str, Any] = field(default_factory=dict)


@dataclass(frozen=True)
class Task:
    """A recording to invert.

    Attributes:
        recording: where it is, for workers, too.
        settings: as for all.
        known: digest of the contents that were inverted before, or ''.
        folder: that the fitted file will be in.
        name: of the fitted file, without its ending.

    """

    recording: Path
    settings: FitSettings
    known: str
    folder: Path
    name: str


def read(path: Path, settings: FitSettings) -> Recording:
    """Read a recording of any format, by those of the options that it has."""
    chosen, robot = format_of(path), settings.robot
    return read_recording(
        path, chosen.name, progress=False,
        robot_joints=[joint.name for joint in robot.joints] if robot else (),
        **{name: value for name, value in settings.reading.items() if not chosen.refusal(name)})


def invert_recording(task: Task) -> dict[str, Any]:
    """Invert a recording; the result contains whatever is wrong with it.

    Returns:
        ``digest``, and nothing else if that is the known one; otherwise the fields of a row of
        the table, ``files`` (name -> text) and ``picture`` (SVG).

    """
    began = time.perf_counter()
    row: dict[str, Any] = {'digest': '', 'reason': ''}
    try:
        row['digest'] = digest(task.recording)
        if task.known and row['digest'] == task.known:
            return {'digest': task.known}
        settings = task.settings
        found = fit_recording(read(task.recording, settings), settings.robot, settings.network,
                              settings.gait, free=settings.free, order=settings.order,
                              preset=settings.preset, starts=settings.starts)
        row |= {**_facts(found), 'picture': picture(found)}
        row['files'] = _files(task, found)
    except (CpgError, OSError) as error:
        row['reason'] = ' '.join(str(error).split())
    # A bug costs one row, too, and is reported with its traceback.
    except Exception as error:
        row['reason'] = f'{type(error).__name__}: {" ".join(str(error).split())}'
        row['traceback'] = traceback.format_exc()
    row['seconds'] = round(time.perf_counter() - began, 3)
    return row


def _facts(found: RecordingFit) -> dict[str, Any]:
    results = found.as_dict()
    return {'gait': results['gait'], 'recognised': results['recognised'] or '',
            'frequency': results['frequency'], 'frequency_error': results['frequency_error'],
            'confidence': results['confidence'], 'cycles': results['cycles'],
            'begin': results['begin'], 'end': results['end'], 'network': results['network'],
            'parameters': results['parameters'], 'phases': results['phases'],
            'rms_share': results['rms_share'],
            'joints': {name: one['rms'] for name, one in results['joints'].items()},
            'warnings': results['warnings']}


def _files(task: Task, found: RecordingFit) -> dict[str, str]:
    """The parameter file and the robot file, as they will be in their folder."""
    with TemporaryDirectory(prefix='cpg_ros_') as folder:
        written = write_fitted(Path(folder, f'{task.name}.yaml'), found, task.settings.robot,
                               robot_file_of(task.folder / f'{task.name}.yaml'))
        return {path.name: path.read_text() for path in written}


def picture(found: RecordingFit) -> str:
    """Mean cycles of the joints that move most, recorded and fitted, as a small SVG."""
    recorded, fitted = found.fit.recorded, found.fit.fitted
    span = recorded.max(axis=1) - recorded.min(axis=1)
    largest = sorted(span.argsort()[::-1][:DRAWN])
    step = max(1, recorded.shape[1] // POINTS)
    lines = []
    for k, joint in enumerate(largest):
        low, size = recorded[joint].min(), max(span[joint], 1e-9)
        width = WIDTH / len(largest)
        for kind, row in (('r', recorded[joint]), ('f', fitted[joint])):
            points = ' '.join(
                f'{k * width + 0.9 * width * m / len(row[::step]):.0f},'
                f'{HEIGHT - 3 - (HEIGHT - 6) * (value - low) / size:.0f}'
                for m, value in enumerate(row[::step]))
            lines.append(f'<polyline class="{kind}" points="{points}"/>')
    return (f'<svg width="{WIDTH}" height="{HEIGHT}" role="img" aria-label="mean cycles">'
            f'{"".join(lines)}</svg>')
