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

"""The design of a gait in a few numbers, and the target of each gait for a knee-high robot.

All figures are for a leg of LENGTH from thigh joint to foot in the stand; for other robots lengths
go with that length, times and speeds with its square root, as for pendulums.
"""

from dataclasses import astuple, dataclass, replace
import math

from cpg_ros.simulation.foot_path import Path
from cpg_ros.simulation.run_metrics import RunMetrics
import numpy as np

#: Of a leg in the stand, m.
LENGTH = 0.2664
#: Share by which strides of the gentlest start are shorter.
SHORTER = 0.5
#: Height that feet should exceed for a tenth of the time, m.
CLEAR = 0.02


@dataclass(frozen=True)
class Design:
    """A gait.

    Attributes:
        frequency: Hz.
        stride, lift, height: as of Path.
        duty, lead, late: as of Path.
        fore, hind: of fore and hind legs, how far ahead of the joint the foot is, as of Path.
        push_fore, push_hind: of fore and hind legs, as of Path.

    """

    frequency: float
    stride: float
    duty: float
    lift: float
    height: float
    lead: float
    fore: float
    hind: float
    push_fore: float
    push_hind: float
    late: float

    def path(self, girdle: str, scale: float) -> Path:
        """Return the way of a fore, middle or hind foot of a robot this much larger."""
        hind = {'hind': 1.0, 'middle': 0.5}.get(girdle, 0.0)
        ahead = self.fore + hind * (self.hind - self.fore)
        push = self.push_fore + hind * (self.push_hind - self.push_fore)
        return Path(scale * self.stride, self.duty, scale * self.lift, scale * self.height,
                    scale * ahead, scale * push, self.late, self.lead)


@dataclass(frozen=True)
class Aim:
    """The target of a gait, and where to search for its design.

    Attributes:
        speed: steady, m/s; more is worth nothing, and much more is a fault.
        hops: a second; 0 if it need not leave the floor.
        low, start, high: designs.

    """

    speed: float
    hops: float
    low: Design
    start: Design
    high: Design

    def design(self, place: np.ndarray) -> Design:
        """Return the design at a place in the unit cube between low and high."""
        low, high = np.array(astuple(self.low)), np.array(astuple(self.high))
        return Design(*(float(value) for value in low + place * (high - low)))

    def gentler(self, share: float) -> 'Aim':
        """Return the same with a start that demands less of the joints, least at a share of 1."""
        start, low = self.start, self.low
        return replace(self, start=replace(
            start, frequency=start.frequency + share * (low.frequency - start.frequency),
            stride=max(low.stride, (1.0 - SHORTER * share) * start.stride),
            push_fore=(1.0 - share) * start.push_fore, push_hind=(1.0 - share) * start.push_hind,
            lift=start.lift + share * (low.lift - start.lift),
            height=start.height + share * (low.height - start.height)))

    def slower(self, share: float) -> 'Aim':
        """Return the same at this share of all frequencies, and of the speed that follows."""
        low, start, high = (replace(one, frequency=share * one.frequency)
                            for one in (self.low, self.start, self.high))
        return Aim(share * self.speed, self.hops, low, start, high)

    @property
    def place(self) -> np.ndarray:
        """Where the start is in the unit cube."""
        low, high = np.array(astuple(self.low)), np.array(astuple(self.high))
        return (np.array(astuple(self.start)) - low) / (high - low)


def _aim(speed: float, hops: float, low: tuple, start: tuple, high: tuple) -> Aim:
    return Aim(speed, hops, Design(*low), Design(*start), Design(*high))


