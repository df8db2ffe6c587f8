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

"""When the watchdog damps a robot whose bridge is silent; 500 ticks a second, 20 ms."""

import logging
import os
from types import SimpleNamespace

from cpg_ros.ros.bridges.unitree.messages import LowCmd, MODELS
from cpg_ros.ros.bridges.watchdog import watch
from cpg_ros.ros.bridges.watchdog_link import address, listening, TickMonitor, unconnected
import numpy as np
import pytest
from stand_in import HG_COMMAND, MACHINE

TICK = TickMonitor.tick(np.full(12, 3.0))


@pytest.fixture
def monitor():
    monitor = TickMonitor(0.002, 0.02)
    assert monitor.timeout(0.0) is None and not monitor.due(0.0)
    monitor.receive(TICK, 1.0)
    return monitor


def test_damping_is_due_after_the_timeout_without_a_tick(monitor):
    assert monitor.timeout(1.0) == pytest.approx(0.02)
    assert not monitor.due(1.0199)
    assert monitor.due(1.0201) and (monitor.kd == 3.0).all() and monitor.kd.size == 12


def test_a_process_may_bring_a_timeout_which_is_two_and_a_half_periods_at_least(monitor):
    monitor.receive(TickMonitor.hello(0.001), 1.0)
    assert monitor.timeout(1.0) == pytest.approx(0.005)
    monitor.receive(TickMonitor.hello(0.5), 1.0)
    assert not monitor.due(1.4999) and monitor.due(1.5001)


def test_then_it_is_due_every_period_until_ticks_are_back(monitor):
    assert monitor.due(1.0201) and not monitor.due(1.0220) and monitor.due(1.0222)
    assert monitor.alarms == 1
    monitor.receive(TICK, 1.023)
    assert not monitor.due(1.0429)
    assert monitor.due(1.0431) and monitor.alarms == 2


def test_only_ticks_are_signs_of_life(monitor):
    monitor.receive(TickMonitor.HELLO, 1.019)
    assert monitor.due(1.0201) and not monitor.ended
    monitor.receive(TickMonitor.END, 1.021)
    assert monitor.ended


def test_damping_of_a_humanoid_repeats_the_mode_machine_of_the_last_tick():
    name = address('test', 'watchdog', os.getpid(), '/lowcmd')
    sent = []
    with listening(name) as listener, unconnected() as line:
        line.connect(name)
        line.send(TickMonitor.tick(np.append(np.full(29, 3.0), MACHINE)))

        def publish(message):
            sent.append(HG_COMMAND.unpack(message[4:]))
            if len(sent) == 3:
                line.send(TickMonitor.END)

        watch(listener, SimpleNamespace(publish=publish), LowCmd(MODELS['g1']),
              TickMonitor(0.002, 0.02), os.getpid(), logging.getLogger())
    for fields in sent:
        motors = np.array(fields[2:2 + 35 * 7]).reshape(35, 7)
        assert fields[:2] == (0, MACHINE) and not motors[29:].any()
        # Mode, angle, speed, torque, kp, kd.
        assert (motors[:29, :6] == [1.0, 0.0, 0.0, 0.0, 0.0, 3.0]).all()
