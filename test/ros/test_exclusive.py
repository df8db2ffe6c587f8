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
from graph import until
import pytest
from sensor_msgs.msg import JointState
from stepped import refused


def test_another_publisher_is_named_and_gone_again(stepped):
    generator, watcher = stepped('-r', '__ns:=/dog', running=False)
    until(lambda: watcher.diagnostics, 'diagnostics')
    assert 'too' not in generator.log
    publisher = watcher.node.create_publisher(JointState, '/dog/lf/joint_states', 10)
    generator.wait_for('/dog/lf/joint_states is published by /watcher, too')
    until(lambda: watcher.diagnostics[-1].level == DiagnosticStatus.ERROR
          and watcher.diagnostics[-1].message
          == '/dog/lf/joint_states is published by /watcher, too', 'the error')
    watcher.destroy(publisher)
    until(lambda: watcher.diagnostics[-1].level != DiagnosticStatus.ERROR, 'the way back')
    assert generator.log.count('too') == 1


def test_two_of_one_name_warn_of_one_another(stepped):
    one, watcher = stepped(running=False)
    stepped(domain=one.domain, running=False)
    until(lambda: one.log.count('/joint_states is published by /cpg_generator, too') >= 2,
          'both warnings')
    until(lambda: watcher.diagnostics[-2:] and all(
        s.level == DiagnosticStatus.ERROR for s in watcher.diagnostics[-2:]), 'both errors')


@pytest.mark.parametrize('command', ['joint_trajectory', 'forward_position'])
def test_one_that_commands_does_not_start_beside_another(stepped, command):
    words = '-p', f'command:={command}', '-p', 'assume_stand:=true'
    one, _ = stepped(*words, running=False)
    reason = refused(*words, domain=one.domain)
    assert 'is published by /cpg_generator, too' in reason and '\n' not in reason
    assert reason.endswith('rename the topic, or set exclusive to false')
    # In another namespace, or told to, it does.
    for more in (('-r', '__ns:=/b'), ('-p', 'exclusive:=false')):
        stepped(*words, *more, domain=one.domain, running=False)


def test_exclusive_without_commands(stepped):
    one, watcher = stepped(running=False)
    assert watcher.get('exclusive') == [False]
    assert 'is published by /cpg_generator, too' in refused('-p', 'exclusive:=true',
                                                            domain=one.domain)


@pytest.mark.parametrize(('words', 'topic'), [
    (('-p', 'combined_topic:=lh/joint_states'), 'lh/joint_states'),
    (('-p', 'combined_topic:=/all', '-r', 'rf/joint_states:=/all'), 'rf/joint_states'),
    (('-p', 'combined_topic:=cpg_generator/phase'), '~/phase')])
def test_a_combined_topic_of_its_own_is_refused(words, topic):
    reason = refused(*words)
    assert f"is the generator's own {topic}" in reason and '\n' not in reason
