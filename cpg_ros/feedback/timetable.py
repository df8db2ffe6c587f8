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

from cpg_ros.feedback.kinematics import forward, Geometry
from cpg_ros.motion.plan import Program
import numpy as np

#: Points of a stride.
POINTS = 512


class Timetable:
    """A gait's angles and the times of its steps, over the stride.

    Attributes:
        angles: from the stand at full strides, rad, shape (POINTS, joints).
        in_place: the same at strides of length 0.
        swinging: whether each leg is meant to, shape (POINTS, legs).
        progress: share of that swing, or else of its stance, that is over, shape (POINTS, legs).

    """

    def __init__(self, program: Program, geometry: Geometry) -> None:
        """Look at a gait: a leg swings while its foot goes forward, seen from the body."""
        robot, theta = program.robot, np.arange(POINTS) / POINTS
        phases = theta[:, None] - program.readout.start + program.orbit.phases[robot.cells]
        self.angles, self.in_place = (
            program.shift + np.stack([_periodic(row, phase) for row, phase
                                      in zip(readout.angles, phases.T, strict=True)], axis=1)
            for readout in (program.readout, program.in_place))
        feet = forward(geometry, robot.column('offset') + self.angles)
        columns = [_swing(x) for x in feet[:, :, 0].T]
        self.swinging = np.stack([one for one, _ in columns], axis=1)
        self.progress = np.stack([one for _, one in columns], axis=1)


def _periodic(values: np.ndarray, phase: np.ndarray) -> np.ndarray:
    grid = np.arange(values.size + 1) / values.size
    return np.interp(phase % 1.0, grid, np.append(values, values[0]))


def _swing(x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Find the swing from the foot furthest back to the foot furthest ahead, if it moves."""
    lift, land = int(x.argmin()), int(x.argmax())
    swing = (land - lift) % x.size
    if np.ptp(x) < 1e-9:
        return np.zeros(x.size, dtype=bool), np.zeros(x.size)
    since = (np.arange(x.size) - lift) % x.size
    swinging = since < swing
    return swinging, np.where(swinging, since / swing, (since - swing) / (x.size - swing))
