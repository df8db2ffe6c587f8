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

"""The stride of a recording: its steady stretch, frequency, mean cycle, leg phases and gait.

A stretch is found where the joints repeat (steady), followed with a phase of its own, as strides
vary in length (warp), and averaged over that phase (warped).
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

from cpg_ros.common.errors import CpgError, InputError, ShortRepr
from cpg_ros.fitting.gaits.foot_contacts import (
    falling_fraction,
    foot_contacts,
    FootContacts,
)
from cpg_ros.fitting.gaits.leg_names import Legs
from cpg_ros.fitting.gaits.leg_phases import (
    GaitMatch,
    leg_phases,
    match_gait,
    match_gait_by_cells,
    phase_scatter,
    PhaseScatter,
    walk_or_run,
)
from cpg_ros.fitting.gaits.mean_cycle import average_cycles, PhaseAverage
from cpg_ros.fitting.gaits.phase_estimation import (
    estimate_phase,
    grow_stretch,
    index_range,
    PhaseEstimate,
    RoughPhase,
)
from cpg_ros.fitting.gaits.quality_checks import (
    check_angles,
    check_change,
    check_legs,
    check_rhythm,
    check_sway,
    check_travel,
    limping,
    MAX_JOINT_RANGE,
    quality_notes,
    QualityIssue,
    RELIABLE_CYCLES,
)
from cpg_ros.fitting.gaits.steady_stretch import (
    best_stretch,
    find_stretches,
    MAX_FREQUENCY,
    MIN_CYCLES,
    MIN_LAG,
    OVERSAMPLING,
    resample_evenly,
)
from cpg_ros.fitting.recordings.downsampling import drop_spikes
from cpg_ros.fitting.recordings.recording import FootLoads, Recording
from cpg_ros.networks.network import Network
import numpy as np

#: MIN_SAMPLES: of a joint.
MIN_SAMPLES = 8


class NoSteadyGait(CpgError):
    """A recording has no steady gait; the message describes what it has instead."""

    exit_code = 1


def usable_joints(recording: Recording, legs: Mapping[str, Sequence[str]]
            ) -> tuple[dict[str, tuple[str, ...]], np.ndarray, list[str]]:
    """Return the legs' joints that have angles, their positions without spikes, and notes.

    Args:
        recording: of the joints.
        legs: leg -> its joints.

    Raises:
        NoSteadyGait: there are too few samples, or a leg has no joint with angles.

    """
    leg_joints = [name for name in recording.joints
                  if any(name in listed_names for listed_names in legs.values())]
    # Joint by joint in memory, as they are averaged.
    x = np.empty((len(leg_joints), len(recording.times))).T
    for column, name in zip(x.T, leg_joints, strict=True):
        column[:] = recording.positions[:, recording.joints.index(name)]
        column[np.isinf(column)] = np.nan
    sufficient = np.isfinite(x).sum(axis=0) >= MIN_SAMPLES
    spikes = 0
    for k in np.flatnonzero(sufficient):
        spikes += drop_spikes(x[:, k])
    # A joint of spikes alone has no samples left.
    sufficient = np.isfinite(x).sum(axis=0) >= MIN_SAMPLES
    names = [name for name, good in zip(leg_joints, sufficient, strict=True) if good]
    dropped = [name for name in leg_joints if name not in names]
    notes = [f'left out, without angles: {", ".join(dropped)}'] if dropped and names else []
    if len(recording.times) < MIN_SAMPLES:
        raise NoSteadyGait(f'{recording.source}: {len(recording.times)} samples are not enough '
                           f'for a gait, at least {MIN_SAMPLES} are needed')
    usable = _select_joints(legs, names, recording.source)
    x = x if sufficient.all() else x[:, sufficient]
    if spikes:
        notes.append(f'left out, far off both neighbours: {spikes} samples')
    return usable, x, notes


def with_angles(names: list[str], legs: dict[str, tuple[str, ...]], x: np.ndarray, source: str,
                notes: list[str]) -> tuple[list[str], dict[str, tuple[str, ...]], np.ndarray]:
    """Drop joints with few angles; return names, legs, and which joints have enough.

    Args:
        names: of the joints.
        legs: leg -> its joints.
        x: angles, rad, nan where missing, shape (n, joints).
        source: of the recording, for messages.
        notes: extended by a line for each kind of dropped data.

    Raises:
        NoSteadyGait: a leg has no joint left.

    """
    full = np.isfinite(x).sum(axis=0) >= MIN_SAMPLES
    if full.all():
        return names, legs, full
    dropped = [name for name, good in zip(names, full, strict=True) if not good]
    notes.append(f'left out, without angles in the stretch: {", ".join(dropped)}')
    names = [name for name in names if name not in dropped]
    return names, _select_joints(legs, names, source), full


def _select_joints(legs: Mapping[str, Sequence[str]], names: Sequence[str], source: str
          ) -> dict[str, tuple[str, ...]]:
    """Keep the legs' joints that are among names, at least one of each leg."""
    names_of_leg = {leg: tuple(name for name in joints if name in names) for leg,
                    joints in legs.items()}
    for leg, joints in names_of_leg.items():
        if not joints:
            raise NoSteadyGait(f'{source}: none of the joints of {leg} '
                               f'({", ".join(legs[leg])}) has angles')
    return names_of_leg


