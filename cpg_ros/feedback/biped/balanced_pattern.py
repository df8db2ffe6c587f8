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

"""The pattern of a biped whose feedback bears it: joints go where balance wants them."""

from collections import deque
import math

from cpg_ros.feedback.biped.crouch import crouch_pose
from cpg_ros.feedback.biped.feedback import BipedFeedback
from cpg_ros.feedback.biped.gains import SHIFT, STAND, WALK
from cpg_ros.feedback.biped.stepping import swing_share, WALKS
from cpg_ros.feedback.biped.substitutes import (
    ADOPTED,
    EXTRAPOLATED,
    FEET,
    IMU,
    JOINTS,
    LastStride,
    Substitutes,
)
from cpg_ros.feedback.biped.support import Arms
from cpg_ros.feedback.estimate import SensorData
from cpg_ros.feedback.input_checks import GOOD
from cpg_ros.feedback.kinematics import GRAVITY
from cpg_ros.motion.core import confine
from cpg_ros.motion.pattern import GaitRunner, Pattern, SHORTEST
from cpg_ros.motion.plan import GaitPlan
from cpg_ros.motion.strides import smoothstep, StrideCommand
import numpy as np

#: LEANS: lean of the base, rad, above which the robot has fallen; LOW: height of the centre of
#: mass, as a share of the wanted one, below which it has fallen.
LEANS, LOW = 1.0, 0.6
#: The robot is on its feet, and balance begins, if all of these hold for a time of STEADY, s:
#: UPRIGHT: largest lean of the base, rad, in the stand; CROUCHED: the same in the crouch;
#: NEAR: largest distance of a joint from the pose, rad; BORNE: least share of the weight on the
#: feet.
UPRIGHT, CROUCHED, NEAR, BORNE, STEADY = 0.2, 0.5, 0.35, 0.4, 0.04
#: RETURN: duration of the way back into the stand, s; LOWER: duration of the way into the crouch,
#: s.
RETURN, LOWER = 0.3, 0.45
#: SETTLED: time in the stand before it crouches, s; PATIENCE: longest time after the failure of an
#: input in which it comes to a stand, s.
SETTLED, PATIENCE = 0.3, 4.0
#: BEHIND: how far the centre of mass is behind the middle of the soles in a crouch from a walk, m.
BEHIND = 0.025
#: PASSING: begin and end, as shares of a swing, of the time in which the body passes over the foot
#: that stands: the best time to crouch without any sensor.
PASSING = 0.38, 0.6
#: CONTRARY: ratio of the swinging foot's load to the other's above which loads contradict the
#: gait.
CONTRARY = 4.0
#: While both feet stand, each with a share of LOADED of the weight, soles that are not level for
#: COMPARED, s, contradict: PARALLEL: largest angle between them by the joints; FLAT: largest lean
#: by IMU and joints, rad.
PARALLEL, FLAT, LOADED, COMPARED = 0.16, 0.1, 0.12, 0.06
#: Largest deviation from the mean over USUAL, s, meanwhile: TWISTED: of the angle between the
#: soles while the weight shifts; TURNED: of their lean, rad; SEEN_LEVEL: time for which they are
#: level in a crouch before the IMU counts again, s.
TWISTED, TURNED, USUAL, SEEN_LEVEL = 0.015, 0.05, 1.0, 1.0
#: TOPPLES: lean of a robot that holds the stand, rad, above which it topples.
TOPPLES = 0.05
#: BLIND: age of IMU and joints, s, from which on nothing balances a walk: its last stride is
#: repeated; LATE: the same where an input has failed already.
BLIND, LATE = 0.025, 0.015
#: A joint was moved by hand, or its sensor failed, if it moves from one tick to the next by more
#: than JUMP, rad, plus FASTEST, rad/s, times the time between.
JUMP, FASTEST = 0.15, 40.0
#: TAKEOVER: duration of the transition from the angles that are held to those of balance, s.
TAKEOVER = 0.1
#: ASIDE: largest speed sideways, m/s; TURN: largest yaw rate, rad/s.
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
        sensors: present measurements, joints in the feedback's order; None if they are unknown.
        command: speeds forward and to the left, m/s, and rate of turning, rad/s.
        balancing: whether the feedback bears the robot now.
        fallen: whether it fell, and has not been put on its feet yet.
        falls: how often it fell.
        ages: of inertial unit, joints and feet, s, shape (3,): since the last valid values came.
        latencies: the same since they were measured.
        failed: whether an input is out.
        doubts: input -> how it contradicts the others, until the pattern is enabled
            anew in a crouch, or the robot falls.
        refused: whether messages arrive, but none of an input has been valid yet.
        crouching: whether it holds the crouch or is on its way into it.

    """

    def __init__(self, plan: GaitPlan, ramp: float = 1.0, enabled: bool = True,
                 strides: StrideCommand | None = None) -> None:
        """Stand; arguments as of Pattern, but a stride command has no effect."""
        super().__init__(plan, ramp, enabled)
        self.balance: BipedFeedback | None = None
        self.sensors: SensorData | None = None
        self.command = 0.0, 0.0, 0.0
        self.balancing, self.fallen, self.falls = False, False, 0
        self._stood, self._share = 0.0, 0.0
        self.ages, self.latencies = np.zeros(3), np.zeros(3)
        self.failed, self.refused, self.crouching = False, False, False
        self.doubts: dict[int, str] = {}
        self._contrary, self._gap, self._before = 0.0, math.inf, np.zeros(1)
        #: Which measured joints have moved further than they can.
        self._leaps = np.zeros(1, dtype=bool)
        self._uneven, self._level, self._unchanged = 0.0, 0.0, np.zeros(1)
        self._settles, self._leant = 0.0, False
        self._tilts, self._usual = np.zeros((2, 2, 2))
        self._ages = np.zeros(3)
        self._good, self._blind = GOOD, False
        self._held, self._still = False, np.zeros_like(self._offset)
        self._start, self._pose = self._offset.copy(), self._offset
        self._time = self._waited = self._failing = 0.0
        self._lowers, self._known = False, False
        self._substitutes: Substitutes | None = None
        self._crouch, self._depth = self._offset, 0.0
        self._braced, self._braces = self._offset, False
        self._places = self.robot.places
        self._rest = np.array(list(self.robot.held.values()))
        self._arms: Arms | None = None
        #: Requests of other threads: a gait to follow, and whether doubts are to be forgotten.
        self._follow: deque[GaitRunner] = deque(maxlen=1)
        self._anew = False

    def steer(self, stride: np.ndarray, pace: float) -> None:
        """Do nothing: feet are placed for the wished speed."""

    def apply(self, plan: GaitPlan, transition: float) -> None:
        """Change to a plan; with feedback at once, whatever the transition."""
        if self.balance is None:
            super().apply(plan, transition)
        else:
            self._follow.append(GaitRunner(plan, SHORTEST))

    def enable(self, enabled: bool, ramp: float) -> None:
        """Walk, or come to a stand; inputs that contradicted others are judged anew."""
        self._anew = True
        super().enable(enabled, ramp)

    def attach(self, strides: StrideCommand) -> None:
        """Do nothing: feet are placed for the wished speed."""

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
        return not (self.enabled or self.level)

    @property
    def held_angles(self) -> np.ndarray:
        """Target angles of joints of no leg, rad, in the order of ``robot.held``."""
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
        """Crouch once the robot stands, and stay there, before the end of all commands.

        Returns:
            Whether it will: it balances, or did.

        """
        self._lowers = self.balance is not None and self._known and not self.fallen
        return self._lowers

    def resume(self, stall: float) -> None:
        """Go on after a stall in s, in which joints moved unseen."""
        super().resume(stall)
        self._gap += stall

    def release(self) -> None:
        """Stop balancing, as without sensors, and hold the angles of the stand."""
        self.balancing, self._stood = False, 0.0

    def advance(self, dt: float) -> None:
        """Advance by dt in s and fill position, velocity and phases."""
        balance, sensors = self.balance, self.sensors
        if balance is None:
            while self._follow:
                track = self._follow.popleft()
                self._keep(track)
                self._struct.waiting = track.address
            if self._arms is not None:
                self._arms.advance(dt, False)
            if self._held or self.balancing:
                self._held = self.balancing = self.crouching = False
                self._wanted[:], self._rate[:] = self.position, 0.0
                self._absorb()
            super().advance(dt)
            return
        if self._arms is not balance.arms:
            self._attach(balance)
        self._take(balance)
        self._ages[:] = self.ages
        if sensors is not None:
            assert self._substitutes is not None
            self._doubt(balance, sensors, dt)
            sensors = self._substitutes.fill(sensors, self._ages, self.latencies,
                                             balance.memory, dt)
            self._watch(balance, sensors, dt)
        self._unseen = self._out_of_sight()
        self._good = 0.0 if self.failed or self.doubts else self._good + dt
        if self.balancing and self._gives_up(balance, sensors, dt):
            # First, as another thread may ask whether it has come to rest.
            self._time, self.crouching = 0.0, True
            self._braces = balance.mode == WALK
            self.release()
        measured = self._known or self.refused or sensors is not None
        if not (self.balancing or self.fallen) and (
                self._lowers or ((self.failed or self.doubts) and measured)):
            self._braces = self._braces and self.crouching
            self.crouching = True
        target = None
        if self.balancing and sensors is not None:
            target = self._balanced(balance, sensors, dt)
        if target is None:
            target = self._hold(balance, dt)
        rate = (target - self.position) / dt if dt > 0.0 else self._still
        self.held += confine(target, rate, self._limits, dt, self.position, self.velocity,
                             self._behind) > 0
        if self.balancing:
            self._stride.record(balance, self._unseen, self.position[self._places])

    def _attach(self, balance: BipedFeedback) -> None:
        self._arms = balance.arms
        self._substitutes, self._stride = Substitutes(balance.links), LastStride(len(self._places))
        (self._crouch, self._depth), (leant, _) = (
            crouch_pose(self.robot, balance.links, behind) or (self._offset, 0.0)
            for behind in (0.0, BEHIND))
        self._braced = leant - self._crouch

    def _gives_up(self, balance: BipedFeedback, sensors: SensorData | None, dt: float) -> bool:
        """Return whether to crouch now instead of balancing any longer.

        A crouch that begins in a walk waits for the moment at which the body is over the foot
        that stands.
        """
        if not (self._stops or self._lowers or self._unseen):
            self._waited = self._failing = 0.0
            self._blind = False
            return sensors is None
        self._failing += dt
        self._waited = self._waited + dt if balance.mode == STAND else 0.0
        self._blind = self._blind or self._unseen or (self._stops and self._failing > PATIENCE)
        return (sensors is None or self._waited > SETTLED
                or (self._blind and (balance.mode != WALK or self._passes(balance))))

    def _out_of_sight(self) -> bool:
        """Return whether IMU and joints are both too old to balance a walk."""
        return bool(np.maximum(self._ages, self.latencies)[:FEET].min()
                    > (LATE if self.failed else BLIND))

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
        """Return the angles that balance requests, rad, (joints,); None after a fall."""
        if self.enabled and not (self._stops or self._lowers):
            forward, left, turn = self.command
            balance.walk(forward, min(max(left, -ASIDE), ASIDE), min(max(turn, -TURN), TURN))
        else:
            balance.stand()
        if self._held:
            self._held = False
            self._start[:] = self.position
        target = self._stride.replay(balance, self._unseen, balance.advance(sensors, dt))
        if not np.isfinite(target).all():
            self._fall()
            return None
        self.faults = balance.faults
        self._share = min(1.0, self._share + dt / TAKEOVER)
        start = self._start[self._places]
        self._wanted[self._places] = start + self._share * (target - start)
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
            if np.abs(pose - self._start).max() > JUMP:
                self._settles = duration + SETTLED
        self._time += dt
        balance.arms.advance(dt, False)
        if self.crouching and self._braces:
            pose = pose + smoothstep(min(max(2.0 - self._time / LOWER, 0.0), 1.0)) * self._braced
        return self._start + smoothstep(min(self._time / duration, 1.0)) * (pose - self._start)

    def _take(self, balance: BipedFeedback) -> None:
        """Take requests of other threads."""
        self._core.cpg_take(self._address)
        if self._anew:
            self._anew = False
            if not self.balancing:
                self.doubts.clear()
        while self._follow:
            balance.follow(self._follow.popleft())
        if self._tracks != [balance.track]:
            self._run([balance.track])

    def _doubt(self, balance: BipedFeedback, sensors: SensorData, dt: float) -> None:
        """Count an input as out if it contradicts the others while the robot balances."""
        joints = sensors.joint_positions[0]
        moved = np.abs(joints - self._before)
        self._leaps = moved > JUMP + FASTEST * (self._gap + dt)
        self._before, self._gap = joints.copy(), self._ages[JOINTS]
        if self.balancing:
            self._doubt_joints(balance, moved, dt)
        self._doubt_soles(balance, sensors, dt)
        if self.balancing and balance.mode == WALK and balance.kind == WALKS:
            loads, swings = sensors.foot_forces[0], balance.memory.swinging
            contrary = (self._ages[FEET] < EXTRAPOLATED and self._passes(balance)
                        and loads[swings].sum() > CONTRARY * loads[~swings].sum())
            self._contrary = self._contrary + dt if contrary else 0.0
            if self._contrary > STEADY:
                self.doubts.setdefault(FEET, 'the contacts do not go with the gait')
        assert self._substitutes is not None
        if not self.doubts:
            self._substitutes.suspect = None
        for doubted in self.doubts:
            if doubted != JOINTS or self._substitutes.suspect is None:
                self._ages[doubted] = max(self._ages[doubted], EXTRAPOLATED + ADOPTED)

    def _doubt_joints(self, balance: BipedFeedback, moved: np.ndarray, dt: float) -> None:
        """Doubt a single joint that jumps, or that stays the same in a walk."""
        wrong, reason = self._leaps, 'jumped'
        if self._unchanged.size != moved.size or balance.mode != WALK:
            self._unchanged = np.zeros(moved.size)
        self._unchanged = np.where(moved > 0.0, 0.0, self._unchanged + dt)
        if not wrong.any():
            wrong, reason = np.zeros(moved.size, dtype=bool), 'is stuck'
            wrong[balance.rows] = self._unchanged[balance.rows] > STEADY
        if wrong.sum() == 1 and JOINTS not in self.doubts:
            assert self._substitutes is not None
            self._substitutes.suspect = int(wrong.argmax())
            self.doubts[JOINTS] = f'{balance.order[self._substitutes.suspect]} {reason}'

    def _doubt_soles(self, balance: BipedFeedback, sensors: SensorData, dt: float) -> None:
        """Doubt joints or IMU by the soles while both feet stand.

        The soles of a robot that is pushed lean, too: it crouches, and as they are level there,
        the IMU counts again.
        """
        if self.fallen or (self.balancing and balance.mode == WALK):
            self._settles = SETTLED
            return
        weight = GRAVITY * balance.links.masses.sum()
        if self._ages.max() > EXTRAPOLATED or (sensors.foot_forces[0] < LOADED * weight).any():
            return
        assert self._substitutes is not None
        tilts, shifts = self._substitutes.sole_tilts(sensors), balance.mode == SHIFT
        self._settles -= dt
        if self._settles > 0.0:
            self._tilts[:] = self._usual[:] = tilts
            return
        self._tilts += min(dt / COMPARED, 1.0) * (tilts - self._tilts)
        if not (self.balancing and shifts):
            self._usual += min(dt / USUAL, 1.0) * (tilts - self._usual)
        turned = self._tilts - self._usual
        off = math.dist(*tilts)
        twisted = self.balancing and shifts and math.dist(*turned) > TWISTED
        leaning = max(math.hypot(*tilts.mean(axis=0)), FLAT / TURNED * math.hypot(
            *turned.mean(axis=0)))
        uneven = off > PARALLEL or twisted or leaning > FLAT
        self._uneven = self._uneven + dt if uneven else 0.0
        self._level = self._level + dt if self.crouching and not uneven else 0.0
        if self._level > SEEN_LEVEL and self._leant:
            self._leant = False
            self.doubts.pop(IMU, None)
        if self._uneven <= COMPARED or self.doubts:
            return
        if off > PARALLEL or twisted:
            self.doubts[JOINTS] = (f'the soles are {off:.2f} rad from parallel by the joints, or '
                                   'turn against each other, while both feet stand: encoder '
                                   'offsets or names of joints')
        else:
            self.doubts[IMU] = ('the soles lean by IMU and joints while both feet stand: the '
                                'mounting of the IMU, its signs, a push, or ground too steep')
            self._leant = True

    def _watch(self, balance: BipedFeedback, sensors: SensorData, dt: float) -> None:
        """Find out whether the robot has fallen, was moved, or stands on its feet again."""
        joints = sensors.joint_positions[0]
        lean = math.acos(min(max(math.cos(sensors.rpy[0, 0]) * math.cos(sensors.rpy[0, 1]),
                                 -1.0), 1.0))
        if self.balancing:
            if lean > LEANS:
                self._fall()
            elif self._leaps.sum() > 1:
                # A person moves more than one joint.
                self.release()
            return
        if self.crouching and lean > LEANS and (self._leant or not (self.failed or self.doubts)):
            # A push has felled it, which made the soles lean or the IMU show no gravity.
            self._fall()
        if self._stops or self._lowers:
            self._stood = 0.0
            return
        off = np.abs(joints[balance.rows] - self._pose[self._places]).max()
        weight = GRAVITY * balance.links.masses.sum()
        stands = (lean < (CROUCHED if self.crouching else UPRIGHT) and off < NEAR
                  and sensors.foot_forces.sum() > BORNE * weight)
        if TOPPLES < lean < UPRIGHT and not (stands or self.fallen or self.crouching):
            # Its feet do not show that it stands.
            self.crouching = True
        self._stood = self._stood + dt if stands and not self._leaps.any() else 0.0
        if self._stood >= STEADY:
            balance.restart(self._depth if self.crouching else 0.0)
            self.balancing, self.fallen, self._share, self._known = True, False, 0.0, True
            self.crouching = False

    def _fall(self) -> None:
        self.release()
        self.crouching = False
        self.falls += 1
        self.fallen = True
        # A fall contradicts everything: inputs are judged anew once the robot is on its feet.
        self.doubts.clear()
        self._contrary, self._leant = 0.0, False
