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

"""Checks of what was found in a recording, and how much confidence they leave."""

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from itertools import combinations, product

from cpg_ros.common.errors import InputError
from cpg_ros.fitting.gaits.leg_names import role_of
from cpg_ros.fitting.gaits.leg_phases import leg_phases
from cpg_ros.fitting.gaits.mean_cycle import average_cycles, PhaseAverage
from cpg_ros.fitting.gaits.phase_estimation import PhaseEstimate
import numpy as np

#: Below so many cycles errors are rough.
SURE = 3.0
#: A change of frequency over the stretch that is worth a note.
DRIFT = 0.04
#: Fewer samples a stride may be those of a gait several times as fast.
SAMPLES = 20.0
#: A mean cycle is several strides if all but this share of its power is at multiples of their
#: rate.
ALIKE = 0.1
#: Strides slower than this (Hz) are of no leg; with their times in another unit they may lie
#: between the others.
SLOW, USUAL = 0.05, (0.2, 12.5)
UNITS = {'ms': 1e3, 'us': 1e6, 'ns': 1e9}
#: No joint of a leg swings by more (rad).
SWING = 2.0 * np.pi
#: Legs whose phases differ by more between the parts of a stretch (cycles) change gait.
CHANGE = 0.1
#: These parts of a stretch are compared, of so many strides at least, and of so many samples of
#: each joint.
PARTS, STRIDES, FEWEST = ('at its beginning', 'in its middle', 'at its end'), 1, 16
#: Legs that move together, within this part of a cycle, and by less than this (rad) may stand.
TOGETHER, SWAY = 0.06, 0.3
#: A leg limps that moves by less than this share of what the others do.
LIMPS = 0.6


@dataclass(frozen=True)
class QualityIssue:
    """Something that speaks against what was found.

    Attributes:
        message: one line.
        left: the share of the confidence that it leaves.

    """

    message: str
    left: float


def check_rhythm(frequency: float, phases: np.ndarray, x: np.ndarray, c: np.ndarray
                 ) -> list[QualityIssue]:
    """Doubt a stride frequency that rests on few samples, or whose mean cycle is several.

    Args:
        frequency: Hz.
        phases: of the samples of a stretch, cycles, shape (n,).
        x: rad, nan where missing, shape (n, joints).
        c: coefficients of the mean cycles, shape (harmonics + 1, joints).

    """
    found, samples = [], _samples(phases, x)
    power = np.sum(np.abs(c[1:])**2, axis=1)
    order = np.arange(1, len(c))
    for times in (3, 2):
        if power[order % times > 0].sum() < ALIKE * power.sum():
            found.append(QualityIssue(f'the mean cycle holds {times} that are alike: the gait '
                                      f'may be '
                                      f'{times} times as fast, {times * frequency:.4g} Hz', 0.2))
            break
    if samples < SAMPLES:
        found.append(QualityIssue(f'only {samples:.1f} samples a stride: a gait several times as '
                                  f'fast would look the same; record faster', 0.5))
    if frequency < SLOW:
        unit = next((unit for unit, more in UNITS.items()
                     if USUAL[0] <= frequency * more <= USUAL[1]), '')
        found.append(QualityIssue(f'a stride of {1.0 / frequency:.4g} s is slower than any leg' + (
            f': if the times are in {unit}, it is {frequency * UNITS[unit]:.4g} Hz; declare it '
            f'(--time {unit})' if unit else ''), 0.02))
    return found


def _samples(phases: np.ndarray, x: np.ndarray) -> float:
    """Return how many samples of a joint a stride has: of bursts, by the pauses between them."""
    there = np.isfinite(x)
    own = phases[there[:, int(np.argmax(there.sum(axis=0)))]]
    steps = np.sort(np.diff(own))
    passed = np.cumsum(steps)
    # Half of the time passes between samples that are further apart than this.
    apart = float(steps[np.searchsorted(passed, 0.5 * passed[-1])])
    return min(own.size / float(phases[-1] - phases[0]), 1.0 / apart)


