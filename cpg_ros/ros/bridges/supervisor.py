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

"""The state machine of a bridge: rise, hang in a rack, stand, follow, sit, damp.

Only a new start leaves ``damping``. docs/how_to/unitree.md lists all transitions to it and the
times, in the section What the bridge does when something goes wrong.
"""

from collections.abc import Callable
from enum import Enum
import math

from cpg_ros.motion.strides import smoothstep
from cpg_ros.ros.bridges.robot_state import BridgeSettings, JointCommand, RobotState
import numpy as np

# Checks of a robot's state; a fault that they find damps the joints at once.

class SafetyChecks:
    """Checks a state for all conditions that make any motion unsafe."""

    def __init__(self, settings: BridgeSettings, state: RobotState) -> None:
        """Check ``state`` against the limits of ``settings``."""
        self._settings, self._state = settings, state
        self._lower = settings.lower - settings.margin
        self._upper = settings.upper + settings.margin
        self._upright = math.cos(settings.tilt)

    def reset(self) -> None:
        """Compare motors with their state as it is now."""
        self._state.reset_motor_faults()

    def fault(self) -> str:
        """Return the first fault found, or ''."""
        state, settings = self._state, self._settings
        q = state.q
        # One look is enough for all: a sum is finite only where every number is.
        if not math.isfinite(float(q.sum()) + float(state.dq.sum())):
            return "a joint's angle or speed is not a number"
        upright = state.tilt_cosine
        if not upright >= self._upright:
            return ('the IMU gives no orientation' if math.isnan(upright) else
                    f'the body leans by {math.degrees(math.acos(max(-1.0, upright))):.0f} degrees')
        outside = (q < self._lower) | (q > self._upper)
        if outside.any():
            worst = int(outside.argmax())
            return (f'{settings.names[worst]} is at {q[worst]:.2f} rad, beyond its limits '
                    f'{settings.lower[worst]:.2f} to {settings.upper[worst]:.2f}')
        if state.temperature.size:
            hot = int(state.temperature.argmax())
            if state.temperature[hot] >= settings.hottest:
                return f'the motor of {settings.names[hot]} has {state.temperature[hot]} deg C'
        return state.motor_fault()


# The target angles of a generator, interpolated from one to the next.

#: MAX_JUMP: largest jump of a target, rad, beyond the distance that the joint's speed limit allows
#: in the time since the last target.
MAX_JUMP = 0.05
#: MAX_GAP: longest time between two targets, s, that is interpolated and that counts for MAX_JUMP.
MAX_GAP = 0.05


class Targets:
    """Target angles with linear interpolation between them.

    A target is reached as long after its arrival as it arrived after the one before, so that a
    generator of 100 Hz moves joints as evenly as one of 500 Hz. Targets that arrive every period
    are used at once.

    Attributes:
        accepted: time of the last accepted target, s; -inf for none.
        rejection: why the last target was rejected; '' if it was accepted.

    """

    def __init__(self, names: tuple[str, ...], lower: np.ndarray, upper: np.ndarray,
                 velocity: np.ndarray, period: float) -> None:
        """Start without a target; arrays have shape (joints,).

        Targets are clipped to ``lower`` and ``upper``, rad; ``velocity`` limits their jumps,
        rad/s; ``period`` is the time between two calls of ``at``, s.
        """
        self._names, self._lower, self._upper = names, lower, upper
        self._velocity, self._period = velocity, period
        self.reset()

    def reset(self) -> None:
        """Discard all targets."""
        self._from = self._to = np.zeros(0)
        self._began = self._received = self.accepted = -np.inf
        self._span, self.rejection = 0.0, ''

    def add(self, target: np.ndarray, now: float) -> None:
        """Add a target, rad, that arrived now, s; reject one that the joints could not follow."""
        gap, self._received = now - self._received, now
        target = np.minimum(np.maximum(target, self._lower), self._upper)
        if self.accepted > -np.inf:
            leap = np.abs(target - self._to) - self._velocity * min(gap, MAX_GAP) - MAX_JUMP
            worst = int(leap.argmax())
            if not leap[worst] <= 0.0:
                self.rejection = (f'the target of {self._names[worst]} jumped by '
                                  f'{abs(target[worst] - self._to[worst]):.2f} rad')
                return
            self._from = self.at(now)
            self._span = min(gap, MAX_GAP) if gap > 1.5 * self._period else 0.0
        self._to, self._began, self.accepted, self.rejection = target, now, now, ''

    def at(self, now: float) -> np.ndarray:
        """Return the angles for now, rad, shape (joints,); only after the first target."""
        if now - self._began >= self._span:
            return self._to
        fraction = (now - self._began) / self._span
        return self._from + fraction * (self._to - self._from)

    def time_at_target(self, now: float) -> float:
        """Return how long the last target has been reached, s."""
        return now - self._began - self._span


