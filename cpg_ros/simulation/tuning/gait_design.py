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

"""Design of a gait in a few numbers, and the target of each gait for a knee-high robot.

All figures are for a leg of LEG_LENGTH from thigh joint to foot in the stand; for other robots
lengths scale with the leg length, times and speeds with its square root, as for pendulums.
"""

from collections.abc import Callable
from dataclasses import astuple, dataclass, replace
import math

from cpg_ros.motion.plan import GaitPlan
from cpg_ros.motion.robot import SteeringTable
from cpg_ros.simulation.bodies import KP_DIGITS, OpenLoopBatch, targets
from cpg_ros.simulation.run_metrics import RunMetrics
from cpg_ros.simulation.scenario import Scenario
from cpg_ros.simulation.tuning.foot_path import FootTrajectory
import numpy as np

# Steering tables: measured speed and yaw rate of a tuned gait by the length of its strides.

#: STRIDES: strides that are tried; SLOWDOWN: by how much the legs move slower at a stride of 0;
#: FREQUENCY_FACTORS: factors of the frequency that are tried at a stride of 1; SPEED_MARGIN: least
#: distance from the joints' speed limits, as a fraction, with which they are.
STRIDES = (-0.4, -0.2, 0.0, 0.2, 0.4, 0.6, 0.8, 1.0)
SLOWDOWN = 0.2
FREQUENCY_FACTORS, SPEED_MARGIN = (1.1, 1.2, 1.3, 1.4), 0.05
#: MAX_ROWS: most rows of a table.
MAX_ROWS = len(STRIDES) + len(FREQUENCY_FACTORS)
#: STRIDE_DIFFERENCE: of the strides of both sides when turning is measured.
STRIDE_DIFFERENCE = 0.5
#: DURATION: of a run, s.
DURATION = 8.0
#: SOFT_STRIDE: stride up to which a gait with stiff servos leaves them as they are.
SOFT_STRIDE = 0.4
#: FLOORS: floors over which speeds and yaw rates are averaged.
FLOORS = (Scenario(), Scenario(0.7))
#: A gait counts as steered if its speed rises by MIN_SPEED_STEP per row, m/s, and its yaw rate is
#: at least MIN_YAW_RATE for a difference of strides of 1, rad/s; for slow gaits, STEP_FRACTION
#: and YAW_FRACTION of the top speed, m/s, are enough.
MIN_SPEED_STEP, MIN_YAW_RATE = 0.01, 0.1
STEP_FRACTION, YAW_FRACTION = 0.05, 0.5


def measure(batch: OpenLoopBatch, plan: GaitPlan,
            update: Callable[[int], None] = lambda done: None) -> SteeringTable | None:
    """Measure a gait at several strides; None if its speed does not increase with them.

    Rows are dropped at the ends where the robot falls or its speed does not increase. Strides
    above SOFT_STRIDE are measured with servos as stiff as the gait's target has them. ``update``
    takes the number of strides measured so far.
    """
    left, stiffness = plan.robot.left, AIMS[plan.name].stiffness
    tried = [*((stride, 1.0 - SLOWDOWN * (1.0 - abs(stride))) for stride in STRIDES),
             *((1.0, pace) for pace in FREQUENCY_FACTORS
               if pace <= (1.0 - SPEED_MARGIN) * plan.most_pace)]
    rows = []
    for done, (stride, pace) in enumerate(tried):
        # Within strides of -1 to 1 on both sides.
        middle = min(stride, 1.0 - 0.5 * STRIDE_DIFFERENCE)
        commands = [np.full(left.size, stride),
                    *(middle + sign * 0.5 * STRIDE_DIFFERENCE * np.where(left, -1.0, 1.0)
                      for sign in (1.0, -1.0))]
        kp = round(1.0 + (stiffness - 1.0) * max(stride - SOFT_STRIDE, 0.0)
                   / (1.0 - SOFT_STRIDE), KP_DIGITS)
        trials = batch.run([(targets(plan, DURATION, batch.timestep, command.tolist(), pace),
                             replace(floor, kp=kp)) for command in commands for floor in FLOORS])
        speeds = [trial.speed for trial in trials]
        turns = [trial.turn for trial in trials]
        n = len(FLOORS)
        turn = (np.mean(turns[n:2 * n]) - np.mean(turns[2 * n:])) / (2.0 * STRIDE_DIFFERENCE)
        rows.append((float(np.mean(speeds[:n])), stride, pace * plan.frequency, float(turn), kp,
                     all(trial.upright for trial in trials)))
        update(done + 1)
    return _rising(rows)


