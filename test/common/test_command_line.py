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

"""Every executable: help, and words that are not for it."""

from functools import partial
from importlib.metadata import EntryPoint
import os
from pathlib import Path
import resource
import signal
import subprocess

from cpg_ros.common.command_line import interval, Parser
from cpg_ros.ros.cli.executables import EXECUTABLES, start
from depth import in_depth
from graph import EXECUTABLE, free_domain, Process
from launch_files import executables
import pytest

NODES = ('generator', 'robot_sim', 'inversion', 'panel')
TOOLS = ('demo', 'analyze', 'check_robot', 'optimize', 'reproduce', 'tune', 'calibrate', 'atlas',
         'export')


def run(executable, *words):
    variables = dict(os.environ, ROS_DOMAIN_ID=str(free_domain()))
    return subprocess.run([EXECUTABLE.with_name(executable), *words], env=variables, text=True,
                          capture_output=True, timeout=60, check=False)


@pytest.fixture
def here(monkeypatch, capsys):
    """Return a function that runs a tool in this process; as run, it returns what came of it."""
    monkeypatch.setattr('signal.signal', lambda *_: None)

    def run_here(tool, *words):
        monkeypatch.setattr('sys.argv', [tool, *words])
        with pytest.raises(SystemExit) as ended:
            start(tool)
        return ended.value.code or 0, *capsys.readouterr()
    return run_here


@pytest.mark.parametrize(('text', 'low'), [('-0.6:0.2', -0.6), ('-.5:0.2', -0.5), ('-1e-3:0.2',
                                                                                   -1e-3)])
def test_a_range_from_below_zero_is_a_value_and_no_option(text, low):
    parser = Parser(prog='tool')
    parser.add_argument('--range', type=interval)
    assert parser.parse_args(['--range', text]).range == (low, 0.2)
    with pytest.raises(SystemExit):
        parser.parse_args(['-x'])


@pytest.mark.parametrize('tool', TOOLS)
def test_help_of_a_tool_and_words_that_are_not_for_it(here, tool):
    for word in ('--help', '-h'):
        code, said, errors = here(tool, word)
        assert code == 0 and not errors
        assert said.startswith('usage: ') and tool in said
    code, said, errors = here(tool, '--nonsense')
    assert code == 2 and not said and len(errors.splitlines()) == 1


@pytest.mark.parametrize(('executable', 'word'), [
    *((executable, '--help') for executable in (*NODES, 'demo')), ('generator', '-h'), *in_depth(
        *((tool, '--help') for tool in TOOLS[1:]),
        *((executable, '-h') for executable in (*NODES[1:], *TOOLS)))])
def test_help(executable, word):
    found = run(executable, word)
    assert found.returncode == 0 and not found.stderr
    assert found.stdout.startswith('usage: ') and executable in found.stdout
    if executable in ('generator', 'robot_sim'):
        assert '\n  command*: ' in found.stdout


def test_the_entry_points_of_setup_are_the_executables(monkeypatch, capsys):
    assert executables() == set(EXECUTABLES)
    loaded = EntryPoint('analyze', 'cpg_ros.ros.cli.executables:analyze', 'console_scripts').load()
    monkeypatch.setattr('sys.argv', ['analyze', '--set', 'x'])
    monkeypatch.setattr('signal.signal', lambda *_: None)
    with pytest.raises(SystemExit) as ended:
        loaded()
    assert ended.value.code == 2
    assert capsys.readouterr().err.endswith("analyze: argument --set: 'x' is not of the form "
                                            'name=value\n')


@pytest.mark.parametrize(('executable', 'words', 'said'), [
    *((executable, ['--nonsense'], '--nonsense') for executable in NODES if executable !=
      'inversion'),
    *((executable, ['--nonsense'], '') for executable in ('inversion', 'demo')),
    *in_depth(*((tool, ['--nonsense'], '') for tool in TOOLS[1:])),
    ('generator', ['--gait', 'walk'], 'not understood: --gait walk (parameters: --ros-args -p '),
    ('generator', ['walk', '--help'], 'not understood: walk'),
    ('generator', ['--ros-args', '-p', 'gait:=walk', '--', 'walk'], 'not understood: walk'),
    ('inversion', ['--ros-args', '-p', 'order:=1', '--', 'walk'], 'not understood: walk'),
    ('generator', ['--ros-args', '-p', 'gait'], "Couldn't parse parameter override rule"),
    ('robot_sim', ['--ros-args', '--nonsense'], '--nonsense')])
