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

"""Leg odometry: where the base is, from the estimated velocity, and how uncertain that is.

The position integrates the velocity of the base, turned by the measured heading. Its error is that
of a velocity which is off by a constant share (soft feet, geometry) and by a little that changes
slowly (feet that slip or sink; a first-order Gauss-Markov process in the base's frame), of white
noise, and of a heading that drifts. The covariance is that of an extended Kalman filter without
corrections.
"""

from collections.abc import Callable
import math

from cpg_ros.feedback.estimate import fill_quaternion, SensorData
from cpg_ros.feedback.kinematics import foot_of, Geometry
from cpg_ros.integration.jit import bound, entry
import numpy as np

#: Standard deviation of the slow velocity error: at rest, m/s, and as a share of the speed; its
#: correlation time, s. Of a simulated Go2 that trots, walks, turns and is pushed.
STILL, SHARE, SLOWLY = 0.001, 0.015, 15.0
#: Standard deviation of the constant share by which the velocity is wrong of a robot whose way was
#: never measured.
SCALE = 0.05
#: White noise of the position, m/sqrt(s), and of the heading, rad/sqrt(s): an IMU drifts by half a
#: degree in a minute.
PLACE, HEADING = 0.001, 0.001
#: Feet stand on ground that is level within this share of the way, one standard deviation.
LEVEL = 0.05
#: Standard deviation of the height above level ground, m.
HEIGHT = 0.01
#: Standard deviation of the velocity forward, to the left and up at an instant, m/s.
INSTANT = 0.02, 0.02, 0.03
#: Standard deviation of roll and pitch as IMUs measure them, rad, and of their rates, rad/s.
TILT, RATE = 0.01, 0.02
#: Standard deviation of a velocity that is not measured, m/s, beside the last measured speed.
UNSEEN = 0.5
#: Components of the state: x, y, heading, slow error forward and to the left, constant share.
STATES = 6


@entry
def _advance(legs, joints, contact, motion, pose, covariance, scratch):
    """Advance a pose, x, y, z and heading, and the covariance of its states, in place."""
    velocity, rpy, dt = motion
    yaw = rpy[2] - pose[4]
    cr, sr, cp, sp = math.cos(rpy[0]), math.sin(rpy[0]), math.cos(rpy[1]), math.sin(rpy[1])
    cy, sy = math.cos(yaw), math.sin(yaw)
    forward = cp * velocity[0] + sp * (sr * velocity[1] + cr * velocity[2])
    left = cr * velocity[1] - sr * velocity[2]
    east, north = cy * forward - sy * left, sy * forward + cy * left
    pose[0] += dt * east
    pose[1] += dt * north
    pose[3] = (yaw + math.pi) % (2.0 * math.pi) - math.pi
    high, standing = 0.0, 0
    for leg in range(contact.shape[0]):
        if contact[leg] and legs.rows[leg, 1] != 0.0:
            columns = legs.columns[leg]
            x, y, z = foot_of(legs.rows[leg], joints[columns[0]], joints[columns[1]],
                              joints[columns[2]])
            high += sp * x - cp * (sr * y + cr * z) + legs.radius
            standing += 1
    pose[2] = (high / standing if standing else
               pose[2] + dt * (cp * (sr * velocity[1] + cr * velocity[2]) - sp * velocity[0]))

    # P <- F P F' + Q, where F differs from one in the rows of x and y, and in the slow errors.
    stays = math.exp(-dt / SLOWLY)
    scratch[:] = 0.0
    for k in range(STATES):
        scratch[k, k] = stays if k in (3, 4) else 1.0
    scratch[0, 2], scratch[1, 2] = -dt * north, dt * east
    scratch[0, 3], scratch[0, 4] = dt * cy, -dt * sy
    scratch[1, 3], scratch[1, 4] = dt * sy, dt * cy
    scratch[0, 5], scratch[1, 5] = dt * east, dt * north
    covariance[:] = scratch @ covariance @ scratch.T
    slow = STILL**2 + SHARE**2 * (forward**2 + left**2)
    for k, added in enumerate((dt * PLACE**2, dt * PLACE**2, dt * HEADING**2,
                               (1.0 - stays**2) * slow, (1.0 - stays**2) * slow)):
        covariance[k, k] += added
    pose[5] += dt * math.hypot(forward, left)


