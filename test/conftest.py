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

import os
import signal

# As nodes and tools run: before numpy loads.
os.environ.setdefault('OPENBLAS_NUM_THREADS', '1')
# Shells make what they start in the background ignore it, and its children would, too.
if signal.getsignal(signal.SIGINT) == signal.SIG_IGN:
    signal.signal(signal.SIGINT, signal.default_int_handler)

from graph import EXECUTABLE, Process, Watcher  # noqa: E402
import pytest  # noqa: E402

#: Files whose tests measure against the clock on the wall: beside others they would fail.
ALONE = ('test_clock', 'test_demo', 'test_lockstep', 'test_stalls', 'test_stop_paths',
         'test_switching', 'test_topics', 'test_unitree_live')


def pytest_collection_modifyitems(items):
    """Mark what runs on a graph in real time, and of that what must have the machine to itself."""
    seen = set()
    for item in items:
        # The lines that a test runs are those of its first parameters, but for what other tests
        # see as well; measuring makes what runs in Python take two to three times as long.
        name = item.nodeid.partition('[')[0]
        if name in seen:
            item.add_marker('no_cover')
        seen.add(name)
        known = vars(item.module).values()
        given = set(getattr(item, 'callspec', item).__dict__.get('params', ()))
        fixtures = set(item.fixturenames) - given
        if {'start', 'running'} & fixtures or any(
                thing is one for thing in known for one in (EXECUTABLE, Process, Watcher)):
            item.add_marker('live')
            if item.module.__name__ in ALONE:
                item.add_marker('alone')


@pytest.fixture(autouse=True)
def processes(request, monkeypatch):
    """Measure what a test's processes run where the test itself is measured."""
    if request.node.get_closest_marker('no_cover'):
        monkeypatch.delenv('COVERAGE_PROCESS_CONFIG', raising=False)


@pytest.fixture
def start():
    """Start generators and watchers that are ended with the test."""
    ending = []

    def start_one(*ros_args: str, watch: bool = True, domain: int | None = None,
                  node: str = '/cpg_generator'):
        process = Process(*ros_args, domain=domain)
        ending.append(process)
        if not watch:
            return process
        process.wait_for('publishing')
        watcher = Watcher(process.domain, node)
        ending.append(watcher)
        return process, watcher

    yield start_one
    for one in reversed(ending):
        one.end()


@pytest.fixture(scope='module')
def running():
    """One generator for all tests of a file that leave it as they found it."""
    process = Process('-p', 'rate:=200.0', '-p', 'frequency:=2.0', '-p', 'transition:=0.4')
    process.wait_for('publishing')
    watcher = Watcher(process.domain)
    yield process, watcher
    watcher.end()
    process.end()
