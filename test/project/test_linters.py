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

"""The linters of ROS 2, where they are installed, and what they ask for that ruff does not."""

from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
LINTERS = {'ament_copyright': [], 'ament_flake8': [],
           # Sections are written as Google's; magic methods and tests have no docstrings.
           'ament_pep257': ['--convention', 'google', '--add-ignore',
                            *(f'D10{number}' for number in range(8)), '--']}
FOLDERS = ('cpg_ros', 'test', 'launch', 'benchmarks', 'docs', 'resource')


@pytest.mark.parametrize('linter', LINTERS)
def test_ros_finds_nothing(linter):
    main = pytest.importorskip(f'{linter}.main', reason=f'{linter} is not installed').main
    places = [str(ROOT / name) for name in (*FOLDERS, 'setup.py')]
    assert main(LINTERS[linter] + places) == 0


def test_every_source_file_begins_with_copyright_and_licence():
    head = Path(__file__).read_text().split('"""')[0]
    assert 'Apache License, Version 2.0' in head
    files = [file for name in FOLDERS for file in (ROOT / name).rglob('*.py')
             if not {'_build', '__pycache__'} & set(file.parts)]
    assert len(files) > 300
    lacking = [str(file.relative_to(ROOT)) for file in files
               if file.read_text() and not file.read_text().removeprefix(
                   '#!/usr/bin/env python3\n').startswith(head)]
    assert not lacking
