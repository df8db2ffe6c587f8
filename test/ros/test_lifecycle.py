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

"""A managed generator: ROS's life cycle, mapped on silence, the stand and the gait."""

from cpg_ros.ros.cli.cpg import main as cpg
from diagnostic_msgs.msg import DiagnosticStatus
from graph import Process, until, Watcher
from lifecycle_msgs.msg import Transition
from lifecycle_msgs.srv import ChangeState, GetState
import numpy as np
import pytest
from std_srvs.srv import SetBool

STAND = np.tile([0.0, 0.8, -1.5], 4)


def change(watcher, transition):
    request = ChangeState.Request(transition=Transition(id=transition))
    return watcher.call(ChangeState, '/cpg_generator/change_state', request).success


def state(watcher):
    return watcher.call(GetState, '/cpg_generator/get_state',
                        GetState.Request()).current_state.label


def silent(watcher):
    """Whether nothing is published, by the generator's own word."""
    count = len(watcher.diagnostics)
    until(lambda: len(watcher.diagnostics) >= count + 2, 'diagnostics')
    last = watcher.diagnostics[-1]
    return (last.level == DiagnosticStatus.WARN
            and last.message == 'nothing is published: waiting for configure')


def test_it_stands_when_configured_walks_while_active_and_falls_silent(stepped):
    _, watcher = stepped('-p', 'managed:=true')
    assert silent(watcher) and not watcher.samples and state(watcher) == 'unconfigured'
    assert change(watcher, Transition.TRANSITION_CONFIGURE) and state(watcher) == 'inactive'
    _, positions, _ = watcher.record(1.0)
    assert positions == pytest.approx(np.broadcast_to(STAND, positions.shape), abs=1e-9)
    assert change(watcher, Transition.TRANSITION_ACTIVATE) and state(watcher) == 'active'
    _, positions, _ = watcher.record(2.5)
    assert positions[0] == pytest.approx(STAND, abs=0.05)
    assert np.ptp(positions[-100:], axis=0).max() > 0.4
    assert change(watcher, Transition.TRANSITION_DEACTIVATE) and state(watcher) == 'inactive'
    # Legs in mid-stride are not left there: it must stand first.
    assert not change(watcher, Transition.TRANSITION_CLEANUP) and state(watcher) == 'inactive'
    _, positions, _ = watcher.record(2.0)
    assert positions[-1] == pytest.approx(STAND, abs=1e-9)
    assert change(watcher, Transition.TRANSITION_CLEANUP) and state(watcher) == 'unconfigured'
    assert silent(watcher)
    # The clock of this test waits for samples that are not there any more.
    watcher.samples.clear()
    assert silent(watcher) and not watcher.samples
    # Once more, from silence into the gait.
    assert change(watcher, Transition.TRANSITION_CONFIGURE)
    assert change(watcher, Transition.TRANSITION_ACTIVATE)
    _, positions, _ = watcher.record(2.5)
    assert np.ptp(positions[-100:], axis=0).max() > 0.4


@pytest.mark.parametrize('door', ['service', 'cpg'])
def test_a_stop_is_accepted_in_every_state(stepped, capsys, monkeypatch, door):
    generator, watcher = stepped('-p', 'managed:=true', '-p', 'ramp:=0.5')
    monkeypatch.setenv('ROS_DOMAIN_ID', str(generator.domain))

    def stop():
        if door == 'cpg':
            assert cpg(['disable']) == 0, capsys.readouterr().err
            return capsys.readouterr().out.strip()
        answer = watcher.call(SetBool, '/cpg_generator/enable', SetBool.Request(data=False))
        assert answer.success
        return answer.message

    assert stop() == 'nothing is published yet' and state(watcher) == 'unconfigured'
    assert change(watcher, Transition.TRANSITION_CONFIGURE)
    stop()
    assert state(watcher) == 'inactive'
    assert change(watcher, Transition.TRANSITION_ACTIVATE)
    _, positions, _ = watcher.record(1.5)
    assert np.ptp(positions, axis=0).max() > 0.2
    assert stop() == 'ramping down over 0.5 s' and state(watcher) == 'inactive'
    _, positions, velocities = watcher.record(2.0)
    assert positions[-1] == pytest.approx(STAND, abs=1e-9) and not velocities[-1].any()
    # It can be activated again, by its own door only.
    answer = watcher.call(SetBool, '/cpg_generator/enable', SetBool.Request(data=True))
    assert not answer.success and answer.message == 'this node is managed: activate it instead'
    assert change(watcher, Transition.TRANSITION_ACTIVATE)


def test_every_transition_is_answered_in_every_state(stepped):
    generator, watcher = stepped('-p', 'managed:=true', '-p', 'ramp:=0.05')
    allowed = {'unconfigured': {1}, 'inactive': {2, 3}, 'active': {4}}
    into = {'unconfigured': [], 'inactive': [1], 'active': [1, 3]}
    asked = [*range(5), *range(8, 13), 20, 30, 40, 50, 60, 62, 97, 98, 99, 255]
    for name, steps in into.items():
        for one in steps:
            assert change(watcher, one)
        for one in asked:
            if one not in allowed[name]:
                assert not change(watcher, one), (name, one)
        # By names, and that of a shutdown in another state than it is for.
        for label in ('no such', 'transition_success', ''):
            request = ChangeState.Request(transition=Transition(id=99, label=label))
            assert not watcher.call(ChangeState, '/cpg_generator/change_state', request).success
        for one in {5, 6, 7} - {5 + list(into).index(name)}:
            assert not change(watcher, one), (name, one)
        assert state(watcher) == name
        for one in {'active': [4], 'inactive': [2]}.get(name, []):
            assert change(watcher, one)
        if name == 'active':
            until(lambda: change(watcher, 2), 'the stand')
    generator.wait_for("refused: the state 'active' does not have it")
    assert 'Traceback' not in generator.log


def test_shutdown_ramps_down_and_ends_the_process():
    process = Process('-p', 'managed:=true', '-p', 'exclusive:=false')
    watcher = Watcher(process.domain)
    try:
        process.wait_for('publishing nothing until it is configured')
        assert change(watcher, Transition.TRANSITION_CONFIGURE)
        assert change(watcher, Transition.TRANSITION_ACTIVATE)
        watcher.record(1.5)
        assert change(watcher, Transition.TRANSITION_ACTIVE_SHUTDOWN)
        assert process.wait() == 0, process.log
        assert 'ramping down over 0.5 s before the end' in process.log
    finally:
        watcher.end()
        process.end()
