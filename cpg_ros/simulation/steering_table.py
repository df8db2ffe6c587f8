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

"""How fast a tuned gait goes and turns with strides of other lengths: measured, not assumed."""

from collections.abc import Callable

from cpg_ros.motion.plan import GaitPlan
from cpg_ros.robots.robot import SteeringTable
from cpg_ros.simulation.batch import Batch, targets
from cpg_ros.simulation.scenario import Scenario
import numpy as np

#: Strides that are tried, how much slower the legs move at a stride of 0, and how much faster at
#: one of 1, as far as the joints' limits are away by this share.
STRIDES = (-0.4, -0.2, 0.0, 0.2, 0.4, 0.6, 0.8, 1.0)
SLOWER = 0.2
FASTER, ROOM = (1.1, 1.2, 1.3, 1.4), 0.05
#: How many rows are tried at most.
ROWS = len(STRIDES) + len(FASTER)
#: Difference of stride between the legs of both sides, when turning is measured.
DIFFERENCE = 0.5
#: Length of a run, s.
DURATION = 8.0
#: Floors that speeds and turns are means of.
FLOORS = (Scenario(), Scenario(0.7))
#: A gait counts as steered if its speeds rise by at least this much a row, m/s, and if it turns at
#: least so fast for a difference of 1, rad/s; of a slow one, these for each m/s of its speed.
RISE, TURN = 0.01, 0.1
RISE_SHARE, TURN_SHARE = 0.05, 0.5


def measure(batch: Batch, program: GaitPlan,
            update: Callable[[int], None] = lambda done: None) -> SteeringTable | None:
    """Measure a gait at several strides; None if its speed does not rise with them.

    Rows are left out at the ends, where the robot falls or its speed does not rise any more.

    Args:
        batch: bodies.
        program: the gait, of a robot with a motion that has a frequency.
        update: takes the number of strides measured so far.

    """
    left = program.robot.left
    tried = [*((stride, 1.0 - SLOWER * (1.0 - abs(stride))) for stride in STRIDES),
             *((1.0, pace) for pace in FASTER
               if pace <= (1.0 - ROOM) * program.most_pace)]
    rows = []
    for done, (stride, pace) in enumerate(tried):
        # Within strides of -1 to 1 on both sides.
        middle = min(stride, 1.0 - 0.5 * DIFFERENCE)
        commands = [np.full(left.size, stride),
                    *(middle + sign * 0.5 * DIFFERENCE * np.where(left, -1.0, 1.0)
                      for sign in (1.0, -1.0))]
        trials = batch.run([(targets(program, DURATION, batch.timestep, one.tolist(), pace),
                             floor) for one in commands for floor in FLOORS])
        speeds = [trial.speed for trial in trials]
        turns = [trial.turn for trial in trials]
        n = len(FLOORS)
        turn = (np.mean(turns[n:2 * n]) - np.mean(turns[2 * n:])) / (2.0 * DIFFERENCE)
        rows.append((float(np.mean(speeds[:n])), stride, pace * program.frequency, float(turn),
                     all(trial.upright for trial in trials)))
        update(done + 1)
    return _rising(rows)


def _rising(rows: list[tuple[float, float, float, float, bool]]) -> SteeringTable | None:
    """Keep the rows about the stride of 0 as far as speeds rise."""
    zero = STRIDES.index(0.0)
    first = last = zero
    top = max(rows[len(STRIDES) - 1][0], 0.0)
    rise, turning = min(RISE, RISE_SHARE * top), min(TURN, TURN_SHARE * top)
    good = [upright and turn >= turning for *_, turn, upright in rows]
    while last + 1 < len(rows) and good[last + 1] and (
            rows[last + 1][0] >= rows[last][0] + rise):
        last += 1
    while first > 0 and good[first - 1] and rows[first - 1][0] <= rows[first][0] - rise:
        first -= 1
    if not good[zero] or last == zero:
        return None
    speed, stride, frequency, turn = zip(*(row[:4] for row in rows[first:last + 1]), strict=True)
    return SteeringTable(*(tuple(round(value, 4) for value in column)
                           for column in (speed, stride, frequency, turn)))
