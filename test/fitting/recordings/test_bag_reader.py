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

"""Joint states out of bags, against what was written and against the library's own decoder."""

import tracemalloc

from bags import JOINT_STATE, joint_state, JOINTS, START, STEP, STORAGES, walk, write_bag
from cpg_ros.fitting.recordings.bag_reader import read_bag
from cpg_ros.fitting.recordings.cdr import decode, UndecodableError
from cpg_ros.fitting.recordings.recording import RecordingError
from depth import examples
from hypothesis import given
from hypothesis import strategies as st
import numpy as np
import pytest
from rosbags.rosbag2 import Reader
from rosbags.typesys import get_typestore, Stores
import yaml

STORE = get_typestore(Stores.ROS2_JAZZY)
KINDS = [('sqlite3', 'none'), ('sqlite3', 'file'), ('sqlite3', 'message'),
         ('mcap', 'none'), ('mcap', 'file'), ('mcap', 'message'), ('mcap', 'storage')]

names = st.lists(st.text(st.characters(codec='utf-8'), max_size=9), max_size=5, unique=True)
doubles = st.floats(width=64, allow_nan=True, allow_infinity=True)


def lists_like(length):
    return st.just(()) | st.lists(doubles, min_size=length, max_size=length)


@st.composite
def layouts(draw):
    """Names, frame, byte order and which numbers there are, for messages that share them."""
    own = draw(names)
    return (own, draw(st.text(max_size=6)), draw(st.booleans()),
            [draw(st.sampled_from((0, len(own), 3))) for _ in range(3)])


@st.composite
def batches(draw):
    """Return serialised messages whose layouts change midway and come back."""
    kinds = draw(st.lists(layouts(), min_size=1, max_size=12))
    batch = []
    for kind in draw(st.lists(st.integers(0, len(kinds) - 1), max_size=30)):
        own, frame, little, counts = kinds[kind]
        stamp = draw(st.integers(-2**31, 2**31 - 1)) * 10**9 + draw(st.integers(0, 10**9 - 1))
        values = [draw(st.lists(doubles, min_size=n, max_size=n)) for n in counts]
        batch.append(joint_state(stamp, own, *values, frame=frame, little=little))
    return batch


def by_the_library(message):
    decoded = STORE.deserialize_cdr(message, JOINT_STATE)
    stamp = decoded.header.stamp
    return (stamp.sec * 10**9 + stamp.nanosec, tuple(decoded.name), decoded.position,
            decoded.velocity, decoded.effort)


def assert_decoded_as_by_the_library(batch):
    for efforts in (False, True):
        found = {}
        for block in decode(batch, efforts):
            fields = (block.positions, block.velocities, block.efforts)[:3 if efforts else 1]
            for row, stamp, *numbers in zip(block.rows, block.stamps, *fields, strict=True):
                assert row not in found
                found[int(row)] = (int(stamp), block.names, *numbers)
        assert sorted(found) == list(range(len(batch)))
        for row, message in enumerate(batch):
            known = by_the_library(message)
            assert found[row][:2] == known[:2]
            # The bits, so that signs of zero and what is no number count too.
            assert [one.tobytes() for one in found[row][2:]] == [
                np.ascontiguousarray(one, float).tobytes()
                for one in known[2:5 if efforts else 3]]


@given(batches())
@examples(150)
def test_bulk_decoding_gives_the_librarys_numbers(batch):
    assert_decoded_as_by_the_library(batch)


@given(st.data())
@examples(150)
def test_a_message_that_differs_in_any_byte_is_decoded_as_by_the_library(data):
    batch = [joint_state(START + k, ('hip', 'knee'), (0.1, k), (0.2, k), frame='base')
             for k in range(4)]
    which = data.draw(st.integers(0, 3))
    damaged = bytearray(batch[which])
    for _ in range(data.draw(st.integers(1, 3))):
        damaged[data.draw(st.integers(0, len(damaged) - 1))] = data.draw(st.integers(0, 255))
    batch[which] = bytes(damaged)
    try:
        by_the_library(batch[which])
    except Exception:
        with pytest.raises(UndecodableError) as error:
            list(decode(batch))
        assert error.value.index == which
    else:
        assert_decoded_as_by_the_library(batch)


@pytest.mark.parametrize('cut', [0, 1, 3, 4, 11, 12, 20, 60, -8, -1])
def test_a_message_cut_short_is_refused(cut):
    message = joint_state(START, ('hip', 'knee'), (0.1, 0.2))
    with pytest.raises(UndecodableError):
        list(decode([message, message[:cut]]))


