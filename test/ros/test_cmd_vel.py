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

"""A generator that walks as cmd_vel asks, and stands where nobody asks."""

import re

from geometry_msgs.msg import Twist, TwistStamped
from graph import until, Watcher
import numpy as np
import pytest
from std_srvs.srv import SetBool
import steered
from stepped import refused
import yaml

RATE = 100.0


@pytest.fixture(scope='module')
def robot(tmp_path_factory):
    return steered.write(tmp_path_factory.mktemp('robot'))


@pytest.fixture
def walker(stepped, robot):
    generator, watcher = stepped(
        '-p', f'robot:={robot}', '-p', 'cmd_vel:=true', '-p', f'rate:={RATE}', '-p', 'ramp:=0.3',
        '-p', 'cmd_vel_timeout:=0.8', '-p', 'transition:=0.3', running=False)
    publisher = watcher.node.create_publisher(Twist, 'cmd_vel', 10)
    until(publisher.get_subscription_count, 'the generator listening')

    def ask(speed=0.0, turn=0.0, seconds=1.0, aside=0.0):
        message = Twist()
        message.linear.x, message.linear.y, message.angular.z = speed, aside, turn
        for _ in range(round(seconds / 0.06)):
            publisher.publish(message)
            generator.run(0.06)

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

    return generator, watcher, ask, swings


def still(generator):
    first = len(generator.watcher.samples)
    generator.run(0.3)
    positions = [sample[1] for sample in generator.watcher.samples[first:]]
    return np.ptp(positions, axis=0).max() == 0.0


def shown(watcher):
    """Return the command that the diagnostics show."""
    return [value.value for status in watcher.diagnostics[-1:] for value in status.values
            if value.key == 'cmd_vel']


def test_it_walks_as_asked_and_stands_otherwise(walker):
    generator, watcher, ask, swings = walker
    until(lambda: still(generator), 'a stand before anything is asked')
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
    generator.run(0.7)
    assert 'no cmd_vel' not in generator.log
    generator.run(0.3)
    age = generator.wait_for('no cmd_vel for ([0-9.]+) s: stopping')[1]
    assert 0.8 <= float(age) <= 1.1
    until(lambda: still(generator), 'a stand after the last command')
    # Zero stops, too, within the ramp, while it is still being sent.
    ask(0.3, 0.0, 1.0)
    assert not still(generator)
    ask(0.0, 0.0, 1.0)
    ask(0.0, 0.0, 0.3)
    recent = np.array([sample[1] for sample in watcher.samples[-20:]])
    assert np.ptp(recent, axis=0).max() == 0.0


def test_enable_comes_before_cmd_vel(walker):
    generator, watcher, ask, _ = walker
    answer = watcher.call(SetBool, '/cpg_generator/enable', SetBool.Request(data=False))
    assert answer.success
    ask(0.3, 0.0, 1.0)
    assert still(generator)
    generator.run(1.2)
    until(lambda: shown(watcher) == ['none'], 'its age')
    answer = watcher.call(SetBool, '/cpg_generator/enable', SetBool.Request(data=True))
    assert answer.message == 'enabled: standing until cmd_vel asks for motion'
    ask(0.3, 0.0, 0.8)
    assert not still(generator)


def test_what_cannot_be_walked_is_said(walker):
    generator, _, ask, swings = walker
    fast, _ = swings(0.4)
    faster, _ = swings(3.0)
    assert faster == pytest.approx(fast, rel=0.01)
    generator.wait_for("cmd_vel asks for 3 m/s: the trot's range is -0.2 to 0.4 m/s")
    ask(0.2, aside=0.1, seconds=0.2)
    generator.wait_for('asks for 0.1 m/s to the left: without feedback this robot walks forward, '
                     'backward')
    until(lambda: still(generator), 'a stand')
    ask(0.2, float('nan'), seconds=0.7)
    generator.wait_for('cmd_vel ignored: 0.2 m/s forward, .* nan rad/s')
    ask(float('nan'), seconds=0.7)
    assert still(generator)


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
    until(lambda: shown(watcher) == ['0.4 m/s, 0 rad/s'], 'its diagnostics')


def test_one_cmd_vel_changes_to_a_faster_gait_and_back(stepped, tmp_path):
    tree = steered.tree()
    tree['gaits']['run'] = dict(tree['gaits']['trot'], steering=dict(
        steered.STEERING, speed=[-0.4, 0.0, 0.8]))
    path = tmp_path / 'runner.yaml'
    path.write_text(yaml.safe_dump(tree))
    generator, watcher = stepped(
        '-p', f'robot:={path}', '-p', 'cmd_vel:=true', '-p', f'rate:={RATE}', '-p', 'ramp:=0.3',
        '-p', 'cmd_vel_timeout:=60.0', '-p', 'transition:=0.3', '-p', 'faster_gait:=run',
        running=False)
    publisher = watcher.node.create_publisher(Twist, 'cmd_vel', 10)
    until(publisher.get_subscription_count, 'the generator listening')

    def gait_at(speed):
        message = Twist()
        message.linear.x = speed
        publisher.publish(message)
        generator.run(0.5)
        return watcher.get('gait')[0]

    assert gait_at(0.3) == 'trot'
    for _ in range(3):
        until(lambda: gait_at(0.7) == 'run', 'the faster gait')
        # Nine tenths of the trot's 0.4 m/s are left to it.
        assert gait_at(0.38) == 'run'
        until(lambda: gait_at(0.3) == 'trot', 'the gait that was left')
    assert "the trot's range" not in generator.log
    until(lambda: gait_at(0.9) == 'run', 'the faster gait')
    gait_at(0.9)
    generator.wait_for("cmd_vel asks for 0.9 m/s: the run's range is -0.4 to 0.8 m/s")