#: POINTS: of a mean cycle.
POINTS = 64
#: MIN_JOINT_RANGE: rad; a robot whose joints all move by less stands.
MIN_JOINT_RANGE = 0.01
#: MAX_DIFFERENCE: mean square, over twice the variance, of stretches with fewer cycles than
#: RELIABLE_CYCLES.
MAX_DIFFERENCE = 0.1
#: MAX_RESIDUAL_VARIANCE: that the mean cycle may leave, over the joints' variance.
MAX_RESIDUAL_VARIANCE = 0.5
#: MAX_SEEDS: stretches that are followed; MIN_OTHER_CYCLES: of another one that is noted.
MAX_SEEDS, MIN_OTHER_CYCLES = 4, 3.0
#: FEW_CYCLES_FACTOR: of the confidence for fewer cycles than RELIABLE_CYCLES.
FEW_CYCLES_FACTOR = 0.95


@dataclass(frozen=True, eq=False, repr=False)
class Stride(ShortRepr):
    """The mean stride of a steady stretch.

    Phase 0 is where the joint of the first leg with the largest first harmonic has the maximum
    of that harmonic.

    Attributes:
        begin: of the stretch, s.
        end: of the stretch, s.
        frequency: mean, strides per second (Hz).
        frequency_error: its standard error (Hz).
        cycles: whole strides in the stretch.
        joints: those of the legs that have angles, in the order of the recording.
        theta: phases, cycles, even, shape (m,).
        mean: mean cycle, rad, shape (joints, m).
        spread: standard deviation of a cycle about it, rad, (joints, m).
        error: standard error of the mean, rad, (joints, m).
        phases: leg -> cycles in [0, 1) by which it is ahead of the first leg, in the order of
            the network's legs: x_leg(t) = x_first(t + phase T).
        scatter: leg -> how well its phase is known, and kept from stride to stride.
        gait: name, None if none is near enough.
        nearest: the nearest gait.
        candidates: gaits that the recording cannot tell from the nearest, that one among them.
        distance: of the leg phases from the nearest, RMS over legs, cycles.
        margin: how much further the next gait is, cycles.
        confidence: probability that gait and frequency are those named, given the recording.
        issues: what speaks against them, one line each.
        notes: one line each.
        warp: stride phase of the recording's times within the stretch.
        contacts: which feet were on the ground in the stretch, if the recording has loads.

    """

    begin: float
    end: float
    frequency: float
    frequency_error: float
    cycles: int
    joints: tuple[str, ...]
    theta: np.ndarray
    mean: np.ndarray
    spread: np.ndarray
    error: np.ndarray
    phases: dict[str, float]
    scatter: dict[str, PhaseScatter]
    gait: str | None
    nearest: str
    candidates: tuple[str, ...]
    distance: float
    margin: float
    confidence: float
    issues: tuple[str, ...]
    notes: tuple[str, ...]
    warp: PhaseEstimate
    contacts: FootContacts | None = None

    @property
    def verdict(self) -> str:
        """The gait's name, 'walk or run: cannot tell', or a text on the nearest one."""
        if self.gait is None:
            return f'none of the gaits; nearest {self.nearest}'
        return (self.gait if len(self.candidates) < 2
                else f'{" or ".join(self.candidates)}: cannot tell')

    def _summary(self) -> str:
        return (f'{self.verdict}: {self.cycles} cycles of '
                f'{self.frequency:.6g} +- {self.frequency_error:.2g} Hz, {self.begin:.6g} to '
                f'{self.end:.6g} s, {len(self.joints)} joints')


