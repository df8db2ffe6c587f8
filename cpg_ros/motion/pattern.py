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

"""The moving pattern: from plans to joint positions and velocities, tick by tick.

A gait switch cross-fades two networks whose legs share one phase. A ramp scales the pattern
between the stand and the gait. A watchdog compares the network with its orbit. The pattern's clock
slows after a stall, and where a joint would exceed the speed of the gaits.
"""

from collections import deque
from collections.abc import Callable
import ctypes
import math
from typing import Any

from cpg_ros.dynamics.integration.stepper import Stepper
from cpg_ros.motion.body_pose import BodyPose
from cpg_ros.motion.core import Core, core, CTrack, HOLD_TIME, MAX_TRACKS
from cpg_ros.motion.plan import GaitPlan
from cpg_ros.motion.strides import smoothstep, StrideCommand
import numpy as np

__all__ = ['HOLD_TIME', 'SUBSTEP', 'GaitRunner', 'Pattern']

#: SETTLING_STRIDES: strides in which the network has to find its new gait after a transition of 0
#: s.
SETTLING_STRIDES = 40.0
#: MIN_AMPLITUDE: least amplitude of the new gait in the state when such a transition starts, as a
#: fraction of the full gait's.
MIN_AMPLITUDE = 0.05


def shared(name: str, struct: str = '_struct') -> Any:
    """Return a property that reads and writes a number of a struct, which it has by name."""
    def read(self: Any) -> Any:
        return getattr(getattr(self, struct), name)

    def write(self: Any, value: float) -> None:
        setattr(getattr(self, struct), name, value)
    return property(read, write)


def _steered(field: str, address: Callable[[StrideCommand], int]) -> Any:
    """Return a property for the stride command, None for none.

    Args:
        field: of the core's struct, that points to it.
        address: stride command -> address for the field.

    """
    def read(self: Any) -> StrideCommand | None:
        strides: StrideCommand | None = self._strides
        return strides

    def write(self: Any, strides: StrideCommand | None) -> None:
        self._strides = strides
        setattr(self._struct, field, None if strides is None else address(strides))
    return property(read, write)


class GaitRunner:
    """A network that runs a plan, with a watchdog that compares it with the gait's orbit.

    Attributes:
        legs: phase of each leg, cycles.
        phase: of the first leg by the clock, cycles.
        progress: completed fraction of its transition, 0 to 1.
        settling: remaining strides to find the gait.
        address: of its struct in the core.

    """

    phase, progress, settling = shared('phase'), shared('progress'), shared('settling')
    strides = _steered('stride', lambda strides: strides.stride.ctypes.data)

    def __init__(self, plan: GaitPlan, transition: float,
                 strides: StrideCommand | None = None) -> None:
        """Run a plan; a stride command scales its strides."""
        self._core, self._track = core(), CTrack(plan.core)
        self._struct, self.address = self._track.struct, self._track.address
        self._struct.transition = transition
        self.legs = self._track.legs
        self.strides = strides
        self._start_on(plan)
        self.reseed(plan.readout.start)

    def _start_on(self, plan: GaitPlan) -> None:
        """Set the orbit to start on, and create a network for it."""
        self.plan, self._own = plan, plan.seed.copy()
        self._track.set_gait(plan.core)
        self._track.run('seed', plan.seed)
        self._track.run('home', self._own)

    @property
    def stepper(self) -> Stepper:
        """The network in use."""
        at_home = self._struct.net.lane == self._struct.home.lane
        return self._own if at_home else self._other

    @stepper.setter
    def stepper(self, stepper: Stepper) -> None:
        self._other = stepper
        self._track.run('net', stepper)

    def advance(self, strides: float) -> bool:
        """Advance by some strides; return whether the network is still on its orbit."""
        return bool(self._core.cpg_track_advance(self.address, strides))

    def reseed(self, phase: float | None = None) -> None:
        """Put the network on its orbit, at a phase of the first leg in cycles.

        The default phase is the clock's.
        """
        self._core.cpg_track_reseed(self.address, self.phase if phase is None else phase)

    def drift_to(self, plan: GaitPlan) -> None:
        """Take a plan's parameters and leave the change to the network's own dynamics.

        A state without a component in the new gait's symmetry class, such as a state on another
        gait's exact orbit, gets a small one; otherwise the lock would hold the network at rest.
        """
        orbit, stepper = plan.orbit, self.stepper
        stepper.set(orbit.network, plan.gain, orbit.symmetry)
        mean, basis = plan.wave
        at = (self.phase - plan.readout.start) % 1.0 * orbit.period
        state, target = stepper.newest() - mean, orbit(np.array(at)) - mean
        if np.linalg.norm(basis @ state) < MIN_AMPLITUDE * np.linalg.norm(basis @ target):
            stepper.superpose(lambda times: MIN_AMPLITUDE * (orbit(at + times) - mean),
                              lambda times: MIN_AMPLITUDE * orbit.derivative(at + times))
        # Advance to the node at which the change was made, so that all of it shows at once.
        stepper.advance(stepper.ahead)
        self._start_on(plan)
        self.stepper = stepper
        self._core.cpg_track_look(self.address, 0.0)
        self.phase, self._struct.phase_carry = float(self.legs[0]), 0.0
        self._struct.astray = self._struct.calm = self._struct.still = 0.0
        self.settling = SETTLING_STRIDES


