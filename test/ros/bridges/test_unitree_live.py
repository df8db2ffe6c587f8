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

"""The bridge beside a stand-in robot and a real generator, as processes on a real ROS graph."""

import importlib.util
import math
import os
import signal
import time

from graph import free_domain, Process, until
import numpy as np
import pytest
from sensor_msgs.msg import BatteryState, Imu, JointState
from stand_in import StandIn
from std_msgs.msg import Float64MultiArray
from std_srvs.srv import Trigger
from unitree_faults import (
    BRIDGE,
    bridge_and_watchdog_killed,
    FAULTS_OF,
    inflict,
    mend,
    Stranger,
    Walk,
)

for name, how in (('unitree_go', "'make messages' has not been run"),
                  ('unitree_hg', "'make messages' has not been run"),
                  ('mujoco', 'the extra [sim] is not installed')):
    if importlib.util.find_spec(name) is None:
        pytest.skip(how, allow_module_level=True)

if not os.environ.get('CPG_REAL_TIME'):
    pytest.skip('a robot must not wait, and shared machines stall: set CPG_REAL_TIME=1 on one '
                'that keeps 500 Hz', allow_module_level=True)

#: A loaded machine stalls processes for longer than a robot could be left alone.
PATIENT = 'state_timeout:=0.2', 'target_timeout:=0.3'
needs_root = pytest.mark.skipif(os.geteuid() != 0, reason='only root can start what another user '
                                'runs')


@pytest.fixture(scope='module')
def walk():
    walk = Walk(*PATIENT)
    yield walk
    walk.end()


@pytest.fixture(scope='module')
def rack():
    walk = Walk(*PATIENT, model='g1')
    yield walk
    walk.end()


def test_from_lying_in_its_own_mode_to_walking_and_back():
    walk = Walk(*PATIENT, services=True)
    try:
        heard = {kind: [] for kind in (Imu, BatteryState, Float64MultiArray)}
        for kind, topic in ((Imu, 'imu'), (BatteryState, 'battery'),
                            (Float64MultiArray, 'foot_contacts')):
            walk.watcher.node.create_subscription(kind, topic, heard[kind].append, 100)
        walk.wait_for('rising')
        assert walk.robot.asked == [('motion_switcher', 1001), ('sport', 1005),
                                    ('motion_switcher', 1003), ('motion_switcher', 1001)]
        walk.walking()
        time.sleep(2.0)
        assert [phase for _, phase in walk.phases] == ['idle', 'rising', 'standing', 'following']
        assert walk.robot.body.base[2] > 0.2 and walk.robot.body.base[0] > 0.3
        assert not walk.robot.wrong
        # What is measured is published as robot_sim does.
        names, sample = walk.watcher.names, walk.watcher.samples[-1]
        assert names == list(walk.robot.robot.order)
        assert np.abs(np.array(sample[1]) - walk.robot.position).max() < 0.3
        assert heard[Imu][-1].orientation.w == pytest.approx(
            walk.robot.body.quaternion[0], abs=0.1)
        assert 50 < sum(heard[Float64MultiArray][-1].data) < 400
        until(lambda: heard[BatteryState], 'the battery')
        assert heard[BatteryState][0].percentage == pytest.approx(0.87)
        assert heard[BatteryState][0].voltage == pytest.approx(29.6)
        walk.bridge.signal(signal.SIGINT)
        assert walk.bridge.wait() == 0, walk.bridge.log
        assert [phase for _, phase in walk.phases][-2:] == ['sitting', 'damping']
        assert walk.robot.damped and walk.robot.body.base[2] < 0.16
        assert np.abs(walk.robot.velocity).max() < 0.5
    finally:
        walk.end()


def suffer(walk, fault, sits):
    walk.walking()
    try:
        _, sat, torque, step, upright = inflict(walk, fault)
        # Sitting down is done on the feet; who lets go in mid-stride may roll over.
        assert bool(sat) == sits and (upright or not sat)
        assert torque < 1.2
        return step
    finally:
        mend(walk)


@pytest.mark.parametrize('fault', FAULTS_OF['go2'], ids=lambda fault: fault.__name__)
def test_what_happens_on_a_fault(walk, fault):
    assert suffer(walk, fault, FAULTS_OF['go2'][fault][1] is not None) < 15.0


def test_torques_of_another_node_are_added_within_limits_and_end_with_it():
    walk = Walk(*PATIENT, 'feedforward:=0.1')
    publisher = walk.watcher.node.create_publisher(JointState, 'feedforward/joint_states', 1)

    def send(effort, seconds=0.2):
        """Send it for some time; return the torques of the last commands, N m."""
        end = time.monotonic() + seconds
        while time.monotonic() < end:
            if effort is not None:
                publisher.publish(JointState(name=['RL_calf_joint'], effort=[effort]))
            time.sleep(0.005)
        return walk.robot.tau.tolist()

    try:
        walk.wait_for('rising')
        assert not any(send(2.0))
        walk.walking()
        assert not any(send(None))
        rows = walk.robot.since(time.monotonic() - 0.5)
        calm = rows[1:, 3].max()
        began = time.monotonic()
        # Motors 0 to 11, FR FL RR RL: the last one.
        assert send(2.0) == pytest.approx([0.0] * 11 + [2.0])
        assert send(-500.0) == pytest.approx([0.0] * 11 + [-4.543])
        assert not any(send(math.nan))
        assert 'with nan N m' in walk.bridge.log
        assert send(2.0)[11] == pytest.approx(2.0)
        assert not any(send(None))
        # The 4.543 N m of the limit take 0.05 s, 25 commands.
        assert walk.robot.since(began)[:, 3].max() < calm + 1.0
        send(2.0)
        walk.call('stop')
        assert not any(send(2.0))
        walk.wait_for('damping')
        assert walk.robot.damped and not any(send(2.0)) and not walk.robot.wrong
    finally:
        walk.end()


