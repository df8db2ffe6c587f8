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

"""Processes of the demonstration, and what ends it."""

from collections.abc import Iterator
from contextlib import contextmanager
import signal
import subprocess

from cpg_ros.tools.demo_operator import DemoError
from cpg_ros.tools.executables import command


@contextmanager
def running(*arguments: str) -> Iterator[subprocess.Popen]:
    """Run one of the package's nodes out of reach of Ctrl-C; end it in any case."""
    executable, *ros = arguments
    process = subprocess.Popen(
        [*command(executable), '--ros-args', *ros],
        # In a session of its own: a terminal's Ctrl-C would reach it beside our own signal.
        start_new_session=True, stdin=subprocess.DEVNULL)
    try:
        yield process
    finally:
        process.terminate()
        process.wait()


class Interruption:
    """What ends the demonstration from outside: a signal, or the end of a node.

    A signal is only recorded, and acted upon where that is safe: an exception raised while a node
    starts would leave that node behind.

    Attributes:
        nodes: the processes to watch.

    """

    def __init__(self) -> None:
        self.nodes: list[subprocess.Popen] = []
        self._noted = False
        for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
            signal.signal(number, self._note)

    def _note(self, *_: object) -> None:
        # Whoever presses Ctrl-C again wants the film to be cut short.
        for node in self.nodes if self._noted else ():
            node.terminate()
        self._noted = True

    def look(self) -> None:
        """Return if nothing ended it.

        Raises:
            KeyboardInterrupt: a signal arrived.
            DemoError: a node ended.

        """
        if self._noted:
            raise KeyboardInterrupt
        for node in self.nodes:
            if node.poll() is not None:
                raise DemoError(f'a node ended with exit code {node.returncode}')
