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

"""How long a generator takes to start, and what it takes then, for each network in turn.

``two_legs.py`` is that of the tutorial about networks of one's own.

First from an empty cache, then from the one that the first start has filled: seconds from the
start of the process until it publishes, the CPU time of it and of its compilers until it ends 2 s
later, which is about the same on a quiet machine, resident memory, and whether numba is loaded.
Feedback is off.
"""

import argparse
import os
from pathlib import Path
import resource
import tempfile
import time

from common import emit, log
from cpg_ros.networks.registry import find_network, NETWORKS
from own_networks import tutorial_file
from processes import enter_workspace, start_node

SETTLE = 2.0
OWN, ROBOT = 'two_legs.py', 'two_legs.yaml'
#: s for shipped networks and for one's own, MB.
TARGETS = {'first_start_s': 3.0, 'own_first_start_s': 5.0, 'resident_mb': 110.0}


def spent() -> float:
    """Return the CPU time of all children that have ended, s."""
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return used.ru_utime + used.ru_stime


def measure(network: str, robot: str, cache: str) -> dict[str, float]:
    """Start a generator with a cache; return its figures."""
    os.environ['NUMBA_CACHE_DIR'] = cache
    began, before = time.monotonic(), spent()
    with start_node('generator', rate=1000.0, network=network,
                    robot=robot) as node:
        started = time.monotonic() - began
        time.sleep(SETTLE)
        maps = Path(f'/proc/{node.pid}/maps').read_text()
        found = {'start_s': started, 'resident_mb': node.resident_mb(),
                 'numba': 'llvmlite' in maps}
    return {**found, 'cpu_s': spent() - before}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument('--networks', nargs='+', default=[*NETWORKS, OWN], metavar='NAME',
                        choices=[*NETWORKS, OWN], help='networks')
    arguments = parser.parse_args()
    enter_workspace()
    found: dict[str, dict] = {}
    for network in arguments.networks:
        with tempfile.TemporaryDirectory() as cache:
            file, robot = ((tutorial_file(cache, OWN), tutorial_file(cache, ROBOT))
                           if network == OWN else (network, find_network(network).usual_robot))
            first, again = (measure(file, robot, cache) for _ in range(2))
        found[network] = {**again, **{f'first_{key}': value for key, value in first.items()}}
        log(f'{network}: {found[network]}')
    passed = all(each['first_start_s'] <= TARGETS[
        'first_start_s' if network in NETWORKS else 'own_first_start_s']
        and each['resident_mb'] <= TARGETS['resident_mb'] and not each['numba']
        for network, each in found.items())
    emit(benchmark='start', networks=found, targets=TARGETS, passed=passed)


if __name__ == '__main__':
    main()
