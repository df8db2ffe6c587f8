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

"""A generator at 500 Hz under thousands of hostile parameter requests, beside its idle self.

Through the real set_parameters and set_parameters_atomically. After every request all parameters
are read back: a refusal must have changed nothing, an acceptance exactly what it says. A listener
in another process looks for pauses in what is published, first with nobody asking anything.
"""

import argparse
from collections import Counter
import time

from client import NoAnswer, ParameterClient
from common import emit, log
from cpg_ros.networks.library.delayed import PRESETS
from hostile import effect, requests
import numpy as np
from processes import enter_workspace, Listener, start_node
from rcl_interfaces.msg import ParameterType
import rclpy

RATE = 500.0
SETTLE = 4.0
TARGETS = {'died': False, 'changed_by_refusals': 0, 'largest_gap_ms': 50.0}
NETWORKS = {name: {f'delayed.{key}': number for key, number in preset.network.as_dict().items()}
            for name, preset in PRESETS.items()}
TYPES = {bool: ParameterType.PARAMETER_BOOL, int: ParameterType.PARAMETER_INTEGER,
         float: ParameterType.PARAMETER_DOUBLE, str: ParameterType.PARAMETER_STRING}


def described(parameter) -> str:
    return f'{parameter.name[:40]!r} type {parameter.value.type}'


def harass(client: ParameterClient, count: int, seed: int) -> dict[str, object]:
    """Send the requests and check what each has done."""
    names = [name for name in client.names() if not name.startswith('qos_overrides')]
    values = client.get(names)
    # Arrays are read-only here, and left out.
    types = {name: TYPES[type(each)] for name, each in values.items() if type(each) in TYPES}
    tally: Counter[str] = Counter()
    wrong: list[str] = []
    unanswered = ''
    sent: list[tuple[int, str]] = []
    for number, (atomically, batch) in enumerate(requests(types, count, seed)):
        if number % 1000 == 0:
            log(f'{number} requests of {count}')
        sent.append((time.monotonic_ns(), f'{number}: {[described(p) for p in batch][:6]}'))
        try:
            results = client.set(batch, atomically)
            after = client.get(names)
        except NoAnswer as error:
            unanswered = f'request {number}, {[described(p) for p in batch]}: {error}'
            break
        accepted = sum(result.successful for result in results)
        tally['accepted'] += accepted
        tally['refused'] += len(results) - accepted
        tally['refused_without_reason'] += sum(
            not result.successful and not result.reason for result in results)
        expected = effect(values, atomically, batch, results, NETWORKS)
        # repr, because a NaN that got in is not equal to itself.
        off = [name for name in names if repr(after[name]) != repr(expected[name])]
        if off:
            tally['changed_by_refusals' if not accepted else 'otherwise_wrong'] += 1
            wrong.append(f'request {number}, {"atomic" if atomically else "each"}, '
                         f'{[described(p) for p in batch][:6]}: ' + ', '.join(
                             f'{n} is {after[n]!r}, not {expected[n]!r}' for n in off)[:400])
        elif any(isinstance(v, float) and not np.isfinite(v) for v in after.values()):
            tally['not_finite_accepted'] += 1
        values = after
    keys = ('accepted', 'refused', 'refused_without_reason', 'changed_by_refusals',
            'otherwise_wrong', 'not_finite_accepted')
    return {**{key: tally[key] for key in keys}, 'wrong': wrong[:5], 'unanswered': unanswered,
            'sent': sent}


def gaps(instants: np.ndarray) -> dict[str, float]:
    """Largest and 99.9 % gap between messages, ms."""
    between = 1e-6 * np.diff(instants)
    return {'largest': float(between.max()), 'p99.9': float(np.percentile(between, 99.9))}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument('--requests', type=int, default=10000)
    parser.add_argument('--idle', type=float, default=30.0, help='seconds before the requests')
    parser.add_argument('--seed', type=int, default=0)
    arguments = parser.parse_args()
    enter_workspace()
    with start_node('generator', rate=RATE) as node:
        rclpy.init(args=[])
        client = ParameterClient()
        time.sleep(SETTLE)
        with Listener(3600.0) as listener:
            time.sleep(1.0)
            idle_from = time.monotonic_ns()
            time.sleep(arguments.idle)
            busy_from = time.monotonic_ns()
            result = harass(client, arguments.requests, arguments.seed)
            busy_until = time.monotonic_ns()
            time.sleep(1.0)
            listener.end()
            record, health = listener.record()
        died = not node.alive or bool(result['unanswered'])
        output = node.output
        code = node.end()
        rclpy.shutdown()
    arrival = record['arrival']
    idle = (arrival >= idle_from) & (arrival < busy_from)
    busy = (arrival >= busy_from) & (arrival < busy_until)
    gap = {key: {state: gaps(record[key][part]) for state, part in (('idle', idle),
                                                                    ('busy', busy))}
           for key in ('arrival', 'source')}
    # The requests that were sent last before the three longest pauses ended.
    sent = result.pop('sent')
    ends = arrival[busy][1:][np.argsort(np.diff(arrival[busy]))[-3:]]
    suspects = [sent[np.searchsorted([instant for instant, _ in sent], end) - 1][1]
                for end in ends[::-1]]
    answers = np.concatenate([client.answer_ms['set_parameters'],
                              client.answer_ms['set_parameters_atomically']])
    figures = {'died': died, 'largest_gap_ms': gap['arrival']['busy']['largest'],
               'changed_by_refusals': result['changed_by_refusals'] + result['otherwise_wrong']}
    emit(benchmark='hostile', rate=RATE, requests=answers.size, seconds=(busy_until - busy_from)
         * 1e-9, **result | figures, largest_gap_idle_ms=gap['arrival']['idle']['largest'],
         gap_ms=gap, requests_at_largest_gaps=suspects,
         answer_ms={'p50': float(np.median(answers)), 'p99': float(np.percentile(answers, 99)),
                    'max': float(answers.max())},
         exceptions_logged=output.count('a request failed'),
         exceptions=Counter(line for line in output.splitlines() if 'Error' in line[:60]
                            ).most_common(5),
         exit_code=code, last_health=health[-1:], targets=TARGETS,
         passed=not died and figures['changed_by_refusals'] == 0
         and figures['largest_gap_ms'] <= TARGETS['largest_gap_ms'])


if __name__ == '__main__':
    main()