def find_stride(recording: Recording, legs: Legs | Mapping[str, Sequence[str]],
                network: type[Network] | Network, cells: Mapping[str, int] | None = None,
                gains: Mapping[str, complex] | None = None,
                loads: FootLoads | None = None, body: np.ndarray | None = None,
                gait_name: str = '') -> Stride:
    """Find the steady gait of a recording.

    Args:
        recording: of the joints.
        legs: leg -> its joints; the legs must be those of the network.
        network: whose gaits it may be.
        cells: joint -> the cell that drives it, from 1. A leg's phase is then that of its first
            cell.
        gains: joint -> w_x + i w_y, rad, the first two weights of its readout. With these gaits
            that move the legs alike (walk and run of the biped) are distinguished, if every cell
            has a joint.
        loads: on the feet, at the recording's times or others. The legs' phases are then those
            of touchdown, and they tell walk from run where legs move alike in both.
        body: where the body was, m, the last axis upward, shape (n, 3); how it falls tells walk
            from run, too.
        gait_name: the gait, if it is given: the confidence is then that of the frequency alone.

    Raises:
        NoSteadyGait: there is none, or none of a leg's joints has angles.
        InputError: the legs are not the network's.

    """
    kind = network if isinstance(network, type) else type(network)
    source = recording.source
    leg_cells = next(iter(kind.legs.values()))
    if set(legs) != set(leg_cells):
        raise InputError(f'{source}: legs are {", ".join(legs)}; the network {kind.name} has '
                         f'{", ".join(leg_cells)}')
    cycles = _average_cycles(recording, {leg: legs[leg] for leg in leg_cells})
    names, usable, warp, average = cycles.names, cycles.legs, cycles.warp, cycles.average
    c = dict(zip(names, average.coefficients.T, strict=True))
    # A leg's phase is that of its first cell.
    leading = {leg: tuple(name for name in leg_joints
                          if cells is None or cells.get(name) == leg_cells[leg][0]) or leg_joints
               for leg, leg_joints in usable.items()}
    ahead, by_legs, vague, opposite = leg_phases(leading, c)
    contacts = None if loads is None else foot_contacts(
        loads, leg_cells, float(warp.knots[0]), float(warp.knots[-1]), 1.0 / warp.frequency)
    leads = None if contacts is None else contacts.leads(warp, tuple(leg_cells))
    if contacts is not None and leads is not None:
        # Joints of legs that are built alike move alike, others need not.
        ahead, vague = leads, ()
        by_legs = (*by_legs, f"the legs' phases are those of touchdown, by {contacts.source}")
    body = None if body is None else body[cycles.inside]
    theta = np.arange(POINTS) / POINTS
    mean = average.mean(theta)
    issues = [*_check_cycles(cycles, leading, ahead, vague, mean, kind),
              *check_travel(usable, c, kind.girdles, opposite, _travel(body, warp))]
    gait = _decide(match_gait(ahead, kind), kind, (c, cells, gains), contacts,
                   None if body is None else
                   falling_fraction(cycles.phases, body[:, 2], warp.frequency), gait_name)
    if len(gait.candidates) > 1:
        # The odds of the gait have this already.
        issues.append(QualityIssue(f'{" or ".join(gait.candidates)}: cannot tell, the legs move '
                                   'in the same phases; name the gait it is (--gait)', 1.0))
    return Stride(float(warp.knots[0]), float(warp.knots[-1]), warp.frequency,
                  warp.frequency_error, int(warp.cycles + 1e-6), tuple(names), theta,
                  mean, average.spread, average.error, ahead,
                  phase_scatter(cycles.phases, cycles.x, average, leading, names), gait.gait,
                  gait.nearest, gait.candidates, gait.distance, gait.margin,
                  gait.probability * float(np.prod([issue.factor for issue in issues])),
                  tuple(issue.message for issue in issues if issue.message),
                  (*cycles.notes, *by_legs, *limping(usable, c), *gait.notes),
                  replace(warp, phases=warp.phases - average.zero), contacts)


class _Cycles(NamedTuple):
    """Steady part of a recording: its samples, their phases, shape (n,), and mean cycles."""

    names: list[str]
    legs: dict[str, tuple[str, ...]]
    inside: slice
    phases: np.ndarray
    x: np.ndarray
    warp: PhaseEstimate
    average: PhaseAverage
    notes: list[str]


