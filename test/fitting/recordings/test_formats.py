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

"""Formats of recordings: the front door chooses one, and one more is a file and its name."""

import json
import subprocess
import sys

from bags import storage_file, walk, write_bag
import cpg_ros
from cpg_ros.common.errors import InputError
from cpg_ros.fitting.inversion.inversion import main
from cpg_ros.fitting.inversion.results import recordings_in
from cpg_ros.fitting.recordings.formats import FORMATS
from cpg_ros.fitting.recordings.recording import (
    JOINTS,
    merge_chunks,
    Option,
    RecordingError,
    RecordingFormat,
)
import numpy as np
import pytest


@pytest.fixture
def table(tmp_path):
    path = tmp_path / 'walk.csv'
    path.write_text('time,hip [deg],knee\n0,180,1\n0.1,90,2\n')
    return path


@pytest.fixture
def bag(tmp_path):
    return write_bag(tmp_path / 'bag', walk(20)[0], storage='mcap')


def test_the_path_decides(table, bag, tmp_path):
    recordings_in = cpg_ros.read_recording(table, progress=False)
    assert recordings_in.positions == pytest.approx(np.array([[np.pi, 1.0], [np.pi / 2, 2.0]]))
    whole, file = (cpg_ros.read_recording(path, progress=False)
                   for path in (bag, storage_file(bag)))
    assert whole.joints == file.joints and np.array_equal(whole.positions, file.positions)
    # A name that says nothing is read as what it is declared to be.
    other = table.rename(tmp_path / 'walk.txt')
    assert cpg_ros.read_recording(other, 'csv', progress=False).joints == ('hip', 'knee')
    with pytest.raises(RecordingError, match=r'walk\.txt: not a recording: .* \.mcap, .*\.csv'):
        cpg_ros.read_recording(other)


def test_options_go_to_the_reader_or_are_refused(table, bag):
    recordings_in = cpg_ros.read_recording(table, unit='deg', joints=['knee'], progress=False)
    assert recordings_in.joints == ('knee',)
    assert recordings_in.positions[0, 0] == pytest.approx(np.radians(1.0))
    recordings_in = cpg_ros.read_recording(bag, robot_joints=['lh_hip', 'tail'], progress=False)
    assert recordings_in.joints == ('lh_hip',)
    for path, option, words in ((table, {'topics': ['/a']}, 'topics: a CSV file has none'),
                                (bag, {'unit': 'deg'}, 'unit: joint states are in rad'),
                                (bag, {'colour': 'red'}, 'colour: bag recordings have none')):
        with pytest.raises(InputError, match=words):
            cpg_ros.read_recording(path, **option)
    # What counts as not given is refused by none.
    assert cpg_ros.read_recording(table, topics=(), servo=None, progress=False)
    with pytest.raises(InputError, match="no format 'xyz' of recordings; there are 'bag', 'csv'"):
        cpg_ros.read_recording(table, 'xyz')


def read_steps(path, joints=(), rate=None, progress=True):
    """Read a recording that is made here: a list of lists, at so many rows a second."""
    try:
        tree = json.loads(path.read_text())
    except ValueError as error:
        raise RecordingError(f'{path}: {error}') from error
    rows = np.array(tree['angles'])
    stamps = np.round(1e9 / float(rate or 50) * np.arange(len(rows))).astype(np.int64)
    return merge_chunks([(stamps, tree['joints'], rows)], str(path), joints)


STEPS = RecordingFormat('steps', 'a file of steps', 'rows of angles', 'JSON', read_steps,
                        ('.steps',), (JOINTS, Option('rate', 'rows a second', 'HZ')))


@pytest.fixture
def steps(monkeypatch, tmp_path):
    monkeypatch.setitem(FORMATS, 'steps', STEPS)
    turn = 2.0 * np.pi * (1.5 * np.arange(400) / 50.0 + np.array([0.0, 0.5, 0.5, 0.0])[:, None])
    path = tmp_path / 'walk.steps'
    path.write_text(json.dumps({
        'joints': [f'{leg}_{joint}' for joint in ('hip', 'knee')
                   for leg in ('lh', 'rh', 'lf', 'rf')],
        'angles': np.concatenate([0.3 * np.cos(turn), 0.3 * np.sin(turn)]).T.tolist()}))
    return path


def test_a_format_of_ones_own_is_read_by_the_tool_and_found_in_folders(steps, bag, capsys):
    assert cpg_ros.read_recording(steps, rate=100.0).times[1] == pytest.approx(0.01)
    assert list(recordings_in([steps.parent])) == [bag, steps]
    assert main(['--steps', str(steps), '--order', '1', '--free', 'tau', '--json']) == 0
    fitted = json.loads(capsys.readouterr().out)
    assert fitted['gait'] == 'trot' and fitted['frequency'] == pytest.approx(1.5, rel=1e-3)
    for arguments, words in ((['--unit', 'deg'], '--unit: steps recordings have none'),
                             (['--kp', '5'], '--kp: steps recordings have none')):
        assert main(['--steps', str(steps), *arguments]) == 2
        assert words in capsys.readouterr().err
    assert main(['--bag', str(bag), '--rate', '5']) == 2
    assert '--rate: bag recordings have none' in capsys.readouterr().err
    steps.write_text('[')
    assert main(['--steps', str(steps)]) == 2
    assert capsys.readouterr().err.startswith(f'inversion: {steps}: Expecting')
    with pytest.raises(SystemExit):
        main(['--help'])
    text = ' '.join(capsys.readouterr().out.split())
    assert ', or a file of steps.' in text
    assert 'Without a recording,' in text


def test_the_help_lists_the_formats_that_come_with_the_package():
    text = subprocess.run([sys.executable, '-P', '-m', 'cpg_ros.fitting.inversion.inversion',
                           '--help'],
                          capture_output=True, text=True, check=True).stdout
    assert '(--bag DIR | --bags FOLDER [FOLDER ...] | --csv FILE | --mot FILE' in text
    assert text.index('--topics') < text.index('--joints') < text.index('--unit')
