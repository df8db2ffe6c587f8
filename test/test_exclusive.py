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

"""One robot, one generator: others on its topics are named, or keep it from starting."""

from diagnostic_msgs.msg import DiagnosticStatus
from graph import Process, until
import pytest
from sensor_msgs.msg import JointState


def test_another_publisher_is_named_and_gone_again(start):
    process, watcher = start('-r', '__ns:=/dog', node='/dog/cpg_generator')
    watcher.record(0.2)
    until(lambda: watcher.diagnostics, 'diagnostics')
    assert 'too' not in process.log
    publisher = watcher.node.create_publisher(JointState, '/dog/lf/joint_states', 10)
    process.wait_for('WARN.*/dog/lf/joint_states is published by /watcher, too')
    until(lambda: watcher.diagnostics[-1].level == DiagnosticStatus.ERROR
          and watcher.diagnostics[-1].message
          == '/dog/lf/joint_states is published by /watcher, too', 'the error')
    watcher.node.destroy_publisher(publisher)
    until(lambda: watcher.diagnostics[-1].level != DiagnosticStatus.ERROR, 'the way back')
    assert process.log.count('too') == 1


def test_two_of_one_name_warn_of_one_another(start):
    one, watcher = start()
    two = start(domain=one.domain, watch=False)
    for process in (one, two):
        process.wait_for('/joint_states is published by /cpg_generator, too')
    until(lambda: watcher.diagnostics[-2:] and all(
        s.level == DiagnosticStatus.ERROR for s in watcher.diagnostics[-2:]), 'both errors')


@pytest.mark.parametrize('command', ['joint_trajectory', 'forward_position'])
def test_one_that_commands_does_not_start_beside_another(start, command):
    one, _ = start('-p', f'command:={command}')
    two = start('-p', f'command:={command}', domain=one.domain, watch=False)
    assert two.wait() == 1
    assert 'FATAL' in two.lines[-1] and 'is published by /cpg_generator, too' in two.lines[-1]
    assert two.lines[-1].endswith('rename the topic, or set exclusive to false')
    assert 'publishing' not in two.log and 'Traceback' not in two.log
    # In another namespace, or told to, it does.
    for more in (('-r', '__ns:=/b'), ('-p', 'exclusive:=false')):
        start('-p', f'command:={command}', *more, domain=one.domain,
              watch=False).wait_for('publishing')


def test_exclusive_without_commands(start):
    one, watcher = start()
    assert watcher.get('exclusive') == [False]
    two = start('-p', 'exclusive:=true', domain=one.domain, watch=False)
    assert two.wait() == 1
    assert 'is published by /cpg_generator, too' in two.lines[-1]


@pytest.mark.parametrize(('words', 'topic'), [
    (('-p', 'combined_topic:=lh/joint_states'), 'lh/joint_states'),
    (('-p', 'combined_topic:=/all', '-r', 'rf/joint_states:=/all'), 'rf/joint_states'),
    (('-p', 'combined_topic:=cpg_generator/phase'), '~/phase')])
def test_a_combined_topic_of_its_own_is_refused(words, topic):
    process = Process(*words)
    assert process.wait() == 1
    assert 'FATAL' in process.lines[-1] and len(process.lines) == 1
    assert f"is the generator's own {topic}" in process.lines[-1]
