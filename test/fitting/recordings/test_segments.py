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

"""Files of segments: the shipped ones, and what is wrong with others, in one line."""

from cpg_ros.fitting.recordings.markers import load_segments, shipped
from cpg_ros.fitting.recordings.recording import RecordingError
import pytest

GOOD = 'segments: {a: [x, y], b: [[y, z], w]}\njoints: {knee: {between: [a, b]}}\n'


def test_shipped_files_are_read():
    assert shipped() == ['dog_skeleton', 'human_key_points', 'human_plug_in_gait',
                         'mouse_side_view', 'quadruped_side_view']
    for name in shipped():
        assert len(load_segments(name).joints) >= 6
    mouse = load_segments('mouse_side_view')
    assert mouse.markers('hind_knee', solid=False) == ('Hip', 'Knee', 'Ankle')
    human = load_segments('human_plug_in_gait')
    assert human.markers('left_knee', solid=False) == ('LASI', 'LPSI', 'LKNE', 'LANK')
    assert set(human.markers('left_knee', solid=True)) >= {'RASI', 'RPSI'}


def test_a_file_of_ones_own(tmp_path):
    path = tmp_path / 'own.yaml'
    path.write_text(GOOD + 'least_likelihood: 0.9\n')
    found = load_segments(path)
    assert found.segments['b'].begin == ('y', 'z') and found.segments['b'].end == ('w',)
    assert found.least_likelihood == 0.9 and found.joints['knee'].neutral == 0.0


@pytest.mark.parametrize(('text', 'words'), [
    ('', r'file: must be a mapping'),
    ('segments: {a: [x, y]}', r'file\.joints: is missing'),
    (GOOD + 'colour: red', r'file\.colour: unknown key'),
    (GOOD.replace('[x, y]', '[x]'), r'segments\.a: has two ends, not 1'),
    (GOOD.replace('[x, y]', '[x, 5]'), r'segments\.a\[1\]: must be a name, not 5'),
    (GOOD.replace('[x, y]', '[x, x]'), r'segments\.a: begins and ends at the same marker'),
    (GOOD.replace('[a, b]', '[a, c]'), r"joints\.knee: there is no segment 'c', only 'a', 'b'"),
    (GOOD.replace('[a, b]', '[a, a]'), r'joints\.knee\.between: must be two segments'),
    (GOOD.replace('[a, b]', '[a, b], axis: q'), r"joints\.knee: there is no segment 'q'"),
    (GOOD.replace('[a, b]', '[a, b], neutral: 90'), r'neutral: 90 rad is more than half a turn'),
    (GOOD.replace('[a, b]', '[a, b], neutral: .nan'), r'neutral: must be finite'),
    (GOOD + 'alternatives: {x: q}', r'alternatives\.x: must be a list'),
    (GOOD + 'least_likelihood: 60', r'least_likelihood: 60 is not from 0 to 1'),
    ('segments: [a', r'line \d'),
])
def test_what_is_wrong_is_said_with_its_place(tmp_path, text, words):
    path = tmp_path / 'own.yaml'
    path.write_text(text)
    with pytest.raises(RecordingError, match=words) as raised:
        load_segments(path)
    assert str(raised.value).startswith(f'segments {path}: ') and '\n' not in str(raised.value)


def test_a_name_that_is_no_file():
    with pytest.raises(RecordingError, match="shipped are 'dog_skeleton', 'human_key_p"):
        load_segments('horse')
