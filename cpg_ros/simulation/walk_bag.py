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

"""What a simulated robot's sensors measured, as a bag of joint states, IMU and loads on feet."""

from pathlib import Path

from cpg_ros.feedback.estimate import fill_quaternion, SensorData
from cpg_ros.recordings.bag_writer import BagWriter
from cpg_ros.robots.robot import Robot
import numpy as np
from rosbags.typesys import get_typestore, Stores

#: Stamps begin here, ns.
START = 1_700_000_000_000_000_000
STORE = get_typestore(Stores.ROS2_JAZZY)
JOINTS, IMU, LOADS = ('sensor_msgs/msg/JointState', 'sensor_msgs/msg/Imu',
                      'std_msgs/msg/Float64MultiArray')


def write_bag(path: Path, robot: Robot, senses: SensorData, efforts: np.ndarray, period: float
              ) -> None:
    """Write the topics ``joint_states``, ``imu`` and ``foot_contacts``, packed.

    Args:
        path: of the bag, a folder that is not there yet.
        robot: whose joints and legs they are.
        senses: of arrays (samples, ...).
        efforts: of the joints, N m, shape (samples, joints).
        period: between samples, s.

    Raises:
        BagError: the bag cannot be written.

    """
    types = STORE.types
    angles, speeds, loads, rpy, turning, acceleration = senses
    names, unknown = [joint.name for joint in robot.joints], np.zeros(9)
    facing = np.zeros(4)
    legs = types['std_msgs/msg/MultiArrayDimension'](','.join(robot.legs), len(robot.legs), 1)
    layout = types['std_msgs/msg/MultiArrayLayout']([legs], 0)
    bag = BagWriter(path, packed=True)
    to = {kind: bag.connect(topic, kind, lambda kind: '') for topic, kind in (
        ('/joint_states', JOINTS), ('/imu', IMU), ('/foot_contacts', LOADS))}
    vector, turn = types['geometry_msgs/msg/Vector3'], types['geometry_msgs/msg/Quaternion']
    for k in range(len(angles)):
        stamp = START + round(1e9 * k * period)
        header = types['std_msgs/msg/Header'](types['builtin_interfaces/msg/Time'](
            stamp // 10**9, stamp % 10**9), 'base_link')
        roll, pitch, yaw = rpy[k].tolist()
        fill_quaternion(roll, pitch, yaw, facing)
        w, *xyz = facing.tolist()
        for kind, message in (
                (JOINTS, types[JOINTS](header, names, angles[k], speeds[k], efforts[k])),
                (IMU, types[IMU](header, turn(*xyz, w), unknown, vector(*turning[k]), unknown,
                                 vector(*acceleration[k]), unknown)),
                (LOADS, types[LOADS](layout, loads[k]))):
            bag.write(to[kind], stamp, bytes(STORE.serialize_cdr(message, kind)))
    bag.close()
