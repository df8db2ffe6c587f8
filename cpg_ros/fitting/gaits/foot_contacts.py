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

"""Stance and swing from the loads on the feet; walk and run from the flight.

A stride is from touchdown to touchdown; duty is the fraction of it in stance. In a walk a foot is
on the ground at any time, in a run there is flight (Alexander 2003, Principles of Animal
Locomotion). A runner's foot is foremost before it lands: contacts estimated from its motion begin
too early, and underestimate the flight.
"""

from collections.abc import Callable, Collection, Sequence
from dataclasses import dataclass

from cpg_ros.common.errors import ShortRepr
from cpg_ros.fitting.gaits.leg_names import legs_of, LegsError
from cpg_ros.fitting.gaits.steady_stretch import true_runs
from cpg_ros.fitting.recordings.recording import FootLoads
import numpy as np

#: CONTACT_THRESHOLD: of a foot on the ground, over the span from its least to its largest load.
#: MAX_SWING_LOAD: least load of a foot that is lifted at all, over its largest.
CONTACT_THRESHOLD, MAX_SWING_LOAD = 0.15, 0.5
#: Percentiles of a foot's loads that count as its least and largest.
LOW_PERCENTILE, HIGH_PERCENTILE = 5.0, 95.0
#: MIN_DURATION: of a contact or lift, over the stride; shorter ones are bounces and are ignored.
MIN_DURATION = 0.08
#: For the phase of touchdown. MAX_PHASE_SCATTER: mean distance of touchdowns from their median,
#: cycles; MIN_STANCE_RATIO: of a contact that counts, over the usual one.
MIN_STRIDES, MAX_PHASE_SCATTER, MIN_STANCE_RATIO = 3, 0.12, 0.5
#: MIN_STRIDE_SAMPLES: samples of a stride that tell stance from swing.
MIN_STRIDE_SAMPLES = 12
#: Fractions of the time in flight. MAX_WALK_FLIGHT is above 0, as a foot that is about to be
#: lifted bears little and may count as lifted. By the motion of the feet it is a run from
#: MAX_WALK_FLIGHT on, and a walk from as much double support on.
MAX_WALK_FLIGHT, MIN_RUN_FLIGHT = 0.1, 0.15


@dataclass(frozen=True, eq=False, repr=False)
class FootContacts(ShortRepr):
    """Contacts of the feet.

    Attributes:
        legs: their names.
        times: s, ascending, shape (n,).
        down: whether each foot is on the ground, bool, shape (n, legs).
        by_motion: whether contacts are estimated from the motion of the feet.

    """

    legs: tuple[str, ...]
    times: np.ndarray
    down: np.ndarray
    by_motion: bool = False

    def __str__(self) -> str:
        duty = ', '.join(f'{leg} {fraction:.0%}' for leg, fraction in self.duty.items())
        return f'{duty} of the time in stance, {self.flight:.0%} in flight'

    @property
    def source(self) -> str:
        """Source of the contacts."""
        return 'the motion of the feet' if self.by_motion else 'the loads on the feet'

    def _summary(self) -> str:
        return str(self)

    @property
    def duty(self) -> dict[str, float]:
        """Fraction of the time in stance, for each leg."""
        return dict(zip(self.legs, self.down.mean(axis=0).tolist(), strict=True))

    @property
    def flight(self) -> float:
        """Fraction of the time without a foot on the ground."""
        return float(1.0 - self.down.any(axis=1).mean())

    @property
    def gait(self) -> str | None:
        """Walk or run, or None if the flight is between theirs."""
        if self.by_motion:
            if self.flight >= MAX_WALK_FLIGHT:
                return 'run'
            return 'walk' if self.down.all(axis=1).mean() >= MAX_WALK_FLIGHT else None
        if self.flight <= MAX_WALK_FLIGHT:
            return 'walk'
        return 'run' if self.flight >= MIN_RUN_FLIGHT else None

    def leads(self, phase: Callable[[np.ndarray], np.ndarray], legs: Sequence[str]
              ) -> dict[str, float] | None:
        """Return by how much each leg touches down before the first, cycles.

        It is the median over the strides, so a stumble or a bouncing foot has no effect.

        Args:
            phase: of the stride, cycles, at times, s.
            legs: names, in the order of the network.

        Returns:
            None for too few strides, or if the strides disagree.

        """
        touchdowns = {}
        for leg in legs:
            begins, _, stances = self.strides(leg).T
            if begins.size < MIN_STRIDES:
                return None
            # Of a foot that bounces, the begin of the longer contact counts.
            phases = phase(begins[stances > MIN_STANCE_RATIO * np.median(stances)])
            middle = float(np.angle(np.exp(2j * np.pi * phases).mean())) / (2.0 * np.pi)
            off = (phases - middle + 0.5) % 1.0 - 0.5
            if np.abs(off - np.median(off)).mean() > MAX_PHASE_SCATTER:
                return None
            touchdowns[leg] = middle + float(np.median(off))
        return {leg: (touchdowns[legs[0]] - phase) % 1.0 for leg, phase in touchdowns.items()}

    def strides(self, leg: str) -> np.ndarray:
        """Return touchdown, duration and stance of a leg's strides, s, shape (k, 3)."""
        down = self.down[:, self.legs.index(leg)]
        touchdowns = self.times[1:][down[1:] & ~down[:-1]]
        liftoffs = self.times[1:][~down[1:] & down[:-1]]
        begins, ends = touchdowns[:-1], touchdowns[1:]
        stance = liftoffs[np.searchsorted(liftoffs, begins)] if len(ends) else ends
        return np.column_stack([begins, ends - begins, stance - begins])


