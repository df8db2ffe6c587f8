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

"""Feedback of a biped that stands, walks, runs and hops on the clock of a network."""

from collections.abc import Callable
import ctypes

from cpg_ros.common.errors import InputError
from cpg_ros.dynamics.integration.compilation import specialised
from cpg_ros.feedback.biped.gains import BipedGains, BipedMemory, GAIT
from cpg_ros.feedback.biped.links import links_of
from cpg_ros.feedback.biped.modes import (
    advance,
    BipedArrays,
    NUM_SLOTS,
    ServoArrays,
    STATE,
    STOP_SLOT,
)
from cpg_ros.feedback.biped.stepping import HOPS, RUNS, WALKS
from cpg_ros.feedback.biped.support import Arms
from cpg_ros.feedback.estimate import SensorData
from cpg_ros.motion.core import core
from cpg_ros.motion.pattern import GaitRunner
from cpg_ros.motion.plan import GaitPlan, plan_gait
from cpg_ros.motion.robot import Robot
from cpg_ros.networks.registry import NETWORKS
import numpy as np

#: KINDS: gait -> how its legs go, for all gaits that the laws can balance.
KINDS = {'walk': WALKS, 'run': RUNS, 'two_legged_hop': HOPS, 'two_legged_jump': HOPS}
WALK_GAIT = 'walk'


def gait_plan(robot: Robot, gait: str) -> GaitPlan:
    """Return a gait at the frequency that a robot's feedback has for it.

    Raises:
        InputError: no law is for it, the network does not have it, or the robot has no soles.
        PlanError: it cannot be run.

    """
    presets = NETWORKS[robot.networks[0]].presets()
    if gait not in KINDS or gait not in presets or robot.biped is None:
        raise InputError(f"'{robot.name}' cannot be balanced in the gait '{gait}', only in "
                         + ', '.join(KINDS))
    return plan_gait(robot, gait, BipedGains.of_body(robot.biped, gait).frequency)


def addresses(*functions: str) -> np.ndarray:
    """Return the addresses of functions of the pattern's core, shape (functions,)."""
    return np.array([ctypes.cast(getattr(core(), name), ctypes.c_void_p).value
                     for name in functions], dtype=np.int64)


