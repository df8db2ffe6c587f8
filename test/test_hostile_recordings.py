"""Hostile recordings through the reader and the recogniser: no traceback, nothing wrong unsaid."""

import sys
from pathlib import Path

import pytest

sys.path.append(str(Path(__file__).resolve().parent.parent / 'benchmarks'))

from bench_recordings import outcome
from hostile_recordings import WAYS


@pytest.mark.parametrize('number', range(len(WAYS)), ids=[way.replace(' ', '_') for way in WAYS])
def test_right_or_said(tmp_path, number):
    kind, _, said = outcome(number, tmp_path)
    assert kind in ('right', 'warned', 'refused'), said
    # What is not spoiled much is found all the same.
    if list(WAYS)[number] in ('as it is', 'decimal commas', 'limp', 'half of the rows',
                              'wild values', 'a stamp far off'):
        assert kind == 'right', said
