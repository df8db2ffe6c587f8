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
import subprocess
import sys

ROOT = Path(__file__).resolve().parents[2]
sys.path.append(str(ROOT / 'test' / 'mutants'))

from run import APPLY, mutants  # noqa: E402

MUTANTS = mutants()


def test_each_applies():
    broken = [one.name for one in MUTANTS if subprocess.run(
        [*APPLY, '--check', one.path], cwd=ROOT, capture_output=True).returncode]
    assert not broken


def test_each_says_what_is_wrong_and_which_tests_notice():
    assert len(MUTANTS) >= 60
    for one in MUTANTS:
        assert one.fault.endswith('.') and one.files and one.tests, one.name
        for test in one.tests:
            file, _, name = test.partition('::')
            assert (ROOT / file).is_file(), (one.name, test)
            assert re.search(rf'^def {name or "test_"}', (ROOT / file).read_text(),
                             re.MULTILINE), (one.name, test)
