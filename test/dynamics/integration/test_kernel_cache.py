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

"""Kernels on disk: compiled for one network in one process, loaded with others in the next."""

import ast
import fcntl
import os
from pathlib import Path
import shutil
import signal
import subprocess
import sys

import cpg_ros
from cpg_ros.common.cache_folder import MAX_FOLDERS
from cpg_ros.common.files import resource_folder
from graph import EXECUTABLE, Process
import pytest

STEP = """
import numpy as np
from cpg_ros.dynamics.integration.simulate import simulate
from cpg_ros.networks.registry import PRESETS
network = next(iter(PRESETS[{network!r}].values())).network
simulate(network, np.zeros((2, network.components)), network.step, network.step)
"""


def environment(*without, **more):
    """Return ours with changes; not measured, which makes compiling take half as long again."""
    without = (*without, 'COVERAGE_PROCESS_CONFIG')
    return {key: value for key, value in os.environ.items() if key not in without} | more


@pytest.fixture(scope='module')
def copied(tmp_path_factory):
    """Return a copy of the package in which nothing has been compiled."""
    package = tmp_path_factory.mktemp('package')
    shutil.copytree(Path(cpg_ros.__file__).parent, package / 'cpg_ros',
                    ignore=shutil.ignore_patterns('__pycache__'))
    shutil.copytree(resource_folder('config'), package / 'config')
    return package


def kernels_after(package, code):
    """Run code in a process of its own; return what is on disk then."""
    subprocess.run([sys.executable, '-c', code], check=True, cwd=package,
                   env=environment('NUMBA_CACHE_DIR', PYTHONPATH=str(package)))
    return {*package.rglob('*.nbc'), *package.rglob('*.so')}


ONE = """
from cpg_ros.dynamics.integration.compilation import jit_entry
@jit_entry
def doubled(x):
    return 2.0 * x
assert doubled(1.0) == 2.0
"""


def test_a_changed_source_is_another_cache(copied):
    (copied / 'one.py').write_text(ONE)
    before = kernels_after(copied, 'import one')
    assert kernels_after(copied, 'import one') == before
    changed = copied / 'cpg_ros' / 'motion' / 'readout.py'
    text = changed.read_text()
    changed.write_text(text + '\n# Changed.\n')
    after = kernels_after(copied, 'import one')
    assert len(after - before) == 1 and after > before
    changed.write_text(text)
    assert kernels_after(copied, 'import one') == after


def test_a_changed_source_is_generated_and_compiled_again(copied):
    step = STEP.format(network='biped')
    known = kernels_after(copied, step)
    assert kernels_after(copied, step) == known
    for source in ('dynamics/integration/kernel_source.py', 'dynamics/integration/c/lanes.c'):
        changed = copied / 'cpg_ros' / source
        changed.write_text(changed.read_text() + '\n')
        before, known = known, kernels_after(copied, step)
        assert known > before, source


OWN = """
import numpy as np
from cpg_ros.dynamics.integration.simulate import simulate
import one
from own import TwoLegs
run = simulate(TwoLegs(1.0, 2.0, 0.1), 2 * [np.array([1.0, 0.5, 0.0, 0.0])], 0.01)
state, slope = run.x[1, -1], run.slopes[1, -1]
# Of x of the first leg, whose square rate is 1 - x^2 - y^2.
x, y = state[0], state[2]
print(np.round((slope[0] + 2.0 * y - 0.1 * state[1]) / x / (1.0 - x ** 2 - y ** 2), 9))
"""


@pytest.mark.deep
def test_an_edited_network_of_ones_own_is_compiled_again_and_nothing_else(tmp_path):
    (tmp_path / 'one.py').write_text(ONE)
    own, given = tmp_path / 'own.py', environment(NUMBA_CACHE_DIR=str(tmp_path / 'cache'),
                                                  PYTHONPATH=str(tmp_path))
    text = (Path(__file__).parents[2] / 'networks' / 'test_own_network.py').read_text()
    found, growth = [], []
    for factor in ('', '', '1.5 * '):
        own.write_text(text.replace('return rest * x', f'return {factor}rest * x'))
        run = subprocess.run([sys.executable, '-c', OWN], env=given, check=True,
                             stdout=subprocess.PIPE, text=True)
        found.append(float(run.stdout))
        growth.append({*tmp_path.rglob('*.nbc'), *tmp_path.rglob('*.so')} - set().union(*growth))
    assert found == [1.0, 1.0, 1.5]
    _, again, edited = growth
    assert not again
    assert {kernel.parent.name.partition('_')[0] for kernel in edited} == {'two'}


