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

"""The patterns of many runs: orbits looked up, ramped in, steered, switched, held to limits."""

from collections.abc import Mapping, Sequence

from cpg_ros.feedback.timetable import POINTS, Timetable
from cpg_ros.integration.jit import entry
from cpg_ros.motion.plan import GaitPlan
from cpg_ros.motion.smoothstep import smoothstep
from cpg_ros.motion.strides import approach
from cpg_ros.simulation.scenario import Scenario
import numpy as np

#: From the stand into the gait, and from one gait into another, s.
RAMP, TRANSITION = 1.0, 1.0


class PatternBatch:
    """As many patterns as runs, which know the same gaits.

    Attributes:
        phase: of the first leg, cycles, shape (runs,).
        gaits: index of the gait that is left and of the one that is entered, shape (runs, 2).
        mix: share of the second, shape (runs,).
        level: 0 at the stand, 1 in the full gait.
        wanted: speed forward and to the left, m/s, shape (runs, 2).
        course: heading that follows from the turning wanted, rad, shape (runs,).
        planned: angles before any correction, rad, shape (runs, joints).

    """

    def __init__(self, programs: Mapping[str, GaitPlan], tables: Sequence[Timetable],
                 scenarios: Sequence[Scenario], dt: float) -> None:
        """Stand; the first program is the one that all runs begin with."""
        self._programs, self._names, self._dt = list(programs.values()), list(programs), dt
        robot, runs = self._programs[0].robot, len(scenarios)
        self._angles = np.stack([one.angles for one in tables])
        self._still = np.stack([one.in_place for one in tables])
        self._frequency = np.array([one.frequency for one in self._programs])
        self._leg, self._offset = robot.leg_of_joint, robot.column('offset')
        self._lower, self._upper = robot.column('lower'), robot.column('upper')
        self._reach = robot.column('velocity') * dt
        legs = len(robot.legs)
        self.phase = np.array([one.phase for one in scenarios])
        self.gaits, self._faded = np.zeros((runs, 2), dtype=np.int64), np.ones(runs)
        self.mix, self.course = np.ones(runs), np.zeros(runs)
        self.wanted, self._turning = np.zeros((runs, 2)), np.zeros(runs)
        self.wanted[:, 0] = [one.speed for one in scenarios]
        # The strides of the legs and the pace, as of motion.steering.Drive.
        self._target = np.ones((runs, legs + 1))
        for run in range(runs):
            self._ask(run)
        self._drive, self._rate = self._target.copy(), np.zeros((runs, legs + 1))
        self._last = np.tile(self._offset, (runs, 1))
        self.planned = self._last.copy()
        self._time = self.level = 0.0
        self._events: list[tuple[float, int, str, tuple[float, ...]]] = sorted(
            [(wish[0], run, '', wish[1:]) for run, one in enumerate(scenarios)
             for wish in one.commands]
            + [(when, run, name, ()) for run, one in enumerate(scenarios)
               for when, name in one.switches], reverse=True)

    def _ask(self, run: int) -> None:
        program = self._programs[self.gaits[run, 1]]
        self._target[run] = 1.0
        if program.motion.steering is not None:
            self._target[run, :-1], self._target[run, -1] = program.steer(
                self.wanted[run, 0], self._turning[run])

    def advance(self, stride: np.ndarray, frequency_scale: np.ndarray) -> None:
        """Advance, with strides changed, shape (runs, legs), and clocks hurried, shape (runs,)."""
        self._time += self._dt
        while self._events and self._events[-1][0] <= self._time:
            _, run, name, wish = self._events.pop()
            if name:
                self.gaits[run] = self.gaits[run, 1], self._names.index(name)
                self._faded[run] = 0.0
            else:
                self.wanted[run], self._turning[run] = wish[:2], wish[2]
            self._ask(run)
        self.level = smoothstep(min(1.0, self._time / RAMP))[0]
        _advance(self._angles, self._still, self._frequency, self._leg, self._offset, self._target,
                 self._drive, self._rate, stride, frequency_scale, self.phase, self.gaits,
                 self._faded, self.mix, self._turning, self.course, self.level, self._dt,
                 self.planned)

    def confine(self, angles: np.ndarray) -> np.ndarray:
        """Hold angles to the joints' limits and speeds."""
        _confine(angles, self._last, self._lower, self._upper, self._reach)
        return self._last


@entry
def _advance(angles, still, frequencies, legs, offset, targets, drive, rates, strides,
             frequency_scales, phases, gaits, faded, mix, turning, course, level, dt, planned):
    """Advance each run; arguments as of PatternBatch."""
    for run in range(len(phases)):
        old, new, clock = gaits[run, 0], gaits[run, 1], frequency_scales[run] * dt
        faded[run] = min(1.0, faded[run] + clock / TRANSITION)
        s = faded[run]
        mix[run] = s * s * (3.0 - 2.0 * s)
        if s == 1.0:
            old = gaits[run, 0] = new
        approach(targets[run], strides[run], clock, drive[run], rates[run])
        frequency = frequencies[old] + mix[run] * (frequencies[new] - frequencies[old])
        phases[run] = (phases[run] + frequency * drive[run, -1] * clock) % 1.0
        course[run] += turning[run] * dt
        place = phases[run] * POINTS
        low = int(place) % POINTS
        high, on = (low + 1) % POINTS, place - int(place)
        for joint in range(len(offset)):
            stride, found = drive[run, legs[joint]], 0.0
            for gait, share in ((old, 1.0 - mix[run]), (new, mix[run])):
                rest = still[gait, low, joint] + on * (still[gait, high, joint]
                                                       - still[gait, low, joint])
                full = angles[gait, low, joint] + on * (angles[gait, high, joint]
                                                        - angles[gait, low, joint])
                found += share * (rest + stride * (full - rest))
            planned[run, joint] = offset[joint] + level * found


@entry
def _confine(angles, last, lower, upper, reach):
    for run in range(len(angles)):
        for k in range(len(lower)):
            near = min(max(angles[run, k], last[run, k] - reach[k]), last[run, k] + reach[k])
            last[run, k] = min(max(near, lower[k]), upper[k])
