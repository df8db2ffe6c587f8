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

"""One network running one gait, and the watchdog that compares it with the gait's orbit."""

import math

from cpg_ros.motion.plan import GaitPlan
from cpg_ros.motion.strides import Drive, lengthen
import numpy as np

#: Off the orbit: a cell further away than this share of the peak, or the phase behind or ahead
#: of the clock by this share of a cycle, for longer than this many strides.
FAR, ASTRAY, PATIENCE = 0.3, 0.15, 0.5
#: Strides the network gets to find its new gait by itself after a transition of 0 s.
SETTLING = 40.0
#: At rest: no state changes by more than this share of a cell's range in a stride.
AT_REST = 0.05
#: Such a transition starts with at least this share of the new gait in the state.
KICK = 0.05


class Track:
    """A network running one program.

    Attributes:
        motion: the three that follow, and one of its own, in one array, shape (4, joints).
        angle: of each joint from the stand, rad.
        rise: its derivative by phase, rad per cycle.
        reach: its derivative by the stride of the joint's leg, rad; only with a drive.
        legs: phase of each leg, cycles.

    """

    def __init__(self, program: GaitPlan, transition: float, drive: Drive | None = None) -> None:
        """Run a program, its strides as long as a drive has them, if there is one."""
        self.transition = transition
        self.progress = 0.0
        self.drive = drive
        self._leg = program.robot.leg_of_joint
        self.motion = np.zeros((4, self._leg.size))
        self.angle, self.rise, self.reach, self._lift = self.motion
        self.legs = np.zeros(len(program.robot.legs))
        self.stepper = program.seed.copy()
        self._clocks = program.readout.clocks(0.0)
        self.settling = self._calm = self._still = 0.0
        self.follow(program)

    def follow(self, program: GaitPlan) -> None:
        """Read joints and judge health by this program from now on."""
        self.program = program
        self._least = AT_REST * float(program.orbit.levels[0, 0, 1])
        self._astray = 0.0
        self._look(0.0)
        self.phase = float(self.legs[0])

    def _look(self, strides: float) -> float:
        program, now, angle, rise = self.program, self.stepper.now, self.angle, self.rise
        clocks = self._clocks
        distance = program.readout.look(now, strides, clocks, angle, rise, self.legs)
        if self.drive is not None:
            program.in_place.look(now, 0.0, clocks, self.reach, self._lift, self.legs)
            lengthen(self.drive.stride, self._leg, program.shift, self.motion)
        else:
            angle += program.shift
        return distance

    def advance(self, strides: float) -> bool:
        """Advance by some strides; tell whether the network is still on its orbit."""
        self.stepper.advance(strides * self.program.orbit.period)
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
            moving = np.abs(self.stepper.now[1]).max() * self.program.orbit.period
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
        ahead = ((self.phase if phase is None else phase) - self.program.readout.start) % 1.0
        self.stepper = self.program.seed.copy()
        self.stepper.advance(ahead * self.program.orbit.period)
        self._clocks = self.program.readout.clocks(ahead)
        self._look(0.0)
        self.phase = float(self.legs[0])
        self.settling = self._astray = 0.0

    def drift_to(self, program: GaitPlan) -> None:
        """Take a program's parameters and leave the change to the network's own dynamics.

        A gait in whose class the state has nothing, as between any two gaits on their exact
        orbits, gets a small start; the lock would otherwise hold the network at rest.
        """
        orbit = program.orbit
        self.stepper.set(orbit.network, program.gain, orbit.symmetry)
        mean, basis = program.wave
        at = (self.phase - program.readout.start) % 1.0 * orbit.period
        state, target = self.stepper.newest() - mean, orbit(np.array(at)) - mean
        if np.linalg.norm(basis @ state) < KICK * np.linalg.norm(basis @ target):
            self.stepper.superpose(lambda times: KICK * (orbit(at + times) - mean),
                                   lambda times: KICK * orbit.derivative(at + times))
        # On to the node where the change is, so that all of it shows at once.
        self.stepper.advance(self.stepper.ahead)
        self.follow(program)
        self.settling, self._calm, self._still = SETTLING, 0.0, 0.0
