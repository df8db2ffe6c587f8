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

"""A first robot from a description: its stand by inverse kinematics, and small steps.

Nothing depends on the joints' zeros, signs or names: a leg is bent, in a vertical plane and in the
direction that its limits allow, until its foot is below its hip.
"""

from dataclasses import dataclass, replace
from math import inf, pi

from cpg_ros.fitting.gaits.leg_names import Legs
from cpg_ros.motion.description import (
    DescriptionError,
    JointDescription,
    LegChain,
    outward,
    RobotDescription,
    sprawls,
)
from cpg_ros.motion.plan import plan_gait
from cpg_ros.motion.robot import Joint, NUM_HARMONICS, Robot
from cpg_ros.motion.robot_file import LIMITS
from cpg_ros.networks.registry import NETWORKS, numbered
from cpg_ros.simulation.robot_setup.description_match import sole_up, unlimited
import numpy as np
from scipy.optimize import least_squares

#: Height of the stand over the length of the stretched leg. BIPED_HEIGHT: on two legs, to the
#: ankle; CROUCH_HEIGHT: on more.
BIPED_HEIGHT, CROUCH_HEIGHT = 0.97, 0.765
#: Angles in the stand of a leg that reaches to the side, rad. FEMUR_PITCH: femur above level;
#: TIBIA_PITCH: tibia below level.
FEMUR_PITCH, TIBIA_PITCH = 0.4, 1.3
#: Initial amplitudes of feet over the height of the stand. SWING_AMPLITUDE: forward;
#: LIFT_AMPLITUDES: upward, on two legs and on more.
SWING_AMPLITUDE, LIFT_AMPLITUDES = 0.15, (0.02, 0.06)
#: Limits of joints that have none. MAX_ANGLE: of the angle, rad; SPEED: of the speed, rad/s.
MAX_ANGLE, SPEED = pi, 20.0
#: LIMIT_MARGIN: least distance of the stand from a joint's limits, as a fraction of its range;
#: MAX_USE: largest fraction of the room to the limits that gaits use.
LIMIT_MARGIN, MAX_USE = 0.1, 0.8
#: NUM_STARTS: poses from which a stand is searched; MIDDLE_WEIGHT: of the distance from the middle
#: of the joints' ranges; REVERSED_COST, STRAIGHT_COST: of a knee bent the unusual way or not.
NUM_STARTS, MIDDLE_WEIGHT, REVERSED_COST, STRAIGHT_COST = 8, 1e-3, 0.3, 1.0
#: START_RANGE: width of the ranges from which the first of them are drawn, rad.
START_RANGE = 1.5
#: COST_TOLERANCE: price of a stand up to which no other is searched.
COST_TOLERANCE = 1e-5
#: MIN_BEND: least distance of a bent knee from the line from hip to foot, over the leg's length.
MIN_BEND = 0.03


def robot_from(model: RobotDescription, name: str, legs: Legs) -> tuple[Robot, str]:
    """Make a first robot from a description; return it and the roles of its joints.

    Args:
        model: the description.
        name: of the robot.
        legs: its legs, as of ``legs_in``.

    Raises:
        DescriptionError: the links make no tree, a leg cannot be bent, a joint has no room to
            move, or two legs do not have five or six joints.

    """
    counts = {len(legs[leg]) for leg in legs}
    if len(legs) == 2 and not counts <= {5, 6}:
        first = next(legs[leg] for leg in legs)
        raise DescriptionError(
            f'legs of {len(first)} joints ({", ".join(first)}): on two legs a robot needs five '
            'or six in each, to step aside and to keep its soles level')
    usual = {kind.name: next(iter(kind.legs.items())) for kind in numbered(len(legs))}
    assignment, cells = next(entry for entry in usual.values() if set(entry[1]) == set(legs))
    networks = tuple(name for name, entry in usual.items() if entry == (assignment, cells))
    standing = {leg: _StandingLeg.of(model, legs, leg) for leg in legs}
    # All feet are on one level.
    ground = float(np.mean([leg.ground for leg in standing.values()]))
    joints, notes = {}, []
    for leg, leg_model in standing.items():
        angles = leg_model.angles(ground)
        weights, roles = leg_model.steps(angles, len(legs))
        by_name = dict(zip(leg_model.chain.joints, zip(angles.tolist(), weights, strict=True),
                           strict=True))
        joints[leg] = tuple(
            Joint(joint, leg, cells[leg][0], *by_name[joint], *_range(model.joints[joint]),
                  SPEED if model.joints[joint].velocity == inf else model.joints[joint].velocity,
                  tuple(key for key in LIMITS if abs(getattr(model.joints[joint], key)) == inf))
            for joint in legs[leg])
        notes.append(f'{leg}: ' + ', '.join(
            f'{joint} {role}' for joint, role in zip(leg_model.chain.joints, roles, strict=True)))
    driven = {joint for leg in legs for joint in legs[leg]}
    robot = Robot(name, networks, assignment, NUM_HARMONICS, joints,
                  tuple(joint for joint in model.joints if joint in driven))
    return _fitting(robot), '\n'.join([*notes, *([legs.explanation] if legs.explanation else [])])


