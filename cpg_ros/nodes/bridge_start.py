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

"""The start of a bridge, step by step, in a thread of its own; a step that fails ends it."""

from collections.abc import Callable, Sequence
import threading

from cpg_ros.errors import CpgError

#: Sleeps for some seconds; raises StartRefused once the start is cancelled.
Wait = Callable[[float], None]


class StartRefused(CpgError):
    """The robot is not started; the message is one line for the user."""


class StartSequence(threading.Thread):
    """Carries out steps one after another."""

    def __init__(self, steps: Sequence[Callable[[Wait], None]], on_end: Callable[[str], None]
                 ) -> None:
        """Prepare to start.

        Args:
            steps: each is called with a function that waits, and raises StartRefused to refuse.
            on_end: called with why the robot was not started, or ''.

        """
        super().__init__(name='start', daemon=True)
        self._steps, self._on_end = steps, on_end
        self._cancelled = threading.Event()
        self._reason = ''

    @property
    def cancelled(self) -> bool:
        """Whether the start was cancelled."""
        return self._cancelled.is_set()

    def cancel(self, reason: str) -> None:
        """Cancel the start at its next wait or step."""
        self._reason = reason
        self._cancelled.set()

    def run(self) -> None:
        """Carry out the steps."""
        reason = ''
        try:
            for step in self._steps:
                self._wait(0.0)
                step(self._wait)
        except StartRefused as error:
            reason = str(error)
        except Exception as error:
            # Whatever else goes wrong, the robot has not been touched.
            reason = f'{type(error).__name__}: {error}'
        self._on_end(reason)

    def _wait(self, seconds: float) -> None:
        if self._cancelled.wait(seconds):
            raise StartRefused(self._reason)
