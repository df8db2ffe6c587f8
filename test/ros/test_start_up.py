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

"""How a generator begins: silent until it is enabled, then from where the robot's joints are."""

import signal
import time

from cpg_ros.motion.pattern import Pattern
from cpg_ros.motion.plan import plan
from cpg_ros.motion.robot_file import load_robot
from cpg_ros.networks.registry import PRESETS
from diagnostic_msgs.msg import DiagnosticStatus
from graph import Process, until, Watcher
from lifecycle_msgs.msg import Transition
from lifecycle_msgs.srv import ChangeState
import numpy as np
import pytest
from rclpy.qos import QoSProfile
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64MultiArray
from std_srvs.srv import SetBool
from stepped import refused
from trajectory_msgs.msg import JointTrajectory

ROBOT = load_robot('quadruped')
STAND = np.tile([0.0, 0.8, -1.5], 4)
CROUCH = np.tile([0.2, 1.6, -2.4], 4)
COMMANDS = 'forward_position_controller/commands'


def heard(watcher, *topics):
    """Return a list of (topic, message) that grows as messages arrive."""
    rows = []
    for kind, topic in topics:
        watcher.node.create_subscription(
            kind, topic, lambda message, topic=topic: rows.append((topic, message)),
            QoSProfile(depth=5000))
    return rows


def enable(watcher, wanted):
    return watcher.call(SetBool, '/cpg_generator/enable', SetBool.Request(data=wanted))


def test_it_publishes_nothing_until_it_is_enabled(stepped):
    _, watcher = stepped('-p', 'autostart:=false', '-p', 'command:=forward_position',
                         '-p', 'assume_stand:=true')
    rows = heard(watcher, (Float64MultiArray, COMMANDS), (JointState, 'lh/joint_states'))
    until(lambda: watcher.node.count_publishers(COMMANDS), 'a publisher')
    until(lambda: len(watcher.diagnostics) >= 2, 'diagnostics')
    assert enable(watcher, False).message == 'nothing is published yet'
    for status in watcher.diagnostics:
        assert status.level == DiagnosticStatus.WARN
        assert status.message == 'nothing is published: waiting for ~/enable'
    assert not (rows or watcher.samples or watcher.phases)
    answer = enable(watcher, True)
    assert answer.message == 'ramping up over 1 s from the stand'
    _, positions, _ = watcher.record(2.5)
    assert positions[0] == pytest.approx(STAND, abs=1e-3)
    assert np.ptp(positions, axis=0).max() > 0.4
    assert {topic for topic, _ in rows} == {COMMANDS, 'lh/joint_states'}
    # From now on it stands where it is disabled.
    assert enable(watcher, False).success
    until(lambda: not np.any(watcher.samples[-1][2]), 'the stand')


def test_a_silent_one_ends_without_a_word(start):
    process, watcher = start('-p', 'autostart:=false')
    process.signal(signal.SIGTERM)
    assert process.wait() == 0
    assert not watcher.samples and 'Traceback' not in process.log


@pytest.fixture
def measured(start):
    """Start a generator on whose robot's joint states somebody else publishes."""
    def begin(names, angles, *more):
        _, watcher = start('-p', 'autostart:=false', '-p', 'combined_topic:=""', '-p',
                           'rate:=200', '-p', 'command:=forward_position', *more)
        rows = heard(watcher, (Float64MultiArray, COMMANDS))
        publisher = watcher.node.create_publisher(JointState, 'joint_states', 10)
        until(publisher.get_subscription_count, 'the generator listening')
        message = JointState(name=names, position=angles)
        watcher.node.create_timer(0.02, lambda: publisher.publish(message))
        time.sleep(0.2)
        return watcher, rows
    return begin


def test_it_begins_at_the_measured_pose(measured):
    # In an order of the robot's own.
    watcher, rows = measured(list(ROBOT.order)[::-1], CROUCH[::-1].tolist())
    assert enable(watcher, True).message == 'ramping up over 1 s from the measured pose'
    until(lambda: len(rows) > 500, 'commands')
    sent = np.array([message.data for _, message in rows])
    assert sent[0] == pytest.approx(CROUCH, abs=1e-3)
    assert np.abs(np.diff(sent, axis=0)).max() < 0.005 * 6.0
    middle = 0.5 * (sent[-200:].min(axis=0) + sent[-200:].max(axis=0))
    # Thighs swing by 0.25 rad either way about the stand.
    assert middle[1::3] == pytest.approx(STAND[1::3], abs=0.01)
    assert np.ptp(sent[-200:, 1::3], axis=0) == pytest.approx(0.5, abs=0.02)


