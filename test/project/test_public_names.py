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

"""What `import cpg_ros` gives."""

import importlib
from pathlib import Path
import subprocess
import sys

import cpg_ros
import pytest

PACKAGE = Path(cpg_ros.__file__).parent
ROOMS = sorted(file.parent for file in PACKAGE.glob('*/**/__init__.py'))


def test_the_import_loads_nothing_and_sets_the_threads_of_blas_before_numpy():
    script = """
import os, sys
os.environ.pop('OPENBLAS_NUM_THREADS', None)
import cpg_ros
assert 'solve_orbit' in dir(cpg_ros)
assert 'numpy' not in sys.modules and 'yaml' not in sys.modules
assert os.environ['OPENBLAS_NUM_THREADS'] == '1'
preset = cpg_ros.PRESETS['delayed']['trot']
print(cpg_ros.solve_orbit(preset.network, 'trot').period)
"""
    found = subprocess.run([sys.executable, '-P', '-c', script], capture_output=True, text=True,
                           check=True)
    # The trot of Liu & Zhang's example 1, at tau 0.4.
    assert float(found.stdout) == pytest.approx(1.27827056, abs=1e-8)


@pytest.mark.parametrize('name', cpg_ros.__all__)
def test_every_name_is_there(name):
    assert name in dir(cpg_ros)
    known = getattr(cpg_ros, name)
    assert getattr(known, '__name__', name) == name
    assert getattr(cpg_ros, name) is known


def test_another_name_is_not():
    with pytest.raises(AttributeError, match="module 'cpg_ros' has no attribute 'gait'"):
        _ = cpg_ros.gait
    with pytest.raises(ImportError):
        from cpg_ros import gait  # noqa: F401


@pytest.mark.parametrize('room', ROOMS, ids=lambda room: room.name)
def test_every_room_lists_its_modules(room):
    name = '.'.join(room.relative_to(PACKAGE).parts)
    listed = importlib.import_module(f'cpg_ros.{name}').__all__
    folders = [one.parent for one in room.glob('*/__init__.py')]
    assert listed == sorted(file.stem for file in (*room.glob('*.py'), *folders)
                            if file.stem != '__init__')


def test_the_package_says_that_it_is_typed():
    assert (Path(cpg_ros.__file__).parent / 'py.typed').is_file()
