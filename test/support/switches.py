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

"""A generator that is taken from every gait to every other, and what must hold on the way."""

from itertools import pairwise

from depth import in_full
from graph import off_grid
import numpy as np


def tour(names):
    """Visit every ordered pair of names once, one after the other."""
    edges = {name: [other for other in names if other != name] for name in names}
    path, stack = [], [names[0]]
    while stack:
        if edges[stack[-1]]:
            stack.append(edges[stack[-1]].pop())
        else:
            path.append(stack.pop())
    return path[::-1]


def off(measured, expected):
    """Distance of leg phases from a gait's, in cycles."""
    return np.abs((measured - measured[:, :1] - expected + 0.5) % 1.0 - 0.5).max()


def by_leg(watcher, robot, table):
    """Reorder recorded joints from the declared order to that of the robot's legs."""
    return table[:, [watcher.names.index(joint.name) for joint in robot.joints]]


def check_switches(watcher, robot, plans, phases, lasting, slack=1e-5):
    """Switch between ordered pairs of gaits and hold every message against their orbits.

    Between all of them in depth, and between a third of them before a commit.

    Args:
        watcher: of a generator at 200 Hz.
        robot: that it moves.
        plans: gait -> its program at the generator's settings.
        phases: gait -> those of the legs, where its symmetry says them.
        lasting: seconds that a switch takes at most, and a little more.
        slack: that joints may leave the gaits' spans by, rad.

    """
    offset, way = robot.column('offset'), tour(list(plans))
    assert len(set(pairwise(way))) == len(way) - 1 == len(plans) * (len(plans) - 1)
    way = way if in_full() else way[:len(way) // 3 + 1]
    assert watcher.set(gait=way[0])[0].successful
    watcher.record(lasting)
    for old, new in pairwise(way):
        first = len(watcher.samples)
        assert watcher.set(gait=new)[0].successful
        watcher.record(lasting)
        times, positions, _ = (np.array(part) for part in
                               zip(*watcher.samples[first:], strict=True))
        positions = by_leg(watcher, robot, positions)
        assert off_grid(times, 0.005) < 1e-3
        speed = np.maximum(plans[old].speed, plans[new].speed)
        steps = np.abs(np.diff(positions, axis=0))
        # A period that a busy machine leaves out gives the step more time.
        periods = np.maximum(np.round(np.diff(times) / 0.005), 1.0)[:, None]
        assert (steps <= 0.005 * periods * speed * 1.001 + 1e-9).all(), (old, new)
        low = np.minimum(plans[old].span[0], plans[new].span[0]) + offset
        high = np.maximum(plans[old].span[1], plans[new].span[1]) + offset
        assert (positions >= low - slack).all() and (positions <= high + slack).all(), (old, new)
        if new in phases:
            assert off(watcher.next_phases(20), phases[new]) < 0.02, (old, new)
        assert watcher.gaits[-1] == new
