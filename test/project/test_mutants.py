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

"""Mutants (see CONTRIBUTING.md): that each of them still applies, and names tests that exist."""

from pathlib import Path
import re
import sys

import pytest

ROOT = Path(__file__).resolve().parents[2]
sys.path.append(str(ROOT / 'test' / 'mutants'))

from run import mutants, mutated  # noqa: E402

MUTANTS = mutants()


def test_each_applies():
    for mutant in MUTANTS:
        changed = mutated(mutant.path)
        assert set(changed) == set(mutant.files), mutant.name
        for file, text in changed.items():
            assert text != (ROOT / file).read_text(), mutant.name
            if file.endswith('.py'):
                compile(text, file, 'exec')


def test_lines_are_found_by_their_text(tmp_path):
    (tmp_path / 'one.patch').write_text(
        'A fault.\n\nCaught by: test\n\n--- a/some.py\n+++ b/some.py\n@@ -1,3 +1,3 @@\n'
        ' before = 1\n-value = 2\n+value = 3\n after = 4\n')
    (tmp_path / 'some.py').write_text('more = 0\nrenamed = 1\nvalue = 2\nafter = 5\n')
    assert mutated(tmp_path / 'one.patch', tmp_path) == {
        'some.py': 'more = 0\nrenamed = 1\nvalue = 3\nafter = 5\n'}
    (tmp_path / 'some.py').write_text('value = 2\nother = 1\nvalue = 2\n')
    with pytest.raises(ValueError, match=r'one.patch: 2 places in some.py'):
        mutated(tmp_path / 'one.patch', tmp_path)


def test_each_says_what_is_wrong_and_which_tests_notice():
    assert len(MUTANTS) >= 60
    for one in MUTANTS:
        assert one.fault.endswith('.') and one.files and one.tests, one.name
        for test in one.tests:
            file, _, name = test.partition('::')
            assert (ROOT / file).is_file(), (one.name, test)
            assert re.search(rf'^def {name or "test_"}', (ROOT / file).read_text(),
                             re.MULTILINE), (one.name, test)
