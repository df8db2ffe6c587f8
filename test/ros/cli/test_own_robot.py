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

"""From a URDF to a robot that one drives: which steps run, what is used again, what is refused."""

from argparse import Namespace
from dataclasses import replace
import importlib.util
import os
from pathlib import Path
import re
import shutil
import signal

from cpg_ros.common.errors import InputError
from cpg_ros.motion.description import load_urdf
from cpg_ros.motion.robot_file import load_robot, write_robot
from cpg_ros.ros.cli import demo as tool
from cpg_ros.ros.cli import demo_parts
from cpg_ros.ros.cli.demo_parts import StepFailed
from demo_process import alive, demo, nodes_of
from go2 import FILE
from graph import until
from panel_client import Client
import pytest
from urdf_texts import SOURCE

if any(importlib.util.find_spec(name) is None for name in ('mujoco', 'cma')):
    pytest.skip('the extra [sim] is not installed', allow_module_level=True)

URDF = SOURCE / 'resource' / 'urdf' / 'quadruped.urdf'


class Made:
    """Steps that write what the executables would: a file that exists, or none."""

    def __init__(self, *codes, writing=(0,)):
        self.codes, self.words, self.writing = list(codes), [], writing

    def run(self, what, seconds, words):
        assert what and seconds > 0.0
        self.words.append(words)
        code = self.codes.pop(0) if self.codes else 0
        if code in self.writing:
            shutil.copy(FILE, words[words.index('--out' if words[0] == 'tune' else '--make') + 1])
        return code


def args(folder, **changes):
    return Namespace(**{'urdf': URDF, 'mjcf': None, 'forward': None, 'legs': None,
                        'velocity': None, 'evaluations': None, 'kp': None, 'kd': None,
                        'tour': None, 'out': folder, **changes})


def test_a_robot_file_is_made_then_its_gaits_are_tuned_and_both_are_used_again(tmp_path, capsys):
    steps, file, tuned = Made(), tmp_path / 'quadruped.yaml', tmp_path / 'quadruped_tuned.yaml'
    robot = demo_parts.prepare(args(tmp_path, velocity=8.0, evaluations=7), steps)
    check, trot, walk = steps.words
    assert check == ['check_robot', '--urdf', str(URDF), '--make', str(file), '--velocity', '8']
    for words, before, gait in ((trot, file, 'trot'), (walk, tuned, 'walk')):
        assert words == ['tune', '--robot', str(before), '--model', str(URDF), '--gait', gait,
                         '--evaluations', '7', '--out', str(tuned)]
    # It says that its feedback helps.
    assert not robot.unjudged
    # The shipped Go2's trot is faster than its walk.
    assert robot.file == str(tuned) and robot.gaits[:2] == ('trot', 'walk') and robot.steered
    said = capsys.readouterr().out.splitlines()
    assert said[0] == f'the files of the robot go into {tmp_path}' and len(said) == 2
    assert said[1].startswith('gaits, best first: trot (')
    steps = Made()
    assert demo_parts.prepare(args(tmp_path), steps) == robot and not steps.words
    assert capsys.readouterr().out.count('; delete it to regenerate it') == 2
    for option in ('velocity', 'evaluations'):
        with pytest.raises(InputError, match=rf'--{option}: .*\.yaml exists already'):
            demo_parts.prepare(args(tmp_path, **{option: 5}), steps)


def test_a_robot_that_faces_another_way_is_turned_once_and_its_legs_are_those_given(tmp_path):
    urdf = Path(shutil.copy(URDF, tmp_path))
    for _ in range(2):
        given, steps = args(tmp_path, urdf=urdf, forward='-y', legs=['lf=lf_', 'rf=rf_']), Made()
        assert demo_parts.name_of(given) == 'quadruped_facing_x'
        demo_parts.prepare(given, steps)
        turned = tmp_path / 'quadruped_facing_x.urdf'
        assert given.urdf == turned
        assert all(str(turned) in words for words in steps.words)
    assert not steps.words and load_urdf(turned).root() == 'facing_x'


def test_gains_of_servos_tune_the_robot_and_drive_it(tmp_path):
    given = args(tmp_path, kp=14.0, kd=0.35, film=False, course=False)
    steps = Made()
    robot = demo_parts.prepare(given, steps)
    assert all(words[-4:] == ['--kp', '14', '--kd', '0.35'] for words in steps.words[1:])
    body, _ = tool._nodes(given, robot)
    assert 'kp:=14.0' in body and 'kd:=0.35' in body


@pytest.mark.parametrize(('trot', 'walk', 'first'), [
    ('poor: falls after 2.1 s', 'good: 0.20 m/s', 'walk'),
    ('good: 0.50 m/s', 'poor: 0.02 m/s', 'trot'),
    ('poor: 0.05 m/s', 'poor: 0.02 m/s', 'trot')])
