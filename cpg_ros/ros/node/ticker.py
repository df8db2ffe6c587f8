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

"""A thread that ticks on absolute deadlines, by the steady clock or by simulated time."""

from collections.abc import Callable, Sequence
import contextlib
import ctypes
from dataclasses import dataclass
import os
import threading
import time
from typing import Any

from cpg_ros.common.errors import CpgError
from cpg_ros.ros.node import native
from cpg_ros.ros.node.parameters import fixed, Spec
from rclpy.clock import JumpThreshold
from rclpy.duration import Duration
from rclpy.impl.rcutils_logger import RcutilsLogger
from rclpy.node import Node

# Real-time scheduling of a thread: priority, cores and locked memory, as controller_manager's.

#: Flags of mlockall. MCL_CURRENT: lock all present pages; MCL_FUTURE: lock all future ones.
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
    """Real-time settings that are requested of the scheduler.

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

    Any of them may hold a lock of the interpreter or the middleware; one of them serves stops.
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


#: STALL: number of periods behind, as after a suspension, from which on ticks are left out: a
#: robot must not be driven through the motion it missed, and never gets more than two ticks at
#: once.
STALL = 2
#: COARSE: step of simulated time that is not a stall, s: /clock may be coarse or lose a message.
COARSE = 0.05
#: MOST_BEHIND: longest delay that a ticker without ``resume``, as in a simulation, makes up for,
#: s.
MOST_BEHIND = 1.0
#: JITTER: step back of simulated time, s, above which it is a jump; after a smaller one (messages
#: out of order, two publishers of /clock) the ticker waits until time is past its last value.
JITTER = 0.1
#: STOPPED: time of the steady clock, s, after which a stop no longer waits for a still /clock.
STOPPED = 0.2


class TickThread(threading.Thread):
    """A thread of ticks that counts them, and reports the exception that ends it.

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
        """Ticks so far."""
        return self.count.ticks

    @property
    def late(self) -> int:
        """Ticks that began more than a period after their deadline."""
        return self.count.late

    @property
    def dropped(self) -> int:
        """Periods left out."""
        return self.count.dropped

    @property
    def worst(self) -> float:
        """Longest delay of a tick since this was last read, s."""
        worst, self.count.worst = self.count.worst, 0
        return 1e-9 * worst

    def end(self) -> None:
        """Stop after the tick under way."""
        self._ending.set()

    def run(self) -> None:
        """Tick until ended; hand any exception to ``failed``."""
        try:
            self._run()
        except BaseException as error:
            self._failed(error)

    def _run(self) -> None:
        raise NotImplementedError


