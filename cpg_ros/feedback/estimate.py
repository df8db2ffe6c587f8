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

"""What a robot feels, and what it makes of it: contact, lean, and its velocity over ground."""

from dataclasses import dataclass
import math

from cpg_ros.feedback.kinematics import foot_of, Geometry, GRAVITY, slopes_of
from cpg_ros.integration.jit import entry, jit
import numpy as np

#: A foot counts as on the ground above this share of the weight, until below the other.
TOUCH, LEAVE = 0.10, 0.04
#: Stance legs pull the velocity to theirs with this time constant, s, when they bear the weight.
PULL = 0.02
#: Legs whose velocity is this far from the one expected, m/s, count half: they slip.
SLIP = 0.25


@dataclass
class Senses:
    """What a robot feels at an instant, of each run.

    Attributes:
        angles, rates: of the joints leg by leg, rad and rad/s, shape (runs, joints).
        loads: of the feet, N, shape (runs, legs).
        lean: roll, pitch and yaw, rad, shape (runs, 3).
        turning: of the base in its own frame, rad/s, shape (runs, 3).
        push: what an accelerometer shows, its own frame, m/s^2, shape (runs, 3).

    """

    angles: np.ndarray
    rates: np.ndarray
    loads: np.ndarray
    lean: np.ndarray
    turning: np.ndarray
    push: np.ndarray

    @classmethod
    def blank(cls, runs: int, legs: int, joints: int) -> 'Senses':
        """Nothing felt yet, to be filled in place."""
        return cls(*(np.zeros((runs, size)) for size in (joints, joints, legs, 3, 3, 3)))


def rpy_of(quaternions: np.ndarray) -> np.ndarray:
    """Return roll, pitch and yaw of orientations (w x y z), rad, shape (..., 3)."""
    w, x, y, z = np.moveaxis(quaternions, -1, 0)
    return np.stack([np.arctan2(2.0 * (w * x + y * z), 1.0 - 2.0 * (x * x + y * y)),
                     np.arcsin(np.clip(2.0 * (w * y - z * x), -1.0, 1.0)),
                     np.arctan2(2.0 * (w * z + x * y), 1.0 - 2.0 * (y * y + z * z))], axis=-1)


def upward(lean: np.ndarray) -> np.ndarray:
    """Return the vertical in the base's frame, shape (..., 3)."""
    roll, pitch = lean[..., 0], lean[..., 1]
    return np.stack([-np.sin(pitch), np.sin(roll) * np.cos(pitch),
                     np.cos(roll) * np.cos(pitch)], axis=-1)


@jit
def seen_by(leg, joints, rates, slopes, turning, up, radius, out):
    """Fill the base's velocity as one leg has it whose foot rolls on the ground, m/s.

    Args:
        leg: a row of the geometry.
        joints: hip, thigh and calf, rad.
        rates: of these, rad/s.
        slopes: scratch, shape (3, 3).
        turning: of the base, rad/s, shape (3,).
        up: the vertical in the base's frame.
        radius: of the foot, m.
        out: shape (3,).

    """
    x, y, z = foot_of(leg, joints[0], joints[1], joints[2])
    slopes_of(leg, joints[0], joints[1], joints[2], slopes)
    hip, pitching = leg[0] * joints[0], leg[1] * rates[1] + leg[2] * rates[2]
    # Angular velocity of the shank.
    a = turning[0] + leg[0] * rates[0]
    b = turning[1] + pitching * math.cos(hip)
    c = turning[2] + pitching * math.sin(hip)
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
def update(rows, columns, radius, weight, angles, rates, loads, lean, turning, push, dt,
           velocity, contact, seen, scratch):
    """Take note of what one run feels: velocity (3,) and contact (legs,) are changed in place.

    Scratch are seen, shape (legs, 4), and scratch, shape (5, 3).
    """
    legs = rows.shape[0]
    up, slopes, now = scratch[4], scratch[:3], scratch[3]
    up[0], up[1] = -math.sin(lean[1]), math.sin(lean[0]) * math.cos(lean[1])
    up[2] = math.cos(lean[0]) * math.cos(lean[1])
    vx, vy, vz = velocity[0], velocity[1], velocity[2]
    velocity[0] += dt * (push[0] - GRAVITY * up[0] - (turning[1] * vz - turning[2] * vy))
    velocity[1] += dt * (push[1] - GRAVITY * up[1] - (turning[2] * vx - turning[0] * vz))
    velocity[2] += dt * (push[2] - GRAVITY * up[2] - (turning[0] * vy - turning[1] * vx))
    total = 0.0
    for leg in range(legs):
        share = max(loads[leg], 0.0) / weight
        contact[leg] = share > (LEAVE if contact[leg] else TOUCH)
        seen[leg, 3] = 0.0
        if not contact[leg] or rows[leg, 1] == 0.0:
            continue
        one, two, three = columns[leg, 0], columns[leg, 1], columns[leg, 2]
        now[0], now[1], now[2] = angles[one], angles[two], angles[three]
        seen_by(rows[leg], now, (rates[one], rates[two], rates[three]), slopes, turning, up,
                radius, seen[leg])
        off = 0.0
        for k in range(3):
            off += (seen[leg, k] - velocity[k])**2
        # Even where all legs slip, they are believed a little: integrated pushes drift.
        seen[leg, 3] = min(dt / PULL * share / (1.0 + off / SLIP**2), 0.5)
        total += seen[leg, 3]
    scale = min(total, 0.9) / max(total, 1e-9)
    vx, vy, vz = velocity[0], velocity[1], velocity[2]
    for leg in range(legs):
        pull = scale * seen[leg, 3]
        velocity[0] += pull * (seen[leg, 0] - vx)
        velocity[1] += pull * (seen[leg, 1] - vy)
        velocity[2] += pull * (seen[leg, 2] - vz)


@entry
def _update_all(rows, columns, radius, weight, angles, rates, loads, lean, turning, push, dt,
                velocity, contact, seen, scratch):
    for run in range(angles.shape[0]):
        update(rows, columns, radius, weight, angles[run], rates[run], loads[run], lean[run],
               turning[run], push[run], dt, velocity[run], contact[run], seen, scratch)


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
        self.scratch = np.zeros((legs, 4)), np.zeros((5, 3))

    def update(self, senses: Senses, dt: float) -> None:
        """Take note of what is felt, dt in s after the last time."""
        geometry = self.geometry
        _update_all(geometry.rows, geometry.columns, geometry.radius, geometry.weight,
                    senses.angles, senses.rates, senses.loads, senses.lean, senses.turning,
                    senses.push, dt, self.velocity, self.contact, *self.scratch)
