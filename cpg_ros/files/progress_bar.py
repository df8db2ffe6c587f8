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

"""A progress bar on standard error, shown only when work takes longer than two seconds."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
import sys
import time

PATIENCE = 2.0
WIDTH = 30


@contextmanager
def progress_bar(what: str, total: int, enabled: bool = True) -> Iterator[Callable[[int], None]]:
    """Yield a function that takes the amount done so far.

    On a terminal the bar is redrawn in place; elsewhere (a log) it is one line every tenth.
    """
    started = time.monotonic()
    live = sys.stderr.isatty()
    shown = -1

    def update(done: int) -> None:
        nonlocal shown
        spent = time.monotonic() - started
        if not enabled or spent < PATIENCE or (done >= total and shown < 0):
            return
        share = done / total
        mark = int(share * (100 if live else 10))
        if mark == shown:
            return
        shown = mark
        bar = '#' * int(share * WIDTH)
        remaining = spent / share - spent if share else float('inf')
        line = f'{what} [{bar:<{WIDTH}}] {share:4.0%}, {remaining:.0f} s left'
        sys.stderr.write(f'\r{line}\x1b[K' if live else line + '\n')
        sys.stderr.flush()

    try:
        yield update
    finally:
        if live and shown >= 0:
            sys.stderr.write('\n')