def _average_cycles(recording: Recording, legs: Mapping[str, Sequence[str]]) -> _Cycles:
    """Find the steady part of a recording of legs' joints, and average its cycles."""
    times, source = recording.times, recording.source
    usable, positions, notes = usable_joints(recording, legs)
    names = [name for name in recording.joints
             if any(name in leg_joints for leg_joints in usable.values())]
    rough, region_notes = _regions(times, positions, source)
    notes += region_notes
    within = index_range(times, rough.begin, rough.end)
    names, usable, full = with_angles(names, usable, positions[within], source, notes)
    positions = positions[:, full]
    warp = _phase(times, positions, rough, source)
    inside = index_range(times, warp.knots[0], warp.knots[-1])
    phases, x = warp(times[inside]), positions[inside]
    # Strides that differ were left out at the ends of the rough stretch.
    names, usable, full = with_angles(names, usable, x, source, notes)
    x = x[:, full]
    average = _average(phases, x, [names.index(name) for name in usable[next(iter(legs))]],
                       warp.frequency, source)
    notes += quality_notes(warp, average, names)
    return _Cycles(names, usable, inside, phases, x, warp, average, notes)


def _check_cycles(cycles: _Cycles, leading: Mapping[str, Sequence[str]],
                  ahead: Mapping[str, float], vague: Sequence[str], mean: np.ndarray,
                  kind: type[Network]) -> list[QualityIssue]:
    """Return issues of rhythm, angles and legs' phases; few cycles are one without a message."""
    phases, x, warp = cycles.phases, cycles.x, cycles.warp
    few = [] if warp.cycles >= RELIABLE_CYCLES else [QualityIssue('', FEW_CYCLES_FACTOR)]
    return [*check_rhythm(warp.frequency, phases, x, cycles.average.coefficients),
            *check_angles(cycles.names, mean), *check_legs(vague), *check_sway(ahead, mean),
            *check_change(phases, x, leading, cycles.names,
                          lambda part: match_gait(part, kind).gait), *few]


def _decide(gait: GaitMatch, kind: type[Network], signals: tuple[
        dict[str, np.ndarray], Mapping[str, int] | None, Mapping[str, complex] | None],
        contacts: FootContacts | None, falls: float | None, gait_name: str) -> GaitMatch:
    """Decide between gaits that move the legs alike.

    Args:
        gait: by the legs' phases.
        kind: network.
        signals: harmonics of the joints, and cells and gains as of find_stride.
        contacts: of the feet.
        falls: fraction of the stride in which the body falls freely.
        gait_name: the gait, if it is given.

    """
    coefficients, cells, gains = signals
    if cells is not None and gains is not None and len(gait.candidates) > 1:
        by_cells = _cell_signals(coefficients, cells, gains, kind)
        if by_cells is not None:
            gait = match_gait_by_cells(by_cells, kind)
    gait = walk_or_run(gait, contacts, falls)
    if not gait_name:
        return gait
    gait = replace(gait, probability=1.0)
    return (replace(gait, gait=gait_name, nearest=gait_name, candidates=(gait_name,))
            if gait_name in gait.candidates else gait)


def _phase(times: np.ndarray, x: np.ndarray, rough: RoughPhase, source: str) -> PhaseEstimate:
    """Return the phase in a stretch, if enough of its cycles are alike."""
    warp = estimate_phase(times, x, rough)
    if warp.cycles < MIN_CYCLES:
        raise NoSteadyGait(f'{source}: no steady gait: only {warp.cycles:.2f} cycles of '
                           f'{1.0 / warp.frequency:.3g} s are alike, {MIN_CYCLES:g} are needed: '
                           f'record {RELIABLE_CYCLES:g} strides or more, '
                           f'{RELIABLE_CYCLES / warp.frequency:.3g} s')
    return warp


def _average(phases: np.ndarray, x: np.ndarray, leading: list[int], frequency: float, source: str
             ) -> PhaseAverage:
    """Return the mean cycle, if it explains enough of the motion."""
    try:
        average = average_cycles(phases, x, np.arange(POINTS) / POINTS, leading)
    except InputError as error:
        raise NoSteadyGait(f'{source}: {error}') from error
    power = np.array([np.nanvar(column) for column in x.T])
    residual = float(np.sum(average.residual * power) / np.sum(power))
    if residual > MAX_RESIDUAL_VARIANCE:
        raise NoSteadyGait(f'{source}: no steady gait: the mean cycle, of {1.0 / frequency:.3g} s,'
                           f' leaves {100.0 * residual:.0f} % of the variance')
    return average


def _travel(body: np.ndarray | None, warp: PhaseEstimate) -> float:
    """Return by how much the body goes on in a stride, m, 0 if that is not known."""
    if body is None:
        return 0.0
    return float(np.linalg.norm(np.ptp(body[:, :2], axis=0)) / warp.cycles)