def test_padding_and_options_are_no_part_of_a_layout():
    message = joint_state(START, ('a', 'bcdef'), (0.1, 0.2))
    # Header options; behind frame_id ''; behind 'a' (length, letter, 0); behind 'bcdef'.
    padding = [2, 3, 17, 18, 19, 30, 31, 42, 43]
    other = bytearray(message)
    for place in padding:
        assert other[place] == 0
        other[place] = 0xA5
    assert by_the_library(bytes(other))[:2] == by_the_library(message)[:2]
    block, = decode([message, bytes(other)])
    assert block.rows.tolist() == [0, 1]
    assert block.positions.tolist() == [[0.1, 0.2]] * 2


def test_messages_of_one_length_and_other_names_are_told_apart():
    batch = [joint_state(START, ('ab', 'cd'), (1.0, 2.0)),
             joint_state(START, ('ab', 'ce'), (3.0, 4.0)),
             joint_state(START, ('ab', 'c'), (5.0, 6.0)),
             joint_state(START, ('ab', 'cd'), (7.0, 8.0), frame='xy')]
    assert len({len(message) for message in batch}) == 1
    assert_decoded_as_by_the_library(batch)


def test_messages_of_several_layouts_are_in_their_order(tmp_path):
    messages, angles = walk(90)
    for k in range(0, 90, 3):
        topic, received, _ = messages[k]
        stamp, frame = START + STEP * k, 'base' if k % 2 else ''
        messages[k] = topic, received, joint_state(stamp, JOINTS, angles[k], frame=frame,
                                                   little=k % 4 > 1)
    recording = read_bag(write_bag(tmp_path / 'walk', messages))
    assert np.array_equal(recording.positions, angles)
    assert recording.notes == ()


@pytest.mark.parametrize('version', [8, 9])
@pytest.mark.parametrize(('storage', 'compression'), KINDS)
def test_every_storage_and_compression_is_read_exactly(tmp_path, storage, compression, version):
    messages, angles = walk(4500)
    recording = read_bag(write_bag(tmp_path / 'walk', messages, storage, compression, version))
    assert recording.joints == JOINTS
    assert np.array_equal(recording.positions, angles)
    assert np.array_equal(recording.times, STEP * np.arange(4500) / 1e9)
    assert recording.start == START / 1e9
    assert recording.source == f'{tmp_path / "walk"}, /joint_states'
    assert recording.notes == ()


@pytest.mark.parametrize('version', [1, 2, 3, 4, 5, 6, 7])
def test_metadata_of_older_versions_is_read(tmp_path, version):
    messages, angles = walk(20)
    path = write_bag(tmp_path / 'walk', messages)
    whole = yaml.safe_load((path / 'metadata.yaml').read_text())
    bag = whole['rosbag2_bagfile_information']
    bag['version'] = version
    topic = bag['topics_with_message_count'][0]['topic_metadata']
    since = {3: 'compression_mode', 5: 'files', 6: 'custom_data', 8: 'ros_distro'}
    for first, key in since.items():
        if version < first:
            del bag[key]
    if version < 4:
        del topic['offered_qos_profiles']
        bag['relative_file_paths'] = [f'walk/{name}' for name in bag['relative_file_paths']]
    if version < 7:
        del topic['type_description_hash']
    (path / 'metadata.yaml').write_text(yaml.safe_dump(whole))
    assert np.array_equal(read_bag(path).positions, angles)


def test_a_bag_split_into_files_is_one_recording(tmp_path):
    messages, angles = walk(60)
    path = write_bag(tmp_path / 'walk', messages[:30])
    write_bag(tmp_path / 'more', messages[30:])
    (tmp_path / 'more' / 'more.db3').rename(path / 'walk_1.db3')
    text = (path / 'metadata.yaml').read_text()
    (path / 'metadata.yaml').write_text(text.replace('  - walk.db3\n', '  - walk.db3\n'
                                                     '  - walk_1.db3\n', 1))
    recording = read_bag(path)
    assert np.array_equal(recording.positions, angles)
    assert recording.notes == (
        "/joint_states: 60 messages, where the bag's metadata counts 30",)


@pytest.mark.parametrize('storage', STORAGES)
def test_partial_messages_of_one_topic_are_merged_by_name(tmp_path, storage):
    messages, angles = walk(50)
    halves = []
    for topic, received, data in messages:
        stamp, own, position = by_the_library(data)[:3]
        halves.append((topic, received, joint_state(stamp, own[:6], position[:6])))
        halves.append((topic, received + 1, joint_state(stamp, own[6:], position[6:])))
    recording = read_bag(write_bag(tmp_path / 'walk', halves, storage))
    assert recording.joints == JOINTS
    assert np.array_equal(recording.positions, angles)
    assert recording.notes == ()


