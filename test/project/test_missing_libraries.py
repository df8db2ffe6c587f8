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

"""What happens where a library is not installed: one line, or nothing at all."""

from pathlib import Path
import subprocess
import sys

from bags import walk, write_bag
import numpy as np
import pytest

SUPPORT = Path(__file__).parents[1] / 'support'


def run(missing, text):
    script = f'import sys; sys.modules[{missing!r}] = None; {text}'
    return subprocess.run([sys.executable, '-P', '-c', script], capture_output=True, text=True,
                          check=False)


@pytest.mark.parametrize(('missing', 'module'), [
    ('rosbags', 'cpg_ros.fitting.inversion.inversion'),
    ('websockets', 'cpg_ros.ros.panel.panel_node')])
def test_one_line_says_how_to_get_it(missing, module):
    found = run(missing, f'import {module}')
    assert found.returncode == 1 and not found.stdout
    (line,) = found.stderr.splitlines()
    assert f'needs {missing}' in line and f'pip install {missing}' in line


@pytest.mark.parametrize(('missing', 'executable'), [
    ('numba', 'robot_sim'), ('numba', 'tune'), ('rosbags', 'inversion')])
def test_an_executable_without_a_library_ends_in_one_line_with_its_name(missing, executable):
    found = run(missing, f"""
from cpg_ros.ros.cli.executables import start
sys.exit(start({executable!r}))""")
    assert found.returncode == 2 and not found.stdout
    (line,) = found.stderr.splitlines()
    assert line.startswith(f'{executable}: cpg_ros needs {missing}')


@pytest.mark.parametrize(('missing', 'module'), [
    ('numba', 'cpg_ros'), ('numba', 'cpg_ros.ros.generator'),
    ('numba', 'cpg_ros.analysis.analyze'), ('numba', 'cpg_ros.ros.cli.inversion'),
    ('rosbags', 'cpg_ros.ros.generator'), ('matplotlib', 'cpg_ros.ros.generator'),
    ('mujoco', 'cpg_ros.ros.generator'), ('pymoo', 'cpg_ros.ros.generator')])
def test_what_does_without_it(missing, module):
    found = run(missing, f'import {module}')
    assert found.returncode == 0, found.stderr


def test_other_errors_are_shown_as_ever():
    found = run('rosbags', """
try:
    import cpg_ros.fitting.inversion.inversion
except ImportError:
    1 / 0""")
    assert found.returncode == 1 and 'ZeroDivisionError' in found.stderr
    assert len(found.stderr.splitlines()) > 1


@pytest.mark.parametrize('compression', ['none', 'message'])
def test_bags_are_read_by_ros_where_rosbags_is_missing(compression, tmp_path):
    messages, angles = walk(60)
    bag = write_bag(tmp_path / 'bag', messages, compression=compression)
    found = run('nothing', f"""
sys.path.insert(0, {str(SUPPORT)!r})
import rosbag2_stand_in
from cpg_ros.fitting.recordings.bag_reader import read_bag
print(*read_bag({str(bag)!r}, progress=False).positions.ravel().tolist())""")
    assert found.returncode == 0, found.stderr
    assert np.array_equal(np.array(found.stdout.split(), float).reshape(angles.shape), angles)


def test_a_bag_that_ros_cannot_read_is_one_line(tmp_path):
    (tmp_path / 'bag').mkdir()
    (tmp_path / 'bag' / 'metadata.yaml').write_text('nothing: here\n')
    found = run('nothing', f"""
sys.path.insert(0, {str(SUPPORT)!r})
import rosbag2_stand_in
from cpg_ros.fitting.inversion.inversion import main
sys.exit(main(['--bag', {str(tmp_path / 'bag')!r}]))""")
    (line,) = found.stderr.splitlines()
    assert found.returncode and str(tmp_path / 'bag') in line
