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

"""Every attack on what surrounds the loop, many times: nothing falls, no joint beyond its limits.

The attacks are the live tests of them, which hold each message against the limits and end with the
robot at its stand, sitting or damped; here each is repeated, on processes of its own every time.

With --sensors the faults are those of the sensors of a simulated Go2 that trots, in this process:
each row of ``test/support/sensor_faults.py`` with some seeds. A seed draws the noise and the time
at which the fault begins.

With --gaps something holds up a generator at 1 kHz; the longest gap between two of its messages
is compared with that of one that is left alone, which is measured first and last.

usage: bench_faults.py [--times 20] [--only NAME] [--sensors] [--seeds 5] [--gaps]
"""

import argparse
from collections import Counter
from contextlib import ExitStack
import math
import os
from pathlib import Path
import pty
import subprocess
import sys
import tempfile
import time
from xml.etree import ElementTree

from common import emit, log, ROOT
import numpy as np
from processes import ends_with_us, enter_workspace, HERE, Listener, Process

sys.path.append(str(ROOT / 'test' / 'support'))

#: Attack -> the file of its tests, and their names.
FAULTS = {
    'blocked log': ('ros/test_blocked_log.py',
                    'test_a_generator_moves_on_and_ends_at_the_stand', 'test_a_bridge_sits_down',
                    'test_every_node_ends_though_its_terminal_is_paused'),
    'ending signal': ('ros/test_process.py', 'test_a_signal_ends_it_at_the_stand_with_code_0',
                      'test_a_signal_while_it_imports_is_one_line'),
    'stopped clock': ('ros/test_clock.py',
                      'test_a_stop_does_not_wait_for_a_clock_that_stands_still',
                      'test_disabled_and_enabled_again_while_the_clock_stands_still'),
    'clock that jumps': ('ros/test_clock.py', 'test_a_looped_clock',
                         'test_two_publishers_of_different_times',
                         'test_a_stop_between_two_clocks',
                         'test_jitter_of_the_clock_is_not_seen'),
    'watchdog': ('ros/bridges/test_unitree_live.py',
                 'test_bridge_and_watchdog_killed_together_leave_the_last_command',
                 'test_another_users_watchdog_is_not_trusted',
                 'test_what_happens_on_a_fault[fed_by_another_user]'),
    'steering': ('ros/panel/test_panel_lease.py', 'test_two_pages_do_not_steer_at_once',
                 'test_a_link_with_a_delay_does_not_steer',
                 'test_a_page_that_was_frozen_does_not_steer',
                 'test_a_panel_that_was_stopped_publishes_zero_first',
                 'test_stop_works_from_any_page')}
TARGETS = {'failed': 0, 'skipped': 0}
#: What holds up a generator: its own threads, see disturbed_generator.py, where its log goes, and
#: requests of changes.
KINDS = 'log', 'garbage', 'lock', 'compile'
DISTURBANCES = 'terminal', 'pipe', 'parameters', *KINDS
#: MOST_MORE: longest gap beyond that of an idle run, ms; SETTLE: time from the start to the first
#: message, s, on a busy machine.
MOST_MORE, SETTLE = 5.0, 10.0
#: Faults that stop the legs, too: the servos keep the pose of an instant in mid-trot.
LEGS_STOP = 'stalled'
SENSOR_TARGETS = {'fell': 0, 'crossed': 0}
#: A run goes on for so long after a fault that ends, and takes so long with one that lasts, s.
AFTER, LASTS = 1.5, 5.0


def repeat(file: str, tests: list[str], times: int) -> dict[str, object]:
    """Run tests so often; return how many ended how, and the reasons of the first failures."""
    with tempfile.TemporaryDirectory() as folder:
        report = Path(folder) / 'report.xml'
        subprocess.run(
            [sys.executable, '-m', 'pytest', '--count', str(times), '-q', '--timeout', '600',
             f'--junitxml={report}', *(f'test/{file}::{test}' for test in tests)],
            cwd=ROOT, stdout=sys.stderr, check=False)
        cases = list(ElementTree.parse(report).iter('testcase'))
    outcomes: Counter[str] = Counter()
    reasons = []
    for case in cases:
        bad = [one for one in case if one.tag in ('failure', 'error')]
        skipped = case.find('skipped') is not None
        outcomes['failed' if bad else 'skipped' if skipped else 'passed'] += 1
        reasons += [f'{case.get("name")}: {one.get("message", "")[:200]}' for one in bad]
    return {'runs': len(cases), **{key: outcomes[key] for key in ('passed', 'failed', 'skipped')},
            'first failures': reasons[:3]}