def test_without_header_stamps_the_receive_times_count(tmp_path):
    messages, angles = walk(30)
    bare = [(topic, received, joint_state(0, *by_the_library(data)[1:]))
            for topic, received, data in messages]
    recording = read_bag(write_bag(tmp_path / 'walk', bare))
    assert recording.start == pytest.approx((START + 150_000) / 1e9, abs=1e-6)
    assert np.array_equal(recording.positions, angles)
    assert recording.notes == (
        "no header stamps on '/joint_states': the times are those of receipt",)


def test_single_messages_without_stamp_or_positions_are_left_out_and_counted(tmp_path):
    messages, angles = walk(30)
    topic, received, data = messages[7]
    messages[7] = topic, received, joint_state(0, *by_the_library(data)[1:])
    messages[9] = topic, messages[9][1], joint_state(START, JOINTS, (), np.ones(12))
    messages[12] = topic, messages[12][1], joint_state(START, JOINTS, np.ones(5))
    recording = read_bag(write_bag(tmp_path / 'walk', messages))
    assert np.array_equal(recording.positions, np.delete(angles, [7, 9, 12], axis=0))
    assert recording.notes[:3] == (
        '/joint_states: 1 of 30 messages without positions, left out',
        '/joint_states: 1 of 30 messages with more or fewer positions than names, such as '
        'message 13: 5 positions for 12 names, left out',
        '/joint_states: 1 of 30 messages without a stamp, left out')
    assert recording.notes[3].startswith('3 dropouts, about 3 samples of 30')


def test_simulated_time_may_start_at_zero(tmp_path):
    messages, angles = walk(30, start=0)
    recording = read_bag(write_bag(tmp_path / 'walk', messages))
    assert recording.start == 0.0
    assert np.array_equal(recording.positions, angles)
    assert recording.notes == ()


@given(batch=batches())
@examples(25)
def test_a_bag_of_anything_is_read_as_the_library_reads_it_or_refused(batch, tmp_path_factory):
    path = tmp_path_factory.mktemp('any') / 'bag'
    write_bag(path, [('/joint_states', START + k, data) for k, data in enumerate(batch)],
              types={'/joint_states': JOINT_STATE})
    try:
        recording = read_bag(path)
    except RecordingError as error:
        assert '\n' not in str(error)
        return
    # Each finite position of each joint at its stamp, the first one.
    with Reader(path) as reader:
        read = [by_the_library(data)[:3] for _, _, data in reader.messages()]
    stamps = [stamp for stamp, own, position in read if len(own) == len(position)]
    stamped = any(stamps)
    dated = max(stamps) > 10**17
    expected = {}
    for k, (stamp, own, position) in enumerate(read):
        if len(own) == len(position) and (stamp or not stamped or not dated):
            for name, value in zip(own, position, strict=True):
                if np.isfinite(value):
                    at = stamp if stamped else START + k
                    expected.setdefault((at, name), []).append(value)
    table = recording.positions
    assert (~np.isnan(table)).sum() <= len(expected)
    for row, column in zip(*np.nonzero(~np.isnan(table)), strict=True):
        time = recording.start + recording.times[row]
        near = [values for (at, name), values in expected.items()
                if name == recording.joints[column] and abs(at / 1e9 - time) < 2e-6]
        assert table[row, column] in [value for values in near for value in values]


def test_progress_is_shown_on_long_reads_and_can_be_silenced(tmp_path, monkeypatch, capsys):
    path = write_bag(tmp_path / 'walk', walk(9000, JOINTS[:2])[0])
    monkeypatch.setattr('cpg_ros.common.command_line.PROGRESS_DELAY', -1.0)
    read_bag(path)
    assert capsys.readouterr().err.startswith('reading walk [')
    read_bag(path, progress=False)
    assert capsys.readouterr().err == ''


def test_memory_grows_by_less_than_half_of_what_the_bag_grows(tmp_path):
    sizes, peaks = [], []
    for count in (9_000, 18_000):
        messages, angles = walk(count, velocity=np.ones(12), effort=np.ones(12))
        path = write_bag(tmp_path / f'{count}', messages, 'mcap')
        del messages
        tracemalloc.start()
        recording = read_bag(path, progress=False)
        peaks.append(tracemalloc.get_traced_memory()[1])
        tracemalloc.stop()
        sizes.append(sum(file.stat().st_size for file in path.iterdir()))
        assert np.array_equal(recording.positions, angles)
    assert peaks[1] - peaks[0] < 0.5 * (sizes[1] - sizes[0])
    # What is read at a time does not depend on the length.
    assert peaks[0] < 16e6
