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

"""The generator's body: parameters, ``body_pose``, sitting, standing up, sitting at the end."""

import signal

from cpg_ros.motion.body_pose import BodyPose
from cpg_ros.motion.robot_file import load_robot
from geometry_msgs.msg import Point, Pose, Quaternion
from graph import Process, until, Watcher
import numpy as np
import pytest
from std_srvs.srv import SetBool, Trigger

GO2 = load_robot('unitree_go2')
BODY = BodyPose(GO2)
#: CURE: end of the message on a robot file without geometry.
CURE = '(part geometry: check_robot --make writes it, and tune)'
STAND = GO2.column('offset')[GO2.order_indices]


def angles(*pose):
    return BODY.angles(pose)[GO2.order_indices]


def ask(watcher, name):
    answer = watcher.call(Trigger, f'/cpg_generator/{name}', Trigger.Request())
    return answer.success, answer.message


@pytest.fixture
def go2(stepped):
    return stepped('-p', 'robot:=unitree_go2', '-p', 'ramp:=0.2', '-p', 'feedback.enabled:=false')


def comes_to(watcher, target, near=2e-3):
    """Wait for a pose of the joints, rad."""
    until(lambda: watcher.samples and np.abs(watcher.samples[-1][1] - target).max() < near,
          f'the pose {target}')


def enable(watcher, data):
    watcher.call(SetBool, '/cpg_generator/enable', SetBool.Request(data=data))


def test_the_body_follows_parameters_and_messages_within_limits(go2):
    generator, watcher = go2
    enable(watcher, False)
    assert watcher.set(**{'body.height': -0.05, 'body.roll': 0.1})[0].successful
    comes_to(watcher, angles(-0.05, 0.1, 0.0, 0.0))
    answer = watcher.set(**{'body.height': -0.4})[0]
    assert not answer.successful and answer.reason.startswith('body.height -0.4 m, body.roll')
    # A gait that does not fit into the pose is refused as well.
    answer = watcher.set(amplitude=3.0)[0]
    assert not answer.successful
    publisher = watcher.node.create_publisher(Pose, 'body_pose', 1)
    until(publisher.get_subscription_count, 'the generator')
    publisher.publish(Pose(position=Point(z=0.02), orientation=Quaternion(
        x=0.0, y=float(np.sin(0.05)), z=0.0, w=float(np.cos(0.05)))))
    comes_to(watcher, angles(0.02, 0.0, 0.1, 0.0))
    publisher.publish(Pose(position=Point(z=1.0), orientation=Quaternion()))
    generator.wait_for('body_pose ignored: body.height 1 m: the feet do not reach')
    watcher.record(1.0)
    comes_to(watcher, angles(0.02, 0.0, 0.1, 0.0))
    # The newest of messages and parameters counts.
    assert watcher.set(**{'body.roll': 0.0})[0].successful
    comes_to(watcher, angles(-0.05, 0.0, 0.0, 0.0))


def test_it_sits_stands_up_and_walks(go2):
    _, watcher = go2
    assert np.ptp(watcher.record(1.5)[1][-100:], axis=0).max() > 0.2
    assert ask(watcher, 'sit') == (True, 'sitting down')
    comes_to(watcher, angles(*BODY.seat))
    until(lambda: watcher.diagnostics and watcher.diagnostics[-1].message == 'sitting',
          'diagnostics')
    assert ask(watcher, 'stand')[0]
    comes_to(watcher, STAND)
    # From the seat into the gait: it stands first.
    assert ask(watcher, 'sit')[0]
    comes_to(watcher, angles(*BODY.seat))
    first = len(watcher.samples)
    enable(watcher, True)
    until(lambda: np.ptp([row[1] for row in watcher.samples[-100:]], axis=0).max() > 0.2
          and watcher.diagnostics[-1].message == 'running', 'the gait')
    path = np.array([row[1] for row in watcher.samples[first:]])
    seat, rise = np.abs(path - angles(*BODY.seat)).max(axis=1), np.abs(path - STAND).max(axis=1)
    assert rise[np.flatnonzero(seat > 0.3)].min() < 0.05


def test_robots_without_geometry_refuse_in_one_line(stepped):
    _, watcher = stepped('-p', 'robot:=goat')
    told = "robot file 'goat' has no geometry of the leg lh"
    assert ask(watcher, 'sit') == (False, f'{told} {CURE}')
    for values in ({'body.yaw': 0.1}, {'end': 'sit'}):
        answer = watcher.set(**values)[0]
        assert not answer.successful and 'has no geometry of the leg' in answer.reason
    assert '\n' not in answer.reason


def test_it_sits_before_it_ends():
    generator = Process('-p', 'robot:=unitree_go2', '-p', 'end:=sit')
    watcher = Watcher(generator.domain)
    try:
        watcher.record(1.5)
        generator.signal(signal.SIGINT)
        assert generator.wait() == 0
        assert 'sitting down before the end' in generator.log
        until(lambda: watcher.samples, 'the last joint states')
        assert watcher.samples[-1][1] == pytest.approx(angles(*BODY.seat), abs=0.03)
    finally:
        watcher.end()
        generator.end()
