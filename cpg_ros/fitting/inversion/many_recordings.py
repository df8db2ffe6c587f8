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

"""Inversion of folders of recordings: a row of the table for each, with a result or a reason."""

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from concurrent.futures import Executor
from dataclasses import dataclass, field, fields
import hashlib
from pathlib import Path
from tempfile import TemporaryDirectory
import time
import traceback
from typing import Any

from cpg_ros.common.errors import CpgError, InputError
from cpg_ros.common.jobs import JobOutcome, JobProgress, outcomes
from cpg_ros.fitting.inversion.parameter_files import robot_file_of, write_fitted
from cpg_ros.fitting.inversion.recording_fit import fit_recording, RecordingFit
from cpg_ros.fitting.inversion.results import (
    digest,
    FIT_FOLDER,
    library,
    outline,
    recordings_in,
    Results,
    write_page,
    write_tables,
)
from cpg_ros.fitting.recordings.formats import format_of, read_recording
from cpg_ros.fitting.recordings.recording import Recording
from cpg_ros.motion.robot import Robot

# The inversion of one recording, as a job: the result in plain types, or the reason for none.

#: Of a picture. POINTS: of a mean cycle; WIDTH, HEIGHT: pixels.
MAX_CURVES, POINTS, WIDTH, HEIGHT = 4, 32, 120, 36


@dataclass(frozen=True)
class FitSettings:
    """Settings of reading and fitting: the options of the executable ``inversion``."""

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
        recording: its path, also for workers.
        settings: of all recordings.
        known: digest of the contents at the last inversion, or ''.
        folder: of the fitted file.
        name: of the fitted file, without its suffix.

    """

    recording: Path
    settings: FitSettings
    known: str
    folder: Path
    name: str


def read(path: Path, settings: FitSettings) -> Recording:
    """Read a recording of any format, with those options that its format has."""
    kind, robot = format_of(path), settings.robot
    return read_recording(
        path, kind.name, progress=False,
        robot_joints=robot.order if robot else (),
        **{name: value for name, value in settings.reading.items() if not kind.validate(name)})


def invert_recording(task: Task) -> dict[str, Any]:
    """Invert a recording; the result contains the reason if that fails.

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
        result = fit_recording(read(task.recording, settings), settings.robot, settings.network,
                              settings.gait, free=settings.free, order=settings.order,
                              preset=settings.preset, starts=settings.starts)
        row |= {**_facts(result), 'picture': picture(result)}
        row['files'] = _files(task, result)
    except (CpgError, OSError) as error:
        row['reason'] = ' '.join(str(error).split())
    # A bug costs one row, too, and is reported with its traceback.
    except Exception as error:
        row['reason'] = f'{type(error).__name__}: {" ".join(str(error).split())}'
        row['traceback'] = traceback.format_exc()
    row['seconds'] = round(time.perf_counter() - began, 3)
    return row


def _facts(result: RecordingFit) -> dict[str, Any]:
    results = result.as_dict()
    return {'gait': results['gait'], 'recognised': results['recognised'] or '',
            'frequency': results['frequency'], 'frequency_error': results['frequency_error'],
            'confidence': results['confidence'], 'cycles': results['cycles'],
            'begin': results['begin'], 'end': results['end'], 'network': results['network'],
            'parameters': results['parameters'], 'phases': results['phases'],
            'rms_share': results['rms_share'],
            'joints': {name: joint['rms'] for name, joint in results['joints'].items()},
            'warnings': results['warnings']}


def _files(task: Task, result: RecordingFit) -> dict[str, str]:
    """Return the parameter file and the robot file, as they will be in their folder."""
    with TemporaryDirectory(prefix='cpg_ros_') as folder:
        paths = write_fitted(Path(folder, f'{task.name}.yaml'), result, task.settings.robot,
                             robot_file_of(task.folder / f'{task.name}.yaml'))
        return {path.name: path.read_text() for path in paths}


