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

"""Several robots on one domain: each is moved by its own nodes, in its own namespace."""

import contextlib
import importlib.util

from constant_go2 import ConstantGo2
from graph import EXECUTABLE, free_domain, Process, until, Watcher
import numpy as np
import pytest
from servo_chain import servo_steps
from servo_robot import Sender, ServoRobot, STAND
from std_msgs.msg import Float64MultiArray

#: A shared machine may be late.
SLOW, SLOW_BUS = 'state_timeout:=5.0', 'command_timeout:=5.0'


@pytest.fixture
def servo_robot(tmp_path):
    """Return a function that starts the bus of a robot in a namespace of one domain."""
    domain, robots = free_domain(), []

    def make(namespace, *parameters):
        robots.append(ServoRobot(tmp_path, namespace, domain, *parameters))
        return robots[-1]

    yield make
    for robot in robots:
        robot.end()


def test_a_servo_bridge_moves_the_robot_of_its_namespace_only(servo_robot):
    one, other = servo_robot('a', SLOW_BUS), servo_robot('b', SLOW_BUS)
    one.start(SLOW).wait_for('standing: it has risen')
    until(lambda: np.abs(one.goals() - servo_steps(STAND)).max() <= 1, 'the stand')
    assert not other.chain.written and not any(other.chain.torque.values())
    other.start(SLOW).wait_for('standing: it has risen')
    until(lambda: all(other.chain.torque.values()), 'torque')
    one.bridge.end()
    until(lambda: not any(one.chain.torque.values()), 'no torque')
    assert all(other.chain.torque.values()) and 'sitting' not in other.bridge.log


def test_a_bus_obeys_its_bridge_and_refuses_a_stranger(servo_robot):
    robot = servo_robot('a', SLOW_BUS)
    robot.start(SLOW).wait_for('standing: it has risen')
    # No pose on the way of the bridge has these angles.
    strange = servo_steps([0.7, -0.4, 0.7, -0.4])
    with Sender(robot.domain, '/a/servo/commands', [0.7, -0.4, 0.7, -0.4]):
        robot.bus.wait_for('refused: commands of .*: the servos are driven by /a/servo_bridge')
        # The bridge makes it sit, says who it is, and lets the servos go.
        robot.bridge.wait_for('another node commands the robot: /stranger')
        robot.bridge.wait_for('damping: it has sat down')
        until(lambda: not any(robot.chain.torque.values()), 'no torque')
        # Nor does the stranger take the servos over now.
        begun, packets = len(robot.chain.torques), robot.chain.packets
        until(lambda: robot.chain.packets > packets + 50, 'more of the bus')
        assert not any(value for _, value in robot.chain.torques[begun:])
    written = robot.chain.written
    assert not any(value == strange[servo - 1] for servo, value in written)


needs_unitree = pytest.mark.skipif(importlib.util.find_spec('unitree_go') is None,
                                   reason="'make messages' has not been run")


@pytest.fixture
def ending():
    """Return a stack of what is ended with the test."""
    with contextlib.ExitStack() as stack:
        yield stack


def unitree_bridge(ending, domain, namespace, *parameters, remapped=True):
    words = [word for one in (
        'rate:=100.0', 'state_timeout:=0.2', 'motion_switcher:=false', *parameters)
        for word in ('-p', one)]
    if remapped:
        words += [word for one in ('lowcmd', 'lowstate')
                  for word in ('-r', f'/{one}:=/{namespace}/{one}')]
    process = Process('-r', f'__ns:=/{namespace}', *words, domain=domain,
                      executable=EXECUTABLE.with_name('unitree_bridge'))
    ending.callback(process.end)
    return process


@needs_unitree
def test_a_unitree_bridge_moves_the_robot_of_its_topics_only(ending):
    domain = free_domain()
    # In the order FR FL RR RL of the message.
    one, other = (ConstantGo2(domain, name, (10, 60, 25, 20)) for name in ('a', 'b'))
    ending.callback(one.end)
    ending.callback(other.end)
    unitree_bridge(ending, domain, 'a', 'foot_scale:=2.0', 'foot_offset:=[10.0, 20.0, 20.0, 11.0]',
                   'foot_threshold:=[15.0]').wait_for('rising: ')
    until(lambda: one.driven, 'motion')
    # Legs LH RH LF RF: 2 (20 - 10), 2 (25 - 20) < 15, 2 (60 - 20), 2 (10 - 11).
    until(lambda: one.contacts == [20.0, 0.0, 80.0, 0.0], f'forces, not {one.contacts}')
    # The robot's own topic is one robot's: a bridge to both is none.
    second = unitree_bridge(ending, domain, 'b')
    second.wait_for('no other command publisher')
    until(lambda: other.driven, 'motion of the other')
    third = unitree_bridge(ending, domain, 'a')
    assert third.wait() == 1
    assert 'another bridge on this computer commands the robot on /a/lowcmd' in third.log


@pytest.mark.skipif(importlib.util.find_spec('mujoco') is None,
                    reason='the extra [sim] is not installed')
def test_a_simulation_follows_the_commands_of_its_namespace_only(ending):
    domain = free_domain()
    watchers = []
    for name in 'ab':
        process = Process('-r', f'__ns:=/{name}', '-p', 'command:=forward_position', domain=domain,
                          executable=EXECUTABLE.with_name('robot_sim'))
        ending.callback(process.end)
        watchers.append(Watcher(domain, f'/{name}/robot_sim'))
        ending.callback(watchers[-1].end)
    one, other = watchers
    until(lambda: one.samples and other.samples, 'both')
    target = np.array(one.samples[-1][1]) + 0.2
    publisher = one.node.create_publisher(
        Float64MultiArray, '/a/forward_position_controller/commands', 1)

    def arrived():
        publisher.publish(Float64MultiArray(data=target.tolist()))
        return np.abs(np.array(one.samples[-1][1]) - target).max() < 0.15

    until(arrived, 'the target')
    # Knees give way a little under the weight; hips do not.
    assert np.abs(np.array(other.samples[-1][1])[::3]).max() < 0.05


def test_panels_of_two_namespaces_live_on_one_domain(ending):
    domain = free_domain()
    for name in 'ab':
        process = Process('-r', f'__ns:=/{name}', '-p', 'port:=0', domain=domain,
                          executable=EXECUTABLE.with_name('panel'))
        ending.callback(process.end)
        process.wait_for('http://')
