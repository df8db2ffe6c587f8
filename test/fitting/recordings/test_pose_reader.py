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

"""Tables of pose estimation: DeepLabCut, SLEAP, Anipose, against numbers printed into them."""

import gzip
import os
import pickle

import cpg_ros
from cpg_ros.common import errors
from cpg_ros.fitting.recordings import reader_process
from cpg_ros.fitting.recordings.formats import format_of
from cpg_ros.fitting.recordings.pose_reader import pose_markers
from cpg_ros.fitting.recordings.recording import RecordingError
import h5py
import numpy as np
import pytest
from skeletons import deeplabcut

NAMES = ('Iliac Crest', 'Hip', 'Knee', 'Ankle', 'Hind paw tao')
RNG = np.random.default_rng(3)
POINTS = RNG.uniform(0.0, 500.0, (20, 5, 2))
LIKELY = RNG.uniform(0.0, 1.0, (20, 5))


def written(tmp_path, text, name='pose.csv'):
    path = tmp_path / name
    path.write_text(text)
    return path


@pytest.mark.parametrize('individual', ['', 'mouse1'])
def test_deeplabcut(tmp_path, individual):
    path = written(tmp_path, deeplabcut(POINTS, LIKELY, NAMES, individual))
    assert format_of(path).name == 'pose'
    for args in (None, *[individual] * bool(individual)):
        found = pose_markers(path, fps='250', individual=args)
        assert found.names == NAMES
        assert found.stamps == pytest.approx(1e9 * np.arange(20) / 250.0)
        # A picture's y points down, an angle's up.
        np.testing.assert_array_equal(found.points, POINTS * [1.0, -1.0])
        np.testing.assert_array_equal(found.likelihoods, LIKELY)
    packed = tmp_path / 'pose.csv.gz'
    packed.write_bytes(gzip.compress(path.read_bytes()))
    assert format_of(packed).name == 'pose'
    # The shipped mouse: what counter-clockwise is in the picture, by cross and dot product.
    found = cpg_ros.read_recording(path, segments='mouse_side_view', fps=250, progress=False)
    assert found.joints == ('hind_hip', 'hind_knee', 'hind_ankle')
    thigh, shank = (np.diff(POINTS[:, k:k + 2] * [1, -1], axis=1)[:, 0] for k in (1, 2))
    expected = (np.angle((shank @ [1, 1j]) / (thigh @ [1, 1j])))
    seen = (LIKELY[:, 1:4] >= 0.6).all(axis=1)
    knee = found.positions[:, 1]
    assert knee[~np.isnan(knee)] == pytest.approx(expected[seen])


def test_the_individual_is_named_where_there_are_several(tmp_path):
    first, second = (deeplabcut(POINTS + shift, LIKELY, NAMES, name).splitlines()
                     for shift, name in ((0.0, 'a'), (9.0, 'b')))
    path = written(tmp_path, '\n'.join(
        one + ',' + other.partition(',')[2] for one, other in zip(first, second, strict=True)))
    np.testing.assert_array_equal(pose_markers(path, 25, 'b').points,
                                  (POINTS + 9.0) * [1.0, -1.0])
    for individual, words in ((None, r"there are 'a', 'b': name one \(individual\)"),
                              ('c', "no individual 'c'; there are 'a', 'b'")):
        with pytest.raises(RecordingError, match=words):
            pose_markers(path, 25, individual)


SLEAP = """\
track,frame_idx,instance.score,nose.x,nose.y,nose.score,tail base.x,tail base.y,tail base.score
one,0,0.9,1.5,2.5,0.8,3.0,4.0,0.7
two,0,0.9,9.5,2.5,0.8,3.0,4.0,0.7
one,4,0.9,,,,5.0,6.0,0.3
"""


