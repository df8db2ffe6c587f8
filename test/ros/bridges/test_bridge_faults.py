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

"""What a bridge does when others command its robot, and when it, its bus or a servo fails."""

import signal
import time

from diagnostic_msgs.msg import DiagnosticStatus
from graph import free_domain, until, Watcher
import pytest
from servo_robot import Sender, ServoRobot, swinging, TARGETS
from std_srvs.srv import Trigger

SLOW, SLOW_BUS = 'state_timeout:=5.0', 'command_timeout:=5.0'


@pytest.fixture
def robot(tmp_path):
    """Return a function that starts a bus, and a watcher of the bridge."""
    made = []

    def make(*parameters):
        domain = free_domain()
        made.extend((ServoRobot(tmp_path, 'a', domain, *parameters),
                     Watcher(domain, '/a/servo_bridge')))
        return made

    yield make
    for one in made:
        one.end()


def error_of(watcher):
    """Wait for an error in /diagnostics; return it."""
    return until(lambda: watcher.diagnostics and watcher.diagnostics[-1].level
                 == DiagnosticStatus.ERROR and watcher.diagnostics[-1].message, 'an error')


def stall(process, seconds):
    process.signal(signal.SIGSTOP)
    time.sleep(seconds)
    process.signal(signal.SIGCONT)


def test_two_sources_of_targets_make_the_robot_sit_and_are_named(robot):
    one, watcher = robot(SLOW_BUS)
    one.start(SLOW)
    with Sender(one.domain, f'/a/{TARGETS}', swinging(0.2), 'generator'):
        one.bridge.wait_for('following: targets have come')
        with Sender(one.domain, f'/a/{TARGETS}', swinging(0.1), 'rival'):
            one.bridge.wait_for('sitting: .* is published by')
            one.bridge.wait_for('damping: it has sat down')
            until(lambda: '/a/forward_position_controller/commands is published by /generator, '
                  '/rival: only one may publish it (exclusive)' in error_of(watcher), 'names')
            watcher.call(Trigger, '/a/servo_bridge/start', Trigger.Request())
            one.bridge.wait_for('not started: .*commands is published by /generator, /rival')
        until(lambda: watcher.node.count_publishers(f'/a/{TARGETS}') == 1, 'the end of the rival')
        count = one.bridge.log.count('following: ')
        watcher.call(Trigger, '/a/servo_bridge/start', Trigger.Request())
        until(lambda: one.bridge.log.count('following: ') > count, 'following')


def test_two_sources_are_followed_where_they_may_be(robot):
    one, _ = robot(SLOW_BUS)
    one.start(SLOW, 'exclusive:=false')
    with (Sender(one.domain, f'/a/{TARGETS}', swinging(0.0), 'generator'),
          Sender(one.domain, f'/a/{TARGETS}', swinging(0.0), 'rival')):
        one.bridge.wait_for('following: targets have come')
    one.bridge.wait_for('sitting: no fresh target')


@pytest.mark.parametrize('name', ['stop', 'damp'])
def test_stops_are_accepted_in_every_state(robot, name):
    one, watcher = robot(SLOW_BUS)
    bridge = one.start(SLOW, 'autostart:=false').wait_for('a biped at 50 Hz')
    ways = {'stop': 'sitting: ~/stop', 'damp': 'damping: ~/damp'}

    def call(service):
        answer = watcher.call(Trigger, f'/a/servo_bridge/{service}', Trigger.Request())
        assert answer.success, answer.message

    def count(words):
        return bridge.log.count(words)

    call(name)
    call('start')
    until(lambda: count('no other command publisher'), 'the start')
    call(name)
    until(lambda: count(f'not started: ~/{name}'), 'the end of the start')
    assert not count('rising')
    with Sender(one.domain, f'/a/{TARGETS}', swinging(0.0)):
        for number, state in enumerate(('rising', 'standing', 'following')):
            call('start')
            before = count(f'{state}: ')
            until(lambda state=state, before=before: count(f'{state}: ') > before, state)
            call(name)
            until(lambda number=number: count(ways[name]) == number + 1, ways[name])
            until(lambda number=number: count('damping: ') == number + 1, 'damping')
            until(lambda: not any(one.chain.torque.values()), 'no torque')
            call(name)
    if name == 'damp':
        assert not count('sitting')


@pytest.mark.parametrize('seconds', [0.1, 0.3])
def test_servos_keep_their_torque_while_a_bridge_stalls(robot, seconds):
    one, _ = robot()
    one.start()
    with Sender(one.domain, f'/a/{TARGETS}', swinging(0.2)):
        one.bridge.wait_for('following: targets have come')
        begun = len(one.chain.torques)
        stall(one.bridge, seconds)
        written = len(one.chain.written)
        until(lambda: len(one.chain.written) > written + 100, 'more goals')
        assert not one.chain.torques[begun:]
        assert 'damping' not in one.bridge.log and 'sitting' not in one.bridge.log


@pytest.mark.parametrize(('bus', 'bridge', 'words'), [
    (SLOW_BUS, 'watchdog_timeout:=1.0', 'damping: the watchdog has damped the robot'),
    ('command_timeout:=1.0', 'watchdog_timeout:=5.0', 'damping: no fresh state of the robot')])
def test_servos_that_were_let_go_stay_so_until_a_new_start(robot, bus, bridge, words):
    one, watcher = robot(bus)
    one.start(SLOW, bridge)
    with Sender(one.domain, f'/a/{TARGETS}', swinging(0.2)):
        one.bridge.wait_for('following: targets have come')
        begun = len(one.chain.torques)
        stall(one.bridge, 2.0)
        one.bridge.wait_for(words)
        assert words in error_of(watcher)
        packets = one.chain.packets
        until(lambda: one.chain.packets > packets + 50, 'more of the bus')
        assert len(one.chain.torques) > begun
        assert not any(value for _, value in one.chain.torques[begun:])
        watcher.call(Trigger, '/a/servo_bridge/start', Trigger.Request())
        until(lambda: one.bridge.log.count('following: ') == 2, 'following again')
        until(lambda: all(one.chain.torque.values()), 'torque')


def test_a_servo_that_is_stuck_makes_the_robot_sit(robot):
    one, watcher = robot(SLOW_BUS)
    one.start(SLOW, 'tracking_error:=0.15')
    with Sender(one.domain, f'/a/{TARGETS}', swinging(0.4)):
        one.bridge.wait_for('following: targets have come')
        written = len(one.chain.written)
        until(lambda: len(one.chain.written) > written + 400, 'some strides')
        assert 'sitting' not in one.bridge.log
        one.chain.jammed[4] = one.chain.goals[4]
        one.bridge.wait_for('sitting: left_knee_joint does not follow: it is at .* rad away on '
                            'average')
        assert 'left_knee_joint does not follow' in error_of(watcher)
