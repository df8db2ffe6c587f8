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

"""Resident memory of the generator at 1 kHz over minutes, beside a node that only publishes.

In the first half nothing happens, in the second the gait is changed every 5 s through the real
parameter service. A generator that runs for days must not grow: less than 1 MB in the plain half.
"""

import argparse
import itertools
import time

from client import ParameterClient, text
from common import emit, log
import numpy as np
from processes import enter_workspace, Process, start_node
import rclpy

GAITS = ('walk', 'trot', 'pace', 'bound', 'jump', 'pronk')
EVERY, SWITCH_EVERY, START = 2.0, 5.0, 10.0
TARGETS = {'growth_plain_mb': 1.0}


def watch(node: Process, seconds: float, client: ParameterClient | None = None
          ) -> tuple[dict[str, float], int]:
    """Sample the memory of a running node; with a client, change its gait meanwhile."""
    began = time.monotonic()
    times, resident, switches = [], [], 0
    gaits = itertools.cycle(GAITS)
    while (now := time.monotonic() - began) <= seconds:
        times.append(now)
        resident.append(node.resident_mb())
        if client is not None and now >= switches * SWITCH_EVERY:
            (result,) = client.set([text('gait', next(gaits))], atomically=False)
            assert result.successful, result.reason
            switches += 1
        time.sleep(max(0.0, began + len(times) * EVERY - time.monotonic()))
    slope = 60.0 * np.polyfit(times, resident, 1)[0]
    return {'start_mb': resident[0], 'end_mb': resident[-1], 'most_mb': max(resident),
            'slope_mb_per_minute': float(slope)}, switches


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument('--seconds', type=float, default=300.0, help='for the generator')
    half = parser.parse_args().seconds / 2
    enter_workspace()
    result = {}
    log(f'null node, {START + half:.0f} s')
    with start_node('null', rate=1000.0) as node:
        time.sleep(START)
        result['null'], _ = watch(node, half)
    log(f'generator, {START + 2 * half:.0f} s')
    with start_node('generator', rate=1000.0, transition=1.0) as node:
        # Everything that is made once exists before the first sample, the client's side, too.
        rclpy.init(args=[])
        client = ParameterClient()
        client.get(client.names())
        time.sleep(START)
        result['plain'], _ = watch(node, half)
        log(f'plain half: {result["plain"]}')
        result['switching'], switches = watch(node, half, client)
        rclpy.shutdown()
    growth = {key: each['end_mb'] - each['start_mb'] for key, each in result.items()}
    emit(benchmark='memory', rate=1000.0, seconds=2 * half, switches=switches, **result,
         growth_mb=growth, growth_plain_mb=growth['plain'], targets=TARGETS,
         passed=growth['plain'] < TARGETS['growth_plain_mb'])


if __name__ == '__main__':
    main()
