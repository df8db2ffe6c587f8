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

"""What stops a robot acts at once, whatever the parameter services are doing."""

import signal
import time

from cpg_ros.networks.library.delayed import PRESETS
from geometry_msgs.msg import Twist
from graph import until
import numpy as np
import pytest
from rcl_interfaces.srv import SetParameters
from rclpy.parameter import Parameter
from std_srvs.srv import SetBool
import steered

#: Enough to plan for seconds, were all of them planned.
FLOOD = np.linspace(1.0, 2.0, 200)


def ask(watcher, *batches):
    """Ask for batches of (name, value), each a request; return the futures of the answers."""
    name = f'{watcher.generator}/set_parameters'
    # The first answer to a client may be lost, but for this one, which is asked for again.
    watcher.call(SetParameters, name, SetParameters.Request())
    client = watcher.client(SetParameters, name)
    return [client.call_async(SetParameters.Request(parameters=[
        Parameter(name, value=float(value)).to_parameter_msg() for name, value in batch]))
        for batch in batches]


def flood(watcher, at_once=True):
    """Ask for 200 frequencies, in one request or in as many."""
    wanted = [('frequency', value) for value in FLOOD]
    return ask(watcher, *([wanted] if at_once else [[one] for one in wanted]))


def results(futures):
    until(lambda: all(one.done() for one in futures), 'the answers')
    return [result for one in futures for result in one.result().results]


@pytest.mark.parametrize('at_once', [True, False])
def test_a_flood_is_thinned_to_the_last(start, at_once):
    _, watcher = start('-p', 'rate:=200')
    told = results(flood(watcher, at_once))
    assert len(told) == 200 and told[-1].successful
    assert watcher.get('frequency') == [2.0]
    thinned = [one for one in told if not one.successful]
    assert all('superseded' in one.reason for one in thinned)
    if at_once:
        assert len(thinned) >= 198
    # Other parameters are not taken for the same.
    both = watcher.set(amplitude=0.5, frequency=1.5)
    assert all(one.successful for one in both)


@pytest.mark.parametrize(('asked', 'applied'), [
    ([1.5, 9.9], [True, False]), ([1.4, 1.5, 9.9, 9.8], [False, True, False, False]),
    ([9.9, 1.5], [False, True])])
def test_a_valid_request_outlives_later_ones_that_are_refused(stepped, asked, applied):
    _, watcher = stepped(running=False)
    # All of them wait at once: they come in one message.
    answers = results(ask(watcher, [('frequency', value) for value in asked]))
    assert [one.successful for one in answers] == applied
    assert watcher.get('frequency') == [1.5]
    assert all('superseded' in one.reason or 'above its limit' in one.reason
               for one in answers if not one.successful)


def test_a_refused_request_does_not_bring_an_earlier_one_past_a_gait(stepped):
    _, watcher = stepped(running=False)
    names = 'delayed.a', 'gait', 'delayed.a'
    answer = watcher.call(SetParameters, '/cpg_generator/set_parameters', SetParameters.Request(
        parameters=[Parameter(name, value=value).to_parameter_msg()
                    for name, value in zip(names, (-1.9, 'trot', -1e9), strict=True)]))
    assert [one.successful for one in answer.results] == [True, True, False]
    assert watcher.get('delayed.a') == [PRESETS['trot'].network.as_dict()['a']] != [-1.9]


def test_enable_false_does_not_wait_for_plans(start):
    process, watcher = start('-p', 'rate:=200', '-p', 'network:=quadruped', '-p', 'ramp:=0.2')
    watcher.record(0.5)
    # Each is planned: a parameter of the network of its own.
    alpha, = watcher.get('quadruped.alpha')
    waiting = ask(watcher, *([(name, alpha + off)] for off in np.linspace(0.0, 1e-3, 40)
                             for name in ('quadruped.alpha', 'quadruped.beta')))
    waiting += flood(watcher)
    began = time.monotonic()
    answer = watcher.call(SetBool, '/cpg_generator/enable', SetBool.Request(data=False))
    assert answer.success
    print(f'enable answered after {1e3 * (time.monotonic() - began):.1f} ms')
    # Answered before what was asked for earlier, and the robot stands although that goes on.
    assert not all(one.done() for one in waiting)
    until(lambda: not np.any(watcher.samples[-1][2]), 'the stand')
    results(waiting)
    assert process.alive


def test_the_time_out_does_not_wait_for_plans(start, tmp_path):
    process, watcher = start('-p', f'robot:={steered.write(tmp_path)}', '-p', 'cmd_vel:=true',
                             '-p', 'ramp:=0.2', '-p', 'cmd_vel_timeout:=0.3')
    publisher = watcher.node.create_publisher(Twist, 'cmd_vel', 10)
    until(publisher.get_subscription_count, 'the generator listening')
    message = Twist()
    message.linear.x = 0.3
    until(lambda: publisher.publish(message) or np.any(watcher.record(0.0)[2]), 'a robot walking')
    waiting = ask(watcher, *([pair] for tau in np.linspace(0.4, 0.45, 60)
                             for pair in (('delayed.tau', tau), ('delayed.b', 0.6 + tau))))
    process.wait_for('no cmd_vel for')
    words = process.log.partition('no cmd_vel for ')[2]
    # Its own words on how old the command was: 0.3 s, to two digits.
    assert float(words.split()[0]) <= 0.35
    until(lambda: not np.any(watcher.samples[-1][2]), 'the stand')
    results(waiting)


@pytest.mark.parametrize('number', [signal.SIGINT, signal.SIGTERM])
def test_a_signal_does_not_wait_for_plans(start, number):
    process, watcher = start('-p', 'rate:=200', '-p', 'network:=quadruped')
    watcher.record(1.2)
    flood(watcher, at_once=False)
    process.signal(number)
    began = time.monotonic()
    assert process.wait() == 0
    assert 'ramping down' in process.log and 'Traceback' not in process.log
    _, _, velocity = watcher.samples[-1]
    assert velocity == pytest.approx([0.0] * 12, abs=1e-9)
    # The ramp is 0.5 s, and the process ends within a second by contract.
    assert time.monotonic() - began < 10.0
