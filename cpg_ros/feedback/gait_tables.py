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

"""Tables of the gaits that the feedback corrects, in preallocated arrays."""

import ctypes
import itertools
from typing import NamedTuple

from cpg_ros.common.errors import InputError
from cpg_ros.feedback.efference_copy import BINS, EfferenceCopy, periodic, SIGNALS, SPEEDS
from cpg_ros.feedback.kinematics import forward, Geometry
from cpg_ros.motion.plan import GaitPlan
from cpg_ros.motion.robot import Robot
import numpy as np

# When each leg of a gait swings, and how far it has got, by the stride phase of the first leg.

#: NUM_PHASES: number of phases of a stride in the tables.
NUM_PHASES = 512
#: MIN_SINGLE_SWING: legs of a pair swing together if one alone swings for less than this fraction
#: of a stride.
MIN_SINGLE_SWING = 0.2


class Timetable:
    """A gait's angles and the times of its steps, over the stride.

    Attributes:
        angles: from the stand at full strides, rad, shape (NUM_PHASES, joints).
        in_place: the same at strides of length 0.
        swinging: whether each leg should swing, shape (NUM_PHASES, legs).
        progress: completed fraction of that swing or stance, shape (NUM_PHASES, legs).
        hops: whether the left and right leg of each pair swing together.

    """

    def __init__(self, plan: GaitPlan, geometry: Geometry) -> None:
        """Tabulate a gait: a leg swings while its foot moves forward relative to the body."""
        robot, theta = plan.robot, np.arange(NUM_PHASES) / NUM_PHASES
        phases = theta[:, None] - plan.readout.start + plan.orbit.phases[robot.cells]
        self.angles, self.in_place = (
            plan.shift + np.stack([periodic(row, phase) for row, phase
                                      in zip(readout.angles, phases.T, strict=True)], axis=1)
            for readout in (plan.readout, plan.in_place))
        feet = forward(geometry, robot.column('offset') + self.angles)
        columns = [_swing(x) for x in feet[:, :, 0].T]
        self.swinging = np.stack([column for column, _ in columns], axis=1)
        self.progress = np.stack([column for _, column in columns], axis=1)
        self.hops = _hops(robot, self.swinging)


def _hops(robot: Robot, swinging: np.ndarray) -> bool:
    pairs = [pair for pair in itertools.combinations(range(len(robot.legs)), 2)
             if _paired(robot, *(list(robot.legs)[leg] for leg in pair))]
    return bool(pairs) and all((swinging[:, first] != swinging[:, other]).mean() < MIN_SINGLE_SWING
                               for first, other in pairs)


def _paired(robot: Robot, leg: str, other: str) -> bool:
    return (robot.girdles.get(leg) == robot.girdles.get(other)
            and {robot.sides.get(leg), robot.sides.get(other)} == {'left', 'right'})


