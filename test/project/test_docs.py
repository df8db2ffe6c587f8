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

"""What the documentation names is there: cited sections, links, files, modules; its code runs."""

import importlib
from pathlib import Path
import pkgutil
import re

import pytest

ROOT = Path(__file__).parents[2]
PAGES = [*sorted(ROOT.glob('*.md')), *sorted(
    path for path in (ROOT / 'docs').rglob('*.md') if path.parent.name != 'generated')]
SOURCES = [path for folder in ('cpg_ros', 'test', 'benchmarks')
           for path in sorted((ROOT / folder).rglob('*.py')) if path != Path(__file__)]
CITATION = re.compile(r'docs/(\w+\.md), section (.{60})')


def headings(page):
    return re.findall(r'^##+ (.+)$', page.read_text(), re.MULTILINE)


def anchors(page):
    """As GitHub makes them."""
    return {re.sub(r'[^\w -]', '', heading.lower()).replace(' ', '-')
            for heading in headings(page)}


def test_sections_that_code_cites():
    cited = [(path.name, *found) for path in SOURCES for found in CITATION.findall(
        re.sub(r'\s+(#:? )?\s*', ' ', path.read_text()))]
    assert len(cited) > 10
    assert not [one for one in cited
                if not one[2].startswith(tuple(headings(ROOT / 'docs' / one[1])))]


@pytest.mark.parametrize('page', PAGES, ids=lambda page: str(page.relative_to(ROOT)))
def test_what_a_page_names(page):
    text = page.read_text()
    for link, anchor in re.findall(r'\]\((?!https?:)([^)#]*)#?([^)]*)\)', text):
        there = (page.parent / link) if link else page
        assert there.exists(), link
        assert not anchor or anchor in anchors(there), f'{link}#{anchor}'
    for name in re.findall(r'`((?:test|bench)_\w+\.py)`', text):
        assert any(path.name == name for path in SOURCES), name
    rooms = '|'.join(path.name for path in (ROOT / 'cpg_ros').iterdir() if path.is_dir())
    for name in re.findall(rf'`(?:cpg_ros/)?((?:{rooms})/[\w/]+\.py)`', text):
        assert (ROOT / 'cpg_ros' / name).exists(), name
    for name in re.findall(r'\bcpg_ros(?:\.[a-z_]\w*){2,}', text):
        pkgutil.resolve_name(name)


def test_the_example_of_the_readme_runs():
    (example,) = re.findall(r'```python\n(.*?)```', (ROOT / 'README.md').read_text(), re.DOTALL)
    exec(example, {})


def test_the_readme_is_short():
    assert len((ROOT / 'README.md').read_text().splitlines()) <= 120


def test_the_reference_has_the_keys_of_robot_files(monkeypatch):
    monkeypatch.syspath_prepend(ROOT / 'docs' / 'extensions')
    (block,) = re.findall(r'```{robotfile} keys\n(.*?)```',
                          (ROOT / 'docs/reference/robot_file.md').read_text(), re.DOTALL)
    described = [line.split(': ')[0] for line in block.splitlines() if line]
    assert sorted(described) == sorted(importlib.import_module('robot_keys').asked_for())


@pytest.mark.parametrize(('file', 'pattern'), [
    ('setup.py', r"version='([\d.]+)'"), ('package.xml', r'<version>([\d.]+)<'),
    ('CITATION.cff', r'\nversion: ([\d.]+)\n')])
def test_the_version_is_the_same_everywhere(file, pattern):
    found = re.findall(pattern, (ROOT / file).read_text())
    assert found == [importlib.import_module('cpg_ros').__version__]