#: Columns as of Design.
AIMS = {
    'walk': _aim(0.45, 0.0,
                 (1.0, 0.10, 0.55, 0.05, 0.25, 0.0, -0.08, -0.08, -0.02, -0.02, 0.7),
                 (1.8, 0.20, 0.70, 0.08, 0.255, 0.12, -0.04, -0.05, 0.01, 0.0, 1.2),
                 (2.4, 0.32, 0.80, 0.12, 0.29, 0.25, 0.06, 0.06, 0.04, 0.04, 2.0)),
    'trot': _aim(0.80, 0.0,
                 (1.8, 0.10, 0.45, 0.05, 0.25, 0.0, -0.06, -0.06, -0.02, -0.02, 0.7),
                 (2.2, 0.26, 0.65, 0.06, 0.275, 0.08, -0.01, -0.04, 0.01, 0.01, 1.1),
                 (3.0, 0.32, 0.70, 0.12, 0.29, 0.25, 0.06, 0.06, 0.04, 0.04, 2.0)),
    'pace': _aim(0.60, 0.0,
                 (1.8, 0.10, 0.45, 0.04, 0.23, 0.0, -0.08, -0.08, -0.02, -0.02, 0.7),
                 (2.9, 0.16, 0.52, 0.065, 0.265, 0.13, -0.03, -0.06, -0.01, -0.01, 0.9),
                 (3.2, 0.32, 0.70, 0.12, 0.29, 0.25, 0.06, 0.06, 0.04, 0.04, 2.0)),
    'bound': _aim(0.50, 0.0,
                  (1.5, 0.06, 0.35, 0.05, 0.235, 0.0, -0.10, -0.10, -0.02, -0.02, 0.5),
                  (2.4, 0.20, 0.47, 0.07, 0.25, 0.11, -0.06, -0.01, 0.02, 0.03, 1.1),
                  (4.0, 0.32, 0.75, 0.12, 0.29, 0.25, 0.08, 0.08, 0.10, 0.10, 2.5)),
    'jump': _aim(0.50, 1.25,
                 (1.8, 0.05, 0.35, 0.04, 0.23, 0.0, -0.10, -0.10, 0.0, 0.0, 0.5),
                 (3.3, 0.20, 0.55, 0.055, 0.255, 0.13, -0.05, -0.06, 0.05, 0.03, 2.0),
                 (4.0, 0.32, 0.75, 0.12, 0.29, 0.25, 0.08, 0.08, 0.10, 0.10, 3.0)),
    'pronk': _aim(0.50, 1.25,
                  (1.8, 0.05, 0.35, 0.04, 0.23, 0.0, -0.10, -0.10, 0.0, 0.0, 0.5),
                  (3.0, 0.20, 0.60, 0.055, 0.245, 0.13, -0.05, -0.08, 0.05, 0.03, 2.0),
                  (4.0, 0.32, 0.75, 0.12, 0.29, 0.25, 0.08, 0.08, 0.10, 0.10, 3.0)),
    'tripod': _aim(0.55, 0.0,
                   (0.8, 0.12, 0.50, 0.06, 0.23, 0.0, -0.08, -0.08, -0.02, -0.02, 0.7),
                   (1.2, 0.22, 0.56, 0.10, 0.266, 0.08, 0.0, 0.0, 0.0, 0.0, 1.0),
                   (2.2, 0.34, 0.70, 0.18, 0.31, 0.25, 0.08, 0.08, 0.04, 0.04, 2.0)),
    'ripple': _aim(0.36, 0.0,
                   (0.6, 0.12, 0.60, 0.06, 0.23, 0.0, -0.08, -0.08, -0.02, -0.02, 0.7),
                   (1.0, 0.22, 0.67, 0.10, 0.266, 0.06, 0.0, 0.0, 0.0, 0.0, 1.0),
                   (1.8, 0.34, 0.75, 0.18, 0.31, 0.20, 0.08, 0.08, 0.04, 0.04, 2.0)),
    'wave': _aim(0.20, 0.0,
                 (0.4, 0.12, 0.76, 0.06, 0.23, 0.0, -0.08, -0.08, -0.02, -0.02, 0.7),
                 (0.7, 0.22, 0.82, 0.10, 0.266, 0.04, 0.0, 0.0, 0.0, 0.0, 1.0),
                 (1.1, 0.34, 0.86, 0.18, 0.31, 0.12, 0.08, 0.08, 0.04, 0.04, 2.0))}
AIMS |= {f'reverse_{gait}': AIMS[gait] for gait in ('ripple', 'wave')}


def price(trial: RunMetrics, aim: Aim, duration: float, scale: float = 1.0) -> float:
    """Return the cost of a run by its figures; 0 would be perfect.

    Slower or much faster than wanted, fewer hops or, where none are wanted, bobbing, turning,
    leaning, dragging feet, drifting, sliding, torques at their limit and work all add to it; a
    fall adds most. Lengths are divided by the robot's scale.
    """
    fall = 0.0 if trial.upright else 15.0 + 25.0 * (1.0 - trial.fell / duration)
    share = trial.speed / aim.speed
    speed = 12.0 * max(0.0, 1.0 - share) + 3.0 * max(0.0, share - 1.2)
    turning = (0.15 * min(abs(math.degrees(trial.turn)) / 0.5, 8.0)**2
               + 0.1 * min(abs(trial.heading) / 4.0, 8.0)**2)
    leaning = (trial.sway / 5.0)**1.5
    dragging = 6.0 * max(0.0, 1.0 - trial.lift / (CLEAR * scale))
    restless = 0.5 * trial.bob / (0.01 * scale)
    if aim.hops:
        restless = 5.0 * max(0.0, 1.0 - trial.hops / (0.85 * aim.hops * duration))
    return (fall + speed + turning + leaning + dragging + restless + 0.3 * (trial.drift / 0.4)**2
            + 2.0 * min(trial.slip, 3.0) + 20.0 * trial.saturation + 0.6 * min(trial.cost, 5.0))
