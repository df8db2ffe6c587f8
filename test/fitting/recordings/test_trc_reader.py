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

from cpg_ros.fitting.recordings.opensim_reader import trc_markers
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
    (lambda text: '', "no TRC file: it does not begin with 'PathFileType'"),
    (lambda text: text[:200], r'line 4: \d+ markers?, where NumMarkers is 12'),
    (lambda text: text.replace('RTOE', ''), '11 markers, where NumMarkers is 12'),
    (lambda text: text.replace('Frame#', 'Frames'), "line 4: the columns have to be 'Frame#'"),
    (lambda text: text.replace('\t0.050000', '\t?'), r"line 12: '\?' is not a number"),
    (lambda text: text.replace('\t0.050000', '\tnan'), '1 row without a time in s, such as f'),
    (lambda text: text.replace('\t0.050000', '\t1e30'), '1 row without a time in s'),
    (lambda text: text.replace('\n6\t', '\n6\t7\t'), 'line 12: 39 columns, where there should be'),
    (lambda text: text.partition('\n1\t')[0], 'no rows'),
])
def test_what_is_wrong_is_said(tmp_path, change, words):
    with pytest.raises(RecordingError, match=words):
        read(tmp_path, change(trc(TIME, POINTS)))
