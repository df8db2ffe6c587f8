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

"""Bags as robots' drivers write them: Unitree's state, prefixes, missing names, two robots."""

import shutil

from bags import joint_state, JOINTS, START, STEP, storage_file, walk, write_bag
from cpg_ros.fitting.recordings.bag_reader import read_bag
from cpg_ros.fitting.recordings.formats import read_recording
from cpg_ros.fitting.recordings.recording import RecordingError
from cpg_ros.fitting.recordings.rosbags_library import ZSTD
from cpg_ros.ros.bridges.unitree.messages import LowState, MODELS
import numpy as np
import pytest
from rosbags.rosbag2 import StoragePlugin, Writer
from rosbags.typesys import get_types_from_msg, get_typestore, Stores

LOW_STATE = 'unitree_go/msg/LowState'
MOTORS = MODELS['go2'].joints


def low_states(path, topics, count=50):
    """Write a bag of LowState messages by the layout of the bridge; return the angles."""
    angles = np.sin(0.1 * np.arange(count)[:, None] + np.arange(12)).astype(np.float32)
    state = LowState()
    store = get_typestore(Stores.ROS2_JAZZY)
    store.register(get_types_from_msg('uint8 level', LOW_STATE))
    with Writer(path, version=9, storage_plugin=StoragePlugin.MCAP) as writer:
        places = [writer.add_connection(topic, LOW_STATE, typestore=store) for topic in topics]
        for k, row in enumerate(angles):
            state.q[:], state.dq[:], state.torque[:] = row, 2.0 * row, 10.0
            message = b'\0\1\0\0' + bytes(state._buffer[4:])
            for each, place in enumerate(places):
                if k % (each + 1) == 0:
                    writer.write(place, START + STEP * k, message)
    return angles


def test_unitrees_state_is_read_at_its_full_rate_by_the_names_of_its_motors(tmp_path):
    angles = low_states(tmp_path / 'bag', ['/lowstate', '/lf/lowstate'])
    recording = read_recording(tmp_path / 'bag')
    assert recording.joints == MOTORS and recording.source.endswith(', /lowstate')
    assert np.array_equal(recording.positions, angles.astype(float))
    assert recording.times[1] == pytest.approx(0.002)
    slower = read_recording(tmp_path / 'bag', topics=['/lf/lowstate'])
    assert len(slower.times) == 25


def test_a_robot_file_names_unitrees_motors_in_its_order(tmp_path):
    angles = low_states(tmp_path / 'bag', ['/lowstate'])
    recording = read_recording(tmp_path / 'bag', robot_joints=JOINTS)
    assert recording.joints == JOINTS
    assert np.array_equal(recording.positions, angles.astype(float))
    turned = read_recording(tmp_path / 'bag', robot_joints=MOTORS[::-1])
    assert turned.joints == MOTORS[::-1]
    assert np.array_equal(turned.positions, angles.astype(float)[:, ::-1])


def test_a_humanoids_state_is_read_by_the_layout_of_its_message(tmp_path):
    # By the library's own CDR, from the definition of unitree_hg.
    store = get_typestore(Stores.ROS2_JAZZY)
    imu = 'float32[4] quaternion\nfloat32[3] gyroscope\nfloat32[3] accelerometer\n' \
          'float32[3] rpy\nint16 temperature'
    motor = 'uint8 mode\nfloat32 q\nfloat32 dq\nfloat32 ddq\nfloat32 tau_est\n' \
            'int16[2] temperature\nfloat32 vol\nuint32[2] sensor\nuint32 motorstate\n' \
            'uint32[4] reserve'
    state = 'uint32[2] version\nuint8 mode_pr\nuint8 mode_machine\nuint32 tick\n' \
            'IMUState imu_state\nMotorState[35] motor_state\nuint8[40] wireless_remote\n' \
            'uint32[4] reserve\nuint32 crc'
    kind = 'unitree_hg/msg/LowState'
    for text, name in ((imu, 'IMUState'), (motor, 'MotorState'), (state, 'LowState')):
        store.register(get_types_from_msg(text, f'unitree_hg/msg/{name}'))
    Motor, Imu, State = (store.types[f'unitree_hg/msg/{name}']
                         for name in ('MotorState', 'IMUState', 'LowState'))
    angles = np.sin(0.1 * np.arange(40)[:, None] + np.arange(35)).astype(np.float32)
    with Writer(tmp_path / 'bag', version=9, storage_plugin=StoragePlugin.MCAP) as writer:
        place = writer.add_connection('/lowstate', kind, typestore=store)
        for k, row in enumerate(angles):
            motors = [Motor(1, float(q), 2.0 * float(q), 0.0, 3.0, np.zeros(2, np.int16), 0.0,
                            np.zeros(2, np.uint32), 0, np.zeros(4, np.uint32)) for q in row]
            body = Imu(*(np.zeros(n, np.float32) for n in (4, 3, 3, 3)), 0)
            message = State(np.zeros(2, np.uint32), 0, 5, k, body, motors, np.zeros(40, np.uint8),
                            np.zeros(4, np.uint32), 0)
            writer.write(place, START + STEP * k, bytes(store.serialize_cdr(message, kind)))
    recording = read_recording(tmp_path / 'bag')
    assert recording.joints[3] == 'left_knee_joint' and recording.joints[9] == 'right_knee_joint'
    assert len(recording.joints) == 29
    assert np.array_equal(recording.positions, angles[:, :29].astype(float))
    legs = ['a', 'b', 'c']
    named = read_recording(tmp_path / 'bag', robot_joints=legs)
    assert named.joints == ('a', 'b', 'c')
    assert np.array_equal(named.positions, angles[:, :3].astype(float))


