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

"""Generators as nodes of another program: in its executor, several in one process."""

import os
import subprocess
import sys
import threading

from cpg_ros.ros.generator import Generator
from graph import free_domain, PATIENCE, until, Watcher
import numpy as np
import pytest
from rcl_interfaces.msg import Log, LoggerLevel
from rcl_interfaces.srv import SetLoggerLevels
import rclpy
from rclpy.executors import ExternalShutdownException, SingleThreadedExecutor
from rclpy.parameter import Parameter
from rclpy.qos import DurabilityPolicy, QoSProfile
from std_srvs.srv import SetBool

pytestmark = pytest.mark.live


class Program:
    """A program with an executor of its own, which spins in a thread."""

    def __init__(self):
        self.domain, self.context = free_domain(), rclpy.Context()
        rclpy.init(context=self.context, domain_id=self.domain)
        self.executor = SingleThreadedExecutor(context=self.context)
        self.nodes = []
        self.spinning = threading.Thread(target=self.spin, daemon=True)

    def spin(self):
        try:
            while not self.ended:
                self.executor.spin_once(timeout_sec=0.1)
        except ExternalShutdownException:
            pass

    ended = False

    def generator(self, namespace, **values):
        node = Generator(namespace=namespace, context=self.context, parameter_overrides=[
            Parameter(name, value=value) for name, value in values.items()])
        self.executor.add_node(node)
        self.nodes.append(node)
        return node

    def end(self):
        self.ended = True
        self.spinning.join(PATIENCE)
        while self.nodes:
            self.nodes.pop().destroy_node()
        self.executor.shutdown()
        rclpy.try_shutdown(context=self.context)


@pytest.fixture
def program():
    program = Program()
    yield program
    program.end()


def test_two_generators_in_the_executor_of_a_program(program):
    left, right = (program.generator(f'/{side}', gait=gait, rate=200.0, ramp=0.2)
                   for side, gait in (('left', 'walk'), ('right', 'trot')))
    watchers = [Watcher(program.domain, f'/{side}/cpg_generator') for side in ('left', 'right')]
    lines = []
    watchers[0].node.create_subscription(
        Log, '/rosout', lambda message: lines.append((message.name, message.msg)),
        QoSProfile(depth=1000, durability=DurabilityPolicy.TRANSIENT_LOCAL))
    try:
        program.spinning.start()
        for watcher, gait in zip(watchers, ('walk', 'trot'), strict=True):
            until(lambda watcher=watcher: watcher.gaits, 'a gait')
            assert watcher.gaits == [gait]
            # They walk: every joint that swings moves.
            _, positions, _ = watcher.record(1.0)
            assert np.ptp(positions, axis=0).max() > 0.1
            until(lambda watcher=watcher: watcher.diagnostics, 'diagnostics')
        until(lambda: {name for name, text in lines if 'publishing 12 joints' in text}
              == {'left.cpg_generator', 'right.cpg_generator'}, 'the log of both')
        # Parameters, services and the level of the log of one of them.
        assert watchers[0].set(frequency=1.3)[0].successful
        assert left.get_parameter('frequency').value == 1.3 != right.get_parameter(
            'frequency').value
        answer = watchers[1].call(SetLoggerLevels, '/right/cpg_generator/set_logger_levels',
                                  SetLoggerLevels.Request(levels=[LoggerLevel(
                                      name='right.cpg_generator', level=40)]))
        assert answer.results[0].successful
        assert watchers[1].call(SetBool, '/right/cpg_generator/enable',
                                SetBool.Request(data=False)).success
        until(lambda: np.ptp(watchers[1].record(0.3)[1], axis=0).max() < 1e-9, 'a stand')
        assert np.ptp(watchers[0].record(0.5)[1], axis=0).max() > 0.1
    finally:
        for watcher in watchers:
            watcher.end()


def test_destroying_a_node_ramps_down_and_leaves_no_thread(program):
    node = program.generator('', rate=200.0, ramp=0.1)
    watcher = Watcher(program.domain)
    before = set(threading.enumerate())
    try:
        program.spinning.start()
        watcher.record(0.5)
        stand = np.array([joint.offset for joint in node.pattern.robot.joints])[
            list(node.pattern.robot.order_indices)]
        program.end()
        last = until(lambda: watcher.samples, 'joint states')[-1]
        assert watcher.names == list(node.pattern.robot.order)
        assert np.allclose(last[1], stand, atol=1e-6) and np.allclose(last[2], 0.0, atol=1e-6)
        assert not {thread.name for thread in set(threading.enumerate()) - before} & {
            'ticker', 'parameters'}
    finally:
        watcher.end()


LATE = """
import threading, time
from cpg_ros.ros.generator import Generator
import rclpy
from rclpy.executors import ExternalShutdownException
rclpy.init()
node = Generator()

def spin():
    try:
        rclpy.spin(node)
    except ExternalShutdownException:
        pass

spinning = threading.Thread(target=spin)
spinning.start()
while node.ticker.ticks < 20:
    time.sleep(0.01)
rclpy.shutdown()
spinning.join()
node.ticker.join()
node.destroy_node()
"""


def test_a_shutdown_before_the_end_of_the_node_is_one_line():
    found = subprocess.run([sys.executable, '-P', '-c', LATE], capture_output=True, text=True,
                           env=dict(os.environ, ROS_DOMAIN_ID=str(free_domain())),
                           timeout=PATIENCE)
    assert found.returncode == 0 and 'Traceback' not in found.stderr, found.stderr
    assert 'cpg_generator: rclpy was shut down before the node was destroyed' in found.stderr
