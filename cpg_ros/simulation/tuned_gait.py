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

"""What tuning finds for a gait."""

from dataclasses import dataclass

from cpg_ros.robots.robot import Motion
from cpg_ros.simulation.gait_design import Design
from cpg_ros.simulation.run_metrics import RunMetrics

#: Share of the speed aimed at from which a gait is good.
GOOD = 0.3


@dataclass(frozen=True)
class Tuned:
    """What was found for a gait.

    Attributes:
        gait: its name.
        design: of the lowest price.
        price: its price.
        first: price of the usual start.
        motion: what it makes of the robot.
        trial: LONG seconds of it on a good floor, nothing disturbing it.
        aim: speed that it was to reach on this robot, m/s.
        pace: share of the usual frequencies and speed, for joints that can do no more.

    """

    gait: str
    design: Design
    price: float
    first: float
    motion: Motion
    trial: RunMetrics
    aim: float
    pace: float = 1.0

    @property
    def good(self) -> bool:
        """Whether it stays upright and gets on."""
        return self.trial.upright and self.trial.speed >= GOOD * self.aim

    @property
    def verdict(self) -> str:
        """Good or poor, and why."""
        if not self.trial.upright:
            return f'poor: falls after {self.trial.fell:.1f} s'
        return f'{"good" if self.good else "poor"}: {self.trial.speed:.2f} m/s' + (
            f', at {100.0 * self.pace:.0f} % of the usual pace' if self.pace < 1.0 else '')
