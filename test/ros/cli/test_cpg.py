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

"""Executable cpg: a running generator asked, changed, recorded and played back."""

import os
import signal
import subprocess
import threading
import time

from bags import joint_state, write_bag
from cpg_ros.fitting.recordings.bag_reader import read_bag
from cpg_ros.ros.cli.graph import as_yaml
from diagnostic_msgs.msg import DiagnosticStatus, KeyValue
from graph import EXECUTABLE, free_domain, until
import numpy as np
import pytest
import rclpy
from rclpy.executors import SingleThreadedExecutor
from sensor_msgs.msg import Imu, JointState
from std_srvs.srv import Trigger
import yaml

CPG = EXECUTABLE.with_name('cpg')


def variables(domain, **more):
    return dict(os.environ, ROS_DOMAIN_ID=str(domain), **more)


def ask(domain, *words):
    """Ask with more patience than who types has: a loaded machine finds the graph late."""
    found = subprocess.run([CPG, '--wait', '60', *words], env=variables(domain), text=True,
                           capture_output=True, timeout=120, check=False)
    lines = [line for line in found.stderr.splitlines() if not line.startswith('cpg: waiting')]
    return found.returncode, found.stdout.strip(), '\n'.join(lines)


def completed(domain, line):
    """Return what a shell would complete a line with, by argcomplete's own protocol."""
    read, write = os.pipe()
    shell = subprocess.Popen(
        ['bash', '-c', f'exec 8>&{write} 9>/dev/null; exec {CPG}'], pass_fds=[write],
        env=variables(domain, _ARGCOMPLETE='1', COMP_LINE=line, COMP_POINT=str(len(line)),
                      _ARGCOMPLETE_IFS='\n', COMP_TYPE='9'), stdout=subprocess.DEVNULL)
    os.close(write)
    shell.wait(60)
    with os.fdopen(read) as told:
        return {word.strip() for word in told.read().split('\n') if word}


@pytest.fixture
def unhurried(running):
    """Return the session's generator, as fast as real time, and its watcher."""
    running[0].pace = 1.0
    return running


def test_parameters_and_topics_of_a_running_generator(unhurried):
    process, watcher = unhurried
    domain = process.domain
    assert ask(domain, 'gait', 'walk') == (0, '/cpg_generator: gait is walk', '')
    assert ask(domain, 'param', 'get', 'gait') == (0, 'walk', '')
    assert watcher.get('gait') == ['walk']
    # An integer for a double.
    assert ask(domain, 'param', 'set', 'frequency', '2') == (
        0, '/cpg_generator: frequency is 2', '')
    code, _, why = ask(domain, 'param', 'set', 'delayed.tau', '0.2')
    assert code == 1 and "below the walk's critical delay" in why and '\n' not in why
    code, told, _ = ask(domain, 'param', 'list')
    assert code == 0 and 'delayed.tau  delay between opposite legs' in told
    # A loaded machine takes longer to find the graph than the command waits.
    until(lambda: '/joint_states  sensor_msgs/msg/JointState' in ask(domain, 'topic', 'list')[1],
          'the topic')
    code, told, _ = ask(domain, 'topic', 'echo', '--once', 'joint_states')
    assert code == 0 and told.endswith('\n---')
    message = yaml.safe_load(told.removesuffix('---'))
    assert 'lf_calf_joint' in message['name'] and len(message['velocity']) == 12
    assert list(message['header']) == ['stamp', 'frame_id']
    # Latched: it was published before anybody asked.
    assert ask(domain, 'topic', 'echo', '--once', 'cpg_generator/gait')[:2] == (
        0, 'data: walk\n---')
    assert ask(domain, 'disable')[:2] == (0, 'ramping down over 1 s')
    # As the generator answers: this robot's file has no geometry.
    for action in ('sit', 'stand'):
        code, _, why = ask(domain, action)
        assert code == 1 and "robot file 'quadruped' has no geometry of the leg lh" in why
    assert ask(domain, 'enable')[:2] == (0, 'ramping up over 1 s')
    assert ask(domain, 'param', 'get', 'nothing')[::2] == (
        1, "cpg: /cpg_generator has no parameter 'nothing'")