def test_the_best_gait_by_its_verdict_is_the_first_and_a_poor_one_is_said(
        tmp_path, capsys, trot, walk, first):
    robot = load_robot(str(FILE))
    motions = {gait: replace(robot.motions[gait], verdict=verdict)
               for gait, verdict in (('trot', trot), ('walk', walk))}
    for name in ('quadruped.yaml', 'quadruped_tuned.yaml'):
        write_robot(tmp_path / name, replace(robot, motions=motions))
    assert demo_parts.prepare(args(tmp_path), Made()).gaits[0] == first
    said = capsys.readouterr().out
    assert f'trot ({trot})' in said and f'walk ({walk})' in said
    poor = motions[first].verdict.startswith('poor')
    assert (f'begins with the {first}, which is poor' in said) == poor


def test_an_old_file_is_used_again_and_that_it_is_old_is_said(tmp_path, capsys):
    for name in ('quadruped.yaml', 'quadruped_tuned.yaml'):
        shutil.copy(FILE, tmp_path / name)
    os.utime(tmp_path / 'quadruped_tuned.yaml', (1e9, 1e9))
    demo_parts.prepare(args(tmp_path), Made())
    said = capsys.readouterr().out.splitlines()
    assert 'has changed since' in said[2]


@pytest.mark.parametrize(('codes', 'code', 'count'), [
    ((2,), 2, 1), ((0, 2), 2, 2), ((0, 1, 1), 1, 3)])
def test_what_fails_ends_the_steps_with_its_code(tmp_path, codes, code, count):
    steps = Made(*codes)
    with pytest.raises(StepFailed) as error:
        demo_parts.prepare(args(tmp_path), steps)
    assert error.value.code == code and len(steps.words) == count


def test_a_gait_that_cannot_be_had_does_not_stop_the_other(tmp_path, capsys):
    assert demo_parts.prepare(args(tmp_path), Made(0, 1)).gaits
    assert 'no gait is good' not in capsys.readouterr().out


def test_where_no_gait_is_good_it_says_what_to_try(tmp_path, capsys):
    assert demo_parts.prepare(args(tmp_path), Made(0, 1, 1, writing=(0, 1))).gaits
    assert (
        f"no gait is good: delete {tmp_path / 'quadruped_tuned.yaml'}, and search longer with "
        '--evaluations 240, or give stiffer joints with --kp and --kd\n'
    ) in capsys.readouterr().out


@pytest.mark.parametrize(('arguments', 'words'), [
    (['--urdf', 'no.urdf'], 'URDF no.urdf: No such file'),
    (['--urdf', __file__], 'not'),
    (['--mjcf', 'no.xml'], 'model no.xml: no such file'),
    (['--urdf', str(URDF), '--evaluations', '0'], '0 is not positive'),
    (['--urdf', str(URDF), '--mjcf', 'go2'], 'not allowed with'),
    (['--urdf', str(URDF), '--course'], 'not with a robot of your own'),
    (['--kp', '8'], '--kp: only with --urdf or --mjcf'),
    (['--velocity', '8'], 'only with --urdf or --mjcf')])
def test_what_cannot_be_used_ends_in_one_line_before_anything_is_written(
        arguments, words, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    try:
        code = tool.main(arguments)
    except SystemExit as end:
        code = end.code
    said = capsys.readouterr()
    assert code == 2 and words in said.err and said.err.count('\n') == 1 and not said.out
    assert not list(tmp_path.iterdir())


def test_the_page_says_what_goes_on_and_a_stop_leaves_whole_files_only(tmp_path):
    with demo(tmp_path, '--urdf', URDF, '--tour', 'trot') as process:
        line = until(lambda: re.search(rb'in a browser: (http://\S+)', process.stdout.readline()),
                     'the address')
        page = Client(line[1].decode())
        until(lambda: 'tuning the trot' in page.last.get('state', {}).get('starting', ''),
              'the second step')
        nodes = nodes_of(process)
        process.send_signal(signal.SIGINT)
        output, _ = process.communicate(timeout=60)
        assert process.returncode == 0 and b'Traceback' not in output
        assert not any(alive(pid) for pid in nodes)
    assert [file.name for file in tmp_path.iterdir()] == ['quadruped.yaml']


@pytest.mark.parametrize('text', ['<robot name="r"><link name="base"/></robot>', '<robot'])
def test_a_useless_urdf_leaves_no_folder(tmp_path, text, capsys, monkeypatch):
    monkeypatch.chdir(tmp_path)
    Path('my.urdf').write_text(text)
    assert tool.main(['--urdf', 'my.urdf']) == 2
    assert capsys.readouterr().err.count('\n') == 1
    assert [file.name for file in tmp_path.iterdir()] == ['my.urdf']


@pytest.mark.deep
def test_one_command_makes_a_robot_that_is_driven(tmp_path):
    with demo(tmp_path, '--urdf', URDF, '--evaluations', '1', '--tour', 'trot', '--every', '2',
              '--no-panel') as process:
        output, _ = process.communicate(timeout=400)
        assert process.returncode == 0
        said = output.decode()
        assert all(f'step {k}: took' in said for k in (1, 2)) and 'assumed: ' in said
        assert re.search(r'^ +\d+\.\d s  trot ', said, re.MULTILINE)
    assert {'quadruped.yaml', 'quadruped_tuned.yaml'} < {file.name for file in tmp_path.iterdir()}
