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

"""A joint that does not follow is reported, and feedback does not correct by it."""

import time

from diagnostic_msgs.msg import DiagnosticStatus
from graph import until
import pytest
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64MultiArray

COMMANDS = 'forward_position_controller/commands'
#: Of the Go2's, and where it jams, rad.
JOINT, JAMMED = 'FL_thigh_joint', 1.5


@pytest.fixture
def followed(stepped):
    """Start a generator whose robot goes at once to where it is commanded, but for one joint."""
    generator, watcher = stepped(*(word for one in (
        'robot:=unitree_go2', 'command:=forward_position', 'combined_topic:=""',
        'assume_stand:=true', 'measured_topic:=measured', 'feedback.enabled:=true',
        'feedback.joint_states_topic:=measured') for word in ('-p', one)))
    names = generator._node._planner.robot.order
    publisher = watcher.node.create_publisher(JointState, 'measured', 10)
    jammed = {}

    def follow(command):
        angles = {**dict(zip(names, command.data, strict=True)), **jammed}
        publisher.publish(JointState(name=list(angles), position=list(angles.values())))
        newest[:] = command.data
    newest = []
    watcher.node.create_subscription(Float64MultiArray, COMMANDS, follow, 10)
    return generator, watcher, jammed, lambda: follow(Float64MultiArray(data=newest))


def state(watcher):
    return {one.key: one.value for one in watcher.diagnostics[-1].values}['feedback']


def test_a_joint_that_jams_is_an_error_and_ends_the_feedback(followed):
    generator, watcher, jammed, _ = followed
    until(lambda: len(watcher.diagnostics) >= 4, 'diagnostics')
    assert all(one.level != DiagnosticStatus.ERROR for one in watcher.diagnostics)
    # It is enabled, and waits for the other sensors.
    assert state(watcher).startswith('waiting: ')
    jammed[JOINT] = JAMMED
    until(lambda: watcher.diagnostics[-1].level == DiagnosticStatus.ERROR, 'the error')
    said = f'{JOINT} does not follow: it is at 1.50 rad'
    assert watcher.diagnostics[-1].message.startswith(said)
    assert state(watcher) == 'off'
    generator.wait_for(f'{JOINT} does not follow')
    # What its user sets meanwhile does not switch it on.
    assert watcher.set(**{'feedback.enabled': True})[0].successful
    count = len(watcher.diagnostics)
    until(lambda: len(watcher.diagnostics) > count + 1, 'diagnostics')
    assert state(watcher) == 'off'
    jammed.clear()
    generator.wait_for('all joints follow again')
    until(lambda: watcher.diagnostics[-1].level != DiagnosticStatus.ERROR, 'the way back')
    assert state(watcher).startswith('waiting: ')


def test_a_joint_that_jams_within_its_swing_is_an_error(followed):
    generator, watcher, jammed, _ = followed
    until(lambda: len(watcher.diagnostics) >= 2, 'diagnostics')
    # In the middle of its swing, whose mean distance from there is below tracking_error.
    jammed[JOINT] = 0.9
    generator.wait_for(f'{JOINT} is stuck at 0.90 rad')
    jammed.clear()
    generator.wait_for('all joints follow again')


def test_the_mean_is_over_simulated_time(followed):
    generator, watcher, jammed, measure = followed
    until(lambda: len(watcher.diagnostics) >= 2, 'diagnostics')
    jammed[JOINT] = JAMMED
    generator.run(0.1)
    # A simulation may be slower than the wall: this is a moment of a stride.
    for _ in range(40):
        measure()
        time.sleep(0.05)
    assert 'does not follow' not in generator.log
    generator.run()
    generator.wait_for(f'{JOINT} does not follow')
