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

"""A stick figure for a robot of which only legs and joints are known."""

from collections.abc import Mapping, Sequence

from cpg_ros.panel.body_shape import along, box, Link, Shape, sphere
import numpy as np

#: From hip to hip along and across, half of them, and the length of a leg, m.
LONG, WIDE, LEG = 0.24, 0.11, 0.42
BODY, STICK, FOOT = (0.22, 0.33, 0.45), (0.75, 0.78, 0.82), (0.20, 0.20, 0.20)


def draw(name: str, legs: Mapping[str, Sequence[str]], places: Mapping[str, tuple[float, float]],
         limits: Mapping[str, tuple[float, float]] | None = None) -> Shape:
    """Return the shape.

    Args:
        name: of the robot, for people.
        legs: leg -> its joints, from the body down. Of three the first turns about the axis that
            points ahead, all others turn about that to the left.
        places: leg -> 1 or -1 for ahead or behind (0 in between), and for left or right.
        limits: joint -> lower and upper, rad.

    """
    base = Link('base', -1)
    ends = [np.array([LONG * ahead, WIDE * left, 0.0]) for ahead, left in places.values()]
    long = max((abs(end[0]) for end in ends), default=0.0)
    base.add(box(np.array([long + 0.06, 0.7 * WIDE, 0.05])), BODY)
    base.add(box(np.array([0.02, 0.04, 0.02])), STICK, np.array([long + 0.08, 0.0, 0.02]))
    shape = Shape(f"stick figure of '{name}'", [base], dict(limits or {}))
    for (leg, joints), end in zip(legs.items(), ends, strict=True):
        base.add(along(np.array([end[0], 0.0, 0.0]), end, 0.025), BODY)
        parent, place = 0, end
        down = [k for k in range(len(joints)) if not (len(joints) >= 3 and k == 0)]
        length = LEG / max(len(down), 1)
        for k, joint in enumerate(joints):
            link = Link(joint, parent, joint, place=place,
                        axis=np.eye(3)[1 if k in down else 0])
            if k in down:
                tip = np.array([0.0, 0.0, -length])
                link.add(along(np.zeros(3), tip, 0.018), STICK)
                link.add(sphere(0.028), BODY)
            else:
                tip = np.array([0.0, 0.3 * np.sign(end[1]) * WIDE, 0.0])
                link.add(along(np.zeros(3), tip, 0.025), BODY)
            shape.links.append(link)
            parent, place = len(shape.links) - 1, tip
        shape.links[parent].add(sphere(0.026), FOOT, place)
        shape.feet[leg] = parent, place
    return shape
