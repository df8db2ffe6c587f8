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

"""Plausibility checks of a recording's stride, legs and travel, and the resulting confidence."""

from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass
from itertools import combinations, product

from cpg_ros.common.errors import InputError
from cpg_ros.fitting.gaits.leg_names import role_of
from cpg_ros.fitting.gaits.leg_phases import leg_phases
from cpg_ros.fitting.gaits.mean_cycle import average_cycles, PhaseAverage
from cpg_ros.fitting.gaits.phase_estimation import PhaseEstimate
import numpy as np

#: RELIABLE_CYCLES: with fewer, the errors are rough.
RELIABLE_CYCLES = 3.0
#: DRIFT_THRESHOLD: relative change of the frequency over the stretch that is noted.
DRIFT_THRESHOLD = 0.04
#: MIN_STRIDE_SAMPLES: with fewer, the true gait may be several times as fast (aliasing).
MIN_STRIDE_SAMPLES = 20.0
#: SUBHARMONIC_THRESHOLD: fraction of a mean cycle's power off the multiples of n, if it is n
#: strides.
SUBHARMONIC_THRESHOLD = 0.1
#: MIN_FREQUENCY: of a leg's steps, Hz; FREQUENCY_RANGE: Hz, in which the same times in another
#: unit must lie for that unit to be suggested.
MIN_FREQUENCY, FREQUENCY_RANGE = 0.05, (0.2, 12.5)
#: TIME_UNITS: unit of time -> how many of it are a second.
TIME_UNITS = {'ms': 1e3, 'us': 1e6, 'ns': 1e9}
#: MAX_JOINT_RANGE: plausible for a leg's joint, rad.
MAX_JOINT_RANGE = 2.0 * np.pi
#: PHASE_CHANGE_THRESHOLD: change of a leg's phase between parts of a stretch, cycles.
PHASE_CHANGE_THRESHOLD = 0.1
#: Parts of a stretch that are compared; MIN_PART_SAMPLES: of each joint in a part.
PART_NAMES = 'at its beginning', 'in its middle', 'at its end'
MIN_PART_STRIDES, MIN_PART_SAMPLES = 1, 16
#: IN_PHASE_TOLERANCE: of legs that move together, cycles. MAX_SWAY_RANGE: of the joints, rad, up
#: to which such legs may only sway on the spot.
IN_PHASE_TOLERANCE, MAX_SWAY_RANGE = 0.06, 0.3
#: LIMP_RATIO: motion of a leg that limps, over the other legs' median motion.
LIMP_RATIO = 0.6


@dataclass(frozen=True)
class QualityIssue:
    """A reason to doubt a result.

    Attributes:
        message: one line.
        factor: by which it multiplies the confidence.

    """

    message: str
    factor: float


def check_rhythm(frequency: float, phases: np.ndarray, x: np.ndarray, c: np.ndarray
                 ) -> list[QualityIssue]:
    """Return issues: a mean cycle of several strides, few samples, or a stride that is too slow.

    Args:
        frequency: Hz.
        phases: of the samples of a stretch, cycles, shape (n,).
        x: rad, nan where missing, shape (n, joints).
        c: coefficients of the mean cycles, shape (harmonics + 1, joints).

    """
    issues, samples = [], _samples(phases, x)
    power = np.sum(np.abs(c[1:])**2, axis=1)
    order = np.arange(1, len(c))
    for times in (3, 2):
        if power[order % times > 0].sum() < SUBHARMONIC_THRESHOLD * power.sum():
            issues.append(QualityIssue(f'the mean cycle holds {times} that are alike: the gait '
                                      f'may be '
                                      f'{times} times as fast, {times * frequency:.4g} Hz', 0.2))
            break
    if samples < MIN_STRIDE_SAMPLES:
        issues.append(QualityIssue(f'only {samples:.1f} samples a stride: a gait several times as '
                                  f'fast would look the same; record faster', 0.5))
    if frequency < MIN_FREQUENCY:
        unit = next((unit for unit, more in TIME_UNITS.items()
                     if FREQUENCY_RANGE[0] <= frequency * more <= FREQUENCY_RANGE[1]), '')
        issues.append(QualityIssue(f'a stride of {1.0 / frequency:.4g} s is slower than any leg'
                                   + (
            f': if the times are in {unit}, it is {frequency * TIME_UNITS[unit]:.4g} Hz; declare '
            f'it (--time {unit})' if unit else ''), 0.02))
    return issues


