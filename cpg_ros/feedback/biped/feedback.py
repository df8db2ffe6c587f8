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

"""A biped that stands, walks, runs and hops by a network's clock: sensors in, positions out."""

from collections.abc import Callable
import math

from cpg_ros.common.errors import InputError
from cpg_ros.dynamics.integration.compilation import specialised
from cpg_ros.feedback.biped.gains import BipedGains, BipedMemory, SHIFT, STAND, WALK
from cpg_ros.feedback.biped.links import links_of
from cpg_ros.feedback.biped.stepping import HOPS, RUNS, WALKS
from cpg_ros.feedback.biped.support import Arms
from cpg_ros.feedback.biped.tick import tick
from cpg_ros.feedback.estimate import SensorData
from cpg_ros.motion.pattern import GaitRunner
from cpg_ros.motion.plan import GaitPlan, plan_gait
from cpg_ros.motion.robot import Robot
from cpg_ros.networks.registry import NETWORKS
import numpy as np

#: SHIFTING: duration of the shift of the weight to the second foot before the first step, s;
#: FIRST_STEP: time from the begin of the shift to the first step, s.
SHIFTING, FIRST_STEP = 0.8, 1.0
#: RISING: speed at which a crouching robot stands up, m/s.
RISING = 0.2
#: A walk ends on two feet when the centre of mass is slower than twice STILL, m/s, and the error
#: of the capture point is below CAUGHT, m.
STILL, CAUGHT = 0.15, 0.05
#: SLOWED: speed at which a run may become a walk, as a multiple of the fastest walk.
SLOWED = 1.2
#: KINDS: gait -> how its legs go, for all gaits that the laws can balance.
KINDS = {'walk': WALKS, 'run': RUNS, 'two_legged_hop': HOPS, 'two_legged_jump': HOPS}
WALK_GAIT = 'walk'
#: STARTS: kind of gait -> phase of the first leg's flexor, cycles, at which it begins.
STARTS = {WALKS: 0.75, RUNS: 0.0, HOPS: 0.5}


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


