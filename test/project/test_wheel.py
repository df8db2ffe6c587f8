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

"""The wheel: what pip installs from it works without this tree, and without colcon."""

import os
from pathlib import Path
import site
import subprocess
import sys
import venv

from cpg_ros.ros.cli.executables import EXECUTABLES
import pytest

ROOT = Path(__file__).parents[2]


def run(*words, **options):
    """Run a command with nothing of this tree in its environment; return what it prints."""
    bare = {name: value for name, value in os.environ.items()
            if name not in ('PYTHONPATH', 'AMENT_PREFIX_PATH')}
    done = subprocess.run(words, capture_output=True, text=True, env=bare, **options)
    assert done.returncode == 0, done.stderr
    return done.stdout


@pytest.fixture(scope='module')
def installed(tmp_path_factory):
    """Return the folder of the commands of an environment that has the wheel, and libraries."""
    folder = tmp_path_factory.mktemp('wheel')
    source = folder / 'source'
    run('git', 'clone', '--quiet', str(ROOT), str(source))
    run(sys.executable, '-m', 'pip', 'wheel', '--quiet', '--no-deps', '--no-build-isolation',
        '--wheel-dir', str(folder), str(source))
    venv.create(folder / 'environment', symlinks=True)
    own, = (folder / 'environment' / 'lib').glob('python3*/site-packages')
    # The libraries are those that the tests run with, without their build of the package.
    (own / 'libraries.pth').write_text('\n'.join(site.getsitepackages()))
    wheel, = folder.glob('cpg_ros-*.whl')
    run(sys.executable, '-m', 'pip', '--python', str(folder / 'environment/bin/python'),
        'install', '--quiet', '--no-deps', '--no-index', str(wheel))
    return folder / 'environment' / 'bin'


def test_its_commands_begin_with_cpg(installed):
    assert {path.name for path in installed.glob('cpg*')} == {
        'cpg', *(f'cpg-{name.replace("_", "-")}' for name in EXECUTABLES if name != 'cpg')}
    assert not set(EXECUTABLES) - {'cpg'} & {path.name for path in installed.iterdir()}


def test_its_commands_find_what_it_brings(installed, tmp_path):
    python = installed / 'python'
    load = "from cpg_ros.motion.robot_file import load_robot; print(load_robot('goat').name)"
    assert run(python, '-c', load, cwd=tmp_path) == 'goat\n'
    assert 'generator' in run(installed / 'cpg', '--help', cwd=tmp_path)
    package, = installed.parent.glob('lib/python3*/site-packages/cpg_ros')
    assert (package / 'dynamics/integration/c/cpg.h').exists()
    assert {'index.html', 'three.LICENSE', 'uplot.LICENSE'} <= {
        path.name for path in (package / 'ros/panel/page').iterdir()}
