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

"""Walks for efference copies: simulated ones, and recordings of joints, IMU and foot forces."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from cpg_ros.common.errors import CpgError, InputError, ShortRepr
from cpg_ros.feedback.efference_copy import EfferenceCopy, fold, SPEEDS
from cpg_ros.feedback.estimate import SensorData
from cpg_ros.fitting.gaits.leg_names import CODES
from cpg_ros.fitting.recordings.recording import RecordingError
from cpg_ros.motion.plan import plan_gait
from cpg_ros.motion.robot import Robot
from cpg_ros.motion.rotations import rpy_of
from cpg_ros.simulation.closed_loop import ClosedLoopBatch
from cpg_ros.simulation.robot_setup.model_reading import geometry_from, load_description
from cpg_ros.simulation.scenario import Scenario
import numpy as np

# Measurement of a gait's efference copy: the body's motion on flat ground without feedback.

#: DURATION: of a run, s; SETTLING_TIME: first part of it that is ignored, s; FRICTIONS: of the
#: grounds over which the motion is averaged.
DURATION, SETTLING_TIME, FRICTIONS = 10.0, 3.0, (0.6, 0.8, 1.0)


def measure_efference(loop: ClosedLoopBatch,
                      speeds: Sequence[float] | None = None) -> EfferenceCopy:
    """Measure the motion of the body in a gait at several commanded speeds.

    Args:
        loop: bodies that walk their first gait.
        speeds: commanded, m/s; by default as many as a table takes, from the slowest, which may be
            backward, to the fastest. A gait without steering only has its own. Those at which a
            body falls are left out.

    Raises:
        InputError: a body falls at each speed.

    """
    commanded: Sequence[float] | np.ndarray = [0.0]
    if loop.plan.motion.steering is not None:
        commanded = np.linspace(*loop.plan.speeds, SPEEDS) if speeds is None else speeds
    ran = loop.run([Scenario(friction, speed=speed, kp=loop.plan.stiffness(speed))
                    for speed in commanded for friction in FRICTIONS], DURATION)
    upright = ran.upright.reshape(-1, len(FRICTIONS)).all(axis=1)
    if not upright.any():
        raise InputError(f"'{loop.plan.name}' has no efference copy: without feedback the robot "
                         'falls at each of its speeds')
    first = round(SETTLING_TIME / loop.timestep)
    # The velocity is the robot's own estimate: an error that it makes at every stride is no
    # disturbance.
    signals = np.concatenate([ran.estimated[:, :, :2], ran.angular_velocity[:, :, :2],
                              ran.rpy[:, :, :2]], axis=2)
    tables = np.array([np.mean([fold(ran.phase[k, first:], signals[k, first:])
                                for k in range(row, row + len(FRICTIONS))], axis=0)
                       for row in len(FRICTIONS) * np.flatnonzero(upright)])
    mean_speed = ran.velocity[:, first:, 0].reshape(upright.size, -1).mean(axis=1)[upright]
    rising = np.argsort(mean_speed)
    return EfferenceCopy(mean_speed[rising], tables[rising])


def calibrated(robot: Robot, model: str, gaits: Sequence[str],
               update: Callable[[str], None] = lambda gait: None, *, kp: float | None = None,
               kd: float | None = None) -> Robot:
    """Return a robot with the geometry of a model, and with efference copies measured on it.

    A robot without a leg that feedback can displace is unchanged.

    Args:
        robot: whose first network is used.
        model: as of ``robot_model.load``.
        gaits: to measure; others keep their copies.
        update: called with each gait after its measurement.
        kp: proportional gain of the joints, N m / rad; None for the default.
        kd: damping gain of the joints, N m s / rad; the same.

    Raises:
        SimulationError: the model cannot be used.
        Refused: a gait cannot run.
        InputError: a robot did not go through all phases of a stride.

    """
    motions, geometry = dict(robot.motions), geometry_from(robot, load_description(model))
    if not geometry.legs:
        return robot
    for gait in gaits:
        loop = ClosedLoopBatch(model, plan_gait(robot, gait), kp=kp, kd=kd)
        motions[gait] = replace(robot.motion(gait, gait),
                                efference=measure_efference(loop).as_table())
        robot = replace(robot, geometry=geometry)
        update(gait)
    return replace(robot, motions=motions)


#: TOPIC_TYPES: key of a topic that is read -> its type.
TOPIC_TYPES = {'joint_states': 'sensor_msgs/msg/JointState', 'imu': 'sensor_msgs/msg/Imu',
         'foot_contacts': 'std_msgs/msg/Float64MultiArray',
         'phase': 'std_msgs/msg/Float64MultiArray'}
#: OPTIONAL: keys of topics that a bag may lack.
OPTIONAL = ('phase',)


@dataclass(frozen=True, eq=False, repr=False)
class WalkRecording(ShortRepr):
    """Sensor data of a walking robot.

    Attributes:
        source: the bag.
        joints: names, leg by leg.
        times: of the IMU's stamps, rising, s, shape (n,).
        senses: at these times, as of n runs.
        phase: of the first leg's cell, by the generator, cycles, shape (n,), or None.

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
    """Read the sensor data for feedback from a bag.

    Unitree's LowState has all of them except the phase; it is read if the bag has no joint states.

    Args:
        path: the bag.
        robot: with the joints and legs to read.
        topics: their names, by the keys of TOPIC_TYPES.

    Raises:
        RecordingError: the bag or a message cannot be read, a topic is missing or of another type,
            or a joint or a leg is not in it.

    """
    # Loaded here: what tunes gaits needs no bags.
    from cpg_ros.fitting.recordings.bag_storage import opened
    from cpg_ros.fitting.recordings.low_state import LOW_STATE
    from cpg_ros.fitting.recordings.rosbags_library import SerdeError, TYPESTORE

    path = Path(path)
    names = {key: '/' + topic.lstrip('/') for key, topic in topics.items()}
    with opened(path) as bag:
        kinds = {connection.topic: connection.msgtype for connection in bag.connections}
        dogs = [topic for topic, kind in kinds.items() if kind == LOW_STATE]
        if dogs and kinds.get(names['joint_states']) != TOPIC_TYPES['joint_states']:
            topic_names, counts = names['joint_states'], bag.expected()
            return _of_low_states(path, robot, [
                (received, data) for _, received, data in bag.messages(
                    [topic_names if topic_names in dogs else max(dogs, key=counts.__getitem__)])])
        for key, topic in list(names.items()):
            if key in OPTIONAL and topic not in kinds:
                del names[key]
            elif kinds.get(topic) != TOPIC_TYPES[key]:
                there = ', '.join(f'{name} ({kind})' for name, kind in list(kinds.items())[:8])
                raise RecordingError(f'{path}: no topic {topic} of type {TOPIC_TYPES[key]} (--'
                                     f'{key.replace("_", "-")}); it has {there or "none"}')
        key_of = {topic: key for key, topic in names.items()}
        by_key: dict[str, list[tuple[int, Any]]] = {key: [] for key in names}
        for topic, received, data in bag.messages(list(names.values())):
            key = key_of[topic]
            try:
                by_key[key].append((received, TYPESTORE.deserialize_cdr(data, TOPIC_TYPES[key])))
            except SerdeError as error:
                raise RecordingError(f'{path}, {topic}: a message cannot be read: {error}'
                                     ) from error
    for key, messages in by_key.items():
        if len(messages) < 2:
            raise RecordingError(f'{path}: {len(messages)} messages of {names[key]}')
    return _joined(path, robot, by_key)


