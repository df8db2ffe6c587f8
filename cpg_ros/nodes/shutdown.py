"""How a node ends while one of its threads is still at work."""

import os
import sys
import threading

#: Seconds that a thread gets to come to its end.
PATIENCE = 0.2


def ended(code: int, *threads: threading.Thread | None) -> int:
    """Return the exit code once the threads have ended; if one does not, end the process with it.

    An interpreter that winds up under a thread which then returns from compiled C++ code is
    aborted by the C++ runtime.
    """
    for thread in filter(None, threads):
        thread.join(PATIENCE)
        if thread.is_alive():
            sys.stdout.flush()
            sys.stderr.flush()
            os._exit(code)
    return code
