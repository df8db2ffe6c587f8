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

"""Round trips over the real graph: recorded to a bag and run again, and fitted live."""

import json
import os
from pathlib import Path
import signal
import subprocess
import sys

from depth import in_depth
from graph import EXECUTABLE, PATIENCE, Process, SimulatedTime, until, Watcher
import numpy as np
import pytest
from rcl_interfaces.srv import SetParameters, SetParametersAtomically
from rclpy.parameter import Parameter
from rclpy.qos import DurabilityPolicy, QoSProfile
from std_msgs.msg import String
from std_srvs.srv import Trigger
import yaml

INVERSION = EXECUTABLE.with_name('inversion')
RECORDER = Path(__file__).parents[1] / 'support' / 'recorder.py'


@pytest.fixture
def ending():
    """Yield processes and watchers that are ended with the test."""
    started = []
    yield started
    for one in reversed(started):
        one.end()


def angles_at(times, positions, names, joint, instants):
    """Return a joint's angle at instants, by linear interpolation."""
    return np.interp(instants, times, positions[:, names.index(joint)])


def gaps_in_step(watcher, again, period):
    """Return how far joints differ after one shift of time for all, shape (instants, joints).

    Args:
        watcher: names, and samples (times, positions).
        again: the same of what moved later.
        period: of the strides, s.

    """
    (names, (times, positions)), (others, (later, angles)) = watcher, again
    instants = np.arange(0.0, times[-1] - times[0] - period - 0.11, 0.01)
    spans = np.ptp(positions, axis=0)

    def gaps(shift):
        return np.stack([np.abs(
            angles_at(times, positions, names, joint, times[0] + shift % period + instants)
            - angles_at(later, angles, others, joint, later[0] + instants))
            / spans[names.index(joint)] for joint in names
            if spans[names.index(joint)] > 0.01], axis=1)
    best = min(np.linspace(0.0, period, 171), key=lambda shift: gaps(shift).max())
    return gaps(min(best + np.linspace(-0.005, 0.005, 201), key=lambda one: gaps(one).max()))


@pytest.mark.parametrize(('network', 'gait', 'topics'), [
    ('quadruped', 'pace', tuple(f'/{leg}/joint_states' for leg in ('lh', 'rh', 'lf', 'rf'))),
    *in_depth(('delayed', 'walk', ('/joint_states',)))])
def test_a_gait_recorded_inverted_and_run_again_is_the_same(ending, tmp_path, network, gait,
                                                            topics):
    # Generator, recorder process, inversion of the bag, a second generator with the result. In
    # simulated time: by the wall clock, a generator on a busy machine leaves periods out.
    timing = ('-p', 'use_sim_time:=true', '-p', 'rate:=100.0')
    first = Process('-p', f'network:={network}', '-p', f'gait:={gait}', '-p', 'frequency:=1.7',
                    *timing)
    ending.append(first)
    first.wait_for('publishing')
    watcher = Watcher(first.domain)
    ending.append(watcher)
    clock = SimulatedTime(watcher)
    clock.run(100.0, 103.0)
    bag = tmp_path / 'bag'
    environment = dict(os.environ, ROS_DOMAIN_ID=str(first.domain))
    recorder = subprocess.Popen([sys.executable, str(RECORDER), str(bag), *topics],
                                env=environment, stdout=subprocess.PIPE, text=True)
    assert recorder.stdout.readline() == 'listening\n'
    assert recorder.stdout.readline() == 'recording\n'
    began = len(watcher.samples)
    clock.lead(103.0, 110.0, 0.01)
    recorder.send_signal(signal.SIGINT)
    assert recorder.wait(PATIENCE) == 0
    times, positions, _ = (np.array(part) for part in zip(*watcher.samples[began:], strict=True))
    names = watcher.names

    out = tmp_path / 'fitted.yaml'
    ended = subprocess.run([str(INVERSION), '--bag', str(bag), '--network', network, '--out',
                            str(out), '--json'], capture_output=True, text=True, timeout=300)
    assert ended.returncode == 0, ended.stderr
    said = json.loads(ended.stdout)
    assert said['gait'] == gait and said['frequency'] == pytest.approx(1.7, rel=2e-3)

    second = Process('--params-file', str(out), *timing)
    ending.append(second)
    second.wait_for('publishing')
    again = Watcher(second.domain)
    ending.append(again)
    clock = SimulatedTime(again)
    clock.run(100.0, 103.0)
    began = len(again.samples)
    clock.lead(103.0, 111.0, 0.01)
    later, angles, _ = (np.array(part) for part in zip(*again.samples[began:], strict=True))

    # They were started at different instants: in step after one shift of time, for all joints
    # and the whole of the recording.
    found = gaps_in_step((names, (times, positions)), (again.names, (later, angles)),
                         1.0 / 1.7).max()
    # One per cent of range.
    assert found < 0.01


