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

"""Estimates from sensor data: loads on the feet, contacts, velocity over ground and odometry."""

import math
from typing import NamedTuple

from cpg_ros.dynamics.integration.compilation import jit, jit_entry
from cpg_ros.feedback.kinematics import (
    cross,
    foot_of,
    from_leg,
    Geometry,
    GRAVITY,
    slopes_of,
    vertical,
)
from cpg_ros.motion.rotations import fill_quaternion
import numpy as np

# Foot forces from joint torques, for feet without sensors.

#: MIN_DETERMINANT: determinant of a leg's Jacobian, m^3, below which torques do not determine the
#: force.
MIN_DETERMINANT = 1e-6


@jit
def load_of(leg, columns, angles, efforts, up, slopes):
    """Return the upward force on a foot, N, of a leg without mass.

    Args:
        leg: a row of the geometry.
        columns: index of hip, thigh and calf among the joints.
        angles: of all joints, rad.
        efforts: of all joints, N m.
        up: the vertical in the base's frame.
        slopes: scratch, shape (3, 3).

    """
    hip, thigh, calf = columns[0], columns[1], columns[2]
    slopes_of(leg, angles[hip], angles[thigh], angles[calf], slopes)
    effort = (efforts[hip], efforts[thigh], efforts[calf])
    if leg[0] == 0.0:
        # Nothing holds it sideways: no force there.
        slopes[1, 0], effort = 1.0, (0.0, effort[1], effort[2])
    # By virtual work the efforts are -J^T F; J^-T has the cross products of J's rows as rows.
    forward, left, upward = (cross(slopes[1], slopes[2]), cross(slopes[2], slopes[0]),
                             cross(slopes[0], slopes[1]))
    volume = slopes[0, 0] * forward[0] + slopes[0, 1] * forward[1] + slopes[0, 2] * forward[2]
    if abs(volume) < MIN_DETERMINANT:
        return 0.0
    load = 0.0
    for k in range(3):
        load -= effort[k] * (up[0] * forward[k] + up[1] * left[k] + up[2] * upward[k]) / volume
    return load


@jit_entry
def loads_of(rows, columns, angles, efforts, roll, pitch, out):
    """Fill out, N, shape (legs,), with the upward forces on the feet of one robot.

    Rows and columns are the geometry's; angles in rad, efforts in N m, shape (joints,); roll
    and pitch in rad.
    """
    up, slopes = vertical(roll, pitch), np.empty((3, 3))
    for leg in range(len(out)):
        out[leg] = load_of(rows[leg], columns[leg], angles, efforts, up, slopes)


#: TOUCHDOWN_LOAD: fraction of the weight above which a foot is on the ground; LIFTOFF_LOAD:
#: fraction below which it is in the air again.
TOUCHDOWN_LOAD, LIFTOFF_LOAD = 0.10, 0.04
#: CORRECTION_TIME: time constant, s, with which a leg that bears the whole weight corrects the
#: velocity.
CORRECTION_TIME = 0.02
#: SLIP_SPEED: difference of a leg's velocity from the estimate, m/s, at which it counts half: it
#: slips.
SLIP_SPEED = 0.25
#: DISAGREEMENT_TIME: time, s, after which legs that contradict the estimate are believed, not the
#: estimate. WIDENING_TIME: time, s, in which the tolerance SLIP_SPEED then grows by its own size.
DISAGREEMENT_TIME, WIDENING_TIME = 0.2, 0.05


class SensorData(NamedTuple):
    """Measurements of a robot at an instant, of each run.

    Attributes:
        joint_positions: leg by leg, rad, shape (runs, joints).
        joint_velocities: the same, rad/s.
        foot_forces: upward on each foot, N, shape (runs, legs).
        rpy: roll, pitch and yaw, rad, shape (runs, 3).
        angular_velocity: of the base in its own frame, rad/s, shape (runs, 3).
        acceleration: as an accelerometer measures it, base's frame, m/s^2, shape (runs, 3).

    """

    joint_positions: np.ndarray
    joint_velocities: np.ndarray
    foot_forces: np.ndarray
    rpy: np.ndarray
    angular_velocity: np.ndarray
    acceleration: np.ndarray

    @classmethod
    def zeros(cls, runs: int, legs: int, joints: int) -> 'SensorData':
        """Return zeros, to be filled in place."""
        return cls(*(np.zeros((runs, size)) for size in (joints, joints, legs, 3, 3, 3)))


