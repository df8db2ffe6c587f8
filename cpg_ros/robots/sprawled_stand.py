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

"""Legs that reach to the side, as those of insects: which they are, and how they stand at first.

The first of a leg's last three joints, the coxa, turns it about an upright axis; the other two,
femur and tibia, about level axes that are parallel and do not lie across the body: those swing a
leg forward by themselves.
"""

import math

import numpy as np

#: Part of the femur's axis across the body from which on it swings the leg forward.
ACROSS = 0.9
#: How far the femur is raised above level in a first stand, and the tibia lowered below it, rad.
RAISED, LOWERED = 0.4, 1.3


def sprawls(axes: np.ndarray) -> bool:
    """Tell whether a leg is of this kind.

    Args:
        axes: of its joints down the leg with all of them at 0, unit vectors, shape (joints, 3).

    """
    if len(axes) < 3:
        return False
    coxa, femur, tibia = axes[-3:]
    return bool(abs(coxa[2]) > 0.99 and max(abs(femur[2]), abs(tibia[2])) < 0.01
                and abs(femur @ tibia) > 0.99 and abs(femur[1]) < ACROSS)


def outward(axis: np.ndarray, reach: np.ndarray) -> np.ndarray:
    """Return the level direction in which a leg reaches, in the plane that its femur moves.

    Args:
        axis: of the femur, shape (3,).
        reach: from coxa to foot, m; its first two numbers count.

    """
    out = np.array([-axis[1], axis[0]]) / math.hypot(axis[0], axis[1])
    return out if out @ reach[:2] >= 0.0 else -out


def first_stand(places: np.ndarray, axes: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return a stand with the foot out to the side and below, and what the joints do there.

    Args:
        places: of coxa, femur, tibia and foot with all joints at 0, m, shape (4, 3).
        axes: of the joints, unit vectors, shape (3, 3).

    Returns:
        Angles of coxa, femur and tibia, rad, the coxa's 0; then 1 or -1 by whether positive
        angles of the coxa take the foot forward, and of femur and tibia upward.

    """
    out = outward(axes[1], places[3] - places[0])
    # As complex numbers out + i up; turns of femur and tibia by what they do to out.
    upper, lower = np.diff(places[1:, :2] @ out + 1j * places[1:, 2])
    turns = np.sign(np.cross(axes[1:], [*out, 0.0])[:, 2])
    femur = RAISED - np.angle(upper)
    tibia = -LOWERED - np.angle(lower) - femur
    angles = (np.array([0.0, turns[0] * femur, turns[1] * tibia]) + math.pi) % (2.0 * math.pi)
    forward = -math.copysign(1.0, axes[0, 2] * out[1])
    return angles - math.pi, np.array([forward, *turns])