def _joined(path: Path, robot: Robot,
            messages_of: dict[str, list[tuple[int, Any]]]) -> WalkRecording:
    received = np.array([at for at, _ in messages_of['imu']], dtype=float)
    stamps = np.array([_stamp(message) for _, message in messages_of['imu']])
    # If the bag was played faster or slower, only the stamps tell the true time.
    first = stamps[0]
    times, keep = np.unique(1e-9 * (stamps - first), return_index=True)
    messages = [messages_of['imu'][k][1] for k in keep]

    def to_imu(key: str, rows: np.ndarray, own: np.ndarray) -> np.ndarray:
        if rows.ndim != 2 or not np.isfinite(rows).all():
            raise RecordingError(f'{path}: {key} has messages without numbers')
        return np.stack([np.interp(times, 1e-9 * (own - first), row) for row in rows.T], axis=1)

    joints = tuple(joint.name for joint in robot.joints)
    states = [message for _, message in messages_of['joint_states']]
    indices = []
    for name in joints:
        if name not in states[0].name:
            raise RecordingError(f"{path}: joint_states has no joint '{name}'")
        indices.append(list(states[0].name).index(name))
    own = np.array([_stamp(message) for message in states])
    angles, rates = (np.array([getattr(one, part)[indices] if len(getattr(one, part)) else
                               np.full(len(indices), np.nan) for one in states])
                     for part in ('position', 'velocity'))
    # Without stamps: by when they were received, beside the IMU's.
    by_leg = {}
    for key in ('foot_contacts', 'phase'):
        rows = [message.data for _, message in messages_of.get(key, [])]
        if {len(row) for row in rows} - {len(robot.legs)}:
            raise RecordingError(f'{path}: {key} does not have {len(robot.legs)} numbers, one a '
                                 'leg')
        at = np.interp([when for when, _ in messages_of.get(key, [])], received, stamps)
        by_leg[key] = np.array(rows), at
    loads, at = by_leg['foot_contacts']
    phase = None
    if len(by_leg['phase'][0]):
        first_leg = 2.0 * np.pi * by_leg['phase'][0][:, :1]
        phase = to_imu('phase', np.unwrap(first_leg, axis=0), by_leg['phase'][1])[:, 0] / (
            2.0 * np.pi)

    def vectors(part: str, axes: str = 'xyz') -> np.ndarray:
        return np.array([[getattr(getattr(one, part), axis) for axis in axes]
                         for one in messages])

    senses = SensorData(to_imu('joint_states.position', angles, own),
                    to_imu('joint_states.velocity', rates, own),
                    to_imu('foot_contacts', loads, at), rpy_of(vectors('orientation', 'wxyz')),
                    vectors('angular_velocity'), vectors('linear_acceleration'))
    return WalkRecording(str(path), joints, times, senses, phase)


