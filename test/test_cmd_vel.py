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

"""A real generator that walks as cmd_vel asks, and stands where nobody asks."""

import time

from geometry_msgs.msg import Twist
from graph import Process, until
import numpy as np
import pytest
from std_srvs.srv import SetBool
import steered

RATE = 100.0


@pytest.fixture(scope='module')
def robot(tmp_path_factory):
    return steered.write(tmp_path_factory.mktemp('robot'))


@pytest.fixture
def walker(start, robot):
    process, watcher = start('-p', f'robot:={robot}', '-p', 'cmd_vel:=true', '-p', f'rate:={RATE}',
                             '-p', 'ramp:=0.3', '-p', 'cmd_vel_timeout:=0.8',
                             '-p', 'transition:=0.3')
    publisher = watcher.node.create_publisher(Twist, 'cmd_vel', 10)
    until(publisher.get_subscription_count, 'the generator listening')

    def ask(speed=0.0, turn=0.0, seconds=1.0, aside=0.0):
        message = Twist()
        message.linear.x, message.linear.y, message.angular.z = speed, aside, turn
        end = time.monotonic() + seconds
        while time.monotonic() < end:
            publisher.publish(message)
            time.sleep(0.05)
        _, position, _ = watcher.record(0.0)
        return position

    def swings(speed, turn=0.0):
        """Walk until it is steady; return each joint's range and the stride frequency in Hz."""
        ask(speed, turn, 2.0)
        first = len(watcher.samples)
        phase = len(watcher.phases)
        ask(speed, turn, 2.1)
        positions = np.array([sample[1] for sample in watcher.samples[first:]])
        phases = np.unwrap(np.array(watcher.phases[phase:])[:, 0], period=1.0)
        return (dict(zip(watcher.names, np.ptp(positions, axis=0), strict=True)),
                (phases[-1] - phases[0]) / (len(phases) - 1) * RATE)

    return process, watcher, ask, swings


def still(watcher):
    _, positions, _ = watcher.record(0.3)
    return np.ptp(positions, axis=0).max() == 0.0


def test_it_walks_as_asked_and_stands_otherwise(walker):
    process, watcher, ask, swings = walker
    until(lambda: still(watcher), 'a stand before anything is asked')
    fast, frequency = swings(0.4)
    # The table: stride 0.9 at 2 Hz; a thigh swings by its weights times the stride.
    assert frequency == pytest.approx(2.0, rel=0.01)
    slow, frequency = swings(0.2)
    assert frequency == pytest.approx(1.5, rel=0.01)
    ratio = np.interp(0.2, [0.0, 0.4], [-0.1, 0.9]) / 0.9
    for leg in ('lh', 'rh', 'lf', 'rf'):
        assert slow[f'{leg}_thigh_joint'] / fast[f'{leg}_thigh_joint'] == pytest.approx(ratio,
                                                                                        rel=0.02)
    left, _ = swings(0.2, 0.3)
    assert left['rh_thigh_joint'] > 1.5 * left['lh_thigh_joint']
    right, _ = swings(0.2, -0.3)
    assert right['lf_thigh_joint'] > 1.5 * right['rf_thigh_joint']
    # Nobody asks any more.
    process.wait_for(r'no cmd_vel for 0\.\d+ s: stopping')
    until(lambda: still(watcher), 'a stand after the last command')
    # Zero stops, too, within the ramp, while it is still being sent.
    ask(0.3, 0.0, 1.0)
    assert not still(watcher)
    ask(0.0, 0.0, 1.0)
    ask(0.0, 0.0, 0.3)
    recent = np.array([sample[1] for sample in watcher.samples[-20:]])
    assert np.ptp(recent, axis=0).max() == 0.0


def test_enable_comes_before_cmd_vel(walker):
    _, watcher, ask, _ = walker
    answer = watcher.call(SetBool, '/cpg_generator/enable', SetBool.Request(data=False))
    assert answer.success
    ask(0.3, 0.0, 1.0)
    assert still(watcher)
    time.sleep(1.2)
    answer = watcher.call(SetBool, '/cpg_generator/enable', SetBool.Request(data=True))
    assert answer.message == 'enabled: standing until cmd_vel asks for motion'
    ask(0.3, 0.0, 0.8)
    assert not still(watcher)


def test_what_cannot_be_walked_is_said(walker):
    process, watcher, ask, swings = walker
    fast, _ = swings(0.4)
    faster, _ = swings(3.0)
    assert faster == pytest.approx(fast, rel=0.01)
    process.wait_for("cmd_vel asks for 3 m/s: the trot's range is -0.2 to 0.4 m/s")
    ask(0.2, aside=0.1, seconds=0.2)
    process.wait_for('asks for 0.1 m/s to the left: without feedback this robot walks forward, '
                     'backward')
    until(lambda: still(watcher), 'a stand')
    ask(float('nan'), seconds=0.7)
    process.wait_for('cmd_vel ignored: nan m/s forward')
    assert still(watcher) and process.alive


def test_gaits_bring_their_frequency_and_must_be_steerable(walker):
    _, watcher, _, swings = walker
    assert watcher.get('frequency', 'gait') == [2.0, 'trot']
    assert watcher.set(gait='walk')[0].successful
    assert watcher.get('frequency') == [1.25]
    _, frequency = swings(0.4)
    assert frequency == pytest.approx(1.25, rel=0.01)
    refused = watcher.set(gait='pace')[0]
    assert not refused.successful
    assert refused.reason == ("robot file 'steered' does not say how to steer the gait 'pace' "
                              '(gaits.pace.steering), which cmd_vel needs')
    assert watcher.get('gait', 'frequency') == ['walk', 1.25]
    # A frequency of one's own scales the table's.
    assert watcher.set_together(gait='trot', frequency=1.0).successful
    _, frequency = swings(0.4)
    assert frequency == pytest.approx(1.0, rel=0.01)
    until(lambda: watcher.diagnostics and any(
        value.key == 'cmd_vel' and value.value == '0.4 m/s, 0 rad/s'
        for status in watcher.diagnostics for value in status.values), 'its diagnostics')


def test_frequencies_without_cmd_vel(start, robot):
    _, watcher = start('-p', f'robot:={robot}', '-p', 'gait:=walk')
    assert watcher.get('frequency') == [1.25]
    assert watcher.set(gait='pace')[0].successful
    assert watcher.get('frequency') == [1.25]
    assert watcher.set(gait='trot')[0].successful
    assert watcher.get('frequency') == [2.0]


def test_a_robot_that_cannot_be_steered_does_not_start():
    process = Process('-p', 'cmd_vel:=true')
    assert process.wait() == 1
    assert ("robot file 'quadruped' does not say how to steer the gait 'trot' "
            '(gaits.trot.steering), which cmd_vel needs') in process.log
    assert 'Traceback' not in process.log


def test_the_timeout_has_a_range(walker):
    _, watcher, _, _ = walker
    refused = watcher.set(cmd_vel_timeout=0.0)[0]
    assert not refused.successful and 'cmd_vel_timeout' in refused.reason
    assert watcher.get('cmd_vel_timeout') == [0.8]
