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

"""Bags that are damaged, unfinished or not what was asked for: one clear line, nothing left."""

import gc
import os
import re
import sqlite3
import tempfile

from bags import JOINT_STATE, joint_state, JOINTS, START, storage_file, STORAGES, walk, write_bag
from cpg_ros.fitting.recordings.bag_reader import read_bag
from cpg_ros.fitting.recordings.recording import RecordingError
from depth import examples, in_depth
from hypothesis import given
from hypothesis import strategies as st
import numpy as np
import pytest
from rosbags.rosbag2 import Reader
import yaml

#: Storage and compression of the bags that are cut and scratched.
KINDS = [('sqlite3', 'none'), ('sqlite3', 'file'), ('mcap', 'none'), ('mcap', 'file'),
         ('mcap', 'storage')]


@pytest.fixture(autouse=True)
def nothing_left(tmp_path, monkeypatch):
    """No test leaves a temporary file or an open file behind."""
    temporary = tmp_path / 'temporary'
    temporary.mkdir()
    monkeypatch.setattr(tempfile, 'tempdir', str(temporary))
    before = set(os.listdir('/proc/self/fd'))
    yield
    # The library leaves a database it could not open to the collector.
    gc.collect()
    assert not list(temporary.iterdir())
    assert set(os.listdir('/proc/self/fd')) <= before


def refused(path, *arguments, **options):
    """Return the message with which a bag is refused."""
    with pytest.raises(RecordingError) as error:
        read_bag(path, *arguments, progress=False, **options)
    message = str(error.value)
    assert '\n' not in message
    assert message.startswith(str(path)), message
    return message