def _samples(phases: np.ndarray, x: np.ndarray) -> float:
    """Return the samples of a joint per stride; for bursts, the pauses between them count."""
    finite = np.isfinite(x)
    joint_phases = phases[finite[:, int(np.argmax(finite.sum(axis=0)))]]
    steps = np.sort(np.diff(joint_phases))
    elapsed = np.cumsum(steps)
    # Half of the time passes between samples that are further apart than this.
    interval = float(steps[np.searchsorted(elapsed, 0.5 * elapsed[-1])])
    return min(joint_phases.size / float(phases[-1] - phases[0]), 1.0 / interval)


def check_angles(joints: Sequence[str], mean: np.ndarray) -> list[QualityIssue]:
    """Return an issue if a joint swings too far; mean cycles in rad, shape (joints, m)."""
    swing = np.ptp(mean, axis=1)
    k = int(np.argmax(swing))
    if swing[k] <= MAX_JOINT_RANGE:
        return []
    return [QualityIssue(f'{joints[k]} swings by {swing[k]:.3g} rad, more than a turn: if the '
                         f'angles are in degrees, declare it (--unit deg)', 0.5)]


def check_sway(phases: Mapping[str, float], mean: np.ndarray) -> list[QualityIssue]:
    """Return an issue if the hop of all legs may be the sway of a standing body.

    Args:
        phases: leg -> phase, cycles.
        mean: cycles of the joints, rad, shape (joints, m).

    """
    largest = float(np.ptp(mean, axis=1).max())
    if largest >= MAX_SWAY_RANGE or any(abs((phase + 0.5) % 1.0 - 0.5) > IN_PHASE_TOLERANCE
                                        for phase in phases.values()):
        return []
    return [QualityIssue(f'all legs move together, by no more than {largest:.2g} rad: this also '
                         'happens when a standing body sways', 0.3)]


def check_legs(vague: Sequence[str]) -> list[QualityIssue]:
    """Return an issue if the phases of some legs may be half a cycle off."""
    if not vague:
        return []
    return [QualityIssue(f'the sign convention of {", ".join(vague)} is unknown: half a cycle is '
                         'uncertain', 0.5)]


def check_change(phases: np.ndarray, x: np.ndarray, legs: Mapping[str, Sequence[str]],
                 names: Sequence[str], gait_of: Callable[[Mapping[str, float]], str | None]
                 ) -> list[QualityIssue]:
    """Return an issue if the legs' phases differ between parts of the stretch.

    Animals' phases vary within one gait, too; parts of the same gait are no issue.

    Args:
        phases: of the samples of a stretch, cycles, shape (n,).
        x: rad, nan where missing, shape (n, joints).
        legs: leg -> its joints.
        names: of the joints.
        gait_of: returns the gait of phases, or None.

    """
    parts = _by_parts(phases, x, legs, names)
    gaits = {gait_of(part) for part in parts}
    if not parts or (len(gaits) == 1 and None not in gaits):
        return []

    def change(leg: str, pair: tuple[int, int]) -> float:
        return abs((parts[pair[1]][leg] - parts[pair[0]][leg] + 0.5) % 1.0 - 0.5)

    leg, pair = max(product(parts[0], combinations(range(len(parts)), 2)),
                    key=lambda couple: change(*couple))
    if change(leg, pair) <= PHASE_CHANGE_THRESHOLD:
        return []
    at = [f'at {parts[k][leg]:.2f} {PART_NAMES[k]}' for k in pair]
    return [QualityIssue(f'the gait changes within the stretch: of a cycle, {leg} is {at[0]} and '
                         f'{at[1]}', 0.2)]