def _of_low_states(path: Path, robot: Robot, states: Sequence[tuple[int, bytes]]
                   ) -> WalkRecording:
    from cpg_ros.fitting.recordings.low_state import decode_low_states, low_states
    received = np.array([at for at, _ in states], dtype=np.int64)
    stamps, keep = np.unique(received, return_index=True)
    if len(keep) < 2:
        raise RecordingError(f'{path}: {len(keep)} messages of LowState')
    times, messages = 1e-9 * (stamps - stamps[0]), [states[k][1] for k in keep]
    feet = [CODES[code] for code in ('fr', 'fl', 'rr', 'rl')]
    if set(robot.legs) != set(feet):
        raise RecordingError(f'{path}: LowState is of the legs {", ".join(feet)}, where the robot '
                             f'has {", ".join(robot.legs)}')
    try:
        own = low_states(messages)
        (block,) = decode_low_states(messages, robot.order, True)
    except CpgError as error:
        raise RecordingError(f'{path}, LowState: {error}') from error
    joints = tuple(joint.name for joint in robot.joints)
    if lacking := [name for name in joints if name not in block.names]:
        raise RecordingError(f"{path}: LowState has no joint '{lacking[0]}'")
    indices = [block.names.index(name) for name in joints]
    return WalkRecording(str(path), joints, times, SensorData(
        block.positions[:, indices], block.velocities[:, indices],
        own['feet'][:, [feet.index(leg) for leg in robot.legs]].astype(float),
        rpy_of(own['quaternion'].astype(float)), own['gyroscope'].astype(float),
        own['accelerometer'].astype(float)))


def _stamp(message: Any) -> float:
    """Return the time of a message's header, ns."""
    return 1e9 * message.header.stamp.sec + message.header.stamp.nanosec