#: SUBSTEP: longest step of cross-fades and ramps, s, whatever the tick.
SUBSTEP = 1e-3
#: MIN_DURATION: least duration of a ramp or cross-fade, s. The clock adapts from substep to
#: substep: a joint that accelerated within a single one would exceed its speed limit before the
#: clock slows.
MIN_DURATION = 0.05


class Pattern:
    """Joint positions and velocities of a robot in its gait.

    ``advance`` belongs to one thread; ``apply`` and ``enable`` may be called from others.

    Attributes:
        position, velocity: of each joint, rad and rad/s, leg by leg; overwritten by advance.
        faults: number of times that the watchdog put the network back on its orbit.
        held: number of ticks in which a limit held a joint back.
        body: pose of the body.
        frequency_scale: factor of the pattern's clock.
        substep: longest part of a tick while gaits fade or the ramp moves, s.

    """

    faults, held = shared('faults'), shared('ticks_held')
    frequency_scale, substep = shared('frequency_scale'), shared('substep')
    strides = _steered('strides', lambda strides: strides.address)

    def __init__(self, plan: GaitPlan, ramp: float = 1.0, enabled: bool = True,
                 strides: StrideCommand | None = None) -> None:
        """Begin in the stand and, if enabled, ramp into the gait in ``ramp`` s."""
        robot = plan.robot
        self.robot = robot
        self._core, self._struct = core(), Core(joints=len(robot.joints), substep=SUBSTEP,
                                                frequency_scale=1.0)
        self._address = ctypes.addressof(self._struct)
        self._ramp, self._approach = self._struct.ramp, self._struct.approach
        self._offset = robot.column('offset')
        self._limits = np.stack([robot.column(name) for name in ('lower', 'upper', 'velocity')])
        #: The plan whose gait the network is to find by itself, if requested; _request is then 1.
        self._drift: deque[GaitPlan] = deque(maxlen=1)
        self._request = ctypes.c_int32()
        #: Runners by the addresses of their structs.
        self._runners: dict[int, GaitRunner] = {}
        self.position, self.velocity = self._offset.copy(), np.zeros_like(self._offset)
        self._wanted, self._rate, self._goal, self._found, self._correction = rows = np.zeros(
            (5, self._offset.size))
        self._behind = np.zeros(self._offset.size, dtype=bool)
        # Arrays that only the core uses: last rates; the jump that it absorbs, and its rate.
        own = np.zeros((3, self._offset.size))
        self._kept = own
        for name, array in zip(
                ('wanted', 'rate', 'goal', 'found', 'correction', 'last_rate', 'jump', 'jump_rate',
                 'offset', 'position', 'velocity', 'behind'),
                (*rows, *own, self._offset, self.position, self.velocity, self._behind),
                strict=True):
            setattr(self._struct, name, array.ctypes.data)
        for k, row in enumerate(self._limits):
            self._struct.limits[k] = row.ctypes.data
        self._run([GaitRunner(plan, 0.0, strides)])
        self.strides = strides
        self.body = BodyPose(robot)
        self._struct.body = self.body.address
        self.restart(ramp, enabled)

    def _run(self, tracks: list[GaitRunner]) -> None:
        """Let the core run these runners, the newest one last."""
        for k, track in enumerate(tracks):
            self._keep(track)
            self._struct.track[k] = track.address
        self._struct.tracks = len(tracks)
        self._struct.legs = tracks[-1].legs.ctypes.data
        self._struct.state = tracks[-1].stepper.now.ctypes.data

    @property
    def _tracks(self) -> list[GaitRunner]:
        """The runners in the core, the newest one last."""
        struct = self._struct
        # From the last one on: the core moves them forward as the first one ends.
        slots = [struct.track[k] for k in reversed(range(struct.tracks))]
        return [self._runners[address] for address in reversed(slots)]

    def _keep(self, track: GaitRunner) -> None:
        """Keep a runner alive as long as the core may run it."""
        waiting = self._struct.waiting
        used = {waiting, track.address, *(runner.address for runner in self._tracks)}
        for old in list(self._runners)[:-2 * MAX_TRACKS]:
            if old not in used:
                del self._runners[old]
        self._runners[track.address] = track

    def restart(self, ramp: float, enabled: bool = True) -> None:
        """Restart at phase 0 with the newest plan, from the present joint positions."""
        newest, struct = self._tracks[-1], self._struct
        newest.reseed(0.0)
        self._run([newest])
        struct.go = 0.0
        self.velocity[:] = 0.0
        self._wanted[:], self._rate[:] = self.position, self.velocity
        self._behind[:], self._correction[:] = False, 0.0
        struct.absorbed, struct.recovering = math.inf, 0
        struct.slowing = struct.slower = 1.0
        struct.frequency, struct.followed = newest.plan.frequency, 0
        struct.stall = struct.stall_past = 0.0
        self._ramp.level = self._ramp.rate = 0.0
        self._go(self._ramp, float(enabled), ramp)
        self.enabled = enabled
        self.start_from(self.position, ramp)

    def _go(self, ramp: Any, end: float, time: float) -> None:
        """Move a ramp to its end in a time in s, from its present level and rate."""
        self._core.cpg_ramp_to(ctypes.addressof(ramp), end, time)

    def _absorb(self) -> None:
        """Let the core smooth the next jump of the wanted positions."""
        self._struct.absorbed, self._struct.jumped = 0.0, 0

    def start_from(self, angles: np.ndarray, time: float) -> None:
        """Begin at these angles, rad, (joints,), and move to the stand in a time in s or more.

        Call it before the first advance. No joint takes more than half of its speed limit.
        """
        # The joints' offsets from the stand, and the ramp that leads these to 0.
        self._found[:] = angles - self._offset
        self._approach.level, self._approach.rate, self._approach.parts = 1.0, 0.0, 0
        self.position[:] = np.clip(angles, *self._limits[:2])
        if self._found.any():
            self._core.cpg_approach_stand(self._address, time)

    def begin_at(self, phase: float) -> None:
        """Put the first leg at a phase in cycles, before the first advance."""
        self._newest.reseed(phase)

    @property
    def clock(self) -> float:
        """Phase of the first leg by the clock, cycles; setting it moves the network, too."""
        return float(self._newest.phase)

    @clock.setter
    def clock(self, phase: float) -> None:
        self._newest.reseed(phase)

    def like(self, other: 'Pattern') -> None:
        """Take phase, strides and positions of another pattern in the same, full gait."""
        self.clock = other.clock
        for mine, its in ((self.position, other.position), (self.velocity, other.velocity)):
            mine[:] = its
        if self.strides is not None and other.strides is not None:
            self.strides.state[:] = other.strides.state

    # -- requests from other threads ------------------------------------------------------

    def apply(self, plan: GaitPlan, transition: float) -> None:
        """Change to a plan over a transition in s; 0 leaves the change to the network's dynamics.

        It replaces a plan that still waits.
        """
        # Seeding an orbit takes long: do it in the caller's thread, not in that of the ticks.
        prepared = GaitRunner(plan, max(transition, MIN_DURATION), self.strides)
        self._keep(prepared)
        if transition > 0.0:
            self._drift.clear()
            self._struct.waiting = prepared.address
        else:
            self._struct.waiting = None
            self._drift.append(plan)
            self._request.value = 1

    def enable(self, enabled: bool, ramp: float) -> None:
        """Ramp into the gait, or down to the stand, over a time in s."""
        self.enabled = enabled
        self._struct.go = math.copysign(max(ramp, MIN_DURATION), 1.0 if enabled else -1.0)

    def steer(self, stride: np.ndarray, pace: float) -> None:
        """Request strides of the legs, shape (legs,), and the pace; see StrideCommand.

        Raises:
            ValueError: the pattern was made without a stride command.

        """
        if self.strides is None:
            raise ValueError('this pattern has no stride command')
        self.strides.set_target(stride, pace, at_once=self._ramp.level == 0.0)

    def attach(self, strides: StrideCommand) -> None:
        """Use a stride command from now on; without a target it changes nothing."""
        for track in self._tracks:
            track.strides = strides
        self.strides = strides

    @property
    def plan(self) -> GaitPlan:
        """The newest plan in force."""
        return self._newest.plan

    @property
    def _newest(self) -> GaitRunner:
        return self._runners[self._struct.track[self._struct.tracks - 1]]

    @property
    def fading(self) -> tuple[GaitPlan, GaitPlan, float]:
        """The plan that fades out, the newest plan in force, and the fraction of the newest."""
        older, newest = (tracks := self._tracks)[-2:][0], tracks[-1]
        if older is newest:
            return newest.plan, newest.plan, 0.0
        return older.plan, newest.plan, smoothstep(newest.progress)

    @property
    def phases(self) -> np.ndarray:
        """Phase of each leg, cycles, shape (legs,); 0 is where its cell peaks."""
        return self._newest.legs

    @property
    def state(self) -> np.ndarray:
        """State and rate of the newest network, shape (2, components); overwritten by advance."""
        return self._newest.stepper.now[:2]

    @property
    def level(self) -> float:
        """Level of the ramp: 0 at the stand, 1 in the full gait."""
        return self._ramp.level

    @property
    def standing(self) -> bool:
        """Whether the pattern is disabled and the ramp has ended."""
        return not (self.enabled or self._ramp.level or self._struct.go or self._approach.parts)

    @property
    def in_transition(self) -> bool:
        """Whether gaits fade into one another, or settle."""
        return self._struct.tracks > 1 or self._newest.settling > 0.0

    @property
    def recovering(self) -> bool:
        """Whether the pattern recovers from a fault."""
        return bool(self._struct.recovering)

    @property
    def addresses(self) -> dict[str, Any]:
        """The addresses by which C advances the pattern.

        They are the core's functions of a pattern and a time in s: advance (plan, then move),
        resume after a stall, plan (compute the wanted angles, which may then be corrected), move
        (move the joints to them within limits); report, which fills Instant.numbers and gaits;
        what, the pattern; attend, a 32-bit integer that is not 0 if start_drift is to be called;
        and the pointers to the arrays position, velocity, legs (phases) and state.
        """
        functions = {name: ctypes.cast(getattr(self._core, f'cpg_{name}'), ctypes.c_void_p).value
                     for name in ('advance', 'resume', 'plan', 'move', 'report')}
        return {**functions, 'what': self._address, 'attend': ctypes.addressof(self._request),
                **{name: self._address + getattr(Core, name).offset
                   for name in ('position', 'velocity', 'legs', 'state')}}

    @property
    def planned(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Angles before and after a correction, rad, (joints,), and the clock's factor, (1,)."""
        return self._wanted, self._goal, np.ndarray(
            1, float, memoryview(self._struct).cast('B'), Core.frequency_scale.offset)

    # -- the tick --------------------------------------------------------------------------

    def advance(self, dt: float) -> None:
        """Advance by dt in s and fill position, velocity and phases."""
        self.start_drift()
        self._core.cpg_advance(self._address, dt)

    def plan_tick(self, dt: float) -> np.ndarray:
        """Begin to advance by dt in s; return the wanted angles, rad, for a correction."""
        self.start_drift()
        self._core.cpg_plan(self._address, dt)
        return self._wanted

    def move(self, dt: float, goal: np.ndarray) -> None:
        """Move the joints to the corrected angles, rad, shape (joints,)."""
        self._goal[:] = goal
        self._core.cpg_move(self._address, dt, 1)

    def start_drift(self) -> None:
        """Change to a plan without a transition, if one has been asked for."""
        if self._request.value:
            self._request.value = 0
            while self._drift:
                self._run(self._tracks[-1:])
                self._newest.drift_to(self._drift.pop())
                self._absorb()

    def resume(self, stall: float) -> None:
        """Resume after a stall in s from where the pattern stopped, slowly at first.

        Call it from the thread of advance.
        """
        self._core.cpg_resume(self._address, stall)
