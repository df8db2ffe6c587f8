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

"""Sensor data, and the state estimated from it: contacts and velocity over ground."""

import math
from typing import NamedTuple

from cpg_ros.feedback.kinematics import (
    foot_of,
    from_leg,
    Geometry,
    GRAVITY,
    slopes_of,
    vertical,
)
from cpg_ros.integration.jit import entry, jit
import numpy as np

#: A foot counts as on the ground above this share of the weight, until below the other.
TOUCH, LEAVE = 0.10, 0.04
#: Stance legs pull the velocity to theirs with this time constant, s, when they bear the weight.
PULL = 0.02
#: Legs whose velocity is this far from the one expected, m/s, count half: they slip.
SLIP = 0.25
#: Where the legs on the ground have disagreed for longer than this, s, the estimate is wrong, not
#: the legs: from then on SLIP grows by its own size in each time of the second, s.
DISAGREE, WIDENS = 0.2, 0.05


class SensorData(NamedTuple):
    """What a robot measures at an instant, of each run.

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


def fill_quaternion(roll: float, pitch: float, yaw: float, out: np.ndarray) -> None:
    """Fill an orientation, w x y z, from its angles, rad."""
    roll, pitch, yaw = 0.5 * roll, 0.5 * pitch, 0.5 * yaw
    cr, sr, cp, sp = math.cos(roll), math.sin(roll), math.cos(pitch), math.sin(pitch)
    cy, sy = math.cos(yaw), math.sin(yaw)
    out[0], out[1] = cr * cp * cy + sr * sp * sy, sr * cp * cy - cr * sp * sy
    out[2], out[3] = cr * sp * cy + sr * cp * sy, cr * cp * sy - sr * sp * cy


def rpy_of(quaternions: np.ndarray) -> np.ndarray:
    """Return roll, pitch and yaw of orientations (w x y z), rad, shape (..., 3)."""
    w, x, y, z = np.moveaxis(quaternions, -1, 0)
    return np.stack([np.arctan2(2.0 * (w * x + y * z), 1.0 - 2.0 * (x * x + y * y)),
                     np.arcsin(np.clip(2.0 * (w * y - z * x), -1.0, 1.0)),
                     np.arctan2(2.0 * (w * z + x * y), 1.0 - 2.0 * (y * y + z * z))], axis=-1)


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

    Of doubt, shape (runs,), that of the run is how long the legs have disagreed, s. Scratch are
    leg_velocities, shape (legs, 4), each leg's estimate and its weight, and scratch, shape (4, 3).
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
    slip = SLIP * (1.0 + max(doubt[run] - DISAGREE, 0.0) / WIDENS)
    for leg in range(rows.shape[0]):
        share, seen = max(forces[leg], 0.0) / legs.weight, leg_velocities[leg]
        contact[leg] = share > (LEAVE if contact[leg] else TOUCH)
        seen[3] = 0.0
        if not contact[leg] or rows[leg, 1] == 0.0:
            continue
        one, two, three = columns[leg, 0], columns[leg, 1], columns[leg, 2]
        now[0], now[1], now[2] = angles[one], angles[two], angles[three]
        velocity_by_leg(rows[leg], now, (rates[one], rates[two], rates[three]), slopes, turning,
                        up, legs.radius, seen)
        off = 0.0
        for k in range(3):
            off += (seen[k] - velocity[k])**2
        # Even where all legs slip, they count a little: integrated accelerations drift.
        seen[3] = min(dt / PULL * share / (1.0 + off / slip**2), 0.5)
        total += seen[3]
        loaded, apart = loaded + share, apart + (share if off > (2.0 * SLIP)**2 else 0.0)
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


@entry
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
        """Update the estimate with what is measured, dt in s after the last time."""
        _update_all(self.geometry.arrays, sensors, dt, self.velocity, self.contact,
                    self._doubt, *self.scratch)