def _regions(times: np.ndarray, x: np.ndarray, source: str) -> tuple[RoughPhase, list[str]]:
    """Find the longest stretch of steady motion; return it, and notes on the others."""
    reach = np.nanmax(x, axis=0) - np.nanmin(x, axis=0)
    if reach.max() < MIN_JOINT_RANGE:
        raise NoSteadyGait(f'{source}: no steady gait: the joints stand, none moves by more than '
                           f'{reach.max():.2g} rad')
    rate = min(MIN_LAG * MAX_FREQUENCY, OVERSAMPLING / float(np.median(np.diff(times))))
    stretches = find_stretches(*resample_evenly(times, x, rate))
    if not stretches:
        raise NoSteadyGait(f'{source}: no steady gait: the joints move by up to '
                           f'{reach.max():.2g} rad, but no stride of up to '
                           f'{times[-1] / MIN_CYCLES:.3g} s repeats for {MIN_CYCLES:g} cycles'
                           + _hint(times, x, reach))
    regions: list[tuple[RoughPhase, float]] = []
    largest = max(stretch.size for stretch in stretches)
    for _ in range(MAX_SEEDS):
        if not stretches:
            break
        seed = best_stretch(stretches)
        # Two strides may be alike by chance, if not in all joints.
        if seed.cycles >= RELIABLE_CYCLES or seed.difference <= MAX_DIFFERENCE:
            regions.append((grow_stretch(times, x, seed), seed.period))
            stretches = [stretch for stretch in stretches if stretch.outside(regions[-1][0].begin,
                                                         regions[-1][0].end)]
        stretches = [stretch for stretch in stretches if stretch.outside(seed.begin, seed.end)
                 and stretch.cycles >= MIN_OTHER_CYCLES and stretch.size >= 0.5 * largest]
    if not regions:
        raise NoSteadyGait(f'{source}: no steady gait: the joints repeat their motion '
                           f'only roughly, for {seed.cycles:.1f} cycles of '
                           f'{seed.period:.3g} s: record {RELIABLE_CYCLES:g} strides or more')
    regions.sort(key=lambda stretch: stretch[0].begin - stretch[0].end)
    rough = regions[0][0]
    notes = [f'another steady stretch, of {1.0 / period:.3g} Hz from {other.begin:.2f} to '
             f'{other.end:.2f} s, is shorter and left out' for other, period in regions[1:]
             if (min(other.end, rough.end) - max(other.begin, rough.begin)
                 < 0.5 * (other.end - other.begin))
             and other.end - other.begin >= MIN_OTHER_CYCLES * period]
    return rough, notes


def _hint(times: np.ndarray, x: np.ndarray, reach: np.ndarray) -> str:
    """Return a remedy where joints do not repeat: another unit, or more strides."""
    if reach.max() > MAX_JOINT_RANGE:
        return ': if the angles are in degrees, declare it (--unit deg)'
    # Half a stride is at least as long as the slowest joint takes from its least to its largest.
    indices = [np.flatnonzero(np.isfinite(column)) for column in x.T]
    half = max(abs(float(times[at[np.argmax(column[at])]] - times[at[np.argmin(column[at])]]))
               for at, column in zip(indices, x.T, strict=True))
    if times[-1] > 2.0 * MIN_CYCLES * half:
        return ''
    return (f': it lasts {times[-1]:.3g} s, which may be a single stride: record '
            f'{RELIABLE_CYCLES:g} or more, {2.0 * RELIABLE_CYCLES * half:.2g} s or longer')


def _cell_signals(c: Mapping[str, np.ndarray], cells: Mapping[str, int],
                  gains: Mapping[str, complex], network: type[Network]) -> np.ndarray | None:
    """Return the coefficients of every cell's signal, None unless every cell has a joint."""
    cell_of = {name: cell for name, cell in cells.items()
             if name in c and abs(gains.get(name, 0.0)) > 0.0}
    signals = []
    for cell in range(1, network.cells + 1):
        names = [name for name, one in cell_of.items() if one == cell]
        if not names:
            return None
        # The joint that moves most stands for the cell.
        name = max(names, key=lambda one: float(np.abs(c[one][1])))
        gain, n = complex(gains[name]), np.arange(c[name].size)
        signals.append(np.where(n > 0, c[name], 0.0)
                       / np.where(n > 0, gain.real + 1j * n * gain.imag, 1.0))
    return np.stack(signals, axis=1)
