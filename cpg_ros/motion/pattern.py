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

A gait switch cross-fades two networks whose legs share one phase; a ramp scales the whole
pattern between the stand (every joint at its offset) and the gait; a watchdog compares the
network with its orbit. All three run on the pattern's own clock, which is slowed while they
move whenever a joint would exceed the speed that the gaits themselves reach, and after a stall.
"""

from collections import deque
from collections.abc import Callable
import math

from cpg_ros.motion.plan import GaitPlan
from cpg_ros.motion.readout import confine
from cpg_ros.motion.strides import come_to_rest, lengthen, scale, smoothstep, StrideCommand
import numpy as np

#: Off the orbit: a cell further away than this fraction of the peak, or the phase behind or ahead
#: of the clock by this fraction of a cycle, for longer than this many strides.
FAR, ASTRAY, PATIENCE = 0.3, 0.15, 0.5
#: Strides the network gets to find its new gait by itself after a transition of 0 s.
SETTLING = 40.0
#: At rest: no state changes by more than this fraction of a cell's range in a stride.
AT_REST = 0.05
#: Such a transition starts with at least this fraction of the new gait in the state.
KICK = 0.05


class GaitRunner:
    """A network running one plan, and the watchdog that compares it with the gait's orbit.

    Attributes:
        motion: the three that follow, and one of its own, in one array, shape (4, joints).
        angle: of each joint from the stand, rad.
        d_angle_d_phase: its derivative by phase, rad per cycle.
        reach: its derivative by the stride of the joint's leg, rad; only with a drive.
        legs: phase of each leg, cycles.

    """

    def __init__(self, plan: GaitPlan, transition: float,
                 drive: StrideCommand | None = None) -> None:
        """Run a plan, its strides as long as a drive has them, if there is one."""
        self.transition = transition
        self.progress = 0.0
        self.drive = drive
        self._leg = plan.robot.leg_of_joint
        self.motion = np.zeros((4, self._leg.size))
        self.angle, self.d_angle_d_phase, self.reach, self._lift = self.motion
        self.legs = np.zeros(len(plan.robot.legs))
        self.stepper = plan.seed.copy()
        self._clocks = plan.readout.clocks(0.0)
        self.settling = self._calm = self._still = 0.0
        self.follow(plan)

    def follow(self, plan: GaitPlan) -> None:
        """Read joints and judge health by this plan from now on."""
        self.plan = plan
        self._least = AT_REST * float(plan.orbit.levels[0, 0, 1])
        self._astray = 0.0
        self._look(0.0)
        self.phase = float(self.legs[0])

    def _look(self, strides: float) -> float:
        plan, now = self.plan, self.stepper.now
        angle, d_angle_d_phase = self.angle, self.d_angle_d_phase
        clocks = self._clocks
        distance = plan.readout.look(now, strides, clocks, angle, d_angle_d_phase, self.legs)
        if self.drive is not None:
            plan.in_place.look(now, 0.0, clocks, self.reach, self._lift, self.legs)
            lengthen(self.drive.stride, self._leg, plan.shift, self.motion)
        else:
            angle += plan.shift
        return distance

    def advance(self, strides: float) -> bool:
        """Advance by some strides; tell whether the network is still on its orbit."""
        self.stepper.advance(strides * self.plan.orbit.period)
        distance = self._look(strides)
        expected = self.phase + strides
        if not math.isfinite(distance):
            self.phase = expected % 1.0
            return False
        error = (self.legs[0] - expected + 0.5) % 1.0 - 0.5
        # The clock follows the network's own phase within two strides.
        self.phase = (expected + min(1.0, 0.5 * strides) * error) % 1.0
        if self.settling > 0.0:
            # A stride on the orbit is the end of it; for an instant a small state may look so.
            self._calm = self._calm + strides if distance < FAR / 3 else 0.0
            self.settling = 0.0 if self._calm > 1.0 else self.settling - strides
            # Come to rest, where the network has a stable equilibrium beside the gait?
            moving = np.abs(self.stepper.now[1]).max() * self.plan.orbit.period
            self._still = self._still + strides if moving < self._least else 0.0
            if self._still > 1.0:
                self.settling, self._astray = 0.0, 2.0 * PATIENCE
            self.phase = float(self.legs[0])
        elif distance > FAR or abs(error) > ASTRAY:
            self._astray += strides
        else:
            self._astray = 0.0
        return self._astray <= PATIENCE

    def reseed(self, phase: float | None = None) -> None:
        """Put the network on its orbit where its first leg is at a phase, cycles.

        The phase is the clock's if not given.
        """
        ahead = ((self.phase if phase is None else phase) - self.plan.readout.start) % 1.0
        self.stepper = self.plan.seed.copy()
        self.stepper.advance(ahead * self.plan.orbit.period)
        self._clocks = self.plan.readout.clocks(ahead)
        self._look(0.0)
        self.phase = float(self.legs[0])
        self.settling = self._astray = 0.0

    def drift_to(self, plan: GaitPlan) -> None:
        """Take a plan's parameters and leave the change to the network's own dynamics.

        A gait in whose class the state has nothing, as between any two gaits on their exact
        orbits, gets a small start; the lock would otherwise hold the network at rest.
        """
        orbit = plan.orbit
        self.stepper.set(orbit.network, plan.gain, orbit.symmetry)
        mean, basis = plan.wave
        at = (self.phase - plan.readout.start) % 1.0 * orbit.period
        state, target = self.stepper.newest() - mean, orbit(np.array(at)) - mean
        if np.linalg.norm(basis @ state) < KICK * np.linalg.norm(basis @ target):
            self.stepper.superpose(lambda times: KICK * (orbit(at + times) - mean),
                                   lambda times: KICK * orbit.derivative(at + times))
        # On to the node where the change is, so that all of it shows at once.
        self.stepper.advance(self.stepper.ahead)
        self.follow(plan)
        self.settling, self._calm, self._still = SETTLING, 0.0, 0.0


#: Jumps are absorbed over this time (s).
ABSORB = 0.3


class BumplessTransfer:
    """Absorbs a jump of joint positions and velocities: the difference decays smoothly."""

    def __init__(self) -> None:
        self._jump: tuple[np.ndarray, np.ndarray] | None = None
        self._time = ABSORB

    @property
    def active(self) -> bool:
        """Tell whether a jump is being absorbed."""
        return self._time < ABSORB

    def begin(self) -> None:
        """Mark a jump of the output here; the next ``smooth`` measures it."""
        self._jump, self._time = None, 0.0

    def smooth(self, wanted: np.ndarray, rate: np.ndarray, dt: float,
               before: tuple[np.ndarray, np.ndarray]) -> tuple[np.ndarray, np.ndarray]:
        """Add a difference that starts where the output was and decays.

        Args:
            wanted: positions, rad, (joints,).
            rate: their velocities, rad/s.
            dt: since the last time, s.
            before: what was returned then.

        """
        if self._jump is None:
            self._jump = (before[0] + dt * before[1] - wanted, before[1] - rate)
        else:
            self._time += dt
        gap, gap_rate = come_to_rest(*self._jump, 0.0, ABSORB, min(1.0, self._time / ABSORB))
        return wanted + gap, rate + gap_rate


class Ramp:
    """A level between the stand and the gait, and its rate, on the way to its target.

    Attributes:
        level: 0 at the stand, 1 in the full gait, or where the joints were found.
        rate: its derivative, 1/s of the pattern's clock.

    """

    def __init__(self, level: float = 0.0) -> None:
        """Rest at a level."""
        self.level, self.rate = level, 0.0
        self._parts: deque[tuple[float, float, float, float]] = deque()
        self._past = 0.0

    @property
    def active(self) -> bool:
        """Whether the level is on its way."""
        return bool(self._parts)

    def go(self, end: float, time: float) -> None:
        """Plan the level's way to its end in s, from its present value and rate, no overshoot.

        Cubics that end at rest, each (start, rate, end, time). One that starts towards its end
        stays in between if it takes no longer than 3 |end - start| / |rate|.
        """
        level, rate = self.level, self.rate
        self._parts.clear()
        self._past = 0.0
        if rate * (end - level) < 0.0:
            # Turned round half way: brake first, within half of the room that is left.
            turn = level + 0.5 * ((1.0 if rate > 0.0 else 0.0) - level)
            self._parts.append((level, rate, turn, 2.0 * (turn - level) / rate))
            level, rate = turn, 0.0
        if rate:
            time = min(time, 3.0 * (end - level) / rate)
        self._parts.append((level, rate, end, time))

    def advance(self, clock: float) -> None:
        """Advance by a time in s."""
        start, start_rate, end, time = self._parts[0]
        self._past += clock
        s = self._past / time if time > 0.0 else 1.0
        if s >= 1.0:
            self._parts.popleft()
            self._past = 0.0
            self.level, self.rate = end, 0.0
            return
        self.level, self.rate = come_to_rest(start, start_rate, end, time, s)


#: A joint whose command stood still for this time (s) has come to rest.
HOLD = 0.1
#: The clock is slowed in for as long as the stall was, but no longer than this (s).
LONGEST = 0.5


class StallRecovery:
    """The pace of a clock: 1, and less after a stall."""

    def __init__(self) -> None:
        self._time = self._past = self._low = 0.0

    @property
    def active(self) -> bool:
        """Whether the clock is being slowed in."""
        return self._time > 0.0

    def begin(self, stall: float) -> None:
        """Slow the clock in after a stall in s: the longer, the more the joints have stopped."""
        fraction = self._pace(self._past / self._time) if self.active else 1.0
        self._low = fraction * max(0.0, 1.0 - stall / HOLD)
        self._time = min(LONGEST, stall + self._time - self._past)
        self._past = 0.0

    def _pace(self, s: float) -> float:
        return self._low + (1.0 - self._low) * smoothstep(s)[0]

    def advance(self, dt: float) -> tuple[float, float]:
        """Return how far the clock goes in dt, s, and its pace at the end of it."""
        time, low = self._time, self._low
        before, after = self._past / time, min(1.0, (self._past + dt) / time)
        # The integral of the smooth step.
        risen = after**3 * (1.0 - 0.5 * after) - before**3 * (1.0 - 0.5 * before)
        way = time * (low * (after - before) + (1.0 - low) * risen)
        way += max(0.0, self._past + dt - time)
        self._past += dt
        if after == 1.0:
            self._time = self._past = 0.0
        return way, self._pace(after)


#: Cross-fades and ramps are worked out at least this often (s), whatever the tick.
SUBSTEP = 1e-3
#: No ramp or cross-fade is shorter (s): the clock is slowed from substep to substep, and a joint
#: that has to get up to speed within one would outrun its limit before that.
SHORTEST = 0.05
#: Most gaits fading into one another at once; a further one waits for a place.
MOST_TRACKS = 4
#: A joint may cover the shift between the stand and a gait at this many times it a second.
SHIFTING = 2.0
#: Fraction of the bound on speed to keep to at a substep, so that none is passed between two.
SHORT_OF = 0.997


class Pattern:
    """Joint positions and velocities of a robot in its gait.

    ``advance`` belongs to one thread; ``apply`` and ``enable`` may be called from another.

    Attributes:
        position, velocity: of each joint, rad and rad/s, leg by leg; overwritten by advance.
        faults: times the watchdog had to put the network back on its orbit.
        held: ticks in which a limit held a joint back.
        correct: takes and returns angles before limits hold them; None for the gait as it is.
        frequency_scale: factor of the pattern's clock.
        substep: longest part of a tick while gaits fade or the ramp moves, s.

    """

    def __init__(self, plan: GaitPlan, ramp: float = 1.0, enabled: bool = True,
                 drive: StrideCommand | None = None) -> None:
        """Stand, then go into the gait within ``ramp`` s if enabled; a drive steers it."""
        robot = plan.robot
        self.robot, self.drive = robot, drive
        self._leg = robot.leg_of_joint
        self.faults = self.held = 0
        self.correct: Callable[[np.ndarray], np.ndarray] | None = None
        self.frequency_scale, self.substep = 1.0, SUBSTEP
        self._offset = robot.column('offset')
        self._limits = np.stack([robot.column(name) for name in ('lower', 'upper', 'velocity')])
        self._fastest = self._limits[2]
        self._requests: deque = deque()
        self._tracks = [GaitRunner(plan, 0.0, drive)]
        self.position, self.velocity = self._offset.copy(), np.zeros_like(self._offset)
        self.restart(ramp, enabled)

    def restart(self, ramp: float, enabled: bool = True) -> None:
        """Begin anew at phase 0, with the newest plan, from where the joints are."""
        newest = self._tracks[-1]
        newest.reseed(0.0)
        self._tracks = [newest]
        self.velocity[:] = 0.0
        self._wanted, self._rate = self.position.copy(), self.velocity.copy()
        self._behind = np.zeros(self._offset.size, dtype=bool)
        self._corrected, self._correction = np.zeros((2, self._offset.size))
        self._absorption, self._recovering = BumplessTransfer(), False
        self._slowing = self._slower = 1.0
        self._frequency = newest.plan.frequency
        self._last_rate: np.ndarray | None = None
        self._resumption = StallRecovery()
        self._ramp = Ramp()
        self._ramp.go(float(enabled), max(ramp, SHORTEST))
        self.enabled = enabled
        self.start_from(self.position, ramp)

    def start_from(self, angles: np.ndarray, time: float) -> None:
        """Begin at these angles, rad, (joints,), and lead the joints to the stand in s or more.

        To be called before the first advance. No joint takes more than half of its speed limit.
        """
        # Where the joints were found, from the stand, and what is left of that.
        self._found, self._lead = angles - self._offset, Ramp(1.0)
        self.position[:] = np.clip(angles, *self._limits[:2])
        if self._found.any():
            self._lead_in(time)

    def _lead_in(self, time: float) -> None:
        left = self._lead.level * np.abs(self._found)
        fastest = float(np.max(1.5 * left / np.maximum(0.5 * self._fastest, 1e-9)))
        self._lead.go(0.0, max(time, SHORTEST, fastest))

    # -- requests from other threads ------------------------------------------------------

    def apply(self, plan: GaitPlan, transition: float) -> None:
        """Change to a plan over a transition in s; 0 leaves it to the network's dynamics."""
        # Seeding an orbit takes its time: here, in the caller's thread, not in that of the ticks.
        prepared = GaitRunner(plan, max(transition, SHORTEST), self.drive)
        self._requests.append((plan, prepared if transition > 0.0 else None))

    def enable(self, enabled: bool, ramp: float) -> None:
        """Ramp into the gait, or down to the stand, over a time in s."""
        self._requests.append((enabled, max(ramp, SHORTEST)))

    def steer(self, stride: np.ndarray, pace: float) -> None:
        """Request the legs' strides, shape (legs,), and the pace; see Drive.

        Raises:
            ValueError: the pattern was made without a drive.

        """
        if self.drive is None:
            raise ValueError('this pattern has no drive')
        self.drive.set_target(stride, pace, at_once=self._ramp.level == 0.0)

    def attach(self, drive: StrideCommand) -> None:
        """Use a drive from now on; one that has no target yet changes nothing."""
        self.drive = drive
        for track in self._tracks:
            track.drive = drive

    @property
    def plan(self) -> GaitPlan:
        """The newest plan in force."""
        return self._tracks[-1].plan

    @property
    def fading(self) -> tuple[GaitPlan, GaitPlan, float]:
        """The plan that fades out, the newest in force, and the fraction of that."""
        if len(self._tracks) == 1:
            return self._tracks[0].plan, self._tracks[0].plan, 0.0
        older, newest = self._tracks[-2:]
        return older.plan, newest.plan, smoothstep(newest.progress)[0]

    @property
    def phases(self) -> np.ndarray:
        """Phase of each leg in cycles, shape (legs,); 0 is where its cell peaks."""
        return self._tracks[-1].legs

    @property
    def state(self) -> np.ndarray:
        """The newest network's state and its rate, shape (2, components), of advance's own."""
        return self._tracks[-1].stepper.now[:2]

    @property
    def level(self) -> float:
        """0 at the stand, 1 in the full gait."""
        return self._ramp.level

    @property
    def standing(self) -> bool:
        """Tell whether it is disabled and the ramp has ended."""
        return not (self.enabled or self._ramp.level or self._requests or self._lead.active)

    @property
    def in_transition(self) -> bool:
        """Tell whether gaits are still fading into one another, or settling."""
        return len(self._tracks) > 1 or self._tracks[-1].settling > 0.0

    @property
    def recovering(self) -> bool:
        """Tell whether the pattern is still recovering from a fault."""
        return self._recovering and self._absorption.active

    # -- the tick --------------------------------------------------------------------------

    def advance(self, dt: float) -> None:
        """Advance by dt in s and fill position, velocity and phases."""
        if self._requests:
            self._take_requests()
        slow = self._resumption
        clock, fraction = slow.advance(dt) if slow.active else (dt, 1.0)
        clock, fraction = self.frequency_scale * clock, self.frequency_scale * fraction
        calm = (len(self._tracks) == 1 and not (self._ramp.active or self._lead.active)
                and not self._absorption.active)
        if not (calm and self._cruise(clock)):
            parts = max(1, math.ceil(clock / self.substep - 1e-9))
            for _ in range(parts):
                self._step(clock / parts)
        wanted, rate = self._wanted, self._rate if fraction == 1.0 else fraction * self._rate
        if self.correct is not None:
            wanted = self.correct(wanted)
            now, before = self._correction, self._corrected
            np.subtract(wanted, self._wanted, out=now)
            if dt > 0.0:
                np.subtract(now, before, out=before)
                before /= dt
                before += rate
                rate = before
            self._corrected, self._correction = now, before
        self.held += confine(wanted, rate, self._limits, dt, self.position, self.velocity,
                             self._behind) > 0

    def resume(self, stall: float) -> None:
        """Resume after a stall in s from where the pattern stopped, slowly at first.

        Belongs to the thread of advance.
        """
        self._resumption.begin(stall)

    def _take_requests(self) -> None:
        waiting = []
        while self._requests:
            what, how = self._requests.popleft()
            if isinstance(what, bool):
                self.enabled = what
                self._ramp.go(float(what), how)
                if self._lead.active and not what:
                    self._lead_in(how)
            elif how is None:
                del self._tracks[:-1]
                self._tracks[0].drift_to(what)
                self._absorption.begin()
            elif len(self._tracks) < MOST_TRACKS:
                how.reseed(self._tracks[-1].phase)
                how.drive = self.drive
                self._tracks.append(how)
            else:
                # Of those that wait, only the last one matters.
                waiting = [(what, how)]
        self._requests.extend(waiting)

    def _cruise(self, dt: float) -> bool:
        """One gait, at the stand or in full swing: nothing to mix, nothing to allocate.

        Returns False if the network left its orbit: the tick must then be computed again.
        """
        self._slowing, self._slower, self._last_rate = 1.0, 1.0, None
        track, drive = self._tracks[0], self.drive
        frequency = track.plan.frequency
        if drive is not None:
            drive.advance(dt)
            frequency *= drive.pace
        strides = 0.5 * (self._frequency + frequency) * dt
        self._frequency = frequency
        if not track.advance(strides):
            track.phase -= strides
            self._recover(track)
            self._step(0.0)
            return False
        if drive is not None:
            scale(self._ramp.level, frequency, drive.rate, self._leg, self._offset, track.motion,
                  self._wanted, self._rate)
            return True
        np.multiply(track.angle, self._ramp.level, out=self._wanted)
        self._wanted += self._offset
        np.multiply(track.d_angle_d_phase, self._ramp.level * frequency, out=self._rate)
        return True

    def _recover(self, track: GaitRunner) -> None:
        self.faults += 1
        self._recovering = True
        track.reseed()
        self._absorption.begin()

    def _step(self, dt: float) -> None:
        # Slowing and frequency run linearly from tick to tick, as the velocities say.
        clock = 0.5 * dt * (self._slowing + self._slower)
        self._slowing = self._slower
        tracks = self._tracks
        first = tracks[0]
        frequency, moving = first.plan.frequency, len(tracks) > 1
        fades = []
        if moving:
            for track in tracks[1:]:
                track.progress = min(1.0, track.progress + clock / track.transition)
                fraction, slope = smoothstep(track.progress)
                fades.append((fraction, slope / track.transition))
                frequency += fraction * (track.plan.frequency - frequency)
        if self.drive is not None:
            self.drive.advance(dt)
            frequency *= self.drive.pace
        strides = 0.5 * (self._frequency + frequency) * clock
        self._frequency = frequency
        for track in tracks:
            if not track.advance(strides):
                self._recover(track)

        wanted, rate = first.angle, self._rate_of(first, frequency)
        for track, (fraction, slope) in zip(tracks[1:], fades, strict=True):
            rate = (rate + fraction * (self._rate_of(track, frequency) - rate)
                    + slope * (track.angle - wanted))
            wanted = wanted + fraction * (track.angle - wanted)
        while len(tracks) > 1 and tracks[1].progress >= 1.0:
            del tracks[0]

        if self._ramp.active:
            moving = True
            # First to the stand: the gait swings about it, not about where the joints were.
            if not self._lead.active:
                self._ramp.advance(clock)
        if self._ramp.level != 1.0 or self._ramp.rate:
            rate = self._ramp.level * rate + self._ramp.rate * wanted
            wanted = self._ramp.level * wanted
        found = np.zeros_like(wanted)
        if self._lead.active:
            moving, found = True, self._found
            self._lead.advance(clock)
            wanted, rate = wanted + self._lead.level * found, rate + self._lead.rate * found
        if moving:
            # The pattern slows where it would outrun the gaits at the next substep.
            bound = SHORT_OF * np.minimum(np.max([t.plan.speed + SHIFTING * (
                np.abs(t.plan.shift) + np.abs(found)) for t in tracks], axis=0), self._fastest)
            ahead = rate if self._last_rate is None else 2.0 * rate - self._last_rate
            self._last_rate = rate
            self._slower = 1.0 / max(1.0, float(np.max(np.abs(ahead) / np.maximum(bound, 1e-9))))
            rate = self._slowing * rate
        else:
            self._slowing, self._slower, self._last_rate = 1.0, 1.0, None

        if self._absorption.active:
            self._wanted[:], self._rate[:] = self._absorption.smooth(
                wanted + self._offset, rate, dt, (self._wanted, self._rate))
            self._recovering = self.recovering
        else:
            np.add(wanted, self._offset, out=self._wanted)
            self._rate[:] = rate

    def _rate_of(self, track: GaitRunner, frequency: float) -> np.ndarray:
        rate = track.d_angle_d_phase * frequency
        if self.drive is not None:
            rate += self.drive.rate[self._leg] * track.reach
        return rate
