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

import ast
from graphlib import TopologicalSorter
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


def test_no_files_import_one_another_in_a_circle():
    # Those within functions, and those that only types are taken from, too.
    files = {'.'.join(file.relative_to(ROOT).with_suffix('').parts).removesuffix('.__init__'): file
             for file in (ROOT / 'cpg_ros').rglob('*.py') if '__pycache__' not in file.parts}
    graph = {}
    for name, file in files.items():
        known = [node for node in ast.walk(ast.parse(file.read_text()))
                 if isinstance(node, ast.ImportFrom) and node.module]
        graph[name] = {found for node in known for alias in node.names
                       for found in (f'{node.module}.{alias.name}', node.module)
                       if found in files} - {name}
    # Subpackages list their files; what is looked for is circles of these.
    packages = {name for name, file in files.items() if file.name == '__init__.py'}
    TopologicalSorter({name: found - packages for name, found in graph.items()}).prepare()