def sensor_fault(fault: str, seeds: int) -> dict[str, object]:
    """Let a Go2 trot with a fault of its sensors; return how many runs ended how."""
    from faulty_go2 import FaultyGo2
    outcomes = []
    for seed in range(seeds):
        robot = FaultyGo2(fault, seed)
        ends = robot.sensors.ends
        outcomes.append(robot.run(LASTS if math.isinf(ends) else ends + AFTER))
    reasons = Counter(reason for one in outcomes for reason in one.faults)
    return {'runs': seeds, 'fell': sum(one.fell for one in outcomes),
            'crossed': sum(one.crossed for one in outcomes),
            'without feedback at the end': sum(float(one.fractions[-1]) == 0.0
                                               for one in outcomes),
            'reasons': [reason for reason, _ in reasons.most_common(3)]}


def sensor_table(seeds: int, only: str) -> None:
    """Run the table of faults of sensors."""
    from sensor_faults import FAULTS as ROWS
    found = {}
    for fault in ROWS:
        if only in fault:
            found[fault] = sensor_fault(fault, seeds)
            log(f'{fault}: {found[fault]}')
    emit(benchmark='sensor_faults', robot='unitree_go2', seeds=seeds, **found,
         targets=SENSOR_TARGETS, passed=all(
             one[key] == target for fault, one in found.items()
             for key, target in SENSOR_TARGETS.items()
             if key == 'crossed' or not fault.startswith(LEGS_STOP)))


def gap_ms(kind: str, seconds: float, priority: int) -> float:
    """Return the longest time between two messages being handed to the middleware, ms."""
    own, output = pty.openpty() if kind == 'terminal' else os.pipe()
    words = {'rate': 1000.0, 'robot': 'unitree_go2', 'combined_topic': 'joint_states',
             'thread_priority': priority}
    disturbance = 'log' if kind in ('terminal', 'pipe') else kind if kind in KINDS else 'idle'
    command = [sys.executable, str(HERE / 'disturbed_generator.py'), disturbance, '--ros-args',
               *(word for name, value in words.items() for word in ('-p', f'{name}:={value}'))]
    with ExitStack() as running:
        process = running.enter_context(subprocess.Popen(
            command, stdout=output, stderr=output, preexec_fn=ends_with_us))
        running.callback(process.kill)
        time.sleep(SETTLE)
        if kind == 'terminal':
            os.write(own, b'\x13')  # Ctrl-S; a pipe that nobody reads fills by itself
        elif kind == 'parameters':
            running.enter_context(Process([sys.executable, str(HERE / 'flood.py')]))
        listener = running.enter_context(Listener(seconds))
        record, _ = listener.record()
    os.close(own)
    os.close(output)
    source = record['source'][int(record['source'].size > 500) * 500:]
    return float(np.diff(source).max()) * 1e-6


def gap_table(seconds: float, only: str, priority: int) -> None:
    """Measure the longest gaps, idle ones first and last."""
    kinds = ['idle', *(kind for kind in DISTURBANCES if only in kind), 'idle']
    gaps = []
    for kind in kinds:
        gaps.append(gap_ms(kind, seconds, priority))
        log(f'{kind}: {gaps[-1]:.3f} ms')
    idle = max(gaps[0], gaps[-1])
    found = dict(zip(kinds[1:-1], gaps[1:-1], strict=True))
    emit(benchmark='gaps', seconds=seconds, priority=priority, idle_ms=[gaps[0], gaps[-1]],
         gap_ms=found, targets={'more_ms': MOST_MORE},
         passed=max(found.values()) - idle <= MOST_MORE)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument('--times', type=int, default=20, help='repetitions of each test')
    parser.add_argument('--only', default='', help='attacks with this in their names')
    parser.add_argument('--sensors', action='store_true', help='faults of the sensors instead')
    parser.add_argument('--seeds', type=int, default=5, help='of each fault of the sensors')
    parser.add_argument('--gaps', action='store_true', help='longest gaps between messages')
    parser.add_argument('--seconds', type=float, default=20.0, help='of each run with --gaps')
    parser.add_argument('--priority', type=int, default=0, help='thread_priority with --gaps')
    given = parser.parse_args()
    enter_workspace()
    if given.gaps:
        gap_table(given.seconds, given.only, given.priority)
        return
    if given.sensors:
        sensor_table(given.seeds, given.only)
        return
    found = {}
    for fault, (file, *tests) in FAULTS.items():
        if given.only in fault:
            log(f'{fault}: {len(tests)} tests, {given.times} times')
            found[fault] = repeat(file, tests, given.times)
    emit(benchmark='faults', times=given.times, **found, targets=TARGETS, passed=all(
        one['runs'] and one[key] == target for one in found.values()
        for key, target in TARGETS.items()))


if __name__ == '__main__':
    main()
