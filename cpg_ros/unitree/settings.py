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

"""All that a bridge must know of a robot and of what is safe with it."""

from dataclasses import dataclass
import math

from cpg_ros.errors import InputError
from cpg_ros.robots.robot import Robot
from cpg_ros.unitree.models import each, JOINTS, Model
import numpy as np


@dataclass(frozen=True)
class Settings:
    """Joints, limits, poses and times; arrays have shape (12,), joints as Unitree's motors.

    Attributes:
        names: of the joints.
        kp: N m / rad.
        kd: N m s / rad.
        torque: largest that a command may ask for, N m.
        lower: least angles, rad.
        upper: largest angles, rad.
        velocity: largest speeds of what is commanded, rad/s.
        stand: pose to rise to, rad.
        lying: pose to sit down to, rad.
        period: between two commands, s.
        damping: kd once nothing else holds the joints, N m s / rad.
        rise: time from the measured pose to the stand, s.
        approach: time from the stand to the first targets, s.
        late: longest time at a last target before the legs gather at the stand, s.
        fade: time in which a gait fades to the stand before the robot sits, s; less than ``sit``.
        sit: time from the stand to lying, s.
        fold: time in which legs amid a stride gather on that way, or at the stand, s.
        target_timeout: longest time without a fresh target, s.
        state_timeout: longest time without a fresh state, s.
        tilt: largest lean of the body, rad.
        hottest: temperature of a motor at which it is let go, deg C.
        margin: beyond the joint limits that what is measured may be, rad: a leg that swings
            runs into its stop.
        astray: largest distance from the stand after rising, rad.

    """

    names: tuple[str, ...]
    kp: np.ndarray
    kd: np.ndarray
    torque: np.ndarray
    lower: np.ndarray
    upper: np.ndarray
    velocity: np.ndarray
    stand: np.ndarray
    lying: np.ndarray
    period: float = 0.002
    damping: float = 5.0
    rise: float = 2.0
    approach: float = 1.0
    late: float = 0.03
    fade: float = 0.5
    sit: float = 1.5
    fold: float = 0.06
    target_timeout: float = 0.1
    state_timeout: float = 0.02
    tilt: float = math.radians(50.0)
    hottest: float = 85.0
    margin: float = 0.2
    astray: float = 0.4


def places(robot: Robot) -> np.ndarray:
    """Return where in ``robot.order`` each of Unitree's motors is, shape (12,).

    Raises:
        InputError: the robot's joints are not those of a Unitree robot.

    """
    missing = [name for name in JOINTS if name not in robot.order]
    extra = [name for name in robot.order if name not in JOINTS]
    if missing or extra:
        name = (missing or extra)[0]
        raise InputError(f"the robot file '{robot.name}' has {'no ' if missing else ''}joint "
                         f"'{name}'; Unitree's robots have {', '.join(JOINTS)}")
    return np.array([robot.order.index(name) for name in JOINTS])


def settings_of(robot: Robot, model: Model, kp: list[float], kd: list[float],
                torque_factor: float = 1.0, **others: float) -> Settings:
    """Return the settings of a robot file and a model.

    Args:
        robot: whose limits, speeds and stand (offsets) are taken.
        model: what the motors bear, and how it lies.
        kp: proportional gains, as ``each`` takes them.
        kd: damping gains, the same.
        torque_factor: share of what the motors bear that commands may ask for.
        others: further attributes of Settings.

    Raises:
        InputError: the robot is not one of Unitree's, or a gain is out of range.

    """
    order = robot.places[places(robot)]
    lower, upper, velocity, stand = (robot.column(name)[order] for name in (
        'lower', 'upper', 'velocity', 'offset'))
    lying = np.clip(np.resize(model.lying, len(JOINTS)), lower, upper)
    return Settings(JOINTS, each(kp, 'kp', model.most_kp), each(kd, 'kd', model.most_kd),
                    torque_factor * np.resize(model.torque, len(JOINTS)), lower, upper, velocity,
                    stand, lying, **others)
