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

"""A humanoid over the graph: generator and robot_sim make it stand, walk, run and fall."""

import importlib.util
import json
import os
import re
import signal
import subprocess

from geometry_msgs.msg import Twist, Wrench
from graph import EXECUTABLE, free_domain, Process, until, Watcher
from nav_msgs.msg import Odometry
import pytest
from std_srvs.srv import Trigger

if importlib.util.find_spec('mujoco') is None:
    pytest.skip('the extra [sim] is not installed', allow_module_level=True)

SIMULATED = ('-p', 'robot:=humanoid', '-p', 'model:=humanoid', '-p', 'real_time_factor:=0.0', '-p',
             'friction:=0.6', '-p', 'imu_delay:=0.004', '-p', 'joint_delay:=0.004', '-p',
             'gyroscope_noise:=0.02', '-p', 'accelerometer_noise:=0.1', '-p', 'force_noise:=0.05')
GENERATED = ('-p', 'robot:=humanoid', '-p', 'network:=biped', '-p', 'rate:=500.0', '-p',
             'use_sim_time:=true', '-p', "combined_topic:=''", '-p', 'cmd_vel:=true', '-p',
             'cmd_vel_timeout:=60.0')


class Stage:
    """A simulated humanoid, its generator, and who drives it."""

    def __init__(self):
        domain = free_domain()
        self.body = Process(*SIMULATED, domain=domain,
                            executable=EXECUTABLE.with_name('robot_sim'))
        self.generator = Process(*GENERATED, domain=domain)
        self.watcher = Watcher(domain)
        node = self.watcher.node
        self.places = []
        node.create_subscription(Odometry, 'odom', lambda message: self.places.append((
            message.header.stamp.sec + 1e-9 * message.header.stamp.nanosec,
            message.pose.pose.position.x, message.twist.twist.linear.x)), 1000)
        self._walk = node.create_publisher(Twist, 'cmd_vel', 10)
        self._push = node.create_publisher(Wrench, 'robot_sim/push', 10)

    def drive(self, speed):
        message = Twist()
        message.linear.x = speed
        until(lambda: self._walk.get_subscription_count(), 'a reader of cmd_vel')
        self._walk.publish(message)

    def push(self, sideways):
        message = Wrench()
        message.force.y = sideways
        self._push.publish(message)

    def pass_time(self, seconds):
        """Let simulated time pass; return the mean speed forward in it, m/s."""
        until(lambda: self.places, 'the robot')
        first = len(self.places) - 1
        begin = self.places[first][0]
        until(lambda: self.places[-1][0] > begin + seconds, f'{seconds} s')
        speeds = [place[2] for place in self.places[first:]]
        return sum(speeds) / len(speeds)

    def end(self):
        self.watcher.end()
        self.generator.end()
        self.body.end()


@pytest.fixture
def stage():
    made = Stage()
    yield made
    made.end()


def test_it_walks_by_cmd_vel_survives_a_push_falls_and_is_reset(stage):
    # The sensors are judged first.
    stage.pass_time(2.0)
    stage.drive(0.3)
    stage.pass_time(2.0)
    assert stage.pass_time(1.2) == pytest.approx(0.3, abs=0.04)
    refused = stage.watcher.set(gait='skip')[0]
    assert not refused.successful and 'skip' in refused.reason
    stage.push(200.0)  # 20 N s
    stage.pass_time(2.0)
    stage.drive(0.0)
    stage.pass_time(2.0)
    assert stage.pass_time(0.6) == pytest.approx(0.0, abs=0.03)
    assert 'fallen' not in stage.body.log
    stage.push(1500.0)
    stage.body.wait_for('the robot has fallen')
    stage.watcher.call(Trigger, '/robot_sim/reset', Trigger.Request())
    stage.body.wait_for('standing at the origin')
    stage.drive(0.3)
    stage.pass_time(5.0)
    assert stage.pass_time(0.6) == pytest.approx(0.3, abs=0.06)
    assert len(re.findall('the robot has fallen', stage.body.log)) == 1
    # Joints that lay on the ground follow again.
    until(lambda: stage.watcher.diagnostics[-1].message == 'running', 'all joints to follow')
    # What is held is measured, too.
    assert 'waist_joint' in stage.watcher.names


def test_ctrl_c_in_a_walk_leaves_it_crouching(stage):
    stage.pass_time(0.5)
    stage.drive(0.3)
    stage.pass_time(3.0)
    stage.generator.signal(signal.SIGINT)
    assert stage.generator.wait() == 0
    assert 'crouching before the end' in stage.generator.log
    # Nobody commands any more.
    stage.pass_time(2.0)
    assert 'fallen' not in stage.body.log
    assert stage.pass_time(0.5) == pytest.approx(0.0, abs=0.02)


@pytest.mark.deep
def test_its_walk_and_its_run_come_back_from_bags(stage, tmp_path):
    stage.pass_time(1.0)
    for gait, speed, rate in (('walk', 0.3, 1.65), ('run', 0.5, 2.2)):
        assert stage.watcher.set(gait=gait)[0].successful
        stage.drive(speed)
        stage.pass_time(3.0)
        environment = {**os.environ, 'ROS_DOMAIN_ID': str(stage.generator.domain)}
        recorder = subprocess.Popen(
            [EXECUTABLE.with_name('cpg'), 'record', tmp_path / gait, 'joint_states',
             'foot_contacts'], env=environment, stderr=subprocess.PIPE, text=True)
        assert stage.pass_time(8.0) == pytest.approx(speed, abs=0.05)
        recorder.send_signal(signal.SIGINT)
        assert recorder.wait(20.0) == 0, recorder.stderr.read()
        said = json.loads(subprocess.run(
            [EXECUTABLE.with_name('inversion'), '--bag', tmp_path / gait, '--robot', 'humanoid',
             '--json'], env=environment, stdout=subprocess.PIPE, text=True, check=True).stdout)
        assert (said['network'], said['gait'], said['recognised']) == ('biped', gait, gait)
        assert said['confidence'] > 0.95
        assert said['frequency'] == pytest.approx(rate, abs=0.02)
        assert any('by the loads on the feet' in note for note in said['notes'])
