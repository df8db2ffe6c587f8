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

"""TRC files: markers come back, gaps are gaps, and what is wrong is named."""

from cpg_ros.fitting.recordings.opensim_reader import read_trc, trc_markers
from cpg_ros.fitting.recordings.recording import RecordingError
import numpy as np
import pytest
from skeletons import angles, LABELS, places, trc

TIME = np.arange(30) / 100.0
POINTS = places(angles(TIME))


def read(tmp_path, text):
    path = tmp_path / 'walk.trc'
    path.write_text(text)
    return trc_markers(path)


def test_markers_come_back_and_gaps_are_nan(tmp_path):
    points = POINTS.copy()
    points[3, 2], points[4, 5] = np.nan, 0.0
    found = read(tmp_path, trc(TIME, points))
    points[4, 5] = np.nan
    assert found.names == LABELS and not found.notes
    assert found.stamps == pytest.approx(1e9 * TIME)
    np.testing.assert_allclose(found.points, 1000.0 * points, atol=1e-6)
    # A subject before the colon is not part of a marker's name.
    found = read(tmp_path, trc(TIME, POINTS, [f'Anna:{name}' for name in LABELS]))
    assert found.names == LABELS


def test_a_cut_file_is_read_to_its_last_whole_row(tmp_path):
    found = read(tmp_path, trc(TIME, POINTS)[:-200])
    assert len(found.stamps) == 29
    assert found.notes == ('line 36 is cut, left out', '29 rows, where NumFrames is 30')


@pytest.mark.parametrize(('change', 'words'), [
    (lambda text: '', "not a TRC file: it does not begin with 'PathFileType'"),
    (lambda text: text[:200], 'no rows'),
    (lambda text: text.replace('RTOE', ''), 'columns, where the header has 35'),
    (lambda text: text.replace('Frame#', 'Frames'), "line 4: the columns have to be 'Frame#'"),
    (lambda text: text.replace('\t0.050000', '\t?'),
     r"line 12, column 'Time': '\?' is not a number"),
    (lambda text: text.replace('\t0.050000', '\tnan'), '1 row without a time in s, such as f'),
    (lambda text: text.replace('\t0.050000', '\t1e30'), '1 row without a time in s'),
    (lambda text: text.replace('\n6\t', '\n6\t7\t'), 'line 12: 39 columns, where the header has'),
    (lambda text: text.partition('\n1\t')[0], 'no rows'),
])
def test_what_is_wrong_is_said(tmp_path, change, words):
    with pytest.raises(RecordingError, match=words):
        read(tmp_path, change(trc(TIME, POINTS)))


def test_a_wrong_number_of_markers_and_delimiters_at_the_ends_of_lines(tmp_path):
    text = trc(TIME, POINTS)
    wrong = read(tmp_path, text.replace('\t12\t', '\t11\t', 1))
    assert wrong.names == LABELS and '12 markers, where NumMarkers is 11' in wrong.notes
    filled = read(tmp_path, text.replace('\n', '\t\t\t\n'))
    np.testing.assert_allclose(filled.points, wrong.points)


def test_of_equal_labels_the_one_with_data_is_taken(tmp_path):
    points = np.concatenate([POINTS[:, :1] * 0.0, POINTS], axis=1)
    found = read(tmp_path, trc(TIME, points, [LABELS[0], *LABELS]))
    assert found.names == (f'{LABELS[0]}#2', *LABELS)
    np.testing.assert_allclose(found.points[:, 1:], 1000.0 * POINTS, atol=1e-6)
    assert f"2 markers are called '{LABELS[0]}': the one seen in 30 samples" in found.notes[0]


def test_subjects_are_kept_where_names_would_be_there_twice(tmp_path):
    two = np.concatenate([POINTS, POINTS + 1.0], axis=1)
    found = read(tmp_path, trc(TIME, two, [f'{who}:{name}' for who in ('Anna', 'Bert')
                                           for name in LABELS]))
    assert found.names[0] == f'Anna:{LABELS[0]}' and found.names[12] == f'Bert:{LABELS[0]}'


def test_a_sacral_marker_stands_for_those_at_the_back_of_the_pelvis(tmp_path):
    back = [LABELS.index('LPSI'), LABELS.index('RPSI')]
    kept = [k for k in range(12) if k not in back]
    points = np.concatenate([POINTS[:, kept], POINTS[:, back].mean(axis=1, keepdims=True)], axis=1)
    path = tmp_path / 'walk.trc'
    path.write_text(trc(TIME, points, [*(LABELS[k] for k in kept), 'SACR']))
    recording = read_trc(path, 'human_plug_in_gait')
    assert recording.joints == ('left_hip', 'left_knee', 'left_ankle',
                                'right_hip', 'right_knee', 'right_ankle')
    moved = recording.positions - recording.positions.mean(axis=0)
    expected = angles(TIME) - angles(TIME).mean(axis=0)
    assert np.abs(moved - expected).max() < 0.1
