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

"""What the benchmarks share: timing by turns, messages on stderr, one JSON line on stdout."""

from collections.abc import Callable
import json
from pathlib import Path
import statistics
import sys
import time

ROOT = Path(__file__).resolve().parent.parent
# Installed, as under `make bench`, or from the sources, when a script is started by itself.
sys.path.append(str(ROOT))


def log(text: str) -> None:
    """Report progress."""
    print(text, file=sys.stderr, flush=True)


def emit(**result: object) -> None:
    """Print the one JSON line, floats with five significant digits."""
    def shorten(value: object) -> object:
        if isinstance(value, dict):
            return {key: shorten(inner) for key, inner in value.items()}
        if isinstance(value, list | tuple):
            return [shorten(inner) for inner in value]
        if isinstance(value, float):
            return float(f'{value:.5g}')
        return value
    print(json.dumps(shorten(result)), flush=True)


def by_turns(contestants: dict[str, tuple[Callable[[], object], int]], rounds: int
             ) -> dict[str, dict[str, float]]:
    """Time contestants by turns, so that noise of the machine meets all of them.

    Args:
        contestants: name -> (what to time, how often in each round).
        rounds: turns that each of them gets.

    Returns:
        Name -> best and median time of a call in ms.

    """
    spent: dict[str, list[float]] = {name: [] for name in contestants}
    log(f'timing {len(contestants)} contestants in {rounds} rounds')
    for _ in range(rounds):
        for name, (call, times) in contestants.items():
            for _ in range(times):
                began = time.perf_counter()
                call()
                spent[name].append(1e3 * (time.perf_counter() - began))
    return {name: {'best': min(each), 'median': statistics.median(each)}
            for name, each in spent.items()}