@jit
def velocity_by_leg(leg, joints, rates, slopes, turning, up, radius, out):
    """Fill the base's velocity according to one leg whose foot rolls on the ground, m/s.

    Args:
        leg: a row of the geometry.
        joints: hip, thigh and calf, rad.
        rates: of these, rad/s.
        slopes: scratch, shape (3, 3).
        turning: angular velocity of the base, rad/s, shape (3,).
        up: the vertical in the base's frame, shape (3,).
        radius: of the foot, m.
        out: shape (3,).

    """
    x, y, z = foot_of(leg, joints[0], joints[1], joints[2])
    slopes_of(leg, joints[0], joints[1], joints[2], slopes)
    hip, pitching = leg[0] * joints[0], leg[1] * rates[1] + leg[2] * rates[2]
    # Angular velocity of the shank.
    a, b, c = from_leg(leg, leg[0] * rates[0], pitching * math.cos(hip), pitching * math.sin(hip))
    a, b, c = turning[0] + a, turning[1] + b, turning[2] + c
    moving_x, moving_y, moving_z = turning[1] * z - turning[2] * y, turning[2] * x - turning[
        0] * z, turning[0] * y - turning[1] * x
    for joint in range(3):
        moving_x += slopes[0, joint] * rates[joint]
        moving_y += slopes[1, joint] * rates[joint]
        moving_z += slopes[2, joint] * rates[joint]
    out[0] = radius * (b * up[2] - c * up[1]) - moving_x
    out[1] = radius * (c * up[0] - a * up[2]) - moving_y
    out[2] = radius * (a * up[1] - b * up[0]) - moving_z


@jit
def update(legs, sensors, run, dt, velocity, contact, doubt, leg_velocities, scratch):
    """Update the estimate of one run: velocity (3,) and contact (legs,), in place.

    doubt[run] is how long the legs have disagreed with the estimate, s. leg_velocities, shape
    (legs, 4), are filled with each leg's estimate and its weight; scratch has the shape (4, 3).
    """
    rows, columns = legs.rows, legs.columns
    angles, rates = sensors.joint_positions[run], sensors.joint_velocities[run]
    forces, rpy = sensors.foot_forces[run], sensors.rpy[run]
    turning, acceleration = sensors.angular_velocity[run], sensors.acceleration[run]
    up, slopes, now = vertical(rpy[0], rpy[1]), scratch[:3], scratch[3]
    vx, vy, vz = velocity[0], velocity[1], velocity[2]
    velocity[0] += dt * (acceleration[0] - GRAVITY * up[0] - (turning[1] * vz - turning[2] * vy))
    velocity[1] += dt * (acceleration[1] - GRAVITY * up[1] - (turning[2] * vx - turning[0] * vz))
    velocity[2] += dt * (acceleration[2] - GRAVITY * up[2] - (turning[0] * vy - turning[1] * vx))
    total, loaded, apart = 0.0, 0.0, 0.0
    slip = SLIP_SPEED * (1.0 + max(doubt[run] - DISAGREEMENT_TIME, 0.0) / WIDENING_TIME)
    for leg in range(rows.shape[0]):
        fraction, seen = max(forces[leg], 0.0) / legs.weight, leg_velocities[leg]
        contact[leg] = fraction > (LIFTOFF_LOAD if contact[leg] else TOUCHDOWN_LOAD)
        seen[3] = 0.0
        if not contact[leg] or rows[leg, 1] == 0.0:
            continue
        first, second, third = columns[leg, 0], columns[leg, 1], columns[leg, 2]
        now[0], now[1], now[2] = angles[first], angles[second], angles[third]
        velocity_by_leg(rows[leg], now, (rates[first], rates[second], rates[third]), slopes,
                        turning, up, legs.radius, seen)
        off = 0.0
        for k in range(3):
            off += (seen[k] - velocity[k])**2
        # Even where all legs slip, they count a little: integrated accelerations drift.
        seen[3] = min(dt / CORRECTION_TIME * fraction / (1.0 + off / slip**2), 0.5)
        total += seen[3]
        loaded += fraction
        apart += fraction if off > (2.0 * SLIP_SPEED)**2 else 0.0
    if loaded > 0.0:
        # In flight nothing is known.
        doubt[run] = min(max(doubt[run] + (dt if apart > 0.5 * loaded else -2.0 * dt), 0.0), 1.0)
    scale = min(total, 0.9) / max(total, 1e-9)
    vx, vy, vz = velocity[0], velocity[1], velocity[2]
    for leg in range(rows.shape[0]):
        seen = leg_velocities[leg]
        pull = scale * seen[3]
        velocity[0] += pull * (seen[0] - vx)
        velocity[1] += pull * (seen[1] - vy)
        velocity[2] += pull * (seen[2] - vz)


