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

"""A stream of jobs into an executor, and of their outcomes out of it.

Jobs are created only when there is room for them, and an outcome is released once it is taken, so
memory does not grow with the number of jobs.
"""

from collections import deque
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import CancelledError, Executor, FIRST_COMPLETED, Future, wait
from concurrent.futures.process import BrokenProcessPool
from dataclasses import dataclass
import itertools
import sys
import time
from types import TracebackType
from typing import Any, Generic, TextIO, TypeVar

from cpg_ros.common.errors import CpgError

# The progress of many jobs: done, failed, rate and time left.

#: LINE_PERIOD: between lines if there is no terminal, s; REDRAW_PERIOD: between updates on a
#: terminal, s; PROGRESS_DELAY: before the first of these, s.
LINE_PERIOD, REDRAW_PERIOD, PROGRESS_DELAY = 60.0, 0.2, 2.0


def _time(seconds: float) -> str:
    if seconds < 90.0:
        return f'{seconds:.0f} s'
    if seconds < 5400.0:
        return f'{seconds / 60.0:.0f} min'
    return f'{seconds / 3600.0:.1f} h'


class JobProgress:
    """Counts jobs and reports their progress on standard error.

    Attributes:
        total: jobs there are; None while that is not known.
        done: jobs that have ended, those that failed among them.
        failed: of these.
        kept: jobs that earlier runs had done.

    """

    def __init__(self, what: str, total: int | None, enabled: bool = True,
                 stream: TextIO | None = None,
                 clock: Callable[[], float] = time.monotonic) -> None:
        self.what, self.total = what, total
        self.done = self.failed = self.kept = 0
        self._stream = stream or sys.stderr
        self._enabled, self._clock = enabled, clock
        self._live = self._stream.isatty()
        self._began = self._reported = clock()
        self._drawn = False

    def add(self, failed: bool = False, kept: bool = False) -> None:
        """Count a job."""
        self.done += 1
        self.failed += failed
        self.kept += kept
        self.tick()

    @property
    def line(self) -> str:
        """The progress, as one line."""
        elapsed = self._clock() - self._began
        computed = self.done - self.kept
        rate = computed / elapsed if elapsed > 0.0 else 0.0
        parts = [f'{self.what}: {self.done}' + ('' if self.total is None else f' of {self.total}')
                 + ' done', f'{self.failed} failed']
        if self.kept:
            parts.append(f'{self.kept} from before')
        parts.append(f'{rate:.2f} a second' if rate >= 1.0 else f'{60.0 * rate:.2g} a minute')
        if self.total is not None and computed and self.done < self.total:
            parts.append(f'{_time((self.total - self.done) / rate)} left')
        return ', '.join(parts)

    def tick(self) -> None:
        """Report the progress if it is due."""
        now = self._clock()
        period = REDRAW_PERIOD if self._live else LINE_PERIOD
        if not self._enabled or now - self._reported < period:
            return
        if self._live and now - self._began < PROGRESS_DELAY:
            return
        self._reported, self._drawn = now, True
        self._write()

    def _write(self) -> None:
        self._stream.write(f'\r{self.line}\x1b[K' if self._live else self.line + '\n')
        self._stream.flush()

    def __enter__(self) -> 'JobProgress':
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None,
                 trace: TracebackType | None) -> None:
        if self._enabled and self._drawn:
            self._write()
            if self._live:
                self._stream.write('\n')


#: TICK_PERIOD: longest time between two calls of tick, s.
TICK_PERIOD = 0.5
#: MAX_DEATHS: of workers under a job while it runs alone; then it is blamed.
MAX_DEATHS = 2
#: DEFAULT_ROOM: number of jobs that an executor has room for.
DEFAULT_ROOM = 8

Job = TypeVar('Job')


class WorkerDied(CpgError):
    """The process that ran a job died."""


@dataclass(frozen=True)
class JobOutcome(Generic[Job]):
    """The outcome of a job.

    Attributes:
        job: its arguments.
        value: return value of the job.
        error: exception of the job, or None.

    """

    job: Job
    value: Any
    error: BaseException | None = None


