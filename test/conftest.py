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

from contextlib import ExitStack
import gc
import os
from pathlib import Path
import shutil
import signal

# As nodes and tools run: before numpy loads.
os.environ.setdefault('OPENBLAS_NUM_THREADS', '1')
# Shells make what they start in the background ignore it, and its children would, too.
if signal.getsignal(signal.SIGINT) == signal.SIG_IGN:
    signal.signal(signal.SIGINT, signal.default_int_handler)

from cpg_ros.ros.node.node_base import leave_shared_memory  # noqa: E402
import depth  # noqa: E402
from graph import EXECUTABLE, Process, Watcher  # noqa: E402
import pytest  # noqa: E402
from stepped import SteppedGenerator  # noqa: E402

depth.register()
# As nodes do, for this process and all that tests start.
os.environ['ROS_AUTOMATIC_DISCOVERY_RANGE'] = 'LOCALHOST'
leave_shared_memory()

#: What Chromium is called, and how it runs on a machine without a screen or a network.
CHROMIUM = 'chromium', 'chromium-browser', 'google-chrome'
FLAGS = ['--headless', '--no-sandbox', '--disable-gpu', '--use-angle=swiftshader',
         '--enable-unsafe-swiftshader', '--disable-quic', '--no-first-run',
         '--disable-background-networking', '--disable-component-update', '--disable-sync']


#: Libraries that apt does not have: where colcon runs the tests beside a sourced ROS, they may be
#: missing.
FROM_PIP = 'ezc3d', 'jitcdde', 'rosbags', 'websockets'


class File(pytest.Module):
    """The tests of a file, which are skipped where it imports a library that is missing."""

    def collect(self):
        try:
            return super().collect()
        except self.CollectError as error:
            cause = error.__cause__
            missing = next((name for name in FROM_PIP if name in str(cause)), '')
            if not (isinstance(cause, ImportError) and missing):
                raise
            pytest.skip(f'{missing} is not installed', allow_module_level=True)


def pytest_pycollect_makemodule(module_path, parent):
    """Read a file of tests."""
    return File.from_parent(parent, path=module_path)


def pytest_collection_modifyitems(items):
    """Mark what runs on a graph."""
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
        if {'start', 'running', 'stepped', 'generators'} & fixtures or any(
                thing is one for thing in known for one in (EXECUTABLE, Process, Watcher)):
            item.add_marker('live')


def pytest_collection_finish():
    """Spare the garbage collector what stays until the end."""
    gc.collect()
    gc.freeze()


def pytest_terminal_summary(terminalreporter, config):
    """Add what was skipped, and why, to the file that SKIPS names, for .ci/run."""
    if 'SKIPS' in os.environ:
        skipped = {f'{Path(file).relative_to(config.rootpath)}: {why.removeprefix("Skipped: ")}'
                   for file, _, why in (report.longrepr for report in
                                        terminalreporter.getreports('skipped'))}
        with Path(os.environ['SKIPS']).open('a') as lines:
            lines.writelines(f'{line}\n' for line in sorted(skipped))


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


@pytest.fixture(scope='session')
def generators():
    """Return the session's generator of a network, on simulated time in this process."""
    started = {}

    def of(network: str) -> SteppedGenerator:
        if network not in started:
            started[network] = SteppedGenerator('-p', f'network:={network}', '-p', 'rate:=200.0',
                                                '-p', 'frequency:=2.0', '-p', 'transition:=0.4')
        return started[network]

    yield of
    for one in started.values():
        one.end()


@pytest.fixture
def running(generators):
    """Return the generator of the delayed network and its watcher; a test may change it."""
    generator = generators('delayed')
    with generator.lent():
        yield generator, generator.watcher


@pytest.fixture
def stepped():
    """Start generators on simulated time in this process, which are ended with the test.

    Time goes on by itself, or as the test lets it run.
    """
    with ExitStack() as ending:
        def start_one(*ros_args: str, running: bool = True, domain: int | None = None):
            one = SteppedGenerator(*ros_args, domain=domain)
            ending.callback(one.end)
            if running:
                one.run()
            return one, one.watcher

        yield start_one


@pytest.fixture(scope='module')
def browser():
    """Yield Chromium without a screen, which looks at nothing but this machine."""
    playwright = pytest.importorskip('playwright.sync_api', reason='playwright is not installed')
    chromium = next(filter(None, map(shutil.which, CHROMIUM)), None)
    if chromium is None:
        pytest.skip('there is no Chromium on this machine')
    with playwright.sync_playwright() as running:
        started = running.chromium.launch(executable_path=chromium, args=FLAGS)
        yield started
        started.close()