class BipedFeedback:
    """Balance of one biped with soles; a tick allocates nothing.

    Walk and run change into one another in the middle of a stance, where the body rises no more
    and falls no more, a run once it is slow enough for a walk. Whatever else changes does so on
    two feet. Speeds forward are held to those of the gait in force and of the gait wanted.

    Attributes:
        robot: whose feedback it is.
        biped: data for compiled code, changed by it.
        state: modes.STATE: the mode, and how often the network left its orbit (faults).
        memory: gains.LAWS: state of the laws.
        pose: of the links.
        arms: targets of the joints that belong to no leg.
        order: names of the joints in the order of the sensors and links.
        runners: the network in each place among the gaits, None where there is none.

    """

    def __init__(self, robot: Robot, plan: GaitPlan | None = None) -> None:
        """Prepare to stand.

        Args:
            robot: whose robot file has the part ``biped``.
            plan: gait whose orbit is the clock; the walk of the robot's first network if not
                given.

        Raises:
            InputError: the robot file has no such part, bad gains, or no law is for the gait.
            PlanError: the gait cannot be run.

        """
        links, body = links_of(robot), robot.biped
        if body is None or len(robot.legs) != 2:
            raise InputError(f"robot '{robot.name}' has no two legs with soles")
        self.robot, self.order = robot, list(body.links)
        self._gains = {gait: BipedGains.of_body(body, gait) for gait in KINDS}
        walk = gait_plan(robot, WALK_GAIT)
        plan = plan or walk
        if plan.gait not in KINDS:
            raise InputError(f"a biped cannot be balanced in the gait '{plan.gait}', only in "
                             + ', '.join(KINDS))
        rows = np.array([self.order.index(name) for name in robot.order])
        chained = (links.chains - 1).ravel().tolist()
        kp, effort = np.array([(body.links[name].kp, body.links[name].effort)
                               for name in robot.order]).T.copy()
        servos = ServoArrays(rows, np.array([chained.index(row) for row in rows]), kp, effort,
                             *np.zeros((2, len(rows))))
        state, gaits = (np.zeros(size, kind).view(np.recarray)
                        for size, kind in ((1, STATE), (NUM_SLOTS, GAIT)))
        self.biped = BipedArrays(links, gaits, Arms.of(robot, NUM_SLOTS), servos,
                                 addresses('cpg_track_advance', 'cpg_track_reseed'),
                                 BipedMemory.empty(links), np.zeros((2, 3)), state)
        self.state, self.arms = state[0], self.biped.arms
        self.pose, self.memory = self.biped.memory.pose, self.biped.memory.laws[0]
        self.runners: list[GaitRunner | None] = [None] * NUM_SLOTS
        self._put(STOP_SLOT, GaitRunner(walk, 0.0))
        self._put(STOP_SLOT + 1, GaitRunner(plan, 0.0))
        self.state.gait = self.state.goal = self.state.requested = STOP_SLOT + 1
        self._advance: Callable | None = None

    @property
    def track(self) -> GaitRunner:
        """The network in force, whose orbit is the clock."""
        track = self.runners[self.state.gait]
        assert track is not None
        return track

    @property
    def wanted(self) -> GaitRunner:
        """The network of the gait that is wanted."""
        track = self.runners[self.state.requested]
        assert track is not None
        return track

    @property
    def plan(self) -> GaitPlan:
        """The gait in force."""
        return self.track.plan

    @property
    def gains(self) -> np.record:
        """Gains of the laws in the gait in force, by name."""
        return self.biped.gaits[self.state.gait]

    @property
    def changing(self) -> bool:
        """Whether a change to another gait is pending."""
        return bool(self.state.gait != self.state.requested)

    def walk(self, forward: float, left: float = 0.0, turn: float = 0.0) -> None:
        """Walk at this velocity, m/s, and yaw rate, rad/s."""
        self.biped.velocities[0] = forward, left, turn
        self.state.walks = True

    def stand(self) -> None:
        """Stop, and stand on both legs as soon as the body is slow enough."""
        self.biped.velocities[0] = 0.0
        self.state.walks = False

    def set_gains(self, gait: str, gains: BipedGains) -> None:
        """Replace the gains of a gait but its frequency, which is the plan's."""
        self._gains[gait] = gains
        for slot, track in enumerate(self.runners):
            if track is not None and track.plan.gait == gait:
                self._fill(slot, track)

    def set_gait(self, track: GaitRunner) -> None:
        """Change to the gait of a network that has not moved yet, at its frequency.

        Raises:
            KeyError: no law is for its gait.

        """
        state = self.state
        slot = min({*range(NUM_SLOTS)} - {STOP_SLOT, state.gait, state.goal, state.requested})
        self._put(slot, track)
        state.requested = slot

    def _put(self, slot: int, track: GaitRunner) -> None:
        """Put a network at a place among the gaits that is not in use."""
        self.runners[slot] = track
        self._fill(slot, track)
        self.arms.learn(slot, track.plan)

    def _fill(self, slot: int, track: GaitRunner) -> None:
        plan = track.plan
        gains = self._gains[plan.gait]._replace(frequency=plan.frequency)
        self.biped.gaits[slot] = (*gains, *plan.speeds, KINDS[plan.gait],
                                  list(KINDS).index(plan.gait), track.address)

    def advance(self, sensors: SensorData, dt: float) -> np.ndarray:
        """Return the target angles of the joints, rad, shape (joints,), in ``robot.order``.

        Args:
            sensors: of one run, joints by ``order``.
            dt: since the last time, s.

        """
        if self._advance is None:
            self._advance = specialised(advance, self.biped, sensors, dt)
        self._advance(self.biped, sensors, dt)
        return self.biped.servos.positions
