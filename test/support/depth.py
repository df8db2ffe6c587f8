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

"""What runs before a commit, and what in depth only: examples of a property, cases of a test."""

from hypothesis import settings
import pytest

#: Profiles of Hypothesis, which conftest.py registers, and the share of its examples in percent.
PROFILES = {'quick': 25, 'deep': 100}
#: Fewest examples of a property that is tried on more than these.
FEWEST = 6


def register() -> None:
    """Register the profiles and choose the quick one; --hypothesis-profile chooses another.

    Draws are the same in every run, and no example is kept from one run for the next.
    """
    for name, percent in PROFILES.items():
        settings.register_profile(name, max_examples=percent, derandomize=True, deadline=None,
                                  database=None)
    settings.load_profile('quick')


def examples(most: int, **options) -> settings:
    """Return settings with that many examples in depth, and the profile's share of them else."""
    fraction = round(most * settings.default.max_examples / 100)
    return settings(max_examples=max(fraction, min(FEWEST, most)), **options)


def spread(cases, every: int = 3):
    """Return cases for parametrize: the first and every third, or so; in depth, all of them."""
    return [case if place % every == 0 else in_depth(case)[0]
            for place, case in enumerate(cases)]


def in_full() -> bool:
    """Return whether tests run in depth, for one that goes through a part of its cases else."""
    return settings.default.max_examples == PROFILES['deep']


def in_depth(*cases):
    """Return cases for parametrize that run in make test-deep only; a tuple has several values."""
    return [pytest.param(*(case if isinstance(case, tuple) else (case,)), marks=pytest.mark.deep)
            for case in cases]