def test_a_prefix_before_the_names_of_a_robot_is_left_out(tmp_path):
    messages, angles = walk(30, tuple(f'go2/{name}' for name in JOINTS))
    recording = read_recording(write_bag(tmp_path / 'bag', messages), robot_joints=JOINTS)
    assert recording.joints == JOINTS and np.array_equal(recording.positions, angles)
    assert "the names without 'go2/' before them" in recording.notes[0]


def unnamed(count=30):
    messages, angles = walk(count)
    return [(topic, received, joint_state(START + STEP * k, (), row)) for k, (
        (topic, received, _), row) in enumerate(zip(messages, angles, strict=True))], angles


def test_positions_without_names_have_the_order_of_the_robot_file(tmp_path):
    messages, angles = unnamed()
    path = write_bag(tmp_path / 'bag', messages)
    recording = read_recording(path, robot_joints=JOINTS)
    assert recording.joints == JOINTS and np.array_equal(recording.positions, angles)
    assert 'no names; the positions are taken in the order of' in recording.notes[0]
    assert read_recording(path).joints[11] == 'position[11]'


def test_a_message_with_a_position_too_few_is_named(tmp_path):
    messages, angles = walk(30)
    topic, received, _ = messages[7]
    messages[7] = topic, received, joint_state(START + 7 * STEP, JOINTS, angles[7, :-1])
    recording = read_bag(write_bag(tmp_path / 'bag', messages))
    assert ('1 of 30 messages with more or fewer positions than names, such as message 8: '
            '11 positions for 12 names, left out') in recording.notes[0]


def test_of_two_robots_one_is_to_be_chosen(tmp_path):
    first, angles = walk(30, topic='/a/joint_states')
    second, others = walk(30, topic='/b/joint_states', seed=1)
    path = write_bag(tmp_path / 'bag', [*first, *second])
    with pytest.raises(RecordingError, match='/a/joint_states and /b/joint_states have the same '
                                             r'joints: choose a topic or a namespace \(--topics'):
        read_bag(path)
    assert np.array_equal(read_bag(path, ['/a/joint_states']).positions, angles)
    assert np.array_equal(read_bag(path, ['b']).positions, others)


def test_a_packed_storage_file_alone(tmp_path):
    messages, angles = walk(30)
    file = storage_file(write_bag(tmp_path / 'bag', messages, 'mcap'))
    packed = tmp_path / 'walk.mcap.zstd'
    packed.write_bytes(ZSTD.compress(file.read_bytes()))
    assert np.array_equal(read_recording(packed).positions, angles)
    packed.write_bytes(packed.read_bytes()[:-40])
    with pytest.raises(RecordingError, match=r'walk\.mcap\.zstd: '):
        read_recording(packed)


@pytest.mark.parametrize('storage', ['mcap', 'sqlite3'])
def test_a_renamed_storage_file_is_read_with_its_metadata(tmp_path, storage):
    messages, angles = walk(30)
    path = write_bag(tmp_path / 'bag', messages, storage)
    file = storage_file(path)
    name = file.name
    file.rename(path / f'renamed{file.suffix}')
    recording = read_bag(path)
    assert np.array_equal(recording.positions, angles)
    assert f"metadata.yaml names '{name}', which is missing" in recording.notes[0]


@pytest.mark.parametrize(('name', 'content', 'words'), [
    ('walk.bag', b'#ROSBAG V2.0\n' + bytes(99), r'a bag of ROS 1: convert it with "rosbags-conv'),
    ('walk.mcap', b'version https://git-lfs.github.com/spec/v1\n', r'a pointer of Git LFS, not t'),
    ('walk.csv', b'version https://git-lfs.github.com/spec/v1\n', r'a pointer of Git LFS, not t'),
])
def test_what_is_no_recording_is_called_what_it_is(tmp_path, name, content, words):
    path = tmp_path / name
    path.write_bytes(content)
    with pytest.raises(RecordingError, match=words):
        read_recording(path)
    folder = tmp_path / 'folder'
    folder.mkdir()
    shutil.move(path, folder / name)
    if name.endswith('.mcap'):
        with pytest.raises(RecordingError, match=words):
            read_recording(folder)