def check_angles(joints: Sequence[str], mean: np.ndarray) -> list[QualityIssue]:
    """Doubt mean cycles of joints, rad, shape (joints, m), that swing too far."""
    swing = np.ptp(mean, axis=1)
    k = int(np.argmax(swing))
    if swing[k] <= SWING:
        return []
    return [QualityIssue(f'{joints[k]} swings by {swing[k]:.3g} rad, more than a turn: if the '
                         f'angles are in degrees, declare it (--unit deg)', 0.5)]


def check_sway(phases: Mapping[str, float], mean: np.ndarray) -> list[QualityIssue]:
    """Doubt a hop of all legs that a body which breathes or sways on its feet would look like.

    Args:
        phases: leg -> its phase, cycles.
        mean: cycles of the joints, rad, shape (joints, m).

    """
    most = float(np.ptp(mean, axis=1).max())
    if most >= SWAY or any(abs((one + 0.5) % 1.0 - 0.5) > TOGETHER for one in phases.values()):
        return []
    return [QualityIssue(f'all legs move together, and by no more than {most:.2g} rad: a body '
                         'that stands and sways moves its joints so, too', 0.3)]


def check_legs(vague: Sequence[str]) -> list[QualityIssue]:
    """Doubt the phases of legs that may be half a cycle off."""
    if not vague:
        return []
    return [QualityIssue(f'nothing tells in which sense {", ".join(vague)} count angles: half a '
                         f'cycle is uncertain', 0.5)]


def check_change(phases: np.ndarray, x: np.ndarray, legs: Mapping[str, Sequence[str]],
                 names: Sequence[str]) -> list[QualityIssue]:
    """Doubt one gait where the legs' phases differ between parts of the stretch.

    Args:
        phases: of the samples of a stretch, cycles, shape (n,).
        x: rad, nan where missing, shape (n, joints).
        legs: leg -> its joints.
        names: of the joints.

    """
    parts = _by_parts(phases, x, legs, names)
    if not parts:
        return []

    def moved(leg: str, pair: tuple[int, int]) -> float:
        return abs((parts[pair[1]][leg] - parts[pair[0]][leg] + 0.5) % 1.0 - 0.5)

    leg, pair = max(product(parts[0], combinations(range(len(parts)), 2)),
                    key=lambda one: moved(*one))
    if moved(leg, pair) <= CHANGE:
        return []
    at = [f'at {parts[k][leg]:.2f} {PARTS[k]}' for k in pair]
    return [QualityIssue(f'the gait changes within the stretch: of a cycle, {leg} is {at[0]} and '
                         f'{at[1]}', 0.2)]


def _by_parts(phases: np.ndarray, x: np.ndarray, legs: Mapping[str, Sequence[str]],
              names: Sequence[str]) -> list[dict[str, float]]:
    """Find the legs' phases in the parts of a stretch, if it is that long."""
    span, found = phases[-1] - phases[0], []
    edges = np.searchsorted(phases, phases[0] + span * np.arange(1, len(PARTS)) / len(PARTS))
    for place in map(slice, [0, *edges], [*edges, len(phases)]):
        if span < len(PARTS) * STRIDES or (np.isfinite(x[place]).sum(axis=0) < FEWEST).any():
            return []
        try:
            part = average_cycles(phases[place], x[place], np.zeros(1), [0])
        except InputError:
            return []
        c = dict(zip(names, part.coefficients.T, strict=True))
        found.append(leg_phases(legs, c)[0])
    return found


def limping(legs: Mapping[str, Sequence[str]], c: Mapping[str, np.ndarray]) -> list[str]:
    """Name the legs that move by much less than the others do, one line each."""
    size = {leg: float(np.sqrt(sum(np.sum(np.abs(c[name][1:])**2) for name in listed)
                               / len(listed))) for leg, listed in legs.items()}
    found = []
    for leg, own in size.items():
        usual = float(np.median([other for name, other in size.items() if name != leg]))
        if own < LIMPS * usual:
            found.append(f'{leg} moves by {own / usual:.2f} of what the other legs do')
    return found