@pytest.mark.parametrize(('storage', 'compression'), KINDS)
def test_cut_at_fifty_places_it_is_refused_or_reads_what_is_whole(tmp_path, storage, compression):
    # Several chunks of an mcap file.
    count = 6000 if compression != 'file' else 600
    messages, angles = walk(count)
    path = write_bag(tmp_path / 'walk', messages, storage, compression)
    file = storage_file(path)
    whole = file.read_bytes()
    recovered = 0
    for k in range(50):
        file.write_bytes(whole[:len(whole) * k // 50])
        try:
            recording = read_bag(path)
        except RecordingError as error:
            assert '\n' not in str(error)
            assert str(file) in str(error)
            continue
        assert storage == 'mcap' and compression != 'file'
        read = len(recording.times)
        assert 2 <= read <= count
        assert np.array_equal(recording.positions, angles[:read])
        assert f'{file}: its recorder did not finish it' in recording.notes[0]
        if read < count:
            assert (f"/joint_states: {read} messages, where the bag's metadata counts {count}"
                    in recording.notes)
        recovered += 1
    assert recovered >= (15 if (storage, compression) == ('mcap', 'none') else 0)


@pytest.mark.parametrize('compression', ['none', *in_depth('file', 'message')])
@pytest.mark.parametrize('storage', STORAGES)
def test_cut_metadata_is_refused_by_name(tmp_path, storage, compression):
    path = write_bag(tmp_path / 'walk', walk(30)[0], storage, compression)
    file = path / 'metadata.yaml'
    whole = file.read_bytes()
    for k in range(50):
        file.write_bytes(whole[:len(whole) * k // 50])
        assert f'{file} cannot be used' in refused(path)


@pytest.mark.parametrize('storage', STORAGES)
@given(data=st.data())
@examples(30)
def test_scratched_files_are_read_or_refused(storage, data, tmp_path_factory):
    messages, _ = walk(40)
    path = write_bag(tmp_path_factory.mktemp('bags') / 'walk', messages, storage)
    file = data.draw(st.sampled_from([storage_file(path), path / 'metadata.yaml']))
    damaged = bytearray(file.read_bytes())
    for _ in range(data.draw(st.integers(1, 30))):
        damaged[data.draw(st.integers(0, len(damaged) - 1))] = data.draw(st.integers(0, 255))
    file.write_bytes(damaged)
    try:
        recording = read_bag(path)
    except RecordingError as error:
        assert '\n' not in str(error)
    else:
        assert len(recording.times) >= 2


def test_a_chunk_scratched_in_the_middle_names_how_far_it_was_read(tmp_path):
    messages, _ = walk(9000)
    path = write_bag(tmp_path / 'walk', messages, 'mcap')
    file = storage_file(path)
    damaged = bytearray(file.read_bytes())
    middle = len(damaged) // 2
    damaged[middle:middle + 8192] = b'\xff' * 8192
    file.write_bytes(damaged)
    assert re.search(r', after [34]\d\d\d messages of /joint_states$', refused(path))


def test_an_unfinished_mcap_without_metadata_is_read_as_far_as_it_is_whole(tmp_path):
    messages, angles = walk(8000)
    path = write_bag(tmp_path / 'walk', messages, 'mcap')
    (path / 'metadata.yaml').unlink()
    file = storage_file(path)
    whole = file.read_bytes()
    first = []
    for tail in (b'', bytes(5000)):  # A file system may append zeros.
        file.write_bytes(whole[:len(whole) // 2] + tail)
        recording = read_bag(path)
        read = len(recording.times)
        assert 2000 < read < 4000
        assert np.array_equal(recording.positions, angles[:read])
        first.append(recording.notes[0])
        assert 'its recorder did not finish it' in first[0]
        assert recording.notes[1] == (
            f'{path}: metadata.yaml is missing; its storage files are read as they are')
        assert np.array_equal(read_bag(file).positions, recording.positions)
    assert first[0] == first[1]


def test_topics_of_an_unfinished_mcap_need_not_be_in_common_order(tmp_path):
    # The library reads files without an index only if the messages are in order.
    first, angles = walk(3000, JOINTS[:6], '/front')
    second, others = walk(3000, JOINTS[6:], '/hind')
    path = write_bag(tmp_path / 'walk', [*first, *second], 'mcap')
    file = storage_file(path)
    file.write_bytes(file.read_bytes()[:-1])
    assert np.array_equal(read_bag(path).positions, np.hstack([angles, others]))


@pytest.mark.parametrize('storage', STORAGES)
def test_a_storage_file_alone_is_read(tmp_path, storage):
    messages, angles = walk(30)
    file = storage_file(write_bag(tmp_path / 'walk', messages, storage))
    assert np.array_equal(read_bag(file).positions, angles)
    assert read_bag(file).source == f'{file}, /joint_states'


@pytest.mark.parametrize('storage', STORAGES)
def test_a_wrong_storage_plugin(tmp_path, storage):
    path = write_bag(tmp_path / 'walk', walk(30)[0], storage)
    file = path / 'metadata.yaml'
    other = next(name for name in STORAGES if name != storage)
    for name in (other, 'leveldb'):
        file.write_text(file.read_text().replace(f'storage_identifier: {storage}',
                                                 f'storage_identifier: {name}'))
        message = refused(path)
        assert f"{file} cannot be used to read '{storage_file(path).name}': " in message
        file.write_text(file.read_text().replace(name, storage))


def test_a_file_that_metadata_names_is_missing(tmp_path):
    path = write_bag(tmp_path / 'walk', walk(30)[0])
    storage_file(path).unlink()
    assert 'walk.db3' in refused(path)


def test_topics_that_are_not_there_or_of_another_type(tmp_path):
    messages, _ = walk(30)
    path = write_bag(tmp_path / 'walk', messages, types={
        '/plan': 'trajectory_msgs/msg/JointTrajectory', '/tick': 'std_msgs/msg/Header'})
    assert refused(path, ['/joint_state']) == (
        f"{path}: no topic '/joint_state'; there are '/plan', '/tick', '/joint_states'")
    assert refused(path, ['/joint_states', 'plan']) == (
        f'{path}, /plan: trajectory_msgs/msg/JointTrajectory, where {JOINT_STATE} is needed')
    other = write_bag(tmp_path / 'other', [], types={
        '/plan': 'trajectory_msgs/msg/JointTrajectory'})
    assert refused(other) == (f'{other}: no topic of type {JOINT_STATE}; it has /plan '
                              '(trajectory_msgs/msg/JointTrajectory)')


def test_messages_of_another_type_under_the_name_of_joint_states(tmp_path):
    path = write_bag(tmp_path / 'walk', [
        ('/joint_states', START, b'\0\1\0\0' + b'\7' * 40)])
    assert refused(path).startswith(
        f'{path}, /joint_states: message 1 is not a {JOINT_STATE}: ')


def test_joints_that_are_not_there(tmp_path):
    path = write_bag(tmp_path / 'walk', walk(30, JOINTS[:3])[0])
    assert refused(path, joints=['lh_hip', 'knee', 'ankle']) == (
        f"{path}, /joint_states: no joints 'knee', 'ankle'; "
        "there are 'lh_hip', 'lh_thigh', 'lh_calf'")


def test_a_joint_that_is_never_a_number(tmp_path):
    messages = [('/joint_states', START + k, joint_state(START + k, ('hip', 'knee'),
                                                         (0.1 * k, float('nan'))))
                for k in range(9)]
    path = write_bag(tmp_path / 'walk', messages)
    assert refused(path).startswith(
        f"{path}, /joint_states: no finite position of joint 'knee' in 9 samples")
    assert read_bag(path, joints=['hip']).positions.shape == (9, 1)


@pytest.mark.parametrize('count', [1, 5])
def test_no_time_passes(tmp_path, count):
    messages = [('/joint_states', START + k, joint_state(START, ('hip',), (0.1,)))
                for k in range(count)]
    message = refused(write_bag(tmp_path / 'walk', messages))
    assert f'{count} sample' in message
    assert 'all at stamp 1700000000.000000000 s: no time passes' in message


@pytest.mark.parametrize('storage', STORAGES)
def test_empty_bags(tmp_path, storage):
    assert 'an empty bag' in refused(write_bag(tmp_path / 'none', [], storage))
    silent = write_bag(tmp_path / 'silent', [], storage, types={'/joint_states': JOINT_STATE})
    assert refused(silent) == (f'{silent}, /joint_states: no message with positions; '
                               '/joint_states: no messages')


def test_what_is_no_bag(tmp_path):
    assert refused(tmp_path / 'missing') == f'{tmp_path / "missing"}: no such bag'
    (tmp_path / 'folder').mkdir()
    assert 'neither metadata.yaml nor a storage file' in refused(tmp_path / 'folder')
    (tmp_path / 'walk.bag').write_text('#ROSBAG V2.0')
    assert 'a bag of ROS 1' in refused(tmp_path / 'walk.bag')
    (tmp_path / 'walk.bag').write_text('no bag')
    assert 'neither a folder nor a file with the ending' in refused(tmp_path / 'walk.bag')
    for name in ('text.mcap', 'text.db3'):
        (tmp_path / name).write_text('time,knee\n0,1\n')
        refused(tmp_path / name)
    (tmp_path / 'folder.mcap').mkdir()
    refused(tmp_path / 'folder.mcap')


def test_metadata_that_counts_messages_the_files_do_not_have(tmp_path):
    path = write_bag(tmp_path / 'walk', walk(30)[0])
    with sqlite3.connect(storage_file(path)) as database:
        database.execute('DELETE FROM messages')
    database.close()
    assert refused(path) == (
        f'{path}, /joint_states: no message with positions; '
        "/joint_states: 0 messages, where the bag's metadata counts 30; "
        '/joint_states: no messages')


def test_what_the_library_cannot_read_yet(tmp_path):
    path = write_bag(tmp_path / 'walk', walk(30)[0])
    whole = yaml.safe_load((path / 'metadata.yaml').read_text())
    whole['rosbag2_bagfile_information']['version'] = 10
    (path / 'metadata.yaml').write_text(yaml.safe_dump(whole))
    with pytest.raises(Exception, match='version 10'), Reader(path):
        pass
    assert 'version 10 not supported' in refused(path)