def test_sleap(tmp_path):
    path = written(tmp_path, SLEAP)
    assert format_of(path).name == 'pose'
    found = pose_markers(path, 20, 'one')
    assert found.names == ('nose', 'tail base')
    # Frame 4 of 20 a second, whatever is missing between.
    assert found.stamps.tolist() == [0, 200_000_000]
    np.testing.assert_array_equal(found.points, [[[1.5, -2.5], [3.0, -4.0]],
                                                 [[np.nan, np.nan], [5.0, -6.0]]])
    np.testing.assert_array_equal(found.likelihoods, [[0.8, 0.7], [np.nan, 0.3]])
    with pytest.raises(RecordingError, match="there are 'one', 'two': name one"):
        pose_markers(path, 20)
    path.write_text(SLEAP.replace('two', '').replace('one', ''))
    with pytest.raises(RecordingError, match='frame 0 occurs twice: animals without'):
        pose_markers(path, 20)


def test_anipose_is_in_space(tmp_path):
    path = written(tmp_path, 'knee_x,knee_y,knee_z,knee_error,knee_ncams,knee_score,M_00,fnum\n'
                   '1,2,3,0.5,3,0.9,1.0,0\n4,5,6,0.5,3,0.8,1.0,1\n')
    assert format_of(path).name == 'pose'
    found = pose_markers(path, 100)
    assert found.names == ('knee',)
    np.testing.assert_array_equal(found.points[:, 0], [[1, 2, 3], [4, 5, 6]])
    np.testing.assert_array_equal(found.likelihoods[:, 0], [0.9, 0.8])


def test_a_table_of_angles_is_none_of_poses(tmp_path):
    assert format_of(written(tmp_path, 'time,hip\n0,1\n1,2\n')).name == 'csv'
    assert format_of(written(tmp_path, '')).name == 'csv'


GOOD = deeplabcut(POINTS, LIKELY, NAMES)


@pytest.mark.parametrize(('text', 'words'), [
    ('', 'not a table of poses: its first line neither begins'),
    ('time,hip\n0,1\n', 'not a table of poses'),
    (GOOD[:50], 'line 2: a row of headers has to begin with|not both there'),
    (GOOD.replace('coords', 'cords'), "line 3: a row of headers has to begin with one of 's"),
    (GOOD.replace('Ankle', 'Knee'), "two columns 'x' of marker 'Knee'"),
    (GOOD.replace(',y,', ',v,').replace(',y\n', ',v\n'), "no marker has columns 'x', 'y'"),
    (GOOD.partition('\n0,')[0], 'no rows'),
    (GOOD.replace('\n3,', '\n3,up,'), r'line 7: 17 columns, where the header has 16'),
    (GOOD.replace('\n3,', '\n1e300,'), 'frames without a plausible number'),
    (GOOD.replace('\n3,', '\nthree,'), "line 7, column 'frame': 'three' is not a number"),
])
def test_what_is_wrong_is_said(tmp_path, text, words):
    with pytest.raises(RecordingError, match=words):
        pose_markers(written(tmp_path, text), 25)


@pytest.mark.parametrize(('fps', 'words'), [
    (None, r'it has no times: give the frames a second \(fps\)'),
    ('fast', 'fast frames a second are not from'), (0, '0 frames a second'),
    (float('inf'), 'inf frames'), ('nan', 'nan frames'), (-5, '-5 frames')])
def test_the_rate_is_told_and_never_guessed(tmp_path, fps, words):
    with pytest.raises(RecordingError, match=words):
        pose_markers(written(tmp_path, GOOD), fps)


def pandas_table(path, columns, rows):
    """Write a table as pandas does in HDF5: a record for each row, names of columns pickled."""
    kind = np.dtype([('index', '<i8'), ('values_block_0', '<f8', (rows.shape[1],))])
    table = np.empty(len(rows), kind)
    table['index'], table['values_block_0'] = 3 + np.arange(len(rows)), rows
    with h5py.File(path, 'w') as file:
        one = file.create_dataset('df_with_missing/table', data=table)
        one.attrs['values_block_0_kind'] = np.bytes_(pickle.dumps(columns, protocol=0))
    return path


