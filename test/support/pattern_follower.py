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

"""A body that follows a pattern, tick by tick, as a robot follows the generator, and feels."""

from cpg_ros.common.errors import CpgError
from cpg_ros.feedback.estimate import SensorData
from cpg_ros.motion.pattern import Pattern
from cpg_ros.simulation.body import Body
from cpg_ros.simulation.sensors import fill_sensor_data
import numpy as np


class Fallen(CpgError):
    """The robot fell; the message says when."""


class Follow:
    """One walk of a body, from the stand on.

    Attributes:
        track: place on the floor (m) and heading (rad, not wrapped) after each step, rows
            x, y, yaw.

    """

    def __init__(self, body: Body, pattern: Pattern) -> None:
        """Reset the body; the pattern starts at the stand, too."""
        self.body, self.pattern = body, pattern
        self._places = pattern.robot.order_indices
        body.reset()
        self.track = np.zeros((1, 3))

    def go(self, duration: float) -> np.ndarray:
        """Walk on for some seconds; return this part of the track.

        Raises:
            Fallen: the robot fell.

        """
        body, pattern, dt = self.body, self.pattern, self.body.model.opt.timestep
        rows = np.empty((round(duration / dt), 3))
        for row in rows:
            pattern.advance(dt)
            body.command(pattern.position[self._places])
            body.step()
            row[:2], row[2] = body.base[:2], body.yaw
            if body.fallen:
                raise Fallen(f'fell {body.time:.2f} s after the start')
        rows[:, 2] = np.unwrap(np.append(self.track[-1, 2], rows[:, 2]))[1:]
        self.track = np.concatenate([self.track, rows])
        return rows


def speed(track: np.ndarray, timestep: float) -> float:
    """Mean speed along the robot's own heading, m/s."""
    steps, yaw = np.diff(track[:, :2], axis=0), 0.5 * (track[1:, 2] + track[:-1, 2])
    return float((steps[:, 0] * np.cos(yaw) + steps[:, 1] * np.sin(yaw)).mean()) / timestep


class Proprioception:
    """What one body feels, step by step; call it once after each."""

    def __init__(self, body: Body) -> None:
        self._body = body
        self._order = np.argsort(body.robot.order_indices)
        self._senses = SensorData.zeros(1, len(body.robot.legs), len(self._order))
        self._before, self._velocity = body.rates[None].copy(), np.zeros((1, 3))

    def __call__(self) -> SensorData:
        """Return what is felt now, of one run; overwritten by the next call."""
        body, senses = self._body, self._senses
        senses.joint_positions[0] = body.position[self._order]
        senses.joint_velocities[0] = body.velocity[self._order]
        senses.foot_forces[0] = body.feet
        fill_sensor_data(senses, body.quaternion[None], body.rates[None], self._before,
                         body.model.opt.timestep, self._velocity)
        self._before[0] = body.rates
        return senses