def test_words_that_are_not_for_it(executable, words, said):
    found = run(executable, *words)
    assert found.returncode == 2 and not found.stdout
    assert len(found.stderr.splitlines()) == 1, found.stderr
    assert said in found.stderr


@pytest.mark.parametrize(('words', 'code', 'said'), [
    (['-p', 'combined_topic:=bad topic'], 1, "topic 'bad topic': failed to resolve name: "),
    (['-p', 'autostart:=false', '-p', 'measured_topic:=9a'], 1, "topic '9a': failed to"),
    (['-r', 'joint_states:=9 bad'], 2, "Couldn't parse remap rule: '-r joint_states:=9 bad'"),
    (['--params-file', '/nix.yaml'], 2, "'--params-file /nix.yaml': Error opening YAML file"),
    (['--params-file', 'nested.yaml'], 2, "nested.yaml': Sequences cannot be key at line 3"),
    (['-p', 'qos_overrides./joint_states.publisher.reliability:=bogus'], 1,
     "topic 'joint_states': Unexpected QoS override for policy `reliability`: `bogus`"),
    (['-p', 'qos_overrides./joint_states.publisher.depth:=many'], 1, "topic 'joint_states': ")],
    ids=['topic', 'listening', 'remap', 'missing file', 'nested', 'qos', 'depth'])
def test_what_cannot_be_used_is_one_line(words, code, said, tmp_path):
    nested = tmp_path / 'nested.yaml'
    nested.write_text('/**:\n  ros__parameters:\n    gait: {a: {b: [[1, 2], [3]]}}\n')
    found = run('generator', '--ros-args', *(str(nested) if word == nested.name else word
                                             for word in words))
    lines = [line for line in found.stderr.splitlines() + found.stdout.splitlines()
             if 'compiling ' not in line and 'compiled in' not in line]
    assert found.returncode == code and len(lines) == 1, found.stderr
    assert said in lines[0]


@pytest.mark.parametrize(('domain', 'said'), [
    ('999', 'ROS_DOMAIN_ID 999 is not from 0 to 232'),
    ('abc', 'ROS_DOMAIN_ID is not an integral number')])
def test_a_bad_domain_is_one_line(domain, said):
    found = subprocess.run([EXECUTABLE], env=dict(os.environ, ROS_DOMAIN_ID=domain), text=True,
                           capture_output=True, timeout=60, check=False)
    assert found.returncode == 2
    (line,) = found.stderr.splitlines()
    assert said in line


def test_a_full_disk_is_said_with_the_name_of_the_file(tmp_path):
    urdf = Path(__file__).parents[2] / 'resource' / 'urdf' / 'quadruped.urdf'
    made = tmp_path / 'made.yaml'
    # No file may grow: as on a full disk, the error of the system has no name in it.
    none = partial(resource.setrlimit, resource.RLIMIT_FSIZE, (0, 0))

    def make(where, **options):
        return subprocess.run([EXECUTABLE.with_name('check_robot'), '--urdf', urdf, '--make',
                               where], text=True, capture_output=True, timeout=60, **options)

    for other in (tmp_path / 'one.yaml', tmp_path / 'two.yaml'):
        # From now on all that it compiles is on disk.
        assert make(other).returncode == 0
        other.unlink()
    found = make(made, preexec_fn=none)
    assert found.returncode == 2
    assert found.stderr == f'check_robot: {made}: File too large\n'
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize('executable', ['generator', 'analyze'])
def test_an_interrupt_while_it_loads_is_one_line(executable, tmp_path):
    # numpy loads slowly here.
    (tmp_path / 'numpy.py').write_text('import time; print(flush=True); time.sleep(60.0)\n')
    path = os.pathsep.join([str(tmp_path), os.environ.get('PYTHONPATH', '')])
    process = subprocess.Popen([EXECUTABLE.with_name(executable)], text=True,
                               env=dict(os.environ, PYTHONPATH=path), stdout=subprocess.PIPE,
                               stderr=subprocess.PIPE)
    process.stdout.readline()
    process.send_signal(signal.SIGINT)
    assert process.communicate(timeout=60)[1] == f'{executable}: stopped\n'
    assert process.returncode == 130


@pytest.mark.deep
def test_a_second_start_compiles_nothing(tmp_path):
    # A cache of its own: others that compile at the same time would write into it.
    for said in (True, False):
        process = Process(environment={'NUMBA_CACHE_DIR': str(tmp_path)})
        try:
            assert ('compil' in process.wait_for('publishing').log) is said
        finally:
            process.end()
