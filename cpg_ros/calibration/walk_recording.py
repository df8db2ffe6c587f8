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

"""Recording of a walking robot in a bag: joints, IMU and foot forces on one clock."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from cpg_ros.feedback.estimate import rpy_of, SensorData
from cpg_ros.recordings.bag_storage import opened
from cpg_ros.recordings.cdr import JOINT_STATE
from cpg_ros.recordings.recording import RecordingError
from cpg_ros.recordings.rosbags_library import SerdeError, STORE
from cpg_ros.robots.robot import Robot
from cpg_ros.short_repr import ShortRepr
import numpy as np

#: What is read: key -> type of its topic.
TYPES = {'joint_states': JOINT_STATE, 'imu': 'sensor_msgs/msg/Imu',
         'foot_contacts': 'std_msgs/msg/Float64MultiArray',
         'phase': 'std_msgs/msg/Float64MultiArray'}
#: What a bag may be without.
OPTIONAL = ('phase',)


@dataclass(frozen=True, eq=False, repr=False)
class WalkRecording(ShortRepr):
    """Sensor data of a walking robot.

    Attributes:
        source: the bag.
        joints: names, leg by leg.
        times: of the IMU's stamps, rising, s, shape (n,).
        senses: at these, n runs' worth.
        phase: of the first leg's cell, as the generator told it, cycles, shape (n,), or None.

    """

    source: str
    joints: tuple[str, ...]
    times: np.ndarray
    senses: SensorData
    phase: np.ndarray | None = None

    @property
    def positions(self) -> np.ndarray:
        """Angles in rad, shape (n, joints)."""
        return self.senses.joint_positions


def read_walk(path: str | Path, robot: Robot, topics: Mapping[str, str]) -> WalkRecording:
    """Read the sensor data that feedback takes from a bag.

    Args:
        path: the bag.
        robot: whose joints and legs are read.
        topics: their names, by the keys of TYPES.

    Raises:
        RecordingError: the bag or a message cannot be read, a topic is missing or of another
            type, or a joint or a leg is not in it.

    """
    path = Path(path)
    names = {key: '/' + topic.lstrip('/') for key, topic in topics.items()}
    with opened(path) as bag:
        kinds = {one.topic: one.msgtype for one in bag.connections}
        for key, topic in list(names.items()):
            if key in OPTIONAL and topic not in kinds:
                del names[key]
            elif kinds.get(topic) != TYPES[key]:
                there = ', '.join(f'{name} ({kind})' for name, kind in list(kinds.items())[:8])
                raise RecordingError(f'{path}: no topic {topic} of type {TYPES[key]} (--'
                                     f'{key.replace("_", "-")}); it has {there or "none"}')
        key_of = {topic: key for key, topic in names.items()}
        found: dict[str, list[tuple[int, Any]]] = {key: [] for key in names}
        for topic, received, data in bag.messages(list(names.values())):
            key = key_of[topic]
            try:
                found[key].append((received, STORE.deserialize_cdr(data, TYPES[key])))
            except SerdeError as error:
                raise RecordingError(f'{path}, {topic}: a message cannot be read: {error}'
                                     ) from error
    for key, messages in found.items():
        if len(messages) < 2:
            raise RecordingError(f'{path}: {len(messages)} messages of {names[key]}')
    return _joined(path, robot, found)


def _joined(path: Path, robot: Robot, found: dict[str, list[tuple[int, Any]]]) -> WalkRecording:
    received = np.array([at for at, _ in found['imu']], dtype=float)
    stamps = np.array([_stamp(message) for _, message in found['imu']])
    # Whoever played a bag faster or slower has stamps that tell the true time.
    first = stamps[0]
    times, keep = np.unique(1e-9 * (stamps - first), return_index=True)
    messages = [found['imu'][k][1] for k in keep]

    def to_imu(key: str, rows: np.ndarray, own: np.ndarray) -> np.ndarray:
        if rows.ndim != 2 or not np.isfinite(rows).all():
            raise RecordingError(f'{path}: {key} has messages without numbers')
        return np.stack([np.interp(times, 1e-9 * (own - first), row) for row in rows.T], axis=1)

    joints = tuple(joint.name for joint in robot.joints)
    states = [message for _, message in found['joint_states']]
    places = []
    for name in joints:
        if name not in states[0].name:
            raise RecordingError(f"{path}: joint_states has no joint '{name}'")
        places.append(list(states[0].name).index(name))
    own = np.array([_stamp(message) for message in states])
    angles, rates = (np.array([getattr(one, part)[places] if len(getattr(one, part)) else
                               np.full(len(places), np.nan) for one in states])
                     for part in ('position', 'velocity'))
    # Without stamps: by when they were received, beside the IMU's.
    by_leg = {}
    for key in ('foot_contacts', 'phase'):
        rows = [message.data for _, message in found.get(key, [])]
        if {len(row) for row in rows} - {len(robot.legs)}:
            raise RecordingError(f'{path}: {key} does not have {len(robot.legs)} numbers, one a '
                                 'leg')
        at = np.interp([when for when, _ in found.get(key, [])], received, stamps)
        by_leg[key] = np.array(rows), at
    loads, at = by_leg['foot_contacts']
    phase = None
    if len(by_leg['phase'][0]):
        first_leg = 2.0 * np.pi * by_leg['phase'][0][:, :1]
        phase = to_imu('phase', np.unwrap(first_leg, axis=0), by_leg['phase'][1])[:, 0] / (
            2.0 * np.pi)

    def vectors(part: str) -> np.ndarray:
        return np.array([[getattr(one, part).x, getattr(one, part).y, getattr(one, part).z]
                         for one in messages])

    turned = np.array([[one.orientation.w, one.orientation.x, one.orientation.y,
                        one.orientation.z] for one in messages])
    senses = SensorData(to_imu('joint_states.position', angles, own),
                    to_imu('joint_states.velocity', rates, own),
                    to_imu('foot_contacts', loads, at), rpy_of(turned),
                    vectors('angular_velocity'), vectors('linear_acceleration'))
    return WalkRecording(str(path), joints, times, senses, phase)


def _stamp(message: Any) -> float:
    """Time of a message's header, ns."""
    return 1e9 * message.header.stamp.sec + message.header.stamp.nanosec