@pytest.mark.parametrize('animals', [('',), ('a', 'b')], ids=['one', 'two'])
def test_deeplabcut_in_hdf5(tmp_path, animals):
    columns = [('net', *[animal] * bool(animal), name, axis) for animal in animals
               for name in NAMES for axis in ('x', 'y', 'likelihood')]
    own = np.concatenate([POINTS, LIKELY[:, :, None]], axis=2).reshape(20, -1)
    path = pandas_table(tmp_path / 'pose.h5', columns,
                        np.concatenate([own + 9.0 * k for k in range(len(animals))], axis=1))
    assert format_of(path).name == 'pose'
    found = pose_markers(path, 250, animals[-1] or None)
    assert found.names == NAMES
    assert found.stamps == pytest.approx(1e9 * (3 + np.arange(20)) / 250.0)
    shift = 9.0 * (len(animals) - 1)
    np.testing.assert_array_equal(found.points, (POINTS + shift) * [1.0, -1.0])
    np.testing.assert_array_equal(found.likelihoods, LIKELY + shift)
    if len(animals) > 1:
        with pytest.raises(RecordingError, match="there are 'a', 'b': name one"):
            pose_markers(path, 250)


def test_sleap_in_hdf5(tmp_path):
    path = tmp_path / 'analysis.h5'
    tracks = RNG.uniform(0.0, 500.0, (2, 2, 5, 20))
    with h5py.File(path, 'w') as file:
        file['tracks'], file['point_scores'] = tracks, tracks[:, 0] / 500.0
        file['node_names'] = [name.encode() for name in NAMES]
        file['track_names'] = [b'one', b'two']
    found = pose_markers(path, 20, 'two')
    assert found.names == NAMES
    np.testing.assert_array_equal(found.points, tracks[1].T * [1.0, -1.0])
    np.testing.assert_array_equal(found.likelihoods, tracks[1, 0].T / 500.0)
    with pytest.raises(RecordingError, match="there are 'one', 'two': name one"):
        pose_markers(path, 20)


class Harmful:
    """Runs a command where it is unpickled."""

    def __reduce__(self):
        return os.system, ('false',)


@pytest.mark.parametrize(('content', 'words'), [
    (b'\x89HDF\r\n', r'not a readable HDF5 file of poses: .*'),
    ({'other': 1}, "neither poses of DeepLabCut nor an analysis of SLEAP: it has 'other'"),
    ([Harmful()], 'system among the names of columns'),
], ids=['damaged', 'other', 'harmful'])
def test_hdf5_files_of_other_kinds_end_in_one_line(tmp_path, content, words):
    path = tmp_path / 'pose.h5'
    if isinstance(content, bytes):
        path.write_bytes(content)
    elif isinstance(content, list):
        pandas_table(path, content, np.zeros((3, 1)))
    else:
        with h5py.File(path, 'w') as file:
            file.update(content)
    with pytest.raises(RecordingError, match=words) as raised:
        pose_markers(path, 25)
    assert str(raised.value).startswith(f'{path}: ') and '\n' not in str(raised.value)


def test_a_project_of_sleap_and_a_missing_library_are_said(tmp_path, monkeypatch):
    with pytest.raises(RecordingError, match='export its analysis as HDF5 or CSV'):
        pose_markers(tmp_path / 'pose.slp', 25)
    monkeypatch.setattr(errors, 'find_spec', lambda name: None)
    with pytest.raises(errors.MissingLibraryError, match=r'needs h5py, .*/pip install h5py'):
        pose_markers(tmp_path / 'pose.h5', 25)


@pytest.mark.parametrize(('library', 'words'), [
    ('import os, signal; os.kill(os.getpid(), signal.SIGSEGV)', 'ended with SIGSEGV'),
    ('while True: pass', 'not read within 1 s of processor time')], ids=['crash', 'hang'])
def test_what_h5py_does_ends_nothing_but_its_process(tmp_path, monkeypatch, library, words):
    (tmp_path / 'h5py.py').write_text(library)
    path = tmp_path / 'pose.h5'
    path.write_bytes(b'no poses')
    monkeypatch.setenv('PYTHONPATH', str(tmp_path))
    monkeypatch.setattr(reader_process, 'MAX_CPU_TIME', 1.0)
    with pytest.raises(RecordingError, match=words) as error:
        pose_markers(path, 25)
    assert str(error.value).startswith(f'{path}: ') and '\n' not in str(error.value)
