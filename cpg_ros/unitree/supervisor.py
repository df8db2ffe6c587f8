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

"""What a robot does and when it lets go: rise, stand, follow, sit, damp.

Nothing leaves ``damping`` but a new start. Every way there and the times are in
docs/how_to/unitree.md, section What the bridge does when something goes wrong.
"""

from collections.abc import Callable
from enum import Enum

from cpg_ros.motion.smoothstep import smoothstep
from cpg_ros.unitree.dangers import Dangers
from cpg_ros.unitree.low_cmd import LowCmd
from cpg_ros.unitree.low_state import LowState
from cpg_ros.unitree.settings import Settings
from cpg_ros.unitree.targets import Targets
import numpy as np


class Phase(Enum):
    """What the robot is made to do."""

    IDLE = 'idle'
    RISING = 'rising'
    STANDING = 'standing'
    FOLLOWING = 'following'
    SITTING = 'sitting'
    DAMPING = 'damping'


#: Phases in which joints are held at angles.
DRIVEN = (Phase.RISING, Phase.STANDING, Phase.FOLLOWING, Phase.SITTING)

#: Without a fresh state for so many periods, what was commanded last is held: what torque another
#: angle would ask for is not known.
STALE = 2.5


def _between(start: np.ndarray, end: np.ndarray, share: float) -> np.ndarray:
    """Return the angles on the smooth way from one pose to another, share from 0 to 1 or more."""
    return start + smoothstep(min(share, 1.0))[0] * (end - start)