class BipedFeedback:
    """Balance of one biped with soles; a tick allocates nothing but what the network's clock does.

    Walk and run change into one another in the middle of a stance, where the body rises no more
    and falls no more, a run once it is slow enough for a walk. Whatever else changes does so on
    two feet. Speeds forward are held to those of the gait in force and of the gait wanted.

    Attributes:
        robot: whose feedback it is.
        links: of the robot.
        gains: of the laws in the gait that is in force.
        memory: state and output of the laws.
        mode: STAND, SHIFT or WALK.
        order: names of the joints in the order of the sensors and links.
        rows: place of each joint of ``robot.order`` in that order, shape (joints,).
        track: the network in force, whose orbit is the clock.
        arms: where the joints that are no leg's are to be driven.
        command: speeds forward and to the left, m/s, and rate of turning, rad/s, that the gait in
            force is to have.
        faults: how often the network left its orbit and was put back.
        torques: wanted of the joints in ``robot.order``, N m, within what their servos can,
            shape (joints,).
        positions: the same as targets of servos, rad.

    """

    def __init__(self, robot: Robot, gains: BipedGains | None = None,
                 plan: GaitPlan | None = None) -> None:
        """Prepare to stand.

        Args:
            robot: whose robot file has the part ``biped``.
            gains: of the laws in the plan's gait; the robot file's if not given.
            plan: gait whose orbit is the clock; the walk of the robot's first network if not
                given.

        Raises:
            InputError: the robot file has no such part, bad gains, or no law is for the gait.
            PlanError: the gait cannot be run.

        """
        self.robot, self.links = robot, links_of(robot)
        biped = robot.biped
        if biped is None or len(robot.legs) != 2:
            raise InputError(f"robot '{robot.name}' has no two legs with soles")
        self._gains = {gait: BipedGains.of_body(biped, gait) for gait in KINDS}
        walk = gait_plan(robot, WALK_GAIT)
        plan = plan or walk
        if plan.gait not in KINDS:
            raise InputError(f"a biped cannot be balanced in the gait '{plan.gait}', only in "
                             + ', '.join(KINDS))
        if gains is not None:
            self._gains[plan.gait] = gains
        else:
            self._set_frequency(plan)
        self.gains = self._gains[plan.gait]
        #: The wanted gait, the gait in force, and a walk with which to stop.
        self._goal = self.track = GaitRunner(plan, 0.0)
        self._walk, self.faults = GaitRunner(walk, 0.0), 0
        self.arms = Arms(robot)
        self.arms.follow(plan)
        self.memory, self.mode = BipedMemory.empty(self.links), STAND
        self.order = list(biped.links)
        self.rows = np.array([self.order.index(name) for name in robot.order])
        # Their places among the legs' torques.
        chained = (self.links.chains - 1).ravel().tolist()
        self._places = np.array([chained.index(row) for row in self.rows])
        self._kp, self._effort = np.array([
            (biped.links[name].kp, biped.links[name].effort) for name in robot.order]).T.copy()
        self.torques, self.positions = np.zeros((2, len(robot.order)))
        self._asked, self._walks, self.command = np.zeros(3), False, np.zeros(3)
        self._time = 0.0
        self._ready = False
        self._before = np.zeros(2)
        self._tick: Callable | None = None
        self._bound: BipedGains | None = None

    @property
    def plan(self) -> GaitPlan:
        """The gait in force."""
        return self.track.plan

    @property
    def kind(self) -> int:
        """Kind of its gait: WALKS, RUNS or HOPS."""
        return KINDS[self.plan.gait]

    @property
    def changing(self) -> bool:
        """Whether another gait than that in force is wanted."""
        return self.track is not self._goal

    def restart(self, crouch: float = 0.0) -> None:
        """Stand with an empty memory, as after a fall.

        Args:
            crouch: how much lower the centre of mass is now, m; it rises from there.

        """
        self.memory, self.mode = BipedMemory.empty(self.links), STAND
        self.memory.crouch[0] = crouch
        self._time, self._ready = 0.0, False

    def walk(self, forward: float, left: float = 0.0, turn: float = 0.0) -> None:
        """Go with this velocity, m/s, and rate of turning, rad/s, from now on."""
        self._asked[:] = forward, left, turn
        self._walks = True

    def stand(self) -> None:
        """Stop, and stand on both legs as soon as the body is slow enough."""
        self._asked[:] = 0.0
        self._walks = False

    def set_gains(self, gait: str, gains: BipedGains) -> None:
        """Replace the gains of a gait but its frequency, which is the plan's."""
        self._gains[gait] = gains._replace(frequency=self._gains[gait].frequency)
        if gait == self.plan.gait:
            self.gains = self._gains[gait]

    def follow(self, track: GaitRunner) -> None:
        """Change to the gait of a network that has not moved yet, at its frequency.

        Raises:
            KeyError: no law is for its gait.

        """
        gait, same = track.plan.gait, self.track is self._goal
        self._goal = track
        self._set_frequency(track.plan)
        if gait == self.plan.gait and same:
            track.reseed(self.track.phase)
            self._adopt(track)

    def advance(self, sensors: SensorData, dt: float) -> np.ndarray:
        """Return where the servos are to be driven, rad, shape (joints,), by ``robot.order``.

        Args:
            sensors: of one run, joints by ``order``.
            dt: since the last time, s.

        """
        memory = self.memory
        if not self._ready:
            memory.heading[0] = sensors.rpy[0, 2]
            self._ready = True
        self._choose(dt)
        step = dt, min(self._time / SHIFTING, 1.0), self.kind
        self._limit()
        arguments = (self.links, self.gains, memory, sensors, self.command, self.mode, step)
        if self._tick is None or self._bound is not self.gains:
            self._tick, self._bound = specialised(tick, *arguments), self.gains
        self._tick(*arguments)
        if self.mode == WALK:
            quick, leap = memory.clock
            if not self.track.advance(leap + quick * self.gains.frequency * dt):
                self.faults += 1
                self.track.reseed()
        # In a run the same swing costs more than it saves.
        self.arms.advance(dt, self.mode == WALK and self.kind == WALKS, self.track.stepper.now[0])
        np.take(memory.torque, self._places, out=self.torques)
        np.clip(self.torques, -self._effort, self._effort, out=self.torques)
        np.divide(self.torques, self._kp, out=self.positions)
        self.positions += sensors.joint_positions[0, self.rows]
        return self.positions

    def _limit(self) -> None:
        """Fill the velocity requested of the gait in force, which may be changing to another."""
        if self._stops:
            self.command[:] = 0.0
            return
        (slow, fast), (slowest, fastest) = self.plan.speeds, self._goal.plan.speeds
        self.command[:] = self._asked
        self.command[0] = min(max(self._asked[0], slow, slowest), fast, fastest)

    def _set_frequency(self, plan: GaitPlan) -> None:
        self._gains[plan.gait] = self._gains[plan.gait]._replace(frequency=plan.frequency)

    def _adopt(self, track: GaitRunner) -> None:
        self.track = track
        self.arms.follow(track.plan)
        self.gains = self._gains[track.plan.gait]

    @property
    def _stops(self) -> bool:
        """Whether it has to come to a stand, at a request or to change the gait."""
        target = KINDS[self._goal.plan.gait]
        return not self._walks or (self.changing and HOPS in (target, self.kind))

    def _choose(self, dt: float) -> None:
        """Change mode and gait when it is time, and read the clock."""
        memory = self.memory
        if self.mode == WALK:
            half = 0.5 * (1.0 - self.gains.duty)
            self._before[:] = memory.phases
            np.mod(self.track.legs + half, 1.0, out=memory.phases)
            if self._stops and self._ends(half):
                self.mode, self._time = STAND, 0.0
            elif self.kind != HOPS:
                self._change(half)
            return
        self._time += dt
        crouch = memory.crouch
        crouch[0] = max(0.0, crouch[0] - RISING * dt)
        if self.mode == STAND and self.changing:
            self._adopt(self._goal)
        if not self._walks:
            self.mode, self._time = STAND, 0.0
        elif self.mode == STAND:
            if not crouch[0]:
                self.mode, self._time = SHIFT, 0.0
        elif self._time >= FIRST_STEP:
            self._start()

    def _ends(self, half: float) -> bool:
        """Return whether to stand now: in a walk once it is slow, in a hop at the bottom."""
        memory = self.memory
        if self.kind == HOPS:
            return bool(self._before[0] < half + 0.5 <= memory.phases[0])
        both = not memory.swinging.any() and bool((memory.fractions > 0.0).all())
        return (self.kind == WALKS and both and np.abs(memory.wanted).max() < 1e-6
                and np.abs(memory.center[1, :2]).max() < 2.0 * STILL
                and np.abs(memory.dcm_error).max() < CAUGHT)

    def _change(self, half: float) -> None:
        """Change between walk and run where a leg is in the middle of its swing."""
        memory, target = self.memory, self._goal
        if self._stops:
            target = self._walk if self.kind == RUNS else self.track
        if target is self.track or KINDS[target.plan.gait] == HOPS:
            return
        if self.kind == RUNS:
            velocity, heading = memory.center[1], memory.heading[0]
            forward = velocity[0] * math.cos(heading) + velocity[1] * math.sin(heading)
            if forward > SLOWED * target.plan.speeds[1]:
                return
        for leg in range(2):
            if memory.swinging[leg] and self._before[leg] < half <= memory.phases[leg]:
                # There its flexor peaks, in any gait; swings begin from the other sole in a walk.
                sign = 1.0 if self.kind == WALKS else -1.0
                memory.lift_off[leg] += sign * memory.pose.soles[1 - leg]
                memory.ground[0] = memory.pose.soles[1 - leg, 2]
                target.reseed(0.5 * leg)
                self._adopt(target)
                half = 0.5 * (1.0 - self.gains.duty)
                np.mod(target.legs + half, 1.0, out=memory.phases)
                memory.clock[:] = 1.0, 0.0
                return

    def _start(self) -> None:
        """Start the clock.

        A walk begins in the middle of both feet's stance, before the first one lifts off, a run
        in the middle of the second foot's, a hop in that of both.
        """
        memory, self.mode = self.memory, WALK
        memory.wanted[:] = memory.integral[:] = 0.0
        memory.clock[:] = 1.0, 0.0
        memory.lift_off[:] = memory.pose.soles
        memory.ground[0] = memory.pose.soles[:, 2].mean()
        self.track.reseed(STARTS[self.kind])
        self._choose(0.0)
