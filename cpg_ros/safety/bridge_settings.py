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

"""Settings of a bridge: the robot's joints, gains, poses, limits and times."""

from dataclasses import dataclass
import math

from cpg_ros.errors import InputError
from cpg_ros.robots.robot import Robot
from cpg_ros.short_repr import ShortRepr
import numpy as np


@dataclass(frozen=True, eq=False, repr=False)
class BridgeSettings(ShortRepr):
    """Joints, gains, poses, limits and times; arrays have shape (joints,), in motor order.

    Attributes:
        names: of the joints.
        kp: N m / rad.
        kd: N m s / rad.
        torque: largest that a command may ask for, N m.
        lower: smallest angles, rad.
        upper: largest angles, rad.
        velocity: largest speeds of commanded angles, rad/s.
        stand: pose to rise to, rad.
        lying: pose to sit down to, rad.
        most_kp: up to which a generator's feedback may scale kp, N m / rad.
        period: between two commands, s.
        damping: kd with which joints are only damped, N m s / rad.
        rise: time from the measured pose to the stand, s.
        approach: time from the stand to the first targets, s.
        late: time at the last target after which the legs gather at the stand, s.
        fade: time in which a gait fades to the stand before the robot sits, s; less than ``sit``.
        sit: time from the stand to lying, s.
        fold: time in which legs in mid-stride join that motion, or gather at the stand, s.
        target_timeout: longest time without a fresh target, s.
        state_timeout: longest time without a fresh state, s.
        tilt: largest tilt of the body, rad.
        hottest: motor temperature at which the robot is damped, deg C.
        margin: how far measured angles may exceed the joint limits, rad: a swinging leg runs
            into its stop.
        astray: largest distance from the stand after rising, rad.
        tracking_error: largest mean distance of a joint from its commanded angle while it
            follows targets, rad.
        tracking_time: over which that mean is taken, s.

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
    most_kp: float = math.inf
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
    tracking_error: float = math.inf
    tracking_time: float = 1.0


def motor_places(robot: Robot, joints: tuple[str, ...], whose: str) -> np.ndarray:
    """Return the position of each motor's joint in ``robot.order``, shape (joints,).

    Args:
        robot: of the robot file.
        joints: names in motor order.
        whose: whose motors these are, for the message.

    Raises:
        InputError: the robot file has other joints.

    """
    missing = [name for name in joints if name not in robot.order]
    extra = [name for name in robot.order if name not in joints]
    if missing or extra:
        name = (missing or extra)[0]
        raise InputError(f"the robot file '{robot.name}' has {'no ' if missing else ''}joint "
                         f"'{name}'; {whose} have {', '.join(joints)}")
    return np.array([robot.order.index(name) for name in joints])


def settings_for(robot: Robot, places: np.ndarray, *, kp: np.ndarray, kd: np.ndarray,
                 torque: np.ndarray, lying: np.ndarray, **others: float) -> BridgeSettings:
    """Return the settings of a robot file; arrays have shape (joints,), in motor order.

    Args:
        robot: provides limits, speeds and the stand (offsets).
        places: as returned by ``motor_places``.
        kp: proportional gains, N m / rad.
        kd: damping gains, N m s / rad.
        torque: largest torques, N m.
        lying: pose to sit down to, rad; clipped to the limits.
        others: further attributes of ``BridgeSettings``.

    """
    order = robot.places[places]
    lower, upper, velocity, stand = (robot.column(name)[order] for name in (
        'lower', 'upper', 'velocity', 'offset'))
    return BridgeSettings(tuple(robot.order[place] for place in places), kp, kd, torque, lower,
                          upper, velocity, stand, np.clip(lying, lower, upper), **others)