class Supervisor:
    """Fills a command every period, from what is measured and what is asked for.

    Its methods are for one thread.

    Attributes:
        state: the robot's, as last read; who reads it then calls ``heard``.
        command: what is to be sent after ``step``.
        targets: what a generator asks for.
        phase: at present.
        reason: why it is in this phase.

    """

    def __init__(self, settings: Settings, told: Callable[[Phase, str], None]) -> None:
        """Be idle.

        Args:
            settings: of the robot.
            told: called with every new phase and the reason for it.

        """
        self._settings, self._told = settings, told
        self.state, self.command = LowState(), LowCmd()
        self.targets = Targets(settings.names, settings.lower, settings.upper,
                               settings.velocity, settings.period)
        self._dangers = Dangers(settings, self.state)
        self.phase, self.reason = Phase.IDLE, ''
        self._at = self._from = settings.stand
        self._began = self._before = 0.0
        self._fades, self._gathered = False, 0.0
        self._heard, self._counter = -np.inf, -1

    # -- what comes from outside ----------------------------------------------------------

    def heard(self, now: float) -> None:
        """Know that ``state`` has been read now, s; a robot whose counter stands still is mute."""
        if self.state.tick == 0 or self.state.tick != self._counter:
            self._heard, self._counter = now, self.state.tick

    def rise(self, now: float) -> str:
        """Lead the joints from where they are to the stand; return why not, or ''."""
        if self.phase in DRIVEN:
            return f'it is {self.phase.value} already'
        self._dangers.begin()
        self._before = now
        reason = self._danger(now)
        if reason:
            return reason
        self._at, self._gathered = self.state.q.astype(float), 0.0
        self.targets.forget()
        self._enter(Phase.RISING, now, 'from the pose that it was found in')
        return ''

    def ask(self, target: np.ndarray, now: float) -> None:
        """Take a target, rad, that has come now; one with what is no number is refused."""
        if np.isfinite(target).all():
            self.targets.take(target, now)
        else:
            self.refuse('a target is not a number', now)

    def refuse(self, reason: str, now: float) -> None:
        """Know that what a generator sends cannot be used; whoever follows it damps at once."""
        if self.phase is Phase.FOLLOWING:
            self.damp(now, reason)

    def sit(self, now: float, reason: str) -> None:
        """Sit down, if it is up; what damps already goes on damping.

        A gait whose targets still come fades to the stand first.
        """
        if self.phase in DRIVEN and self.phase is not Phase.SITTING:
            self._fades = (self.phase is Phase.FOLLOWING and not self._gathered
                           and self.since(now) >= self._settings.approach)
            self._enter(Phase.SITTING, now, reason)

    def damp(self, now: float, reason: str) -> None:
        """Let the joints go at once; what is idle stays idle."""
        if self.phase in DRIVEN:
            self._enter(Phase.DAMPING, now, reason)

    def _enter(self, phase: Phase, now: float, reason: str) -> None:
        self.phase, self.reason, self._began, self._from = phase, reason, now, self._at
        self._told(phase, reason)

    def since(self, now: float) -> float:
        """How long the phase has lasted, s."""
        return now - self._began

    # -- every period ---------------------------------------------------------------------

    def step(self, now: float) -> bool:
        """Fill the command for now, s; return whether there is one: not while idle."""
        if self.phase is Phase.IDLE:
            self._before = now
            return False
        if self.phase in DRIVEN and (reason := self._danger(now)):
            self.damp(now, reason)
        if self.phase is Phase.FOLLOWING:
            self._look_for_targets(now)
        dt, self._before = now - self._before, now
        if self.phase in DRIVEN:
            self._lead(now, dt)
        if self.phase is Phase.DAMPING:
            self.command.damp(self.damping)
        return True

    @property
    def damping(self) -> np.ndarray:
        """Gains kd with which joints are only damped, N m s / rad, shape (joints,)."""
        return self._bearable(self._settings.damping)

    def _bearable(self, kd: float | np.ndarray) -> np.ndarray:
        """Return kd, less where it would ask for more torque than a joint bears."""
        speed = np.abs(self.state.dq)
        # What is no number limits nothing: damped too hard is better than not at all.
        speed[~np.isfinite(speed)] = 0.0
        return np.minimum(kd, self._settings.torque / np.maximum(speed, 1e-3))

    def _danger(self, now: float) -> str:
        timeout = self._settings.state_timeout
        if now - self._before > timeout:
            return f'the bridge itself stood still for {1e3 * (now - self._before):.0f} ms'
        if now - self._heard > timeout:
            return f'no fresh state of the robot for {1e3 * timeout:.0f} ms'
        return self._dangers.found()

    def _look_for_targets(self, now: float) -> None:
        targets, timeout = self.targets, self._settings.target_timeout
        if now - targets.fresh > timeout:
            self.sit(now, targets.refused or f'no fresh target for {1e3 * timeout:.0f} ms')

    def _lead(self, now: float, dt: float) -> None:
        settings, phase, passed = self._settings, self.phase, now - self._began
        # After a late tick no more than two periods' way.
        dt = min(dt, 2.0 * settings.period)
        if phase is Phase.FOLLOWING:
            goal, time = self._followed(now, dt), settings.approach
        elif phase is Phase.SITTING:
            goal, time = self._seated(now)
            passed = now - self._began
        else:
            goal, time = settings.stand, settings.rise if phase is Phase.RISING else 0.0
        if passed < time:
            goal = _between(self._from, goal, passed / time)
        way = settings.velocity * dt
        self._at = np.minimum(np.maximum(goal, self._at - way), self._at + way)
        if passed >= (settings.sit if phase is Phase.SITTING else time):
            self._arrive(now)
        if self.phase in DRIVEN and now - self._heard < STALE * settings.period:
            self._drive()

    def _followed(self, now: float, dt: float) -> np.ndarray:
        """Return the target; if no other follows, the legs gather at the stand, and come back."""
        settings, targets = self._settings, self.targets
        way = dt if targets.reached(now) > settings.late else -dt
        self._gathered = min(max(0.0, self._gathered + way / settings.fold), 1.0)
        return _between(targets.at(now), settings.stand, self._gathered)

    def _seated(self, now: float) -> tuple[np.ndarray, float]:
        """Return where the joints go to sit down, and how long they take to join that way."""
        settings, passed = self._settings, now - self._began
        if self._fades:
            if passed < settings.fade and self.targets.reached(now) < settings.late:
                return _between(self.targets.at(now), settings.stand, passed / settings.fade), 0.0
            self._fades, self._began, self._from, passed = False, now, self._at, 0.0
        # All legs on one way: a robot that holds its legs as in mid-stride topples.
        return _between(settings.stand, settings.lying, passed / settings.sit), settings.fold

    def _arrive(self, now: float) -> None:
        settings = self._settings
        if self.phase is Phase.RISING:
            away = np.abs(self.state.q - settings.stand)
            worst = int(away.argmax())
            if away[worst] > settings.astray:
                self.damp(now, f'{settings.names[worst]} is {away[worst]:.2f} rad from the stand '
                          'after rising')
            else:
                # A target of before is no sign of a generator that is there.
                self.targets.forget()
                self._enter(Phase.STANDING, now, 'it has risen')
        elif self.phase is Phase.SITTING:
            self._enter(Phase.DAMPING, now, f'it has sat down: {self.reason}')
        elif self.phase is Phase.STANDING and now - self.targets.fresh < settings.target_timeout:
            self._enter(Phase.FOLLOWING, now, 'targets have come')

    def _drive(self) -> None:
        """Command angles at which no joint is asked for more torque than it bears."""
        settings, command, state = self._settings, self.command, self.state
        kp, kd = np.maximum(settings.kp, 1e-9), self._bearable(settings.kd)
        braking = kd * state.dq
        least = state.q + (braking - settings.torque) / kp
        most = state.q + (braking + settings.torque) / kp
        command.q[:] = np.minimum(np.maximum(self._at, least), most)
        command.dq[:] = command.tau[:] = 0.0
        command.kp[:], command.kd[:] = settings.kp, kd
