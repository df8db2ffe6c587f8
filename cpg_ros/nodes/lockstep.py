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

"""A thread that lets a simulation and what commands it take turns, no faster than they should."""

from collections.abc import Callable
import threading
import time

from cpg_ros.nodes.command_topics import Commands
from rclpy.node import Node

#: How long an answer to an instant is waited for, s: at first, and while none comes.
PATIENCE, IMPATIENCE = 1.0, 0.02
#: Between two looks at whether an answer is there, s.
LOOK = 5e-5
#: Behind the clock on the wall by no more than this is made up for, s; more makes a slow robot.
MOST_BEHIND = 0.05


class Lockstep(threading.Thread):
    """Tells the time with ``tell``, waits for the commands of that instant, calls ``tick``.

    Simulated time begins when there is a publisher of every command and a reader of /clock, and
    the first ``tick`` is at the first command, so that a run can be repeated exactly. Where
    commands come only every few periods, as from a generator of a lower rate, that is learnt.

    With a pace, simulated time goes that many times as fast as the clock on the wall, or slower
    where the machine is.

    Attributes:
        ticks: so far.
        late: those that did not get the command they waited for.
        dropped: none ever.
        rate: of the ticks in simulated time, Hz.
        worst: longest delay behind the pace since it was last read, s.

    """

    def __init__(self, node: Node, rate: float, commands: Commands,
                 tell: Callable[[int], None], ready: Callable[[], bool],
                 tick: Callable[[float, int], None], failed: Callable[[BaseException], None],
                 pace: float = 0.0) -> None:
        super().__init__(name='lockstep', daemon=True)
        self.rate = rate
        self.ticks = self.late = self.dropped = 0
        self._worst, self._due = 0.0, 0.0
        self._spacing = 1.0 / (rate * pace) if pace else 0.0
        self._node, self._commands = node, commands
        self._tell, self._ready, self._tick, self._failed = tell, ready, tick, failed
        self._ending = threading.Event()

    @property
    def worst(self) -> float:
        """Longest delay behind the pace since this was last read, s."""
        worst, self._worst = self._worst, 0.0
        return worst

    def end(self) -> None:
        """Stop after the tick under way."""
        self._ending.set()

    def run(self) -> None:
        """Take turns until ended; hand any exception to ``failed``."""
        try:
            self._run()
        except BaseException as error:
            self._failed(error)

    def _run(self) -> None:
        logger = self._node.get_logger()
        announced = False
        while not (self._ready() and self._commands.connected):
            if self._ending.wait(0.02):
                return
            if not announced:
                announced = True
                logger.info('waiting for a node that listens to /clock and publishes '
                            + ', '.join(self._commands.topics))
        period = round(1e9 / self.rate)
        now, every, since, patience = 0, 1, 0, PATIENCE
        started = False
        while not self._ending.is_set():
            now += period
            since += 1
            self._commands.expect(now - period + 1)
            self._tell(now)
            if since < every:
                if self._commands.take():
                    every, since = since, 0
            elif self._answered(patience):
                since, patience, started = 0, PATIENCE, True
            elif self._ending.is_set():
                return
            elif started:
                every, patience = since + 1, IMPATIENCE
                self.late += 1
                logger.warning(f'no command for the time {1e-9 * now:.3f} s within '
                               f'{PATIENCE:g} s: going on without; the rate of what commands '
                               f'should be {self.rate:g} Hz', throttle_duration_sec=10.0)
            if started:
                self._keep_pace()
                self.ticks += 1
                self._tick(1.0 / self.rate, now)

    def _keep_pace(self) -> None:
        """Wait until the clock on the wall is where simulated time is."""
        if not self._spacing:
            return
        now = time.monotonic()
        due = max(self._due + self._spacing, now - MOST_BEHIND) if self._due else now
        self._worst = max(self._worst, now - due)
        self._due = due
        if due > now:
            self._ending.wait(due - now)

    def _answered(self, patience: float) -> bool:
        """Wait for the commands; return whether they came."""
        deadline = time.monotonic() + patience
        while not self._commands.take():
            if time.monotonic() > deadline or self._ending.is_set():
                return False
            time.sleep(LOOK)
        return True