class ResilientExecutor(Executor):
    """An executor that survives the loss of its workers, and yields results in order.

    Attributes:
        inner: the executor that runs the jobs now.
        room: jobs that are handed to it at the same time.
        what: name of the jobs of map in progress messages; '' prints none.

    """

    what = ''

    def __init__(self, inner: Executor, room: int = DEFAULT_ROOM,
                 renew: Callable[[], tuple[Executor, int]] | None = None,
                 close: Callable[[bool], None] = lambda wait: None) -> None:
        """Run jobs with an executor.

        Args:
            inner: the executor.
            room: jobs that are handed to it at the same time.
            renew: makes another one like it and returns it with its room; without it a broken
                executor ends the work.
            close: releases the workers; if it is given True, after the jobs under way.

        """
        self.inner, self.room = inner, room
        self._renew, self._close = renew, close

    def submit(self, function: Callable[..., Any], /, *arguments: Any, **options: Any
               ) -> Future[Any]:
        """Submit a job."""
        return self.inner.submit(function, *arguments, **options)

    def map(self, function: Callable[..., Any], *iterables: Any, timeout: float | None = None,
            chunksize: int = 1) -> Iterator[Any]:
        """Yield results in the order of the jobs; jobs of a worker that dies are done again."""
        jobs = [(number, function, job)
                for number, job in enumerate(zip(*iterables, strict=False))]
        waiting: dict[int, Any] = {}
        following = 0
        with JobProgress(self.what, len(jobs), bool(self.what)) as tally:
            for outcome in outcomes(self, _applied, jobs, tally.tick):
                if outcome.error is not None:
                    raise outcome.error
                waiting[outcome.job[0]] = outcome.value
                while following in waiting:
                    tally.add()
                    yield waiting.pop(following)
                    following += 1

    def lost(self, error: BaseException) -> bool:
        """Return whether an error means that the executor broke, not that the job failed."""
        return self._renew is not None and isinstance(error, BrokenProcessPool | CancelledError)

    def renew(self) -> None:
        """Replace an executor that broke.

        Raises:
            NoCluster: a scheduler does not come back.

        """
        assert self._renew is not None
        self.inner, self.room = self._renew()

    def shutdown(self, wait: bool = True, *, cancel_futures: bool = False) -> None:
        """Release the workers, without waiting for jobs that are under way if wait is False."""
        self._close(wait)


class _Stream(Generic[Job]):
    def __init__(self, executor: Executor, function: Callable[..., Any],
                 jobs: Iterable[Job]) -> None:
        self.fleet = executor if isinstance(executor,
                                            ResilientExecutor) else ResilientExecutor(executor)
        self.function, self.jobs = function, iter(jobs)
        self.flying: dict[Future[Any], Job] = {}
        # Jobs that were running when a worker died: each runs alone, which identifies the cause.
        self.suspects: deque[tuple[Job, int]] = deque()
        self.alone: tuple[Job, int] | None = None

    def _send(self, job: Job) -> bool:
        try:
            future = self.fleet.submit(self.function, job)
        except BrokenProcessPool:
            return False
        self.flying[future] = job
        return True

    def fill(self) -> None:
        """Submit as many jobs as there is room for."""
        if self.alone is not None and self.flying:
            return
        if self.suspects:
            if not self.flying:
                self.alone = self.suspects.popleft()
                if not self._send(self.alone[0]):
                    self.suspects.appendleft(self.alone)
                    self.fleet.renew()
            return
        for job in itertools.islice(self.jobs, max(0, self.fleet.room - len(self.flying))):
            if not self._send(job):
                self.suspects.append((job, 0))
                self.fleet.renew()
                return

    def ended(self) -> Iterator[JobOutcome[Job]]:
        """Yield the outcomes of jobs that have ended; wait TICK_PERIOD at most."""
        done, _ = wait(self.flying, TICK_PERIOD, FIRST_COMPLETED)
        broken: BaseException | None = None
        retries: list[Job] = []
        for future in done:
            job = self.flying.pop(future)
            error = CancelledError() if future.cancelled() else future.exception()
            if error is not None and self.fleet.lost(error):
                broken = error
                retries.append(job)
                continue
            self.alone = None
            yield JobOutcome(job, None if error else future.result(), error)
        if broken is None:
            return
        # All other jobs in the executor are lost, too.
        retries += self.flying.values()
        self.flying.clear()
        died = isinstance(broken, BrokenProcessPool)
        if self.alone is not None:
            job, deaths = self.alone
            self.alone = None
            if died and deaths + 1 >= MAX_DEATHS:
                yield JobOutcome(job, None, WorkerDied('the process that worked on this job died'))
            else:
                self.suspects.appendleft((job, deaths + died))
        elif died:
            self.suspects.extend((job, 0) for job in retries)
        else:
            self.jobs = itertools.chain(retries, self.jobs)
        self.fleet.renew()


def outcomes(executor: Executor, function: Callable[[Job], Any], jobs: Iterable[Job],
             tick: Callable[[], None] = lambda: None) -> Iterator[JobOutcome[Job]]:
    """Yield the outcomes of jobs, in the order in which they end.

    A job whose worker dies runs again; if its worker dies twice while the job runs alone, its
    error is WorkerDied. Jobs that were running when a scheduler was lost run again.

    Args:
        executor: any; a ResilientExecutor survives the loss of workers.
        function: of a job; both and the result can be pickled.
        jobs: read as room becomes free.
        tick: called twice a second at least.

    Raises:
        NoCluster: a scheduler that was lost does not come back.

    """
    stream = _Stream(executor, function, jobs)
    try:
        while True:
            stream.fill()
            tick()
            if not stream.flying and not stream.suspects:
                return
            yield from stream.ended()
    finally:
        for future in stream.flying:
            future.cancel()


def _applied(job: tuple[int, Callable[..., Any], tuple[Any, ...]]) -> Any:
    return job[1](*job[2])
