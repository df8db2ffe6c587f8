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

"""Unitree's four-legged robots: motor order, torque limits, gains and the lying pose."""

from dataclasses import dataclass

from cpg_ros.common.errors import InputError
from cpg_ros.motion.robot import Robot
from cpg_ros.ros.bridges.robot_state import BridgeSettings, motor_indices, settings_for
import numpy as np

PARTS = ('hip', 'thigh', 'calf')
#: Joints in the order of Unitree's motors.
JOINTS = tuple(f'{leg}_{part}_joint' for leg in ('FR', 'FL', 'RR', 'RL') for part in PARTS)


@dataclass(frozen=True)
class Model:
    """One kind of robot; columns are hip, thigh and calf.

    Attributes:
        torque: limits of the joints, N m.
        most_kp: largest proportional gain, N m / rad.
        most_kd: largest damping gain, N m s / rad.
        lying: pose on its belly, rad (the first pose of Unitree's own examples).

    """

    torque: tuple[float, float, float]
    most_kp: float
    most_kd: float
    lying: tuple[float, float, float] = (0.0, 1.36, -2.65)


#: Torques as in Unitree's own models of the robots (unitree_ros, unitree_mujoco).
MODELS = {'go2': Model((23.7, 23.7, 45.43), 150.0, 8.0),
          'go1': Model((23.7, 23.7, 35.55), 150.0, 8.0),
          'b2': Model((200.0, 200.0, 320.0), 1000.0, 20.0)}


def each(values: list[float], name: str, most: float) -> np.ndarray:
    """Return a number for each of the joints.

    Args:
        values: one for all, three for hip, thigh and calf, or one for each of JOINTS.
        name: of the parameter, for messages.
        most: largest that is allowed; from 0 on.

    Returns:
        Shape (12,).

    Raises:
        InputError: there are not 1, 3 or 12 of them, or one is out of range.

    """
    if len(values) not in (1, len(PARTS), len(JOINTS)):
        raise InputError(f'{name} has {len(values)} numbers: give one for all joints, three for '
                         f'{", ".join(PARTS)}, or {len(JOINTS)}, for {", ".join(JOINTS)}')
    for value in values:
        if not 0.0 <= value <= most:
            raise InputError(f'{name}: {value:g} is not from 0 to {most:g}')
    return np.resize(np.array(values, dtype=float), len(JOINTS))


def motor_order(robot: Robot) -> np.ndarray:
    """Return the position of each of Unitree's motors in ``robot.order``, shape (12,).

    Raises:
        InputError: the robot's joints are not those of a Unitree robot.

    """
    return motor_indices(robot, JOINTS, "Unitree's robots")


def settings_of(robot: Robot, model: Model, kp: list[float], kd: list[float],
                torque_factor: float = 1.0, **others: float) -> BridgeSettings:
    """Return the settings of a robot file and a model.

    Args:
        robot: provides limits, speeds and the stand (offsets).
        model: provides torque limits and the lying pose.
        kp: proportional gains, as ``each`` takes them.
        kd: damping gains, likewise.
        torque_factor: fraction of the torque limits that commands may use.
        others: further attributes of ``BridgeSettings``.

    Raises:
        InputError: the robot is not one of Unitree's, or a gain is out of range.

    """
    n = len(JOINTS)
    return settings_for(
        robot, motor_order(robot), kp=each(kp, 'kp', model.most_kp),
        kd=each(kd, 'kd', model.most_kd),
        torque=torque_factor * np.resize(model.torque, n), lying=np.resize(model.lying, n),
        most_kp=model.most_kp, **others)
