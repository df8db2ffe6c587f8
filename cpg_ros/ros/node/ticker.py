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

"""A thread that ticks at absolute deadlines, by the steady clock or by simulated time."""

from collections.abc import Callable, Sequence
from contextlib import AbstractContextManager, nullcontext, suppress
import ctypes
from dataclasses import dataclass
import os
import threading
import time
from typing import Any

from cpg_ros.common.errors import CpgError
from cpg_ros.ros.node import native
from cpg_ros.ros.node.parameters import fixed, Spec
from cpg_ros.ros.node.polled import PolledSubscription
from rclpy.impl.implementation_singleton import rclpy_implementation
from rclpy.impl.rcutils_logger import RcutilsLogger
from rclpy.node import Node
from rosgraph_msgs.msg import Clock

# Real-time scheduling of a thread: priority, cores and locked memory, as controller_manager's.

#: Flags of mlockall. MCL_CURRENT: lock all present pages; MCL_FUTURE: lock all future ones.
MCL_CURRENT, MCL_FUTURE = 1, 2
LIMITS_HINT = 'in /etc/security/limits.conf, and log in again'

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
    """Real-time settings to request from the scheduler.

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
        """Return the settings of the parameters; errors as of the class."""
        return cls(priority, () if list(cores) == [-1] else tuple(cores), lock)

    def claim(self) -> tuple[list[str], list[str]]:
        """Request the settings for the calling thread; return what is granted and what is refused.

        Each refusal is one line with the reason and the remedy.
        """
        granted, refused = [], []
        if self.lock:
            if reason := _lock_memory():
                refused.append(f'lock_memory refused: {reason}. Raise the limit memlock '
                               f'(@realtime - memlock unlimited) {LIMITS_HINT}')
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
                               f'{LIMITS_HINT}')
        return granted, refused

    def request(self, logger: RcutilsLogger) -> None:
        """Request the settings for the calling thread, log the result, and continue anyway."""
        granted, refused = self.claim()
        for line in refused:
            logger.warning(line)
        if granted:
            logger.info(f'real time: {", ".join(granted)}')


def _raise_others() -> None:
    """Schedule the other threads above all ordinary processes, and below the calling thread.

    They may hold a lock of the interpreter or the middleware, and one of them serves stops.
    """
    own = threading.get_native_id()
    # Once more for what has been started meanwhile by one that was still an ordinary thread.
    for thread in (int(name) for _ in range(2) for name in os.listdir('/proc/self/task')):
        if thread != own:
            # It may have ended.
            with suppress(ProcessLookupError):
                os.sched_setscheduler(thread, os.SCHED_RR, os.sched_param(1))


def _lock_memory() -> str:
    """Lock the memory of the process; return why not, or ''."""
    with suppress(AttributeError):
        if ctypes.CDLL(None, use_errno=True).mlockall(MCL_CURRENT | MCL_FUTURE) == 0:
            return ''
        return os.strerror(ctypes.get_errno())
    return 'this system has no mlockall'


#: STALL_PERIODS: number of periods behind, as after a suspension, from which on ticks are left
#: out: a robot must not be driven through the motion it missed, and never gets more than two ticks
#: at once.
STALL_PERIODS = 2
#: Longest delay that a ticker without ``resume``, as in a simulation, makes up for, s.
MAX_DELAY = 1.0


class TickThread(threading.Thread):
    """A thread that counts its ticks, and reports the exception that ends it.

    Attributes:
        rate: of the ticks, Hz.

    """

    def __init__(self, name: str, rate: float, failed: Callable[[BaseException], None]) -> None:
        super().__init__(name=name, daemon=True)
        self.rate = rate
        #: Counters that are shared with ticks outside the interpreter.
        self.count = native.Counters()
        self._failed = failed
        self._ending = threading.Event()

    @property
    def ticks(self) -> int:
        """Number of ticks."""
        return self.count.ticks

    @property
    def late(self) -> int:
        """Number of ticks that began more than a period after their deadline."""
        return self.count.late

    @property
    def dropped(self) -> int:
        """Number of periods without a tick."""
        return self.count.dropped

    @property
    def worst(self) -> float:
        """Longest delay of a tick since the last reading, s."""
        worst, self.count.worst = self.count.worst, 0
        return 1e-9 * worst

    def end(self) -> None:
        """Stop after the present tick."""
        self._ending.set()

    def run(self) -> None:
        """Tick until ended; pass any exception to ``failed``."""
        try:
            self._run()
        except BaseException as error:
            self._failed(error)

    def _run(self) -> None:
        raise NotImplementedError


class Ticker(TickThread):
    """Thread that calls ``tick(dt, stamp)`` once a period, dt in s, stamp in ns of ROS time.

    Deadlines stay on their grid, and stamps are deadlines. A tick that is late by less than a
    period is followed at once by the next; after a stall the missed periods are skipped, and
    ``resume`` gets its length in s. With simulated time the deadlines are instants of ``/clock``,
    and a jump back calls ``restart``; after ``stop_moving`` the ticker continues by the steady
    clock if ``/clock`` stands still for .2 s or jumps back. ``tick.c`` does all of this.

    Attributes:
        jumps: number of jumps back of simulated time.
        paused: ticks continue but do nothing; ``prepare`` is called after a change.
        loop: shared with ``tick.c``.

    """

    def __init__(self, node: Node, rate: float, tick: Callable[[float, int], None],
                 restart: Callable[[], None], failed: Callable[[BaseException], None],
                 resume: Callable[[float], None] | None = None,
                 begin: Callable[[], None] = lambda: None,
                 prepare: Callable[[native.Loop], AbstractContextManager] = nullcontext) -> None:
        """Prepare to tick.

        Args:
            node: whose clock decides about simulated time.
            rate: of the ticks, Hz.
            tick: called with dt and stamp.
            restart: called when simulated time jumps back.
            failed: called with the exception that ended the thread.
            resume: called after a stall; None to catch up with up to MAX_DELAY instead.
            begin: called first in the thread.
            prepare: called with the loop in the thread, first and after ``attend``; it may enter
                what does the following ticks in place of ``tick``. Its result is kept alive
                meanwhile.

        """
        super().__init__('ticker', rate, failed)
        self._library = native.library()
        self.jumps, self._paused = 0, False
        self._tick, self._restart, self._resume, self._begin = tick, restart, resume, begin
        self._prepare = prepare
        self.loop = native.Loop(count=ctypes.addressof(self.count), offset=ctypes.cast(
            self._library.system_offset, ctypes.c_void_p).value)
        clock: Any = node.get_clock()
        self._clock = SimulatedClock(node) if clock.ros_time_is_active else None
        if self._clock is not None:
            self.loop.clock = ctypes.addressof(self._clock.struct)

    @property
    def paused(self) -> bool:
        """Whether ticks do nothing."""
        return self._paused

    @paused.setter
    def paused(self, paused: bool) -> None:
        self._paused = paused
        self.attend()

    @property
    def waiting(self) -> bool:
        """Whether it has not been started, or is paused."""
        return self.paused or not self.is_alive()

    def end(self) -> None:
        """Stop after the present tick."""
        super().end()
        self.attend()

    def stop_moving(self, stopping: bool = True) -> None:
        """Tick by the steady clock if ``/clock`` stands still, until called with False."""
        self.count.stopping = stopping

    def attend(self) -> None:
        """Let ``prepare`` be called before the next tick."""
        self.count.attend = 1

    def _run(self) -> None:
        self._begin()
        loop, address = self.loop, ctypes.byref(self.loop)
        loop.deadline = 0 if self._clock is not None else time.monotonic_ns()
        while not self._ending.is_set():
            self.count.attend, loop.period = 0, round(1e9 / self.rate)
            loop.stall = (round(1e9 * MAX_DELAY) if self._resume is None else
                          STALL_PERIODS * loop.period)
            with self._prepare(loop), self._clock or nullcontext():
                # Asked again, as attend may have been set before it is reset above.
                while not self._ending.is_set() and (
                        event := self._library.run(address)) != native.ATTEND:
                    self._handle(event)

    def _handle(self, event: int) -> None:
        """Do what ``tick.c`` leaves to Python."""
        loop = self.loop
        if event == native.TICK:
            self._tick(1e-9 * loop.period, loop.stamp)
        elif event == native.RESUME and self._resume is not None:
            self._resume(1e-9 * loop.behind)
        elif event == native.RESTART:
            self.jumps += 1
            self._restart()
        elif event == native.REFUSED:
            raise native.middleware_error()


class SimulatedClock:
    """``/clock`` as ``tick.c`` takes it, while it is entered.

    Attributes:
        struct: shared with ``tick.c``.

    """

    def __init__(self, node: Node) -> None:
        self._messages = PolledSubscription(node, Clock, '/clock', raw=True, overridable=False)
        context: Any = node.context.handle
        with context:
            self._set = rclpy_implementation.WaitSet(1, 0, 0, 0, 0, 0, context)
        self._held: Any = self._messages.handle
        self.struct = native.Simulated(
            set=self._set.pointer, message=native.empty_message(),
            **{name: native.address(function) for name, function in (
                ('clear', 'rcl_wait_set_clear'), ('add', 'rcl_wait_set_add_subscription'),
                ('wait', 'rcl_wait'), ('take', 'rcl_take_serialized_message'),
                ('forget', 'rcutils_reset_error'))})

    def __enter__(self) -> None:
        self._held.__enter__()
        self._set.__enter__()
        self.struct.subscription = self._held.pointer

    def __exit__(self, *_: object) -> None:
        self._set.__exit__(None, None, None)
        self._held.__exit__(None, None, None)