# Monitoring of how far joints are from their commanded angles.

#: A joint is stuck if it moves by less than MIN_TRACKING of the range that it is commanded, while
#: that is more than MIN_RANGE, rad, in two windows of ``tracking_time`` that follow one another.
MIN_TRACKING, MIN_RANGE = 0.2, 0.08
#: MAX_AGE: largest age of the measured angles that are compared, s.
MAX_AGE = 0.2


class TrackingMonitor:
    """Finds a joint that does not follow its commands: one that is far from them, or is stuck.

    A joint that is stuck amid a gait is at its commanded angle twice in a stride, so the criterion
    is the exponential mean of |commanded - measured|, with the time constant ``tracking_time``. A
    joint that is late by some time has the mean error of its mean speed times that time. A joint
    that is stuck within a small swing is never far away, but its range is small.
    """

    def __init__(self, settings: BridgeSettings) -> None:
        """Monitor the joints of ``settings`` against its tracking_error."""
        self._settings = settings
        self.reset()

    def reset(self) -> None:
        """Discard all errors."""
        self._mean = np.zeros(len(self._settings.names))
        self._still, self._stuck = np.zeros((2, self._mean.size), dtype=bool)
        self._begin_window()

    def _begin_window(self) -> None:
        """Discard the commanded and measured extremes, rad, (2, joints), and the time, s."""
        self._low, self._window = np.full((2, self._mean.size), math.inf), 0.0
        self._high = -self._low

    @property
    def worst(self) -> str:
        """The joint with the largest mean error, and that error in rad."""
        worst = int(self._mean.argmax())
        return f'{self._settings.names[worst]} {self._mean[worst]:.3f}'

    def update(self, commanded: np.ndarray, measured: np.ndarray, dt: float) -> str:
        """Add angles, rad, dt s after those before; return what is wrong, or ''."""
        settings = self._settings
        weight = min(dt / settings.tracking_time, 1.0)
        self._mean += weight * (np.abs(commanded - measured) - self._mean)
        worst = int(self._mean.argmax())
        if stuck := self._find_stuck(np.stack([commanded, measured]), dt):
            return stuck
        if not self._mean[worst] > settings.tracking_error:
            return ''
        return (f'{settings.names[worst]} does not follow: it is at {measured[worst]:.2f} rad, '
                f'commanded to {commanded[worst]:.2f}, and was {self._mean[worst]:.2f} rad away '
                f'on average (tracking_error {settings.tracking_error:g} rad)')

    def _find_stuck(self, angles: np.ndarray, dt: float) -> str:
        """Add commanded and measured angles, rad, (2, joints); name a stuck joint, '' for none."""
        settings = self._settings
        self._low, self._high = np.minimum(self._low, angles), np.maximum(self._high, angles)
        self._window += dt
        if self._window >= settings.tracking_time and math.isfinite(settings.tracking_error):
            commanded, measured = self._high - self._low
            before, self._still = self._still, (commanded > MIN_RANGE) & (
                measured < MIN_TRACKING * commanded)
            self._stuck = self._still & before
            self._begin_window()
        if not self._stuck.any():
            return ''
        joint = int(self._stuck.argmax())
        return (f'{settings.names[joint]} is stuck at {angles[1, joint]:.2f} rad: it moves by '
                f'less than {MIN_TRACKING:g} of the range that it is commanded')


class BridgeState(Enum):
    """State of a bridge; HANGING holds the stand and follows no targets until ``stand``."""

    IDLE = 'idle'
    RISING = 'rising'
    HANGING = 'hanging'
    STANDING = 'standing'
    FOLLOWING = 'following'
    SITTING = 'sitting'
    DAMPING = 'damping'


#: ACTIVE_STATES: states in which the bridge holds the joints at target angles.
ACTIVE_STATES = (BridgeState.RISING, BridgeState.HANGING, BridgeState.STANDING,
                 BridgeState.FOLLOWING, BridgeState.SITTING)

#: STALE_PERIODS: number of periods without a measurement after which the last command is held, as
#: the torque that another angle would cause is unknown.
STALE_PERIODS = 2.5


def _between(start: np.ndarray, end: np.ndarray, fraction: float) -> np.ndarray:
    """Interpolate smoothly between two poses; a fraction beyond 1 counts as 1."""
    return start + smoothstep(min(fraction, 1.0)) * (end - start)