def _by_parts(phases: np.ndarray, x: np.ndarray, legs: Mapping[str, Sequence[str]],
              names: Sequence[str]) -> list[dict[str, float]]:
    """Return leg -> phase, cycles, for each part of a stretch; nothing if it is too short."""
    span, averages, count = phases[-1] - phases[0], [], len(PART_NAMES)
    edges = np.searchsorted(phases, phases[0] + span * np.arange(1, count) / count)
    for interval in map(slice, [0, *edges], [*edges, len(phases)]):
        samples = np.isfinite(x[interval]).sum(axis=0)
        if span < count * MIN_PART_STRIDES or (samples < MIN_PART_SAMPLES).any():
            return []
        try:
            part = average_cycles(phases[interval], x[interval], np.zeros(1), [0])
        except InputError:
            return []
        c = dict(zip(names, part.coefficients.T, strict=True))
        averages.append(leg_phases(legs, c)[0])
    return averages


def limping(legs: Mapping[str, Sequence[str]], c: Mapping[str, np.ndarray]) -> list[str]:
    """Return a line for each leg that moves by much less than the others."""
    size = {leg: float(np.sqrt(sum(np.sum(np.abs(c[name][1:])**2) for name in names)
                               / len(names))) for leg, names in legs.items()}
    limping_legs = []
    for leg, motion in size.items():
        usual = float(np.median([other for name, other in size.items() if name != leg]))
        if motion < LIMP_RATIO * usual:
            limping_legs.append(f'{leg} moves {motion / usual:.2f} times as far as the other legs')
    return limping_legs


def quality_notes(warp: PhaseEstimate, average: PhaseAverage, names: Sequence[str]) -> list[str]:
    """Return a line each on few cycles, a drift of the frequency, and dropped samples."""
    notes = []
    if warp.cycles < RELIABLE_CYCLES:
        notes.append(f'only {warp.cycles:.1f} cycles: errors are approximate, one value for each '
                     "joint's cycle, from the parts that occur twice")
    elif warp.knots.size > 4:
        middles = 0.5 * (warp.knots[1:] + warp.knots[:-1])
        slope = np.polyfit(middles, np.diff(warp.phases) / np.diff(warp.knots), 1)
        ends = np.polyval(slope, warp.knots[[0, -1]])
        if abs(ends[1] - ends[0]) > DRIFT_THRESHOLD * warp.frequency:
            notes.append(f'the frequency drifts from {ends[0]:.3g} to {ends[1]:.3g} Hz')
    wild = [f'{name} ({count})' for name, count in zip(names, average.spikes, strict=True)
            if count]
    if wild:
        notes.append(f'samples far off the mean cycle, left out: {", ".join(wild)}')
    return notes


# Travel, which phases do not show: whether legs walk on, step on the spot, or turn.

#: Area of the loop that two joints of a leg describe, relative to an ellipse of the same
#: amplitudes: below the first the leg goes to and fro, above the second its sense is certain.
MIN_LOOP_AREA, CLEAR_LOOP_AREA = 0.25, 0.4
#: MIN_MOTION_RATIO: of a joint that counts, over the leg's largest motion.
MIN_MOTION_RATIO = 0.1
#: COPY_TOLERANCE: fraction of its motion that a copy of another joint has for itself.
#: JOINT_WORDS: words in common of joints that are copies whatever their ratio.
COPY_TOLERANCE, JOINT_WORDS = 0.1, frozenset({'hip', 'thigh', 'knee', 'calf', 'shank', 'ankle'})
#: MIN_TRAVEL: of the body in a stride, m; with less it steps on the spot.
MIN_TRAVEL = 0.1