#: FREE_FALL_RATIO: downward acceleration over GRAVITY (m/s^2) from which on a body falls freely.
#: MAX_WALK_FALL, MIN_RUN_FALL: fractions of a stride of free fall up to which it walks, and from
#: which on it runs. HARMONICS: number of harmonics of the body's height; POINTS: phases of its
#: fall.
FREE_FALL_RATIO, GRAVITY, MAX_WALK_FALL, MIN_RUN_FALL = 0.7, 9.81, 0.02, 0.1
HARMONICS, POINTS = 6, 200


def falling_fraction(phases: np.ndarray, height: np.ndarray, frequency: float) -> float:
    """Return the fraction of a stride in which a body falls freely, without a foot on the ground.

    Args:
        phases: of the stride, cycles, shape (n,).
        height: of the body, m, shape (n,).
        frequency: of the stride, Hz.

    """
    exponents = 2j * np.pi * np.arange(1, HARMONICS + 1)
    waves = np.exp(np.multiply.outer(phases, exponents))
    basis = np.column_stack([np.ones_like(phases), phases - phases.mean(), waves.real, waves.imag])
    weights = np.linalg.lstsq(basis, height, rcond=None)[0][2:].reshape(2, -1)
    grid = (np.exp(np.multiply.outer(np.arange(POINTS) / POINTS, exponents))
            * (exponents * frequency)**2)
    downward = -(grid.real @ weights[0] + grid.imag @ weights[1])
    return float(np.mean(downward > FREE_FALL_RATIO * GRAVITY))


def foot_contacts(loads: FootLoads, legs: Collection[str], begin: float, end: float,
                  period: float) -> FootContacts | None:
    """Find the feet's contacts between two times.

    Return None for too few samples, or if names do not tell to which legs the feet belong.

    Args:
        loads: on the feet, named as the legs or their joints, such as FR_force.
        legs: names.
        begin: s.
        end: s.
        period: of a stride, s.

    """
    foot_legs = _legs_of_feet(loads.legs, legs)
    if foot_legs is None:
        return None
    inside = (loads.times >= begin) & (loads.times <= end)
    times, rows = loads.times[inside], loads.loads[inside]
    if len(times) < MIN_STRIDE_SAMPLES * (end - begin) / period or not np.isfinite(rows).all():
        return None
    smallest, largest = np.percentile(rows, [LOW_PERCENTILE, HIGH_PERCENTILE], axis=0)
    threshold = np.where(smallest > MAX_SWING_LOAD * largest, -np.inf,
                         smallest + CONTACT_THRESHOLD * (largest - smallest))
    down = rows > threshold
    # A foot that bounces touches down once.
    for state in (False, True):
        for column in down.T:
            for first, last in true_runs(column == state):
                inner = first > 0 and last + 1 < len(times)
                if inner and times[last + 1] - times[first] < MIN_DURATION * period:
                    column[first:last + 1] = not state
    return FootContacts(foot_legs, times, down, loads.by_motion)


def _legs_of_feet(names: Sequence[str], legs: Collection[str]) -> tuple[str, ...] | None:
    """Return the leg of each foot by its name; None if there is not one foot for each leg."""
    if set(legs) <= set(names):
        return tuple(names)
    try:
        by_leg = legs_of(names)
    except LegsError:
        return None
    if set(by_leg) != set(legs) or any(len(by_leg[leg]) != 1 for leg in legs) or by_leg.unassigned:
        return None
    return tuple(next(leg for leg in legs if name in by_leg[leg]) for name in names)
