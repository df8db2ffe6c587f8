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

"""Torques of another node, which motors add to those of their targets."""

import importlib.util
import math
from pathlib import Path
import re
import threading

from cpg_ros.motion.robot_file import read_robot
from cpg_ros.ros import command_topics
from cpg_ros.ros.command_topics import FeedforwardSubscription
from graph import EXECUTABLE, Process, until, Watcher
import numpy as np
import pytest
from sensor_msgs.msg import JointState

WALKER = Path(__file__).parents[1] / 'data' / 'walker.yaml'
TOPIC = 'feedforward/joint_states'


class Wire:
    """A topic whose messages are put there by the test, and the node that warns of them."""

    topic = TOPIC

    def __init__(self, *_) -> None:
        self.message, self.warnings = None, []

    def newest(self):
        message, self.message = self.message, None
        return message

    def get_logger(self):
        return self

    def warning(self, text, **_):
        self.warnings.append(text)


@pytest.fixture
def received(monkeypatch):
    """Return a function of the time, s, and of joints with efforts that arrive then."""
    monkeypatch.setattr(command_topics, 'PolledSubscription', Wire)
    node = Wire()
    subscription = FeedforwardSubscription(node, ('hip', 'knee'), np.array([10.0, 20.0]))

    def at(now, names=None, efforts=(), active=True):
        if names is not None:
            subscription._subscription.message = JointState(name=names, effort=efforts)
        return subscription.receive(now, active).tolist()

    at.warnings = node.warnings
    return at


def test_torques_rise_within_a_twentieth_of_a_second_up_to_the_limit(received):
    assert received(1.0, ['knee'], [8.0]) == [0.0, 0.0]
    # 20 N m in 0.05 s are 4 N m in 0.01 s.
    assert received(1.01, ['knee'], [8.0]) == pytest.approx([0.0, 4.0])
    assert received(1.02, ['knee'], [8.0]) == pytest.approx([0.0, 8.0])
    assert received(1.03, ['knee', 'hip'], [1e9, -1e9]) == pytest.approx([-2.0, 12.0])
    assert received(1.07, ['knee', 'hip'], [1e9, -1e9]) == pytest.approx([-10.0, 20.0])


def risen(received):
    received(1.0, ['hip'], [5.0])
    assert received(1.04, ['hip'], [5.0]) == [5.0, 0.0]


def test_they_fall_to_zero_when_nobody_sends_any_more(received):
    risen(received)
    assert received(1.08) == [5.0, 0.0]
    assert received(1.10) == pytest.approx([1.0, 0.0])
    assert received(1.12) == [0.0, 0.0]
    # Nor do they come back where time jumps back.
    assert received(0.5) == [0.0, 0.0]
    assert received(0.6) == [0.0, 0.0]


def test_they_fall_to_zero_when_they_may_not_act(received):
    risen(received)
    assert received(1.05, ['hip'], [5.0], active=False) == pytest.approx([3.0, 0.0])
    assert received(1.07, ['hip'], [5.0], active=False) == [0.0, 0.0]


@pytest.mark.parametrize(('names', 'efforts', 'words'), [
    (['knee', 'hip'], [1.0, math.nan], "joint 'hip' with nan N m"),
    (['knee'], [-math.inf], "joint 'knee' with -inf N m"),
    (['knee'], [], '0 efforts for 1 joints'),
    (['knee', 'knee'], [1.0, 1.0], "joint 'knee' is there twice"),
    (['ankle'], [1.0], "joint 'ankle' is not one of hip, knee")])
def test_a_message_that_is_wrong_anywhere_counts_as_zero(received, names, efforts, words):
    risen(received)
    received(1.05, names, efforts)
    assert received(1.10, names, efforts) == [0.0, 0.0]
    assert received.warnings[0] == f'ignored: {TOPIC}: {words}'


class Sender(threading.Thread):
    """Sends efforts a hundred times a second, as ROS would on a graph; None for silence."""

    def __init__(self, watcher):
        super().__init__(daemon=True)
        self.efforts, self._over = None, threading.Event()
        self._publisher = watcher.node.create_publisher(JointState, TOPIC, 1)
        self.start()
        until(self._publisher.get_subscription_count, 'a listener to torques')

    def run(self):
        while not self._over.wait(0.01):
            if (efforts := self.efforts) is not None:
                self._publisher.publish(JointState(name=list(efforts),
                                                   effort=list(efforts.values())))

    def end(self):
        self._over.set()
        self.join()


@pytest.mark.skipif(importlib.util.find_spec('mujoco') is None, reason='no MuJoCo')
def test_a_simulated_robots_motors_add_them_within_their_limits():
    robot = read_robot(WALKER)
    stand = robot.column('offset')[robot.order_indices]
    process = Process('-p', f'robot:={WALKER}', '-p', 'feedforward:=0.25',
                      executable=EXECUTABLE.with_name('robot_sim')).wait_for('simulating')
    kp, kd = (float(re.search(rf'{name} ([\d.]+) N m', process.log)[1]) for name in ('kp', 'kd'))
    watcher = Watcher(process.domain, '/robot_sim')
    efforts = []
    watcher.node.create_subscription(JointState, 'joint_states', efforts.append, 100)
    sender = Sender(watcher)

    def added():
        """Return what the motors add to kp (stand - angle) - kd speed, N m, of all joints."""
        message = efforts[-1]
        return (np.array(message.effort) - kp * (stand - message.position)
                + kd * np.array(message.velocity))

    def wait(joint, torque):
        wanted = np.zeros(12)
        wanted[list(robot.order).index(joint)] = torque
        # An instant passes between torque and angle: a robot that rests is compared.
        until(lambda: efforts and np.abs(added() - wanted).max() < 0.3, f'{torque} N m')

    try:
        wait('FL_calf_joint', 0.0)
        sender.efforts = {'FL_calf_joint': 3.0}
        wait('FL_calf_joint', 3.0)
        # A quarter of the motor's 23.7 N m.
        sender.efforts = {'FR_hip_joint': -1000.0}
        wait('FR_hip_joint', -23.7 / 4)
        sender.efforts = {'FL_calf_joint': 3.0, 'FR_hip_joint': math.nan}
        wait('FL_calf_joint', 0.0)
        process.wait_for("ignored: .*joint 'FR_hip_joint' with nan N m")
        sender.efforts = {'FL_calf_joint': 3.0}
        wait('FL_calf_joint', 3.0)
        sender.efforts = None
        wait('FL_calf_joint', 0.0)
    finally:
        for one in (sender, watcher, process):
            one.end()
