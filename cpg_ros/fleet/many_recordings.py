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

"""Folders of recordings inverted: a row for each, whatever is wrong with it."""

from collections.abc import Callable, Iterable, Iterator, Sequence
from concurrent.futures import Executor
from dataclasses import dataclass, fields
import hashlib
from pathlib import Path
import time
from typing import Any

from cpg_ros.errors import InputError
from cpg_ros.fleet.outcomes import JobOutcome, outcomes
from cpg_ros.fleet.recording_job import FitSettings, invert_recording, Task
from cpg_ros.fleet.recordings_found import found, outline
from cpg_ros.fleet.results import FITTED, Results
from cpg_ros.fleet.results_page import write_page
from cpg_ros.fleet.results_table import library, write_tables
from cpg_ros.fleet.tally import Tally

#: While new recordings are waited for: seconds between two looks at the folders, and between two
#: tables.
LOOK, TABLES = 2.0, 30.0


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
        """Look for the recordings.

        Raises:
            InputError: a folder is not there or has no recordings, or out holds something else.
            MissingLibraryError: pyarrow is missing.

        """
        library()
        self.folders, self.settings, self.progress = folders, settings, progress
        # Before the folder of results is made: one that is not there leaves nothing behind.
        self.recordings = list(found(folders))
        self.results = Results(out, settings_digest(settings))
        self.recordings = list(found(folders))

    def tasks(self, recordings: Iterable[Path]) -> Iterator[Task]:
        """Yield the jobs, each made when it is needed."""
        for one in recordings:
            row = self.results.get(one)
            yield Task(one.absolute(), self.settings, row['digest'] if row else '',
                       (self.results.folder / FITTED).absolute(), self.results.name(one))

    def keep(self, outcome: JobOutcome[Task], shown: Path, tally: Tally) -> None:
        """Store the outcome of a job, unless the recording was done before."""
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
        tally = Tally('recordings', len(self.recordings), self.progress)
        try:
            with tally:
                self._through(executor, self.recordings, tally)
        except BaseException:
            self.write()
            raise
        return self.write(tally.kept)

    def _through(self, executor: Executor, recordings: Sequence[Path], tally: Tally) -> None:
        shown = {one.absolute(): one for one in recordings}
        for outcome in outcomes(executor, invert_recording, self.tasks(recordings), tally.tick):
            self.keep(outcome, shown[outcome.job.recording], tally)

    def watch(self, executor: Executor, say: Callable[[str], None],
              goes_on: Callable[[], bool] = lambda: True) -> Summary:
        """Invert the recordings in the folders, and new ones, until interrupted.

        A recording is read once its files do not change between two looks.

        Args:
            executor: any.
            say: takes a line for each recording that is taken.
            goes_on: called before every look; False ends the watch.

        """
        seen: dict[Path, Any] = {}
        done: dict[Path, Any] = {}
        written, waits = time.monotonic() - TABLES, False
        try:
            while goes_on():
                self.recordings = list(found(self.folders))
                now = {one: outline(one) for one in self.recordings}
                ready = [one for one, at in now.items() if at == seen.get(one) != done.get(one)]
                seen = now
                if ready:
                    for one in ready:
                        say(f'new recording: {one}')
                    with Tally('recordings', len(ready), self.progress) as tally:
                        self._through(executor, ready, tally)
                    done |= {one: now[one] for one in ready}
                    waits = True
                if waits and time.monotonic() - written >= TABLES:
                    self.write()
                    written, waits = time.monotonic(), False
                time.sleep(LOOK)
        finally:
            summary = self.write()
        return summary

    def write(self, kept: int = 0) -> Summary:
        """Write the table and the page of the finished recordings."""
        def rows() -> Iterator[dict[str, Any]]:
            return self.results.rows(self.recordings)

        done = failed = 0
        for row in rows():
            done += 1
            failed += bool(row['reason'])
        page = self.results.folder / 'index.html'
        written = write_tables(self.results.folder, rows)
        write_page(page, rows(), done, failed)
        return Summary(done, failed, kept, (*written, page))