def _range(joint: JointDescription) -> tuple[float, float]:
    lower, upper = max(joint.lower, -MAX_ANGLE), min(joint.upper, MAX_ANGLE)
    if upper - lower < 0.01:
        raise DescriptionError(f"the joint '{joint.name}' has no room to move: its limits are "
                               f'{joint.lower:g} to {joint.upper:g} rad')
    return lower, upper


@dataclass(frozen=True, eq=False)
class _StandingLeg:
    """A leg in the stand.

    Attributes:
        chain: its joints.
        low, high: limits of the angles, rad, shape (joints,).
        bend: index of the first of the two joints that bend it.
        top: index of the joint below which its foot, or its ankle, is placed.
        end: of the foot, or of the ankle of a leg with a sole, among the points of the chain.
        sole: upward direction at the sole with all joints at 0, None if it need not be level.
        aside: of a leg that reaches to the side, where femur and tibia end, m, else None.
        biped: whether it is one of two.

    """

    chain: LegChain
    low: np.ndarray
    high: np.ndarray
    bend: int
    top: int
    end: int
    sole: np.ndarray | None
    aside: np.ndarray | None
    biped: bool

    @classmethod
    def of(cls, model: RobotDescription, legs: Legs, leg: str) -> '_StandingLeg':
        """Return a leg of a description; errors as of ``robot_from``."""
        chain = model.leg(legs[leg])
        low, high = np.array([_range(model.joints[name]) for name in chain.joints]).T
        low, high = low + LIMIT_MARGIN * (high - low), high - LIMIT_MARGIN * (high - low)
        axes, points, _ = chain.posed(0.5 * (low + high))
        pairs = [k for k in range(len(axes) - 1) if abs(axes[k] @ axes[k + 1]) > 0.99
                 and np.linalg.norm(points[k + 1] - points[k]) > MIN_BEND * sum(chain.lengths)
                 and (k or abs(axes[k, 2]) < 0.7)]
        biped, count = len(legs) == 2, len(axes)
        if not pairs or (chain.lengths[-1] < 1e-3 and not biped):
            why = ('no two joints in a row have parallel axes, as hip pitch and knee must: such '
                   'a leg is not supported'
                   if not pairs else f'the position of the foot below {chain.joints[-1]} is '
                   'unknown: give its link a <collision> shape, or install the package of its '
                   'meshes')
            raise DescriptionError(f'leg {leg} ({", ".join(chain.joints)}): {why}')
        bend, aside, end = pairs[0], None, count
        # Or the leg swings about y, and is bent to the side.
        if sprawls(axes[max(bend - 1, 0):bend + 2]) or (
                bend and abs(axes[bend, 0]) > 0.9 and abs(axes[bend - 1, 1]) > 0.9):
            out = np.array([*outward(axes[bend], points[-1] - points[0]), 0.0])
            femur, tibia = (np.linalg.norm(points[b] - points[a])
                            for a, b in ((bend, bend + 1), (bend + 1, count)))
            aside = points[bend] + femur * (
                np.cos(FEMUR_PITCH) * out + [0.0, 0.0, np.sin(FEMUR_PITCH)])
            aside += tibia * (np.cos(TIBIA_PITCH) * out - [0.0, 0.0, np.sin(TIBIA_PITCH)])
        level = bend + 2 < count and aside is None
        if level:
            # The ankle, where it pitches: the last of the parallel joints.
            end = bend + 1
            while end + 1 < count and abs(axes[end] @ axes[end + 1]) > 0.99:
                end += 1
        # Where only knee and ankle are in a row, the hip that pitches is further up.
        hips = range(bend if end == bend + 1 else min(bend, 1))
        top = next((k for k in hips if abs(chain.axes[k, 1]) > 0.7), bend)
        return cls(chain, low, high, bend, top, end,
                   sole_up(model, chain.joints[-1]) if level else None, aside, biped)

    @property
    def height(self) -> float:
        """Height of the hip above the foot or ankle, m."""
        return (BIPED_HEIGHT if self.biped else CROUCH_HEIGHT) * float(sum(
            self.chain.lengths[self.top:self.end]))

    @property
    def ground(self) -> float:
        """Height of the ground that this leg would choose, m upward from the base."""
        if self.aside is not None:
            return float(self.aside[2])
        points = self.chain.posed(0.5 * (self.low + self.high))[1]
        return float(points[self.top, 2]) - self.height

    def angles(self, ground: float) -> np.ndarray:
        """Return the stand with the foot, or the ankle, at a height, rad, shape (joints,)."""
        middle, length = 0.5 * (self.low + self.high), float(sum(self.chain.lengths))
        wide = self.high - self.low
        draws = np.random.default_rng(0).uniform(0.1, 0.9, (NUM_STARTS - 1, len(middle)))
        # Of joints that turn almost anywhere, first a part of the range.
        width = np.where(np.arange(NUM_STARTS - 1)[:, None] < NUM_STARTS // 2,
                         np.minimum(wide, START_RANGE), wide)

        def off(angles: np.ndarray) -> np.ndarray:
            axes, points, frame = self.chain.posed(angles)
            rest = MIDDLE_WEIGHT * (angles - middle) / wide
            if self.aside is not None:
                return np.array([*(points[-1] - [*self.aside[:2], ground]) / length, *rest])
            down = (points[self.end] - points[self.top]) / length
            tilt = [] if self.sole is None else frame @ self.sole - [0.0, 0.0, 1.0]
            return np.array([down[0], (points[self.end, 2] - ground) / length,
                             *axes[self.bend, ::2], *tilt, *rest])

        best, price = middle, inf
        for start in (middle, *(middle + (draws - 0.5) * width)):
            if price > COST_TOLERANCE:
                solution = least_squares(off, start, bounds=(self.low, self.high), x_scale=wide)
                if (cost := 2.0 * float(solution.cost) + self._way(solution.x)) < price:
                    best, price = solution.x, cost
        return np.clip(np.round(best, 3), self.low, self.high) + 0.0

    def _way(self, angles: np.ndarray) -> float:
        """Return the cost of a knee on this side: less behind, or on two legs in front."""
        if self.aside is not None:
            return 0.0
        points = self.chain.posed(angles)[1]
        hip, foot = points[self.top], points[self.end]
        knees = points[self.top + 1:self.end]
        fractions = (knees[:, 2] - hip[2]) / min(foot[2] - hip[2], -1e-9)
        bulges = knees[:, 0] - hip[0] - fractions * (foot[0] - hip[0])
        bulge = float(bulges[np.abs(bulges).argmax()]) * (1.0 if self.biped else -1.0)
        needed = MIN_BEND * float(sum(self.chain.lengths[self.top:self.end]))
        return 0.0 if bulge > needed else REVERSED_COST if bulge < -needed else STRAIGHT_COST

    def steps(self, angles: np.ndarray, legs: int) -> tuple[list[tuple[float, ...]], list[str]]:
        """Return weights that swing the foot forward and up, rad, and the role of each joint."""
        axes, points, _ = self.chain.posed(angles)
        slopes = np.cross(axes, points[self.end] - points[:-1])
        if self.aside is not None:
            moved = [max(self.bend - 1, 0), self.bend, self.bend + 1]
            task = slopes[moved].T
        else:
            moved = ([k for k in range(len(axes)) if abs(axes[k, 1]) > 0.7]
                     if self.sole is not None else [self.bend, self.bend + 1])
            # Forward, upward, and the pitch of a sole that stays level.
            task = np.column_stack([slopes[:, [0, 2]], axes[:, 1]])[moved].T[
                :3 if self.sole is not None else 2]
        ways = np.zeros((len(task), 2))
        ways[0, 0] = SWING_AMPLITUDE * self.height
        ways[2 if self.aside is not None else 1, 1] = LIFT_AMPLITUDES[legs > 2] * self.height
        turned = np.linalg.lstsq(task, ways, rcond=1e-3)[0]
        weights: list[tuple[float, ...]] = [(0.0,)] * len(angles)
        roles = ['holds still'] * len(angles)
        for k, (swing, lift) in zip(moved, turned.tolist(), strict=True):
            weights[k] = (swing, lift)
            roles[k] = ('swings' if abs(swing) > abs(lift) or k == min(moved) else
                        'lifts' if self.aside is not None else
                        'keeps the foot level' if k > self.bend + 1 or k == self.end
                        else 'bends in swing')
        return weights, roles


def _fitting(robot: Robot) -> Robot:
    """Scale weights down to what all gaits allow at 1 Hz, all alike so that feet go straight."""
    low, high, fast = (robot.column(key) for key in ('lower', 'upper', 'velocity'))
    offset, fraction = robot.column('offset'), 1.0
    for network in robot.networks:
        for gait in NETWORKS[network].gaits():
            gait_plan = plan_gait(unlimited(robot), gait, 1.0, network=network)
            room = np.stack([offset - low, high - offset, fast])
            needed = np.stack([-gait_plan.span[0], gait_plan.span[1], gait_plan.speed])
            fraction = min(fraction, float((MAX_USE * room / np.maximum(needed, 1e-9)).min()))
    return replace(robot, legs={leg: tuple(replace(joint, weights=tuple(
        round(fraction * weight, 4) for weight in joint.weights))
        for joint in joints) for leg, joints in robot.legs.items()})
