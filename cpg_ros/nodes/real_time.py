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

"""Real-time scheduling of a thread: priority, cores and locked memory, as controller_manager's."""

from collections.abc import Sequence
import contextlib
import ctypes
from dataclasses import dataclass
import os
import threading

from cpg_ros.errors import CpgError
from cpg_ros.nodes.parameter_spec import fixed, Spec
from rclpy.impl.rcutils_logger import RcutilsLogger

#: Of mlockall: the pages that are there, and those to come.
MCL_CURRENT, MCL_FUTURE = 1, 2
LIMITS = 'in /etc/security/limits.conf, and log in again'

SPECS = fixed({
    'thread_priority': Spec(0, 'real-time priority (SCHED_FIFO) of the publishing thread; the '
                            'other threads then get 1; 0 for none', 0, 99),
    'cpu_affinity': Spec([-1], 'cores on which the publishing thread may run, one or a list; -1 '
                         'for any'),
    'lock_memory': Spec(False, 'lock all memory of the process in RAM, so that no tick waits for '
                        'a page')})


class NoSuchCore(CpgError):
    """The process may not run on a requested core."""


@dataclass(frozen=True)
class RealTime:
    """What is requested of the scheduler.

    Attributes:
        priority: of SCHED_FIFO, 0 for none.
        cores: on which the thread may run, empty for any.
        lock: whether to lock the memory of the process.

    Raises:
        NoSuchCore: this process cannot run on one of the cores.

    """

    priority: int = 0
    cores: tuple[int, ...] = ()
    lock: bool = False

    def __post_init__(self) -> None:
        usable = sorted(os.sched_getaffinity(0))
        for core in self.cores:
            if core not in usable:
                raise NoSuchCore(f'cpu_affinity: {core} is not one of the cores that this process '
                                 f'may run on ({", ".join(map(str, usable))})')

    @classmethod
    def of(cls, priority: int, cores: Sequence[int], lock: bool) -> 'RealTime':
        """Return the request of the parameters' values; errors as of the class."""
        return cls(priority, () if list(cores) == [-1] else tuple(cores), lock)

    def claim(self) -> tuple[list[str], list[str]]:
        """Request it for the calling thread; return what is granted and what is refused.

        Each refusal is one line with the reason and what to set.
        """
        granted, refused = [], []
        if self.lock:
            if reason := _lock_memory():
                refused.append(f'lock_memory refused: {reason}. Raise the limit memlock '
                               f'(@realtime - memlock unlimited) {LIMITS}')
            else:
                granted.append('memory locked')
        if self.cores:
            os.sched_setaffinity(0, self.cores)
            granted.append(f'core {", ".join(map(str, self.cores))}')
        if self.priority:
            try:
                os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(self.priority))
                _raise_others()
                granted.append(f'SCHED_FIFO, priority {self.priority}')
            except OSError as error:
                refused.append(f'thread_priority {self.priority} refused: {error.strerror}. Raise '
                               f'the limit rtprio (@realtime - rtprio {max(98, self.priority)}) '
                               f'{LIMITS}')
        return granted, refused

    def request(self, logger: RcutilsLogger) -> None:
        """Request it for the calling thread, log the result, and continue in any case."""
        granted, refused = self.claim()
        for line in refused:
            logger.warning(line)
        if granted:
            logger.info(f'real time: {", ".join(granted)}')


def _raise_others() -> None:
    """Schedule the other threads before all ordinary processes, and after the calling one.

    Any of them may hold the interpreter lock or one of the middleware's, and would keep it while
    an ordinary process runs in its place. Stops are served by one of them, too.
    """
    own = threading.get_native_id()
    # Once more for what has been started meanwhile by one that was still an ordinary thread.
    for thread in (int(name) for _ in range(2) for name in os.listdir('/proc/self/task')):
        if thread != own:
            # It may have ended.
            with contextlib.suppress(ProcessLookupError):
                os.sched_setscheduler(thread, os.SCHED_RR, os.sched_param(1))


def _lock_memory() -> str:
    """Lock the memory of the process; return why not, or ''."""
    with contextlib.suppress(AttributeError):
        if ctypes.CDLL(None, use_errno=True).mlockall(MCL_CURRENT | MCL_FUTURE) == 0:
            return ''
        return os.strerror(ctypes.get_errno())
    return 'this system has no mlockall'
