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

"""The moving pattern: from programs to joint positions and velocities, tick by tick.

A gait switch cross-fades two networks whose legs share one phase; a ramp scales the whole
pattern between the stand (every joint at its offset) and the gait; a watchdog compares the
network with its orbit. All three run on the pattern's own clock, which is slowed while they
move whenever a joint would exceed the speed that the gaits themselves reach, and after a stall.
"""

from collections import deque
from collections.abc import Callable
import math

from cpg_ros.motion.absorption import Absorption
from cpg_ros.motion.plan import GaitPlan
from cpg_ros.motion.ramp import Ramp
from cpg_ros.motion.readout import confine
from cpg_ros.motion.resumption import Resumption
from cpg_ros.motion.smoothstep import smoothstep
from cpg_ros.motion.strides import Drive, scale
from cpg_ros.motion.track import Track
import numpy as np

#: Cross-fades and ramps are worked out at least this often (s), whatever the tick.
SUBSTEP = 1e-3
#: No ramp or cross-fade is shorter (s): the clock is slowed from substep to substep, and a joint
#: that has to get up to speed within one would outrun its limit before that.
SHORTEST = 0.05
#: Most gaits fading into one another at once; a further one waits for a place.
MOST_TRACKS = 4
#: A joint may cover the shift between the stand and a gait at this many times it a second.
SHIFTING = 2.0
#: Share of the bound on speed to keep to at a substep, so that none is passed between two.
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

    def __init__(self, program: GaitPlan, ramp: float = 1.0, enabled: bool = True,
                 drive: Drive | None = None) -> None:
        """Stand, then go into the gait within ``ramp`` s if enabled; a drive steers it."""
        robot = program.robot
        self.robot, self.drive = robot, drive
        self._leg = robot.leg_of_joint
        self.faults = self.held = 0
        self.correct: Callable[[np.ndarray], np.ndarray] | None = None
        self.frequency_scale, self.substep = 1.0, SUBSTEP
        self._offset = robot.column('offset')
        self._limits = np.stack([robot.column(name) for name in ('lower', 'upper', 'velocity')])
        self._fastest = self._limits[2]
        self._requests: deque = deque()
        self._tracks = [Track(program, 0.0, drive)]
        self.position, self.velocity = self._offset.copy(), np.zeros_like(self._offset)
        self.restart(ramp, enabled)

    def restart(self, ramp: float, enabled: bool = True) -> None:
        """Begin anew at phase 0, with the newest program, from where the joints are."""
        newest = self._tracks[-1]
        newest.reseed(0.0)
        self._tracks = [newest]
        self.velocity[:] = 0.0
        self._wanted, self._rate = self.position.copy(), self.velocity.copy()
        self._behind = np.zeros(self._offset.size, dtype=bool)
        self._corrected, self._correction = np.zeros((2, self._offset.size))
        self._absorption, self._recovering = Absorption(), False
        self._slowing = self._slower = 1.0
        self._frequency = newest.program.frequency
        self._last_rate: np.ndarray | None = None
        self._resumption = Resumption()
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

    def apply(self, program: GaitPlan, transition: float) -> None:
        """Change to a program over a transition in s; 0 leaves it to the network's dynamics."""
        # Seeding an orbit takes its time: here, in the caller's thread, not in that of the ticks.
        prepared = Track(program, max(transition, SHORTEST), self.drive)
        self._requests.append((program, prepared if transition > 0.0 else None))

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

    def attach(self, drive: Drive) -> None:
        """Use a drive from now on; one that has no target yet changes nothing."""
        self.drive = drive
        for track in self._tracks:
            track.drive = drive

    @property
    def program(self) -> GaitPlan:
        """The newest program in force."""
        return self._tracks[-1].program

    @property
    def fading(self) -> tuple[GaitPlan, GaitPlan, float]:
        """The program that fades out, the newest in force, and the share of that."""
        if len(self._tracks) == 1:
            return self._tracks[0].program, self._tracks[0].program, 0.0
        older, newest = self._tracks[-2:]
        return older.program, newest.program, smoothstep(newest.progress)[0]

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
        clock, share = slow.advance(dt) if slow.active else (dt, 1.0)
        clock, share = self.frequency_scale * clock, self.frequency_scale * share
        calm = (len(self._tracks) == 1 and not (self._ramp.active or self._lead.active)
                and not self._absorption.active)
        if not (calm and self._cruise(clock)):
            parts = max(1, math.ceil(clock / self.substep - 1e-9))
            for _ in range(parts):
                self._step(clock / parts)
        wanted, rate = self._wanted, self._rate if share == 1.0 else share * self._rate
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
        frequency = track.program.frequency
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
        np.multiply(track.rise, self._ramp.level * frequency, out=self._rate)
        return True

    def _recover(self, track: Track) -> None:
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
        frequency, moving = first.program.frequency, len(tracks) > 1
        fades = []
        if moving:
            for track in tracks[1:]:
                track.progress = min(1.0, track.progress + clock / track.transition)
                share, share_rate = smoothstep(track.progress)
                fades.append((share, share_rate / track.transition))
                frequency += share * (track.program.frequency - frequency)
        if self.drive is not None:
            self.drive.advance(dt)
            frequency *= self.drive.pace
        strides = 0.5 * (self._frequency + frequency) * clock
        self._frequency = frequency
        for track in tracks:
            if not track.advance(strides):
                self._recover(track)

        wanted, rate = first.angle, self._rate_of(first, frequency)
        for track, (share, share_rate) in zip(tracks[1:], fades, strict=True):
            rate = (rate + share * (self._rate_of(track, frequency) - rate)
                    + share_rate * (track.angle - wanted))
            wanted = wanted + share * (track.angle - wanted)
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
            bound = SHORT_OF * np.minimum(np.max([t.program.speed + SHIFTING * (
                np.abs(t.program.shift) + np.abs(found)) for t in tracks], axis=0), self._fastest)
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
            self._wanted[:] = wanted
            self._wanted += self._offset
            self._rate[:] = rate

    def _rate_of(self, track: Track, frequency: float) -> np.ndarray:
        rate = track.rise * frequency
        if self.drive is not None:
            rate += self.drive.rate[self._leg] * track.reach
        return rate
