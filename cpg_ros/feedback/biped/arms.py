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

"""Arms of a biped: joints of no leg that swing with the waveforms of the network's cells."""

from cpg_ros.motion.plan import GaitPlan
from cpg_ros.robots.robot import Robot
import numpy as np

#: From rest to the whole swing, and back, s.
RISE = 1.0
#: Largest speed, also where gaits change, rad/s.
FASTEST = 10.0
#: Instants at which an orbit is searched for the range of a cell.
SAMPLES = 256


class Arms:
    """Where the joints that a robot file holds are to be driven.

    One with a cell and a swing goes by that many radians about its angle as the cell's last
    variable goes from its mean to its peak; the others stay where they are held. Of a Morris-Lecar
    cell that is the recovery variable, a quarter of a stride behind the voltage: an arm that is
    driven by the other leg's flexor is fastest forward as that leg is, which takes the yaw of the
    swing.

    Attributes:
        names: of all held joints, in the order of the robot file.
        rest: where they are held, rad, shape (joints,).
        positions: where they are to be driven, rad, shape (joints,).
        swing: whether any of them swings.

    """

    def __init__(self, robot: Robot) -> None:
        """Take what the robot file holds."""
        links = robot.biped.links if robot.biped is not None else {}
        self.names = tuple(robot.held)
        self.rest = np.array(list(robot.held.values()))
        self.positions = self.rest.copy()
        self._swings = np.array([links[name].swing for name in self.names])
        self._cells = np.array([max(links[name].cell - 1, 0) for name in self.names], dtype=int)
        # Of each joint's cell in the network's state.
        self._places = self._cells
        self.swing = bool(self._swings.any())
        self._level, self._waves = 0.0, np.zeros(len(self.names))
        self._middle, self._half = np.zeros(len(self.names)), np.ones(len(self.names))

    def follow(self, program: GaitPlan) -> None:
        """Read the cells of another gait from now on."""
        if not self.swing:
            return
        orbit = program.orbit
        network = orbit.network
        self._places = self._cells + network.cells * (len(network.states) - 1)
        waves = orbit(np.arange(SAMPLES) / SAMPLES * orbit.period)[:, self._places]
        low, high = waves.min(axis=0), waves.max(axis=0)
        self._middle, self._half = 0.5 * (low + high), 0.5 * (high - low)

    def advance(self, dt: float, moving: bool, state: np.ndarray | None = None) -> None:
        """Fill the positions dt in s later.

        Args:
            dt: s.
            moving: whether arms are to swing; where they are not, they return to rest.
            state: of the network, shape (components,); None where it does not move.

        """
        if not self.swing:
            return
        self._level = min(max(self._level + (dt if moving else -dt) / RISE, 0.0), 1.0)
        if state is not None:
            self._waves = (state[self._places] - self._middle) / self._half
        wanted = self.rest + self._level * self._swings * self._waves
        self.positions += np.clip(wanted - self.positions, -FASTEST * dt, FASTEST * dt)
