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

"""Logging that never waits for a terminal, a disk or the graph: a thread writes from a queue.

rclpy's own logger writes in the thread that logs, and holds the interpreter's lock meanwhile.
"""

import atexit
from datetime import datetime
import os
import queue
import re
import sys
import threading
import time
from types import CodeType
from typing import Any, NamedTuple

from cpg_ros.ros.node.console import Console
from rcl_interfaces.msg import Log
from rclpy.duration import Duration
from rclpy.exceptions import InvalidHandle
from rclpy.impl import rcutils_logger
from rclpy.impl.implementation_singleton import rclpy_implementation
from rclpy.impl.logging_severity import LoggingSeverity
from rclpy.logging import get_logging_directory
from rclpy.node import Node
from rclpy.publisher import Publisher
from rclpy.qos import DurabilityPolicy, QoSProfile
from rclpy.utilities import ok

#: The end of a process waits this long for unwritten records, s.
PATIENCE = 0.2
#: Largest number of waiting records.
CAPACITY = 1000
#: Format of a line if RCUTILS_CONSOLE_OUTPUT_FORMAT is not set.
FORMAT = '[{severity}] [{time}] [{name}]: {message}'
#: NO_FILE: argument that keeps rclpy's own logger, which only rcl still uses, from writing a file:
#: it would wait for the disk.
NO_FILE = '--disable-external-lib-logs'
#: Quality of service of /rosout.
ROSOUT = QoSProfile(depth=1000, durability=DurabilityPolicy.TRANSIENT_LOCAL,
                    lifespan=Duration(seconds=10))
#: ANSI colors as rcutils has them.
COLORS = {LoggingSeverity.DEBUG: 32, LoggingSeverity.INFO: 0, LoggingSeverity.WARN: 33,
          LoggingSeverity.ERROR: 31, LoggingSeverity.FATAL: 31}
#: INNER: files of the logger itself, whose frames are skipped to find the caller.
INNER = __file__, rcutils_logger.__file__


def _wanted(kind: str, args: list[str]) -> bool:
    """Return whether the arguments of ROS enable a kind of logs: the last switch counts."""
    switches = [word for word in args if word in (f'--disable-{kind}-logs',
                                                  f'--enable-{kind}-logs')]
    return not switches or switches[-1].startswith('--enable')


class Record(NamedTuple):
    """One message, ``stamp`` in ns of system time."""

    stamp: int
    severity: LoggingSeverity
    name: str
    message: str
    code: CodeType
    line: int
    rosout: Publisher | None

    def text(self, form: str) -> str:
        """Return it in a format, of which each {word} that is known is replaced."""
        seconds, rest = divmod(self.stamp, 10 ** 9)
        values = {
            'severity': self.severity.name, 'name': self.name, 'message': self.message,
            'function_name': self.code.co_name, 'file_name': self.code.co_filename,
            'line_number': str(self.line), 'time': f'{seconds}.{rest:09d}',
            'time_as_nanoseconds': str(self.stamp),
            'date_time_with_ms': datetime.fromtimestamp(seconds).strftime('%Y-%m-%d %H:%M:%S')
            + f'.{rest // 10 ** 6:03d}'}
        return re.sub(r'\{(\w+)\}', lambda found: values.get(found[1], found[0]), form)