def test_a_schedule_is_played(unhurried, tmp_path):
    process, watcher = unhurried
    path = tmp_path / 'gaits.yaml'
    robot, = watcher.get('robot')

    def plays(network, *entries):
        path.write_text(yaml.safe_dump({'network': network, 'robot': robot, 'schedule': [
            {'at': at, 'parameters': parameters} for at, parameters in entries]},
            sort_keys=False))
        return ask(process.domain, 'play-schedule', str(path), '--rate', '10')

    code, played, why = plays('delayed', (0.0, {'gait': 'walk', 'frequency': 1.5}),
                              (10.0, {'gait': 'trot', 'frequency': 2, 'delayed.tau': 0.45}))
    assert (code, why) == (0, '')
    assert [line.split() for line in played.splitlines()[:2]] == [
        ['0.00', 's', 'gait', 'walk,', 'frequency', '1.5'],
        ['10.00', 's', 'gait', 'trot,', 'frequency', '2,', 'delayed.tau', '0.45']]
    assert watcher.get('gait', 'frequency', 'delayed.tau') == ['trot', 2.0, 0.45]
    # All of an entry or none: a walk there is not.
    code, played, why = plays('delayed', (0.0, {'gait': 'walk', 'delayed.tau': 0.2}))
    assert (code, played) == (1, '') and "below the walk's critical delay" in why
    assert watcher.get('gait', 'delayed.tau') == ['trot', 0.45]
    code, played, why = plays('quadruped', (0.0, {'gait': 'walk'}))
    assert code == 2 and 'is for the network quadruped, and /cpg_generator runs delayed' in why
    assert f'start it with: generator --ros-args -p network:=quadruped -p robot:={robot}' in why


def test_a_shell_completes_actions_gaits_parameters_and_topics(unhurried):
    domain = unhurried[0].domain
    assert {'run', 'gait', 'param', 'record'} <= completed(domain, 'cpg ')
    # A loaded machine takes longer to find the graph than who types wants to wait.
    until(lambda: completed(domain, 'cpg gait tr') == {'trot'}, 'the gait')
    until(lambda: completed(domain, 'cpg param set delayed.ta') == {'delayed.tau'},
          'the parameter')
    until(lambda: '/joint_states' in completed(domain, 'cpg topic hz /joint'), 'the topic')


def test_what_is_recorded_is_what_the_generator_publishes(unhurried, tmp_path):
    process, watcher = unhurried
    domain, before = process.domain, watcher.node.count_subscribers('/joint_states')
    recorder = subprocess.Popen([CPG, 'record', tmp_path / 'bag', 'joint_states'],
                                env=variables(domain), text=True, stdout=subprocess.PIPE,
                                stderr=subprocess.PIPE)
    assert recorder.stderr.readline() == 'recording /joint_states\n'
    # A loaded machine takes longer than a moment to find the recorder.
    until(lambda: watcher.node.count_subscribers('/joint_states') > before, 'the recorder')
    time.sleep(2.0)
    assert not (tmp_path / 'bag').exists()
    # An impatient user, or timeout, which signals the process and its group.
    recorder.send_signal(signal.SIGINT)
    recorder.send_signal(signal.SIGTERM)
    told, errors = recorder.communicate(timeout=60)
    assert recorder.returncode == 0 and not errors and 'messages' in told
    # Nothing in it is hidden from a shell's *, or beside it.
    assert {one.name for one in (tmp_path / 'bag').iterdir()} == {'bag.mcap', 'metadata.yaml'}
    assert [one.name for one in tmp_path.iterdir()] == ['bag']
    recording = read_bag(tmp_path / 'bag', progress=False)
    assert len(recording.joints) == 12
    assert np.ptp(recording.positions, axis=0).max() > 0.1
    assert ask(domain, 'record', str(tmp_path / 'bag'))[::2] == (
        1, f'cpg: {tmp_path / "bag"}: already exists')


def test_a_bag_is_played_message_by_message(tmp_path):
    domain, start, step = free_domain(), 1_700_000_000_000_000_000, 20_000_000
    sent = [('/joint_states', start + k * step,
             joint_state(start + k * step, ['a'], [0.001 * k])) for k in range(200)]
    bag = write_bag(tmp_path / 'bag', sent)
    recorder = subprocess.Popen([CPG, 'record', tmp_path / 'again'], env=variables(domain),
                                text=True, stdout=subprocess.PIPE, stderr=subprocess.PIPE)
    code, told, _ = ask(domain, 'play', str(bag))
    assert (code, told) == (0, '/joint_states: 200 messages')
    recorder.send_signal(signal.SIGINT)
    recorder.communicate(timeout=60)
    heard = read_bag(tmp_path / 'again', progress=False)
    # The recorder joins while the first messages pass; from then on none is missing.
    angles = heard.positions[:, 0]
    assert len(angles) > 20 and np.allclose(np.diff(angles), 0.001)
    assert np.isclose(angles[-1], 0.199)


