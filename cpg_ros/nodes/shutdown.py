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

"""The signals that end a node, and the end of the process while a thread is still at work."""

import os
import signal
import threading

from cpg_ros.nodes.log_queue import QUEUE

#: How long to wait for the end of a thread, s.
PATIENCE = 0.2


def endings() -> list[signal.Signals]:
    """Return the signals that end a node; SIGHUP does not if it was ignored at the start."""
    return [number for number in (signal.SIGINT, signal.SIGTERM, signal.SIGQUIT, signal.SIGHUP)
            if number != signal.SIGHUP or signal.getsignal(number) != signal.SIG_IGN]


def ended(code: int, *threads: threading.Thread | None) -> int:
    """Return the exit code once the threads have ended; if one does not, end the process with it.

    An interpreter that winds up under a thread which then returns from compiled C++ code is
    aborted by the C++ runtime.
    """
    for thread in filter(None, threads):
        thread.join(PATIENCE)
        if thread.is_alive():
            QUEUE.drain()
            os._exit(code)
    return code