@jit_entry
def _update_all(legs, sensors, dt, velocity, contact, doubt, leg_velocities, scratch):
    for run in range(velocity.shape[0]):
        update(legs, sensors, run, dt, velocity[run], contact[run], doubt, leg_velocities,
               scratch)


class BodyState:
    """State of the base and of its contacts.

    Attributes:
        velocity: of the base in its own frame, m/s, shape (runs, 3).
        contact: whether each foot is on the ground, shape (runs, legs).

    """

    def __init__(self, geometry: Geometry, runs: int = 1) -> None:
        self.geometry = geometry
        legs = len(geometry.hips)
        self.velocity = np.zeros((runs, 3))
        self.contact = np.zeros((runs, legs), dtype=bool)
        self._doubt = np.zeros(runs)
        self.scratch = np.zeros((legs, 4)), np.zeros((4, 3))

    def update(self, sensors: SensorData, dt: float) -> None:
        """Update the estimate with new measurements, dt in s after the last ones."""
        _update_all(self.geometry.arrays, sensors, dt, self.velocity, self.contact,
                    self._doubt, *self.scratch)


# Leg odometry: the base's pose, from the estimated velocity, and its covariance.

# All but NUM_STATES are standard deviations or intensities of noise.
#: Slow velocity error, measured on a simulated Go2 that trots, walks, turns and is pushed.
#: DRIFT_AT_REST: its size at rest, m/s; DRIFT_PER_SPEED: as a fraction of the speed; DRIFT_TIME:
#: correlation time, s.
DRIFT_AT_REST, DRIFT_PER_SPEED, DRIFT_TIME = 0.001, 0.015, 15.0
#: SCALE_ERROR: constant relative error of the velocity of a robot whose odometry was not
#: calibrated.
SCALE_ERROR = 0.05
#: White noise. POSITION_NOISE: of the position, m/sqrt(s); HEADING_NOISE: of the heading,
#: rad/sqrt(s), at which an IMU drifts by half a degree in a minute.
POSITION_NOISE, HEADING_NOISE = 0.001, 0.001
#: SLOPE_ERROR: slope of the ground, as a fraction of the distance covered.
SLOPE_ERROR = 0.05
#: HEIGHT_ERROR: height above level ground, m.
HEIGHT_ERROR = 0.01
#: VELOCITY_ERROR: velocity at an instant forward, to the left and up, m/s.
VELOCITY_ERROR = 0.02, 0.02, 0.03
#: TILT_ERROR: roll and pitch as an IMU measures them, rad; RATE_ERROR: their rates, rad/s.
TILT_ERROR, RATE_ERROR = 0.01, 0.02
#: UNMEASURED_VELOCITY: velocity that is not measured, m/s, in addition to the last measured speed.
UNMEASURED_VELOCITY = 0.5
#: NUM_STATES: number of states: x, y, heading, slow error forward and to the left, relative error.
NUM_STATES = 6


class Odometry(NamedTuple):
    """Pose of one robot's base relative to its first pose, and the covariance of that.

    The x axis of its frame is the base's heading at the start. Height is that above the feet which
    stand: going up a slope is not seen.

    Attributes:
        pose: x, y and z in m, heading in rad, those of the start, and the way so far in m.
        covariance: of x, y, heading, the slow velocity error forward and to the left, and the
            fraction by which velocities are wrong, in m, rad and m/s, shape (6, 6).
        twist: velocity and angular velocity in the base's frame, m/s and rad/s, shape (6,).
        orientation: in the odometry's frame, w x y z.
        pose_covariance: of x, y, z, roll, pitch and yaw, m and rad, shape (6, 6), as in ROS.
        tilt: roll and pitch, rad, shape (2,).
        scale: by which estimated velocities are multiplied (true by estimated distance), and its
            standard deviation, shape (2,).
        unseen: time without measurements, s, below 0 before the first ones, shape (1,).
        scratch: shape (2, 6, 6).

    """

    pose: np.ndarray
    covariance: np.ndarray
    twist: np.ndarray
    orientation: np.ndarray
    pose_covariance: np.ndarray
    tilt: np.ndarray
    scale: np.ndarray
    unseen: np.ndarray
    scratch: np.ndarray

    @classmethod
    def begin(cls, scale: float = 1.0, scale_error: float = SCALE_ERROR) -> 'Odometry':
        """Return one that begins where the base is; arguments as in ``scale``."""
        square = NUM_STATES, NUM_STATES
        return cls(np.zeros(6), np.zeros(square), np.zeros(6), np.zeros(4), np.zeros((6, 6)),
                   np.zeros(2), np.array([scale, scale_error]), np.full(1, -1.0),
                   np.zeros((2, *square)))

    def restart(self) -> None:
        """Start again where the base is now."""
        self.pose[:] = self.covariance[:] = 0.0
        self.twist[:] = self.pose_covariance[:] = 0.0
        self.unseen[0] = -1.0