class LogQueue:
    """Takes records without waiting, and writes them in a thread that may be blocked.

    Attributes:
        rosout: whether records are published.

    """

    def __init__(self) -> None:
        self._records: queue.SimpleQueue[Record] = queue.SimpleQueue()
        self._dropped = self._taken = self._written = 0
        self._console: Console | None = None
        self._file: int | None = None
        form = os.environ.get('RCUTILS_CONSOLE_OUTPUT_FORMAT') or FORMAT
        self._form = form.replace('\\n', '\n').replace('\\t', '\t')
        self._shown = True
        self.rosout = True
        self._thread = threading.Thread(target=self._work, name='log', daemon=True)

    def start(self, name: str, args: list[str]) -> None:
        """Write to the streams of this process, which never block it from now on, and to a file.

        Args:
            name: prefix of the file's name unless --log-file-name gives one.
            args: of ROS.

        Raises:
            OSError: the system has no pipe or process left.

        """
        self._console = Console()
        self.rosout = _wanted('rosout', args)
        self._shown = _wanted('stdout', args)
        doubt = self._open(name, args) if _wanted('external-lib', args) else ''
        self._thread.start()
        atexit.register(self.drain)
        if doubt:
            QueuedLogger(name).warning(doubt)

    def _open(self, name: str, args: list[str]) -> str:
        """Open the file; return why there is none, or ''."""
        if '--log-file-name' in args[:-1]:
            name = args[args.index('--log-file-name') + 1]
        path = get_logging_directory() / f'{name}_{os.getpid()}_{time.time_ns() // 10 ** 6}.log'
        try:
            path.parent.mkdir(parents=True, exist_ok=True)
            self._file = os.open(path, os.O_WRONLY | os.O_CREAT | os.O_APPEND, 0o644)
        except OSError as error:
            return f'no log file {path}: {error.strerror}'
        return ''

    @property
    def dropped(self) -> int:
        """Number of lines that were not written to all of their places."""
        return self._dropped + (self._console.lost if self._console else 0)

    def put(self, record: Record) -> None:
        """Take a record, or drop it if too many wait."""
        if self._records.qsize() < CAPACITY:
            self._taken += 1
            self._records.put(record)
        else:
            self._dropped += 1

    def _work(self) -> None:
        while True:
            record = self._records.get()
            text = record.text(self._form)
            if self._shown and self._console is not None:
                shown = (f'\033[{COLORS[record.severity]}m{text}\033[0m'
                         if self._console.colored else text)
                self._console.write(shown + '\n')
            if record.rosout is not None:
                self._publish(record, record.rosout)
            if self._file is not None:
                try:
                    os.write(self._file, (text + '\n').encode(errors='replace'))
                except OSError:
                    # The disk is full: it may not be for ever.
                    self._dropped += 1
            self._written += 1

    def _publish(self, record: Record, rosout: Publisher) -> None:
        message = Log(level=int(record.severity), name=record.name, msg=record.message,
                      file=record.code.co_filename, function=record.code.co_name,
                      line=record.line)
        message.stamp.sec, message.stamp.nanosec = divmod(record.stamp, 10 ** 9)
        try:
            rosout.publish(message)
        except (rclpy_implementation.RCLError, InvalidHandle):
            # The graph is gone: the node ends.
            self._dropped += ok()

    def drain(self, patience: float = PATIENCE) -> None:
        """Wait until everything has been written, but no longer than ``patience``, s."""
        end = time.monotonic() + patience
        while self._written < self._taken and time.monotonic() < end:
            time.sleep(0.002)
        if self._console is not None:
            self._console.drain(end - time.monotonic())


#: The queue of this process, as its streams are shared, too.
QUEUE = LogQueue()


class QueuedLogger(rcutils_logger.RcutilsLogger):
    """rclpy's logger, which writes to the queue."""

    def __init__(self, name: str, rosout: Publisher | None = None) -> None:
        super().__init__(name)
        self._rosout = rosout

    @classmethod
    def of(cls, node: Node) -> 'QueuedLogger':
        """Return the logger of a node, for which rclpy's own does not publish."""
        rosout = node.create_publisher(Log, '/rosout', ROSOUT) if QUEUE.rosout else None
        return cls(node.get_logger().name, rosout)

    def get_child(self, name: str) -> 'QueuedLogger':
        """Return a logger whose name is appended to this one's."""
        return QueuedLogger(f'{self.name}.{name}', self._rosout)

    def log(self, message: str, severity: LoggingSeverity, **options: Any) -> bool:
        """Log a message; options are rclpy's, for each place in the code that logs.

        Args:
            message: a text.
            severity: of it.
            options: throttle_duration_sec, once, skip_first.

        """
        if not self.is_enabled_for(severity):
            return False
        frame = sys._getframe(1)
        while frame.f_code.co_filename in INNER and frame.f_back is not None:
            frame = frame.f_back
        if options and not self._passes((frame.f_code, frame.f_lasti), options):
            return False
        QUEUE.put(Record(time.time_ns(), LoggingSeverity(severity), self.name, str(message),
                         frame.f_code, frame.f_lineno, self._rosout))
        return True

    def _passes(self, place: tuple[CodeType, int], options: dict[str, Any]) -> bool:
        context = self.contexts.get(place)
        if context is None:
            context = self.contexts[place] = {
                'filters': rcutils_logger.get_filters_from_kwargs(**options)}
            for name in context['filters']:
                rcutils_logger.supported_filters[name].initialize_context(context, **options)
        return all(rcutils_logger.supported_filters[name].should_log(context)
                   for name in context['filters'])
