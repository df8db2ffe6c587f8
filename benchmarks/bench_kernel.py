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

"""The generator at 1 kHz with the kernels that numba compiles, and with the exported C.

Three ways, by turns, each from an empty cache and then from one that is filled: numba; C beside
numba, which still compiles the readout; and C where numba cannot be imported, by a sitecustomize
that hides it. Seconds from the start of the process until it publishes, CPU time without a
subscriber, and whether all ticks were in time.
"""

import argparse
from collections.abc import Iterator
from contextlib import contextmanager
import os
from pathlib import Path
import tempfile
import time

from common import emit, log
from cpg_ros.networks.registry import NETWORKS
import numpy as np
from processes import enter_workspace, Listener, start_node

RATE, SETTLE = 1000.0, 3.0
#: Name -> the parameter kernel, and whether numba is hidden.
WAYS = {'numba': ('numba', False), 'c': ('c', False), 'c_without_numba': ('auto', True)}
HIDING = "import sys\nsys.modules['numba'] = None\n"
TARGETS = {'first_start_s': 3.0, 'missing': 0}


@contextmanager
def environment(cache: Path, hidden: bool) -> Iterator[None]:
    """Have children keep what they compile in a folder, and find no numba if it is hidden."""
    before = dict(os.environ)
    os.environ['NUMBA_CACHE_DIR'] = str(cache)
    if hidden:
        (cache / 'sitecustomize.py').write_text(HIDING)
        os.environ['PYTHONPATH'] = f'{cache}:{before.get("PYTHONPATH", "")}'
    yield
    os.environ.clear()
    os.environ.update(before)


def measure(way: str, network: str, seconds: float, cache: Path) -> dict[str, float]:
    """Start a generator; return its figures."""
    kernel, hidden = WAYS[way]
    with environment(cache, hidden):
        began = time.monotonic()
        with start_node('generator', rate=RATE, network=network, kernel=kernel,
                        robot=NETWORKS[network].usual_robot) as node:
            started = time.monotonic() - began
            time.sleep(SETTLE)
            before, began = node.cpu_s(), time.monotonic()
            time.sleep(seconds)
            percent = 100.0 * (node.cpu_s() - before) / (time.monotonic() - began)
            memory = node.resident_mb()
            with Listener(seconds) as listener:
                record, health = listener.record()
    missing = int((np.diff(record['sequence'][int(RATE / 2):]) != 1).sum())
    dropped = int(health[-1]['dropped ticks']) - int(health[0]['dropped ticks'])
    return {'start_s': started, 'cpu_percent': percent, 'resident_mb': memory,
            'missing': missing + dropped}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument('--seconds', type=float, default=10.0, help='length of each window')
    parser.add_argument('--networks', nargs='+', choices=[*NETWORKS], default=[*NETWORKS])
    arguments = parser.parse_args()
    enter_workspace()
    found: dict[str, dict] = {}
    for network in arguments.networks:
        found[network] = {}
        for way in WAYS:
            with tempfile.TemporaryDirectory() as cache:
                first, again = (measure(way, network, arguments.seconds, Path(cache))
                                for _ in range(2))
            found[network][way] = {**again, 'first_start_s': first['start_s'],
                                   'missing': first['missing'] + again['missing']}
            log(f'{network} {way}: {found[network][way]}')
    bare = [each['c_without_numba'] for each in found.values()]
    emit(benchmark='kernel', rate=RATE, seconds=arguments.seconds, networks=found,
         targets=TARGETS, passed=all(one[key] <= most for one in bare
                                     for key, most in TARGETS.items()))


if __name__ == '__main__':
    main()