class Supervisor:
    """Fills a command every period, from the measured state and the targets.

    All methods must be called from one thread.

    Attributes:
        robot: the measured state; readers of a new one then call ``state_received``.
        command: to send after ``step``.
        targets: of a generator.
        state: of the bridge.
        reason: for this state.
        tracking: distances of joints from their commanded angles.
        kp_scale: factor of kp while the robot follows targets, up to the settings' most_kp.
        feedforward: torques to add, N m, shape (joints,), as far as the limits allow.

    """

    def __init__(self, settings: BridgeSettings, robot: RobotState, command: JointCommand,
                 on_state: Callable[[BridgeState, str], None]) -> None:
        """Start idle; ``on_state`` gets every new state and the reason for it."""
        self._settings, self._on_state = settings, on_state
        self.robot, self.command = robot, command
        self.targets = Targets(settings.names, settings.lower, settings.upper,
                               settings.velocity, settings.period)
        self.tracking = TrackingMonitor(settings)
        self._checks = SafetyChecks(settings, robot)
        self.state, self.reason, self.kp_scale = BridgeState.IDLE, '', 1.0
        self.feedforward = np.zeros(len(settings.names))
        self._at = self._from = settings.stand
        self._began = self._before = 0.0
        self._fades, self._gathered = False, 0.0
        self._received, self._counter = -np.inf, -1

    # -- events ---------------------------------------------------------------------------

    def state_received(self, now: float) -> None:
        """Record that ``robot`` was read now, s, unless the robot's counter stands still."""
        if self.robot.tick == 0 or self.robot.tick != self._counter:
            self._received, self._counter = now, self.robot.tick

    def rise(self, now: float) -> str:
        """Begin to move the joints to the stand; return why not, or ''."""
        if self.state in ACTIVE_STATES:
            return f'it is {self.state.value} already'
        self._checks.reset()
        self._before = now
        reason = self._fault(now)
        if reason:
            return reason
        self._at, self._gathered = self.robot.q.astype(float), 0.0
        self.targets.reset()
        self._enter(BridgeState.RISING, now, 'from its present pose')
        return ''

    def stand(self, now: float) -> None:
        """Follow targets from now on, if the robot hangs in its rack."""
        if self.state is BridgeState.HANGING:
            # An earlier target does not show that a generator is running.
            self.targets.reset()
            self._enter(BridgeState.STANDING, now, '~/start')

    def set_target(self, target: np.ndarray, now: float) -> None:
        """Add a target, rad, that arrived now; reject one with a value that is not a number."""
        if np.isfinite(target).all():
            self.targets.add(target, now)
        else:
            self.reject_target('a target is not a number', now)

    def reject_target(self, reason: str, now: float) -> None:
        """Record that a target cannot be used; damp at once if the robot follows targets."""
        if self.state is BridgeState.FOLLOWING:
            self.damp(now, reason)

    def sit(self, now: float, reason: str) -> None:
        """Sit down, if the robot is up; one that is damped stays damped.

        A gait whose targets still arrive fades to the stand first.
        """
        if self.state in ACTIVE_STATES and self.state is not BridgeState.SITTING:
            self._fades = (self.state is BridgeState.FOLLOWING and not self._gathered
                           and self.time_in_state(now) >= self._settings.approach)
            self._enter(BridgeState.SITTING, now, reason)

    def damp(self, now: float, reason: str) -> None:
        """Damp the joints at once; an idle robot stays idle."""
        if self.state in ACTIVE_STATES:
            self._enter(BridgeState.DAMPING, now, reason)

    def _enter(self, state: BridgeState, now: float, reason: str) -> None:
        self.state, self.reason, self._began, self._from = state, reason, now, self._at
        self._on_state(state, reason)

    def time_in_state(self, now: float) -> float:
        """Return how long the present state has lasted, s."""
        return now - self._began

    # -- every period ---------------------------------------------------------------------

    def step(self, now: float) -> bool:
        """Fill the command for now, s; return whether to send it: not while idle."""
        if self.state is BridgeState.IDLE:
            self._before = now
            return False
        if self.state in ACTIVE_STATES and (reason := self._fault(now)):
            self.damp(now, reason)
        if self.state is BridgeState.FOLLOWING:
            self._check_targets(now)
        dt, self._before = now - self._before, now
        if self.state is BridgeState.FOLLOWING and now - self._received < MAX_AGE and (
                reason := self.tracking.update(self._at, self.robot.q, dt)):
            self.sit(now, reason)
        if self.state in ACTIVE_STATES:
            self._follow_goal(now, dt)
        if self.state is BridgeState.DAMPING:
            self.command.damp(self.damping)
        return True

    @property
    def damping(self) -> np.ndarray:
        """Gains kd of joints that are only damped, N m s / rad, shape (joints,)."""
        return self._limited(self._settings.damping)

    def _limited(self, kd: float | np.ndarray) -> np.ndarray:
        """Return kd, reduced where it would exceed a joint's torque limit."""
        speed = np.abs(self.robot.dq)
        # A speed that is not a number limits nothing: too much damping is better than none.
        speed[~np.isfinite(speed)] = 0.0
        return np.minimum(kd, self._settings.torque / np.maximum(speed, 1e-3))

    def _fault(self, now: float) -> str:
        timeout = self._settings.state_timeout
        if now - self._before > timeout:
            return f'the bridge itself stalled for {1e3 * (now - self._before):.0f} ms'
        if now - self._received > timeout:
            return f'no fresh state of the robot for {1e3 * timeout:.0f} ms'
        return self._checks.fault()

    def _check_targets(self, now: float) -> None:
        targets, timeout = self.targets, self._settings.target_timeout
        if now - targets.accepted > timeout:
            self.sit(now, targets.rejection or f'no fresh target for {1e3 * timeout:.0f} ms')

    def _follow_goal(self, now: float, dt: float) -> None:
        settings, state, passed = self._settings, self.state, now - self._began
        # After a late tick, move no further than in two periods.
        dt = min(dt, 2.0 * settings.period)
        if state is BridgeState.FOLLOWING:
            goal, time = self._followed(now, dt), settings.approach
        elif state is BridgeState.SITTING:
            goal, time = self._seated(now)
            passed = now - self._began
        else:
            goal, time = settings.stand, settings.rise if state is BridgeState.RISING else 0.0
        if passed < time:
            goal = _between(self._from, goal, passed / time)
        step = settings.velocity * dt
        self._at = np.minimum(np.maximum(goal, self._at - step), self._at + step)
        if passed >= (settings.sit if state is BridgeState.SITTING else time):
            self._arrive(now)
        if self.state in ACTIVE_STATES and now - self._received < STALE_PERIODS * settings.period:
            self._hold()

    def _followed(self, now: float, dt: float) -> np.ndarray:
        """Return the target; gather the legs at the stand while no new one arrives."""
        settings, targets = self._settings, self.targets
        step = dt if targets.time_at_target(now) > settings.late else -dt
        self._gathered = min(max(0.0, self._gathered + step / settings.fold), 1.0)
        return _between(targets.at(now), settings.stand, self._gathered)

    def _seated(self, now: float) -> tuple[np.ndarray, float]:
        """Return the goal while sitting down, and the time to blend into it, s."""
        settings, passed = self._settings, now - self._began
        if self._fades:
            if passed < settings.fade and self.targets.time_at_target(now) < settings.late:
                return _between(self.targets.at(now), settings.stand, passed / settings.fade), 0.0
            self._fades, self._began, self._from, passed = False, now, self._at, 0.0
        # All legs move alike: a robot that holds its legs as in mid-stride topples.
        return _between(settings.stand, settings.lying, passed / settings.sit), settings.fold

    def _arrive(self, now: float) -> None:
        settings = self._settings
        if self.state is BridgeState.RISING:
            away = np.abs(self.robot.q - settings.stand)
            worst = int(away.argmax())
            if away[worst] > settings.astray:
                self.damp(now, f'{settings.names[worst]} is {away[worst]:.2f} rad from the stand '
                          'after rising')
            elif settings.rack:
                self._enter(BridgeState.HANGING, now, 'it has risen; call ~/start to continue')
            else:
                # An earlier target does not show that a generator is running.
                self.targets.reset()
                self._enter(BridgeState.STANDING, now, 'it has risen')
        elif self.state is BridgeState.SITTING:
            self._enter(BridgeState.DAMPING, now, f'it has sat down: {self.reason}')
        elif (self.state is BridgeState.STANDING
              and now - self.targets.accepted < settings.target_timeout):
            self.tracking.reset()
            self._enter(BridgeState.FOLLOWING, now, 'targets have come')

    def _hold(self) -> None:
        """Command angles, limited so that no joint's torque exceeds its limit."""
        settings, command, robot = self._settings, self.command, self.robot
        kp, kd = settings.kp, self._limited(settings.kd)
        if self.kp_scale != 1.0 and self.state is BridgeState.FOLLOWING:
            kp = np.maximum(kp, np.minimum(self.kp_scale * kp, settings.most_kp))
        braking, stiffness = kd * robot.dq, np.maximum(kp, 1e-9)
        low, high = braking - settings.torque, braking + settings.torque
        tau = np.minimum(np.maximum(self.feedforward, low), high)
        least, most = robot.q + (low - tau) / stiffness, robot.q + (high - tau) / stiffness
        command.q[:] = np.minimum(np.maximum(self._at, least), most)
        command.dq[:], command.tau[:] = 0.0, tau
        command.kp[:], command.kd[:] = kp, kd
