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

"""Rotations: matrices, quaternions, and roll, pitch and yaw about the fixed x, then y, then z."""

import math

import numpy as np


def fill_rotation(roll: float, pitch: float, yaw: float, out: np.ndarray) -> None:
    """Fill the matrix from the rotated axes to the fixed ones, shape (3, 3); angles in rad."""
    cr, sr, cp, sp = math.cos(roll), math.sin(roll), math.cos(pitch), math.sin(pitch)
    cy, sy = math.cos(yaw), math.sin(yaw)
    out[0, 0], out[0, 1], out[0, 2] = cy * cp, cy * sp * sr - sy * cr, cy * sp * cr + sy * sr
    out[1, 0], out[1, 1], out[1, 2] = sy * cp, sy * sp * sr + cy * cr, sy * sp * cr - cy * sr
    out[2, 0], out[2, 1], out[2, 2] = -sp, cp * sr, cp * cr


def rotation(rpy: tuple[float, ...]) -> np.ndarray:
    """Return the matrix of roll, pitch and yaw in rad, shape (3, 3)."""
    (roll, pitch, yaw), out = rpy, np.empty((3, 3))
    fill_rotation(roll, pitch, yaw, out)
    return out


def rotation_about(axis: np.ndarray, angle: float) -> np.ndarray:
    """Return the matrix that turns about a unit axis by an angle, rad, shape (3, 3)."""
    (x, y, z), c, s = axis, math.cos(angle), math.sin(angle)
    cross = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    return c * np.eye(3) + s * cross + (1.0 - c) * np.outer(axis, axis)


def fill_quaternion(roll: float, pitch: float, yaw: float, out: np.ndarray) -> None:
    """Fill an orientation, w x y z, from its angles, rad."""
    roll, pitch, yaw = 0.5 * roll, 0.5 * pitch, 0.5 * yaw
    cr, sr, cp, sp = math.cos(roll), math.sin(roll), math.cos(pitch), math.sin(pitch)
    cy, sy = math.cos(yaw), math.sin(yaw)
    out[0], out[1] = cr * cp * cy + sr * sp * sy, sr * cp * cy - cr * sp * sy
    out[2], out[3] = cr * sp * cy + sr * cp * sy, cr * cp * sy - sr * sp * cy


def matrix_of(quaternion: np.ndarray) -> np.ndarray:
    """Return the matrix of an orientation (w x y z, of length 1), shape (3, 3)."""
    w, x, y, z = quaternion
    return np.array([[1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y - w * z), 2.0 * (x * z + w * y)],
                     [2.0 * (x * y + w * z), 1.0 - 2.0 * (x * x + z * z), 2.0 * (y * z - w * x)],
                     [2.0 * (x * z - w * y), 2.0 * (y * z + w * x), 1.0 - 2.0 * (x * x + y * y)]])


def rpy_of(quaternions: np.ndarray) -> np.ndarray:
    """Return roll, pitch and yaw of orientations (w x y z), rad, shape (..., 3)."""
    w, x, y, z = np.moveaxis(quaternions, -1, 0)
    return np.stack([np.arctan2(2.0 * (w * x + y * z), 1.0 - 2.0 * (x * x + y * y)),
                     np.arcsin(np.clip(2.0 * (w * y - z * x), -1.0, 1.0)),
                     np.arctan2(2.0 * (w * z + x * y), 1.0 - 2.0 * (y * y + z * z))], axis=-1)
