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

"""How fast a generator at 1 kHz answers a gait switch and a signal, beside the null node.

All ordered pairs of each network's gaits through the real parameter service, half a second apart;
the null node answers the same calls with a parameter that does nothing. Then stops and starts by
``~/enable`` while another process floods the parameter services, each from the request to the
answer, with which it is in force; at last SIGINT and SIGTERM: how long until the process is gone,
ramp included, and its code.
"""

import argparse
import itertools
import random
import signal
import statistics
import sys
import time

from client import ParameterClient, text
from common import emit, log
from cpg_ros.networks.registry import NETWORKS, PRESETS
from processes import enter_workspace, HERE, Process, start_node
import rclpy
from rclpy.executors import SingleThreadedExecutor
from std_srvs.srv import SetBool

TARGETS = {'answer_ms_max': 100.0, 'stop_ms_max': 50.0, 'end_s_max': 1.0}


def answers(node: Process, values: list[str], parameter: str) -> dict[str, float]:
    """Set a parameter to one value after the other; times of the answers in ms."""
    client = ParameterClient({'gait': 'cpg_generator'}.get(parameter, 'null_node'))
    for value in values:
        (result,) = client.set([text(parameter, value)], atomically=False)
        if not result.successful:
            raise RuntimeError(f'{parameter} {value}: {result.reason}')
        time.sleep(0.5)
    times = client.answer_ms['set_parameters']
    client.node.destroy_node()
    return {'median': statistics.median(times), 'max': max(times)}


def stops(count: int) -> dict[str, float]:
    """Stop a generator again and again during a flood; times of the answers in ms."""
    node = rclpy.create_node('stopping')
    executor = SingleThreadedExecutor()
    executor.add_node(node)
    client = node.create_client(SetBool, 'cpg_generator/enable')
    client.wait_for_service()
    times = []
    with Process([sys.executable, str(HERE / 'flood.py')]).wait_for('flooding') as flood:
        time.sleep(1.0)
        for k in range(2 * count):
            began = time.perf_counter()
            future = client.call_async(SetBool.Request(data=bool(k % 2)))
            while not future.done():
                executor.spin_once(timeout_sec=1.0)
            if not k % 2:
                times.append(1e3 * (time.perf_counter() - began))
            time.sleep(0.03)
        flood.end()
        log(flood.output)
    node.destroy_node()
    return {'stops': count, 'median': statistics.median(times),
            'p99': statistics.quantiles(times, n=100)[98], 'max': max(times)}


def ending(kind: str, number: int) -> dict[str, float]:
    """Start a node, let it run, signal it; seconds until it is gone, and its exit code."""
    with start_node(kind, rate=1000.0) as node:
        time.sleep(3.0)
        began = time.monotonic()
        node.signal(number)
        code = node.wait()
        return {'s': time.monotonic() - began, 'code': code}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument('--only-stops', action='store_true')
    parser.add_argument('--priority', type=int, default=0, help='thread_priority in the flood')
    arguments = parser.parse_args()
    enter_workspace()
    rclpy.init()
    log('stops during a flood')
    with start_node('generator', rate=1000.0, ramp=0.1, network='quadruped',
                    thread_priority=arguments.priority):
        stopping = stops(200)
    if arguments.only_stops:
        emit(benchmark='services', stop_ms=stopping, targets=TARGETS,
             passed=stopping['max'] <= TARGETS['stop_ms_max'])
        return
    ours = {}
    for network, kind in NETWORKS.items():
        gaits = [name for name, preset in PRESETS[network].items() if name == preset.gait]
        pairs = list(itertools.permutations(gaits, 2))
        random.Random(0).shuffle(pairs)
        with start_node('generator', rate=1000.0, transition=0.4, network=network,
                        robot=kind.usual_robot) as node:
            log(f'{network}: {len(pairs)} ordered pairs of gaits')
            ours[network] = answers(node, [gait for pair in pairs for gait in pair], 'gait')
            ours[network]['pairs'] = len(pairs)
    with start_node('null', rate=1000.0) as node:
        log('the null node')
        null = answers(node, ['a', 'b'] * 15, 'nothing')
    rclpy.shutdown()
    log('signals')
    signals = {f'{kind} {name.name}': ending(kind, name)
               for kind in ('generator', 'null') for name in (signal.SIGINT, signal.SIGTERM)}
    ends = [value for key, value in signals.items() if key.startswith('generator')]
    passed = (stopping['max'] <= TARGETS['stop_ms_max']
              and all(each['max'] <= TARGETS['answer_ms_max'] for each in ours.values())
              and all(end['s'] <= TARGETS['end_s_max'] and end['code'] == 0 for end in ends))
    emit(benchmark='services', answer_ms=ours, answer_ms_null=null, stop_ms=stopping,
         signals=signals, targets=TARGETS, passed=passed)


if __name__ == '__main__':
    main()