@pytest.fixture
def driver(stepped):
    """Start a generator that commands a robot, and what the robot's driver does beside it.

    The time of these tests waits for joint_states of the generator: the robot's are elsewhere.
    """
    def begin(*more, command='forward_position', topic=COMMANDS, kind=Float64MultiArray):
        generator, watcher = stepped('-p', 'combined_topic:=""', '-p', f'command:={command}',
                                     '-p', 'measured_topic:=measured', *more)
        rows = heard(watcher, (kind, topic))
        until(lambda: watcher.node.count_publishers(topic), 'its publisher')
        publisher = watcher.node.create_publisher(JointState, 'measured', 10)
        until(publisher.get_subscription_count, 'the generator listening')
        message = JointState()
        watcher.node.create_timer(0.02, lambda: message.name and publisher.publish(message))

        def measure(names, angles):
            message.position = list(angles)
            message.name = list(names)
        return generator, watcher, rows, measure
    return begin


@pytest.mark.parametrize('command', ['forward_position', 'joint_trajectory'])
def test_the_first_command_is_where_the_robot_is(driver, command):
    topic, kind = {'forward_position': (COMMANDS, Float64MultiArray), 'joint_trajectory': (
        'joint_trajectory_controller/joint_trajectory', JointTrajectory)}[command]
    generator, watcher, rows, measure = driver(command=command, topic=topic, kind=kind)
    # It waits for the whole pose, and says so.
    generator.wait_for('waiting: the pose is not known, and the joints must not jump: no joint '
                       'states on /measured')
    measure(ROBOT.order[1:], CROUCH[1:])
    generator.wait_for(f'waiting: .*: /measured has no angle of {ROBOT.order[0]}')
    until(lambda: any(status.message == 'nothing is published: waiting for the measured pose on '
                      '/measured' for status in watcher.diagnostics), 'the warning')
    assert not rows
    measure(ROBOT.order, CROUCH)
    generator.wait_for('beginning from the measured pose')
    until(lambda: len(rows) > 100, 'commands')
    sent = np.array([message.data if command == 'forward_position' else
                     message.points[0].positions for _, message in rows])
    assert sent[0] == pytest.approx(CROUCH, abs=2e-3)
    assert np.abs(np.diff(sent, axis=0)).max() < 0.01 * 6.0


def test_a_stop_ends_the_wait_for_the_pose(driver):
    generator, watcher, rows, measure = driver()
    generator.wait_for('waiting: ')
    assert enable(watcher, False).success
    measure(ROBOT.order, CROUCH)
    count = len(watcher.diagnostics)
    until(lambda: len(watcher.diagnostics) >= count + 2, 'diagnostics')
    assert not rows
    assert watcher.diagnostics[-1].message == 'nothing is published: waiting for ~/enable'
    assert enable(watcher, True).message == 'ramping up over 1 s from the measured pose'
    until(rows.__len__, 'commands')
    assert np.array(rows[0][1].data) == pytest.approx(CROUCH, abs=2e-3)


def test_without_a_measured_pose_it_is_not_enabled(driver):
    _, watcher, rows, measure = driver('-p', 'autostart:=false')
    why = 'the pose is not known, and the joints must not jump: '
    for names, reason in (((), 'no joint states on /measured'),
                          (ROBOT.order[1:], f'/measured has no angle of {ROBOT.order[0]}')):
        measure(names, CROUCH[:len(names)])
        until(lambda reason=reason: enable(watcher, True).message == why + reason, 'the reason')
        assert not enable(watcher, True).success and not rows


