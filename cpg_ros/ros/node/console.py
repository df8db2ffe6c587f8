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

"""Standard output and error of a node, written by a separate process that may be blocked.

A terminal paused by Ctrl-S, or a pipe that nobody reads, blocks its writers; a thread of C++ code
that is blocked there with the interpreter's lock stops all others. So both streams become pipes
that never block: what does not fit is lost, and counted where possible. Another process, which
outlives the node even if it crashes, relays the contents of the pipes. As a program, this file is
that process: python console.py DESCRIPTOR ... with the descriptors from which it reads.
"""

import array
from collections.abc import Sequence
import contextlib
import fcntl
import io
import mmap
import os
import select
import signal
import subprocess
import sys
import termios
import threading
import time

OUT, ERROR = STREAMS = 1, 2
#: WORDS: words of 8 bytes for each stream in shared memory: whether output is being relayed, and
#: the number of lost lines.
WORDS = 2
#: SIGNALS: signals that end nodes, which the relay ignores: it ends after all writers.
SIGNALS = signal.SIGINT, signal.SIGTERM, signal.SIGHUP, signal.SIGQUIT


class _Stream(io.FileIO):
    """A stream that drops what does not fit, instead of raising an error in a print."""

    def __init__(self, descriptor: int, terminal: bool) -> None:
        super().__init__(descriptor, 'w', closefd=False)
        self._terminal = terminal

    def isatty(self) -> bool:
        """Tell whether what is written ends on a terminal."""
        return self._terminal

    def write(self, data: bytes) -> int:  # type: ignore[override]
        """Write as much of the text as fits."""
        with contextlib.suppress(OSError):
            super().write(data)
        return len(data)


class Console:
    """Standard output and error of this process, made so that writing never blocks.

    Attributes:
        colored: whether log lines have colors: they go to a terminal, or
            RCUTILS_COLORIZED_OUTPUT is set to 1.

    """

    def __init__(self) -> None:
        """Start the relay.

        Raises:
            OSError: the system has no pipe or process left.

        """
        for descriptor in STREAMS:
            try:
                os.fstat(descriptor)
            except OSError:
                os.dup2(os.open(os.devnull, os.O_WRONLY), descriptor)
        for stream in (sys.stdout, sys.stderr):
            if stream is not None:
                stream.flush()
        terminal = {descriptor: os.isatty(descriptor) for descriptor in STREAMS}
        use = OUT if os.environ.get('RCUTILS_LOGGING_USE_STDOUT') == '1' else ERROR
        # rcutils looks at the stream, which is a pipe from now on.
        color = os.environ.setdefault('RCUTILS_COLORIZED_OUTPUT', str(int(terminal[use])))
        self.colored, self._log = color == '1', use
        self._lost = 0
        shared = os.memfd_create('console')
        os.ftruncate(shared, mmap.PAGESIZE)
        self._shared = memoryview(mmap.mmap(shared, mmap.PAGESIZE)).cast('Q')
        # Streams that are the same stay the same, so that their lines keep their order.
        same = os.path.sameopenfile(*STREAMS)
        pipes = [os.pipe() for _ in STREAMS[same:]]
        reads = [read for read, _ in pipes]
        # A session of its own: Ctrl-C, or the end of a terminal, is not for the relay.
        self._relay = subprocess.Popen(
            [sys.executable, '-IS', __file__, str(shared), *map(str, reads)],
            stdin=subprocess.DEVNULL, pass_fds=[shared, *reads], start_new_session=True)
        os.close(shared)
        for read in reads:
            os.close(read)
        self._writes = [write for _, write in pipes]
        for write, descriptor in zip(self._writes * (1 + same), STREAMS, strict=True):
            os.set_blocking(write, False)
            os.dup2(write, descriptor)
        for name, descriptor in (('stdout', OUT), ('stderr', ERROR)):
            stream = io.TextIOWrapper(
                io.BufferedWriter(_Stream(descriptor, terminal[descriptor])), line_buffering=True,
                errors='backslashreplace', write_through=descriptor == ERROR)
            setattr(sys, name, stream)
            setattr(sys, f'__{name}__', stream)

    def write(self, line: str) -> None:
        """Write a line of a log if there is room."""
        data = line.encode(errors='backslashreplace')
        try:
            if os.write(self._log, data) < len(data):
                self._lost += 1
        except OSError:
            self._lost += 1

    @property
    def lost(self) -> int:
        """Number of lost lines: of the log for lack of room, of both streams for other reasons."""
        return self._lost + sum(self._shared[1:WORDS * len(self._writes):WORDS])

    def drain(self, patience: float) -> None:
        """Wait until everything has been relayed, but no longer than ``patience``, s."""
        end = time.monotonic() + patience
        while self._waiting() and self._relay.poll() is None and time.monotonic() < end:
            time.sleep(0.002)

    def _waiting(self) -> bool:
        for k, write in enumerate(self._writes):
            left = array.array('i', [0])
            fcntl.ioctl(write, termios.FIONREAD, left)
            if left[0] or self._shared[WORDS * k]:
                return True
        return False


def _relay(read: int, write: int, shared: memoryview) -> None:
    """Relay a stream until nobody can write to it any more."""
    poll = select.poll()
    poll.register(read, select.POLLIN)
    while True:
        poll.poll()
        shared[0] = 1
        data = os.read(read, 1 << 16)
        if not data:
            return
        while data:
            try:
                data = data[os.write(write, data):]
            except BlockingIOError:
                # Another process has made it so, for all who share the stream.
                select.select([], [write], [])
            except OSError:
                # The disk is full, or the terminal is gone.
                shared[1] += max(1, data.count(b'\n'))
                data = b''
        shared[0] = 0


def main(arguments: Sequence[str]) -> None:
    """Relay streams; arguments are the descriptors of the shared memory and of the pipes."""
    for number in SIGNALS:
        signal.signal(number, signal.SIG_IGN)
    memory, *reads = map(int, arguments)
    shared = memoryview(mmap.mmap(memory, mmap.PAGESIZE)).cast('Q')
    for k, read in enumerate(reads):
        # The last stream is standard error, and the only one if both are the same.
        write = STREAMS[k + len(STREAMS) - len(reads)]
        threading.Thread(target=_relay, args=(read, write, shared[WORDS * k:WORDS * (k + 1)])
                         ).start()


if __name__ == '__main__':
    main(sys.argv[1:])
