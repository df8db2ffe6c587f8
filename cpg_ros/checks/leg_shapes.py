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

"""The part ``geometry`` of a first robot file, from a URDF."""

from collections.abc import Mapping

from cpg_ros.robots.body_keys import BodyGeometry, leg_of
from cpg_ros.robots.robot import Robot
from cpg_ros.robots.urdf import chain, direction, UrdfJoint
from cpg_ros.robots.urdf_links import foot_below, placed, UrdfLink
import numpy as np


def geometry_from(robot: Robot, urdf: Mapping[str, UrdfJoint], links: dict[str, UrdfLink]
                  ) -> tuple[BodyGeometry | None, str]:
    """Work out a robot's geometry, and say which legs feedback cannot displace.

    None where the URDF gives no mass, or none of the legs will do.
    """
    known, legs, radii, others = dict(urdf), {}, [], []
    for leg, joints in robot.legs.items():
        names = sorted((joint.name for joint in joints), key=lambda one: len(chain(known, one)))
        foot, radius = foot_below(known, links, names[-1])
        found = None
        if np.linalg.norm(foot - placed(known, names[-1])[0]) > 1e-3:
            found = leg_of(names, np.array([direction(known, name) for name in names]),
                           np.array([placed(known, name)[0] for name in names]), foot)
        if found is None:
            others.append(leg)
        else:
            legs[leg] = found
            radii.append(radius)
    mass = sum(link.mass for link in links.values())
    if not legs or mass <= 0.0:
        return None, ('feedback: the URDF gives no mass' if legs else
                      'feedback: no leg is a hip about x, if any, then two joints about y')
    said = 'feedback can move all feet'
    if others:
        said = (f'feedback moves no foot of {", ".join(others)}: a leg must be a hip about x, if '
                'any, then two joints about y')
    return BodyGeometry(round(mass, 6), round(float(np.mean(radii)), 6), legs), said
