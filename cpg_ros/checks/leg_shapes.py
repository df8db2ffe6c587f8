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

"""The part ``geometry`` of a first robot file, from the robot's description."""

from cpg_ros.robots.body_keys import body_geometry, BodyGeometry, LegChain, LEGS
from cpg_ros.robots.description import RobotDescription
from cpg_ros.robots.robot import Robot
import numpy as np


def geometry_from(robot: Robot, known: RobotDescription) -> BodyGeometry:
    """Return a robot's geometry, with those of its legs that feedback can displace."""
    chains = {}
    for leg, joints in robot.legs.items():
        names = sorted((joint.name for joint in joints), key=lambda one: len(known.chain(one)))
        foot, radius = known.foot_below(names[-1])
        places = np.array([known.frame(name)[0] for name in names])
        if np.linalg.norm(foot - places[-1]) <= 1e-3:
            continue
        axes = np.array([known.direction(name) for name in names])
        chains[leg] = LegChain(names, axes, places, foot, radius)
    return body_geometry(sum(link.mass for link in known.links.values()), chains)


def usable(robot: Robot, found: BodyGeometry, what: str) -> tuple[BodyGeometry | None, str]:
    """Return the geometry, None where it is of no use, and which legs feedback can displace.

    Args:
        robot: with all its legs.
        found: its geometry.
        what: format of the file that this is from.

    """
    if not found.legs or found.mass <= 0.0:
        return None, (f'feedback: the {what} gives no mass' if found.legs else
                      f'feedback: no leg is {LEGS}')
    others = [leg for leg in robot.legs if leg not in found.legs]
    return found, 'feedback can move all feet' if not others else (
        f'feedback moves no foot of {", ".join(others)}: a leg must be {LEGS}')
