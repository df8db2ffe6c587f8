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

"""Pose of a body above its feet, which keep their places on the ground.

A pose is the height above the stand, m, and roll, pitch and yaw, rad, about the base's origin:
first yaw, then pitch (positive nose down), then roll (positive to the right).
"""

from collections.abc import Sequence
import ctypes
from functools import cached_property
import math

from cpg_ros.common.errors import InputError
from cpg_ros.motion.body_file import leg_axes
from cpg_ros.motion.core import Body, core, Smoother
from cpg_ros.motion.plan import beyond_limits, GaitPlan
from cpg_ros.motion.robot import Robot
import numpy as np

#: POSE_NAMES: names of a pose's numbers; POSE_UNITS: their units.
POSE_NAMES, POSE_UNITS = ('height', 'roll', 'pitch', 'yaw'), ('m', 'rad', 'rad', 'rad')
#: FOOT_TOLERANCE: largest distance of a foot from its place, m.
FOOT_TOLERANCE = 1e-5
#: NUM_WAYPOINTS: number of poses on the way along which angles are followed; NUM_ITERATIONS: of
#: the search for each.
NUM_WAYPOINTS, NUM_ITERATIONS = 10, 20
#: MIN_SEATED_HEIGHT: least height of the base over its feet when it sits, as a fraction of the
#: stand's.
MIN_SEATED_HEIGHT = 0.3
#: MAX_SPEED: largest speed of a joint as the body moves, as a fraction of its limit.
MAX_SPEED = 0.5
#: PEAK_SPEED: largest speed of an approach, as a fraction of its way per time constant;
#: TIME_CONSTANT: that time constant, s (``c/steering.c``).
PEAK_SPEED, TIME_CONSTANT = 1.0 / math.e, 0.2


class BodyPose:
    """A robot's body on its way to a pose, and the joint angles of the stand in that pose.

    ``go_to`` may be called from another thread than the ticks.

    Attributes:
        unavailable: why the body cannot be moved, '' if it can.
        now: present pose.
        target: pose to reach.
        address: of its struct in the core.

    """

    def __init__(self, robot: Robot) -> None:
        """Begin in the stand."""
        legs = robot.geometry.legs if robot.geometry is not None else {}
        self.unavailable = (
            f"robot '{robot.name}' balances on its soles: its feedback moves the body"
            if robot.biped is not None else
            next((f"robot file '{robot.name}' has no geometry of the leg {leg} (part geometry: "
                  'check_robot --make writes it, and tune)' for leg in robot.legs
                  if leg not in legs), ''))
        legs = {} if self.unavailable else {leg: legs[leg] for leg in robot.legs}
        self._robot, self._stand = robot, robot.column('offset')
        self._low, self._high, self._fast = (robot.column(key)
                                             for key in ('lower', 'upper', 'velocity'))
        names = [joint.name for joint in robot.joints]
        joints, limbs = np.full((len(legs), 3), -1, np.int16), np.zeros((len(legs), 8, 3))
        for row, limb, leg in zip(joints, limbs, legs.values(), strict=True):
            count = len(leg.joints)
            row[:count] = [names.index(name) for name in leg.joints]
            limb[:count] = (leg_axes(leg.yaw, leg.roll).T[[0, 1, 1][-count:]]
                            * np.array(leg.turns)[:, None])
            limb[3:3 + count] = [leg.thigh, leg.calf, leg.foot][-count:]
            limb[6] = leg.hip if count == 3 else np.add(leg.hip, leg.thigh)
        self.now, self.target, rate = np.zeros((3, len(POSE_NAMES)))
        #: Rates of the stand's angles, rad/s, and arrays that only the core uses.
        self._kept = np.zeros(len(names)), rate, joints, limbs
        self._struct = Body(Smoother(self.now.ctypes.data, rate.ctypes.data,
                                     self.target.ctypes.data, None, len(POSE_NAMES) - 1, 0),
                            1.0, self._kept[0].ctypes.data, joints.ctypes.data,
                            limbs.ctypes.data, len(legs), 0)
        self.address = ctypes.addressof(self._struct)
        feet = np.empty((len(legs), 3))
        core().cpg_feet(self.address, self._stand.ctypes.data, feet.ctypes.data)
        limbs[:, 7] = feet

    @property
    def moving(self) -> bool:
        """Whether the body is on its way to its target."""
        return bool(self._struct.moving)

    @property
    def seated(self) -> bool:
        """Whether the robot sits, or is about to."""
        return bool(self.target[0] < 0.0 and (self.target == self.seat).all())

    def angles(self, pose: Sequence[float] | np.ndarray, plan: GaitPlan | None = None
               ) -> np.ndarray:
        """Return the angles of the joints in a pose, rad, shape (joints,).

        Raises:
            InputError: the body cannot be moved, a foot does not reach the ground, or a joint
                would leave its limits in the pose, or in the gait of ``plan`` about it.

        """
        if self.unavailable:
            raise InputError(self.unavailable)
        angles, far = self._stand.copy(), 0.0
        for fraction in np.arange(1, NUM_WAYPOINTS + 1) / NUM_WAYPOINTS:
            waypoint = fraction * np.asarray(pose, dtype=float)
            far = core().cpg_pose(self.address, waypoint.ctypes.data, angles.ctypes.data,
                                  NUM_ITERATIONS)
        if not far < FOOT_TOLERANCE:
            raise InputError(f'{_text(pose)}: the feet do not reach their places on the ground')
        spans = np.zeros((2, len(angles))) if plan is None else plan.span
        gait = '' if plan is None else f" in the gait '{plan.name}'"
        for joint, angle, low, high in zip(self._robot.joints, angles, *spans, strict=True):
            if faults := beyond_limits(joint, angle + min(low, 0.0), angle + max(high, 0.0)):
                raise InputError(f'{_text(pose)}{gait} takes {faults[0]}')
        return angles

    @cached_property
    def seat(self) -> np.ndarray:
        """Pose in which the robot sits: as low as its joints allow, down to MIN_SEATED_HEIGHT."""
        stand = -float(self._kept[3][:, 7, 2].mean())
        low, high = -(1.0 - MIN_SEATED_HEIGHT) * stand, 0.0
        tried = low
        while high - low > 1e-3:
            try:
                self.angles((tried, 0.0, 0.0, 0.0))
                high = tried
            except InputError:
                low = tried
            tried = 0.5 * (low + high)
        return np.array([high, 0.0, 0.0, 0.0])

    def go_to(self, pose: Sequence[float] | np.ndarray, time: float) -> None:
        """Go to a pose in about a time in s, longer where joints' speed limits require it.

        Raises:
            InputError: as of ``angles``.

        """
        way = np.abs(self.angles(pose) - self.angles(self.now))
        shortest = float((way / self._fast).max()) * PEAK_SPEED / MAX_SPEED
        constant = max(time * TIME_CONSTANT, shortest, 1e-3)
        self._struct.pace = TIME_CONSTANT / constant
        self.target[:] = pose
        self._struct.moving = 1


def _text(pose: Sequence[float] | np.ndarray) -> str:
    """Return the nonzero numbers of a pose, such as 'body.height -0.1 m, body.roll 0.2 rad'."""
    return ', '.join(f'body.{name} {value:g} {unit}' for name, value, unit
                     in zip(POSE_NAMES, pose, POSE_UNITS, strict=True) if value)