def test_a_faster_gait_must_be_steerable(robot):
    assert refused('-p', f'robot:={robot}', '-p', 'cmd_vel:=true', '-p', 'faster_gait:=pace'
                   ).startswith("faster_gait 'pace' is not one of walk, trot")


def test_frequencies_without_cmd_vel(stepped, robot):
    _, watcher = stepped('-p', f'robot:={robot}', '-p', 'gait:=walk')
    assert watcher.get('frequency') == [1.25]
    assert watcher.set(gait='pace')[0].successful
    assert watcher.get('frequency') == [1.25]
    assert watcher.set(gait='trot')[0].successful
    assert watcher.get('frequency') == [2.0]


def test_a_robot_that_cannot_be_steered_does_not_start():
    assert refused('-p', 'cmd_vel:=true') == (
        "robot file 'quadruped' does not say how to steer the gait 'trot' "
        '(gaits.trot.steering), which cmd_vel needs')


def test_the_timeout_has_a_range(walker):
    _, watcher, _, _ = walker
    refused = watcher.set(cmd_vel_timeout=0.0)[0]
    assert not refused.successful and 'cmd_vel_timeout' in refused.reason
    assert watcher.get('cmd_vel_timeout') == [0.8]


def test_stamped_commands_are_taken_and_others_named(stepped, robot):
    generator, watcher = stepped(
        '-p', f'robot:={robot}', '-p', 'cmd_vel:=true', '-p', 'stamped_cmd_vel:=true',
        '-p', f'rate:={RATE}', '-p', 'ramp:=0.3', '-p', 'cmd_vel_timeout:=0.8', running=False)
    publisher = watcher.node.create_publisher(TwistStamped, 'cmd_vel', 10)
    until(publisher.get_subscription_count, 'the generator listening')
    command = TwistStamped()
    command.twist.linear.x = 0.3

    def ask(seconds):
        # Without a stamp there is no age.
        for _ in range(round(seconds / 0.06)):
            publisher.publish(command)
            generator.run(0.06)

    ask(1.0)
    until(lambda: shown(watcher)[-1:] == ['0.3 m/s, 0 rad/s'], 'the command')
    assert not still(generator)
    # Who publishes the other type is named: by a participant of its own, which has one type.
    other = Watcher(generator.domain)
    other.node.create_publisher(Twist, 'cmd_vel', 10)
    warned = 'cmd_vel is published as geometry_msgs/msg/Twist by /watcher'

    def named():
        generator.run(0.2)
        return warned in generator.log
    until(named, 'a warning')
    assert 'set stamped_cmd_vel to false' in generator.log
    assert generator.log.count(warned) == 1
    until(lambda: generator.run(0.1) or any(
        status.message.startswith(warned) for status in watcher.diagnostics[-1:]), 'diagnostics')
    other.end()
    until(lambda: generator.run(0.1) or still(generator), 'a stand after the last command')
    # One that was on its way for too long is none.
    command.header.stamp.sec = 1
    ask(1.5)
    assert re.search(r'cmd_vel ignored: its stamp is [0-9.]+ s old', generator.log)
    assert still(generator)


@pytest.mark.parametrize(('ahead', 'frame', 'reason'), [
    (3600.0, 'base_link', 'its stamp is 3.6e+03 s ahead'),
    (None, 'map', "it is in the frame 'map', not in the base's 'base_link'"),
    (0.0, 'base_link', ''), (None, 'body', '')])
def test_commands_of_another_time_or_frame_move_nothing(stepped, robot, ahead, frame, reason):
    generator, watcher = stepped(
        '-p', f'robot:={robot}', '-p', 'cmd_vel:=true', '-p', 'stamped_cmd_vel:=true', '-p',
        f'rate:={RATE}', '-p', 'ramp:=0.3',
        *(('-p', 'feedback.base_frame:=body') if frame == 'body' else ()), running=False)
    publisher = watcher.node.create_publisher(TwistStamped, 'cmd_vel', 10)
    until(publisher.get_subscription_count, 'the generator listening')
    command = TwistStamped()
    command.header.frame_id, command.twist.linear.x = frame, 0.3
    generator.run(0.2)
    for _ in range(17):
        if ahead is not None:
            now = generator.now + ahead
            command.header.stamp.sec, command.header.stamp.nanosec = int(now), int(now % 1 * 1e9)
        publisher.publish(command)
        generator.run(0.06)
    assert still(generator) == bool(reason)
    assert generator.log.count('cmd_vel ignored') == bool(reason) and reason in generator.log