def test_what_compiled_code_takes_from_other_files_is_watched():
    # numba puts numbers and functions of other modules into machine code when it compiles.
    package = Path(cpg_ros.__file__).parent
    watched = {'cpg_ros.networks', 'cpg_ros.dynamics', 'cpg_ros.motion', 'cpg_ros.feedback'}
    seen = set()
    for file in package.rglob('*.py'):
        tree = ast.parse(file.read_text())
        imported = {alias.asname or alias.name: node.module for node in ast.walk(tree)
                    if isinstance(node, ast.ImportFrom) and node.module for alias in node.names}
        for function in ast.walk(tree):
            if isinstance(function, ast.FunctionDef) and {'jit', 'jit_entry'} & {
                    ast.unparse(decorator) for decorator in function.decorator_list}:
                used = {node.id for node in ast.walk(function) if isinstance(node, ast.Name)}
                seen |= {imported[name] for name in used & set(imported)
                         if imported[name].startswith('cpg_ros.')}
    assert 'cpg_ros.feedback.kinematics' in seen
    assert {'.'.join(module.split('.')[:2]) for module in seen} <= watched


def test_unused_folders_of_the_cache_are_removed_and_no_others(tmp_path):
    cache, given = tmp_path / 'cpg_ros', environment(NUMBA_CACHE_DIR=str(tmp_path))
    old = [cache / f'package-{number:014x}' for number in range(MAX_FOLDERS + 5)]
    for age, folder in enumerate(old):
        folder.mkdir(parents=True)
        lock = folder / 'in_use'
        lock.touch()
        os.utime(lock, (1e9 - age, 1e9 - age))
    other = cache / 'notes'
    other.mkdir()
    with (old[-1] / 'in_use').open() as running:
        fcntl.flock(running, fcntl.LOCK_SH)
        (tmp_path / 'one.py').write_text(ONE)
        subprocess.run([sys.executable, tmp_path / 'one.py'], env=given, check=True)
        left = {folder for folder in cache.iterdir() if folder.name.startswith('package-')}
    # The new one, those last used, and the oldest, which is in use.
    assert set(old) & left == {*old[:MAX_FOLDERS - 1], old[-1]} and len(left) == MAX_FOLDERS + 1
    assert other.exists()


RUN = """
import sys, tempfile
if {nowhere}:
    tempfile.tempdir = '/dev/null'
import cpg_ros
assert cpg_ros.__file__.startswith(sys.argv[1])
import one
"""


@pytest.mark.parametrize('nowhere', [False, True], ids=['temporary', 'nowhere'])
def test_it_starts_where_neither_the_package_nor_the_home_can_be_written(tmp_path, nowhere):
    package, scratch = tmp_path / 'read_only', tmp_path / 'scratch'
    scratch.mkdir()
    shutil.copytree(Path(cpg_ros.__file__).parent, package / 'cpg_ros',
                    ignore=shutil.ignore_patterns('__pycache__'))
    shutil.copytree(resource_folder('config'), package / 'config')
    for room in [folder for folder in package.rglob('*') if folder.is_dir()]:
        # Whoever runs this, root too, can make no folder where a file is.
        (room / '__pycache__').touch()
    (package / 'one.py').write_text(ONE)
    given = environment('NUMBA_CACHE_DIR', 'XDG_CACHE_HOME', HOME='/dev/null', TMPDIR=str(scratch),
                        PYTHONPATH=str(package))
    seen = []
    for _ in range(1 if nowhere else 2):
        run = subprocess.run([sys.executable, '-c', RUN.format(nowhere=nowhere), str(package)],
                             env=given, cwd=package, capture_output=True, text=True)
        assert run.returncode == 0, run.stderr
        seen.append(sorted(scratch.rglob('*.nbc')))
        (line,) = run.stderr.splitlines()
        assert line.startswith(f'compiled code cannot be kept in {package}/cpg_ros/')
        assert line.endswith('nor in a temporary folder: it is compiled at every start' if nowhere
                             else f': kept in {scratch / f"cpg_ros-{os.getuid()}"}')
    assert bool(seen[0]) is not nowhere
    assert seen[0] == seen[-1], 'the cache was not used'


GENERATED = """
from cpg_ros.networks.equations import load
print('loaded', load('some', 'kernel', lambda: 'value = 1').value)
"""
#: Somebody other than the user; only root can give files away.
NOBODY = 65534
as_root = pytest.mark.skipif(os.getuid() != 0, reason='only root can give files away')


def opened(mode):
    """Return what lets others write into a file or folder."""
    return lambda path: path.chmod(mode)