class Ticker(TickThread):
    """Calls ``tick(dt, stamp)`` once a period, dt in s and the stamp in ns of ROS time.

    Deadlines stay on their grid, and stamps are deadlines. A tick that is late by less than a
    period is made up for at once; after a stall the periods that have passed are left out, and
    ``resume`` gets its length in s. With simulated time the deadlines are instants of ``/clock``,
    and a jump back calls ``restart``; after ``stop_moving`` the ticker continues by the steady
    clock if ``/clock`` stands still for STOPPED s or jumps back.

    Attributes:
        jumps: of simulated time back.
        stopping: whether the ticks do not wait for ``/clock``; set it False at rest.
        paused: set by whoever ticks: the ticks go on, but nothing is done at them.

    """

    def __init__(self, node: Node, rate: float, tick: Callable[[float, int], None],
                 restart: Callable[[], None], failed: Callable[[BaseException], None],
                 resume: Callable[[float], None] | None = None,
                 begin: Callable[[], None] = lambda: None,
                 steadily: Callable[..., tuple[int, int] | None] = lambda *_: None) -> None:
        """Prepare to tick.

        Args:
            node: whose clock says whether time is simulated.
            rate: of the ticks, Hz.
            tick: called with dt and stamp.
            restart: called where simulated time jumps back.
            failed: called with the exception that ended the thread.
            resume: called after a stall; None: up to MOST_BEHIND is made up for instead.
            begin: called first thing in the thread.
            steadily: called with a function, a deadline and a period in ns; calls the function
                with a Loop, which does the coming ticks until ``attend`` is called, the deadline
                and the period, and returns what it does; None if ``tick`` is to be called.

        """
        super().__init__('ticker', rate, failed)
        self._library = native.library()
        self.jumps = 0
        self.stopping = self.paused = False
        self._clock: Any = node.get_clock()
        self._tick, self._restart, self._resume, self._begin = tick, restart, resume, begin
        self._steadily = steadily
        self._moved = threading.Event()
        threshold = JumpThreshold(min_forward=Duration(nanoseconds=1),
                                  min_backward=Duration(nanoseconds=-1))
        self._jumps = self._clock.create_jump_callback(
            threshold, post_callback=lambda _: self._moved.set())

    @property
    def waiting(self) -> bool:
        """Whether it has not been started, or is paused."""
        return self.paused or not self.is_alive()

    def end(self) -> None:
        """Stop after the tick under way."""
        super().end()
        self.attend()
        self._moved.set()

    def stop_moving(self) -> None:
        """Tick by the steady clock, should ``/clock`` stand still, while ``stopping``."""
        self.stopping = True
        self._moved.set()

    def _run(self) -> None:
        self._begin()
        if self._clock.ros_time_is_active:
            self._run_simulated()
        else:
            self._run_steady(time.monotonic_ns(), self._system_time)

    def _system_time(self, deadline: int) -> int:
        """Return a time of the steady clock by the system clock, ns."""
        return deadline + int(self._library.system_offset())

    def _period(self) -> int:
        return round(1e9 / self.rate)

    def _run_steady(self, deadline: int, stamp: Callable[[int], int],
                    going: Callable[[], bool] | None = None) -> None:
        """Tick by the steady clock, while ``going`` if given; deadline and its ``stamp`` in ns."""
        ending, count = self._ending, self.count
        while not ending.is_set() and (going is None or going()):
            period = self._period()
            count.wanted = 0
            left = self._steadily(self._run_outside, deadline, period) if going is None else None
            if left is None:
                deadline += period
                behind = self._library.wait_until(deadline)
            else:
                deadline, behind = left
            count.worst = max(count.worst, behind)
            leap, skip = self._stalled(behind, period)
            deadline += leap
            if skip:
                continue
            count.ticks += 1
            if behind > period:
                count.late += 1
            self._tick(period * 1e-9, stamp(deadline))

    def _run_outside(self, loop: native.Loop, deadline: int, period: int) -> tuple[int, int]:
        """Tick outside the interpreter; return the next deadline, and the time since it, ns."""
        loop.count, loop.stall = ctypes.addressof(self.count), STALL * period
        loop.deadline, loop.period = deadline, period
        behind = self._library.run(ctypes.byref(loop))
        return loop.deadline, behind

    def attend(self) -> None:
        """Let the next tick call ``tick`` in the interpreter."""
        self.count.wanted = 1

    def _stalled(self, behind: int, period: int) -> tuple[int, bool]:
        """Return how far the deadline must leap, ns, and whether to leave out its tick, too.

        Leaving it out keeps ticks apart; where every sleep is longer than a stall, some remain.
        """
        resume = self._resume
        if resume is None:
            missed, skip = behind // period if behind > MOST_BEHIND * 1e9 else 0, False
        elif behind < STALL * period:
            self.count.resuming = 0
            return 0, False
        else:
            missed, skip = behind // period, not self.count.resuming
            self.count.resuming = skip
            resume(behind * 1e-9)
        self.count.dropped += missed + skip
        return missed * period, skip

    def _run_simulated(self) -> None:
        # The last tick's stamp, the latest time, and its last step; 0 before the first.
        deadline = last = step = 0
        moved = time.monotonic()
        while not self._ending.is_set():
            left = moved + STOPPED - time.monotonic()
            self._moved.wait(max(left, 0.0) if self.stopping and deadline else None)
            self._moved.clear()
            now = self._clock.now().nanoseconds
            back = last - now
            if now > last:
                moved = time.monotonic()
            elif self.stopping and deadline and (
                    back > JITTER * 1e9 or time.monotonic() >= moved + STOPPED):
                deadline = self._stop_by_steady_clock(deadline)
                # The next time counts, whatever it is.
                last, moved = 0, time.monotonic()
                continue
            if now == 0 or 0 <= back <= JITTER * 1e9:
                continue
            if last == 0 or back > 0:
                if last:
                    self.jumps += 1
                    self._restart()
                deadline = last = now
            # A clock may be coarser than a period; a stall is a step unlike the one before.
            usual, step = step, now - last
            last = now
            period = self._period()
            behind = now - deadline - period
            if behind >= STALL * period and step > max(2 * usual, round(COARSE * 1e9)):
                leap, skip = self._stalled(behind, period)
                deadline += leap + skip * period
            while not self._ending.is_set() and deadline + self._period() <= now:
                period = self._period()
                deadline += period
                self.count.ticks += 1
                self._tick(period * 1e-9, deadline)

    def _stop_by_steady_clock(self, stamp: int) -> int:
        """Continue the ticks from a stamp, ns, until the robot is at rest; return the last one."""
        now = time.monotonic_ns()
        ahead = stamp - now

        def next_stamp(deadline: int) -> int:
            nonlocal stamp
            stamp = deadline + ahead
            return stamp

        self._run_steady(now, next_stamp, lambda: self.stopping)
        return stamp
