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
from cpg_ros.feedback.biped.crouch import crouch_pose
from cpg_ros.feedback.biped.gains import BipedGains, BipedMemory, SHIFT, STAND, WALK
from cpg_ros.feedback.biped.links import links_of
from cpg_ros.feedback.biped.stepping import HOPS, RUNS, swing_share, WALKS
from cpg_ros.feedback.biped.substitutes import EXTRAPOLATED, IMU, JOINTS, Substitutes
from cpg_ros.feedback.biped.support import Arms
from cpg_ros.feedback.biped.tick import tick
from cpg_ros.feedback.estimate import SensorData
from cpg_ros.feedback.kinematics import GRAVITY
from cpg_ros.motion.pattern import GaitRunner, Pattern, smoothstep
from cpg_ros.motion.plan import GaitPlan, plan
from cpg_ros.motion.readout import confine
from cpg_ros.motion.robot import Robot
from cpg_ros.motion.strides import StrideCommand
from cpg_ros.networks.registry import NETWORKS
import numpy as np

#: Time in which the weight goes to the second foot before the first step, and until that, s.
SHIFTING, FIRST_STEP = 0.8, 1.0
#: With which a crouching robot stands up, m/s.
RISING = 0.2
#: At most this fast, m/s, and with this error of the capture point, m, a walk ends on two feet.
STILL, CAUGHT = 0.15, 0.05
#: A run slows down to this multiple of the fastest walk before it becomes one.
SLOWED = 1.2
#: How the legs go in the gaits that there are laws for.
KINDS = {'walk': WALKS, 'run': RUNS, 'two_legged_hop': HOPS, 'two_legged_jump': HOPS}
WALK_GAIT = 'walk'
#: Phase of the first leg's flexor, cycles, with which each kind begins.
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
    preset = presets[gait]
    return plan(robot, gait, preset, preset.network,
                BipedGains.of_body(robot.biped, gait).frequency)


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
            gains: of the laws in the program's gait; the robot file's if not given.
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
        #: What is wanted, what is in force, and a walk to stop with.
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
        """How its legs go: WALKS, RUNS or HOPS."""
        return KINDS[self.plan.gait]

    @property
    def changing(self) -> bool:
        """Whether another gait than that in force is wanted."""
        return self.track is not self._goal

    def restart(self, crouch: float = 0.0) -> None:
        """Stand, and know nothing of what has been, as after a fall.

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
        """Fill what is wished of the gait in force, which may be on its way to another."""
        if self._stops:
            self.command[:] = 0.0
            return
        (slow, fast), (slowest, fastest) = self.plan.speeds, self._goal.plan.speeds
        self.command[:] = self._asked
        self.command[0] = min(max(self._asked[0], slow, slowest), fast, fastest)

    def _set_frequency(self, plan: GaitPlan) -> None:
        known = self._gains[plan.gait]
        self._gains[plan.gait] = known._replace(frequency=plan.frequency)

    def _adopt(self, track: GaitRunner) -> None:
        self.track = track
        self.arms.follow(track.plan)
        self.gains = self._gains[track.plan.gait]

    @property
    def _stops(self) -> bool:
        """Whether it has to come to a stand, be it for another gait."""
        wanted = KINDS[self._goal.plan.gait]
        return not self._walks or (self.changing and HOPS in (wanted, self.kind))

    def _choose(self, dt: float) -> None:
        """Change mode and gait where it is time, and read the clock."""
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
                and np.abs(memory.error).max() < CAUGHT)

    def _change(self, half: float) -> None:
        """Change between walk and run where a leg is in the middle of its swing."""
        memory, wanted = self.memory, self._goal
        if self._stops:
            wanted = self._walk if self.kind == RUNS else self.track
        if wanted is self.track or KINDS[wanted.plan.gait] == HOPS:
            return
        if self.kind == RUNS:
            velocity, heading = memory.center[1], memory.heading[0]
            forward = velocity[0] * math.cos(heading) + velocity[1] * math.sin(heading)
            if forward > SLOWED * wanted.plan.speeds[1]:
                return
        for leg in range(2):
            if memory.swinging[leg] and self._before[leg] < half <= memory.phases[leg]:
                # There its flexor peaks, in any gait; swings begin from the other sole in a walk.
                sign = 1.0 if self.kind == WALKS else -1.0
                memory.lift_off[leg] += sign * memory.pose.soles[1 - leg]
                memory.ground[0] = memory.pose.soles[1 - leg, 2]
                wanted.reseed(0.5 * leg)
                self._adopt(wanted)
                half = 0.5 * (1.0 - self.gains.duty)
                np.mod(wanted.legs + half, 1.0, out=memory.phases)
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


# The pattern of a biped whose feedback bears it: joints go where balance wants them.

#: A base that leans more than this, rad, or a centre of mass lower than this share of its height
#: has fallen.
LEANS, LOW = 1.0, 0.6
#: It stands or crouches on its feet if the base leans less than this and no joint is further from
#: the pose, rad, and if the feet bear this share of the weight, all for this time, s.
UPRIGHT, CROUCHED, NEAR, BORNE, STEADY = 0.2, 0.5, 0.35, 0.4, 0.04
#: From where joints are into the stand, and into the crouch, s.
RETURN, LOWER = 0.3, 0.45
#: How long it stands before it crouches, and the longest time in which it comes to a stand once
#: an input has failed, s.
SETTLED, PATIENCE = 0.3, 4.0
#: Shares of a swing between which the body passes over the foot that stands: the best time to
#: crouch without any sensor.
PASSING = 0.38, 0.6
#: Inputs that failed count as valid again after this time, s.
GOOD = 0.3
#: Joints that move further than this from tick to tick, rad and rad/s, were moved by hand.
JUMP, FASTEST = 0.15, 40.0
#: From the angles that are held to those of the feedback, s.
TAKEOVER = 0.1
#: Fastest sideways, m/s, and fastest turn, rad/s.
ASIDE, TURN = 0.2, 0.5


class BalancedPattern(Pattern):
    """A pattern whose joints a biped's feedback moves.

    Without feedback it is the open-loop pattern. With it, it holds the stand's angles until the
    robot stands on its feet, then balances: it stands while disabled, and walks as wished while
    enabled. After a fall it holds the stand until somebody has put the robot on its feet. Limits
    of positions and speeds hold throughout; where the feedback begins or ends, the joints move on
    from where they are.

    A stand needs balance, a crouch does not. Where an input fails it stops with what substitutes
    it, and crouches; without inertial unit and joints it crouches in the middle of a step. Once
    all inputs are valid it stands up and goes on. Before the end it crouches, too, see ``lower``.

    Attributes:
        balance: the feedback, None for the open-loop pattern.
        sensors: what is measured now, joints in the feedback's order; None if that is not known.
        wish: speeds forward and to the left, m/s, and rate of turning, rad/s.
        balancing: whether the feedback bears the robot now.
        fallen: whether it fell, and has not been put on its feet yet.
        falls: how often it fell.
        ages: of inertial unit, joints and feet, s, shape (3,): those of the last valid values.
        failed: whether an input is out.
        refused: whether messages arrive, but none of an input has been valid yet.
        crouching: whether it holds the crouch or is on its way into it.

    """

    def __init__(self, plan: GaitPlan, ramp: float = 1.0, enabled: bool = True,
                 drive: StrideCommand | None = None) -> None:
        """Stand; arguments as of Pattern, but a drive has nothing to do here."""
        super().__init__(plan, ramp, enabled)
        self.balance: BipedFeedback | None = None
        self.sensors: SensorData | None = None
        self.wish = 0.0, 0.0, 0.0
        self.balancing, self.fallen, self.falls = False, False, 0
        self._stood, self._share = 0.0, 0.0
        self.ages, self.failed, self.refused, self.crouching = np.zeros(3), False, False, False
        self._good, self._blind = GOOD, False
        self._held, self._still = False, np.zeros_like(self._offset)
        self._start, self._pose = self._offset.copy(), self._offset
        self._time = self._waited = self._failing = 0.0
        self._lowers, self._known = False, False
        self._substitutes: Substitutes | None = None
        self._crouch, self._depth = self._offset, 0.0
        self._before: np.ndarray | None = None
        self._places = self.robot.places
        self._rest = np.array(list(self.robot.held.values()))
        self._arms: Arms | None = None

    def steer(self, stride: np.ndarray, pace: float) -> None:
        """Do nothing: feet are placed for the wished speed."""

    def apply(self, plan: GaitPlan, transition: float) -> None:
        """Change to a program; with feedback at once, whatever the transition."""
        if self.balance is None:
            super().apply(plan, transition)
        else:
            self._requests.append((plan, GaitRunner(plan, 0.0)))

    def attach(self, drive: StrideCommand) -> None:
        """Do nothing, likewise."""

    @property
    def level(self) -> float:
        """0 in the stand, 1 in the gait."""
        if self.balance is None:
            return self._ramp.level
        return 1.0 if self.balancing and self.balance.mode == WALK else 0.0

    @property
    def standing(self) -> bool:
        """Tell whether it is disabled and has come to a stand."""
        if self.balance is None:
            return super().standing
        if self._lowers and not self.fallen and (self.balancing or self._time < LOWER + SETTLED):
            return False
        return not (self.enabled or self.level or self._requests)

    @property
    def held_angles(self) -> np.ndarray:
        """Where joints of no leg are to be driven, rad, in the order of ``robot.held``."""
        return self._rest if self._arms is None else self._arms.positions

    @property
    def in_transition(self) -> bool:
        """Tell whether another gait is wanted than that in force."""
        return self.balance.changing if self.balance is not None else super().in_transition

    def restart(self, ramp: float, enabled: bool = True) -> None:
        """Begin anew, from where the joints are."""
        super().restart(ramp, enabled)
        self.balancing, self._stood = False, 0.0
        self.crouching = self._lowers = False

    def lower(self) -> bool:
        """Go into the crouch once it stands, and stay there: before the end of all commands.

        Returns:
            Whether it will: it balances, or did.

        """
        self._lowers = self.balance is not None and self._known and not self.fallen
        return self._lowers

    def release(self) -> None:
        """Forget the balance, as where the sensors are out: the stand's angles are held."""
        self.balancing, self._stood = False, 0.0

    def advance(self, dt: float) -> None:
        """Advance by dt in s and fill position, velocity and phases."""
        balance, sensors = self.balance, self.sensors
        if balance is None:
            if self._arms is not None:
                self._arms.advance(dt, False)
            if self._held or self.balancing:
                self._held = self.balancing = self.crouching = False
                self._wanted[:], self._rate[:] = self.position, 0.0
                self._absorption.begin()
            super().advance(dt)
            return
        if self._arms is not balance.arms:
            self._attach(balance)
        self._take(balance)
        self._good = 0.0 if self.failed else self._good + dt
        if sensors is not None:
            assert self._substitutes is not None
            sensors = self._substitutes.fill(sensors, self.ages, balance.memory, dt)
            self._watch(balance, sensors, dt)
        if self.balancing and self._gives_up(balance, sensors, dt):
            # First, as another thread may ask whether it has come to rest.
            self._time, self.crouching = 0.0, True
            self.release()
        if not self.balancing and not self.fallen and (
                self._lowers or (self.failed and (self._known or self.refused))):
            self.crouching = True
        wanted = None
        if self.balancing and sensors is not None:
            wanted = self._balanced(balance, sensors, dt)
        if wanted is None:
            wanted = self._hold(balance, dt)
        rate = (wanted - self.position) / dt if dt > 0.0 else self._still
        self.held += confine(wanted, rate, self._limits, dt, self.position, self.velocity,
                             self._behind) > 0

    def _attach(self, balance: BipedFeedback) -> None:
        self._arms = balance.arms
        self._substitutes = Substitutes(balance.links)
        self._crouch, self._depth = crouch_pose(self.robot, balance.links) or (self._offset, 0.0)

    def _gives_up(self, balance: BipedFeedback, sensors: SensorData | None, dt: float) -> bool:
        """Return whether to crouch now instead of balancing any longer."""
        if not (self._stops or self._lowers):
            self._waited = self._failing = 0.0
            self._blind = False
            return sensors is None
        self._failing += dt
        self._waited = self._waited + dt if balance.mode == STAND else 0.0
        self._blind = self._blind or min(self.ages[IMU], self.ages[JOINTS]) > EXTRAPOLATED
        return (sensors is None or self._waited > SETTLED
                or (self._stops and self._failing > PATIENCE)
                or (self._blind and (balance.mode != WALK or self._passes(balance))))

    @property
    def _stops(self) -> bool:
        """Whether an input is out, or was lately."""
        return self._good < GOOD

    @staticmethod
    def _passes(balance: BipedFeedback) -> bool:
        """Return whether the body is over the foot that stands."""
        memory, swing = balance.memory, swing_share(balance.gains)
        fractions = memory.phases[memory.swinging] / swing
        return bool(((fractions > PASSING[0]) & (fractions < PASSING[1])).any())

    def _balanced(self, balance: BipedFeedback, sensors: SensorData, dt: float
                  ) -> np.ndarray | None:
        """Return where balance wants the joints, rad; None if the robot has fallen."""
        if self.enabled and not (self._stops or self._lowers):
            forward, left, turn = self.wish
            balance.walk(forward, min(max(left, -ASIDE), ASIDE), min(max(turn, -TURN), TURN))
        else:
            balance.stand()
        if self._held:
            self._held = False
            self._start[:] = self.position
        wanted = balance.advance(sensors, dt)
        if not np.isfinite(wanted).all():
            self._fall()
            return None
        self.faults = balance.faults
        self._share = min(1.0, self._share + dt / TAKEOVER)
        start = self._start[self._places]
        self._wanted[self._places] = start + self._share * (wanted - start)
        height = balance.memory.center[0, 2] - balance.memory.pose.soles[:, 2].min()
        if height < LOW * (balance.gains.height - balance.memory.crouch[0]):
            self._fall()
        return self._wanted

    def _hold(self, balance: BipedFeedback, dt: float) -> np.ndarray:
        """Return the angles of the stand or the crouch, rad, or those on the way to them."""
        pose, duration = (self._crouch, LOWER) if self.crouching else (self._offset, RETURN)
        if not self._held or pose is not self._pose:
            self._held, self._pose, self._time = True, pose, 0.0
            self._start[:] = self.position
        self._time += dt
        balance.arms.advance(dt, False)
        return self._start + smoothstep(min(self._time / duration, 1.0))[0] * (pose - self._start)

    def _take(self, balance: BipedFeedback) -> None:
        """Take requests of other threads."""
        while self._requests:
            what, how = self._requests.popleft()
            if isinstance(what, bool):
                self.enabled = what
                self._ramp.go(float(what), how)
            else:
                balance.follow(how)
        self._tracks[:] = [balance.track]

    def _watch(self, balance: BipedFeedback, sensors: SensorData, dt: float) -> None:
        """Find out whether the robot has fallen, was moved, or stands on its feet again."""
        joints = sensors.joint_positions[0]
        lean = math.acos(min(max(math.cos(sensors.rpy[0, 0]) * math.cos(sensors.rpy[0, 1]),
                                 -1.0), 1.0))
        moved = (self._before is not None
                 and float(np.abs(joints - self._before).max()) > JUMP + FASTEST * dt)
        self._before = joints.copy()
        if self.balancing:
            if lean > LEANS:
                self._fall()
            elif moved:
                self.release()
            return
        if self._stops or self._lowers:
            self._stood = 0.0
            return
        off = np.abs(joints[balance.rows] - self._pose[self._places]).max()
        weight = GRAVITY * balance.links.masses.sum()
        stands = (lean < (CROUCHED if self.crouching else UPRIGHT) and off < NEAR
                  and sensors.foot_forces.sum() > BORNE * weight)
        self._stood = self._stood + dt if stands and not moved else 0.0
        if self._stood >= STEADY:
            balance.restart(self._depth if self.crouching else 0.0)
            self.balancing, self.fallen, self._share, self._known = True, False, 0.0, True
            self.crouching = False

    def _fall(self) -> None:
        self.release()
        self.crouching = False
        self.falls += 1
        self.fallen = True
