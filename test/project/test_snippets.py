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

"""The Python and console blocks of README, tutorials and how-to guides run, page by page."""

import ast
import os
import re
import subprocess
import sys

from graph import EXECUTABLE, free_domain
import pytest
from snippets import blocks, MARK, PAGES, ROOT

RUN = [page if page == 'README.md' else pytest.param(page, marks=pytest.mark.docs)
       for page in PAGES
       if any(block.language in ('python', 'console') for block in blocks(page))]


def script(page):
    """Return what does all of a page's blocks in order, and ends at the first that fails."""
    lines = ['set -m', "trap 'kill $(jobs -p) 2> /dev/null' EXIT"]
    for block in blocks(page):
        if block.file:
            lines.append(f"cat > {block.file} <<'END_OF_FILE'\n{block.text}END_OF_FILE")
        elif block.language == 'python':
            lines.append(f"'{sys.executable}' - <<'END_OF_FILE' || exit 9\n{block.text}"
                         'END_OF_FILE')
        elif block.language == 'console':
            lines += [command(line) for line in block.commands]
    return '\n'.join(lines)


def command(line):
    """Return a line of a console that must succeed; or fail, if it says that it is refused."""
    line, _, remark = line.partition('   # ')
    if line.startswith('kill '):
        return f'{line}; wait %1 || {{ echo "{line}: $?" >&2; exit 9; }}'
    if line.endswith('&'):
        return line
    sign = '&&' if remark.startswith('refused') else '||'
    return f'{line} {sign} {{ echo "failed: {line}" >&2; exit 9; }}'


@pytest.mark.parametrize('page', RUN)
def test_the_blocks_of_a_page_run(page, tmp_path):
    variables = dict(os.environ, ROS_DOMAIN_ID=str(free_domain()),
                     PATH=f'{EXECUTABLE.parent}{os.pathsep}{os.environ["PATH"]}')
    found = subprocess.run(['bash', '-c', script(page)], cwd=tmp_path, env=variables, text=True,
                           capture_output=True, timeout=300, check=False)
    assert found.returncode == 0, found.stdout + found.stderr


def test_every_console_line_is_a_command():
    for page in PAGES:
        for block in blocks(page):
            if block.language == 'console':
                assert all(line.startswith('$ ') for line in block.text.splitlines()), page


@pytest.mark.parametrize('page', PAGES)
def test_blocks_that_need_ros_say_so_and_name_what_is_there(page):
    for block in blocks(page):
        if block.language in ('shell', 'bash', 'sh'):
            assert block.text.startswith(MARK + '\n'), block.text
    text = (ROOT / page).read_text()
    points = set(re.findall(r"'(\w+) = cpg_ros\.", (ROOT / 'setup.py').read_text()))
    assert set(re.findall(r'ros2 run cpg_ros (\w+)', text)) <= points
    for launch, words in re.findall(r'ros2 launch cpg_ros (\w+\.launch\.py)([^`\n]*)', text):
        source = (ROOT / 'launch' / launch).read_text()
        if 'GENERATOR' in source:
            source += (ROOT / 'cpg_ros' / 'ros' / 'launch_arguments.py').read_text()
        known = {node.value for node in ast.walk(ast.parse(source))
                 if isinstance(node, ast.Constant)}
        assert set(re.findall(r'([\w.]+):=', words)) <= known, launch
