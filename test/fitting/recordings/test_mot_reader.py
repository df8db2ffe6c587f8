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

"""Files of OpenSim: a real one against its own text, and made ones."""

from pathlib import Path

import cpg_ros
from cpg_ros.fitting.recordings.formats import format_of
from cpg_ros.fitting.recordings.opensim_reader import read_mot
from cpg_ros.fitting.recordings.recording import RecordingError
import numpy as np
import pytest

RUNNING = Path(__file__).parents[2] / 'data' / 'human_running.mot'


def test_a_motion_is_in_degrees_and_without_its_translations():
    found = cpg_ros.read_recording(RUNNING, progress=False)
    lines = RUNNING.read_text().splitlines()
    at = lines.index('endheader') + 1
    columns, rows = lines[at].split(), np.loadtxt(lines[at + 1:])
    translations = ['pelvis_tx', 'pelvis_ty', 'pelvis_tz']
    kept = [k for k, name in enumerate(columns) if k and name not in translations]
    assert found.joints == tuple(columns[k] for k in kept)
    assert found.positions == pytest.approx(np.radians(rows[:, kept]))
    assert found.times == pytest.approx(rows[:, 0] - rows[0, 0])
    assert found.notes == ('3 columns left out, no angles: '
                           "'pelvis_tx', 'pelvis_ty', 'pelvis_tz'",)
    some = read_mot(RUNNING, joints=['knee_angle_?', 'hip_flexion_l'], progress=False)
    assert some.joints == ('knee_angle_r', 'knee_angle_l', 'hip_flexion_l')


STATES = """\
states
version=1
nRows=3
nColumns=4
endheader
time\t/jointset/hip_r/hip_flexion_r/value\t/jointset/hip_r/hip_flexion_r/speed\t/forceset/soleus/activation
0\t0.1\t5\t0.2
0.1\t0.2\t6\t0.2
"""


def test_states_are_in_rad_and_named_by_their_coordinates(tmp_path):
    path = tmp_path / 'states.sto'
    path.write_text(STATES)
    assert format_of(path).name == 'mot'
    found = read_mot(path, progress=False)
    assert found.joints == ('hip_flexion_r',)
    assert found.positions[:, 0] == pytest.approx([0.1, 0.2])
    assert found.notes[0].startswith("the header has no 'inDegrees': the angles are taken to be")
    assert found.notes[1].startswith('2 columns left out')
    assert found.notes[2] == '2 rows, where the header states 3'
    assert read_mot(path, unit='deg').positions[:, 0] == pytest.approx(np.radians([0.1, 0.2]))


@pytest.mark.parametrize(('text', 'words'), [
    ('', "not a file of OpenSim: it has no line 'endheader'"),
    ('time,hip\n0,1\n', "no line 'endheader'"),
    ('a\nendheader\n', "the first column has to be 'time', not missing"),
    ('a\nendheader\nhip\ttime\n1\t2\n', "the first column has to be 'time', not 'hip'"),
    ('a\nendheader\ntime\tground_force_vx\tground_torque_x\n0\t1\t2\n',
     "no column of joint angles; there are 'ground_force_vx'"),
    ('a\nendheader\ntime\tx/value\ty/x/value\n0\t1\t2\n', "joint 'x' is named twice"),
    (STATES.replace('0.2\t6', 'up\t6'), "line 8, column .*: 'up' is not a number"),
    (STATES.partition('0\t')[0], 'no samples'),
])
def test_what_is_wrong_is_said(tmp_path, text, words):
    path = tmp_path / 'ik.mot'
    path.write_text(text)
    with pytest.raises(RecordingError, match=words):
        read_mot(path, progress=False)


def test_a_declared_unit_is_not_overruled():
    with pytest.raises(RecordingError, match='its preamble says deg, not rad'):
        read_mot(RUNNING, unit='rad', progress=False)


def test_delimiters_at_the_ends_of_all_lines_and_speeds_beside_states(tmp_path):
    path = tmp_path / 'states.sto'
    text = ('walk\nversion=1\nnRows=2\ninDegrees=yes\nendheader\ntime\tknee_r\tknee_r_u\n'
            '0\t10\t7\n1\t20\t8\n')
    path.write_text(text)
    plain = read_mot(path, progress=False)
    assert plain.joints == ('knee_r',) and plain.positions[1] == pytest.approx(np.radians(20.0))
    path.write_text(text.replace('\n', '\t\t\n'))
    filled = read_mot(path, progress=False)
    assert filled.joints == ('knee_r',)
    assert filled.positions.tolist() == plain.positions.tolist()