def given_away(path):
    """Give a file or folder to somebody else."""
    os.chown(path, NOBODY, NOBODY)


@pytest.mark.parametrize('which', ['kernel', 'folder', 'place', 'parent'])
@pytest.mark.parametrize('change', [opened(0o777), pytest.param(given_away, marks=as_root)],
                         ids=['writable', 'owner'])
def test_code_that_others_may_have_written_is_not_executed(tmp_path, which, change):
    parent = tmp_path / 'parent'
    given = environment(NUMBA_CACHE_DIR=str(parent / 'cache'))

    def run():
        return subprocess.run([sys.executable, '-c', GENERATED], env=given, text=True,
                              capture_output=True, check=True)

    assert (run().stdout, run().stderr) == ('loaded 1\n', '')
    (kernel,) = parent.glob('cache/cpg_ros/some-*/kernel.py')
    kernel.write_text('value = 2\n')
    assert run().stdout == 'loaded 2\n', 'the cache is not used'
    path = {'kernel': kernel, 'folder': kernel.parent, 'place': kernel.parents[1],
            'parent': parent}[which]
    if which == 'kernel':
        kernel.parent.chmod(0o755)
    change(path)
    found = run()
    assert found.stdout == 'loaded 1\n'
    (line,) = found.stderr.splitlines()
    assert line.startswith(f'compiled code is not loaded: {path} ')


def test_a_cache_below_a_sticky_folder_is_used(tmp_path):
    place = tmp_path / 'shared'
    place.mkdir()
    place.chmod(0o1777)
    given = environment(NUMBA_CACHE_DIR=str(place / 'cache'))
    for _ in range(2):
        ended = subprocess.run([sys.executable, '-c', GENERATED], env=given, text=True,
                               capture_output=True, check=True)
        assert (ended.stdout, ended.stderr) == ('loaded 1\n', '')
    assert list(place.glob('cache/cpg_ros/some-*/kernel.py'))


LIMIT = """
import resource
resource.setrlimit(resource.RLIMIT_FSIZE, ({room}, {room}))
"""
#: Size, in bytes, within which some files of what is compiled have room.
SOME = 3000


def test_a_full_disk_under_the_cache_is_one_line(tmp_path):
    # A file of ours that may have no byte more ends a write as a full disk does: with an OSError.
    (tmp_path / 'one.py').write_text(ONE)

    def run(place, room):
        return subprocess.run(
            [sys.executable, '-c', LIMIT.format(room=room) + 'import one'], text=True,
            capture_output=True, cwd=tmp_path, env=environment(NUMBA_CACHE_DIR=str(place)))

    for room in (0, SOME):
        place = tmp_path / str(room)
        ended = run(place, room)
        assert ended.returncode == 0, ended.stderr
        (line,) = ended.stderr.splitlines()
        assert line.startswith(f'compiled code cannot be kept in {place}/cpg_ros: File too large')
        assert not list(place.rglob('*.tmp.*')) and not list(place.rglob('*.part'))
    # Once there is room, what was cut off is not taken for code.
    ended = run(place, 10**9)
    assert ended.returncode == 0 and not ended.stderr and list(place.rglob('*.nbc'))


DISK = """
mount -t tmpfs -o size=16k tmpfs {place} && cat /dev/zero > {place}/fill 2> {other}
exec {generator} --ros-args -p gait:=walk
"""


@pytest.mark.deep
def test_a_node_walks_with_a_full_disk_under_the_cache(tmp_path, monkeypatch):
    # It compiles, which takes minutes beside other tests.
    monkeypatch.setattr('graph.PATIENCE', 300.0)
    place, other = tmp_path / 'place', tmp_path / 'other'
    place.mkdir()
    if subprocess.run(['unshare', '-m', 'mount', '-t', 'tmpfs', 'tmpfs', str(place)]).returncode:
        pytest.skip('no file system can be mounted here')
    script = tmp_path / 'full.sh'
    script.write_text('#!/bin/sh\nexec unshare -m sh -c "' + DISK.format(
        place=place, other=other, generator=EXECUTABLE) + '"\n')
    script.chmod(0o755)
    node = Process('-p', 'x:=0', executable=script, environment={'NUMBA_CACHE_DIR': str(place)})
    try:
        node.wait_for('publishing')
        assert 'No space left on device' in other.read_text()
        (line,) = [line for line in node.lines if 'cannot be kept' in line]
        assert line.startswith(f'compiled code cannot be kept in {place}/cpg_ros: '
                               'No space left on device')
        node.signal(signal.SIGINT)
        assert node.wait() == 0 and 'Traceback' not in node.log
    finally:
        node.end()
