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

"""The crouch of a biped: a pose that servos hold without balance.

A stand on servos falls: the ankles would have to be stiffer than the weight topples. In the crouch
the ankles are at the ends of their ranges, so they cannot give way forward, and the centre of mass
is low and above the middle of the soles. Knees rest on the ends of their ranges, or, where thighs
would then point down, are bent less: servos of hips and knees then give way under the weight, and
their targets make up for it (at rest each bears half of the potential energy's derivative).
"""

from collections.abc import Sequence

from cpg_ros.feedback.biped.links import blank_pose, kinematics, Links
from cpg_ros.feedback.kinematics import GRAVITY
from cpg_ros.motion.robot import Robot
import numpy as np

#: MIN_COSINE: least cosine between the axis of a joint that pitches a leg and the lateral axis.
MIN_COSINE = 0.9
#: BISECTIONS: bisections of the range of the hips, which give 1e-6 rad.
BISECTIONS = 22
#: DIFFERENCE_STEP: of central differences, rad.
DIFFERENCE_STEP = 1e-5
#: KNEE_FRACTIONS: bends of the knees that are tried, as fractions of their range, the most bent
#: first.
KNEE_FRACTIONS = np.arange(1.0, 0.4, -0.05)


def crouch_pose(robot: Robot, links: Links, behind: float = 0.0
                ) -> tuple[np.ndarray, float] | None:
    """Return the target angles of the crouch and how much lower the centre of mass is, or None.

    Args:
        robot: whose legs each have three joints that pitch: hip, knee and ankle.
        links: of the robot.
        behind: how far the centre of mass is behind the middle of the soles, m.

    Returns:
        Targets of the joints of the legs, leg by leg, rad, shape (joints,), and by how much the
        centre of mass is lower than in the stand, m. None if a leg has other joints, or if the
        hips cannot bring the centre of mass above the soles with thighs at most level.

    """
    assert robot.biped is not None
    names, joints = list(robot.biped.links), {joint.name: joint for joint in robot.joints}
    angles = np.array([joints[name].offset if name in joints else robot.held[name]
                       for name in names])
    ahead_of_soles = _Ahead(links, behind)
    stand, legs = ahead_of_soles.height(angles), []
    for chain in links.chains:
        pitching = [row - 1 for row in chain if abs(links.axes[row, 1]) > MIN_COSINE]
        if len(pitching) != 3:
            return None
        legs.append(pitching)
    hips, knees, ankles = np.array(legs).T
    lower, upper = (np.array([getattr(joints[name], key) if name in joints else 0.0
                              for name in names]) for key in ('lower', 'upper'))
    bent, high = angles[knees] > 0.0, angles[hips].min()
    angles[ankles] = np.where(bent, lower[ankles], upper[ankles])
    for fraction in KNEE_FRACTIONS:
        angles[knees] = fraction * np.where(bent, upper[knees], lower[knees])
        if (_centre(ahead_of_soles, angles, hips, lower[hips].max(), high)
                and ahead_of_soles.thighs_rise(angles)):
            order = [names.index(joint.name) for joint in robot.joints]
            depth = stand - ahead_of_soles.height(angles)
            if fraction < 1.0:
                kp = np.array([robot.biped.links[name].kp for name in names])
                angles += ahead_of_soles.torques(angles, (hips, knees)) / kp
            return np.clip(angles, lower, upper)[order], depth
    return None


def _centre(ahead_of_soles: '_Ahead', angles: np.ndarray, hips: np.ndarray, low: float,
            high: float) -> bool:
    """Turn the hips so that the centre of mass is above the soles; return whether they can."""
    angles[hips] = low
    first = ahead_of_soles(angles)
    angles[hips] = high
    if first * ahead_of_soles(angles) > 0.0:
        return False
    for _ in range(BISECTIONS):
        angles[hips] = middle = 0.5 * (low + high)
        low, high = (middle, high) if first * ahead_of_soles(angles) > 0.0 else (low, middle)
    return True


class _Ahead:
    """Distance of the centre of mass ahead of where it is to be, soles level, m."""

    def __init__(self, links: Links, behind: float) -> None:
        self._links, self._pose, self._behind = links, blank_pose(links), behind
        self._chain = [row for row in links.chains[0] if abs(links.axes[row, 1]) > MIN_COSINE]
        self._center, self._soles = np.zeros(6), np.zeros((2, 6))
        self._still = np.zeros(3), np.zeros(len(links.masses) - 1)
        self._weights = np.zeros(len(links.masses) - 1)

    def __call__(self, angles: np.ndarray) -> float:
        self._place(angles)
        return float(self._center[0] - self._pose.soles[:, 0].mean()) + self._behind

    def height(self, angles: np.ndarray) -> float:
        """Return the height of the centre of mass above the soles, m."""
        self._place(angles)
        return float(self._center[2] - self._pose.soles[:, 2].mean())

    def thighs_rise(self, angles: np.ndarray) -> bool:
        """Return whether the hips are above the knees."""
        self._place(angles)
        hip, knee = self._chain[:2]
        return bool(self._pose.origins[hip, 2] > self._pose.origins[knee, 2])

    def torques(self, angles: np.ndarray, pairs: Sequence[np.ndarray]) -> np.ndarray:
        """Return the torques of pairs of joints at rest on level soles, N m, (angles,), else 0."""
        torques, weight = np.zeros_like(angles), GRAVITY * self._links.masses.sum()
        for pair in pairs:
            step = np.zeros_like(angles)
            step[pair] = DIFFERENCE_STEP
            torques[pair] = 0.5 * weight / (2.0 * DIFFERENCE_STEP) * (
                self.height(angles + step) - self.height(angles - step))
        return torques

    def _place(self, angles: np.ndarray) -> None:
        lean = -sum(self._links.axes[row, 1] * angles[row - 1] for row in self._chain)
        kinematics(self._links, np.array([0.0, lean, 0.0]), angles, self._still, self._pose,
                   self._center, self._soles, self._weights)
