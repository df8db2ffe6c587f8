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

"""Links of a URDF file: their masses, and the spheres that feet are."""

from dataclasses import dataclass
import math
from pathlib import Path
from xml.etree.ElementTree import Element

from cpg_ros.robots.urdf import bare, chain, read_tree, rotation, UrdfJoint
import numpy as np


@dataclass
class UrdfLink:
    """A link.

    Attributes:
        mass: kg, 0 where the file gives none.
        radius: of its first sphere that collides, m, 0 if it has none.
        centre: of that sphere in the link's frame, m.

    """

    mass: float = 0.0
    radius: float = 0.0
    centre: tuple[float, ...] = (0.0, 0.0, 0.0)


def _link(element: Element) -> UrdfLink:
    """Return a link; what is no number counts as not there."""
    link = UrdfLink()
    for mass in element.iterfind('inertial/mass'):
        link.mass = sum(_numbers(mass.get('value', '')))
    for collision in element.iterfind('collision'):
        origin, sphere = collision.find('origin'), collision.find('geometry/sphere')
        if sphere is not None and not link.radius:
            link.radius = sum(_numbers(sphere.get('radius', '')))
            centre = () if origin is None else _numbers(origin.get('xyz', ''))
            link.centre = centre if len(centre) == 3 else link.centre
    return link


def _numbers(text: str) -> tuple[float, ...]:
    try:
        values = tuple(float(word) for word in text.split())
    except ValueError:
        return ()
    return values if all(map(math.isfinite, values)) else ()


def load_links(path: str | Path) -> dict[str, UrdfLink]:
    """Read the links of a URDF file that ``load_urdf`` has read, by name.

    Raises:
        UrdfError: the file cannot be read.

    """
    links: dict[str, UrdfLink] = {}
    for element in read_tree(path):
        if bare(element.tag) == 'link':
            links[element.get('name', '').strip()] = _link(element)
    return links


def placed(joints: dict[str, UrdfJoint], name: str) -> tuple[np.ndarray, np.ndarray]:
    """Return where a joint is in the frame of the root, m, (3,), and its frame's axes, (3, 3).

    All joints are at 0.
    """
    place, axes = np.zeros(3), np.eye(3)
    for joint in chain(joints, name):
        place = place + axes @ joint.xyz
        axes = axes @ rotation(joint.rpy)
    return place, axes


def foot_below(joints: dict[str, UrdfJoint], links: dict[str, UrdfLink], last: str
               ) -> tuple[np.ndarray, float]:
    """Return the middle of the foot below a leg's last joint, m, (3,), and its radius, m.

    It is the furthest sphere of what that joint moves, or else the furthest fixed frame, which
    has no radius.
    """
    begin, axes = placed(joints, last)
    found = [(begin, axes, joints[last].child)]
    for place, turned, link in found:
        found += [(place + turned @ joint.xyz, turned @ rotation(joint.rpy), joint.child)
                  for joint in joints.values() if joint.parent == link and joint.kind == 'fixed']
    balls = [(place + turned @ links[link].centre, links[link].radius)
             for place, turned, link in found if link in links and links[link].radius]
    return max(balls or [(place, 0.0) for place, _, _ in found],
               key=lambda one: float(np.linalg.norm(one[0] - begin)))
