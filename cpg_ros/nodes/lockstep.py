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

"""A thread in which a simulation and the node that commands it take turns."""

from collections.abc import Callable
import time

from cpg_ros.nodes.command_topics import Commands
from cpg_ros.nodes.deadline_thread import TickThread
from rclpy.node import Node

#: How long to wait for the commands of an instant, s: at first, and while none come.
PATIENCE, IMPATIENCE = 1.0, 0.02
#: Interval at which to look for commands, s.
LOOK = 5e-5
#: A delay behind real time of up to this is made up for, s; a longer one slows the robot down.
MOST_BEHIND = 0.05


class Lockstep(TickThread):
    """Sets the time with ``tell``, waits for the commands of that instant, calls ``tick``.

    Simulated time begins when there is a publisher of every command and a reader of /clock, and
    the first ``tick`` is at the first command, so that a run can be repeated exactly. Commands
    that come only every few periods, as from a generator of a lower rate, are recognised.

    With a pace, simulated time passes that many times as fast as real time, or slower on a slow
    machine.

    Its rate is in simulated time. A late tick did not get the command that it waited for; no tick
    is ever dropped.

    """

    def __init__(self, node: Node, rate: float, commands: Commands,
                 tell: Callable[[int], None], ready: Callable[[], bool],
                 tick: Callable[[float, int], None], failed: Callable[[BaseException], None],
                 pace: float = 0.0) -> None:
        super().__init__('lockstep', rate, failed)
        self._due = 0.0
        self._spacing = 1.0 / (rate * pace) if pace else 0.0
        self._node, self._commands = node, commands
        self._tell, self._ready, self._tick = tell, ready, tick

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
                if self._commands.connected:
                    logger.warning(f'no command came for {1e-9 * now:.3f} s of simulated time: '
                                   'the robot holds the last one; it expects them at '
                                   f'{self.rate:g} Hz', throttle_duration_sec=10.0)
                else:
                    logger.info('nothing commands the robot any more: it holds the last command',
                                throttle_duration_sec=10.0)
            if started:
                self._keep_pace()
                self.ticks += 1
                self._tick(1.0 / self.rate, now)

    def _keep_pace(self) -> None:
        """Wait until real time has caught up with simulated time."""
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