def _rising(rows: list[tuple[float, float, float, float, float, bool]]) -> SteeringTable | None:
    """Keep the rows around the stride of 0 as far as speeds increase."""
    zero = STRIDES.index(0.0)
    first = last = zero
    top = max(rows[len(STRIDES) - 1][0], 0.0)
    rise, turning = min(MIN_SPEED_STEP, STEP_FRACTION * top), min(MIN_YAW_RATE, YAW_FRACTION * top)
    good = [upright and turn >= turning for *_, turn, _, upright in rows]
    while last + 1 < len(rows) and good[last + 1] and (
            rows[last + 1][0] >= rows[last][0] + rise):
        last += 1
    while first > 0 and good[first - 1] and rows[first - 1][0] <= rows[first][0] - rise:
        first -= 1
    if not good[zero] or last == zero:
        return None
    speed, stride, frequency, turn, stiffness = (
        tuple(round(value, 4) for value in column)
        for column in zip(*(row[:5] for row in rows[first:last + 1]), strict=True))
    return SteeringTable(speed, stride, frequency, turn,
                         stiffness if max(stiffness) > 1.0 else ())


#: LEG_LENGTH: of a leg in the stand, m.
LEG_LENGTH = 0.2664
#: STRIDE_REDUCTION: fraction by which strides of the gentlest start are shorter.
STRIDE_REDUCTION = 0.5
#: FOOT_CLEARANCE: height that feet should exceed for a tenth of the time, m.
FOOT_CLEARANCE = 0.02


