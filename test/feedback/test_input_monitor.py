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

"""Measurements that are believed, and those that are not."""

from cpg_ros.feedback.input_checks import (
    check_imu,
    check_joints,
    FAULT_TEXTS,
    IMU,
    IMU_STATE_SIZE,
    InputMonitor,
    MAX_AGE,
    MAX_SILENCE,
    MAX_STAMP_OFFSET,
    note,
)
import numpy as np
import pytest

FASTEST = np.array([20.0, 10.0])


@pytest.fixture
def monitor():
    monitor = InputMonitor('imu')
    note(monitor.numbers, 1.0, 1.0, False, 0, 0.0)
    assert not monitor.fault(1.0)
    return monitor


@pytest.mark.parametrize(('off', 'why'), [
    (-1.5 * MAX_STAMP_OFFSET, 'stamps 0.15 s old'),
    (1.5 * MAX_STAMP_OFFSET, 'stamps 0.15 s ahead')])
def test_stamps_far_from_now_are_named(monitor, off, why):
    now = 1.0 + 1.1 * MAX_SILENCE
    note(monitor.numbers, now, now + off, False, 0, 0.0)
    assert why in monitor.fault(now)
    note(monitor.numbers, now, now + off / 2.0, False, 0, 0.0)
    assert not monitor.fault(now)


def test_the_same_numbers_are_believed_for_as_long_as_allowed(monitor):
    note(monitor.numbers, 1.2, 1.2, True, 0, 0.3)
    assert not monitor.fault(1.2)
    note(monitor.numbers, 1.4, 1.4, True, 0, 0.3)
    assert monitor.fault(1.4) == 'the same numbers again and again'


def test_silence_is_named(monitor):
    assert monitor.fault(1.0 + 1.1 * MAX_SILENCE) == 'no messages'
    assert InputMonitor('feet').fault(1.0) == 'no message yet'


@pytest.mark.parametrize(('angles', 'speeds', 'why'), [
    ((0.1, 0.2), (59.0, -29.0), ''),
    ((0.1, 0.2), (0.0, 31.0), 'an impossible speed of a joint'),
    ((0.1, 0.2), (0.0, -31.0), 'an impossible speed of a joint'),
    ((0.1, -1.4), (0.0, 0.0), 'a joint far beyond its limits'),
    ((1.4, 0.2), (0.0, 0.0), 'a joint far beyond its limits'),
    ((np.nan, 0.2), (0.0, 0.0), 'numbers that are not finite')])
def test_joints_are_where_and_as_fast_as_they_can_be(angles, speeds, why):
    found = np.full((2, 2), 7.0)
    # In the message the joints are the other way round.
    verdict = check_joints(np.array(angles[::-1]), np.array(speeds[::-1]), np.array([1, 0]),
                           np.full(2, -1.0), np.full(2, 1.0), FASTEST, *found)
    assert FAULT_TEXTS[verdict] == why
    assert (found == ([angles, speeds] if not why else 7.0)).all()


def test_a_spike_of_the_gyroscope_is_left_out():
    memory, filled = np.zeros(IMU_STATE_SIZE), np.zeros((3, 3))
    mount = np.array([0.0, 0.0, 0.0, 1.0])
    message = np.zeros(IMU)
    message[3], message[27] = 1.0, 9.81
    verdicts = []
    for spike in (0.0, 0.0, 30.0, 0.0, 0.0):
        message[13] = spike
        verdicts.append(check_imu(message, 0.002, False, mount, memory, *filled))
        assert not filled[1].any()
    # The jump back counts as one, too.
    assert [FAULT_TEXTS[verdict] for verdict in verdicts] == [
        '', '', 'an impossible angular velocity', 'an impossible angular velocity', '']


def test_gravity_is_judged_by_a_quarter_of_a_second_and_not_by_the_first_message():
    memory, filled = np.zeros(IMU_STATE_SIZE), np.zeros((3, 3))
    mount = np.array([0.0, 0.0, 0.0, 1.0])
    message = np.zeros(IMU)
    message[3] = 1.0
    # A robot that is put on the ground falls freely at first; before it, a second of silence.
    for k, dt in enumerate((1.0, *(100 * [0.002]))):
        message[27] = 9.81 * (k > 5)
        assert check_imu(message, dt, False, mount, memory, *filled) == 0
    # A walk's acceleration of an instant, after a second without messages.
    message[27] = 9.81
    for k, dt in enumerate((*(1000 * [0.002]), 1.0)):
        message[27] = 9.81 + 8.0 * (k == 1000)
        assert check_imu(message, dt, True, mount, memory, *filled) == 0
    # Gravity removed by the driver is named once it has been seen for long enough.
    memory[:], message[27] = 0.0, 0.0
    verdicts = [check_imu(message, dt, False, mount, memory, *filled)
                for dt in (1.0, *(140 * [0.002]))]
    assert verdicts[90] == 0 and 'gravity' in FAULT_TEXTS[verdicts[-1]]


def late_monitor(delay, now):
    monitor = InputMonitor('imu', latest=MAX_AGE)
    for _ in range(100):
        now += 0.005
        note(monitor.numbers, now, now - delay, False, 0, 0.0)
        monitor.fault(now)
    return monitor, now


@pytest.mark.parametrize(('delay', 'late'), [(0.02, False), (0.05, True), (0.09, True)])
def test_measurements_that_are_old_when_they_are_used_are_out(delay, late):
    monitor, now = late_monitor(delay, 1.0)
    assert monitor.age == pytest.approx(delay)
    assert ('ms old when it is used, more than feedback.max_delay, 22 ms' in monitor.fault(now)
            ) is late


@pytest.mark.parametrize(('peaks', 'late'), [(True, True), (False, False)])
def test_a_moment_of_late_measurements_counts_at_once_where_the_gait_falls_by_it(peaks, late):
    monitor = InputMonitor('imu', latest=MAX_AGE, peaks=peaks)
    for k in range(20):
        now = 1.0 + 0.002 * k
        note(monitor.numbers, now, now - (0.03 if k == 19 else 0.004), False, 0, 0.0)
        fault = monitor.fault(now)
    assert bool(fault) is late
    # A restart forgets the messages, not what kind of input it is.
    monitor.restart()
    assert monitor.fault(2.0) == 'no message yet'
    note(monitor.numbers, 2.0, 1.996, False, 0, 0.0)
    assert not monitor.fault(2.0)
    note(monitor.numbers, 2.002, 1.972, False, 0, 0.0)
    assert bool(monitor.fault(2.002)) is late


def test_the_age_before_a_gap_does_not_count_after_it():
    monitor, now = late_monitor(0.02, 1.0)
    assert monitor.fault(now + 1.0) == 'no messages' and np.isnan(monitor.age)
    note(monitor.numbers, now + 1.0, now + 1.0, False, 0, 0.0)
    assert not monitor.fault(now + 1.0) and monitor.age == 0.0