@pytest.mark.parametrize('fault', FAULTS_OF['g1'], ids=lambda fault: fault.__name__)
def test_what_happens_on_a_fault_to_a_humanoid_in_its_rack(rack, fault):
    suffer(rack, fault, FAULTS_OF['g1'][fault][1] is not None)
    # Every command repeats mode_machine, the watchdog's, too.
    assert not rack.robot.wrong


def test_a_humanoid_follows_targets_only_once_it_is_sent_on(rack):
    rack.walking()
    rack.call('damp')
    rack.wait_for('damping').call('start')
    rack.wait_for('hanging')
    first = len(rack.robot.commands)
    until(lambda: len(rack.robot.commands) > first + 300, 'more commands')
    # The generator walks all the while; the first joint, the left hip, stays at its stand.
    assert np.ptp(rack.robot.commands[first:, 5]) < 1e-6 and rack.phase == 'hanging'
    rack.call('start')
    rack.wait_for('following')


def test_bridge_and_watchdog_killed_together_leave_the_last_command(walk):
    walk.walking()
    try:
        assert bridge_and_watchdog_killed(walk) == (0, True)
    finally:
        mend(walk)


@pytest.mark.parametrize('how', ['service', 'button'])
def test_stop_is_at_once(walk, how):
    walk.walking()
    if how == 'service':
        assert walk.watcher.call(Trigger, '/unitree_bridge/damp', Trigger.Request()).success
    else:
        walk.robot.buttons = 1 << 9
    walk.wait_for('damping')
    walk.robot.buttons = 0
    assert 'sitting' not in [phase for _, phase in walk.phases[-2:]]
    assert walk.robot.damped


def alone(*parameters, environment=None, domain=None):
    return Process(*(word for name in parameters for word in ('-p', name)), executable=BRIDGE,
                   environment=environment, domain=domain)


def test_another_bridge_on_the_computer_is_refused(walk):
    process = alone(domain=walk.domain)
    assert process.wait() == 1
    assert 'another bridge on this computer' in process.log and len(process.lines) == 1
    assert f': process {walk.bridge.pid} of user ' in process.log


@needs_root
def test_another_users_bridge_is_named():
    domain = free_domain()
    with Stranger('take', 'bridge', domain) as stranger:
        process = alone(domain=domain)
        assert process.wait() == 1
    assert f'process {stranger.pid} of user nobody' in process.log and len(process.lines) == 1


@needs_root
def test_another_users_watchdog_is_not_trusted():
    domain = free_domain()
    with Stranger('take', 'watchdog', domain) as stranger:
        robot = StandIn(domain)
        robot.start()
        process = alone('motion_switcher:=false', *PATIENT, domain=domain)
        try:
            process.wait_for('not started: the watchdog of this robot is process '
                             f'{stranger.pid} of user nobody, who is not the user of the '
                             'bridge')
            assert 'rising' not in process.log
        finally:
            process.end()
            robot.end()


def test_another_publisher_is_refused_and_sits_it_down(walk):
    from unitree_go.msg import LowCmd
    walk.walking()
    rival = walk.watcher.node.create_publisher(LowCmd, '/lowcmd', 1)
    walk.wait_for('sitting').wait_for('damping')
    assert 'another node commands the robot: /watcher' in walk.bridge.log
    answer = walk.watcher.call(Trigger, '/unitree_bridge/start', Trigger.Request())
    assert answer.success
    walk.bridge.wait_for('not started: another node commands the robot: /watcher')
    walk.watcher.destroy(rival)
    assert walk.robot.damped


def test_a_dry_run_sends_nothing(walk):
    walk.wait_for('damping')
    sent = walk.watcher.node.count_publishers('/lowcmd')
    process = alone('dry_run:=true', *PATIENT, 'own_publishers:=2', 'command:=forward_position',
                    domain=walk.domain)
    try:
        process.wait_for('standing: it has risen')
        process.wait_for('dry run: following, the largest torque would be')
        assert walk.watcher.node.count_publishers('/lowcmd') == sent
        assert 'ReleaseMode are not sent' in process.log
    finally:
        process.end()


def test_without_a_robot_it_says_what_to_look_at():
    process = alone()
    try:
        process.wait_for('not started: no LowState for 10 s: is the cable in')
    finally:
        process.end()
    assert process.wait() == 0


@pytest.mark.parametrize(('parameter', 'words'), [
    ('kp:=[200.0]', 'kp: 200 is not from 0 to 150'), ('robot:=goat', "no joint 'FR_hip_joint'"),
    ('kp:=high', "parameter kp must be a list of doubles, not 'high'"),
    ('model:=spot', "model 'spot' is not one of go2, go1, b2, g1, h1_2")])
def test_what_cannot_be_used_is_refused_in_one_line(parameter, words):
    process = alone(parameter)
    assert process.wait() == 1
    assert words in process.log and len(process.lines) == 1


def test_without_the_messages_one_line_says_how_to_get_them(tmp_path):
    (tmp_path / 'unitree_go').mkdir()
    (tmp_path / 'unitree_go' / '__init__.py').write_text("raise ImportError('not here')\n")
    path = os.pathsep.join([str(tmp_path), os.environ.get('PYTHONPATH', '')])
    process = alone(environment={'PYTHONPATH': path})
    assert process.wait() == 1
    assert "'make messages' builds them" in process.log and len(process.lines) == 1
