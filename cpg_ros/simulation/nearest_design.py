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

"""What a search is told that finds no design within a robot's limits: which came nearest."""

from dataclasses import dataclass

from cpg_ros.motion.plan import OutOfLimits
from cpg_ros.robots.description import SERVOS
from cpg_ros.simulation.gait_design import Design
from cpg_ros.simulation.robot_model import SimulationError


class NoDesign(SimulationError):
    """None of a gait's designs can be run; the message gives the reason."""

    exit_code = 1


@dataclass(frozen=True)
class NearestDesign:
    """A design that a robot's joints cannot follow.

    Attributes:
        design: for a knee-high robot.
        frequency: that it has on this one, Hz.
        scale: by which this one's legs are longer.
        error: which limit it misses.

    """

    design: Design
    frequency: float
    scale: float
    error: OutOfLimits

    @property
    def share(self) -> float:
        """The share of its frequency at which it would keep to its limits of speed."""
        return 1.0 / (1.0 + self.error.excess) if self.error.key == 'velocity' else 1.0

    def __str__(self) -> str:
        """Say by how much it misses, and what to change."""
        design, error = self.design, self.error
        return (f'the nearest, with {self.frequency:.2f} Hz, strides of '
                f'{100.0 * self.scale * design.stride:.1f} cm and a lift of '
                f'{100.0 * self.scale * design.lift:.1f} cm, moves {error.message}, by '
                + (self._too_fast() if error.key == 'velocity' else
                   f'{error.excess:.2f} rad: if the joint can go further, set its {error.key} in '
                   'the robot file, or else an offset (its angle in the stand) with more room'))

    def _too_fast(self) -> str:
        return (f'{100.0 * self.error.excess:.0f} %: it would keep to it at '
                f'{self.share * self.frequency:.2f} Hz, too slow to be tried, or at '
                f'{100.0 * self.share:.0f} % of its amplitude; if the motor is faster ({SERVOS}), '
                'make the robot file anew with --velocity and what it reaches')