@dataclass(frozen=True)
class Design:
    """Design of a gait.

    Attributes:
        frequency: Hz.
        stride, lift, height: as of FootTrajectory.
        duty, lead, late: as of FootTrajectory.
        fore, hind: distance of fore and hind feet ahead of the joint, m.
        push_fore, push_hind: of fore and hind legs, as of FootTrajectory.

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

    def path(self, girdle: str, scale: float) -> FootTrajectory:
        """Return the path of a fore, middle or hind foot of a robot scaled by a factor."""
        hind = {'hind': 1.0, 'middle': 0.5}.get(girdle, 0.0)
        ahead = self.fore + hind * (self.hind - self.fore)
        push = self.push_fore + hind * (self.push_hind - self.push_fore)
        return FootTrajectory(scale * self.stride, self.duty, scale * self.lift,
                              scale * self.height,
                    scale * ahead, scale * push, self.late, self.lead)


@dataclass(frozen=True)
class GaitTarget:
    """Target of a gait, and where to search for its design.

    Attributes:
        speed: steady, m/s; more has no value, and much more counts as a fault.
        hops: per second; 0 if the robot need not leave the floor.
        low, start, high: designs.
        stiffness: factor of the servos' proportional gain at full strides.

    """

    speed: float
    hops: float
    low: Design
    start: Design
    high: Design
    stiffness: float = 1.0

    def design(self, point: np.ndarray) -> Design:
        """Return the design at a point of the unit cube between low and high."""
        low, high = np.array(astuple(self.low)), np.array(astuple(self.high))
        return Design(*(float(value) for value in low + point * (high - low)))

    def gentler(self, fraction: float) -> 'GaitTarget':
        """Return the same with a start that demands less of the joints, least for 1."""
        start, low = self.start, self.low
        return replace(self, start=replace(
            start, frequency=start.frequency + fraction * (low.frequency - start.frequency),
            stride=max(low.stride, (1.0 - STRIDE_REDUCTION * fraction) * start.stride),
            push_fore=(1.0 - fraction) * start.push_fore,
            push_hind=(1.0 - fraction) * start.push_hind,
            lift=start.lift + fraction * (low.lift - start.lift),
            height=start.height + fraction * (low.height - start.height)))

    def slower(self, fraction: float) -> 'GaitTarget':
        """Return the same with this fraction of all frequencies, and of the resulting speed."""
        low, start, high = (replace(design, frequency=fraction * design.frequency)
                            for design in (self.low, self.start, self.high))
        return replace(self, speed=fraction * self.speed, low=low, start=start, high=high)

    @property
    def start_point(self) -> np.ndarray:
        """Start in the unit cube, shape (11,)."""
        low, high = np.array(astuple(self.low)), np.array(astuple(self.high))
        return (np.array(astuple(self.start)) - low) / (high - low)


def _aim(speed: float, hops: float, low: tuple, start: tuple, high: tuple,
         stiffness: float = 1.0) -> GaitTarget:
    return GaitTarget(speed, hops, Design(*low), Design(*start), Design(*high), stiffness)


#: AIMS: gait -> its target; columns are those of Design.
AIMS = {
    'walk': _aim(0.45, 0.0,
                 (1.0, 0.10, 0.55, 0.05, 0.25, 0.0, -0.08, -0.08, -0.02, -0.02, 0.7),
                 (1.8, 0.20, 0.70, 0.08, 0.255, 0.12, -0.04, -0.05, 0.01, 0.0, 1.2),
                 (2.4, 0.32, 0.80, 0.12, 0.29, 0.25, 0.06, 0.06, 0.04, 0.04, 2.0)),
    'trot': _aim(0.80, 0.0,
                 (1.8, 0.10, 0.45, 0.05, 0.25, 0.0, -0.06, -0.06, -0.02, -0.02, 0.7),
                 (2.2, 0.26, 0.65, 0.06, 0.275, 0.08, -0.01, -0.04, 0.01, 0.01, 1.1),
                 (3.0, 0.32, 0.70, 0.12, 0.29, 0.25, 0.06, 0.06, 0.04, 0.04, 2.0)),
    'run': _aim(2.0, 0.0,
                (2.0, 0.20, 0.40, 0.035, 0.24, 0.0, -0.08, -0.08, -0.02, -0.02, 0.7),
                (3.1, 0.322, 0.459, 0.055, 0.269, 0.096, -0.011, -0.022, 0.035, 0.043, 1.40),
                (3.4, 0.42, 0.62, 0.10, 0.32, 0.30, 0.06, 0.06, 0.08, 0.08, 2.2), 1.4),
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


def price(trial: RunMetrics, aim: GaitTarget, duration: float, scale: float = 1.0) -> float:
    """Return the cost of a run from its metrics; 0 would be perfect.

    It rises if the robot is slower or much faster than wanted, hops too rarely or, where it should
    not hop, bobs, turns, leans, drags its feet, drifts or slides, and with saturated torques and
    work; a fall costs most. Lengths are divided by the robot's scale.
    """
    fall = 0.0 if trial.upright else 15.0 + 25.0 * (1.0 - trial.fell / duration)
    fraction = trial.speed / aim.speed
    speed = 12.0 * max(0.0, 1.0 - fraction) + 3.0 * max(0.0, fraction - 1.2)
    turning = (0.15 * min(abs(math.degrees(trial.turn)) / 0.5, 8.0)**2
               + 0.1 * min(abs(trial.heading) / 4.0, 8.0)**2)
    leaning = (trial.sway / 5.0)**1.5
    dragging = 6.0 * max(0.0, 1.0 - trial.lift / (FOOT_CLEARANCE * scale))
    restless = 0.5 * trial.bob / (0.01 * scale)
    if aim.hops:
        restless = 5.0 * max(0.0, 1.0 - trial.hops / (0.85 * aim.hops * duration))
    return (fall + speed + turning + leaning + dragging + restless + 0.3 * (trial.drift / 0.4)**2
            + 2.0 * min(trial.slip, 3.0) + 20.0 * trial.saturation + 0.6 * min(trial.cost, 5.0))
