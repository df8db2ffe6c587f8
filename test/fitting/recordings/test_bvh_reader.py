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

"""BVH files: rotations come back in rad, and what is wrong is named."""

import cpg_ros
from cpg_ros.fitting.recordings.bvh_reader import read_bvh
from cpg_ros.fitting.recordings.recording import RecordingError
import numpy as np
import pytest

HEAD = """\
HIERARCHY
ROOT Hips
{
\tOFFSET 0.0 0.0 0.0
\tCHANNELS 6 Xposition Yposition Zposition Zrotation Xrotation Yrotation
\tJOINT LeftUpLeg
\t{
\t\tOFFSET 3.9 0.0 0.0
\t\tCHANNELS 3 Zrotation Xrotation Yrotation
\t\tEnd Site
\t\t{
\t\t\tOFFSET 0.0 -7.0 0.0
\t\t}
\t}
\tJOINT RightUpLeg {
\t\tOFFSET -3.9 0.0 0.0
\t\tCHANNELS 3 Zrotation Xrotation Yrotation
\t}
}
MOTION
Frames: 50
Frame Time: 0.02
"""
RNG = np.random.default_rng(5)
ROWS = np.cumsum(RNG.uniform(-40.0, 60.0, (50, 12)), axis=0)
ROWS[:, 5] = 90.0
#: As a file has them, which jumps from 180 to -180.
WRAPPED = (ROWS + 180.0) % 360.0 - 180.0


def text(rows=WRAPPED, head=HEAD):
    return head + '\n'.join(' '.join(f'{x:.6f}' for x in row) for row in rows) + '\n'


def read(tmp_path, content, **options):
    path = tmp_path / 'walk.bvh'
    path.write_text(content)
    return read_bvh(path, **options)


def test_rotations_come_back_without_jumps(tmp_path):
    found = read(tmp_path, text())
    assert found.joints == ('Hips_z', 'Hips_x', 'LeftUpLeg_z', 'LeftUpLeg_x', 'LeftUpLeg_y',
                            'RightUpLeg_z', 'RightUpLeg_x', 'RightUpLeg_y')
    assert found.notes == ('1 channel left out: no motion',)
    expected = np.radians(ROWS[:, [3, 4, *range(6, 12)]])
    expected += np.radians(WRAPPED[0] - ROWS[0])[[3, 4, *range(6, 12)]]
    assert found.positions == pytest.approx(expected, abs=1e-7)
    assert found.times == pytest.approx(0.02 * np.arange(50))
    assert read(tmp_path, text(), joints=['Right*_x', 'Hips_y']).joints == ('RightUpLeg_x',
                                                                           'Hips_y')
    assert cpg_ros.read_recording(tmp_path / 'walk.bvh', progress=False).joints == found.joints


def test_a_cut_file_is_read_to_its_last_whole_frame(tmp_path):
    found = read(tmp_path, text()[:-60])
    assert len(found.times) == 49
    assert found.notes[:2] == ('line 72 is cut, left out', '49 frames, where the file states 50')


@pytest.mark.parametrize(('content', 'words'), [
    ('', "not a BVH file: it does not begin with 'HIERARCHY'"),
    (text()[:200], "no line 'MOTION' follows the tree"),
    (text().replace('3 Zrot', '4 Zrot', 1), "channels of 'LeftUpLeg', '4', 'Zrotation'"),
    (text().replace('Xrotation', 'Wrotation'), "channels of 'Hips'"),
    (text().replace('}\n}\nMOTION', '}\nMOTION'), 'not as many braces close as open'),
    (text().replace('ROOT Hips', 'ROOT'), 'a ROOT without a name'),
    (text().replace('0.02', '0'), r'1e-6 to 10 s\) have to follow, not 50 and 0'),
    (text().replace('0.02', 'fast'), "line 22: 'fast' is not a number"),
    (text().replace('Frames: 50\n', ''), 'have to follow, not nan and'),
    (text(np.zeros((0, 12))), 'no frames'),
    (text(np.zeros((5, 12))), 'no joint moves in 5 frames'),
    (text().replace('RightUpLeg', 'LeftUpLeg'), "joint 'LeftUpLeg_z' is named twice"),
    (text() + '1 2 3\n4 5\n', 'line 73: 3 columns, where the header has 12'),
])
def test_what_is_wrong_is_said(tmp_path, content, words):
    with pytest.raises(RecordingError, match=words):
        read(tmp_path, content)
