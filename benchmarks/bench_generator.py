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

"""The generator, at 1 kHz if not told otherwise, against a node that publishes constants
on the same thread and topics.

The null node's messages are typed, the generator's serialised once and filled in place. CPU time
of both without a subscriber; then, with one subscriber in another process, whether every period's
message is out, in order, at the right rate and without drift, and how far the periods are off.
Order: null, generator, generator, null.
"""

import argparse
import time

from common import emit, log
from cpg_ros.motion.robot_file import load_robot
from cpg_ros.networks.registry import NETWORKS
import numpy as np
from processes import enter_workspace, Listener, start_node

#: A network for eighteen joints.
SIX = 'delayed6'
SETTLE = 4.0
TARGETS = {'cpu_ratio': 1.0, 'rate_error': 1e-3, 'missing': 0, 'misstamped': 0,
           'drift_periods': 1.0}


def tails(ns: np.ndarray) -> dict[str, float]:
    """Percentiles in us."""
    return {f'p{level:g}': float(np.percentile(ns, level)) / 1e3
            for level in (50, 99, 99.9)} | {'max': float(ns.max()) / 1e3}


def judge(record: dict, health: list[dict], rate: float) -> dict[str, object]:
    """Completeness, rate, drift and jitter of one window."""
    period = 1e9 / rate
    # From half a second on: what was published before the connection stood is not counted.
    begin = np.searchsorted(record['arrival'], record['arrival'][0] + 500_000_000)
    arrival, source, stamp = (record[key][begin:] for key in ('arrival', 'source', 'stamp'))
    counts = {key: int(health[-1][f'{key} ticks']) - int(health[0][f'{key} ticks'])
              for key in ('dropped', 'late')}
    periods = (stamp - stamp[0]) / period
    steps, index = np.diff(periods), np.round(periods)
    return {
        'messages': int(stamp.size), 'ticks_dropped': counts['dropped'],
        'ticks_late': counts['late'],
        'missing': int((np.diff(record['sequence'][begin:]) != 1).sum()),
        # Every stamp is to be one period after the one before it.
        'misstamped': int((np.abs(steps - 1.0) > 0.5).sum()),
        'stamp_error_us': tails(np.abs(steps - 1.0) * period),
        'rate_error': abs((stamp.size - 1) / ((arrival[-1] - arrival[0]) * 1e-9) / rate - 1.0),
        'drift_periods': float(abs(periods[-1] - (stamp.size - 1))),
        'drift_ppm': float(1e6 * abs(np.polyfit(index, periods, 1)[0] - 1.0)),
        # Of the instants at which messages arrived and at which they were handed over.
        'arrival_period_error_us': tails(np.abs(np.diff(arrival) - period)),
        'source_period_error_us': tails(np.abs(np.diff(source) - period)),
        'behind_stamp_us': tails(source - stamp)}


def measure(kind: str, network: str, seconds: float, settings: dict[str, float]
            ) -> dict[str, object]:
    """One start of a node: CPU without and with a subscriber, and what that one saw."""
    log(f'{kind} ({network}): {2 * (seconds + SETTLE):.0f} s')
    own = {'network': network} if kind == 'generator' else {}
    with start_node(kind, robot=NETWORKS[network].usual_robot, **own, **settings) as node:
        def cpu_percent() -> float:
            before, began = node.cpu_s(), time.monotonic()
            time.sleep(seconds)
            return 100.0 * (node.cpu_s() - before) / (time.monotonic() - began)
        time.sleep(SETTLE)
        alone = cpu_percent()
        with Listener(seconds + 2.0) as listener:
            time.sleep(1.0)
            heard = cpu_percent()
            seen = judge(*listener.record(), settings['rate'])
        return {'cpu_percent': alone, 'cpu_percent_with_subscriber': heard, **seen}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument('--seconds', type=float, default=30.0, help='length of each window')
    parser.add_argument('--rate', type=float, default=1000.0, help='ticks per second')
    parser.add_argument('--priority', type=int, default=0, help='thread_priority of both nodes')
    parser.add_argument('--network', choices=[*NETWORKS, SIX],
                        help='by default all, in turn, and that of the hexapod')
    arguments = parser.parse_args()
    enter_workspace()
    settings = {'rate': arguments.rate, 'thread_priority': arguments.priority}
    found = {network: compare(network, arguments.seconds, settings)
             for network in ([arguments.network] if arguments.network else [*NETWORKS, SIX])}
    emit(benchmark='generator', **settings, seconds=arguments.seconds, networks=found,
         targets=TARGETS, passed=all(each['passed'] for each in found.values()))


def compare(network: str, seconds: float, settings: dict[str, float]) -> dict[str, object]:
    """Measure one network's generator against the null node with the same robot."""
    runs: dict[str, list] = {'null': [], 'generator': []}
    for kind in ('null', 'generator', 'generator', 'null'):
        runs[kind].append(measure(kind, network, seconds, settings))
        log(f'{runs[kind][-1]}')

    def mean(kind: str, key: str) -> float:
        return float(np.mean([run[key] for run in runs[kind]]))

    def worst(key: str) -> float:
        return max(run[key] for run in runs['generator'])

    def jitter(key: str) -> dict[str, dict[str, float]]:
        """Return the better of the two runs at each percentile: the machine's own noise aside."""
        return {kind: {level: min(run[key][level] for run in each) for level in each[0][key]}
                for kind, each in runs.items()}
    figures = {
        'cpu_ratio': mean('generator', 'cpu_percent') / mean('null', 'cpu_percent'),
        'rate_error': worst('rate_error'), 'drift_periods': worst('drift_periods'),
        'missing': worst('missing') + worst('ticks_dropped'), 'misstamped': worst('misstamped')}
    keys = ('cpu_percent', 'cpu_percent_with_subscriber')
    return {'joints': len(load_robot(NETWORKS[network].usual_robot).joints), **figures,
            **{key: {kind: mean(kind, key) for kind in runs} for key in keys},
            'cpu_ratio_with_subscriber': mean('generator', keys[1]) / mean('null', keys[1]),
            'arrival_period_error_us': jitter('arrival_period_error_us'),
            'source_period_error_us': jitter('source_period_error_us'),
            'behind_stamp_us': jitter('behind_stamp_us'), 'runs': runs,
            'passed': all(figures[key] <= goal for key, goal in TARGETS.items())}


if __name__ == '__main__':
    main()