def _swing(x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Find the swing from the rearmost to the foremost position of a foot, if it moves."""
    lift, land = int(x.argmin()), int(x.argmax())
    swing = (land - lift) % x.size
    if np.ptp(x) < 1e-9:
        return np.zeros(x.size, dtype=bool), np.zeros(x.size)
    since = (np.arange(x.size) - lift) % x.size
    swinging = since < swing
    return swinging, np.where(swinging, since / swing, (since - swing) / (x.size - swing))


#: MAX_GAITS: most gaits known at the same time; MAX_ROWS: most rows of a steering table.
MAX_GAITS, MAX_ROWS = 8, 32


class GaitTables(NamedTuple):
    """Tables of several gaits; the first axis is the gait's slot.

    Attributes:
        swinging: whether each leg should swing, shape (MAX_GAITS, NUM_PHASES, legs).
        progress: completed fraction of that swing or stance, the same.
        duty: fraction of the stride that each leg stands, shape (MAX_GAITS, legs).
        stance: mean duration of a stance, s, shape (MAX_GAITS,).
        one_by_one: 1 where for most of the stride at most one leg swings, else 0, the same.
        alternates: 1 where left and right legs alternate, 0 where they hop, shape (MAX_GAITS,).
        speeds: of the efference copies, m/s, shape (MAX_GAITS, SPEEDS).
        expected: efference copies, shape (MAX_GAITS, SPEEDS, BINS, SIGNALS).
        steered: whether strides can be changed, shape (MAX_GAITS,).
        at: speeds of the steering tables, m/s, shape (MAX_GAITS, MAX_ROWS).
        turn: yaw rate, rad/s, for each unit by which right strides exceed left ones, the same.
        length: stride at these speeds, 1 for a full one, the same.
        stiffness: factor of the servos' proportional gain at these speeds, the same.
        sides: -1/2 for left legs and 1/2 for right ones, shape (legs,); 0 until a gait with
            steering is known.
        copied: whether the robot file has an efference copy of the gait, shape (MAX_GAITS,).
        keys: addresses of the gaits in the core, shape (MAX_GAITS,).

    """

    swinging: np.ndarray
    progress: np.ndarray
    duty: np.ndarray
    stance: np.ndarray
    one_by_one: np.ndarray
    alternates: np.ndarray
    speeds: np.ndarray
    expected: np.ndarray
    steered: np.ndarray
    at: np.ndarray
    turn: np.ndarray
    length: np.ndarray
    stiffness: np.ndarray
    sides: np.ndarray
    copied: np.ndarray
    keys: np.ndarray

    @classmethod
    def empty(cls, legs: int) -> 'GaitTables':
        """Return tables with empty slots."""
        progress, table = (MAX_GAITS, NUM_PHASES, legs), (MAX_GAITS, MAX_ROWS)
        return cls(np.zeros(progress, dtype=bool), np.zeros(progress), np.ones((MAX_GAITS, legs)),
                   np.ones(MAX_GAITS), np.zeros(MAX_GAITS), np.ones(MAX_GAITS),
                   np.zeros((MAX_GAITS, SPEEDS)), np.zeros((MAX_GAITS, SPEEDS, BINS, SIGNALS)),
                   np.zeros(MAX_GAITS, dtype=bool), np.zeros(table),
                   np.ones(table), np.ones(table), np.ones(table), np.zeros(legs),
                   np.zeros(MAX_GAITS, dtype=bool), np.zeros(MAX_GAITS, dtype=np.int64))

    def fill(self, slot: int, timetable: Timetable, expected: EfferenceCopy, plan: GaitPlan
             ) -> None:
        """Fill the slot of a gait.

        Raises:
            InputError: its tables have more rows than fit.

        """
        self.swinging[slot], self.progress[slot] = timetable.swinging, timetable.progress
        self.duty[slot] = 1.0 - timetable.swinging.mean(axis=0)
        self.stance[slot] = self.duty[slot].mean() / plan.frequency
        self.one_by_one[slot] = (timetable.swinging.sum(axis=1) <= 1).mean() > 0.5
        self.alternates[slot] = not timetable.hops
        self.speeds[slot] = _filled(expected.speeds, SPEEDS, 'an efference copy')
        self.expected[slot] = _filled(expected.table, SPEEDS, 'an efference copy')
        self.copied[slot] = plan.motion.efference is not None
        self.keys[slot] = ctypes.addressof(plan.core.struct)
        steering = plan.motion.steering
        self.steered[slot] = steering is not None
        self.stiffness[slot] = 1.0
        if steering is not None:
            for part, column in ((self.at, steering.speed), (self.turn, steering.turn),
                                 (self.length, steering.stride),
                                 (self.stiffness, steering.stiffness or (1.0,))):
                part[slot] = _filled(np.array(column), MAX_ROWS, 'a steering table')
            self.sides[:] = np.where(plan.robot.left, -0.5, 0.5)


def _filled(rows: np.ndarray, size: int, what: str) -> np.ndarray:
    """Repeat the last row up to a size."""
    if not 1 <= len(rows) <= size:
        raise InputError(f'{what} has {len(rows)} speeds: feedback takes 1 to {size}')
    return np.concatenate([rows, np.repeat(rows[-1:], size - len(rows), axis=0)])
