"""A progress bar on standard error, shown only when work takes longer than two seconds."""

import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager

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
