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

"""What a biped's feedback keeps from tick to tick, and what it puts out."""

from typing import NamedTuple

from cpg_ros.feedback.biped.links import blank_pose, Links, Pose
import numpy as np

#: Modes: standing on both legs, shifting the weight to the second foot, following the clock.
STAND, SHIFT, WALK = 0, 1, 2


class BipedMemory(NamedTuple):
    """Arrays that a tick changes; the world's axes, places from the base unless said otherwise.

    Attributes:
        pose: of the links.
        base: velocity of the base, m/s, shape (3,).
        center: of mass, m, then its velocity, m/s, shape (2, 3).
        turning: angular velocity of the base, rad/s, shape (3,).
        soles: velocities of the soles from the base's, m/s and rad/s, shape (2, 6).
        loads: share of the weight on each foot, shape (2,).
        wanted: velocity forward and left as it is approached, m/s, shape (2,).
        heading: wanted, rad, shape (1,).
        integral: of the missing speed, m, shape (1,).
        phases: of the legs from their lift-off on, cycles, shape (2,).
        swinging: whether each leg swings, shape (2,).
        landed: whether it has landed early, shape (2,).
        lift_off: where each swing began, from the other sole, or, in gaits with flight, from the
            base, m, shape (2, 3).
        target: where it is to end, likewise.
        ground: height of the ground, m, shape (1,).
        shares: of the weight that each leg is to bear, shape (2,).
        error: of the capture point, forward and left, m, shape (2,).
        reaction: moment that the swing leg takes, N m, shape (3,).
        path: of a swinging foot, scratch, shape (3, 3).
        clock: factor of the clock, and by how much it is to leap, cycles, shape (2,).
        crouch: how much lower than usual the centre of mass is to be, m, shape (1,).
        torque: of the legs' joints, N m, shape (2, joints of a leg).

    """

    pose: Pose
    base: np.ndarray
    center: np.ndarray
    turning: np.ndarray
    soles: np.ndarray
    loads: np.ndarray
    wanted: np.ndarray
    heading: np.ndarray
    integral: np.ndarray
    phases: np.ndarray
    swinging: np.ndarray
    landed: np.ndarray
    lift_off: np.ndarray
    target: np.ndarray
    ground: np.ndarray
    shares: np.ndarray
    error: np.ndarray
    reaction: np.ndarray
    path: np.ndarray
    clock: np.ndarray
    crouch: np.ndarray
    torque: np.ndarray

    @classmethod
    def empty(cls, links: Links) -> 'BipedMemory':
        """Return the memory of a biped that has not moved yet."""
        return cls(blank_pose(links), np.zeros(3), np.zeros((2, 3)), np.zeros(3),
                   np.zeros((2, 6)), np.zeros(2), np.zeros(2), np.zeros(1), np.zeros(1),
                   np.zeros(2), np.zeros(2, dtype=bool), np.zeros(2, dtype=bool),
                   np.zeros((2, 3)), np.zeros((2, 3)), np.zeros(1), np.full(2, 0.5), np.zeros(2),
                   np.zeros(3), np.zeros((3, 3)), np.array([1.0, 0.0]),
                   np.zeros(1),
                   np.zeros((2, links.chains.shape[1])))
