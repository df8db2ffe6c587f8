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

"""When the watchdog damps a robot whose bridge is silent; 500 ticks a second."""

from cpg_ros.safety.tick_monitor import TickMonitor
import numpy as np
import pytest

TICK = TickMonitor.tick(np.full(12, 3.0))


@pytest.fixture
def monitor():
    monitor = TickMonitor(0.002)
    assert monitor.timeout(0.0) is None and not monitor.due(0.0)
    monitor.receive(TICK, 1.0)
    return monitor


def test_damping_is_due_after_two_and_a_half_periods_without_a_tick(monitor):
    assert monitor.timeout(1.0) == pytest.approx(0.005)
    assert not monitor.due(1.0049)
    assert monitor.due(1.0051) and (monitor.kd == 3.0).all() and monitor.kd.size == 12


def test_then_it_is_due_every_period_until_ticks_are_back(monitor):
    assert monitor.due(1.0051) and not monitor.due(1.0070) and monitor.due(1.0072)
    assert monitor.alarms == 1
    monitor.receive(TICK, 1.008)
    assert not monitor.due(1.0129)
    assert monitor.due(1.0131) and monitor.alarms == 2


def test_only_ticks_are_signs_of_life(monitor):
    monitor.receive(TickMonitor.HELLO, 1.004)
    assert monitor.due(1.0051) and not monitor.ended
    monitor.receive(TickMonitor.END, 1.006)
    assert monitor.ended
