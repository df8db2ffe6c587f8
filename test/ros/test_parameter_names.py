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

"""Parameters that `ros2 param dump` and `load` can carry: dumped, nested, and given back."""

from itertools import permutations
import os
import subprocess

from cpg_ros.ros.feedback.switch import ENABLED, SWITCH
from graph import EXECUTABLE, free_domain, Process, until, Watcher
from launch_files import of_generator
import pytest
from rcl_interfaces.srv import GetParameters, ListParameters, SetParameters
from rclpy.parameter import Parameter, parameter_value_to_python
from stepped import refused
import yaml

pytestmark = pytest.mark.live


def clashes(names):
    """Pairs of which one would be a value and a part of a parameter file at once."""
    return [(one, other) for one, other in permutations(names, 2) if other.startswith(f'{one}.')]


def nested(values):
    """Parameters as a parameter file has them: dots part levels."""
    tree = {}
    for name, value in values.items():
        *parts, last = name.split('.')
        level = tree
        for part in parts:
            level = level.setdefault(part, {})
            assert isinstance(level, dict), f'{name}: {part} is a value already'
        assert last not in level, f'{name}: {last} has parts already'
        level[last] = value
    return tree


def flat(tree, before=''):
    """Parameters of a file by name."""
    found = {}
    for key, value in tree.items():
        found |= (flat(value, f'{before}{key}.') if isinstance(value, dict)
                  else {f'{before}{key}': value})
    return found


def dumped(watcher, node):
    """Parameters of a node by name, as its services tell them."""
    names = watcher.call(ListParameters, f'{node}/list_parameters',
                         ListParameters.Request()).result.names
    values = watcher.call(GetParameters, f'{node}/get_parameters',
                          GetParameters.Request(names=names)).values
    found = map(parameter_value_to_python, values)
    return {name: list(value) if hasattr(value, 'tolist') else value
            for name, value in zip(names, found, strict=True)}


#: Node -> its executable, and parameters other than the defaults.
NODES = {'/robot_sim': ('robot_sim', ("film:=''", "footfalls:=''")),
         '/cpg_inversion': ('inversion', ('window:=30.0',)), '/cpg_panel': ('panel', ('port:=0',)),
         '/unitree_bridge': ('unitree_bridge', ('dry_run:=true',))}


@pytest.mark.parametrize('network', ['delayed', 'quadruped', 'biped', 'phase', 'hopf'])
def test_no_name_is_the_beginning_of_another_whatever_the_network(network):
    assert clashes(of_generator(network)) == [] and ENABLED in of_generator(network)
    assert clashes([*of_generator(network), 'feedback']) and SWITCH.default is True


def load(watcher, node, path):
    """Write what a node has as a parameter file, and give that back to it; return the values."""
    values = dumped(watcher, node)
    assert clashes(values) == []
    path.write_text(yaml.safe_dump({node: {'ros__parameters': nested(values)}}))
    loaded = flat(yaml.safe_load(path.read_text())[node]['ros__parameters'])
    assert loaded == values
    results = watcher.call(SetParameters, f'{node}/set_parameters', SetParameters.Request(
        parameters=[Parameter(name, value=value).to_parameter_msg()
                    for name, value in loaded.items()])).results
    assert all('read-only' in one.reason for one in results if not one.successful)
    assert dumped(watcher, node) == values
    return values


def test_what_a_generator_dumps_can_be_loaded_and_started_from(tmp_path, stepped):
    path = tmp_path / 'dump.yaml'
    _, watcher = stepped('-p', 'robot:=unitree_go2', '-p', 'gait:=walk', '-p',
                         'feedback.step:=0.12', running=False)
    values = load(watcher, '/cpg_generator', path)
    _, watcher = stepped('--params-file', str(path), running=False)
    assert dumped(watcher, '/cpg_generator') == values


@pytest.mark.parametrize('node', NODES)
def test_what_is_dumped_can_be_loaded_and_started_from(tmp_path, node):
    executable, parameters = NODES[node]
    domain, path = free_domain(), tmp_path / 'dump.yaml'
    given = [word for one in parameters for word in ('-p', one)]
    watcher, before = Watcher(domain, node), None
    for words in (given, ('--params-file', str(path))):
        process = Process(*words, domain=domain, executable=EXECUTABLE.with_name(executable))
        try:
            values = load(watcher, node, path)
            assert before is None or values == before
            before = values
        finally:
            process.end()
            until(lambda: node[1:] not in watcher.node.get_node_names(), 'its end')
    watcher.end()


@pytest.mark.parametrize('word', ['feedback:=false', 'feedback:=true'])
def test_the_former_name_of_the_switch_is_refused_with_the_new_one(word):
    assert refused('-p', word) == "there is no parameter 'feedback': it is 'feedback.enabled'"


def test_the_former_name_is_refused_at_run_time_and_the_new_one_taken(stepped):
    _, watcher = stepped('-p', 'robot:=unitree_go2', '-p', "combined_topic:=''")
    answer, = watcher.set(feedback=False)
    assert not answer.successful
    assert answer.reason == "there is no parameter 'feedback': it is 'feedback.enabled'"
    assert watcher.get(ENABLED) == [True]
    assert watcher.set(**{ENABLED: False})[0].successful
    assert watcher.get(ENABLED) == [False]


def test_feedback_that_the_robot_cannot_have_is_refused_at_run_time(running):
    _, watcher = running
    answer, = watcher.set(**{ENABLED: True})
    assert not answer.successful and answer.reason.startswith('no feedback: ')
    assert watcher.get(ENABLED) == [False]


@pytest.mark.parametrize('columns', ['60', '200'])
def test_the_help_lists_ranges_and_examples_within_the_terminal(columns):
    done = subprocess.run([EXECUTABLE, '--help'], env=dict(os.environ, COLUMNS=columns), text=True,
                          capture_output=True, timeout=120, check=True)
    usage, *lines = done.stdout.splitlines()
    assert usage.startswith('usage: generator')
    listed = lines[lines.index('parameters (* at the start only):') + 1:]
    assert max(map(len, listed)) <= min(int(columns), 100)
    words = ' '.join(' '.join(listed).split())
    assert 'rate: messages per second on every output topic [Hz]; from 1 to 2000 (default' in words
    assert 'frequency: strides per second' in words and 'exclusive*: refuse to start' in words
    assert '  generator --ros-args -p gait:=walk -p rate:=500.0' in lines
