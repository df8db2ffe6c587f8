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

"""The generator's period at 1 kHz with every core loaded: with real-time priority, and without.

Two busy processes a core run all the time. What is judged is how far the instants at which
messages are handed to the middleware are from a period apart; a subscriber in another process,
which the load delays too, only collects them. Order: without, with, without, with.
"""

import argparse
import contextlib
import os
import sys

from common import emit, log
import numpy as np
from processes import enter_workspace, Listener, Process, start_node

RATE = 1000.0
#: Left out at first: the connection, and the start.
SETTLE = 500
TARGETS = {'p99.9_ratio': 0.1}
PRIORITIES = {'ordinary': 0, 'priority': 80}


def measure(kind: str, seconds: float) -> tuple[np.ndarray, int]:
    """Return the errors of the periods of one start, us, and how many ticks were dropped."""
    with start_node('generator', rate=RATE, thread_priority=PRIORITIES[kind]) as node:
        if ('SCHED_FIFO' in node.output) != bool(PRIORITIES[kind]):
            raise RuntimeError(f'the priority is not the requested one:\n{node.output}')
        with Listener(seconds) as listener, contextlib.ExitStack() as load:
            for _ in range(2 * os.cpu_count()):
                load.enter_context(Process([sys.executable, '-c', 'while True: pass']))
            record, health = listener.record()
    dropped = int(health[-1]['dropped ticks']) - int(health[0]['dropped ticks'])
    return np.abs(np.diff(record['source'][SETTLE:]) - 1e9 / RATE) / 1e3, dropped


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument('--seconds', type=float, default=6.0, help='length of each window')
    arguments = parser.parse_args()
    enter_workspace()
    errors: dict[str, list[np.ndarray]] = {kind: [] for kind in PRIORITIES}
    dropped = dict.fromkeys(PRIORITIES, 0)
    for _ in range(2):
        for kind in PRIORITIES:
            log(f'{kind}: {arguments.seconds:.0f} s under load')
            found, lost = measure(kind, arguments.seconds)
            errors[kind].append(found)
            dropped[kind] += lost
    tails = {kind: {f'p{level:g}': float(np.percentile(np.concatenate(found), level))
                    for level in (50, 99, 99.9, 100)} for kind, found in errors.items()}
    ratio = tails['priority']['p99.9'] / tails['ordinary']['p99.9']
    emit(benchmark='priority', rate=RATE, seconds=arguments.seconds, cores=os.cpu_count(),
         period_error_us=tails, dropped_ticks=dropped, **{'p99.9_ratio': ratio}, targets=TARGETS,
         passed=ratio <= TARGETS['p99.9_ratio'])


if __name__ == '__main__':
    main()
