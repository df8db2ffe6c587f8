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

"""A generator in the test's own process, on a /clock that waits for it and for nothing else."""

from collections.abc import Iterator
from contextlib import contextmanager, ExitStack
import gc
import math
import re
import threading
import time
from unittest import mock

from cpg_ros.common.errors import CpgError
from cpg_ros.ros.generator import Generator
from graph import free_domain, OCCUPIED, PATIENCE, until, Watcher
import rclpy
from rclpy.executors import ExternalShutdownException, SingleThreadedExecutor
from rclpy.impl import rcutils_logger
from rclpy.logging import get_logger, LoggingSeverity
from rclpy.signals import SignalHandlerOptions
from rosgraph_msgs.msg import Clock
from std_srvs.srv import SetBool

# A line's caller is beyond this file, too.
rcutils_logger._internal_callers.append(__file__)

#: Of /clock, s: below what a generator takes for a stall.
STEP = 0.02
#: Simulated time by that of the wall at most, where tests share a generator: much of what they
#: wait for goes by the wall, and a generator as fast as it can be takes a core.
PACE = 4.0
#: /clock is sent best effort: once more after so long without an answer, s.
AGAIN = 0.1


class SteppedGenerator:
    """A generator whose simulated time goes on as fast as it publishes, while it is let run.

    Attributes:
        domain: of both.
        watcher: of it, in the same process.
        lines: what the generator has logged.
        now: the simulated time, s.
        pace: simulated time by that of the wall at most.

    """

    def __init__(self, *ros_args: str, domain: int | None = None) -> None:
        """Start it, in a domain of its own if none is given.

        Raises:
            CpgError: as of the generator.

        """
        self.domain = free_domain() if domain is None else domain
        self._context = rclpy.Context()
        rclpy.init(args=['generator', '--ros-args', '-p', 'use_sim_time:=true', *ros_args],
                   context=self._context, domain_id=self.domain,
                   signal_handler_options=SignalHandlerOptions.NO)
        self.lines: list[str] = []
        try:
            with mock.patch('rclpy.node.get_logger', self._logger):
                self._node = Generator(context=self._context)
        except BaseException:
            rclpy.shutdown(context=self._context)
            raise
        OCCUPIED.add(self.domain)
        self._executor = SingleThreadedExecutor(context=self._context)
        self._executor.add_node(self._node)
        self._serving = threading.Thread(target=self._serve, daemon=True)
        self._serving.start()
        self.watcher = Watcher(self.domain, self._node.get_fully_qualified_name())
        self.now, self.pace, self._end_time = 100.0, math.inf, math.inf
        self._clock = self.watcher.node.create_publisher(Clock, '/clock', 10)
        self._going, self._ended = threading.Event(), threading.Event()
        self._ticking = threading.Thread(target=self._tick, daemon=True)
        self._ticking.start()
        self._first = self._values()

    def _logger(self, name: str) -> rcutils_logger.RcutilsLogger:
        """Return a logger that keeps its lines: nodes of one name in a process share /rosout."""
        logger = get_logger(name)
        log = logger.log

        def record(message: str, severity: LoggingSeverity, **options: object) -> bool:
            if logged := log(message, severity, **options):
                self.lines.append(message)
            return logged

        logger.log = record
        return logger

    def _serve(self) -> None:
        while not self._node.stop.is_set():
            try:
                self._executor.spin_once(timeout_sec=0.1)
            except ExternalShutdownException:
                return

    def _tick(self) -> None:
        samples = self.watcher.samples
        while not self._ended.is_set():
            if not self._going.wait(0.1):
                continue
            now, began = self.now + STEP, time.monotonic()
            message = Clock()
            message.clock.sec, message.clock.nanosec = int(now), int(now % 1 * 1e9)
            end = 0.0
            while not self._ended.is_set() and (
                    end == 0.0 or any(one[0] < now - STEP for one in samples[-1:])):
                if time.monotonic() > end:
                    self._clock.publish(message)
                    end = time.monotonic() + AGAIN
                time.sleep(2e-4)
                if not samples:
                    # Nothing is published at the first instant.
                    time.sleep(STEP)
                    break
            self.now = now
            time.sleep(max(STEP / self.pace - (time.monotonic() - began), 0.0))
            if now > self._end_time - 0.5 * STEP:
                self._going.clear()

    def _values(self) -> dict:
        return {name: self._node.get_parameter(name).value for name in self._node._parameters}

    @property
    def log(self) -> str:
        """All that has been logged."""
        return '\n'.join(self.lines)

    def wait_for(self, pattern: str) -> re.Match[str]:
        """Wait for a line of the log."""
        return until(lambda: re.search(pattern, self.log), f"'{pattern}' in the log")

    def run(self, seconds: float = math.inf) -> None:
        """Let time go on, and wait for its end if it is for some time only, s."""
        self._end_time = self.now + seconds
        self._going.set()
        if seconds < math.inf:
            until(lambda: not self._going.is_set(), f'{seconds} s of simulated time')

    @contextmanager
    def lent(self) -> Iterator[None]:
        """Run it, and bring it back, by its services, to what it was at first."""
        self.pace = PACE
        self.run()
        yield
        self.pace = math.inf
        now = self._values()
        changed = {name: value for name, value in self._first.items() if value != now[name]}
        if changed:
            # A gait brings the parameters of its network.
            result = self.watcher.set_together(**{'gait': self._first['gait'], **changed})
            assert result.successful, result.reason
        self.watcher.call(SetBool, '/cpg_generator/enable', SetBool.Request(data=True))
        self.watcher.record(1.5)
        self._going.clear()

    def _end_ticks(self) -> None:
        self._node.ticker.end()
        if self._node.ticker.is_alive():
            self._node.ticker.join(PATIENCE)

    def end(self) -> None:
        """Leave the graph."""
        serving = self._node.parameter_service
        with ExitStack() as ending:
            # From the last one to the first. A node that is not destroyed remains in its domain,
            # where a later test would find it, until Python collects it.
            for step in (lambda: rclpy.shutdown(context=self._context), self._node.destroy_node,
                         self._executor.shutdown, lambda: self._serving.join(PATIENCE),
                         lambda: serving.thread.join(PATIENCE), self._end_ticks, serving.end,
                         self.watcher.end, lambda: self._ticking.join(PATIENCE)):
                ending.callback(step)
            ending.callback(OCCUPIED.discard, self.domain)
            self._ended.set()
            # It need not ramp down.
            self._node.hand_over()
            self._node.stop.set()


def refused(*ros_args: str, domain: int | None = None) -> str:
    """Return why a generator does not start."""
    try:
        SteppedGenerator(*ros_args, domain=domain).end()
    except CpgError as error:
        reason = str(error)
    else:
        raise AssertionError('it started')
    # What had been made of it remains in its domain until Python collects it.
    gc.collect()
    return reason