def _area(a: np.ndarray, b: np.ndarray) -> float:
    """Return the signed area of two joints' loop, 1 for an ellipse a quarter of a cycle apart."""
    n = np.arange(1, a.size)
    sizes = np.sum(n * np.abs(a[1:])**2) * np.sum(n * np.abs(b[1:])**2)
    return float(np.sum(n * (a[1:].conj() * b[1:]).imag) / max(np.sqrt(sizes), 1e-300))


def _without_copies(legs: Sequence[Mapping[str, str]], c: Mapping[str, np.ndarray],
                    roles: Sequence[str]) -> list[str]:
    """Return roles without joints that only copy another one, in a linkage or by duplication."""
    distinct: list[str] = []
    for role in roles:
        def copies(other: str, role: str = role) -> bool:
            pairs = [(c[joints[other]][1:], c[joints[role]][1:]) for joints in legs]
            ratios = [float(np.sum(a.conj() * b).real / max(np.sum(np.abs(a)**2), 1e-300))
                      for a, b in pairs]
            copy = all(np.sum(np.abs(b - ratio * a)**2) < COPY_TOLERANCE**2 * np.sum(np.abs(b)**2)
                       for ratio, (a, b) in zip(ratios, pairs, strict=True))
            return copy and (all(abs(abs(ratio) - 1.0) < COPY_TOLERANCE for ratio in ratios)
                             or bool(JOINT_WORDS & set(other.split()) & set(role.split())))
        if not any(map(copies, distinct)):
            distinct.append(role)
    return distinct


def _loops(legs: Mapping[str, Sequence[str]], c: Mapping[str, np.ndarray]
           ) -> tuple[dict[str, float], set[str]]:
    """Return leg -> area of the loop of its two joints that move most, and these joints' names.

    Only joints of all legs are considered; both results are empty if fewer than two move.
    """
    roles = [{role_of(name): name for name in names} for names in legs.values()]
    power = {role: sum(float(np.sum(np.abs(c[joint_names[role]][1:])**2)) for joint_names in roles)
             for role in sorted(set.intersection(*map(set, roles)))}
    strongest = _without_copies(roles, c, sorted(power, key=lambda role: -power[role]))[:2]
    if len(strongest) < 2 or power[strongest[1]] < MIN_MOTION_RATIO**2 * power[strongest[0]]:
        return {}, set()
    return ({leg: _area(*(c[joint_names[role]] for role in sorted(strongest)))
             for leg, joint_names in zip(legs, roles, strict=True)},
            {joint_names[role] for joint_names in roles for role in strongest})


def check_travel(legs: Mapping[str, Sequence[str]], c: Mapping[str, np.ndarray],
                 girdles: Mapping[str, str], opposite: Collection[str], travel: float
                 ) -> list[QualityIssue]:
    """Return an issue if the gait steps or turns on the spot.

    Args:
        legs: leg -> its joints.
        c: joint -> Fourier coefficients of its mean cycle, complex, shape (n + 1,).
        girdles: leg -> fore or hind, if the legs have them.
        opposite: joints with the opposite sign convention of the first leg's.
        travel: of the body in a stride, m; 0 if unknown.

    """
    loops, joints = _loops(legs, c)
    if not loops or travel > MIN_TRAVEL:
        return []
    if max(map(abs, loops.values())) < MIN_LOOP_AREA:
        return [QualityIssue('the joints of each leg go to and fro on one path: the legs step, '
                             'or hop, on the spot', 0.5)]
    # Fore and hind knees may bend in opposite senses: legs are compared across the body.
    across: dict[str, list[float]] = {}
    for leg, area in loops.items():
        across.setdefault(girdles.get(leg, ''), []).append(area)
    if not joints & set(opposite) and all(
            min(areas) < -CLEAR_LOOP_AREA and max(areas) > CLEAR_LOOP_AREA
            for areas in across.values()):
        return [QualityIssue('the legs of one side step forward and those of the other back: it '
                             'turns on the spot', 0.3)]
    return []
