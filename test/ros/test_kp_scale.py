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

"""The factor of the servos' gain, from a generator that may end or send nonsense."""

import math

from cpg_ros.ros import command_topics
from cpg_ros.ros.command_topics import KpScaleSubscription, MAX_KP_SCALE, SCALE_TIMEOUT
import pytest
from std_msgs.msg import Float64


class Wire:
    """A topic whose messages are put there by the test."""

    def __init__(self, *_) -> None:
        self.message = None

    def newest(self):
        message, self.message = self.message, None
        return message


@pytest.fixture
def received(monkeypatch):
    """Return a function that takes a time, s, and what arrives then, and returns the factor."""
    monkeypatch.setattr(command_topics, 'PolledSubscription', Wire)
    subscription = KpScaleSubscription(None)

    def at(now, scale=None):
        if scale is not None:
            subscription._subscription.message = Float64(data=scale)
        return subscription.receive(now)

    return at


def test_servos_are_as_stiff_as_the_newest_message_says(received):
    assert received(1.0) == 1.0
    assert received(1.1, 2.0) == 2.0
    assert received(1.1 + 0.9 * SCALE_TIMEOUT) == 2.0
    assert received(1.2, 1.0) == 1.0


def test_they_do_not_stay_stiff_when_the_generator_is_gone(received):
    assert received(1.0, 2.0) == 2.0
    assert received(1.0 + 1.1 * SCALE_TIMEOUT) == 1.0
    # Nor where time jumps back.
    assert received(2.0, 2.0) == 2.0
    assert received(1.0) == 1.0


@pytest.mark.parametrize('scale', [0.5, -2.0, 1.1 * MAX_KP_SCALE, math.nan, math.inf])
def test_a_factor_out_of_range_counts_as_1(received, scale):
    received(1.0, 2.0)
    assert received(1.01, scale) == 1.0
