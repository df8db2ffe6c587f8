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

"""Archives of numpy's arrays: angles come back, however they are arranged."""

import cpg_ros
from cpg_ros.fitting.recordings.npz_reader import read_npz
from cpg_ros.fitting.recordings.recording import RecordingError
import numpy as np
import pytest

TIME = np.arange(30) / 50.0
HIP, KNEE = np.cos(TIME), np.sin(TIME)
BOTH = np.column_stack([HIP, KNEE])


def read(tmp_path, options=None, **arrays):
    path = tmp_path / 'walk.npz'
    np.savez(path, **arrays)
    return read_npz(path, **(options or {}))


def test_a_table_with_names_or_an_array_per_joint(tmp_path):
    for arrays in ({'time': TIME, 'positions': BOTH, 'joints': ['hip', 'knee']},
                   {'time': TIME, 'hip': HIP, 'knee': KNEE},
                   {'fps': 50, 'hip': HIP, 'knee': KNEE},
                   {'t': TIME, 'qpos': np.degrees(BOTH), 'names': ['hip', 'knee'], 'unit': 'deg'}):
        found = read(tmp_path, **arrays)
        assert found.joints == ('hip', 'knee')
        assert found.positions == pytest.approx(BOTH)
        assert found.times == pytest.approx(TIME)
        guessed = "no array 'unit': the angles are taken to be in rad"
        assert (guessed in found.notes) == ('unit' not in arrays)
    assert cpg_ros.read_recording(tmp_path / 'walk.npz', progress=False).joints == found.joints


def test_options_say_what_the_archive_does_not(tmp_path):
    found = read(tmp_path, {'unit': 'deg', 'fps': '50', 'joints': ['k*']},
                 hip=np.degrees(HIP), knee=np.degrees(KNEE), mass=np.zeros((2, 2)))
    assert found.joints == ('knee',) and found.positions[:, 0] == pytest.approx(KNEE)
    assert found.times == pytest.approx(TIME)
    assert found.notes == ("1 array left out: 'mass'",)


@pytest.mark.parametrize(('arrays', 'options', 'words'), [
    ({}, {}, "neither 'positions' with 'joints' nor an array per joint"),
    ({'hip': HIP}, {}, r'it has no times: give the frames a second \(fps\)'),
    ({'hip': HIP, 'knee': KNEE[:9]}, {'fps': 9}, r"different lengths, 'hip \(30,\)', 'knee \(9,"),
    ({'positions': BOTH, 'time': TIME}, {}, "columns of 'positions' have no names"),
    ({'positions': BOTH, 'time': TIME, 'joints': ['a']}, {}, "'joints' are 1 of type"),
    ({'positions': BOTH, 'time': TIME, 'joints': ['a', 'a']}, {}, "joint 'a' is named twice"),
    ({'positions': BOTH, 'time': TIME[:3], 'joints': ['a', 'b']}, {}, r"'time' of shape \(3,\)"),
    ({'hip': HIP, 'time': np.full(30, 1e30)}, {}, "'time' has values that are no times in s"),
    ({'hip': HIP, 'time': np.full(30, np.nan)}, {}, "'time' has values that are no times in s"),
    ({'hip': HIP, 'fps': [1, 2]}, {}, "'fps' is not one number"),
    ({'hip': HIP, 'fps': 0}, {}, '0.0 frames a second are not from'),
    ({'hip': HIP, 'fps': 50, 'unit': 'grad'}, {}, "unit 'grad' is none of 'rad'"),
    ({'hip': HIP, 'fps': 50, 'unit': 'deg'}, {'unit': 'rad'}, 'its angles are in deg, not rad'),
    ({'hip': np.array([HIP, 'x'], object), 'fps': 50}, {}, 'Object arrays cannot be loaded'),
    ({'hip': np.full(30, np.nan), 'fps': 50}, {}, "no finite position of joint 'hip'"),
    ({'positions': BOTH.astype('U'), 'time': TIME, 'joints': ['a', 'b']}, {}, 'not of numbers'),
])
def test_what_is_wrong_is_said(tmp_path, arrays, options, words):
    with pytest.raises(RecordingError, match=words):
        read(tmp_path, options, **arrays)
