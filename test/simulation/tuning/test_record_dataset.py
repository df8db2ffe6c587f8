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

"""A labelled set of simulated walks: what is recorded, what is said of it, and what is refused."""

import hashlib
from pathlib import Path
import sys

from cpg_ros import read_recording
from cpg_ros.fitting.inversion.recording_fit import fit_recording
from cpg_ros.fitting.recordings.joint_streams import Servo
from cpg_ros.motion.robot_file import load_robot
import numpy as np
import pytest
from rosbags.rosbag2 import Reader
import yaml

sys.path.append(str(Path(__file__).parents[3] / 'benchmarks'))
from record_dataset import main  # noqa: E402

KEPT = Path(__file__).parents[2] / 'data' / 'simulated_walks'
WALKS = sorted(path.name for path in KEPT.glob('unitree_go2_*'))
OF_THE_GO2 = ('--robot', 'unitree_go2', '--gait', 'trot', '--seconds', '6', '--rate', '50')


def truth_of(folder):
    return yaml.safe_load((folder / 'truth.yaml').read_text())


@pytest.mark.parametrize('name', WALKS)
def test_a_walk_that_is_kept_is_named_by_its_inversion(name):
    truth = truth_of(KEPT / name)
    found = fit_recording(read_recording(KEPT / name / 'bag', progress=False),
                          load_robot('unitree_go2'), 'delayed', free=['tau'])
    assert found.stride.gait == truth['gait'] == 'trot'
    assert found.confidence > 0.95
    # Feedback quickens strides after a push, and on rough ground.
    assert found.stride.frequency == pytest.approx(truth['frequency'], rel=0.03)
    for leg, fraction in truth['duty'].items():
        assert found.stride.contacts.duty[leg] == pytest.approx(fraction, abs=0.1)
    # Joints gave way to the loads by nobody knows how much; commands did not.
    assert any(line.startswith('feet bore loads, ') and line.endswith('tau: cannot tell')
               for line in found.warnings)
    assert not found.fit.parameters['tau'].bounded
    # By what joints did, and by what their servos were sent.
    sent = read_recording(KEPT / name / 'bag', progress=False, servo=Servo(**truth['servo']))
    tau = fit_recording(sent, load_robot('unitree_go2'), 'delayed',
                        free=['tau']).fit.parameters['tau']
    assert tau.low < truth['parameters']['tau'] < tau.high and tau.bounded


def test_a_set_is_what_its_card_says(tmp_path, capsys):
    pytest.importorskip('mujoco', reason='the extra [sim] is not installed')
    out = tmp_path / 'walks'
    assert main([*OF_THE_GO2, '--seed', '41', '--out', str(out)]) == 0
    assert [path.name for path in tmp_path.iterdir()] == ['walks']
    assert f'written: {out}' in capsys.readouterr().out
    assert sorted(path.name for path in out.iterdir()) == ['README.md', *WALKS]
    assert (out / 'README.md').read_text() == (KEPT / 'README.md').read_text()
    for name in WALKS:
        made, kept = truth_of(out / name), truth_of(KEPT / name)
        for key in set(made) - {'duty', 'fell'}:
            assert made[key] == kept[key], key
    assert [len(truth_of(out / name)['pushes']) for name in WALKS] == [0, 1, 0]
    pushed = truth_of(out / WALKS[1])
    assert 8.0 <= np.hypot(*pushed['pushes'][0][1:]) <= 20.0
    with Reader(out / WALKS[1] / 'bag') as bag:
        assert {topic: one.msgcount for topic, one in bag.topics.items()} == {
            '/joint_states': 300, '/imu': 300, '/foot_contacts': 300}
    robot = load_robot('unitree_go2')
    assert set(pushed['readouts']) == {joint.name for joint in robot.joints}
    assert pushed['parameters']['tau'] == 0.4


@pytest.mark.deep
def test_the_same_seed_makes_the_same_set(tmp_path):
    pytest.importorskip('mujoco', reason='the extra [sim] is not installed')

    def made(name, seed):
        assert main([*OF_THE_GO2, '--seed', seed, '--out', str(tmp_path / name)]) == 0
        return {path.parent.parent.name: hashlib.sha256(path.read_bytes()).digest()
                for path in (tmp_path / name).glob('*/bag/*.mcap')}
    first = made('one', '3')
    assert len(first) == 3 and made('two', '3') == first
    assert not set(made('three', '4').values()) & set(first.values())


@pytest.mark.parametrize(('words', 'line'), [
    (['--gait', 'wlk'], "gait 'wlk' of unitree_go2: unknown; it has walk, trot"),
    (['--seconds', '5'], 'argument --seconds: 5 is not from 6 to 600'),
    (['--rate', '33'], 'argument --rate: 33 Hz is none of 20, 25, 50'),
    (['--seed', '-1'], 'argument --seed: -1 is less than 0'),
    (['--robot', 'goat'], 'argument --robot: give the model of goat, too (--model)')])
def test_what_cannot_be_recorded_is_one_line_and_leaves_nothing(tmp_path, capsys, words, line):
    out = tmp_path / 'walks'
    assert main(['--robot', 'unitree_go2', '--out', str(out), *words]) == 2
    said = capsys.readouterr().err
    assert line in said and len(said.splitlines()) == 1
    assert not list(tmp_path.iterdir())


def test_a_folder_that_is_there_is_not_touched(tmp_path, capsys):
    (tmp_path / 'walks').mkdir()
    assert main([*OF_THE_GO2, '--out', str(tmp_path / 'walks')]) == 2
    assert 'walks already exists' in capsys.readouterr().err
    assert not list((tmp_path / 'walks').iterdir())


def test_a_stop_leaves_nothing(tmp_path, capsys, monkeypatch):
    def stopped(*_):
        raise KeyboardInterrupt
    monkeypatch.setattr('record_dataset.walks', stopped)
    assert main([*OF_THE_GO2, '--out', str(tmp_path / 'walks')]) == 130
    assert capsys.readouterr().err == 'record_dataset: stopped, nothing written\n'
    assert not list(tmp_path.iterdir())