def test_live_fits_on_call_written_and_applied(ending, tmp_path):
    # In simulated time: a generator that a busy machine holds up goes on from where it stood, so
    # that by the wall clock its strides are longer than asked for.
    simulated = ('-p', 'use_sim_time:=true')
    source = Process('-p', 'gait:=trot', '-p', 'frequency:=2.0', '-p', 'rate:=100.0', *simulated)
    ending.append(source)
    source.wait_for('publishing')
    follower = Process('-p', 'gait:=pace', '-p', 'frequency:=1.0', '--ros-args', '-r',
                       '__node:=other', '-r', '__ns:=/second', domain=source.domain)
    ending.append(follower)
    out, report = tmp_path / 'fitted.yaml', tmp_path / 'report.html'
    node = Process('-p', f'out:={out}', '-p', f'report:={report}', '-p', 'window:=4.0', '-p',
                   'apply_to:=/second/other', *simulated,
                   domain=source.domain, executable=INVERSION)
    ending.append(node)
    node.wait_for('listening to /joint_states')
    follower.wait_for('publishing')
    watcher = Watcher(source.domain, '/second/other')
    ending.append(watcher)
    heard = Watcher(source.domain)
    ending.append(heard)
    clock = SimulatedTime(heard, listeners=2)
    clock.run(100.0, 103.0)
    results = []
    watcher.node.create_subscription(
        String, '/cpg_inversion/result', lambda message: results.append(message.data),
        QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL))

    early = watcher.call(Trigger, '/cpg_inversion/fit', Trigger.Request())
    assert early.success or early.message
    clock.lead(103.0, 108.0, 0.01)
    # No source any more, as after a bag has been played: what was heard is fitted all the same.
    source.end()
    clock.run(108.0, 109.0)
    answer = watcher.call(Trigger, '/cpg_inversion/fit', Trigger.Request())
    assert answer.success, answer.message
    for words in ('trot at 2.0', 'mean RMS error', f'written: {out}',
                  'applied to /second/other: gait, frequency and network, not the readout',
                  f'start it with --params-file {out}'):
        assert words in answer.message
    tree = yaml.safe_load(out.read_text())['/**']['ros__parameters']
    until(lambda: 'trot' in watcher.gaits, 'the gait of the generator that was set')
    frequency, c, tau = watcher.get('frequency', 'delayed.c', 'delayed.tau')
    assert frequency == pytest.approx(2.0, rel=2e-3)
    assert (c, tau) == pytest.approx((tree['delayed']['c'], tree['delayed']['tau']))
    until(lambda: results, 'the result as JSON')
    said = json.loads(results[-1])
    assert said['gait'] == 'trot' and said['rms_share'] < 0.02
    assert said['params'] == tree['delayed']

    # A generator's joint states have no efforts. Whole numbers are doubles, too.
    assert watcher.call(SetParametersAtomically, '/cpg_inversion/set_parameters_atomically',
                        SetParametersAtomically.Request(parameters=[
                            Parameter('kp', value=60).to_parameter_msg()])).result.successful
    answer = watcher.call(Trigger, '/cpg_inversion/fit', Trigger.Request())
    assert not answer.success
    assert 'no effort of joints' in answer.message
    node.signal(signal.SIGINT)
    assert node.wait() == 0
    assert 'Traceback' not in node.log


def test_the_graph_cannot_choose_which_files_are_written(ending, tmp_path):
    profile = tmp_path / '.bashrc'
    profile.write_text('export PATH\n')
    node = Process('-p', f'out:={tmp_path / "fitted.yaml"}', executable=INVERSION)
    ending.append(node)
    node.wait_for('listening to /joint_states')
    watcher = Watcher(node.domain, '/cpg_inversion')
    ending.append(watcher)
    for name in ('out', 'report'):
        (result,) = watcher.call(SetParameters, '/cpg_inversion/set_parameters',
                                 SetParameters.Request(parameters=[Parameter(
                                     name, value=str(profile)).to_parameter_msg()])).results
        assert not result.successful
        assert result.reason == f'{name} is read-only: set it when the node starts'
    assert watcher.get('out', 'report') == [
        str(tmp_path / 'fitted.yaml'), '']
    assert profile.read_text() == 'export PATH\n'


