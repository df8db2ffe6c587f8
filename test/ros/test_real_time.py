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

"""Priority, cores and locked memory of the publishing thread, as the system has them."""

import contextlib
import os
from pathlib import Path
import re
import subprocess
import sys

from cpg_ros.ros.node.ticker import NoSuchCore, RealTime
from graph import EXECUTABLE
import pytest

MAY = 'import os; os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(1))'
#: Not in this process: locking all of its memory, too, would stay.
PRIVILEGED = subprocess.run([sys.executable, '-c', MAY], stderr=subprocess.DEVNULL).returncode == 0
CORE = min(os.sched_getaffinity(0))


def threads(pid):
    """Thread id -> scheduling policy and priority, of the threads of a process."""
    found = {}
    for thread in map(int, os.listdir(f'/proc/{pid}/task')):
        # One may have ended.
        with contextlib.suppress(ProcessLookupError):
            found[thread] = os.sched_getscheduler(thread), os.sched_getparam(thread).sched_priority
    return found


@pytest.mark.skipif(not PRIVILEGED, reason='this user may not set a real-time priority')
def test_the_publishing_thread_gets_priority_core_and_memory(start):
    process, watcher = start('-p', 'thread_priority:=20', '-p', f'cpu_affinity:={CORE}',
                             '-p', 'lock_memory:=true')
    process.wait_for(rf'real time: (memory locked, )?core {CORE}, SCHED_FIFO, priority 20')
    found = threads(process.pid)
    fast = [thread for thread, policy in found.items() if policy == (os.SCHED_FIFO, 20)]
    assert len(fast) == 1
    # None of the others can be held up by an ordinary process while it holds the interpreter.
    del found[fast[0]]
    assert set(found.values()) == {(os.SCHED_RR, 1)}
    assert os.sched_getaffinity(fast[0]) == {CORE}
    assert os.sched_getaffinity(process.pid) == os.sched_getaffinity(0)
    status = Path(f'/proc/{process.pid}/status').read_text()
    locked = int(re.search(r'VmLck:\s+(\d+)', status)[1])
    assert locked > 100_000 or 'lock_memory refused' in process.log
    watcher.record(0.5)


def test_nothing_is_asked_for_by_default(start):
    process, _ = start()
    assert set(threads(process.pid).values()) == {(os.SCHED_OTHER, 0)}
    assert 'real time' not in process.log


def test_what_is_refused_is_a_line_that_says_what_to_set():
    # In a process of its own, as a user who may not.
    text = """
import os, resource
from cpg_ros.ros.node.ticker import RealTime
for limit in (resource.RLIMIT_RTPRIO, resource.RLIMIT_MEMLOCK):
    resource.setrlimit(limit, (0, 0))
if os.getuid() == 0:
    os.setuid(65534)
granted, refused = RealTime(80, (), True).claim()
assert granted == [], granted
print(*refused, sep='\\n')
"""
    ended = subprocess.run([sys.executable, '-P', '-c', text], capture_output=True, text=True)
    assert ended.returncode == 0, ended.stderr
    memory, priority = ended.stdout.splitlines()
    assert memory == ('lock_memory refused: Operation not permitted. Raise the limit memlock '
                      '(@realtime - memlock unlimited) in /etc/security/limits.conf, and log in '
                      'again')
    assert priority == ('thread_priority 80 refused: Operation not permitted. Raise the limit '
                        'rtprio (@realtime - rtprio 98) in /etc/security/limits.conf, and log in '
                        'again')


def test_a_core_that_is_not_there_is_refused():
    with pytest.raises(NoSuchCore, match=r'cpu_affinity: 4711 is not one of the cores that this '
                                         r'process may run on \('):
        RealTime.of(0, [CORE, 4711], False)
    assert RealTime.of(0, [-1], False).cores == ()


@pytest.mark.parametrize(('given', 'said'), [
    ('cpu_affinity:=[0, 4711]', 'cpu_affinity: 4711 is not one of the cores'),
    ('cpu_affinity:=first', "parameter cpu_affinity must be a list of integers, not 'first'"),
    ('thread_priority:=100', 'parameter thread_priority: 100 is not from 0 to 99')])
def test_bad_values_end_the_start(given, said):
    ended = subprocess.run([EXECUTABLE, '--ros-args', '-p', given], capture_output=True, text=True)
    assert ended.returncode == 1
    assert said in ended.stderr + ended.stdout and 'Traceback' not in ended.stderr
