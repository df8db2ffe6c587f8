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

"""A stream of jobs into an executor, and of what comes of them out of it.

Jobs are made only when there is room for them, and an outcome is let go of once it is taken: what
the client holds does not grow with the number of jobs.
"""

from collections import deque
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import CancelledError, Executor, FIRST_COMPLETED, Future, wait
from concurrent.futures.process import BrokenProcessPool
from dataclasses import dataclass
import itertools
from typing import Any, Generic, TypeVar

from cpg_ros.errors import CpgError
from cpg_ros.fleet.renewable_executor import RenewableExecutor

#: The clock goes on while nothing ends: s.
TICK = 0.5
#: Times a job may be alone at a worker that dies before the job is blamed.
DEATHS = 2

Job = TypeVar('Job')


class WorkerDied(CpgError):
    """The process that a job ran in died of it."""


@dataclass(frozen=True)
class JobOutcome(Generic[Job]):
    """What came of a job.

    Attributes:
        job: its arguments.
        value: what it returned.
        error: what it raised, or None.

    """

    job: Job
    value: Any
    error: BaseException | None = None


class _Stream(Generic[Job]):
    def __init__(self, executor: Executor, function: Callable[..., Any],
                 jobs: Iterable[Job]) -> None:
        self.fleet = (executor if isinstance(executor, RenewableExecutor)
                      else RenewableExecutor(executor))
        self.function, self.jobs = function, iter(jobs)
        self.flying: dict[Future[Any], Job] = {}
        # Jobs that were under way when a worker died: they go alone, and so are told apart.
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
        """Hand over as many jobs as there is room for."""
        if self.alone is not None and self.flying:
            return
        if self.suspects:
            if not self.flying:
                self.alone = self.suspects.popleft()
                if not self._send(self.alone[0]):
                    self.suspects.appendleft(self.alone)
                    self.fleet.renew()
            return
        while len(self.flying) < self.fleet.room:
            for job in itertools.islice(self.jobs, 1):
                if not self._send(job):
                    self.suspects.append((job, 0))
                    self.fleet.renew()
                    return
                break
            else:
                return

    def ended(self) -> Iterator[JobOutcome[Job]]:
        """Yield what has come of jobs, after a while at most."""
        done, _ = wait(self.flying, TICK, FIRST_COMPLETED)
        broken: BaseException | None = None
        back: list[Job] = []
        for future in done:
            job = self.flying.pop(future)
            error = CancelledError() if future.cancelled() else future.exception()
            if error is not None and self.fleet.lost(error):
                broken = error
                back.append(job)
                continue
            self.alone = None
            yield JobOutcome(job, None if error else future.result(), error)
        if broken is None:
            return
        # All that were with it are lost, too, done or not.
        back += self.flying.values()
        self.flying.clear()
        died = isinstance(broken, BrokenProcessPool)
        if self.alone is not None:
            job, deaths = self.alone
            self.alone = None
            if died and deaths + 1 >= DEATHS:
                yield JobOutcome(job, None, WorkerDied('the process that worked on this job died'))
            else:
                self.suspects.appendleft((job, deaths + died))
        elif died:
            self.suspects.extend((job, 0) for job in back)
        else:
            self.jobs = itertools.chain(back, self.jobs)
        self.fleet.renew()


def outcomes(executor: Executor, function: Callable[[Job], Any], jobs: Iterable[Job],
             tick: Callable[[], None] = lambda: None) -> Iterator[JobOutcome[Job]]:
    """Yield what comes of jobs, in the order in which they end.

    A job whose worker dies is done again; one that its worker died of twice, when it was alone
    there, has the error WorkerDied. What was under way when a scheduler was lost is done again.

    Args:
        executor: any; a RenewableExecutor survives the loss of workers.
        function: of a job; both and the result travel to another process.
        jobs: as they are wanted.
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


def in_order(executor: Executor, function: Callable[..., Any], jobs: Iterable[tuple[Any, ...]],
             tick: Callable[[], None] = lambda: None) -> Iterator[Any]:
    """Yield the results of jobs, given by their arguments, in the order of the jobs.

    Raises:
        Exception: the first that a job raised.

    """
    waiting: dict[int, Any] = {}
    following = 0
    numbered = ((number, function, job) for number, job in enumerate(jobs))
    for one in outcomes(executor, _applied, numbered, tick):
        if one.error is not None:
            raise one.error
        waiting[one.job[0]] = one.value
        while following in waiting:
            yield waiting.pop(following)
            following += 1


def _applied(job: tuple[int, Callable[..., Any], tuple[Any, ...]]) -> Any:
    return job[1](*job[2])