def test_a_running_generator_moves_as_what_was_fitted(ending):
    # Its readouts are not those of the robot file, which the second generator has, too; nor is a
    # walk of the file's duty what is fitted.
    timing = ('-p', 'use_sim_time:=true', '-p', 'rate:=100.0')
    source = Process('-p', 'gait:=walk', '-p', 'frequency:=1.7', '-p', 'duty:=0.6', *timing,
                     *(word for leg in ('lh', 'rh') for word in (
                         '-p', f'readout.{leg}_thigh_joint:=[0.6, -0.2, 0.06, 0.05, 0.0]',
                         '-p', f'readout.{leg}_hip_joint:=[0.0, 0.1]')))
    ending.append(source)
    source.wait_for('publishing')
    follower = Process('-p', 'gait:=pace', '-p', 'frequency:=1.0', '-p', 'amplitude:=0.5', *timing,
                       '--ros-args', '-r', '__ns:=/second', domain=source.domain)
    ending.append(follower)
    node = Process('-p', 'apply_to:=/second/cpg_generator', '-p', 'robot:=quadruped', '-p',
                   'window:=6.0', *timing[:2], domain=source.domain, executable=INVERSION)
    ending.append(node)
    node.wait_for('listening to /joint_states')
    follower.wait_for('publishing')
    watchers = Watcher(source.domain), Watcher(source.domain, '/second/cpg_generator')
    ending.extend(watchers)
    clock = SimulatedTime(watchers[0], listeners=3)
    clock.run(100.0, 103.0)
    clock.lead(103.0, 110.0, 0.01)
    answer = watchers[0].call(Trigger, '/cpg_inversion/fit', Trigger.Request())
    assert answer.success, answer.message
    assert answer.message.endswith("gait, frequency, network and joints' readouts")
    # Who misses a step of the clock leaves it out of its stride.
    clock.lead(110.0, 112.0, 0.01, watchers[1])
    began = [len(one.samples) for one in watchers]
    clock.lead(112.0, 115.0, 0.01, watchers[1])
    moved = [(one.names, [np.array(part) for part in zip(*one.samples[start:], strict=True)][:2])
             for one, start in zip(watchers, began, strict=True)]
    gaps = gaps_in_step(*moved, 1.0 / 1.7)
    assert gaps.shape[1] == 10
    # Root of the mean square of each joint, over its range.
    assert np.sqrt(np.mean(gaps**2, axis=0)).max() < 0.05
    # What cannot run changes nothing.
    for wrong, words in (([0.0], 'offset and 1, 2, 4 or 6 weights'),
                         ([0.0, 5.0], 'rh_thigh_joint'), ('none', 'DOUBLE_ARRAY')):
        result = watchers[1].set_together(**{'readout.rh_thigh_joint': wrong})
        assert not result.successful and words in result.reason
    assert watchers[1].get('readout.rh_thigh_joint')[0][0] == pytest.approx(0.6, abs=0.05)
    assert watchers[1].set_together(gait='trot').successful
    assert list(watchers[1].get('readout.rh_thigh_joint')[0]) == [0.8, -0.25]


@pytest.mark.parametrize(('arguments', 'words'), [
    (('robot:=nothing',), "robot 'nothing' is neither"),
    (('order:=5',), 'order'), (('topics:=[1, 2]',), 'topics'),
    (('topics:=["bad topic"]',), 'bad topic')])
def test_a_node_that_cannot_start_says_why(ending, arguments, words):
    node = Process('-p', *arguments, executable=INVERSION)
    ending.append(node)
    assert node.wait() == 1
    assert words in node.log and 'Traceback' not in node.log


def test_a_call_without_joint_states_is_answered(ending):
    node = Process('-p', 'topics:=[silent]', executable=INVERSION)
    ending.append(node)
    node.wait_for('listening to /silent')
    watcher = Watcher(node.domain)
    ending.append(watcher)
    answer = watcher.call(Trigger, '/cpg_inversion/fit', Trigger.Request())
    assert not answer.success and answer.message == '/silent: no joint states came in'


def test_a_network_file_can_be_named_at_the_start_only(ending, tmp_path):
    # What names it later is on the graph, and need not be the user.
    path = tmp_path / 'x.py'
    path.write_text('raise SystemExit\n')
    node = Process('-p', f'network:={path}', executable=INVERSION)
    ending.append(node)
    node.wait_for('listening to /joint_states')
    watcher = Watcher(node.domain, '/cpg_inversion')
    ending.append(watcher)
    for name, allowed in ((str(tmp_path / 'y.py'), False), ('phase', True), (str(path), True),
                          ('./y', False)):
        (result,) = watcher.set(network=name)
        assert result.successful is allowed, name
        assert allowed or 'at the start only' in result.reason
