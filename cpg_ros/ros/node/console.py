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

"""Standard output and error of a node, copied by a process that may wait.

A terminal paused by Ctrl-S, a pipe without a reader and a slow disk make a writer wait; rclpy's
logger waits with the interpreter's lock, and so do all threads. Therefore both streams become
pipes that never make a writer wait; lines that do not fit are lost. Another process, which
outlives a crash of the node, copies them to the original streams, and the log to its file. As a
program, this file is that process: python console.py LOG_FILE PIPE.
"""

import atexit
import contextlib
import io
import os
from pathlib import Path
import re
import select
import signal
import subprocess
import sys
import time
from typing import TextIO

IN, OUT, ERROR = 0, 1, 2
#: STREAM_ARGUMENTS: rclpy's logger writes to its stream only: to a file it would wait.
STREAM_ARGUMENTS = '--ros-args', '--disable-external-lib-logs', '--enable-stdout-logs'
#: Signals that end nodes; the copying process ignores them, as it ends after all writers.
TERMINATION_SIGNALS = signal.SIGINT, signal.SIGTERM, signal.SIGHUP, signal.SIGQUIT
#: COPY_TIMEOUT: longest time that the end of a node waits for its last lines to be copied, s.
COPY_TIMEOUT = 0.2
COLOR = re.compile(rb'\033\[\d+m')


class _Stream(io.FileIO):
    """A stream that drops what does not fit, instead of raising an exception in print."""

    def __init__(self, descriptor: int, terminal: bool) -> None:
        super().__init__(descriptor, 'w', closefd=False)
        self._terminal = terminal

    def isatty(self) -> bool:
        """Return whether the original stream is a terminal."""
        return self._terminal

    def write(self, data: bytes) -> int:  # type: ignore[override]
        """Write as much of the text as fits."""
        with contextlib.suppress(OSError):
            super().write(data)
        return len(data)


def _streams() -> tuple[int, int]:
    """Return the stream of rcutils' log, and the other one."""
    return (OUT, ERROR) if os.environ.get('RCUTILS_LOGGING_USE_STDOUT') == '1' else (ERROR, OUT)


def aside() -> TextIO:
    """Return the stream that is not copied to the log file."""
    return sys.stdout if _streams()[1] == OUT else sys.stderr


def never_wait(name: str, arguments: list[str]) -> None:
    """Make writing to standard output and error never wait; start the copying process.

    Args:
        name: prefix of the log file's name unless --log-file-name gives one.
        arguments: of ROS.

    Raises:
        OSError: no pipe or process is available.

    """
    for descriptor in OUT, ERROR:
        try:
            os.fstat(descriptor)
        except OSError:
            os.dup2(os.open(os.devnull, os.O_WRONLY), descriptor)
    log, other = _streams()
    # rcutils looks at the stream, which is a pipe from now on.
    os.environ.setdefault('RCUTILS_COLORIZED_OUTPUT', str(int(os.isatty(log))))
    (read, write), (read_other, write_other) = os.pipe(), os.pipe()
    # A session of its own: Ctrl-C, or the end of a terminal, is not for it.
    copying = subprocess.Popen(
        [sys.executable, '-IS', __file__, _log_file(name, arguments), str(read_other)],
        stdin=read, stdout=log if _wanted('stdout', arguments) else subprocess.DEVNULL,
        stderr=other, pass_fds=[read_other], start_new_session=True)
    for descriptor, pipe in (log, write), (other, write_other):
        stream = 'stdout' if descriptor == OUT else 'stderr'
        if (original := getattr(sys, stream)) is not None:
            original.flush()
        terminal = os.isatty(descriptor)
        os.set_blocking(pipe, False)
        os.dup2(pipe, descriptor)
        setattr(sys, stream, io.TextIOWrapper(
            io.BufferedWriter(_Stream(descriptor, terminal)), line_buffering=True,
            errors='backslashreplace'))
    for descriptor in read, write, read_other, write_other:
        os.close(descriptor)
    atexit.register(_end, copying)


def _end(copying: subprocess.Popen) -> None:
    """Close both streams, and wait for the copying process, no longer than COPY_TIMEOUT."""
    closed = os.open(os.devnull, os.O_WRONLY)
    for descriptor in OUT, ERROR:
        os.dup2(closed, descriptor)
    with contextlib.suppress(subprocess.TimeoutExpired):
        copying.wait(COPY_TIMEOUT)


def _wanted(kind: str, arguments: list[str]) -> bool:
    """Return whether the arguments of ROS enable a kind of logs: the last switch counts."""
    switches = [word for word in arguments if word.endswith(f'able-{kind}-logs')]
    return switches[-1:] != [f'--disable-{kind}-logs']


def _log_file(name: str, arguments: list[str]) -> str:
    """Return the path of the log file."""
    # The process that copies has no rclpy.
    from rclpy.logging import get_logging_directory
    if not _wanted('external-lib', arguments):
        return os.devnull
    if '--log-file-name' in arguments[:-1]:
        name = arguments[arguments.index('--log-file-name') + 1]
    milliseconds = time.time_ns() // 10 ** 6
    return str(get_logging_directory() / f'{name}_{os.getpid()}_{milliseconds}.log')


def _write(descriptor: int, data: bytes) -> None:
    """Write all, waiting if necessary; drop what a full disk or a closed terminal refuses."""
    while data:
        try:
            data = data[os.write(descriptor, data):]
        except BlockingIOError:
            # Another process has made it so, for all who share the stream.
            select.select([], [descriptor], [])
        except OSError:
            return


def main(path: str, other: int) -> None:
    """Copy the log from standard input to standard output and, without colors, to a file.

    Args:
        path: of the file.
        other: descriptor of a pipe that is copied to standard error.

    """
    for number in TERMINATION_SIGNALS:
        signal.signal(number, signal.SIG_IGN)
    try:
        Path(path).parent.mkdir(parents=True, exist_ok=True)
        file = os.open(path, os.O_WRONLY | os.O_CREAT | os.O_APPEND, 0o644)
    except OSError as error:
        _write(OUT, f'no log file {path}: {error.strerror}\n'.encode())
        file = os.open(os.devnull, os.O_WRONLY)
    targets = {IN: OUT, other: ERROR}
    while targets:
        for pipe in select.select(list(targets), [], [])[0]:
            data = os.read(pipe, 1 << 16)
            if pipe == IN:
                _write(file, COLOR.sub(b'', data))
            _write(targets[pipe], data)
            if not data:
                del targets[pipe]


if __name__ == '__main__':
    main(sys.argv[1], int(sys.argv[2]))
