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
from typing import NamedTuple

from cpg_ros.feedback.interpolation import between_phases
from cpg_ros.feedback.tick import PlannedMotion
from cpg_ros.feedback.timetable import POINTS, Timetable
from cpg_ros.integration.jit import entry, jit
from cpg_ros.motion.plan import GaitPlan
from cpg_ros.motion.smoothstep import smoothstep
from cpg_ros.motion.strides import approach
from cpg_ros.simulation.scenario import Scenario
import numpy as np

#: From the stand into the gait, and from one gait into another, s.
RAMP, TRANSITION = 1.0, 1.0

_smoothstep = jit(smoothstep)


class _Gaits(NamedTuple):
    """The gaits that all runs know, at even phases, and the joints that they move."""

    angles: np.ndarray
    in_place: np.ndarray
    frequency: np.ndarray
    leg: np.ndarray
    offset: np.ndarray


class _Drives(NamedTuple):
    """Strides of the legs and pace, as of motion.strides.Drive, and what else changes a run."""

    target: np.ndarray
    now: np.ndarray
    rate: np.ndarray
    faded: np.ndarray


class PatternBatch:
    """As many patterns as runs, which know the same gaits.

    Attributes:
        planned: the motion before any correction; its arrays are overwritten by advance.
        level: 0 at the stand, 1 in the full gait.
        limits: lowest and highest angles of the joints, rad, shape (joints,) each.

    """

    def __init__(self, programs: Mapping[str, GaitPlan], tables: Sequence[Timetable],
                 scenarios: Sequence[Scenario], dt: float) -> None:
        """Stand; the first program is the one that all runs begin with."""
        self._programs, self._names, self._dt = list(programs.values()), list(programs), dt
        robot, runs = self._programs[0].robot, len(scenarios)
        self._gaits = _Gaits(
            np.stack([one.angles for one in tables]), np.stack([one.in_place for one in tables]),
            np.array([one.frequency for one in self._programs]), robot.leg_of_joint,
            robot.column('offset'))
        self.limits = robot.column('lower'), robot.column('upper')
        self._reach = robot.column('velocity') * dt
        self._last = np.tile(self._gaits.offset, (runs, 1))
        self.planned = PlannedMotion(
            self._last.copy(), np.array([one.phase for one in scenarios]),
            np.zeros((runs, 2), dtype=np.int64), np.ones(runs),
            np.array([[one.speed, 0.0] for one in scenarios]), np.zeros(runs), np.zeros(runs))
        strides = np.ones((runs, len(robot.legs) + 1))
        self._drives = _Drives(strides, strides.copy(), np.zeros_like(strides), np.ones(runs))
        for run in range(runs):
            self._steer(run)
        self._drives.now[:] = strides
        self._time = self.level = 0.0
        self._events: list[tuple[float, int, str, tuple[float, ...]]] = sorted(
            [(wish[0], run, '', wish[1:]) for run, one in enumerate(scenarios)
             for wish in one.commands]
            + [(when, run, name, ()) for run, one in enumerate(scenarios)
               for when, name in one.switches], reverse=True)

    def _steer(self, run: int) -> None:
        program, target = self._programs[self.planned.gaits[run, 1]], self._drives.target[run]
        target[:] = 1.0
        if program.motion.steering is not None:
            target[:-1], target[-1] = program.steer(self.planned.velocity[run, 0],
                                                    self.planned.turn[run])

    def advance(self, stride: np.ndarray, frequency_scale: np.ndarray) -> None:
        """Advance by one time step.

        Args:
            stride: added to each leg's stride, shape (runs, legs).
            frequency_scale: factor of each run's clock, shape (runs,).

        """
        self._time += self._dt
        while self._events and self._events[-1][0] <= self._time:
            _, run, name, wish = self._events.pop()
            if name:
                self.planned.gaits[run] = self.planned.gaits[run, 1], self._names.index(name)
                self._drives.faded[run] = 0.0
            else:
                self.planned.velocity[run], self.planned.turn[run] = wish[:2], wish[2]
            self._steer(run)
        self.level = smoothstep(min(1.0, self._time / RAMP))[0]
        _advance(self._gaits, self._drives, stride, frequency_scale, self.level, self._dt,
                 self.planned)

    def confine(self, angles: np.ndarray) -> np.ndarray:
        """Hold angles to the joints' limits and speeds."""
        near = np.clip(angles, self._last - self._reach, self._last + self._reach)
        return np.clip(near, *self.limits, out=self._last)


@entry
def _advance(gaits, drives, strides, frequency_scales, level, dt, planned):
    """Advance each run by dt in s and fill what is planned; see PatternBatch.advance."""
    angles, still, frequency = gaits.angles, gaits.in_place, gaits.frequency
    drive, faded = drives.now, drives.faded
    for run in range(len(faded)):
        old, new, clock = planned.gaits[run, 0], planned.gaits[run, 1], frequency_scales[run] * dt
        faded[run] = min(1.0, faded[run] + clock / TRANSITION)
        mix = planned.mix[run] = _smoothstep(faded[run])[0]
        if faded[run] == 1.0:
            old = planned.gaits[run, 0] = new
        approach(drives.target[run], strides[run], clock, drive[run], drives.rate[run])
        mixed = frequency[old] + mix * (frequency[new] - frequency[old])
        phase = planned.phase[run] = (planned.phase[run] + mixed * drive[run, -1] * clock) % 1.0
        planned.heading[run] += planned.turn[run] * dt
        low, high, on = between_phases(phase * POINTS, POINTS)
        for joint in range(len(gaits.offset)):
            stride, found = drive[run, gaits.leg[joint]], 0.0
            for gait, share in ((old, 1.0 - mix), (new, mix)):
                rest = still[gait, low, joint] + on * (still[gait, high, joint]
                                                       - still[gait, low, joint])
                full = angles[gait, low, joint] + on * (angles[gait, high, joint]
                                                        - angles[gait, low, joint])
                found += share * (rest + stride * (full - rest))
            planned.angles[run, joint] = gaits.offset[joint] + level * found
