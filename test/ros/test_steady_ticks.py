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

import ctypes
import subprocess
import sys
import threading
from types import SimpleNamespace

from cpg_ros.ros.node import native
from cpg_ros.ros.node.message_block import MessageBlock, Template
from cpg_ros.ros.node.ticker import Ticker
from graph import free_domain
import numpy as np
import pytest
from rclpy.serialization import deserialize_message
from std_msgs.msg import Float64MultiArray
from test_message_block import Graph

STEADY = SimpleNamespace(get_clock=lambda: SimpleNamespace(
    ros_time_is_active=False, create_jump_callback=lambda *_, **__: None))


class Counter:
    """Counts up at each tick outside the interpreter, and publishes that on two topics."""

    def __init__(self, monkeypatch, until):
        """Ask for Python at the tick of that number."""
        self.graph, self.until = Graph(monkeypatch), until
        self.value, self.asked = np.zeros(1), ctypes.c_int32()
        self.pointer = ctypes.c_void_p(self.value.ctypes.data)
        kind = ctypes.CFUNCTYPE(None, ctypes.c_void_p, ctypes.c_double)
        self.functions = kind(self.advance), kind(lambda *_: None)
        self.spans, self.pythons, self.heard = [], [], []
        self.blocks = [self.block(topic) for topic in ('all', 'some')]
        self.done, self.errors = threading.Event(), []
        self.ticker = Ticker(STEADY, 20.0, self.tick, None, self.errors.append,
                             resume=lambda stall: None, steadily=self.steadily)

    def block(self, topic):
        message = Float64MultiArray()
        return MessageBlock(self.graph, [1], [
            (topic, Template(message, numbers=[(message, 'data', np.arange(1))]))])

    def advance(self, _, dt):
        self.value += 1.0
        self.spans.append(dt)
        if self.value == self.until:
            self.asked.value = 1

    def steadily(self, run, deadline, period):
        if self.pythons:
            return None
        advance, resume = (ctypes.cast(function, ctypes.c_void_p).value
                           for function in self.functions)
        loop = native.Loop(asked=ctypes.addressof(self.asked), advance=advance, resume=resume)
        place = ctypes.addressof(self.pointer)
        loop.outputs[:2] = (self.blocks[0].output([place], 1), self.blocks[1].output([place], 4))
        return run(loop, deadline, period)

    def tick(self, dt, stamp):
        self.pythons.append(self.value[0])
        self.heard = [deserialize_message(self.graph.sent[topic], Float64MultiArray).data[0]
                      for topic in ('all', 'some') if topic in self.graph.sent]
        self.done.set()

    def run(self):
        self.ticker.start()
        assert self.done.wait(60.0)
        self.ticker.end()
        self.ticker.join()
        assert not self.errors


def test_a_request_ends_them_at_the_next_tick(monkeypatch):
    counter = Counter(monkeypatch, until=11)
    counter.run()
    assert counter.pythons[0] == 11 and counter.spans == pytest.approx([0.05] * 11)
    # The second topic has every fourth tick.
    assert counter.heard == [11, 8]
    assert counter.ticker.ticks == 11 + len(counter.pythons)


def test_what_the_middleware_refuses_ends_them(monkeypatch):
    counter = Counter(monkeypatch, until=0)
    counter.graph.refused = 0
    counter.run()
    assert counter.pythons[0] == 1 and counter.heard == []


HELD = """
import ctypes
import time
from cpg_ros.motion.plan import plan_gait
from cpg_ros.ros.generator import Generator
import rclpy
rclpy.init(args=['generator', '--ros-args', '-p', 'rate:=1000.0', '-p', 'ramp:=0.1'])
node = Generator()
node.begin()
while node.ticker.ticks < 500:
    time.sleep(0.01)
walk = plan_gait(node.pattern.robot, 'walk')
before = node.ticker.ticks
node.pattern.apply(walk, 0.1)
node.pattern.enable(False, 0.1)
# Of PyDLL: it keeps the interpreter's lock.
ctypes.PyDLL(None).sleep(3)
print(node.ticker.ticks - before, node.pattern.level, node.pattern.plan is walk,
      node.pattern.in_transition)
node.finish()
rclpy.shutdown()
"""


def test_a_thread_that_holds_the_interpreter_delays_no_message_and_no_request(monkeypatch):
    monkeypatch.setenv('ROS_DOMAIN_ID', str(free_domain()))
    found = subprocess.run([sys.executable, '-P', '-c', HELD], capture_output=True, text=True)
    ticks, level, taken, changing = found.stdout.splitlines()[-1].split()
    # Python's own ticks are none or one.
    assert int(ticks) > 20, found.stderr
    # The gait has changed, and the ramp is down, meanwhile.
    assert (float(level), taken, changing) == (0.0, 'True', 'False')
