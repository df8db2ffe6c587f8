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

"""When each leg of a gait swings, and how far it has got, by the stride phase of the first leg."""

import itertools

from cpg_ros.feedback.interpolation import periodic
from cpg_ros.feedback.kinematics import forward, Geometry
from cpg_ros.motion.plan import GaitPlan
from cpg_ros.robots.robot import Robot
import numpy as np

#: Points of a stride.
POINTS = 512
#: Legs of a pair swing together if they differ for less than this share of the stride.
TOGETHER = 0.2


class Timetable:
    """A gait's angles and the times of its steps, over the stride.

    Attributes:
        angles: from the stand at full strides, rad, shape (POINTS, joints).
        in_place: the same at strides of length 0.
        swinging: whether each leg is meant to, shape (POINTS, legs).
        progress: share of that swing, or else of its stance, that is over, shape (POINTS, legs).
        hops: whether the left and right leg of each pair swing together.

    """

    def __init__(self, program: GaitPlan, geometry: Geometry) -> None:
        """Look at a gait: a leg swings while its foot goes forward, seen from the body."""
        robot, theta = program.robot, np.arange(POINTS) / POINTS
        phases = theta[:, None] - program.readout.start + program.orbit.phases[robot.cells]
        self.angles, self.in_place = (
            program.shift + np.stack([periodic(row, phase) for row, phase
                                      in zip(readout.angles, phases.T, strict=True)], axis=1)
            for readout in (program.readout, program.in_place))
        feet = forward(geometry, robot.column('offset') + self.angles)
        columns = [_swing(x) for x in feet[:, :, 0].T]
        self.swinging = np.stack([one for one, _ in columns], axis=1)
        self.progress = np.stack([one for _, one in columns], axis=1)
        self.hops = _hops(robot, self.swinging)


def _hops(robot: Robot, swinging: np.ndarray) -> bool:
    pairs = [pair for pair in itertools.combinations(range(len(robot.legs)), 2)
             if _paired(robot, *(list(robot.legs)[leg] for leg in pair))]
    return bool(pairs) and all((swinging[:, one] != swinging[:, other]).mean() < TOGETHER
                               for one, other in pairs)


def _paired(robot: Robot, one: str, other: str) -> bool:
    return (robot.girdles.get(one) == robot.girdles.get(other)
            and {robot.sides.get(one), robot.sides.get(other)} == {'left', 'right'})


def _swing(x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Find the swing from the foot furthest back to the foot furthest ahead, if it moves."""
    lift, land = int(x.argmin()), int(x.argmax())
    swing = (land - lift) % x.size
    if np.ptp(x) < 1e-9:
        return np.zeros(x.size, dtype=bool), np.zeros(x.size)
    since = (np.arange(x.size) - lift) % x.size
    swinging = since < swing
    return swinging, np.where(swinging, since / swing, (since - swing) / (x.size - swing))
