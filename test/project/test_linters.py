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

import os
from pathlib import Path
import re
import subprocess
import sys

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


def test_benchmarks_call_the_package_as_it_is(tmp_path):
    """They run for minutes each: mypy finds the names and arguments that are no longer there."""
    pytest.importorskip('mypy', reason='mypy is not installed')
    folder = ROOT / 'benchmarks'
    ran = subprocess.run(
        [sys.executable, '-m', 'mypy', '--config-file', os.devnull, '--cache-dir', tmp_path,
         '--ignore-missing-imports', '--check-untyped-defs', '--explicit-package-bases',
         *folder.glob('*.py'), *(folder / 'leaderboard').glob('*.py')], text=True,
        capture_output=True, cwd=folder, env=dict(os.environ, MYPYPATH=':'.join(
            str(ROOT / name) for name in ('', 'benchmarks/leaderboard', 'test/support'))))
    assert re.search(r'checked \d\d+ source files', ran.stdout), ran.stdout + ran.stderr
    lines = [line for line in ran.stdout.splitlines() if line.startswith(('bench_', 'leaderboard'))
             and re.search(r'\[(call-arg|name-defined)\]|Module .* has no attribute', line)]
    assert lines == []