def test_a_managed_one_is_not_configured_without_a_measured_pose(driver):
    generator, watcher, rows, measure = driver('-p', 'managed:=true')
    configure = ChangeState.Request(transition=Transition(id=Transition.TRANSITION_CONFIGURE))
    change = '/cpg_generator/change_state'
    assert not watcher.call(ChangeState, change, configure).success and not rows
    generator.wait_for('configure: refused: the pose is not known')
    measure(ROBOT.order, CROUCH)
    until(lambda: watcher.call(ChangeState, change, configure).success, 'its configuration')
    until(rows.__len__, 'commands')
    assert np.array(rows[0][1].data) == pytest.approx(CROUCH, abs=2e-3)


@pytest.mark.parametrize(('words', 'reason'), [
    ((), "measured_topic 'joint_states' is the generator's own: set combined_topic to ''"),
    (('-p', 'measured_topic:=""'), "measured_topic is ''")])
def test_a_pose_that_cannot_be_measured_is_refused_at_start(words, reason):
    assert refused('-p', 'command:=forward_position', *words) == (
        f"command 'forward_position' begins at the measured pose, but {reason}, or set "
        'assume_stand to true if nothing measures the joints')


@pytest.mark.parametrize('time', [0.0, 1.0, 3.0])
@pytest.mark.parametrize('enabled', [True, False])
def test_joints_are_led_from_where_they_are_within_their_limits(time, enabled):
    preset, dt = PRESETS['delayed']['trot'], 0.002
    one = plan(ROBOT, 'trot', preset, preset.network, 2.0)
    pattern = Pattern(one, 1.0, enabled)
    start = np.array([joint.lower for joint in ROBOT.joints])
    pattern.start_from(start, time)
    rows = [(pattern.position.copy(), pattern.velocity.copy())]
    assert not pattern.standing
    for _ in range(3000):
        pattern.advance(dt)
        rows.append((pattern.position.copy(), pattern.velocity.copy()))
    positions, velocities = map(np.array, zip(*rows, strict=True))
    limit = ROBOT.column('velocity')
    assert np.array_equal(positions[0], start)
    assert (np.abs(np.diff(positions, axis=0)) <= limit * dt).all()
    error = np.abs(np.diff(positions, axis=0) / dt - 0.5 * (velocities[1:] + velocities[:-1]))
    assert error.max() < 0.05 * limit.min() and not pattern.held
    assert pattern.standing is not enabled
    if not enabled:
        assert np.abs(positions[-1] - ROBOT.column('offset')).max() < 1e-12


@pytest.mark.parametrize('seen', [False, True])
def test_silence_is_not_ok(start, seen):
    from rosgraph_msgs.msg import Clock
    process, watcher = start('-p', 'use_sim_time:=true')
    said = 'no /clock yet'
    if seen:
        clock = watcher.node.create_publisher(Clock, '/clock', 10)
        until(clock.get_subscription_count, 'a listener to /clock')
        message = Clock()

        def tick():
            nanoseconds = message.clock.nanosec + 10_000_000
            message.clock.sec += nanoseconds // 1_000_000_000
            message.clock.nanosec = nanoseconds % 1_000_000_000
            clock.publish(message)
            return len(watcher.samples) >= 20
        until(tick, 'joint states')
        said = 'simulated time is still '
    until(lambda: any(s.level == DiagnosticStatus.WARN and s.message.startswith(
        f'nothing is published: {said}') for s in watcher.diagnostics), 'the warning')
    # It stays so.
    count = len(watcher.diagnostics)
    until(lambda: len(watcher.diagnostics) >= count + 2, 'diagnostics')
    assert all(s.level != DiagnosticStatus.OK for s in watcher.diagnostics[count:])
    assert process.alive


@pytest.mark.deep
def test_a_first_start_announces_what_it_compiles_before_it_does(tmp_path):
    generator = Process('-p', 'robot:=unitree_go2', '-p', 'combined_topic:=""', '-p',
                        'command:=forward_position', '-p', 'feedback.enabled:=true',
                        environment={'NUMBA_CACHE_DIR': str(tmp_path)})
    watcher = Watcher(generator.domain)
    try:
        generator.wait_for('compiling the feedback: about 35 s, only at its first start')
        assert 'compiled in' not in generator.log
        # And says so once a second to whoever looks.
        until(lambda: any(status.name == '/cpg_generator: start' and status.message.startswith(
            'compiling the feedback, ') for status in watcher.diagnostics), 'its progress')
    finally:
        watcher.end()
        generator.end()