class Odometry:
    """Where the base of one robot is, from where it was first.

    The x axis of its frame is the base's heading at the start. Height is that above the feet which
    stand: going up a slope is not seen.

    Attributes:
        pose: x, y and z in m, heading in rad, those of the start, and the way so far in m.
        covariance: of x, y, heading, the slow velocity error forward and to the left, and the
            share by which velocities are wrong, in m, rad and m/s, shape (6, 6).
        twist: velocity and angular velocity in the base's frame, m/s and rad/s, shape (6,).

    """

    def __init__(self, geometry: Geometry, scale: float = 1.0, scale_error: float = SCALE) -> None:
        """Begin where the base is.

        Args:
            geometry: of the legs.
            scale: by which estimated velocities are multiplied: true way over estimated way.
            scale_error: its standard deviation.

        """
        self._legs, self._scale, self._velocity = geometry.arrays, scale, np.zeros(3)
        self._scale_error = scale_error
        self.pose = np.zeros(6)
        self.covariance = np.zeros((STATES, STATES))
        self._scratch = np.zeros((STATES, STATES))
        self._tilt, self.twist = np.zeros(3), np.zeros(6)
        self._kernel: Callable | None = None
        self._started, self._unseen = False, 0.0

    def restart(self) -> None:
        """Start again where the base is now."""
        self.pose[:] = self.covariance[:] = 0.0
        self._started, self._unseen = False, 0.0
        self.twist[:] = 0.0

    def advance(self, sensors: SensorData, velocity: np.ndarray, contact: np.ndarray, dt: float
                ) -> None:
        """Take a step.

        Args:
            sensors: what is measured now, of one run.
            velocity: of the base in its own frame, as estimated, m/s, shape (3,).
            contact: whether each foot is on the ground, shape (legs,).
            dt: s.

        """
        rpy, self._unseen = sensors.rpy[0], 0.0
        if not self._started:
            self.pose[4], self._started = rpy[2], True
            self.covariance[3, 3] = self.covariance[4, 4] = STILL**2
            self.covariance[5, 5] = self._scale_error**2
        np.multiply(velocity, self._scale, out=self._velocity)
        arguments = (self._legs, sensors.joint_positions[0], contact, (self._velocity, rpy, dt),
                     self.pose, self.covariance, self._scratch)
        if self._kernel is None:
            self._kernel = bound(_advance, *arguments)
        self._kernel(*arguments)
        self._tilt = rpy
        self.twist[:3], self.twist[3:] = self._velocity, sensors.angular_velocity[0]

    def lose(self, dt: float) -> None:
        """Take a step of dt in s without measurements.

        The base may have kept any constant velocity since the last one, of which UNSEEN and the
        last speed are standard deviations: the error grows with the time, its variance with the
        square of that.
        """
        before = self._unseen
        self._unseen += dt
        added = (UNSEEN**2 + self.twist[0]**2 + self.twist[1]**2) * (self._unseen**2 - before**2)
        for k in range(2):
            self.covariance[k, k] += added

    def orientation(self, out: np.ndarray) -> None:
        """Fill the orientation in the odometry's frame, w x y z."""
        fill_quaternion(self._tilt[0], self._tilt[1], self.pose[3], out)

    def pose_covariance(self, out: np.ndarray) -> np.ndarray:
        """Fill that of x, y, z, roll, pitch and yaw in m and rad, shape (6, 6), as ROS has it."""
        out[:] = 0.0
        for row, k in enumerate((0, 1, 5)):
            for column, other in enumerate((0, 1, 5)):
                out[k, other] = self.covariance[row, column]
        out[2, 2] = HEIGHT**2 + (LEVEL * self.pose[5])**2
        out[3, 3] = out[4, 4] = TILT**2
        return out
