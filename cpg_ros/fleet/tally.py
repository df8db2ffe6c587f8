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

"""The progress of many jobs: done, failed, rate and time left.

On a terminal one line is redrawn in place; elsewhere (a log) it is a line a minute and one at the
end.
"""

from collections.abc import Callable
import sys
import time
from types import TracebackType
from typing import TextIO

#: Seconds between lines where there is no terminal, between redrawings on one, and before the
#: first of these.
MINUTE, REDRAWN, PATIENCE = 60.0, 0.2, 2.0


def _time(seconds: float) -> str:
    if seconds < 90.0:
        return f'{seconds:.0f} s'
    if seconds < 5400.0:
        return f'{seconds / 60.0:.0f} min'
    return f'{seconds / 3600.0:.1f} h'


class Tally:
    """Counts jobs and reports their progress on standard error.

    Attributes:
        total: jobs there are; None while that is not known.
        done: jobs that have ended, those that failed among them.
        failed: of these.
        kept: jobs that earlier runs had done.

    """

    def __init__(self, what: str, total: int | None, enabled: bool = True,
                 stream: TextIO | None = None,
                 clock: Callable[[], float] = time.monotonic) -> None:
        self.what, self.total = what, total
        self.done = self.failed = self.kept = 0
        self._stream = stream or sys.stderr
        self._enabled, self._clock = enabled, clock
        self._live = self._stream.isatty()
        self._began = self._reported = clock()
        self._drawn = False

    def add(self, failed: bool = False, kept: bool = False) -> None:
        """Count a job."""
        self.done += 1
        self.failed += failed
        self.kept += kept
        self.tick()

    @property
    def line(self) -> str:
        """The progress, as one line."""
        spent = self._clock() - self._began
        worked = self.done - self.kept
        rate = worked / spent if spent > 0.0 else 0.0
        parts = [f'{self.what}: {self.done}' + ('' if self.total is None else f' of {self.total}')
                 + ' done', f'{self.failed} failed']
        if self.kept:
            parts.append(f'{self.kept} from before')
        parts.append(f'{rate:.2f} a second' if rate >= 1.0 else f'{60.0 * rate:.2g} a minute')
        if self.total is not None and worked and self.done < self.total:
            parts.append(f'{_time((self.total - self.done) / rate)} left')
        return ', '.join(parts)

    def tick(self) -> None:
        """Report the progress if it is due."""
        now = self._clock()
        if not self._enabled or now - self._reported < (REDRAWN if self._live else MINUTE):
            return
        if self._live and now - self._began < PATIENCE:
            return
        self._reported, self._drawn = now, True
        self._write()

    def _write(self) -> None:
        self._stream.write(f'\r{self.line}\x1b[K' if self._live else self.line + '\n')
        self._stream.flush()

    def __enter__(self) -> 'Tally':
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None,
                 trace: TracebackType | None) -> None:
        if self._enabled and self._drawn:
            self._write()
            if self._live:
                self._stream.write('\n')
