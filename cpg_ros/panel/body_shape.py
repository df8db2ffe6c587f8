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

"""What a robot looks like: links that turn about joints, each with its own triangles."""

import base64
from dataclasses import dataclass, field
import math
from typing import Any

from cpg_ros.robots.mesh_files import merged, Mesh
import numpy as np

#: Number of corners of a circle.
ROUND = 16
#: Colour of triangles without one.
GREY = (0.62, 0.65, 0.70)
#: Vertices closer than this are merged, m: a page draws a robot, not its screws.
GRAIN = 0.008


@dataclass
class Link:
    """A rigid part, and its joint to its parent.

    Attributes:
        name: of it.
        parent: index of the parent, -1 for the base.
        joint: name of the joint between them, '' for a fixed one.
        slides: whether the joint is prismatic, m, not revolute, rad.
        axis: of the joint, in the link's own frame.
        place, pose: of the link in its parent at angle 0: m, and a rotation matrix.
        zero: angle of the joint at which the link is where ``pose`` has it, rad.
        vertices, colours: its triangles, shape (n, 3, 3), m, and their colours, (n, 3), 0 to 1.

    """

    name: str
    parent: int
    joint: str = ''
    slides: bool = False
    axis: np.ndarray = field(default_factory=lambda: np.array([0.0, 1.0, 0.0]))
    place: np.ndarray = field(default_factory=lambda: np.zeros(3))
    pose: np.ndarray = field(default_factory=lambda: np.eye(3))
    zero: float = 0.0
    vertices: list[np.ndarray] = field(default_factory=list)
    colours: list[np.ndarray] = field(default_factory=list)

    def add(self, triangles: np.ndarray, colour: tuple[float, ...] = GREY,
            place: np.ndarray | None = None, pose: np.ndarray | None = None) -> None:
        """Add triangles, shape (n, 3, 3), m, in a frame within the link, in a colour."""
        turned = triangles if pose is None else triangles @ pose.T
        self.vertices.append(turned if place is None else turned + place)
        self.colours.append(np.broadcast_to(np.asarray(colour[:3]), (len(triangles), 3)))


@dataclass
class Shape:
    """A robot.

    Attributes:
        source: of the shape, for people.
        links: a parent before its children, the base first.
        limits: joint -> lower and upper, rad, infinite where there is none.
        feet: leg -> index of the link that stands on the floor, and where on it, m.

    """

    source: str
    links: list[Link]
    limits: dict[str, tuple[float, float]] = field(default_factory=dict)
    feet: dict[str, tuple[int, np.ndarray]] = field(default_factory=dict)

    def message(self) -> dict[str, Any]:
        """Return the message for a page: base64 of float32 triangles and uint8 colours."""
        links = []
        for link in self.links:
            corners = (np.concatenate(link.vertices) if link.vertices else np.zeros((0, 3, 3)))
            colours = (np.concatenate(link.colours) if link.colours else np.zeros((0, 3)))
            links.append({
                'name': link.name, 'parent': link.parent, 'joint': link.joint,
                'slides': link.slides, 'zero': link.zero,
                'axis': np.round(link.axis, 6).tolist(),
                'place': np.round(link.place, 6).tolist(),
                'pose': np.round(link.pose.ravel(), 6).tolist(),
                'vertices': _base64(corners.reshape(-1, 3).astype('<f4')),
                'colours': _base64((255 * np.clip(np.repeat(colours, 3, 0), 0, 1)).astype('u1'))})
        limits = {joint: [value if math.isfinite(value) else None for value in span]
                  for joint, span in self.limits.items()}
        return {'type': 'shape', 'source': self.source, 'links': links, 'limits': limits,
                'feet': {leg: [index, *np.round(place, 5).tolist()]
                         for leg, (index, place) in self.feet.items()}}


def _base64(values: np.ndarray) -> str:
    return base64.b64encode(values.tobytes()).decode('ascii')


def coarse(triangles: np.ndarray, grain: float = GRAIN) -> np.ndarray:
    """Return the triangles that remain when vertices closer than ``grain``, m, are merged."""
    left = merged(Mesh(triangles.reshape(-1, 3), np.arange(3 * len(triangles)).reshape(-1, 3)),
                  grain)
    # Two that came to lie on one another are one, whichever way round.
    _, kept = np.unique(np.sort(left.triangles, axis=1), axis=0, return_index=True)
    return left.points[left.triangles[np.sort(kept)]]


def box(half: np.ndarray) -> np.ndarray:
    """Return the triangles of a box of three half lengths, shape (12, 3, 3)."""
    faces = []
    for axis in range(3):
        for side in (-1.0, 1.0):
            one, other = np.eye(3)[(axis + 1) % 3], np.eye(3)[(axis + 2) % 3]
            middle = side * np.eye(3)[axis]
            a, b, c, d = (middle + s * one + t * other
                          for s, t in ((-1, -1), (1, -1), (1, 1), (-1, 1)))
            faces += [(a, b, c), (a, c, d)]
    return np.array(faces) * np.asarray(half)


def turned(profile: np.ndarray) -> np.ndarray:
    """Return the triangles of a profile of radius and height, (n, 2), turned about z."""
    angles = np.linspace(0.0, 2.0 * math.pi, ROUND + 1)
    ring = np.stack([profile[:, :1] * np.cos(angles), profile[:, :1] * np.sin(angles),
                     np.broadcast_to(profile[:, 1:], (len(profile), ROUND + 1))], -1)
    a, b, c, d = ring[:-1, :-1], ring[:-1, 1:], ring[1:, 1:], ring[1:, :-1]
    found = np.concatenate([np.stack([a, b, c], -2).reshape(-1, 3, 3),
                            np.stack([a, c, d], -2).reshape(-1, 3, 3)])
    area = np.linalg.norm(np.cross(found[:, 1] - found[:, 0], found[:, 2] - found[:, 0]), axis=1)
    return found[area > 1e-12]


def cylinder(radius: float, half: float) -> np.ndarray:
    """Return the triangles of a cylinder along z of a radius and half a length, m."""
    return turned(np.array([[0.0, -half], [radius, -half], [radius, half], [0.0, half]]))


def capsule(radius: float, half: float) -> np.ndarray:
    """Return the triangles of a cylinder along z with a half sphere at each end, m."""
    bend = np.linspace(0.0, 0.5 * math.pi, ROUND // 4 + 1)
    low = np.stack([radius * np.sin(bend), -half - radius * np.cos(bend)], -1)
    return turned(np.concatenate([low, low[::-1] * (1.0, -1.0)]))


def sphere(radius: float) -> np.ndarray:
    """Return the triangles of a sphere, m."""
    return capsule(radius, 0.0)


def along(start: np.ndarray, end: np.ndarray, radius: float) -> np.ndarray:
    """Return the triangles of a capsule between two points, m."""
    way = np.asarray(end, float) - start
    length = float(np.linalg.norm(way))
    made = capsule(radius, 0.5 * length)
    if length > 0.0:
        z = way / length
        x = np.cross([0.0, 1.0, 0.0] if abs(z[1]) < 0.9 else [1.0, 0.0, 0.0], z)
        x /= np.linalg.norm(x)
        made = made @ np.array([x, np.cross(z, x), z])
    return made + 0.5 * (np.asarray(start) + end)