def test_run_starts_every_executable():
    code, told, _ = ask(free_domain(), 'run', 'analyze', '--help')
    assert code == 0 and told.startswith('usage: analyze')
    alone = subprocess.run([CPG, 'analyze', '--help'], text=True, capture_output=True, timeout=120,
                           check=True)
    assert alone.stdout.strip() == told


def test_without_an_action_it_lists_them():
    found = subprocess.run([CPG], text=True, capture_output=True, timeout=60, check=False)
    assert found.returncode == 2 and not found.stdout
    lines = found.stderr.splitlines()
    for start in ('gait  ', 'param  ', 'topic  ', 'record  ', 'run  '):
        line, = (one.strip() for one in lines if one.strip().startswith(start))
        assert len(line.split()) > 2


def test_messages_are_printed_as_yaml():
    angles = JointState(name=['a', 'b: c'], position=[0.1, float('nan')])
    assert as_yaml(angles) == (
        "header:\n  stamp:\n    sec: 0\n    nanosec: 0\n  frame_id: ''\nname:\n- a\n- 'b: c'\n"
        'position:\n- 0.1\n- .nan\nvelocity: []\neffort: []\n')
    assert yaml.safe_load(as_yaml(Imu()))['angular_velocity_covariance'] == [0.0] * 9
    status = DiagnosticStatus(level=b'\2', values=[KeyValue(key='age [ms]', value='1.0')])
    assert yaml.safe_load(as_yaml(status)) == {
        'level': 2, 'name': '', 'message': '', 'hardware_id': '',
        'values': [{'key': 'age [ms]', 'value': '1.0'}]}


def test_what_is_waited_for_is_named():
    domain = free_domain()
    for words, named in (
            (['param', 'get', 'gait', '--wait', '2'],
             'waiting for /cpg_generator (is a generator running?)'),
            (['--node', '/a', 'param', 'get', 'gait', '--wait', '2'], 'waiting for /a (is it '
             'running?)'),
            (['topic', 'echo', 'b', '--wait', '2'], 'waiting for /b (does anything publish it?)')):
        found = subprocess.run([CPG, *words], env=variables(domain), text=True,
                               capture_output=True, timeout=60, check=False)
        assert found.returncode == 1
        assert found.stderr.splitlines()[0] == f'cpg: {named}'
        assert len(found.stderr.splitlines()) == 2


def test_a_bridge_is_stopped_by_its_service():
    domain, context = free_domain(), rclpy.Context()
    rclpy.init(context=context, domain_id=domain)
    node = rclpy.create_node('unitree_bridge', context=context)
    executor = SingleThreadedExecutor(context=context)
    executor.add_node(node)
    answers = [(True, 'damping'), (True, 'damping'), (False, 'not before a start')]

    def stop(_, response):
        response.success, response.message = answers.pop(0)
        return response

    node.create_service(Trigger, '~/stop', stop)
    thread = threading.Thread(target=executor.spin, daemon=True)
    thread.start()
    try:
        assert ask(domain, 'call', '/unitree_bridge/stop') == (0, 'damping', '')
        assert ask(domain, 'call', 'stop', '--node', '/unitree_bridge') == (0, 'damping', '')
        assert ask(domain, 'call', '/unitree_bridge/stop') == (1, '', 'cpg: not before a start')
    finally:
        executor.shutdown()
        thread.join()
        rclpy.shutdown(context=context)


@pytest.mark.parametrize(('words', 'code', 'said'), [
    (['--wait', '0.2', 'call', '/b/stop'], 1, '/b does not answer (no service /b/stop)'),
    (['--wait', '0.2', 'param', 'get', 'gait'], 1, '/cpg_generator does not answer'),
    (['--wait', '0.2', 'topic', 'echo', 'joint_states'], 1, 'nobody publishes on /joint_states'),
    (['param', 'set', 'gait', '{a: 1}'], 2, "'{a: 1}' is not a parameter value"),
    (['--node', 'a b', 'gait', 'walk'], 2, 'Invalid service name'),
    (['topic', 'echo', 'a b'], 2, 'topic name must not contain'),
    (['play', '/nowhere'], 2, '/nowhere: no such bag'),
    (['play', '/nowhere', '--rate', '0'], 2, "'0' is not positive"),
    (['run', 'dance'], 2, 'dance'),
    (['dance'], 2, 'dance')])
def test_what_it_cannot_do_is_one_line(words, code, said):
    found = ask(free_domain(), *words)
    assert found[0] == code and not found[1]
    assert said in found[2] and '\n' not in found[2]
