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

"""Bags for tests, written by the library."""

import numpy as np
from rosbags.rosbag2 import CompressionFormat, CompressionMode, StoragePlugin, Writer
from rosbags.typesys import get_typestore, Stores

STORE = get_typestore(Stores.ROS2_JAZZY)
JOINT_STATE = 'sensor_msgs/msg/JointState'
STORAGES = {'sqlite3': StoragePlugin.SQLITE3, 'mcap': StoragePlugin.MCAP}
SUFFIXES = {'sqlite3': '.db3', 'mcap': '.mcap'}
LEGS = ('lh', 'rh', 'lf', 'rf')
JOINTS = tuple(f'{leg}_{joint}' for leg in LEGS for joint in ('hip', 'thigh', 'calf'))
START = 1_700_000_000_000_000_000
STEP = 2_000_000


def joint_state(stamp: int, names, position, velocity=(), effort=(), frame='', little=True):
    """Return a serialised JointState."""
    types = STORE.types
    header = types['std_msgs/msg/Header'](
        types['builtin_interfaces/msg/Time'](stamp // 10**9, stamp % 10**9), frame)
    message = types[JOINT_STATE](header, list(names), *(
        np.array(values, float) for values in (position, velocity, effort)))
    return bytes(STORE.serialize_cdr(message, JOINT_STATE, little_endian=little))


def write_bag(path, messages, storage='sqlite3', compression='none', version=9, types=None):
    """Write messages (topic, receive time in ns, bytes); types are JointState if not given."""
    writer = Writer(path, version=version, storage_plugin=STORAGES[storage])
    writer.set_compression(CompressionMode[compression.upper()], CompressionFormat.ZSTD)
    with writer:
        connections = {}
        for topic in dict.fromkeys([*(types or {}), *(message[0] for message in messages)]):
            kind = (types or {}).get(topic, JOINT_STATE)
            connections[topic] = writer.add_connection(topic, kind, typestore=STORE)
        for topic, received, data in messages:
            writer.write(connections[topic], received, data)
    return path


def storage_file(path):
    """Return the storage file of a bag."""
    return next(file for file in path.iterdir() if file.suffix != '.yaml')


def walk(count=400, joints=JOINTS, topic='/joint_states', step=STEP, start=START, seed=0, **parts):
    """Return messages of a walk, and its positions, shape (count, joints)."""
    rng = np.random.default_rng(seed)
    angles = (np.sin(2.0 * np.pi * (2e-9 * step * np.arange(count)[:, None]
                                    + np.arange(len(joints)) / 7))
              + rng.normal(0.0, 0.01, (count, len(joints))))
    stamps = start + step * np.arange(count)
    return [(topic, int(stamp) + 150_000, joint_state(int(stamp), joints, row, **parts))
            for stamp, row in zip(stamps, angles, strict=True)], angles