def quality_notes(warp: PhaseEstimate, found: PhaseAverage, names: Sequence[str]) -> list[str]:
    """Note few cycles, a drift of the frequency, and samples left out, one line each."""
    notes = []
    if warp.cycles < SURE:
        notes.append(f'only {warp.cycles:.1f} cycles: errors are rough, one figure for the whole '
                     'cycle of a joint, from what is there twice')
    elif warp.knots.size > 4:
        middles = 0.5 * (warp.knots[1:] + warp.knots[:-1])
        slope = np.polyfit(middles, np.diff(warp.phases) / np.diff(warp.knots), 1)
        ends = np.polyval(slope, warp.knots[[0, -1]])
        if abs(ends[1] - ends[0]) > DRIFT * warp.frequency:
            notes.append(f'the frequency drifts from {ends[0]:.3g} to {ends[1]:.3g} Hz')
    wild = [f'{name} ({count})' for name, count in zip(names, found.spikes, strict=True) if count]
    if wild:
        notes.append(f'samples far off the mean cycle, left out: {", ".join(wild)}')
    return notes


# What legs do besides their phases: walk on, step on the spot, or turn.

#: Area of a loop over that of an ellipse of the same amplitudes, a quarter of a cycle apart: below
#: the first there is no telling from a path, above the second the sense is sure.
PATH, SURE_AREA = 0.25, 0.4
#: Joints that move by less than this share of the motion of the leg's first one are ignored.
MOVES = 0.1


def _area(a: np.ndarray, b: np.ndarray) -> float:
    """Signed area of the loop of two joints, 1 for an ellipse a quarter of a cycle apart."""
    n = np.arange(1, a.size)
    sizes = np.sum(n * np.abs(a[1:])**2) * np.sum(n * np.abs(b[1:])**2)
    return float(np.sum(n * (a[1:].conj() * b[1:]).imag) / max(np.sqrt(sizes), 1e-300))


def _loops(legs: Mapping[str, Sequence[str]], c: Mapping[str, np.ndarray]
           ) -> tuple[dict[str, float], set[str]]:
    """Return areas of the loops of two joints that all legs have, and these joints' names.

    Of those the two that move most; nothing if there are none.
    """
    roles = [{role_of(name): name for name in listed} for listed in legs.values()]
    power = {role: sum(float(np.sum(np.abs(c[own[role]][1:])**2)) for own in roles)
             for role in sorted(set.intersection(*map(set, roles)))}
    most = sorted(power, key=lambda role: -power[role])[:2]
    if len(most) < 2 or power[most[1]] < MOVES**2 * power[most[0]]:
        return {}, set()
    return ({leg: _area(*(c[own[role]] for role in sorted(most)))
             for leg, own in zip(legs, roles, strict=True)},
            {own[role] for own in roles for role in most})


def check_travel(legs: Mapping[str, Sequence[str]], c: Mapping[str, np.ndarray],
                 girdles: Mapping[str, str], opposite: Collection[str]) -> list[QualityIssue]:
    """Doubt a gait that goes nowhere, or round.

    Args:
        legs: leg -> its joints.
        c: joint -> Fourier coefficients of its mean cycle, complex, shape (n + 1,).
        girdles: leg -> fore or hind, where the legs have these.
        opposite: joints that count angles in the opposite sense of the first leg's.

    """
    loops, joints = _loops(legs, c)
    if not loops:
        return []
    if max(map(abs, loops.values())) < PATH:
        return [QualityIssue('the joints of each leg go to and fro on one path: the legs step, '
                             'or hop, on the spot', 0.5)]
    # Fore and hind knees may bend in opposite senses: legs are compared across the body.
    across: dict[str, list[float]] = {}
    for leg, area in loops.items():
        across.setdefault(girdles.get(leg, ''), []).append(area)
    if not joints & set(opposite) and all(
            min(own) < -SURE_AREA and max(own) > SURE_AREA for own in across.values()):
        return [QualityIssue('the legs of one side step forward and those of the other back: it '
                             'turns on the spot', 0.3)]
    return []