_quaternion = jit(fill_quaternion)


@jit
def _report(odometry):
    """Fill the orientation and the covariance of the pose."""
    pose, covariance, out = odometry.pose, odometry.covariance, odometry.pose_covariance
    _quaternion(odometry.tilt[0], odometry.tilt[1], pose[3], odometry.orientation)
    for row in range(3):
        for column in range(3):
            # The heading is the last of the six.
            out[row + 3 * (row == 2), column + 3 * (column == 2)] = covariance[row, column]
    out[2, 2] = HEIGHT_ERROR**2 + (SLOPE_ERROR * pose[5])**2
    out[3, 3] = out[4, 4] = TILT_ERROR**2


@jit
def _multiply(left, right, out):
    """Fill a product of square matrices of NUM_STATES; BLAS takes the interpreter's lock."""
    for row in range(NUM_STATES):
        for column in range(NUM_STATES):
            total = 0.0
            for k in range(NUM_STATES):
                total += left[row, k] * right[k, column]
            out[row, column] = total


@jit_entry
def advance_odometry(odometry, legs, sensors, velocity, contact, dt):
    """Take a step of odometry, in place.

    Args:
        odometry: Odometry.
        legs: LegArrays of the robot.
        sensors: present SensorData of one run.
        velocity: of the base in its own frame, as estimated, m/s, shape (3,).
        contact: whether each foot is on the ground, shape (legs,).
        dt: s.

    """
    pose, covariance, rpy = odometry.pose, odometry.covariance, sensors.rpy[0]
    joints, scale, factor = sensors.joint_positions[0], odometry.scale[0], odometry.scratch[0]
    if odometry.unseen[0] < 0.0:
        pose[4] = rpy[2]
        covariance[3, 3] = covariance[4, 4] = DRIFT_AT_REST**2
        covariance[5, 5] = odometry.scale[1]**2
    odometry.unseen[0], odometry.tilt[0], odometry.tilt[1] = 0.0, rpy[0], rpy[1]
    for k in range(3):
        odometry.twist[k], odometry.twist[3 + k] = (scale * velocity[k],
                                                    sensors.angular_velocity[0, k])
    vx, vy, vz = odometry.twist[0], odometry.twist[1], odometry.twist[2]
    yaw = rpy[2] - pose[4]
    cr, sr, cp, sp = math.cos(rpy[0]), math.sin(rpy[0]), math.cos(rpy[1]), math.sin(rpy[1])
    cy, sy = math.cos(yaw), math.sin(yaw)
    forward = cp * vx + sp * (sr * vy + cr * vz)
    left = cr * vy - sr * vz
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
               pose[2] + dt * (cp * (sr * vy + cr * vz) - sp * vx))

    # P <- F P F' + Q, as F (F P)', for P is symmetric; F differs from one in the rows of x and y,
    # and in the slow errors.
    stays = math.exp(-dt / DRIFT_TIME)
    factor[:] = 0.0
    for k in range(NUM_STATES):
        factor[k, k] = stays if k in (3, 4) else 1.0
    factor[0, 2], factor[1, 2] = -dt * north, dt * east
    factor[0, 3], factor[0, 4] = dt * cy, -dt * sy
    factor[1, 3], factor[1, 4] = dt * sy, dt * cy
    factor[0, 5], factor[1, 5] = dt * east, dt * north
    _multiply(factor, covariance, odometry.scratch[1])
    _multiply(factor, odometry.scratch[1].T, covariance)
    slow = DRIFT_AT_REST**2 + DRIFT_PER_SPEED**2 * (forward**2 + left**2)
    moved = dt * POSITION_NOISE**2
    for k, added in enumerate((moved, moved, dt * HEADING_NOISE**2,
                               (1.0 - stays**2) * slow, (1.0 - stays**2) * slow)):
        covariance[k, k] += added
    pose[5] += dt * math.hypot(forward, left)
    _report(odometry)


@jit_entry
def lose_odometry(odometry, dt):
    """Take a step of dt in s without measurements.

    The base may have kept any constant velocity since the last one, of which
    UNMEASURED_VELOCITY and the last speed are standard deviations: the error grows with the time,
    its variance with the square of that.
    """
    before = odometry.unseen[0]
    if before < 0.0:
        return
    odometry.unseen[0] = before + dt
    added = ((UNMEASURED_VELOCITY**2 + odometry.twist[0]**2 + odometry.twist[1]**2)
             * (odometry.unseen[0]**2 - before**2))
    for k in range(2):
        odometry.covariance[k, k] += added
    _report(odometry)