def picture(result: RecordingFit) -> str:
    """Return the mean cycles of the joints that move most, recorded and fitted, as a small SVG."""
    data, fitted = result.fit.recorded, result.fit.fitted
    span = data.max(axis=1) - data.min(axis=1)
    largest = sorted(span.argsort()[::-1][:MAX_CURVES])
    step = max(1, data.shape[1] // POINTS)
    lines = []
    for k, joint in enumerate(largest):
        low, size = data[joint].min(), max(span[joint], 1e-9)
        width = WIDTH / len(largest)
        for kind, row in (('r', data[joint]), ('f', fitted[joint])):
            points = ' '.join(
                f'{k * width + 0.9 * width * m / len(row[::step]):.0f},'
                f'{HEIGHT - 3 - (HEIGHT - 6) * (value - low) / size:.0f}'
                for m, value in enumerate(row[::step]))
            lines.append(f'<polyline class="{kind}" points="{points}"/>')
    return (f'<svg width="{WIDTH}" height="{HEIGHT}" role="img" aria-label="mean cycles">'
            f'{"".join(lines)}</svg>')


#: While waiting for new recordings: periods of looking at the folders and of writing tables, s.
SCAN_PERIOD, TABLE_PERIOD = 2.0, 30.0


@dataclass(frozen=True)
class Summary:
    """Numbers of recordings: all, those without a fit, those done before; and the files."""

    done: int
    failed: int
    kept: int
    written: tuple[Path, ...]


def settings_digest(settings: FitSettings) -> str:
    """Return a digest that differs between settings."""
    values = {field.name: getattr(settings, field.name) for field in fields(settings)}
    values |= values.pop('reading')
    lines = '\n'.join(f'{name}={value!r}' for name, value in values.items())
    return hashlib.sha256(lines.encode()).hexdigest()[:16]


class Folders:
    """Recordings of some folders, inverted into a folder of results."""

    def __init__(self, folders: Sequence[Path], out: Path, settings: FitSettings,
                 progress: bool = True) -> None:
        """Find the recordings.

        Raises:
            InputError: a folder does not exist or has no recordings, or out contains something
                else.
            MissingLibraryError: pyarrow is missing.

        """
        library()
        self.folders, self.settings, self.progress = folders, settings, progress
        # Before the folder of results is made: one that is not there leaves nothing behind.
        self.recordings = list(recordings_in(folders))
        self.results = Results(out, settings_digest(settings))
        self.recordings = list(recordings_in(folders))

    def tasks(self, recordings: Iterable[Path]) -> Iterator[Task]:
        """Yield the jobs, each made when it is needed."""
        for recording in recordings:
            row = self.results.get(recording)
            yield Task(recording.absolute(), self.settings, row['digest'] if row else '',
                       (self.results.folder / FIT_FOLDER).absolute(), self.results.name(recording))

    def keep(self, outcome: JobOutcome[Task], shown: Path, tally: JobProgress) -> None:
        """Store the result of a job, unless the recording was done before."""
        if outcome.error is None and 'reason' not in outcome.value:
            before = self.results.get(shown) or {'reason': ''}
            tally.add(failed=bool(before['reason']), kept=True)
            return
        row: dict[str, Any] = outcome.value if outcome.error is None else {
            'digest': '', 'reason': f'{type(outcome.error).__name__}: {outcome.error}',
            'seconds': None}
        tally.add(failed=bool(row['reason']))
        self.results.put(shown, row)

    def run(self, executor: Executor) -> Summary:
        """Invert all recordings that are not done, and write the table and the page.

        On KeyboardInterrupt, both are written for the finished recordings before it is raised.

        Raises:
            InputError: there are none.
            OSError: a result cannot be written.

        """
        if not self.recordings:
            raise InputError('no bags or tables in '
                             + ', '.join(str(folder) for folder in self.folders))
        tally = JobProgress('recordings', len(self.recordings), self.progress)
        try:
            with tally:
                self._through(executor, self.recordings, tally)
        except BaseException:
            self.write()
            raise
        return self.write(tally.kept)

    def _through(self, executor: Executor, recordings: Sequence[Path], tally: JobProgress) -> None:
        names = {recording.absolute(): recording for recording in recordings}
        for outcome in outcomes(executor, invert_recording, self.tasks(recordings), tally.tick):
            self.keep(outcome, names[outcome.job.recording], tally)

    def watch(self, executor: Executor, say: Callable[[str], None],
              goes_on: Callable[[], bool] = lambda: True) -> Summary:
        """Invert the recordings in the folders, and new ones, until interrupted.

        A recording is read once its files stay unchanged between two checks.

        Args:
            executor: any.
            say: takes a line for each recording.
            goes_on: called before every check; False ends the watch.

        """
        previous: dict[Path, Any] = {}
        outlines: dict[Path, Any] = {}
        last_write, waits = time.monotonic() - TABLE_PERIOD, False
        try:
            while goes_on():
                self.recordings = list(recordings_in(self.folders))
                now = {recording: outline(recording) for recording in self.recordings}
                ready = [recording for recording, at in now.items()
                         if at == previous.get(recording) != outlines.get(recording)]
                previous = now
                if ready:
                    for recording in ready:
                        say(f'new recording: {recording}')
                    with JobProgress('recordings', len(ready), self.progress) as tally:
                        self._through(executor, ready, tally)
                    outlines |= {recording: now[recording] for recording in ready}
                    waits = True
                if waits and time.monotonic() - last_write >= TABLE_PERIOD:
                    self.write()
                    last_write, waits = time.monotonic(), False
                time.sleep(SCAN_PERIOD)
        finally:
            summary = self.write()
        return summary

    def write(self, kept: int = 0) -> Summary:
        """Write the table and the page of the finished recordings."""
        def rows() -> Iterator[dict[str, Any]]:
            return self.results.rows(self.recordings)

        num_done = failed = 0
        for row in rows():
            num_done += 1
            failed += bool(row['reason'])
        page = self.results.folder / 'index.html'
        paths = write_tables(self.results.folder, rows)
        write_page(page, rows(), num_done, failed)
        return Summary(num_done, failed, kept, (*paths, page))
