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

"""The state machine of a bridge: rise, stand, follow, sit, damp.

Only a new start leaves ``damping``. docs/how_to/unitree.md lists every way there and the times,
in the section What the bridge does when something goes wrong.
"""

from collections.abc import Callable
from enum import Enum

from cpg_ros.motion.smoothstep import smoothstep
from cpg_ros.safety.bridge_settings import BridgeSettings
from cpg_ros.safety.robot_state import JointCommand, RobotState
from cpg_ros.safety.safety_checks import SafetyChecks
from cpg_ros.safety.targets import Targets
from cpg_ros.safety.tracking_monitor import TrackingMonitor
import numpy as np


class BridgeState(Enum):
    """What the bridge makes the robot do."""

    IDLE = 'idle'
    RISING = 'rising'
    STANDING = 'standing'
    FOLLOWING = 'following'
    SITTING = 'sitting'
    DAMPING = 'damping'


#: States in which the bridge holds the joints at angles.
ACTIVE = (BridgeState.RISING, BridgeState.STANDING, BridgeState.FOLLOWING, BridgeState.SITTING)

#: Without a new measurement for this many periods, the last command is held: the torque that
#: another angle would cause is not known.
STALE = 2.5


def _between(start: np.ndarray, end: np.ndarray, share: float) -> np.ndarray:
    """Interpolate smoothly between two poses; a share beyond 1 counts as 1."""
    return start + smoothstep(min(share, 1.0))[0] * (end - start)


class Supervisor:
    """Fills a command every period, from the measured state and the targets.

    All methods must be called from one thread.

    Attributes:
        robot: the measured state; whoever reads a new one then calls ``state_received``.
        command: to be sent after ``step``.
        targets: of a generator.
        state: of the bridge.
        reason: why it is in this state.
        tracking: how far joints are from their commanded angles.
        kp_scale: factor of kp while the robot follows targets, up to the settings' most_kp.

    """

    def __init__(self, settings: BridgeSettings, robot: RobotState, command: JointCommand,
                 on_state: Callable[[BridgeState, str], None]) -> None:
        """Start idle.

        Args:
            settings: of the robot.
            robot: the measured state.
            command: to be filled.
            on_state: called with every new state and the reason for it.

        """
        self._settings, self._on_state = settings, on_state
        self.robot, self.command = robot, command
        self.targets = Targets(settings.names, settings.lower, settings.upper,
                               settings.velocity, settings.period)
        self.tracking = TrackingMonitor(settings)
        self._checks = SafetyChecks(settings, robot)
        self.state, self.reason, self.kp_scale = BridgeState.IDLE, '', 1.0
        self._at = self._from = settings.stand
        self._began = self._before = 0.0
        self._fades, self._gathered = False, 0.0
        self._received, self._counter = -np.inf, -1

    # -- events ---------------------------------------------------------------------------

    def state_received(self, now: float) -> None:
        """Note that ``robot`` was read now, s; unless the robot's counter stands still."""
        if self.robot.tick == 0 or self.robot.tick != self._counter:
            self._received, self._counter = now, self.robot.tick

    def rise(self, now: float) -> str:
        """Begin to move the joints to the stand; return why not, or ''."""
        if self.state in ACTIVE:
            return f'it is {self.state.value} already'
        self._checks.reset()
        self._before = now
        reason = self._fault(now)
        if reason:
            return reason
        self._at, self._gathered = self.robot.q.astype(float), 0.0
        self.targets.reset()
        self._enter(BridgeState.RISING, now, 'from the pose that it was found in')
        return ''

    def set_target(self, target: np.ndarray, now: float) -> None:
        """Add a target, rad, that arrived now; reject one with a value that is not a number."""
        if np.isfinite(target).all():
            self.targets.add(target, now)
        else:
            self.reject_target('a target is not a number', now)

    def reject_target(self, reason: str, now: float) -> None:
        """Note that a target cannot be used; damp at once if the robot follows targets."""
        if self.state is BridgeState.FOLLOWING:
            self.damp(now, reason)

    def sit(self, now: float, reason: str) -> None:
        """Sit down, if the robot is up; one that is damped stays damped.

        A gait whose targets still arrive fades to the stand first.
        """
        if self.state in ACTIVE and self.state is not BridgeState.SITTING:
            self._fades = (self.state is BridgeState.FOLLOWING and not self._gathered
                           and self.time_in_state(now) >= self._settings.approach)
            self._enter(BridgeState.SITTING, now, reason)

    def damp(self, now: float, reason: str) -> None:
        """Damp the joints at once; an idle robot stays idle."""
        if self.state in ACTIVE:
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
        if self.state in ACTIVE and (reason := self._fault(now)):
            self.damp(now, reason)
        if self.state is BridgeState.FOLLOWING:
            self._check_targets(now)
        dt, self._before = now - self._before, now
        if self.state is BridgeState.FOLLOWING and (
                reason := self.tracking.update(self._at, self.robot.q, dt)):
            self.sit(now, reason)
        if self.state in ACTIVE:
            self._lead(now, dt)
        if self.state is BridgeState.DAMPING:
            self.command.damp(self.damping)
        return True

    @property
    def damping(self) -> np.ndarray:
        """Gains kd with which joints are only damped, N m s / rad, shape (joints,)."""
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
            return f'the bridge itself stood still for {1e3 * (now - self._before):.0f} ms'
        if now - self._received > timeout:
            return f'no fresh state of the robot for {1e3 * timeout:.0f} ms'
        return self._checks.fault()

    def _check_targets(self, now: float) -> None:
        targets, timeout = self.targets, self._settings.target_timeout
        if now - targets.accepted > timeout:
            self.sit(now, targets.rejection or f'no fresh target for {1e3 * timeout:.0f} ms')

    def _lead(self, now: float, dt: float) -> None:
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
        if self.state in ACTIVE and now - self._received < STALE * settings.period:
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
        least = robot.q + (braking - settings.torque) / stiffness
        most = robot.q + (braking + settings.torque) / stiffness
        command.q[:] = np.minimum(np.maximum(self._at, least), most)
        command.dq[:] = command.tau[:] = 0.0
        command.kp[:], command.kd[:] = kp, kd
