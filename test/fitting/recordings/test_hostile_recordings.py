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

"""Hostile recordings through the reader and the recogniser: no traceback, nothing wrong unsaid."""

from pathlib import Path
import sys

import pytest

sys.path.append(str(Path(__file__).resolve().parents[3] / 'benchmarks'))

from bench_recordings import outcome  # noqa: E402, I100
from hostile_recordings import WAYS  # noqa: E402


@pytest.mark.parametrize('number', range(len(WAYS)), ids=[way.replace(' ', '_') for way in WAYS])
def test_right_or_said(tmp_path, number):
    kind, _, said = outcome(number, tmp_path)
    assert kind in ('right', 'warned', 'refused'), said
    # What is not spoiled much is found all the same.
    if list(WAYS)[number] in ('as it is', 'decimal commas', 'limp', 'half of the rows',
                              'wild values', 'a stamp far off'):
        assert kind == 'right', said
